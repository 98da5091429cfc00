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
#include <functional>
#include <memory>
#include <new>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "core/coordinates.h"
#include "core/error.h"
#include "core/memory_meter.h"
#include "structures/builders/embree_splits.h"
#include "structures/builders/linked_tree.h"
#include "structures/builders/phase_clock.h"

namespace arboretum {
namespace {

constexpr unsigned kMaxDepth = 128;    ///< deeper down Embree halves ranges without a look
constexpr float kLargest = 1.844e18f;  ///< Embree's own bound on coordinates
constexpr std::size_t kGrain = 1u << 12;

/// What the callbacks make, in Embree's memory. A leaf has no children; it may have no references.
struct Node {
  Bounds3f box[2];  ///< the children's; a leaf's own in the first
  Node* child[2];
  std::uint32_t count;  ///< a leaf's references, which stand behind it
  [[nodiscard]] bool is_leaf() const noexcept { return child[0] == nullptr; }
  [[nodiscard]] bool is_empty() const noexcept { return is_leaf() && count == 0; }
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

/// What the split callback reads. Embree hands it a reference itself to be cut, and a copy while it counts parts.
struct SplitContext {
  SplitContext(const TriangleMesh& mesh, const MeteredVector<RTCBuildPrimitive>& references)
      : splits(mesh), begin(references.data()), end(references.data() + references.size()) {}

  EmbreeSplits splits;
  const RTCBuildPrimitive *begin, *end;
  [[nodiscard]] bool holds(const RTCBuildPrimitive* primitive) const noexcept {
    return !std::less<>()(primitive, begin) && std::less<>()(primitive, end);
  }
};

void split_primitive(const RTCBuildPrimitive* primitive, unsigned dimension, float position, RTCBounds* left,
                     RTCBounds* right, void* context) {
  auto& c = *static_cast<SplitContext*>(context);
  const RTCBuildPrimitive& p = *primitive;
  const Bounds3f box{{p.lower_x, p.lower_y, p.lower_z}, {p.upper_x, p.upper_y, p.upper_z}};
  Bounds3f low, high;
  c.splits.split(p.primID, box, int(dimension), position, !c.holds(primitive), low, high);
  const auto write = [](const Bounds3f& b, RTCBounds& out) {
    out = {b.lower.x, b.lower.y, b.lower.z, 0.0f, b.upper.x, b.upper.y, b.upper.z, 0.0f};
  };
  write(low, *left), write(high, *right);
}

/// Embree's tree as ours. Where a child is an empty leaf, its sibling stands for the node.
class Reader {
 public:
  Reader(const Node& top, LinkedTree& out) : out_(out) {
    const Node& root = filled(top);
    Bounds3f box = root.box[0];
    if (!root.is_leaf()) box.extend(root.box[1]);
    count(root);
    out_.nodes.resize(nodes_), out_.primitives.resize(references_);
    nodes_ = references_ = 0;
    out_.root = copy(root, box);
  }

 private:
  static const Node& filled(const Node& top) noexcept {
    const Node* node = &top;
    while (!node->is_leaf() && (node->child[0]->is_empty() || node->child[1]->is_empty()))
      node = node->child[node->child[0]->is_empty() ? 1 : 0];
    return *node;
  }

  void count(const Node& node) noexcept {
    ++nodes_, references_ += node.count;
    if (!node.is_leaf()) count(filled(*node.child[0])), count(filled(*node.child[1]));
  }

  std::uint32_t copy(const Node& node, const Bounds3f& box) noexcept {
    const std::uint32_t index = nodes_++;
    if (node.is_leaf()) {
      std::copy_n(node.ids(), node.count, out_.primitives.begin() + references_);
      out_.nodes[index] = LinkedNode::leaf(box, references_, node.count);
      references_ += node.count;
    } else {
      const std::uint32_t left = copy(filled(*node.child[0]), node.box[0]);
      out_.nodes[index] = LinkedNode::inner(box, left, copy(filled(*node.child[1]), node.box[1]));
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
    std::optional<SplitContext> context;
    if (spatial) {
      context.emplace(mesh, primitives);
      arguments.splitPrimitive = &split_primitive, arguments.userPtr = &*context;
    }
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
