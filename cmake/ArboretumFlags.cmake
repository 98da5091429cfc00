# Flags that every target of the project shares, as the interface target arboretum_flags. An installed package carries of them
# what a program must have too: the standard, the sanitizers that the libraries were built with.
#
# -ffp-contract=off: GCC fuses a*b-c*d by default, even written in intrinsics, and a fused edge test leaks half of the
# rays that meet an edge (docs/numerics.md). No -ffast-math and no -march=native for the same reason; kernels get
# their instruction set from a pragma (simd/).
set(ARBORETUM_OPTIONS -ffp-contract=off -Wall -Wextra -Wpedantic)
if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
  list(APPEND ARBORETUM_OPTIONS -fno-slp-vectorize)
endif()
if(ARBORETUM_WERROR)
  list(APPEND ARBORETUM_OPTIONS -Werror)
endif()

add_library(arboretum_flags INTERFACE)
target_include_directories(arboretum_flags INTERFACE
  $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<BUILD_INTERFACE:${PROJECT_BINARY_DIR}/generated> $<INSTALL_INTERFACE:include>)
target_compile_features(arboretum_flags INTERFACE cxx_std_20)
target_compile_options(arboretum_flags INTERFACE "$<BUILD_INTERFACE:${ARBORETUM_OPTIONS}>")
if(ARBORETUM_SANITIZE)
  target_compile_options(arboretum_flags INTERFACE -fsanitize=${ARBORETUM_SANITIZE} -fno-omit-frame-pointer -g)
  target_link_options(arboretum_flags INTERFACE -fsanitize=${ARBORETUM_SANITIZE})
  list(APPEND ARBORETUM_OPTIONS -fsanitize=${ARBORETUM_SANITIZE})
endif()

# For code that waits for others: the command line, readers of files, tests. A release build spends half of its time on optimising them at -O3.
# The rest, whatever a measurement or a build of a structure runs through, keeps the build type's own flags.
function(arboretum_optimise_little target)
  target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)
endfunction()
