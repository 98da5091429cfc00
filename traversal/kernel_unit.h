// What every kernel unit includes before its ISA begins: standard headers and the project's baseline headers, so that
// nothing of them is compiled for the ISA. Units are generated (cmake/ArboretumStructures.cmake).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <new>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <immintrin.h>

#include "core/exact/hit_arithmetic.h"
#include "core/isa.h"
#include "core/ray.h"
#include "core/type_list.h"
#include "intersectors/blocks.h"
#include "intersectors/leaf_tests.h"
#include "structures/accel.h"
#include "structures/leaves/leaf_form.h"
#include "traversal/counting.h"
#include "traversal/kernel_table.h"
#include "traversal/ray_order.h"

#include "simd/target.h"
