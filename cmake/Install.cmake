# `cmake --install`: static libraries, headers, the program, its data, and a package for find_package(arboretum).
#
# Components of the package: library (always there), scenes, oracle, rendering, experiments, tests; each is an export set of its own,
# so that a program which only traces needs none of the others' libraries. The program finds its data relative to itself and
# the package its files: an installed tree may be moved.
include(CMakePackageConfigHelpers)
set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/arboretum)

function(arboretum_install_component component)
  install(TARGETS ${ARGN} EXPORT arboretum-${component} ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
  install(EXPORT arboretum-${component} NAMESPACE arboretum:: DESTINATION ${package_folder}
          FILE arboretum-${component}-targets.cmake COMPONENT development)
  export(EXPORT arboretum-${component} NAMESPACE arboretum:: FILE ${PROJECT_BINARY_DIR}/arboretum-${component}-targets.cmake)
endfunction()

if(TARGET arboretum_catch_main)
  set_target_properties(arboretum_catch_main PROPERTIES EXPORT_NAME tests)
  arboretum_install_component(tests arboretum_catch_main)
endif()
foreach(name flags core exact structures statistics traversal registry scenes oracle rendering experiments)
  set_target_properties(arboretum_${name} PROPERTIES EXPORT_NAME ${name})
  add_library(arboretum::${name} ALIAS arboretum_${name})
endforeach()
set_target_properties(arboretum_library PROPERTIES EXPORT_NAME arboretum)
add_library(arboretum::arboretum ALIAS arboretum_library)
arboretum_install_component(library arboretum_flags arboretum_core arboretum_exact arboretum_structures arboretum_statistics arboretum_traversal
                            arboretum_registry arboretum_library)
foreach(component scenes oracle rendering experiments)
  arboretum_install_component(${component} arboretum_${component})
endforeach()

# The package's configuration, of the build tree (find_package(arboretum) with arboretum_DIR=build) and as installed.
string(REPLACE ";" "\n  " structures_text "${ARBORETUM_STRUCTURES}")
function(arboretum_package_config file install_folder headers data)
  set(PACKAGE_HEADERS ${headers})
  set(PACKAGE_DATA ${data})
  configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/arboretumConfig.cmake.in ${file} INSTALL_DESTINATION ${install_folder}
                                PATH_VARS PACKAGE_HEADERS PACKAGE_DATA ${ARGN})
endfunction()
arboretum_package_config(${PROJECT_BINARY_DIR}/package/arboretumConfig.cmake ${package_folder}
                         ${CMAKE_INSTALL_INCLUDEDIR}/arboretum ${CMAKE_INSTALL_DATADIR}/arboretum)
arboretum_package_config(${PROJECT_BINARY_DIR}/arboretumConfig.cmake ${PROJECT_BINARY_DIR}
                         ${PROJECT_SOURCE_DIR} ${PROJECT_BINARY_DIR}/share/arboretum INSTALL_PREFIX ${PROJECT_BINARY_DIR})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/arboretumConfigVersion.cmake COMPATIBILITY SameMinorVersion)
configure_file(cmake/ArboretumStructures.cmake ${PROJECT_BINARY_DIR}/ArboretumStructures.cmake COPYONLY)
install(FILES ${PROJECT_BINARY_DIR}/package/arboretumConfig.cmake ${PROJECT_BINARY_DIR}/arboretumConfigVersion.cmake
              cmake/ArboretumStructures.cmake DESTINATION ${package_folder} COMPONENT development)

# Headers: <arboretum/arboretum.h> for programs, the rest below it. Installed, their includes say "arboretum/core/ray.h" where the
# sources say "core/ray.h", so that no folder of a program is mistaken for ours. In the build tree links stand in for them.
set(header_folders core simd intersectors structures traversal library scenes oracle rendering experiments)
foreach(folder IN LISTS header_folders)
  file(MAKE_DIRECTORY ${PROJECT_BINARY_DIR}/include/arboretum)
  file(CREATE_LINK ${PROJECT_SOURCE_DIR}/${folder} ${PROJECT_BINARY_DIR}/include/arboretum/${folder} SYMBOLIC)
endforeach()
file(CREATE_LINK ${PROJECT_SOURCE_DIR}/library/arboretum.h ${PROJECT_BINARY_DIR}/include/arboretum/arboretum.h SYMBOLIC)
target_include_directories(arboretum_library INTERFACE $<BUILD_INTERFACE:${PROJECT_BINARY_DIR}/include>)
install(CODE "set(source \"${PROJECT_SOURCE_DIR}\")
set(folders \"${header_folders}\")
set(stage \"${PROJECT_BINARY_DIR}/package/include/arboretum\")
set(destination \"\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_INCLUDEDIR}\")
include(\"${PROJECT_SOURCE_DIR}/cmake/InstallHeaders.cmake\")" COMPONENT development)

install(TARGETS arboretum RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT runtime)
set(data ${CMAKE_INSTALL_DATADIR}/arboretum)
install(FILES scenes/catalogue.yaml DESTINATION ${data}/scenes COMPONENT runtime)
install(DIRECTORY plots configs DESTINATION ${data} COMPONENT runtime PATTERN __pycache__ EXCLUDE)
if(TARGET arboretum_catch_main)  # for tests of structures that others write: arboretum_kernel_tests()
  include(ArboretumStructures)
  set(sources ${ARBORETUM_KERNEL_TESTS})
  list(TRANSFORM sources REPLACE "(.+)" "tests/test_\\1.cpp")
  install(FILES ${sources} tests/structure_cases.h tests/kernel_runner.h tests/kernel_scenes.h tests/small_meshes.h tests/folder.h tests/catch.h
          DESTINATION ${data}/tests COMPONENT development)
endif()
install(DIRECTORY examples DESTINATION ${data} COMPONENT development PATTERN build* EXCLUDE)
install(DIRECTORY docs DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT runtime)
install(FILES README.md LICENSE CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT runtime)
# Which sources these are, for the results of an installed program.
install(CODE "set(source \"${PROJECT_SOURCE_DIR}\")
set(stage \"${PROJECT_BINARY_DIR}/package\")
set(destination \"\${CMAKE_INSTALL_PREFIX}/${data}\")
include(\"${PROJECT_SOURCE_DIR}/cmake/InstallRevision.cmake\")" COMPONENT runtime)
