// The box tests on every instruction set, one node of eight boxes at a time, for tests/test_boxes.cpp.
#pragma once

#include "core/ray.h"

namespace arboretum::box_test {

/// As a node has them: lower x, upper x, lower y, ...
struct Boxes {
  alignas(64) float planes[6][8];
};

enum class Test { fast, ize, padded, tight };  ///< tight: padded boxes, tight along the ray

/// The boxes that the test lets the ray into, as bits. `max_coordinate`: the largest of the scene.
unsigned meets_scalar(Test test, const Ray& ray, float max_coordinate, const Boxes& boxes);
unsigned meets_sse(Test test, const Ray& ray, float max_coordinate, const Boxes& boxes);
unsigned meets_avx2(Test test, const Ray& ray, float max_coordinate, const Boxes& boxes);
unsigned meets_avx512(Test test, const Ray& ray, float max_coordinate, const Boxes& boxes);

}  // namespace arboretum::box_test
