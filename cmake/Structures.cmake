# Reads structures/all.h and makes from it a kernel unit for each structure and instruction set, and the registry.
#
# Sets ARBORETUM_STRUCTURES (records, see ArboretumStructures.cmake), ARBORETUM_STRUCTURE_SOURCES (the folders' .cpp files) and
# ARBORETUM_BUILDER_UNITS.
include(ArboretumStructures)
set(ARBORETUM_ISAS "scalar;sse;avx2;avx512" CACHE STRING "Instruction sets to compile kernels for; fewer make a faster build while a kernel is written")
set(generated ${PROJECT_BINARY_DIR}/generated)

arboretum_read_all(headers structures "<folder>/<name>")
set(ARBORETUM_STRUCTURES "")
foreach(header IN LISTS headers)
  string(REGEX REPLACE "^structures/(.+)/.+" "\\1" folder ${header})
  if(folder STREQUAL "embree" AND NOT embree_FOUND)
    continue()
  endif()
  arboretum_read_structure(record ${PROJECT_SOURCE_DIR}/${header} ${header})
  list(APPEND ARBORETUM_STRUCTURES "${record}")
  file(GLOB sources CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/structures/${folder}/*.cpp)
  list(APPEND ARBORETUM_STRUCTURE_SOURCES ${sources})
endforeach()
arboretum_registry(${generated}/registry.cpp ${ARBORETUM_STRUCTURES})

foreach(isa scalar sse avx2 avx512)
  string(TOUPPER ${isa} upper)
  set(unit ${generated}/builders/builders_${isa}.cpp)
  arboretum_write(${unit} "#define ARBORETUM_TARGET ARBORETUM_TARGET_${upper}\n#include \"structures/builders/builder_unit.h\"\n")
  list(APPEND ARBORETUM_BUILDER_UNITS ${unit})
endforeach()
