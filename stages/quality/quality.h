#pragma once
#include "format/documents/tables.h"
#include "stages/data/fragments.h"
#include "stages/data/ladder.h"
#include "stages/data/nested_scales.h"
#include "stages/data/perceptual_values.h"
#include "stages/data/pixels.h"
#include "stages/data/previews.h"
#include "stages/data/stage.h"

namespace texmesh {

inline constexpr int kQualityVersion = 23;

struct QualityOptions {
  int views = 4;
  int large_views = 2;
  int largest_px = 1024;
  int rung_samples = 3;
  double flip_mean = 0.05;
  double flip_p95 = 0.15;
  static void fields(auto& s, auto&& v) {
    v("views", s.views, Range{1, 64},
      "directions in which a scale must pass at displayed heights up to a quarter of the largest");
    v("large_views", s.large_views, Range{1, 64},
      "as many of the views show scales at larger heights, and all else");
    v("largest_px", s.largest_px, Range{128, 2048},
      "largest displayed height of the object that is rendered");
    v("rung_samples", s.rung_samples, Range{1, 16}, ProfileOnly{},
      "rungs that are rendered, spread over the ladder");
    v("flip_mean", s.flip_mean, Range{0, 1},
      "mean FLIP of a view up to which a scale counts as equal to S_0");
    v("flip_p95", s.flip_p95, Range{0, 1},
      "FLIP of the 95th percentile of a view's pixels up to which a scale counts as equal to S_0");
  }
};

/// Renders kept scales and sampled rungs with the reference renderer (stages/render), in the studio's light,
/// and compares each picture with that of S_0 and the source's images, over the pixels that either covers.
/// The reference is what viewers of the source show: its mips mix what no chart covers into charts' borders.
/// FLIP as published and SSIM of luma (stages/measure/flip.h). Means and
/// percentiles are of the pixels of all views together.
/// - Pictures: perspective, 4 x 4 samples a pixel. The camera frames the object's bounding sphere. The
///   displayed height is the length on screen that O_V has at the sphere's centre. All maps of the material
///   show that the renderer knows: base colour with alpha, metallic-roughness, normal, occlusion, emission;
///   all of them read with mips, whatever the sampler says, where scales are compared, and as the source's
///   samplers read where textures are. Where views show far more of the object than 30,000 pixels, bands of
///   96 rows are rendered and compared, evenly spread, at least two in each view.
///   Of meshes of more than a million triangles each height is shown by the coarsest kept scale that has four
///   or more triangles for every pixel of the height's square, and so stands for all finer ones.
/// - Heights: largest_px, its half and so on down to kLeastSwitchPx; half octaves between for scales alone
///   that pass the height below and fail the one above. The table's sizes are the largest, its half and its
///   quarter. A model of few texels and triangles is not rendered at all of them: down to a quarter of
///   largest_px the largest rendered height, which "largest size" means below, is the first at which texels
///   are not smaller than 0.7 pixels (1 where samplers read level 0 alone) and triangles cover 16 pixels on
///   average. Scales that pass there are
///   rendered at larger heights as well. Sizes beyond follow from the two largest rendered ones
///   (table_fit.h: enlarge()).
/// - Switch sizes: a scale passes a height when in every view the mean of FLIP is at most flip_mean and its
///   95th percentile at most flip_p95. The switch size is the largest height such that the scale passes it
///   and all lower ones that are looked at; 0 = it passes nowhere. FLIP publishes no thresholds: these are
///   our own. S_0 has kAnyDisplayPx.
/// - Views: all at heights up to a quarter of the largest, which the table's least size is; `large_views` of
///   them for scales at larger heights, for coarser mips and for samples of everything together; every second
///   one of these for textures at larger sizes. Textures of a model of few texels and triangles are shown in
///   `large_views` at the least size, too. 0.9 of both thresholds count where fewer than 12 views speak,
///   0.8 where fewer than 6 do: the worst of 12 is up to 1.24 times the worse of two. Losses of fewer views
///   than at the size below are corrected by what these views were among all there.
/// - Geometry: at the least size all scales are rendered; at the half those that still pass, every second
///   other one and the coarsest; at the largest those that still pass, the finest and the coarsest. The
///   others follow by the ratio to the size below, linear between the neighbours in the list of scales. Of
///   models of few texels and triangles, those that no longer pass have half the views, and grow from the
///   half to the largest size as enlarge() has it.
/// - Groups: one group's planes are coded, the others have the source's texels. At the least size
///   `rung_samples` of the ladder are rendered, first and last among them, and planes without coding: those
///   that are shown, up to 4 levels finer and 2 coarser; of full size the source's rung, where there is one.
///   At larger sizes the lowest rung and the planes that are shown are rendered, and one coarser level of
///   these: at the half always, at the largest of textures that have no finer plane for it. One that is not
///   rendered loses at least what the same plane loses at the size below. The half has the
///   highest rung, too, and all sizes have previews. Other rungs follow along the curve of what coding adds
///   at the size below, by GroupCurve::kLossPerDoubling where texels are larger on the screen, and by the
///   ratio to it where both were rendered; a highest rung that was not has a ratio of 1. Each size has the
///   knots of the others that lie far from its own: mips have few rungs. Of a model with a sampler that reads
///   level 0 alone, all of this is rendered at every size. The largest size of a model of few texels and
///   triangles has the lowest rung and a coarser level alone. Planes are those that a client shows at the
///   size (format/rules/viewing.h). Planes of one group have the rung whose quality is nearest to that of the
///   group's first plane. FLIP of knots is scaled so that the mean over fragments of GroupCurve::coded() is
///   what was measured for whole planes.
/// - Exponent and error: of samples with all groups changed, on S_0 and on coarser scales, with the lowest
///   rung, the coarsest mips or the previews, 7 at the least size and 1 at the half, the exponent that
///   predicts best. Of models of few texels and triangles, what was fitted over many of these.
/// - Where S_0 covers next to nothing of the pictures (a scan and a stray triangle a thousand times its size
///   away), they show the place in which nearly all positions lie, and a warning says what they leave out.
///   Heights are then that place's.
/// - What shows in no picture at all (a thread thinner than a sample, specks, an alpha of 0 everywhere) has
///   no measured difference: all losses are 0, all scales pass everywhere, and a warning says so.
/// `images` are the model's. InputError for an image that does not decode, StageError for one that is missing
/// and when S_0 has no extent. Same bytes for any thread count and machine.
MeasuredQuality measure_quality(const NestedScales& scales, const PerceptualValues& perceptual,
                                const std::vector<Material>& materials, const std::vector<Image>& images,
                                const Fragments& fragments, const std::vector<Pixels>& pixels,
                                const Ladder& ladder, const Previews& previews, const PackageTables& tables,
                                const QualityOptions& options, const RunContext& context);

}  // namespace texmesh
