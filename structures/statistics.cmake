# The statistics of structures as a library of their own: they need the Accel interface alone.
add_library(arboretum_statistics STATIC
  ${CMAKE_CURRENT_LIST_DIR}/end_point_overlap.cpp
  ${CMAKE_CURRENT_LIST_DIR}/statistics.cpp)
target_link_libraries(arboretum_statistics PUBLIC arboretum_core PRIVATE TBB::tbb)
if(TARGET arboretum_structures)
  target_link_libraries(arboretum_structures PUBLIC arboretum_statistics)
endif()
