// The one list of structures: a line for each folder under structures/.
//
// To add one, write structures/<folder>/<name>.h, which declares `namespace arboretum::<folder> { using Structures =
// TypeList<...>; }`, its .cpp files, and <name>_kernels.h beside it, and put a line here. The build reads these lines
// (cmake/Structures.cmake): the structure is then built, listed, swept, tested and plotted (docs/add-a-structure.md).
#pragma once

#include "structures/bih/bih.h"
#include "structures/brute_force/brute_force.h"
#include "structures/bvh/bvh.h"
#include "structures/bvh4_aos/bvh4_aos.h"
#include "structures/bvh4_motion/bvh4_motion.h"
#include "structures/bvh_quantised/bvh_quantised.h"
#include "structures/embree/embree.h"
#include "structures/grid/grid.h"
#include "structures/kdtree/kdtree.h"
#include "structures/octree/octree.h"
#include "structures/two_level/two_level.h"
