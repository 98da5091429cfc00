# Structures and the executables that have them. Comes with the source tree and with the installed package.
#
# A structure is a folder <folder>/ with <name>.h, which says `using Structures = TypeList<...>;` in namespace
# arboretum::<folder>, its .cpp files, <name>_kernels.h, and, where it says something of its builders, <name>_parameters.h. For each of its types and each instruction set a kernel unit is
# generated; a generated registry.cpp says which structures and kernels an executable has. What the functions below hand to
# each other is a record `<header as included>|<folder>|<types, comma-separated>|<yes where there is a <name>_parameters.h>`.
#
#   arboretum_read_structure(<out> <header> <as included>)     the record of a structure's header
#   arboretum_kernel_units(<out> <folder> <record>...)         writes kernel units into <folder>, sets their compile options
#   arboretum_registry(<file> <record>...)                     writes registry.cpp
#   arboretum_executable(<target> STRUCTURES <folder>... [LIBRARIES <library>...])
#                                                              an `arboretum` of one's own (docs/add-a-structure.md)
#   arboretum_kernel_tests(<target> STRUCTURES <folder>... [LIBRARIES <library>...])
#                                                              the tests of its kernels
#   arboretum_add_structures(<target> <folder>...)             structures for any other executable

# Writes only what changed, so that a configure run rebuilds nothing.
function(arboretum_write path content)
  if(EXISTS "${path}")
    file(READ "${path}" old)
    if(old STREQUAL content)
      return()
    endif()
  endif()
  file(WRITE "${path}" "${content}")
endfunction()

# The headers that a list of them, <folder>/all.h, includes, as they are included. `form`: what stands for them in a message.
function(arboretum_read_all out folder form)
  set(all ${PROJECT_SOURCE_DIR}/${folder}/all.h)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${all})
  file(STRINGS ${all} lines REGEX "^#include \"${folder}/")
  string(REGEX REPLACE "<[a-z]+>" "[a-z0-9_]+" pattern "${form}")
  set(headers "")
  foreach(line IN LISTS lines)
    if(NOT line MATCHES "\"(${folder}/${pattern}\\.h)\"")
      message(FATAL_ERROR "${folder}/all.h: cannot read '${line}'; write #include \"${folder}/${form}.h\"")
    endif()
    list(APPEND headers ${CMAKE_MATCH_1})
  endforeach()
  set(${out} "${headers}" PARENT_SCOPE)
endfunction()

# A function of another name would never be called, and the structure be silently without what it says.
function(arboretum_check_parameters file)
  set(names builder_parameters builder_summary own_parameters)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${file}")
  file(READ "${file}" text)
  string(REGEX REPLACE "//[^\n]*" "" text "${text}")
  string(REGEX MATCHALL "[A-Za-z0-9_]+[ \n]*\\([ \n]*(const[ \n]+)?(std::)?type_identity<" functions "${text}")
  list(TRANSFORM functions REPLACE "[^A-Za-z0-9_].*" "")
  foreach(name IN LISTS functions)
    if(NOT name IN_LIST names)
      list(JOIN names ", " valid)
      message(FATAL_ERROR "${file}: ${name}(std::type_identity<...>) would never be called: what a structure says of its builders, it says in ${valid} (docs/add-a-structure.md)")
    endif()
  endforeach()
  if(NOT functions)
    list(JOIN names ", " valid)
    message(FATAL_ERROR "${file}: declares none of ${valid} of a std::type_identity<...> (docs/add-a-structure.md)")
  endif()
endfunction()

