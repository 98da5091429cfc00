// BatchStack: the stack of one batch's rays, on this frame while the tree is shallow, on the heap when it is deeper.
#pragma once

#include "simd/simd.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <class Entry, std::size_t Inline>
class BatchStack {
 public:
  explicit BatchStack(std::size_t entries) {
    if (entries > Inline) heap_.resize(entries), data_ = heap_.data();
  }
  BatchStack(const BatchStack&) = delete;
  BatchStack& operator=(const BatchStack&) = delete;
  [[nodiscard]] Entry* data() noexcept { return data_; }

 private:
  Entry inline_[Inline];
  std::vector<Entry> heap_;
  Entry* data_ = inline_;
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
