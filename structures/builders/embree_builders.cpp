#include "structures/builders/embree_builders.h"

#if __has_include(<embree3/rtcore.h>)
#include <embree3/rtcore.h>
#else
#include <embree4/rtcore.h>
#endif

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <type_traits>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "core/coordinates.h"
#include "core/error.h"
#include "core/memory_meter.h"
#include "structures/builders/clip.h"
#include "structures/builders/linked_tree.h"
#include "structures/builders/phase_clock.h"

namespace arboretum {
namespace {

constexpr unsigned kMaxDepth = 128;    ///< deeper down Embree halves ranges without a look
constexpr float kLargest = 1.844e18f;  ///< Embree's own bound on coordinates
constexpr std::size_t kGrain = 1u << 12;

/// What the callbacks make, in Embree's memory. A leaf has no children.
struct Node {
  Bounds3f box[2];  ///< the children's; a leaf's own in the first
  Node* child[2];
  std::uint32_t count;  ///< a leaf's references, which stand behind it
  [[nodiscard]] std::uint32_t* ids() noexcept { return reinterpret_cast<std::uint32_t*>(this + 1); }
  [[nodiscard]] const std::uint32_t* ids() const noexcept { return reinterpret_cast<const std::uint32_t*>(this + 1); }
};

Bounds3f to_bounds(const RTCBounds& b) noexcept {
  return {{b.lower_x, b.lower_y, b.lower_z}, {b.upper_x, b.upper_y, b.upper_z}};
}

void* create_node(RTCThreadLocalAllocator allocator, unsigned, void*) {
  return new (rtcThreadLocalAlloc(allocator, sizeof(Node), 16)) Node{};
}

void set_children(void* node, void** children, unsigned count, void*) {
  for (unsigned i = 0; i < count; ++i) static_cast<Node*>(node)->child[i] = static_cast<Node*>(children[i]);
}

void set_bounds(void* node, const RTCBounds** bounds, unsigned count, void*) {
  for (unsigned i = 0; i < count; ++i) static_cast<Node*>(node)->box[i] = to_bounds(*bounds[i]);
}

/// A triangle that several parts of which end in one leaf is referenced once; ids ascend, so that threads leave no
/// trace in their order.
void* create_leaf(RTCThreadLocalAllocator allocator, const RTCBuildPrimitive* primitives, std::size_t count, void*) {
  auto* leaf = new (rtcThreadLocalAlloc(allocator, sizeof(Node) + count * sizeof(std::uint32_t), 16)) Node{};
  for (std::size_t i = 0; i < count; ++i) {
    const RTCBuildPrimitive& p = primitives[i];
    leaf->box[0].extend(Bounds3f{{p.lower_x, p.lower_y, p.lower_z}, {p.upper_x, p.upper_y, p.upper_z}});
    leaf->ids()[i] = p.primID;
  }
  std::sort(leaf->ids(), leaf->ids() + count);
  leaf->count = std::uint32_t(std::unique(leaf->ids(), leaf->ids() + count) - leaf->ids());
  return leaf;
}

/// What of a part of a triangle lies on either side of a plane: the triangle clipped to the side, within the part's
/// box, as Embree clips its own triangles.
void split_primitive(const RTCBuildPrimitive* primitive, unsigned dimension, float position, RTCBounds* left,
                     RTCBounds* right, void* mesh) {
  const RTCBuildPrimitive& p = *primitive;
  const Bounds3f box{{p.lower_x, p.lower_y, p.lower_z}, {p.upper_x, p.upper_y, p.upper_z}};
  const auto corners = static_cast<const TriangleMesh*>(mesh)->corners(p.primID);
  Bounds3f low, high;
  clip_by_plane(corners, int(dimension), position, low, high);
  const auto side = [&](const Bounds3f& part, RTCBounds& out) {
    const Vec3f lower = max(part.lower, box.lower), upper = min(part.upper, box.upper);
    out = {lower.x, lower.y, lower.z, 0.0f, upper.x, upper.y, upper.z, 0.0f};
  };
  side(low, *left), side(high, *right);
}

/// Embree's tree as ours.
class Reader {
 public:
  Reader(const Node& root, LinkedTree& out) : out_(out) {
    Bounds3f box = root.box[0];
    if (root.count == 0) box.extend(root.box[1]);
    count(root);
    out_.nodes.resize(nodes_), out_.primitives.resize(references_);
    nodes_ = references_ = 0;
    out_.root = copy(root, box);
  }

 private:
  void count(const Node& node) noexcept {
    ++nodes_, references_ += node.count;
    if (node.count == 0) count(*node.child[0]), count(*node.child[1]);
  }

