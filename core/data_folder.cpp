#include "core/data_folder.h"

#include <cstdlib>
#include <string>
#include <system_error>

#include "core/error.h"

namespace arboretum {
namespace {

bool holds_data(const std::filesystem::path& folder) {
  std::error_code error;
  return std::filesystem::is_regular_file(folder / "scenes" / "catalogue.yaml", error);
}

std::filesystem::path beside_program() {
  std::error_code error;
  return std::filesystem::read_symlink("/proc/self/exe", error).parent_path();
}

}  // namespace

std::filesystem::path program_data_folder() {
  const std::filesystem::path beside = beside_program();
  for (const char* way : {"share/arboretum", "../share/arboretum", ARBORETUM_DATA_FROM_BINARY}) {
    std::filesystem::path folder = (beside / way).lexically_normal();
    if (holds_data(folder)) return folder;
  }
  return {};
}

std::filesystem::path data_folder() {
  if (const char* chosen = std::getenv("ARBORETUM_DATA"); chosen && *chosen) {
    if (holds_data(chosen)) return chosen;
    throw UserError(std::string("ARBORETUM_DATA=") + chosen +
                    ": no scenes/catalogue.yaml there; name the share/arboretum of an installation, or unset it");
  }
  if (std::filesystem::path folder = program_data_folder(); !folder.empty()) return folder;
  const std::filesystem::path beside = beside_program();
  throw UserError("no share/arboretum with scenes/catalogue.yaml near " +
                  (beside.empty() ? std::string("the executable") : beside.string()) +
                  "; set ARBORETUM_DATA to that folder of an installation or a build");
}

}  // namespace arboretum
