// Exact-sweep SAH in O(n log n) (Wald and Havran 2006, section 4.3): every bound of every reference is a plane to try.
// The bounds are sorted once for each axis; a split filters the sorted lists, and only the references that it cuts
// bring new bounds, which are few: they are sorted and merged in.
#include <algorithm>

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include "structures/builders/phase_clock.h"
#include "structures/kdtree/builders.h"

namespace arboretum::kdtree {
namespace {

/// A bound: where it is, of which of the cell's references, and what it is. At one place ends come before flat boxes,
/// these before begins.
struct Event {
  float at;
  std::uint32_t code;  ///< kind << 30 | reference
  enum Kind : std::uint32_t { end, flat, begin };
  static constexpr std::uint32_t kReference = (1u << 30) - 1;
  [[nodiscard]] std::uint32_t reference() const noexcept { return code & kReference; }
  [[nodiscard]] std::uint32_t kind() const noexcept { return code >> 30; }
};
static_assert(sizeof(Event) == 8);
/// Total but for equal events: no sort can give two results. -0 and 0 are one place.
[[nodiscard]] bool operator<(const Event& a, const Event& b) noexcept {
  return a.at < b.at || (a.at == b.at && a.code < b.code);
}

using Events = MeteredVector<Event>;

void add_events(const Bounds3f& box, std::uint32_t reference, std::size_t axis, Events& out) {
  const float low = box.lower[axis], high = box.upper[axis];
  if (low == high) {
    out.push_back({low, Event::flat << 30 | reference});
  } else {
    out.push_back({low, Event::begin << 30 | reference});
    out.push_back({high, Event::end << 30 | reference});
  }
}

class Sweep {
 public:
  struct State {
    References references;
    Events events[3];
    [[nodiscard]] std::size_t size() const { return references.size(); }
    void append_ids(MeteredVector<std::uint32_t>& ids) const {
      for (const Reference& r : references) ids.push_back(r.id);
    }
    /// Room of a split, used again by the next one at this level.
    std::vector<std::uint8_t> sides;
    std::vector<std::uint32_t> to_left, to_right;
  };

  Sweep(const TriangleMesh& mesh, const BoxPads& pads, const CostModel& model)
      : mesh_(mesh), pads_(pads), model_(model) {}

  static void start(State& root) {
    const References& references = root.references;
    tbb::parallel_for(std::size_t{0}, std::size_t{3}, [&](std::size_t axis) {
      Events& events = root.events[axis];
      events.reserve(2 * references.size());
      for (std::size_t i = 0; i < references.size(); ++i) add_events(references[i].box, std::uint32_t(i), axis, events);
      tbb::parallel_sort(events.begin(), events.end());
    });
  }

  Split find(const State& state, const Bounds3f& cell, bool parallel) const {
    Split best[3];
    const auto along = [&](std::size_t axis) { best[axis] = find(state.events[axis], state.size(), cell, int(axis)); };
    for_axes(along, parallel);
    Split split = best[0];
    for (int axis = 1; axis < 3; ++axis) {
      if (best[axis].cost < split.cost) split = best[axis];
    }
    return split;
  }

