// Counters as a template parameter: NoCounters compiles to nothing, so the timed kernels carry none.
#pragma once

#include "structures/leaves/leaf_form.h"
#include "traversal/kernel_table.h"

namespace arboretum {

struct NoCounters {
  static constexpr bool kCounting = false;
  /// A node's depth, where it is not asked for.
  struct Depth {};
  struct Depths {
    explicit Depths(Depth) noexcept {}
    [[nodiscard]] Depth current() const noexcept { return {}; }
    void push(std::ptrdiff_t, std::ptrdiff_t) const noexcept {}
    void descend() const noexcept {}
    void pop(std::ptrdiff_t) const noexcept {}
  };
  explicit NoCounters(Counters*) noexcept {}
  void node(unsigned, unsigned, unsigned) const noexcept {}
  void at_depth(Depth, unsigned, unsigned) const noexcept {}
  void leaf(const LeafForm&, const std::byte*, unsigned) const noexcept {}
  void blocks(const LeafForm&, const std::byte*, unsigned) const noexcept {}
  void node_queue(unsigned) const noexcept {}
  void leaf_queue(unsigned) const noexcept {}
};

struct WithCounters {
  static constexpr bool kCounting = true;
  /// The root's is 0.
  struct Depth {
    unsigned value = 0;
  };
  /// How deep the node at hand is, and what waits on a traversal stack: entry i of the stack is as deep as
  /// `waiting_[i]`.
  class Depths {
   public:
    explicit Depths(Depth root) noexcept : current_(root.value) {}
    [[nodiscard]] Depth current() const noexcept { return {current_}; }
    /// Children of the node at hand went to the stack, entries `begin` to `end`.
    void push(std::ptrdiff_t begin, std::ptrdiff_t end);
    /// A child of the node at hand is next.
    void descend() noexcept { ++current_; }
    /// Entry `at` of the stack is next.
    void pop(std::ptrdiff_t at) noexcept { current_ = waiting_[std::size_t(at)]; }

   private:
    unsigned current_;
    std::vector<unsigned> waiting_;
  };

  Counters& counters;
  explicit WithCounters(Counters* c) noexcept : counters(*c) {}

  /// A ray visits an inner node: `boxes` child boxes, tested in `lanes` lanes, of which it meets `hit`.
  void node(unsigned boxes, unsigned lanes, unsigned hit) const noexcept { box_tests(lanes, boxes), met(hit); }
  /// The same where its tests are counted with others': of the node's children it meets `hit`.
  void met(unsigned hit) const noexcept;
  /// Lanes of ray/box tests, of which `active` held a ray and a box that exists.
  void box_tests(unsigned lanes, unsigned active) const noexcept;
  /// Of a visit of one ray, or of those that share it, the same lanes again.
  void at_depth(Depth depth, unsigned lanes, unsigned active) const;
  /// So many rays visit a node together, or a leaf.
  void share_node(unsigned rays) const noexcept { counters.nodes_shared += rays - 1; }
  void share_leaf(unsigned rays) const noexcept { counters.leaves_shared += rays - 1; }
  /// Boxes tested against the interval of a packet.
  void interval(unsigned boxes) const noexcept { counters.interval_tests += boxes; }
  /// A ray visits a leaf and is tested against `count` blocks of it; then against more.
  void leaf(const LeafForm& form, const std::byte* at, unsigned count) const noexcept {
    ++counters.leaves, blocks(form, at, count);
  }
  void blocks(const LeafForm& form, const std::byte* at, unsigned count) const noexcept;
  /// The queue of nodes has its turn: a round begins; then that of leaves.
  void node_queue(unsigned length) const noexcept { ++counters.queue_rounds, counters.nodes_queued += length; }
  void leaf_queue(unsigned length) const noexcept { counters.leaves_queued += length; }
};

}  // namespace arboretum
