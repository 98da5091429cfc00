#include "experiments/machine_info.h"

#include <benchmark/benchmark.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <memory>
#include <thread>

#include "core/data_folder.h"
#include "experiments/build_info.h"
#include "structures/accel.h"

namespace arboretum {
namespace {

/// First line of a file whose key matches, as in `model name : AMD`; empty where there is none.
std::string field_of(const char* path, std::string_view key) {
  std::ifstream stream(path);
  for (std::string line; std::getline(stream, line);) {
    if (!line.starts_with(key)) continue;
    const std::size_t value = line.find_first_not_of(" \t", line.find(':') + 1);
    return value == std::string::npos ? "" : line.substr(value);
  }
  return {};
}

std::string first_line(const char* path) {
  std::ifstream stream(path);
  std::string line;
  std::getline(stream, line);
  return line;
}

/// Output of git in the folder; empty when there is no git or no repository. Arguments are constants of ours.
std::string git(const std::filesystem::path& folder, const std::string& arguments) {
  std::string quoted = folder.string();
  for (std::size_t i = 0; (i = quoted.find('\'', i)) != std::string::npos; i += 4) quoted.replace(i, 1, "'\\''");
  const std::string command = fmt::format("git -c safe.directory='*' -C '{}' {} 2>/dev/null", quoted, arguments);
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> pipe(::popen(command.c_str(), "r"), ::pclose);
  std::string text;
  char buffer[256];
  while (pipe && std::fgets(buffer, sizeof buffer, pipe.get())) text += buffer;
  while (text.ends_with('\n')) text.pop_back();
  return text;
}

/// Whether a source of the program is newer than the program, which then was not built from what stands there.
bool is_older_than(const std::filesystem::path& source) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::file_time_type built = fs::last_write_time("/proc/self/exe", error);
  if (error) return false;
  constexpr std::string_view kFolders[] = {"core",   "simd",   "structures", "traversal", "intersectors",
                                           "scenes", "oracle", "library",    "rendering", "experiments"};
  for (const std::string_view folder : kFolders) {
    for (fs::recursive_directory_iterator file(source / folder, error), end; !error && file != end;
         file.increment(error)) {
      const fs::path ending = file->path().extension();
      if ((ending == ".h" || ending == ".cpp") && file->last_write_time(error) > built) return true;
    }
  }
  return false;
}

struct Revision {
  std::string hash;
  bool dirty = false;  ///< files differ from that revision, or the program is older than they are
};

/// Of what was compiled: of the sources that the program's own build tree links to, else what was written down when it
/// was installed. Only a program that has neither beside it (one with structures of its own) asks the folder that
/// ARBORETUM_DATA names.
Revision revision() {
  const std::filesystem::path own = program_data_folder(), data = own.empty() ? data_folder() : own;
  Revision r;
  if (std::filesystem::exists(data / "source")) {
    r.hash = git(data / "source", "rev-parse HEAD");
    r.dirty = !r.hash.empty() && (!git(data / "source", "status --porcelain --untracked-files=no").empty() ||
                                  is_older_than(data / "source"));
  } else {
    std::ifstream stream(data / "revision");
    std::string word;
    stream >> r.hash >> word;
    r.dirty = word == "dirty";
  }
  return r;
}

}  // namespace

Json machine_context(const Experiment& experiment, const std::string& configuration_hash, const std::string& command) {
  Json context = Json::object();
  const std::time_t now = std::time(nullptr);
  const benchmark::CPUInfo& cpu = benchmark::CPUInfo::Get();
  context["date"] = fmt::format("{:%Y-%m-%dT%H:%M:%S+00:00}", fmt::gmtime(now));
  context["host_name"] = benchmark::SystemInfo::Get().name;
  context["executable"] = "arboretum";
  context["num_cpus"] = cpu.num_cpus;
  context["mhz_per_cpu"] = static_cast<int>(cpu.cycles_per_second / 1e6);
  context["cpu_scaling_enabled"] = cpu.scaling == benchmark::CPUInfo::ENABLED;
  Json& caches = context["caches"] = Json::array();
  for (const auto& cache : cpu.caches) {
    caches.push_back(
        {{"type", cache.type}, {"level", cache.level}, {"size", cache.size}, {"num_sharing", cache.num_sharing}});
  }
  context["load_avg"] = cpu.load_avg;

  context["experiment"] = experiment.name;
  context["command"] = command;
  const std::string model = field_of("/proc/cpuinfo", "model name");
  context["cpu"] = model.empty() ? "unknown" : model;
  Json& isas = context["isa"] = Json::array();
  for (Isa isa : available_isas()) isas.push_back(to_string(isa));
  context["cores"] = std::max(1u, std::thread::hardware_concurrency());
  const std::string governor = first_line("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor");
  context["governor"] = governor.empty() ? "unknown" : governor;
  context["load"] = first_line("/proc/loadavg");
  context["memory_bytes"] =
      static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) * static_cast<std::uint64_t>(::sysconf(_SC_PAGE_SIZE));
  utsname system{};
  if (::uname(&system) == 0)
    context["system"] = fmt::format("{} {} {}", system.sysname, system.release, system.machine);
  context["compiler"] = build_info::kCompiler;
  context["compiler_flags"] = build_info::kFlags;
  context["build_type"] = build_info::kBuildType;
  context["version"] = build_info::kVersion;
  if (const StructureEntry* embree = find_structure("embree")) context["embree"] = embree->info.library;
  const Revision at = revision();
  context["git_revision"] = at.hash.empty() ? "unknown" : at.hash;
  context["git_dirty"] = at.dirty;
  context["configuration_hash"] = configuration_hash;
  context["seed"] = experiment.measure.seed;
  context["plots"] = experiment.plots;
  return context;
}

}  // namespace arboretum
