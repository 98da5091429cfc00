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

  /// An inner node of `boxes` child boxes, tested in `lanes` lanes, of which the ray meets `hit`.
  void node(unsigned boxes, unsigned lanes, unsigned hit) const noexcept;
  /// That visit, or a packet's: `lanes` lanes, of which `active` held something to test.
  void at_depth(Depth depth, unsigned lanes, unsigned active) const;
  /// A whole leaf of `count` blocks; an any hit that ends earlier counts as if it went on.
  void leaf(const LeafForm& form, const std::byte* blocks, unsigned count) const noexcept;
  /// The queue of nodes has its turn: a round begins; then that of leaves.
  void node_queue(unsigned length) const noexcept { ++counters.queue_rounds, counters.nodes_queued += length; }
  void leaf_queue(unsigned length) const noexcept { counters.leaves_queued += length; }
};

}  // namespace arboretum
