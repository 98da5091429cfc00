// Top-down construction of a kd-tree, whatever finds the planes.
//
// A Method has a State (the references of one cell), and
//   find(state, cell, parallel)                        the cheapest Split, or none;
//   divide(state, split, cell, left, right, parallel)  the references of its two sides.
// Large cells are split one after the other with all threads at work inside, and their two sides become tasks; below
// kOneTask references a task builds a whole subtree. What is decided depends on the references alone, so the tree is
// the same for any number of threads.
//
// Where a finished subtree costs more than one leaf in its place, it becomes that leaf. A cell with more references
// than a leaf should hold is split by planes that do not pay at first sight, up to kDoubtful of them in a row (Wald and
// Havran 2006 stop at once); for smaller cells that gave no better tree on any scene tried.
#pragma once

#include <algorithm>
#include <memory>
#include <vector>

#include <tbb/parallel_invoke.h>

#include "structures/builders/one_task.h"
#include "structures/kdtree/split.h"

namespace arboretum::kdtree {

/// A node of a Part: a leaf has axis 3, and `first` and `count` name its ids; else its children are nodes first, first
/// + 1.
struct BuildNode {
  float plane;
  std::uint32_t axis, first, count;
};

/// A subtree: either a plane and two parts, or (axis < 0) nodes of its own, the first being the root.
struct Part {
  int axis = -1;
  float plane = 0.0f;
  std::unique_ptr<Part> child[2];
  MeteredVector<BuildNode> nodes;
  MeteredVector<std::uint32_t> ids;
};

/// Bounds that no tree exceeds.
struct Limits {
  unsigned depth;          ///< of a leaf
  std::size_t references;  ///< in all leaves together
};

template <class Method>
class TopDown {
 public:
  using State = typename Method::State;

  TopDown(const Method& method, const CostModel& model, const Limits& limits)
      : method_(method), model_(model), limits_(limits) {}

  void build(State&& root, const Bounds3f& cell, Part& out) const {
    large(std::move(root), {cell, limits_.references, 0, 0}, out);
  }

 private:
  /// What a cell inherits.
  struct Place {
    Bounds3f cell;
    std::size_t references;  ///< its leaves may have so many together
    unsigned depth;
    unsigned doubtful;  ///< planes above it that did not pay at first sight, without one between them that did
  };

  /// The plane to split by; none where a leaf is better, or nothing else is allowed.
  Split choose(const State& state, Place& place, bool parallel) const {
    const std::size_t n = state.size();
    if (n == 0 || place.depth >= limits_.depth) return {};
    Split split = method_.find(state, place.cell, parallel);
    if (!split.exists()) return split;
    if (split.cost < model_.leaf(n)) {
      place.doubtful = 0;
    } else if (n <= model_.max_leaf || ++place.doubtful > kDoubtful) {
      return {};
    }
    return split;
  }
  static constexpr unsigned kDoubtful = 2;

  /// The places of both sides. What the parent may have beyond its sides' references is shared out by their sizes.
  static void share(const Place& place, const Split& split, std::size_t left, std::size_t right, Place& l, Place& r) {
    const std::size_t spare = place.references - left - right;
    const std::size_t to_left = std::min(spare, std::size_t(double(spare) * double(left) / double(left + right)));
    l = {left_of(place.cell, split), left + to_left, place.depth + 1, place.doubtful};
    r = {right_of(place.cell, split), right + (spare - to_left), place.depth + 1, place.doubtful};
  }

  void large(State&& state, Place place, Part& out) const {
    if (state.size() <= kOneTask) return Task(*this, out).run(std::move(state), place);
    const Split split = choose(state, place, true);
    State left, right;
    if (split.exists()) method_.divide(state, split, place.cell, left, right, true);
    if (!split.exists() || left.size() + right.size() > place.references) {
      place.depth = limits_.depth;
      return Task(*this, out).run(std::move(state), place);
    }
    Place l, r;
    share(place, split, left.size(), right.size(), l, r);
    { State done = std::move(state); }
    out.axis = split.axis, out.plane = split.plane;
    out.child[0] = std::make_unique<Part>(), out.child[1] = std::make_unique<Part>();
    tbb::parallel_invoke([&] { large(std::move(left), l, *out.child[0]); },
                         [&] { large(std::move(right), r, *out.child[1]); });
  }

  /// Builds one part, sequentially. States are used again, one pair for each level.
  class Task {
   public:
    Task(const TopDown& tree, Part& out) : tree_(tree), out_(out) {}
    void run(State&& state, const Place& place) {
      base_ = place.depth;
      out_.nodes.resize(1);
      (void)subtree(state, place, 0);
      out_.nodes.shrink_to_fit(), out_.ids.shrink_to_fit();
    }

   private:
    /// Writes node `index` and what is below it; returns its cost for a ray that comes into its cell.
    double subtree(State& state, Place place, std::uint32_t index) {
      const std::size_t n = state.size();
      const double as_leaf = tree_.model_.leaf(n);
      const Split split = tree_.choose(state, place, false);
      if (!split.exists()) return leaf(state, index), as_leaf;
      const std::size_t level = place.depth - base_;
      if (sides_.size() <= level) sides_.resize(level + 1);
      if (!sides_[level]) sides_[level] = std::make_unique<Sides>();
      State &left = sides_[level]->left, &right = sides_[level]->right;
      Place l, r;
      tree_.method_.divide(state, split, place.cell, left, right, false);
      if (left.size() + right.size() > place.references) return leaf(state, index), as_leaf;
      share(place, split, left.size(), right.size(), l, r);
      const std::size_t ids = out_.ids.size();
      const auto first = std::uint32_t(out_.nodes.size());
      out_.nodes.resize(first + 2);
      const double left_cost = subtree(left, l, first), right_cost = subtree(right, r, first + 1);
      const double area = place.cell.area();
      const double cost = area > 0 ? tree_.model_.step + (l.cell.area() * left_cost + r.cell.area() * right_cost) / area
                                   : std::numeric_limits<double>::infinity();
      if (as_leaf <= cost && n <= tree_.model_.max_leaf) {
        out_.nodes.resize(first), out_.ids.resize(ids);
        return leaf(state, index), as_leaf;
      }
      out_.nodes[index] = {split.plane, std::uint32_t(split.axis), first, 0};
      return cost;
    }

    void leaf(const State& state, std::uint32_t index) {
      out_.nodes[index] = {0.0f, 3, std::uint32_t(out_.ids.size()), std::uint32_t(state.size())};
      state.append_ids(out_.ids);
    }

    struct Sides {
      State left, right;
    };
    const TopDown& tree_;
    Part& out_;
    unsigned base_ = 0;  ///< the part's root's depth
    std::vector<std::unique_ptr<Sides>> sides_;
  };

  const Method& method_;
  const CostModel& model_;
  const Limits& limits_;
};

}  // namespace arboretum::kdtree
