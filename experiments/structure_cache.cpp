#include "experiments/structure_cache.h"

#include <fmt/format.h>

#include <system_error>

#include "core/error.h"
#include "structures/structure_file.h"

namespace arboretum {

StructureCache::StructureCache(std::filesystem::path folder, NoteFunction note)
    : folder_(std::move(folder)), note_(std::move(note)) {
  if (!folder_.empty()) (void)program_digest();  // takes some tenths of a second once, which are no part of a load
}

std::unique_ptr<Accel> StructureCache::find(std::string_view structure, const TriangleMesh& mesh,
                                            const BuildSettings& settings) {
  if (folder_.empty()) return nullptr;
  const std::filesystem::path file = folder_ / structure_file_name(structure, mesh, settings);
  std::error_code ignored;
  if (!std::filesystem::exists(file, ignored)) return nullptr;
  try {
    return load_structure(structure, mesh, settings, file, BuiltBy::this_program);
  } catch (const UserError& e) {
    note_(fmt::format("{} (built anew now)", e.what()));
    return nullptr;
  }
}

void StructureCache::keep(Accel& accel, const TriangleMesh& mesh, const BuildSettings& settings) {
  if (folder_.empty()) return;
  try {
    std::error_code ignored;  // save_structure() says what is wrong with the folder
    std::filesystem::create_directories(folder_, ignored);
    save_structure(accel, mesh, settings, folder_ / structure_file_name(accel.info().name, mesh, settings));
  } catch (const UserError& e) {
    if (noted_.insert(e.what()).second) note_(fmt::format("structure_cache: {}", e.what()));
  }
}

}  // namespace arboretum
