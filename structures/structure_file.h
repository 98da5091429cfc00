// Built structures in files: saved once, loaded in place of a build wherever the same mesh, settings and layout meet
// again.
//
// A file is a header (StructureFileHeader in the .cpp: magic, version, byte order, size, checksum, the mesh's hash, the
// program's), the names of structure, builder, leaf and parameters, and what the structure's archive() wrote. The
// checksum is CRC-64 over CRC-64s of 4 MiB pieces (ECMA-182's polynomial), so that any flipped byte is noticed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "structures/accel.h"

namespace arboretum {

/// Tells meshes apart: CRC-64 of vertices and indices, which is what a structure depends on (materials are not).
[[nodiscard]] std::uint64_t hash_of(const TriangleMesh& mesh);
/// `bins=32 traversal_cost=1 ...`: every builder parameter.
[[nodiscard]] std::string text_of(const BuilderParameters& parameters);

/// Tells programs apart that might build another structure from the same mesh and settings: a digest of the running
/// program's file, which holds the project's builders and those of structures of one's own, and of Embree's library
/// where it is loaded. Whatever changes in the program changes it.
[[nodiscard]] std::uint64_t program_digest();

/// A file name that says all that must fit: structure, builder, leaf, and hashes of mesh and parameters.
[[nodiscard]] std::string structure_file_name(std::string_view name, const TriangleMesh& mesh,
                                              const BuildSettings& settings);

/// Writes the structure, built from `mesh` with `settings`. The file is there whole or not at all. Throws UserError
/// where it cannot be written, and for structures that cannot be saved (embree). (`accel` is not changed: archive() is
/// one function for both directions, so it is not const.)
void save_structure(Accel& accel, const TriangleMesh& mesh, const BuildSettings& settings,
                    const std::filesystem::path& file);

/// A structure that another build of the program saved answers as well as one of this; what is measured on it says
/// nothing of this one's builders.
enum class BuiltBy { any_program, this_program };

/// Reads a structure back: the one of that name, built from an equal mesh with equal builder, leaf and parameters
/// (threads, instruction set and parameters that the build does not read do not matter). The mesh must outlive it.
/// Throws UserError, one line, where the file is missing, none of ours, of another version or byte order, truncated,
/// damaged, or of another structure, settings, mesh or (where `by` says so) program.
[[nodiscard]] std::unique_ptr<Accel> load_structure(std::string_view name, const TriangleMesh& mesh,
                                                    const BuildSettings& settings, const std::filesystem::path& file,
                                                    BuiltBy by = BuiltBy::any_program);

}  // namespace arboretum
