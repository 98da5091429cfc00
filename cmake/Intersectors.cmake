# Reads intersectors/all.h and makes from it a unit of leaf tests for each intersector and instruction set, and the list of them all.
#
# Sets ARBORETUM_INTERSECTOR_UNITS.
include(ArboretumStructures)
set(generated ${PROJECT_BINARY_DIR}/generated/intersectors)

arboretum_read_all(headers intersectors "<name>")
set(declarations "")
set(calls "")
foreach(header IN LISTS headers)
  get_filename_component(name ${header} NAME_WE)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/${header})
  file(READ ${PROJECT_SOURCE_DIR}/${header} text)
  if(NOT text MATCHES "struct ([A-Za-z0-9]+)[ a-zA-Z:]* {\n  static constexpr std::string_view kName = \"${name}\"")
    message(FATAL_ERROR "${header}: no 'struct <Name> {' that begins with 'static constexpr std::string_view kName = \"${name}\";'")
  endif()
  set(type ${CMAKE_MATCH_1})
  foreach(isa IN LISTS ARBORETUM_ISAS)
    string(TOUPPER ${isa} upper)
    set(unit ${generated}/${name}_${isa}.cpp)
    arboretum_write(${unit}
"#define ARBORETUM_TARGET ARBORETUM_TARGET_${upper}
#include \"traversal/kernel_unit.h\"
#include \"simd/target_begin.h\"
#include \"simd/simd.h\"
#include \"intersectors/leaf_tests_rows.h\"
#include \"${header}\"
#include \"simd/target_end.h\"

namespace arboretum::isa_${isa} {
void tests_of_${name}(std::vector<LeafTests>& list);
void tests_of_${name}(std::vector<LeafTests>& list) { add_leaf_tests<${type}>(list); }
}  // namespace arboretum::isa_${isa}
")
    arboretum_kernel_options(${unit} ${isa})
    list(APPEND ARBORETUM_INTERSECTOR_UNITS ${unit})
    string(APPEND declarations "namespace isa_${isa} { void tests_of_${name}(std::vector<LeafTests>& list); }\n")
    string(APPEND calls "  if (cpu_supports(Isa::${isa})) isa_${isa}::tests_of_${name}(list);\n")
  endforeach()
endforeach()
arboretum_write(${generated}/list.cpp
"// Made by cmake/Intersectors.cmake: the leaf tests of every intersector and instruction set.
#include \"intersectors/leaf_tests.h\"

namespace arboretum {
${declarations}
std::vector<LeafTests> registered_leaf_tests() {
  std::vector<LeafTests> list;
${calls}  return list;
}
}  // namespace arboretum
")
list(APPEND ARBORETUM_INTERSECTOR_UNITS ${generated}/list.cpp)
