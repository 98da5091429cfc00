#include "structures/archive.h"

#include <ostream>

#include "core/error.h"
#include "structures/accel.h"

namespace arboretum {
namespace {

constexpr const char* kOtherLayout =
    "was saved by a build of arboretum that lays this structure out differently; build and save it again";

}  // namespace

void Archive::expect(std::uint64_t meaning) {
  std::uint64_t saved = meaning;
  value(saved);
  if (saved != meaning) throw UserError(kOtherLayout);
}

void Archive::value(std::string& text) {
  const std::size_t count = length(text.size(), 1);
  if (is_loading()) text.resize(count);
  bytes(text.data(), count);
}

void Archive::value(Arena& arena) {
  const std::size_t count = length(arena.bytes(), 1);
  if (is_loading()) arena = Arena(), arena = Arena(count);
  bytes(arena.data(), count);
}

std::size_t Archive::length(std::size_t count, std::size_t element_bytes) {
  std::uint64_t saved = count;
  value(saved);
  if (is_loading() && saved > rest_.size() / element_bytes) throw UserError(kOtherLayout);
  return static_cast<std::size_t>(saved);
}

void Archive::bytes(void* data, std::size_t count) {
  if (count == 0) return;
  if (out_) {
    out_->write(static_cast<const char*>(data), static_cast<std::streamsize>(count));
    return;
  }
  if (count > rest_.size()) throw UserError(kOtherLayout);
  std::memcpy(data, rest_.data(), count);
  rest_ = rest_.subspan(count);
}

}  // namespace arboretum
