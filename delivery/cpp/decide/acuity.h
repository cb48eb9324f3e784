#pragma once

namespace texmesh {

/// What somebody resolves so many degrees beside the point that they look at, as a part of what they resolve
/// at that point (thesis 5.2, 10.1): 1 in the fovea, the central degree; outside of it the finest detail that
/// is seen grows in proportion to the distance and has doubled 2.3 degrees beyond. Plain double arithmetic,
/// the same bits in delivery/web/src/decide/acuity.ts. `degrees` >= 0.
double acuity_at(double degrees);
/// What a loss counts there: the square, since detail is lost in two directions.
double gaze_weight(double degrees);

}  // namespace texmesh
