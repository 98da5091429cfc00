// Untimed work before a cell's first repetition: so many passes, and so many seconds, whichever lasts longer.
#pragma once

#include "core/timer.h"

namespace arboretum {

template <class Pass>
void warm_up(unsigned passes, double seconds, const Pass& pass) {
  const double end = wall_seconds() + seconds;
  for (unsigned done = 0; done < passes || (seconds > 0.0 && wall_seconds() < end); ++done) pass();
}

}  // namespace arboretum
