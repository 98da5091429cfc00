#include "structures/structure_file.h"

#include <link.h>
#include <tbb/parallel_for.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <boost/crc.hpp>
#include <boost/interprocess/file_mapping.hpp>
#include <boost/interprocess/mapped_region.hpp>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <functional>
#include <map>
#include <span>
#include <sstream>
#include <string>
#include <system_error>
#include <type_traits>
#include <vector>

#include "core/error.h"
#include "core/instances.h"
#include "core/whole_file.h"
#include "structures/archive.h"
#include "structures/own_parameters.h"
#include "structures/parameter_limits.h"
#include "structures/parameters_read.h"

namespace arboretum {
namespace {

using Bytes = std::span<const std::byte>;
using Crc64 = boost::crc_optimal<64, 0x42f0e1eba9ea3693u, ~std::uint64_t{0}, ~std::uint64_t{0}, true, true>;

constexpr std::uint32_t kVersion = 3;
constexpr std::uint32_t kByteOrder = 0x01020304;
constexpr std::array<char, 8> kMagic{'a', 'r', 'b', 'o', 't', 'r', 'e', 'e'};

/// The first bytes of a file; the archive follows.
struct StructureFileHeader {
  std::array<char, 8> magic = kMagic;
  std::uint32_t version = kVersion;
  std::uint32_t byte_order = kByteOrder;
  std::uint64_t file_bytes = 0;
  std::uint64_t checksum = 0;  ///< of the whole file, this field taken as 0
  std::uint64_t mesh_hash = 0, mesh_vertices = 0, mesh_triangles = 0;
  std::uint64_t program = 0;  ///< program_digest() of what built it
};
static_assert(sizeof(StructureFileHeader) == 64 && offsetof(StructureFileHeader, checksum) == 24);

std::uint64_t crc_of_pieces(Bytes bytes) {
  constexpr std::size_t kPiece = std::size_t{4} << 20;
  std::vector<std::uint64_t> sums((bytes.size() + kPiece - 1) / kPiece);
  tbb::parallel_for(std::size_t{0}, sums.size(), [&](std::size_t i) {
    const Bytes piece = bytes.subspan(i * kPiece, std::min(kPiece, bytes.size() - i * kPiece));
    Crc64 crc;
    crc.process_bytes(piece.data(), piece.size());
    sums[i] = crc.checksum();
  });
  Crc64 crc;
  crc.process_bytes(sums.data(), sums.size() * sizeof(std::uint64_t));
  return crc.checksum();
}

std::uint64_t checksum_of(StructureFileHeader header, Bytes file) {
  header.checksum = 0;
  const std::uint64_t sums[] = {crc_of_pieces(std::as_bytes(std::span(&header, 1))),
                                crc_of_pieces(file.subspan(sizeof header))};
  return crc_of_pieces(std::as_bytes(std::span(sums)));
}

/// The file's bytes as the system maps them.
class MappedFile {
 public:
  explicit MappedFile(const std::filesystem::path& file)
      : region_(boost::interprocess::file_mapping(file.c_str(), boost::interprocess::read_only),
                boost::interprocess::read_only) {}
  [[nodiscard]] Bytes bytes() const {
    return {static_cast<const std::byte*>(region_.get_address()), region_.get_size()};
  }

