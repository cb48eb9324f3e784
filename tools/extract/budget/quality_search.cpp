#include "tools/extract/budget/quality_search.h"

#include <algorithm>

#include "format/base/portable_math.h"

namespace texmesh {

double quality_for(double wanted, double start, double near, int tries,
                   const std::function<std::uint64_t(double)>& bytes) {
  double low = kLowestQuality, high = kHighestQuality, at = std::clamp(start, low, high);
  double low_bytes = 0, high_bytes = 0, best = kLowestQuality;
  for (int i = 0; i < tries && high - low > 0.01; ++i) {
    const auto found = static_cast<double>(bytes(at));
    if (found <= wanted) {
      best = std::max(best, at);
      low = at, low_bytes = found;
      if (found >= near * wanted || at >= kHighestQuality) break;
    } else {
      high = at, high_bytes = found;
      if (at <= kLowestQuality) break;
    }
    // Bytes grow about as exp(quality / 30) in the middle of the scale.
    double next = at + 30 * portable::log(std::max(wanted, 1.0) * (1 + near) / 2 / std::max(found, 1.0));
    if (low_bytes > 0 && high_bytes > low_bytes)
      next = low + (high - low) * portable::log(wanted * (1 + near) / 2 / low_bytes) /
                       portable::log(high_bytes / low_bytes);
    // Never nearer to an end than a tenth of what is left, so that a bent curve does not stall the search.
    const double margin = (high - low) * 0.1;
    at = std::clamp(next, low_bytes > 0 ? low + margin : kLowestQuality,
                    high_bytes > 0 ? high - margin : kHighestQuality);
  }
  return best;
}

}  // namespace texmesh
