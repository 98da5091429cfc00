// The rows of Embree: its robust scene stands for `pluecker` and `padded` on triangle4v, its default scene
// for `moller_trumbore` and `fast` on triangle4, its compact scene for the same on triangle4i. The kernels are Embree's
// own; which instruction set they use was settled when the scene was built, so these functions are thin and check only
// that row and scene agree.
//
// Packets and streams stand three times: with the coherent flag as the batch says (primary rays alone), always and
// never. Neither is always the faster one (docs/performance.md).
#pragma once

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

enum class CoherentFlag { of_batch, always, never };

template <embree::Form F, embree::Mode M, CoherentFlag C>
struct EmbreeRow {
  static const embree::EmbreeAccel& scene(const Accel& accel) {
    return static_cast<const embree::EmbreeAccel&>(accel).expect(kIsa, F);
  }
  static RayBatch flagged(RayBatch rays) {
    if constexpr (C != CoherentFlag::of_batch) rays.coherent = C == CoherentFlag::always;
    return rays;
  }
  static void closest_hit(const Accel& a, const KernelRow&, RayBatch r, std::span<Hit> h, Counters*) {
    scene(a).closest_hit(M, flagged(r), h);
  }
  static void any_hit(const Accel& a, const KernelRow&, RayBatch r, std::span<std::uint8_t> h, Counters*) {
    scene(a).any_hit(M, flagged(r), h);
  }
};

/// A mode's row for each kind of scene.
template <embree::Mode M, CoherentFlag C>
void add_embree_rows(KernelRows& rows, std::string_view traversal) {
  using embree::Form;
  const auto add = [&]<Form F>(Value<F>, std::string_view leaf, std::string_view intersector, std::string_view box) {
    using Row = EmbreeRow<F, M, C>;
    rows.push_back({embree::EmbreeAccel::kName,
                    leaf,
                    intersector,
                    box,
                    traversal,
                    kIsa,
                    nullptr,
                    {&Row::closest_hit, &Row::any_hit},
                    {}});
  };
  add(Value<Form::triangle4>{}, "triangle4", "moller_trumbore", "fast");
  add(Value<Form::triangle4v>{}, "triangle4v", "pluecker", "padded");
  add(Value<Form::triangle4i>{}, "triangle4i", "moller_trumbore", "fast");
}

template <embree::Mode M>
void add_flagged_rows(KernelRows& rows, std::string_view traversal, std::string_view coherent,
                      std::string_view incoherent) {
  add_embree_rows<M, CoherentFlag::of_batch>(rows, traversal);
  add_embree_rows<M, CoherentFlag::always>(rows, coherent);
  add_embree_rows<M, CoherentFlag::never>(rows, incoherent);
}

/// Packets wider than the registers are left out: Embree takes them apart and traces each ray alone.
inline void add_kernels(std::type_identity<embree::EmbreeAccel>, KernelRows& rows) {
  using embree::Mode;
  if constexpr (kIsa != Isa::scalar) {
    add_embree_rows<Mode::single, CoherentFlag::of_batch>(rows, "single");
    add_flagged_rows<Mode::packet4>(rows, "packet4", "packet4_coherent", "packet4_incoherent");
    if constexpr (kIsa >= Isa::avx2)
      add_flagged_rows<Mode::packet8>(rows, "packet8", "packet8_coherent", "packet8_incoherent");
    if constexpr (kIsa >= Isa::avx512)
      add_flagged_rows<Mode::packet16>(rows, "packet16", "packet16_coherent", "packet16_incoherent");
    if (embree::has_streams()) add_flagged_rows<Mode::stream>(rows, "stream", "stream_coherent", "stream_incoherent");
  }
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
