// The one list of intersectors: a line for each header under intersectors/.
//
// To add one, write intersectors/<name>.h with a struct as in intersectors/leaf_block.h and put a line here. The build
// reads these lines (cmake/Intersectors.cmake): the intersector is then compiled for every instruction set and there
// for every structure and way of traversal. What it promises, and what `list` says of it, has an entry in
// intersectors/promises.h and a row in docs/numerics.md; which blocks it reads, one in tests/test_leaf_tests.cpp: tests
// fail until these are there.
#include "intersectors/moller_trumbore.h"
#include "intersectors/moller_trumbore_double.h"
#include "intersectors/pluecker.h"
#include "intersectors/pluecker_double.h"
#include "intersectors/watertight.h"
#include "intersectors/watertight_refined.h"
#include "intersectors/baldwin_weber.h"
#include "intersectors/havel_herout.h"
#include "intersectors/wald_projection.h"
#include "intersectors/exact.h"