function(arboretum_read_structure out header include)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${header}")
  get_filename_component(folder "${header}" DIRECTORY)
  get_filename_component(folder "${folder}" NAME)
  file(READ "${header}" text)
  if(NOT text MATCHES "using Structures = TypeList<([A-Za-z0-9_, \n]+)>;")
    message(FATAL_ERROR "${header}: no line 'using Structures = TypeList<...>;'")
  endif()
  string(REGEX MATCHALL "[A-Za-z0-9_]+" types "${CMAKE_MATCH_1}")
  list(JOIN types "," types)
  string(REGEX REPLACE "\\.h$" "_parameters.h" parameters "${header}")
  file(GLOB parameters CONFIGURE_DEPENDS "${parameters}")  # seen when it comes and when it goes
  if(parameters)
    arboretum_check_parameters("${parameters}")
    set(parameters yes)
  endif()
  set(${out} "${include}|${folder}|${types}|${parameters}" PARENT_SCOPE)
endfunction()

# Sets <prefix>_header, _folder, _types and _parameters in the caller.
macro(arboretum_split_record prefix record)
  string(REPLACE "|" ";" ${prefix}_parts "${record}")
  list(GET ${prefix}_parts 0 ${prefix}_header)
  list(GET ${prefix}_parts 1 ${prefix}_folder)
  list(GET ${prefix}_parts 2 ${prefix}_types)
  string(REPLACE "," ";" ${prefix}_types "${${prefix}_types}")
  list(GET ${prefix}_parts 3 ${prefix}_parameters)
endmacro()

# Compile options of a generated unit for an instruction set.
function(arboretum_kernel_options unit isa)
  # GCC's own AVX-512 headers set off -Wmaybe-uninitialized.
  # A copy of a kernel for each constant that it is called with would take a fifth of the compile time and gain nothing.
  set(options "-Wno-uninitialized;$<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>;$<$<CXX_COMPILER_ID:GNU>:-fno-ipa-cp-clone>")
  # The scalar kernels are the reference, not a race: unrolling their lane loops would cost a minute of compile time each.
  # Units of ISAs with FMA are scheduled for the machines that have it (2 to 3 % on incoherent rays); tuning uses no
  # instruction that the pragma does not allow.
  if(isa MATCHES "^avx")
    list(APPEND options "-mtune=haswell")
  elseif(isa STREQUAL "scalar")
    list(APPEND options "$<$<CONFIG:Release>:-O1>")
  endif()
  set_source_files_properties(${unit} PROPERTIES GENERATED ON COMPILE_OPTIONS "${options}")
endfunction()

