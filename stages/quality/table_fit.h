#pragma once
// Inside the room only: from losses of samples to what clients read between them.
//
// A client predicts how any choice of mips and rungs looks. It reads a small table: for each of three
// displayed heights and each group of planes a curve of FLIP over 1 - SSIM, and one exponent that says how
// losses of geometry and of several groups add up. Only some pictures are rendered. Here the others are
// filled in, and the curves and the exponent are searched:
// 1. along_curve() and coarser_along() read what was not rendered at a height from the curves of the height
//    below, for texels as large on the screen.
// 2. fit_exponent() tries a grid of exponents on the pictures in which everything was changed at once, and
// keeps
//    the one with the least mean error.
// 3. texture_losses() sorts a group's knots, takes off what its mips lose without coding, and scales the
// curve
//    until its mean over fragments is what whole planes lost: three steps, which bring it near enough.
// 4. lend_knots() gives each height knots of the others; enlarge() adds heights that are not worth rendering.
// All loops run over knots, heights and fixed numbers of steps, so the fit ends, and equal pictures give
// equal tables.
#include "stages/quality/size_cells.h"

namespace texmesh {

/// What the pictures of one group and size lose.
struct GroupPictures {
  PictureLosses coded, preview, finer, coarser;  // as in GroupCells
};

/// What losses.coded, those per knot of `smaller`, would be for the knots of a larger size: along the curve
/// that clients read, for texels as large on the screen as those of the larger size. The curve is of what
/// coding adds to losses.finer[0], the planes without coding; `finer` are theirs at the larger size. Squares
/// are added: the exponent is not known yet, and 2 is a common one.
PictureLosses along_curve(const GroupCells& larger, const GroupCells& smaller, const GroupPictures& losses,
                          const PictureLosses& finer);
/// The same of coarser mips: where there are no finer planes for the larger size, its mips are as large on
/// the screen as coarser ones of the smaller size, and lose less by what full size has become coarser.
PictureLosses coarser_along(const GroupCells& larger, const GroupCells& smaller, const GroupPictures& losses);

/// The table's part of a group and a size. Knots by rising 1 - SSIM, those that repeat one are left out. Of a
/// knot's FLIP its mips' own is taken off, by the exponent. What is left rises, at most as fast as 1 - SSIM
/// does, and is scaled so that the weighted mean over fragments of GroupCurve::coded() comes as near as three
/// steps of iteration bring it.
TextureLosses texture_losses(const GroupCells& group, GroupPictures pictures, float exponent);

/// Gives each size the knots of the others that lie far from all of its own: mips have few rungs, and clients
/// show others there, too. Losses as for texels as large on the screen as there. `texel_level` per size.
void lend_knots(const std::vector<double>& texel_level, std::vector<TextureLosses>& sizes);

/// Puts a size that is twice the last one in the first one's place: of a table with at least two, whose
/// textures show all their texels at the last one, each as large as a pixel and more. `texel_level`: per
/// group, that of the last size. Differences of geometry and previews grow by a share of what they grew
/// before, those of coarser mips by kMipGrowth at texels of one pixel, and less at larger ones; what coding
/// adds, by GroupCurve::kLossPerDoubling.
void enlarge(const std::vector<double>& texel_level, QualityTable& table);

/// What the table's parts say of a sample, and what was measured.
struct TogetherLoss {
  std::vector<double> parts;
  double measured = 0;
};
/// Sets exponent and error: the exponent of a grid over 1..4 that predicts with the least mean relative
/// error. 1 and 0 without samples.
void fit_exponent(const std::vector<TogetherLoss>& samples, QualityTable& table);

}  // namespace texmesh