 private:
  boost::interprocess::mapped_region region_;
};

StructureFileHeader header_of(const TriangleMesh& mesh) {
  StructureFileHeader header;
  header.mesh_hash = hash_of(mesh), header.mesh_vertices = mesh.vertices.size(),
  header.mesh_triangles = mesh.triangles.size();
  return header;
}

/// What of the settings' parameters the structure depends on.
std::string parameters_of(const StructureInfo& info, const BuildSettings& settings) {
  return info.uses_parameters ? text_of(settings.parameters) : std::string();
}

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& why) {
  throw UserError((file.empty() ? "a path without a name" : file.string()) + ": " + why);
}

/// What a header is wrong in, before anything behind it is looked at.
void check_header(const std::filesystem::path& file, const StructureFileHeader& header, std::uint64_t bytes) {
  if (header.magic != kMagic) refuse(file, "is no saved structure; give a file that arboretum saved");
  if (header.byte_order != kByteOrder)
    refuse(file, "was saved on a machine of the other byte order, or is damaged; build and save it again");
  if (header.version != kVersion) {
    refuse(file, "is of format version " + std::to_string(header.version) + ", this build reads version " +
                     std::to_string(kVersion) + "; build and save it again");
  }
  if (bytes < header.file_bytes) {
    refuse(file, "is truncated: " + std::to_string(bytes) + " of " + std::to_string(header.file_bytes) +
                     " bytes; build and save it again");
  }
}

using Words = std::map<std::string, std::string, std::less<>>;

/// What text_of() wrote, by name.
Words values_of(const std::string& text) {
  Words values;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    const std::size_t end = word.find('=');
    values[word.substr(0, end)] = end == std::string::npos ? "" : word.substr(end + 1);
  }
  return values;
}

/// The row of that parameter, but of a structure's own; nullptr where there is none.
const Parameter<BuilderParameters>* find_parameter(std::string_view name) {
  const auto table = builder_parameter_table();
  const auto row = std::ranges::find(table, name, &Parameter<BuilderParameters>::name);
  return row == table.end() ? nullptr : &*row;
}

/// The parameter's value as a user writes it. One that the text leaves out is a structure's own, and has its default.
std::string value_in(const Words& values, std::string_view name) {
  const auto value = values.find(name);
  if (value == values.end()) {
    const OwnParameter* own = find_own_parameter(name);
    return own ? text_of(own->initial) : "none";
  }
  const auto* parameter = find_parameter(name);
  const bool is_own = parameter && parameter->has_own && value->second == std::to_string(BuilderParameters::kOwn);
  return is_own ? "auto" : value->second;
}

/// "bins 32, here 16; collapse optimal, here greedy": what the file was built with otherwise than wanted, of the
/// parameters that the build reads and of names that this program does not know. Empty where it is the same.
std::string other_parameters(const std::string& saved, const StructureInfo& info, const BuildSettings& settings) {
  const Words before = values_of(saved), here = values_of(parameters_of(info, settings));
  Words all = before;
  all.insert(here.begin(), here.end());
  const auto read = parameters_read(info.name, settings.builder, settings.parameters.below);
  std::string others;
  for (const auto& parameter : all) {
    const std::string& name = parameter.first;
    const bool known = find_own_parameter(name) || find_parameter(name);
    if (known && read && std::ranges::find(*read, name) == read->end()) continue;
    const std::string one = value_in(before, name), other = value_in(here, name);
    if (one != other) others += (others.empty() ? "" : "; ") + name + " " + one + ", here " + other;
  }
  return others;
}

/// What tells the meshes apart, where their hashes are not the same.
std::string other_mesh(const StructureFileHeader& saved, const StructureFileHeader& here) {
  if (saved.mesh_triangles != here.mesh_triangles)
    return std::to_string(saved.mesh_triangles) + " triangles, this one has " + std::to_string(here.mesh_triangles);
  if (saved.mesh_vertices != here.mesh_vertices)
    return std::to_string(saved.mesh_vertices) + " vertices, this one has " + std::to_string(here.mesh_vertices);
  return "as many triangles, but other positions, indices, key frames or instances";
}

/// Names in the file, in this order: what `archive` reads is compared with what is wanted.
void check_name(const std::filesystem::path& file, Archive& archive, const char* what, std::string_view wanted) {
  std::string saved;
  archive(saved);
  if (saved != wanted) {
    refuse(file, std::string("holds ") + what + " '" + saved + "', not '" + std::string(wanted) +
                     "'; ask for what it holds, or build anew");
  }
}

