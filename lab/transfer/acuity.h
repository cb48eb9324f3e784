#pragma once
#include <algorithm>

namespace texmesh {

constexpr double kFoveaRadius_degrees = 0.5, kHalfAcuity_degrees = 2.3;

/// What somebody resolves so many degrees beside the point that they look at, as a part of what they resolve
/// at that point (thesis 5.2, 10.1): 1 in the fovea, the central degree; outside of it the finest detail that
/// is seen grows in proportion to the distance and has doubled 2.3 degrees beyond. The browser client goes by
/// it, with the same bits. `degrees` >= 0.
inline double acuity_at(double degrees) {
  return kHalfAcuity_degrees / (kHalfAcuity_degrees + std::max(0.0, degrees - kFoveaRadius_degrees));
}
/// What a loss counts there: the square, since detail is lost in two directions.
inline double gaze_weight(double degrees) { return acuity_at(degrees) * acuity_at(degrees); }

}  // namespace texmesh
