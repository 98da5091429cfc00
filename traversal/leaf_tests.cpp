#include "intersectors/leaf_tests.h"

#include "structures/leaves/leaf_form.h"

namespace arboretum {

std::span<const LeafTests> leaf_tests() {
  static const std::vector<LeafTests> tests = [] {
    std::vector<LeafTests> list = registered_leaf_tests();
    for (LeafTests& t : list) t.form = find_leaf_form(t.leaf);
    return list;
  }();
  return tests;
}

const LeafTests* find_leaf_tests(std::string_view leaf, std::string_view intersector, Isa isa) {
  for (const LeafTests& t : leaf_tests())
    if (t.isa == isa && t.intersector == intersector && t.leaf == leaf) return &t;
  return nullptr;
}

}  // namespace arboretum
