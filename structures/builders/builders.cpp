#include "structures/builders/builders.h"

#include "core/error.h"

namespace arboretum {

namespace isa_scalar { extern const BinaryBuilder kBinnedSah; }
namespace isa_sse { extern const BinaryBuilder kBinnedSah; }
namespace isa_avx2 { extern const BinaryBuilder kBinnedSah; }
namespace isa_avx512 { extern const BinaryBuilder kBinnedSah; }

BinaryBuilder binary_builder(std::string_view name, Isa isa) {
  if (name != "binned_sah") throw UserError("no builder '" + std::string(name) + "' makes a binary tree; use binned_sah");
  switch (isa) {
    case Isa::scalar: return isa_scalar::kBinnedSah;
    case Isa::sse: return isa_sse::kBinnedSah;
    case Isa::avx2: return isa_avx2::kBinnedSah;
    case Isa::avx512: return isa_avx512::kBinnedSah;
  }
  return nullptr;
}

}  // namespace arboretum
