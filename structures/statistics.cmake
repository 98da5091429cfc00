# The Accel interface, and the statistics of structures, which need no more than it, as a library of their own.
add_library(arboretum_statistics STATIC
  ${CMAKE_CURRENT_LIST_DIR}/archive.cpp
  ${CMAKE_CURRENT_LIST_DIR}/end_point_overlap.cpp
  ${CMAKE_CURRENT_LIST_DIR}/leaf_count_variability.cpp
  ${CMAKE_CURRENT_LIST_DIR}/statistics.cpp)
target_link_libraries(arboretum_statistics PUBLIC arboretum_core PRIVATE TBB::tbb)
if(TARGET arboretum_structures)
  target_link_libraries(arboretum_structures PUBLIC arboretum_statistics)
endif()
