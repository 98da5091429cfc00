// One translation unit of the builders for one ISA; the stub defines ARBORETUM_TARGET.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <limits>
#include <mutex>
#include <utility>
#include <vector>

#include <immintrin.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

#include "core/isa.h"
#include "core/mesh.h"
#include "structures/builders/builders.h"
#include "structures/builders/clip.h"
#include "structures/builders/node_pool.h"
#include "structures/builders/one_task.h"
#include "structures/builders/phase_clock.h"

#include "simd/target.h"
#include "simd/target_begin.h"
#include "structures/builders/binned_sah.h"
#include "structures/builders/spatial_sah.h"
#include "simd/target_end.h"

namespace arboretum::ARBORETUM_ISA_NAMESPACE {
extern const BinaryBuilder kBinnedSah;
const BinaryBuilder kBinnedSah = &build_binned_sah;
extern const BinaryBuilder kSpatialSah;
const BinaryBuilder kSpatialSah = &build_spatial_sah;
}  // namespace arboretum::ARBORETUM_ISA_NAMESPACE
