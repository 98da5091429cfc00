// The rows of Embree: its robust scene stands for `pluecker` and `padded` on triangle4v, its default scene
// for `moller_trumbore` and `fast` on triangle4. The kernels are Embree's own; which instruction set they use
// was settled when the scene was built, so these functions are thin and check only that row and scene agree.
#pragma once

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <bool Robust>
struct EmbreeSingle {
  static const embree::EmbreeAccel& scene(const Accel& accel) {
    return static_cast<const embree::EmbreeAccel&>(accel).expect(kIsa, Robust);
  }
  static void closest_hit(const Accel& a, const KernelRow&, RayBatch r, std::span<Hit> h, Counters*) {
    scene(a).intersect_single(r.rays, h);
  }
  static void any_hit(const Accel& a, const KernelRow&, RayBatch r, std::span<std::uint8_t> h, Counters*) {
    scene(a).occluded_single(r.rays, h);
  }
};

inline void add_kernels(std::type_identity<embree::EmbreeAccel>, KernelRows& rows) {
  if constexpr (kIsa != Isa::scalar) {
    constexpr std::string_view name = embree::EmbreeAccel::kName;
    rows.push_back({name, "triangle4", "moller_trumbore", "fast", "single", kIsa, nullptr,
                    {&EmbreeSingle<false>::closest_hit, &EmbreeSingle<false>::any_hit}, {}});
    rows.push_back({name, "triangle4v", "pluecker", "padded", "single", kIsa, nullptr,
                    {&EmbreeSingle<true>::closest_hit, &EmbreeSingle<true>::any_hit}, {}});
  }
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