void write_archive(Accel& accel, const TriangleMesh& mesh, const BuildSettings& settings,
                   const std::filesystem::path& file) {
  StructureFileHeader header = header_of(mesh);
  header.program = program_digest();
  std::fstream stream(file, std::ios::binary | std::ios::in | std::ios::out | std::ios::trunc);
  stream.write(reinterpret_cast<const char*>(&header), sizeof header);
  Archive archive(stream, mesh);
  std::string name(accel.info().name), builder = settings.builder, leaf = settings.leaf,
                                       parameters = parameters_of(accel.info(), settings);
  archive(name, builder, leaf, parameters);
  accel.archive(archive);
  header.file_bytes = static_cast<std::uint64_t>(stream.tellp());
  stream.flush();
  if (stream) {
    header.checksum = checksum_of(header, MappedFile(file).bytes());
    stream.seekp(0);
    stream.write(reinterpret_cast<const char*>(&header), sizeof header);
    stream.close();
  }
  if (!stream) throw std::ios_base::failure("write failed");
}

/// No two savings have the same, whatever process and thread they are of.
std::filesystem::path unfinished_name(const std::filesystem::path& file) {
  static std::atomic<std::uint64_t> next{0};
  return file.string() + "." + std::to_string(::getpid()) + "." + std::to_string(next++) + ".unfinished";
}

}  // namespace

std::string text_of(const BuilderParameters& parameters) {
  std::string text;
  const auto add = [&](std::string_view name, const ParameterValue& value) {
    text.append(text.empty() ? "" : " ").append(name).append("=").append(text_of(value));
  };
  for (const Parameter<BuilderParameters>& parameter : builder_parameter_table()) {
    const auto value = [&](auto member) -> ParameterValue { return parameters.*member; };
    add(parameter.name, std::visit(value, parameter.member));
  }
  for (const auto& [name, value] : parameters.own) add(name, value);
  return text;
}

std::uint64_t hash_of(const TriangleMesh& mesh) {
  std::vector<std::uint64_t> parts{mesh.vertices.size(), mesh.triangles.size(),
                                   crc_of_pieces(std::as_bytes(std::span(mesh.vertices))),
                                   crc_of_pieces(std::as_bytes(std::span(mesh.triangles)))};
  for (const std::vector<Vec3f>& frame : mesh.later_frames)
    parts.push_back(crc_of_pieces(std::as_bytes(std::span(frame))));
  if (mesh.instancing) {
    parts.push_back(crc_of_pieces(std::as_bytes(std::span(mesh.instancing->instances))));
    for (const TriangleMesh& prototype : mesh.instancing->prototypes) parts.push_back(hash_of(prototype));
  }
  return crc_of_pieces(std::as_bytes(std::span(parts)));
}

std::uint64_t program_digest() {
  static const std::uint64_t digest = [] {
    std::vector<std::filesystem::path> files{"/proc/self/exe"};
    const auto add = [](dl_phdr_info* object, std::size_t, void* to) {
      if (std::string_view(object->dlpi_name).find("embree") != std::string_view::npos)
        static_cast<std::vector<std::filesystem::path>*>(to)->emplace_back(object->dlpi_name);
      return 0;
    };
    ::dl_iterate_phdr(add, &files);
    std::vector<std::uint64_t> sums;
    for (const std::filesystem::path& file : files) {
      try {
        sums.push_back(crc_of_pieces(MappedFile(file).bytes()));
      } catch (const boost::interprocess::interprocess_exception& e) {
        refuse(file, std::string("cannot be read: ") + e.what());
      }
    }
    return crc_of_pieces(std::as_bytes(std::span(sums)));
  }();
  return digest;
}

