#include "structures/builders/phase_clock.h"

#include "core/timer.h"

namespace arboretum {

PhaseClock::PhaseClock(BuildReport& report) noexcept : report_(report), start_(wall_seconds()) {}

void PhaseClock::ends(const char* name) {
  const double now = wall_seconds();
  report_.phases.emplace_back(name, now - start_);
  start_ = now;
}

}  // namespace arboretum
