#include "structures/bvh/bvh.h"

#include "structures/bvh/wide_bvh.h"

namespace arboretum::bvh {

template class WideBvh<SoaNodes<2>>;
template class WideBvh<SoaNodes<4>>;
template class WideBvh<SoaNodes<8>>;
template class WideBvh<SoaNodes<16>>;

}  // namespace arboretum::bvh