std::string structure_file_name(std::string_view name, const TriangleMesh& mesh, const BuildSettings& settings) {
  const StructureEntry* entry = find_structure(name);
  const std::string parameters = entry ? parameters_of(entry->info, settings) : std::string();
  char hashes[64];
  std::snprintf(hashes, sizeof hashes, "-%016llx-%08x.arbotree", static_cast<unsigned long long>(hash_of(mesh)),
                static_cast<unsigned>(crc_of_pieces(std::as_bytes(std::span(parameters)))));
  return std::string(name) + "-" + settings.builder + "-" + settings.leaf + hashes;
}

void save_structure(Accel& accel, const TriangleMesh& mesh, const BuildSettings& settings,
                    const std::filesystem::path& file) {
  const std::filesystem::path target = regular_file(file), unfinished = unfinished_name(target);
  try {
    write_archive(accel, mesh, settings, unfinished);
    std::filesystem::rename(unfinished, target);
  } catch (...) {
    std::error_code ignored;
    std::filesystem::remove(unfinished, ignored);
    constexpr const char* kWhy = "cannot be written; is the folder there, writable and not full?";
    try {
      throw;
    } catch (const std::system_error&) {  // of the stream or of the rename
      refuse(file, kWhy);
    } catch (const boost::interprocess::interprocess_exception&) {  // when it is read again for its checksum
      refuse(file, kWhy);
    }
  }
}

std::unique_ptr<Accel> load_structure(std::string_view name, const TriangleMesh& mesh, const BuildSettings& settings,
                                      const std::filesystem::path& file, BuiltBy by) {
  const StructureEntry* entry = find_structure(name);
  if (!entry) throw UserError("there is no structure '" + std::string(name) + "'; see `arboretum list structures`");
  std::error_code error;
  const std::uint64_t size =
      std::filesystem::is_regular_file(file, error) ? std::filesystem::file_size(file, error) : 0;
  if (error || !std::filesystem::is_regular_file(file, error))
    refuse(file, "is no file; build and save the structure first");
  if (size < sizeof(StructureFileHeader))
    refuse(file, "is no saved structure: too short; give a file that arboretum saved");
  std::unique_ptr<MappedFile> mapped;
  try {
    mapped = std::make_unique<MappedFile>(file);
  } catch (const boost::interprocess::interprocess_exception& e) {
    refuse(file, std::string("cannot be read: ") + e.what());
  }
  const Bytes bytes = mapped->bytes();
  StructureFileHeader header;
  std::memcpy(&header, bytes.data(), sizeof header);
  check_header(file, header, bytes.size());
  if (bytes.size() != header.file_bytes || checksum_of(header, bytes) != header.checksum)
    refuse(file, "is damaged: its checksum does not fit; build and save it again");
  if (by == BuiltBy::this_program && header.program != program_digest())
    refuse(file, "was built by another build of the program, whose builders may be others; build and save it again");

  Archive archive(bytes.subspan(sizeof header), mesh);
  check_name(file, archive, "structure", name);
  check_name(file, archive, "builder", settings.builder);
  check_name(file, archive, "leaf", settings.leaf);
  std::string parameters;
  archive(parameters);
  if (const std::string others = other_parameters(parameters, entry->info, settings); !others.empty())
    refuse(file, "holds other parameters (" + others + "); ask for what it holds, or build anew");
  const StructureFileHeader wanted = header_of(mesh);
  if (header.mesh_hash != wanted.mesh_hash || header.mesh_vertices != wanted.mesh_vertices ||
      header.mesh_triangles != wanted.mesh_triangles) {
    refuse(file, "was built from another mesh (" + other_mesh(header, wanted) +
                     "); load it with the mesh that it was built from");
  }
  std::unique_ptr<Accel> accel = entry->create();
  try {
    accel->archive(archive);
    if (archive.rest() > 0)
      throw UserError(
          "was saved by another build of arboretum: it holds more than this structure reads; build and save it again");
  } catch (const UserError& e) {
    refuse(file, e.what());
  }
  return accel;
}

}  // namespace arboretum
