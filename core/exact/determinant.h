// The two determinants that everything in the exact predicate is made of, for any number type.
#pragma once

#include <array>

namespace arboretum {

template <class T>
using Triple = std::array<T, 3>;

template <class T>
[[nodiscard]] Triple<T> cross(const Triple<T>& a, const Triple<T>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
template <class T>
[[nodiscard]] T dot(const Triple<T>& a, const Triple<T>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
/// det[a, b, c]: three products deep, so that five roundings lie between operands and result.
template <class T>
[[nodiscard]] T determinant(const Triple<T>& a, const Triple<T>& b, const Triple<T>& c) {
  return dot(cross(a, b), c);
}

}  // namespace arboretum