  void divide(State& state, const Split& split, const Bounds3f& cell, State& left, State& right, bool parallel) const {
    const References& in = state.references;
    const std::size_t n = in.size();
    left.references.clear(), right.references.clear();
    state.sides.resize(n), state.to_left.resize(n), state.to_right.resize(n);
    // Boxes of both sides of what is cut, in the order of the references.
    const std::size_t chunks = parallel ? (n + kChunk - 1) / kChunk : 1, per_chunk = parallel ? kChunk : n;
    std::vector<std::vector<std::pair<Bounds3f, Bounds3f>>> cut(chunks);
    const auto classify = [&](std::size_t c) {
      for (std::size_t i = c * per_chunk, end = std::min(n, i + per_chunk); i < end; ++i) {
        const Side side = side_of(in[i].box, split);
        state.sides[i] = std::uint8_t(side);
        if (side != Side::both) continue;
        auto& [l, r] = cut[c].emplace_back();
        divide_reference(mesh_, pads_, in[i], split, cell, l, r);
      }
    };
    if (parallel) {
      tbb::parallel_for(std::size_t{0}, chunks, classify);
    } else {
      classify(0);
    }
    // References that are new to a side: index there.
    std::vector<std::uint32_t> new_left, new_right;
    for (std::size_t c = 0; c < chunks; ++c) {
      auto next_cut = cut[c].begin();
      for (std::size_t i = c * per_chunk, end = std::min(n, i + per_chunk); i < end; ++i) {
        state.to_left[i] = std::uint32_t(left.references.size()),
        state.to_right[i] = std::uint32_t(right.references.size());
        switch (Side(state.sides[i])) {
          case Side::left: left.references.push_back(in[i]); break;
          case Side::right: right.references.push_back(in[i]); break;
          case Side::both: {
            const auto& [l, r] = *next_cut++;
            if (!l.empty()) new_left.push_back(state.to_left[i]), left.references.push_back({l, in[i].id});
            if (!r.empty()) new_right.push_back(state.to_right[i]), right.references.push_back({r, in[i].id});
          }
        }
      }
    }
    const auto distribute = [&](std::size_t axis) {
      filter(state.events[axis], state, Side::left, state.to_left, new_left, left.references, axis, left);
      filter(state.events[axis], state, Side::right, state.to_right, new_right, right.references, axis, right);
    };
    for_axes(distribute, parallel);
  }

 private:
  template <class F>
  static void for_axes(const F& f, bool parallel) {
    if (parallel) {
      tbb::parallel_for(std::size_t{0}, std::size_t{3}, f);
    } else {
      for (std::size_t axis = 0; axis < 3; ++axis) f(axis);
    }
  }

  Split find(const Events& events, std::size_t n, const Bounds3f& cell, int axis) const {
    Split best;
    const AxisCost cost(model_, cell, axis);
    if (cost.flat()) return best;
    std::size_t left = 0, right = n;
    for (std::size_t i = 0; i < events.size();) {
      const float at = events[i].at;
      std::size_t here[3] = {0, 0, 0};
      for (; i < events.size() && events[i].at == at; ++i) ++here[events[i].kind()];
      right -= here[Event::end] + here[Event::flat];
      cost.consider(at, left + here[Event::flat], right, true, best);
      if (here[Event::flat] != 0) cost.consider(at, left, right + here[Event::flat], false, best);
      left += here[Event::flat] + here[Event::begin];
    }
    return best;
  }

  /// The events of one side along one axis: those of references that the plane does not cut, in their order, merged
  /// with the new ones.
  static void filter(const Events& events, const State& state, Side side, const std::vector<std::uint32_t>& index,
                     const std::vector<std::uint32_t>& added, const References& references, std::size_t axis,
                     State& to) {
    Events& out = to.events[axis];
    out.clear();
    out.resize(2 * references.size());
    Events cut;
    for (std::uint32_t i : added) add_events(references[i].box, i, axis, cut);
    std::sort(cut.begin(), cut.end());
    Event* write = out.data();
    auto next = cut.begin();
    for (const Event& e : events) {
      const std::uint32_t r = e.reference();
      if (state.sides[r] != std::uint8_t(side)) continue;
      const Event moved{e.at, (e.code & ~Event::kReference) | index[r]};
      while (next != cut.end() && *next < moved) *write++ = *next++;
      *write++ = moved;
    }
    while (next != cut.end()) *write++ = *next++;
    out.resize(std::size_t(write - out.data()));
  }

  const TriangleMesh& mesh_;
  const BoxPads& pads_;
  const CostModel& model_;
};

}  // namespace

void build_sweep(const TriangleMesh& mesh, const BoxPads& pads, const BuilderParameters&, const CostModel& model,
                 const Limits& limits, const Bounds3f& cell, Part& out, BuildReport& report) {
  PhaseClock phase(report);
  Sweep::State root;
  root.references = make_references(mesh, pads);
  Sweep::start(root);
  phase.ends("sort");
  const Sweep method(mesh, pads, model);
  TopDown<Sweep>(method, model, limits).build(std::move(root), cell, out);
  phase.ends("splits");
}

}  // namespace arboretum::kdtree
