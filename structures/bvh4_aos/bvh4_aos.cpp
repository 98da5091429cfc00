#include "structures/bvh4_aos/bvh4_aos.h"

#include "structures/bvh/wide_bvh.h"

namespace arboretum::bvh {

template class WideBvh<bvh4_aos::AosNodes>;

}  // namespace arboretum::bvh
