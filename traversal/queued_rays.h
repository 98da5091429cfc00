// Queued traversal: K rays of a batch in flight, their next steps in two queues, one of nodes, one of leaves.
//
// A step of one ray waits some fifty cycles for memory and mispredicted branches. Here a step only says what the ray
// needs next: the target's cache lines are asked for and {ray, target} is put on the queue of its kind, so that by the
// time it is its turn the lines are there, and the steps of a queue are independent of each other and all of one kind.
// Every ray keeps its own stack and visits nodes in the very order of single-ray traversal: the answers are the same to
// the bit, however many rays are in flight.
//
// What a structure brings is a Walk:
//   static constexpr bool kAnyHit;
//   using Target, Entry (of a ray's stack), State, Leaves;
//   Walk(const Accel&, const KernelRow&);
//   std::size_t stack_entries() const;
//   void start(void* state, const Ray&, float time, Entry* stack) const;
//                                      makes a State with members `best` (NearestHit) and `data` (Leaves::RayData)
//   Target first(State&) const;
//   static unsigned kind(Target);      0 a node, 1 a leaf, 2 nothing is left
//   void prefetch(Target) const;
//   Target node(State&, Target) const;                   what comes after this step
//   Target leaf(State&, Target, Entry* stack) const;     the same
//   void finish(State&) const;         before a ray's closest hit is reported
#pragma once

#include "traversal/queued_functions.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <class Walk>
class QueuedRays {
 public:
  /// `in_flight`: 1 to kMostInFlight.
  QueuedRays(const Accel& accel, const KernelRow& row, RayBatch rays, unsigned in_flight)
      : in_flight_(in_flight), walk_(accel, row), rays_(rays), stride_(stride_of<Entry>(walk_.stack_entries())),
        stacks_(stride_ * in_flight) {}

  /// report(index of the ray, its nearest hit): any hit has a primitive where something was hit.
  template <class Report, class Counting>
  void run(Report&& report, const Counting& counting) {
    for (unsigned slot = 0; slot < in_flight_; ++slot) start(slot, report);
    while (counts_[0] | counts_[1] | counts_[2]) {
      counting.node_queue(counts_[0]);
      step_nodes();
      counting.leaf_queue(counts_[1]);
      step_leaves();
      const unsigned done = std::exchange(counts_[2], 0u);
      for (unsigned i = 0; i < done; ++i) {
        const unsigned slot = queues_[2][i].slot;
        Slot& s = slot_of(slot);
        walk_.finish(s.state);
        report(s.index, s.state.best);
        start(slot, report);
      }
    }
  }

 private:
  using Target = typename Walk::Target;
  using Entry = typename Walk::Entry;
  struct alignas(64) Slot {
    typename Walk::State state;
    std::size_t index;
  };
  struct Step {
    std::uint32_t slot;
    Target target;
  };

  Slot& slot_of(unsigned slot) { return *reinterpret_cast<Slot*>(slots_ + slot * sizeof(Slot)); }
  Entry* stack_of(unsigned slot) { return stacks_.data() + slot * stride_; }

  /// The ends of the queues while a loop appends to them: in registers.
  struct Tails {
    QueuedRays& q;
    unsigned node, leaf, done;
    ARBORETUM_INLINE explicit Tails(QueuedRays& queued)
        : q(queued), node(queued.counts_[0]), leaf(queued.counts_[1]), done(queued.counts_[2]) {}
    ARBORETUM_INLINE ~Tails() { q.counts_[0] = node, q.counts_[1] = leaf, q.counts_[2] = done; }

    /// Asks for the lines of the target and puts the step on the queue of its kind.
    ARBORETUM_INLINE void route(unsigned slot, Target target) {
      q.walk_.prefetch(target);
      const Step step{slot, target};
      const unsigned kind = Walk::kind(target);
      q.queues_[0][node] = step, q.queues_[1][leaf] = step, q.queues_[2][done] = step;
      node += kind == 0, leaf += kind == 1, done += kind == 2;
    }
  };

  template <class Report>
  void start(unsigned slot, Report&& report) {
    for (; next_ < rays_.size(); ++next_) {
      const Ray& ray = rays_[next_];
      if (!is_valid_in_lanes(ray)) {
        report(next_, NearestHit{ray.tfar});
        continue;
      }
      Slot& s = slot_of(slot);
      walk_.start(&s.state, ray, rays_.time(next_), stack_of(slot));
      s.index = next_++;
      Tails(*this).route(slot, walk_.first(s.state));
      return;
    }
  }

  void step_nodes() {
    const unsigned count = std::exchange(counts_[0], 0u);
    Step steps[kMostInFlight];
    std::memcpy(steps, queues_[0], count * sizeof(Step));
    Tails tails(*this);
    for (unsigned i = 0; i < count; ++i)
      tails.route(steps[i].slot, walk_.node(slot_of(steps[i].slot).state, steps[i].target));
  }

  void step_leaves() {
    const unsigned count = std::exchange(counts_[1], 0u);
    for (unsigned i = 0; i < count; ++i) {
      const Step step = queues_[1][i];
      pending_[i] = {step.slot, walk_.leaf(slot_of(step.slot).state, step.target, stack_of(step.slot))};
    }
    Tails tails(*this);
    for (unsigned i = 0; i < count; ++i) tails.route(pending_[i].slot, pending_[i].target);
  }

  const unsigned in_flight_;
  const Walk walk_;
  const RayBatch rays_;
  std::size_t next_ = 0;
  const std::size_t stride_;
  std::vector<Entry> stacks_;
  unsigned counts_[3] = {0, 0, 0};
  Step queues_[3][kMostInFlight + 1];  ///< one place more: a step is written to the end of all three
  Step pending_[kMostInFlight];
  alignas(64) std::byte slots_[kMostInFlight * sizeof(Slot)];
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
