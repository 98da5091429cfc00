// The one list of intersectors: a line for each header under intersectors/.
//
// To add one, write intersectors/<name>.h with a struct as in intersectors/leaf_block.h and put a line here. The build reads these
// lines (cmake/Intersectors.cmake): the intersector is then compiled for every instruction set and there for every structure and way of traversal.
#include "intersectors/moller_trumbore.h"
#include "intersectors/pluecker.h"
#include "intersectors/watertight.h"
#include "intersectors/exact.h"
