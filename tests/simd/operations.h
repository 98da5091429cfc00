// The operations of simd/ as function pointers on 32-bit patterns: one table for each ISA, compiled for it.
#pragma once

#include <cstdint>

namespace arboretum::simd_test {

/// Reads W patterns of each input, writes W patterns. Floats and ints are passed by their bits, masks as 0 or
/// 1 a lane.
struct Operation {
  const char* name;
  void (*run)(const std::uint32_t* a, const std::uint32_t* b, const std::uint32_t* c, std::uint32_t* out);
};

struct OperationTable {
  const Operation* first;
  int count;
  bool has_fma;
};

/// One function an ISA; `width` is 4, 8 or 16. Only call it, and what it gives, where the machine has the
/// ISA.
OperationTable operations_scalar(int width);
OperationTable operations_sse(int width);
OperationTable operations_avx2(int width);
OperationTable operations_avx512(int width);

}  // namespace arboretum::simd_test