function(arboretum_kernel_units out folder)
  set(units "")
  foreach(record IN LISTS ARGN)
    arboretum_split_record(s "${record}")
    string(REGEX REPLACE "\\.h$" "_kernels.h" kernels "${s_header}")
    foreach(type IN LISTS s_types)
      foreach(isa IN LISTS ARBORETUM_ISAS)
        string(TOUPPER ${isa} upper)
        set(function rows_of_${s_folder}_${type})
        set(unit ${folder}/${s_folder}_${type}_${isa}.cpp)
        arboretum_write(${unit}
"#define ARBORETUM_TARGET ARBORETUM_TARGET_${upper}
#include \"traversal/kernel_unit.h\"
#include \"${s_header}\"
#include \"simd/target_begin.h\"
#include \"simd/simd.h\"
#include \"${kernels}\"
#include \"simd/target_end.h\"

namespace arboretum::isa_${isa} {
void ${function}(KernelRows& rows);
void ${function}(KernelRows& rows) { add_kernels(std::type_identity<${s_folder}::${type}>{}, rows); }
}  // namespace arboretum::isa_${isa}
")
        arboretum_kernel_options(${unit} ${isa})
        list(APPEND units ${unit})
      endforeach()
    endforeach()
  endforeach()
  set(${out} ${units} PARENT_SCOPE)
endfunction()

function(arboretum_registry file)
  set(includes "")
  set(folders "")
  set(lists "")
  set(declarations "")
  set(calls "")
  foreach(record IN LISTS ARGN)
    arboretum_split_record(s "${record}")
    if(s_folder IN_LIST folders)
      message(FATAL_ERROR "two folders of structures are called '${s_folder}'; rename one, and its namespace")
    endif()
    list(APPEND folders ${s_folder})
    string(APPEND includes "#include \"${s_header}\"\n")
    if(s_parameters)
      string(REGEX REPLACE "\\.h$" "_parameters.h" parameters "${s_header}")
      string(APPEND includes "#include \"${parameters}\"\n")
    endif()
    list(APPEND lists "${s_folder}::Structures")
    foreach(type IN LISTS s_types)
      foreach(isa IN LISTS ARBORETUM_ISAS)
        set(function rows_of_${s_folder}_${type})
        string(APPEND declarations "namespace isa_${isa} { void ${function}(KernelRows& rows); }\n")
        string(APPEND calls "  if (cpu_supports(Isa::${isa})) isa_${isa}::${function}(rows);\n")
      endforeach()
    endforeach()
  endforeach()
  list(JOIN lists ", " lists)
  arboretum_write("${file}"
"// Made by cmake/ArboretumStructures.cmake: the structures of this executable and their kernels.
#include \"structures/registry.h\"
#include \"traversal/kernel_table.h\"
${includes}
namespace arboretum {
${declarations}
// What makes an instruction set's rows is itself compiled for it: elsewhere it must not run.
std::vector<StructureEntry> registered_structures() { return structure_entries(ConcatLists<${lists}>{}); }

std::vector<StructureBuilders> registered_builders() { return builders_entries(ConcatLists<${lists}>{}); }

std::vector<KernelRow> registered_kernels() {
  std::vector<KernelRow> rows;
${calls}  return rows;
}
}  // namespace arboretum
")
endfunction()

# Compiles a folder's structure and its kernels, once a project, as the object library arboretum_structure_<name>. Sets <out>
# to its record.
function(arboretum_own_structure out path)
  get_filename_component(path "${path}" ABSOLUTE)
  get_filename_component(name "${path}" NAME)
  if(NOT EXISTS "${path}/${name}.h")
    message(FATAL_ERROR "a structure's folder holds a header of its name: ${path} has no ${name}.h")
  endif()
  get_property(many_configurations GLOBAL PROPERTY GENERATOR_IS_MULTI_CONFIG)
  if(NOT CMAKE_BUILD_TYPE AND NOT many_configurations)
    message(FATAL_ERROR "${name}: CMAKE_BUILD_TYPE is empty, so its kernels would be compiled without optimisation, some twenty times slower than those they are measured beside; set it to Release")
  endif()
  arboretum_read_structure(record "${path}/${name}.h" "${path}/${name}.h")
  set(${out} "${record}" PARENT_SCOPE)
  set(library arboretum_structure_${name})
  if(TARGET ${library})
    return()
  endif()
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${path}/${name}_kernels.h")
  file(STRINGS "${path}/${name}_kernels.h" included REGEX "^#[ \t]*include[ \t]*<")
  if(included)
    list(GET included 0 included)
    message(FATAL_ERROR "${path}/${name}_kernels.h: '${included}' would be compiled for each instruction set and its code shared with all; put it into ${name}.h")
  endif()
  arboretum_kernel_units(units ${CMAKE_CURRENT_BINARY_DIR}/${library} "${record}")
  file(GLOB sources CONFIGURE_DEPENDS "${path}/*.cpp")
  add_library(${library} OBJECT ${sources} ${units})
  target_link_libraries(${library} PUBLIC arboretum::arboretum)
  # Includes as in the project's own structures: "structures/accel.h". What the options are for: cmake/ArboretumFlags.cmake.
  target_include_directories(${library} PRIVATE "${ARBORETUM_HEADERS}")
  target_compile_options(${library} PRIVATE -ffp-contract=off $<$<CXX_COMPILER_ID:Clang>:-fno-slp-vectorize>)
endfunction()

# Adds structures to an executable: it gets a registry of its own, with those of Arboretum and these. One folder a structure, absolute or
# relative to the current source folder; <folder>/<folder>.h is its header. With ARBORETUM_STRUCTURES set to fewer records in the
# caller, the executable has fewer of Arboretum's.
function(arboretum_add_structures target)
  set(records "")
  foreach(path IN LISTS ARGN)
    arboretum_own_structure(record "${path}")
    list(APPEND records "${record}")
    get_filename_component(name "${path}" NAME)
    target_link_libraries(${target} PRIVATE arboretum_structure_${name})
  endforeach()
  set(registry ${CMAKE_CURRENT_BINARY_DIR}/${target}_registry.cpp)
  arboretum_registry(${registry} ${ARBORETUM_STRUCTURES} ${records})
  target_sources(${target} PRIVATE ${registry})
  target_include_directories(${target} PRIVATE "${ARBORETUM_HEADERS}")
endfunction()

# What follows <target> in the arguments of the function `command` that calls it: words_STRUCTURES and words_LIBRARIES.
macro(arboretum_parse_words command)
  cmake_parse_arguments(PARSE_ARGV 1 words "" "" "STRUCTURES;LIBRARIES")
  if(words_UNPARSED_ARGUMENTS)
    message(FATAL_ERROR "${command}(${target}): unknown words '${words_UNPARSED_ARGUMENTS}'; use STRUCTURES <folder>... LIBRARIES <library>...")
  endif()
endmacro()

# The `arboretum` program with structures of one's own beside Arboretum's: `list` shows them, `run` sweeps them.
function(arboretum_executable target)
  arboretum_parse_words(arboretum_executable)
  if(NOT TARGET arboretum::experiments)
    message(FATAL_ERROR "arboretum_executable(${target}) needs find_package(arboretum REQUIRED COMPONENTS experiments)")
  endif()
  set(main ${CMAKE_CURRENT_BINARY_DIR}/${target}_main.cpp)
  arboretum_write("${main}"
"// Made by cmake/ArboretumStructures.cmake.
#include <cstdlib>

#include \"experiments/command_line.h\"

int main(int argc, char** argv) {
  setenv(\"ARBORETUM_DATA\", R\"(${ARBORETUM_DATA})\", 0);  // catalogue and plot scripts, unless the user names others
  return arboretum::command_line(argc, argv);
}
")
  add_executable(${target} "${main}")
  target_link_libraries(${target} PRIVATE arboretum::experiments ${words_LIBRARIES})
  arboretum_add_structures(${target} ${words_STRUCTURES})
endfunction()

# The tests that hold for any structure, as tests/test_<name>.cpp.
set(ARBORETUM_KERNEL_TESTS kernels shown_structures saved_structures structure_cases structure_cases_large structure_cases_moved structure_cases_rays)

# These tests, of every kernel, of what structures show and save, and the structure-level cases B01 to B30, over these structures and
# brute_force, which they are compared with.
function(arboretum_kernel_tests target)
  arboretum_parse_words(arboretum_kernel_tests)
  if(NOT TARGET arboretum::tests)
    message(FATAL_ERROR "arboretum_kernel_tests(${target}) needs find_package(arboretum REQUIRED COMPONENTS tests)")
  endif()
  set(sources ${ARBORETUM_KERNEL_TESTS})
  list(TRANSFORM sources REPLACE "(.+)" "${ARBORETUM_TESTS_FOLDER}/test_\\1.cpp")
  add_executable(${target} ${sources})
  target_link_libraries(${target} PRIVATE arboretum::arboretum arboretum::scenes arboretum::oracle arboretum::tests ${words_LIBRARIES})
  target_compile_options(${target} PRIVATE -O1)  # Catch2 takes half as long to compile; the kernels have options of their own
  get_filename_component(root "${ARBORETUM_TESTS_FOLDER}" DIRECTORY)
  target_include_directories(${target} PRIVATE "${root}")
  list(FILTER ARBORETUM_STRUCTURES INCLUDE REGEX "\\|brute_force\\|")
  arboretum_add_structures(${target} ${words_STRUCTURES})
endfunction()
