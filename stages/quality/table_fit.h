#pragma once
// Inside the room only: from losses of samples to what clients read between them.
#include "stages/quality/size_cells.h"

namespace texmesh::quality {

/// What `losses`, those per knot of `smaller`, would be for the knots of a larger size: along the curve that
/// clients read, for texels as large on the screen as those of the larger size.
PictureLosses along_curve(const GroupCells& larger, const GroupCells& smaller, const PictureLosses& losses);

/// `coded` per knot of the group, `coarser` per level. Knots by rising 1 - SSIM, those that repeat one are
/// left out. FLIP rises, and is scaled so that the weighted mean over fragments of GroupCurve::coded() comes
/// as near as three steps of iteration bring it.
TextureLosses texture_losses(const std::vector<Knot>& knots, const PictureLosses& coded,
                             PictureLosses preview, PictureLosses coarser);

/// What the table's parts say of a sample, and what was measured.
struct TogetherLoss {
  std::vector<double> parts;
  double measured = 0;
};
/// Sets exponent and error: the exponent of a grid over 1..4 that predicts with the least mean relative
/// error. 1 and 0 without samples.
void fit_exponent(const std::vector<TogetherLoss>& samples, QualityTable& table);

}  // namespace texmesh::quality
