# Reads structures/all.h and makes from it: the type list of all structures (generated/structure_list.h), a kernel unit for
# each structure and instruction set, and the list of those units (generated/kernel_units.h).
#
# Sets ARBORETUM_STRUCTURE_SOURCES (the folders' .cpp files), ARBORETUM_KERNEL_UNITS and ARBORETUM_BUILDER_UNITS.
set(ARBORETUM_ISAS "scalar;sse;avx2;avx512" CACHE STRING "Instruction sets to compile kernels for; fewer make a faster build while a kernel is written")
set(generated ${PROJECT_BINARY_DIR}/generated)

# Writes only what changed, so that a configure run rebuilds nothing.
function(arboretum_write path content)
  if(EXISTS ${path})
    file(READ ${path} old)
    if(old STREQUAL content)
      return()
    endif()
  endif()
  file(WRITE ${path} "${content}")
endfunction()

set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/structures/all.h)
file(STRINGS ${PROJECT_SOURCE_DIR}/structures/all.h lines REGEX "^#include \"structures/")
set(lists "")
set(declarations "")
set(calls "")
foreach(line IN LISTS lines)
  if(NOT line MATCHES "\"structures/([a-z0-9_]+)/([a-z0-9_]+)\\.h\"")
    message(FATAL_ERROR "structures/all.h: cannot read '${line}'; write #include \"structures/<folder>/<name>.h\"")
  endif()
  set(folder ${CMAKE_MATCH_1})
  set(header ${CMAKE_MATCH_2})
  if(folder STREQUAL "embree" AND NOT embree_FOUND)
    continue()
  endif()
  set(path ${PROJECT_SOURCE_DIR}/structures/${folder}/${header}.h)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${path})
  file(GLOB sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/structures/${folder}/*.cpp)
  list(APPEND ARBORETUM_STRUCTURE_SOURCES ${sources})
  file(READ ${path} text)
  if(NOT text MATCHES "using Structures = TypeList<([A-Za-z0-9_, \n]+)>;")
    message(FATAL_ERROR "${path}: no line 'using Structures = TypeList<...>;'")
  endif()
  string(REGEX MATCHALL "[A-Za-z0-9_]+" types "${CMAKE_MATCH_1}")
  list(APPEND lists "${folder}::Structures")
  foreach(type IN LISTS types)
    foreach(isa IN LISTS ARBORETUM_ISAS)
      string(TOUPPER ${isa} upper)
      set(function rows_of_${folder}_${type})
      set(unit ${generated}/kernels/${folder}_${type}_${isa}.cpp)
      arboretum_write(${unit}
"#define ARBORETUM_TARGET ARBORETUM_TARGET_${upper}
#include \"traversal/kernel_unit.h\"
#include \"structures/${folder}/${header}.h\"
#include \"simd/target_begin.h\"
#include \"simd/simd.h\"
#include \"structures/${folder}/${header}_kernels.h\"
#include \"simd/target_end.h\"

namespace arboretum::isa_${isa} {
void ${function}(KernelRows& rows);
void ${function}(KernelRows& rows) { add_kernels(std::type_identity<${folder}::${type}>{}, rows); }
}  // namespace arboretum::isa_${isa}
")
      list(APPEND ARBORETUM_KERNEL_UNITS ${unit})
      string(APPEND declarations "namespace isa_${isa} { void ${function}(KernelRows& rows); }\n")
      string(APPEND calls "  isa_${isa}::${function}(rows);\n")
    endforeach()
  endforeach()
endforeach()

list(JOIN lists ", " joined)
arboretum_write(${generated}/structure_list.h
"// Made by cmake/Structures.cmake from structures/all.h.
#pragma once
#include \"structures/all.h\"
namespace arboretum {
using AllStructures = ConcatLists<${joined}>;
}
")
arboretum_write(${generated}/kernel_units.h
"// Made by cmake/Structures.cmake from structures/all.h.
#pragma once
#include \"traversal/kernel_rows.h\"
namespace arboretum {
${declarations}
inline void add_all_rows(KernelRows& rows) {
${calls}}
}  // namespace arboretum
")
foreach(isa scalar sse avx2 avx512)
  string(TOUPPER ${isa} upper)
  set(unit ${generated}/builders/builders_${isa}.cpp)
  arboretum_write(${unit} "#define ARBORETUM_TARGET ARBORETUM_TARGET_${upper}\n#include \"structures/builders/builder_unit.h\"\n")
  list(APPEND ARBORETUM_BUILDER_UNITS ${unit})
endforeach()
