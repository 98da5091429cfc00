#include "structures/parameter_checks.h"

#include <bit>
#include <sstream>
#include <string>

#include "core/error.h"

namespace arboretum {
namespace {

template <class T>
void require(std::string_view parameter, T value, T lowest, T highest) {
  if (value >= lowest && value <= highest) return;
  std::ostringstream message;
  message << parameter << ": " << value << " is not within " << lowest << " .. " << highest;
  throw UserError(message.str());
}

}  // namespace

void require_within(std::string_view parameter, unsigned value, unsigned lowest, unsigned highest) {
  require(parameter, value, lowest, highest);
}

void require_within(std::string_view parameter, float value, float lowest, float highest) {
  require(parameter, value, lowest, highest);
}

void require_bins(unsigned bins) { require_within("bins", bins, kFewestBins, kMostBins); }

void require_triangles(std::string_view structure, std::size_t triangles, std::size_t most) {
  if (triangles <= most) return;
  throw UserError(std::string(structure) + " takes at most 2^" + std::to_string(std::bit_width(most)) +
                  " - 1 triangles");
}

}  // namespace arboretum
