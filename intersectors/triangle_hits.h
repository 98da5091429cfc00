// What an intersector gives back for W lanes: t, and u and v as numerators over one denominator, divided only for the
// lane that wins.
#pragma once

#include "simd/simd.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <int W>
struct TriangleHits {
  vf<W> t;
  vf<W> u_numerator, v_numerator, denominator;
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