  std::uint32_t copy(const Node& node, const Bounds3f& box) noexcept {
    const std::uint32_t index = nodes_++;
    if (node.count > 0) {
      std::copy_n(node.ids(), node.count, out_.primitives.begin() + references_);
      out_.nodes[index] = LinkedNode::leaf(box, references_, node.count);
      references_ += node.count;
    } else {
      const std::uint32_t left = copy(*node.child[0], node.box[0]);
      out_.nodes[index] = LinkedNode::inner(box, left, copy(*node.child[1], node.box[1]));
    }
    return index;
  }

  LinkedTree& out_;
  std::uint32_t nodes_ = 0, references_ = 0;
};

bool on_memory(void*, std::ptrdiff_t bytes, bool) {
  if (bytes >= 0) {
    MemoryMeter::add(std::size_t(bytes));
  } else {
    MemoryMeter::remove(std::size_t(-bytes));
  }
  return true;
}

void build(RTCBuildQuality quality, const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width,
           BinaryTree& tree, BuildReport& report) {
  const std::size_t n = mesh.size();
  if (n == 0) return;
  PhaseClock phase(report);
  const bool spatial = quality == RTC_BUILD_QUALITY_HIGH;
  const std::size_t capacity = spatial ? n + std::size_t(double(n) * parameters.duplication_budget) : n;
  MeteredVector<RTCBuildPrimitive> primitives(capacity);
  std::atomic<bool> too_large{false};
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, n, kGrain), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      const Bounds3f b = mesh.bounds(i);
      if (largest_coordinate(b) > kLargest) too_large = true;
      primitives[i] = {b.lower.x, b.lower.y, b.lower.z, 0, b.upper.x, b.upper.y, b.upper.z, std::uint32_t(i)};
    }
  });
  if (too_large)
    throw UserError("embree's builders take coordinates up to 1.8e18; scale the scene or take one of our builders");
  phase.ends("references");

  const std::unique_ptr<std::remove_pointer_t<RTCDevice>, void (*)(RTCDevice)> device(rtcNewDevice("set_affinity=0"),
                                                                                      &rtcReleaseDevice);
  if (!device) throw std::runtime_error("embree: no device, error " + std::to_string(int(rtcGetDeviceError(nullptr))));
  rtcSetDeviceMemoryMonitorFunction(device.get(), &on_memory, nullptr);
  LinkedTree linked;
  {
    const std::unique_ptr<std::remove_pointer_t<RTCBVH>, void (*)(RTCBVH)> bvh(rtcNewBVH(device.get()), &rtcReleaseBVH);
    RTCBuildArguments arguments = rtcDefaultBuildArguments();
    arguments.buildQuality = quality;
    arguments.maxBranchingFactor = 2, arguments.maxDepth = kMaxDepth;
    arguments.sahBlockSize = std::bit_floor(leaf_width);
    arguments.minLeafSize = quality == RTC_BUILD_QUALITY_LOW ? leaf_width : 1, arguments.maxLeafSize = leaf_width;
    arguments.traversalCost = parameters.traversal_cost, arguments.intersectionCost = parameters.intersection_cost;
    arguments.bvh = bvh.get();
    arguments.primitives = primitives.data(), arguments.primitiveCount = n, arguments.primitiveArrayCapacity = capacity;
    arguments.createNode = &create_node, arguments.createLeaf = &create_leaf;
    arguments.setNodeChildren = &set_children, arguments.setNodeBounds = &set_bounds;
    if (spatial) arguments.splitPrimitive = &split_primitive;
    arguments.userPtr = const_cast<TriangleMesh*>(&mesh);
    auto* root = static_cast<Node*>(rtcBuildBVH(&arguments));  // works in the caller's arena
    if (!root)
      throw std::runtime_error("embree: rtcBuildBVH failed, error " +
                               std::to_string(int(rtcGetDeviceError(device.get()))));
    phase.ends("embree");
    Reader(*root, linked);
  }
  linked.duplicates = spatial;
  tree = lay_out(linked, leaf_width);
  phase.ends("layout");
}

}  // namespace

void build_embree_low(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width,
                      BinaryTree& tree, BuildReport& report) {
  build(RTC_BUILD_QUALITY_LOW, mesh, parameters, leaf_width, tree, report);
}

void build_embree_medium(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width,
                         BinaryTree& tree, BuildReport& report) {
  build(RTC_BUILD_QUALITY_MEDIUM, mesh, parameters, leaf_width, tree, report);
}

void build_embree_high(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width,
                       BinaryTree& tree, BuildReport& report) {
  build(RTC_BUILD_QUALITY_HIGH, mesh, parameters, leaf_width, tree, report);
}

}  // namespace arboretum
