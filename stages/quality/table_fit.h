#pragma once
// Inside the room only: what is rendered at one of the table's displayed heights, and from losses of these
// samples to what clients read between them.
//
// A client predicts how any choice of mips and rungs looks. It reads a small table: for each of three
// displayed heights and each group of planes a curve of FLIP over 1 - SSIM, and one exponent that says how
// losses of geometry and of several groups add up. Only some pictures are rendered. Here the others are
// filled in, and the curves and the exponent are searched:
// 1. along_curve() and coarser_along() read what was not rendered at a height from the curves of the height
//    below, for texels as large on the screen.
// 2. fit_exponent() tries a grid of exponents on the pictures in which everything was changed at once, and
//    keeps the one with the least mean error.
// 3. texture_losses() sorts a group's knots, takes off what its mips lose without coding, and scales the
//    curve until its mean over fragments is what whole planes lost: three steps, which bring it near enough.
// 4. lend_knots() gives each height knots of the others; enlarge() adds heights that are not worth rendering.
// All loops run over knots, heights and fixed numbers of steps, so the fit ends, and equal pictures give
// equal tables.
//
// Samplers that read level 0 alone have rules of their own: their texels flicker where they are smaller than
// pixels. What is lost there is a matter of chance, so it follows neither from a smaller size nor from
// pictures of the same texels read with mips.
#include "stages/quality/quality.h"
#include "stages/quality/shots.h"

namespace texmesh {

/// What pictures of one list lose; an element without losses was not rendered.
using LossCells = std::vector<Losses>;

/// How all groups are shown together: at their last knot, in the coarsest mips, by previews.
enum class Together : std::uint8_t { kCoded, kCoarser, kPreview };
struct TogetherCell {
  std::size_t scale = 0;
  Together shown = Together::kCoded;
  Losses losses;
};

struct GroupCells {
  std::vector<Knot> knots;
  double texel_level = 0;  // texel_level() of the planes
  std::vector<ShownMip> mips;
  LossCells coded;    // per knot
  LossCells preview;  // one
  LossCells finer;    // 0, 1, 2 .. levels
  LossCells coarser;  // 1, 2 .. levels
};

struct SizeCells {
  double displayed_px = 0;
  LossCells geometry;  // per kept scale; S_0 stays empty
  std::vector<GroupCells> groups;
  std::vector<TogetherCell> together;
};

inline constexpr std::size_t kCoarserLevels = 2, kFinerLevels = 4;

/// What the textures of one size are made from.
struct TextureSampler {
  const TextureData& data;
  const ShownTextures& shown;
  const std::vector<PlanesOfGroup>& groups;
  int rung_samples = 4;
  double surface_area = 0;
};

/// What is asked of one displayed height.
struct SizeTask {
  /// Per kept scale: the views in which it is rendered with the source's texels. S_0 is not.
  std::vector<std::optional<ViewPart>> scales;
  std::optional<ShotLimits> ends_beyond;  // scales: of no more use behind the first view that is beyond
  std::optional<std::size_t>
      rank;  // of the table's sizes, 0 = the least: textures are rendered as quality.h says
};
/// Fills `cells`, whose height is given. The studio's textures are the source's, before and behind.
void render_size(const TextureSampler& sampler, const SizeTask& task, Studio& studio, SizeCells& cells,
                 const RunContext& context);

/// Losses of a list of cells at the size below, and what they say of cells that were not rendered.
struct SmallerSize {
  const LossCells& cells;
  const PictureLosses& measured;  // losses_of() them
  PictureLosses losses;           // per cell of the larger size: what the smaller one would have
  bool first_follows = false;     // the first cell is as at the smaller size, where it was not rendered
};
/// Losses of a list of cells. Those with fewer views than at the size below are corrected by what these views
/// were there beside the cell's losses. Those that were not rendered follow by the ratio of rendered
/// neighbours.
PictureLosses losses_of(const LossCells& cells, const SmallerSize* smaller);

inline constexpr std::size_t kTextureSizes = 3;  // that show textures

/// How often the largest height is halved for pictures of textures, below kTextureSizes. Beyond the height at
/// which texels are as large as pixels and triangles as large as 16 pixels, pictures are enlarged ones: what
/// they lose follows (enlarge()). `triangles` of the finest scale.
std::size_t fewer_heights(const TextureSampler& sampler, std::size_t triangles, double object_height,
                          const QualityOptions& options);

/// Whether scales, which are looked at with mips, and textures, which are looked at as samplers read them,
/// are compared with the same pictures.
bool have_one_reference(const ShownTextures& shown);

/// Short ladders have no other rung.
bool repeats(const Knot& knot, const Knot& before);

/// The knots that are rendered: all, at larger sizes that of the lowest rung, and at the half that of the
/// highest one: from a mip with a single rung, as small sizes show it, nothing follows for another mip's best
/// rung. Without mips losses do not follow from smaller sizes.
bool is_sampled(const TextureSampler& sampler, const std::vector<Knot>& knots, std::size_t knot,
                std::size_t rank);

/// Levels of source's texels that are rendered.
struct MipSamples {
  std::size_t finer = 0, coarser = 0;
};
/// At larger heights the planes that are shown, and the next coarser ones where textures have no finer planes
/// for them, and once for all. Without mips all at every height.
MipSamples mip_samples(const TextureSampler& sampler, std::size_t rank, const Display& display,
                       const PlanesOfGroup& group);

/// What the pictures of one group and size lose.
struct GroupPictures {
  PictureLosses coded, preview, finer, coarser;  // as in GroupCells
};

/// Whether scales, previews and finer mips of that size follow from the two sizes below, where texels and
/// triangles are few: all but the lowest rung and a coarser mip.
bool follows_below(const TextureSampler& sampler, std::size_t rank);

/// Of the growth to one height, what is left to the next. Geometry of saxophone, turtle, helmet and small
/// models: .5 to .9 (of 256 to 512 beside 512 to 1024 px); previews: .3 to .7.
inline constexpr double kGeometryGrows = 0.6, kPreviewGrows = 0.5;
/// What is lost at twice the height: grown by `part` of the growth from `smaller`, element by element.
PictureLosses enlarged(const PictureLosses& from, const PictureLosses& smaller, double part);

/// What losses.coded, those per knot of `smaller`, would be for the knots of a larger size: along the curve
/// that clients read, for texels as large on the screen as those of the larger size. The curve is of what
/// coding adds to losses.finer[0], the planes without coding; `finer` are theirs at the larger size. Squares
/// are added: the exponent is not known yet, and 2 is a common one.
PictureLosses along_curve(const GroupCells& larger, const GroupCells& smaller, const GroupPictures& losses,
                          const PictureLosses& finer);
/// The same of coarser mips: where there are no finer planes for the larger size, its mips are as large on
/// the screen as coarser ones of the smaller size, and lose less by what full size has become coarser.
PictureLosses coarser_along(const GroupCells& larger, const GroupCells& smaller, const GroupPictures& losses);
/// Raises `coarser` of the larger size, where it was not rendered, to what the same planes lose at the
/// smaller one: between two levels the texels of small charts run together, and no ratio of others tells of
/// it.
void raise_to_smaller(const GroupCells& larger, const GroupCells& smaller, const GroupPictures& losses,
                      PictureLosses& coarser);
/// Of the planes that a size shows, by their parts of the surface.
double mean_mip(const GroupCells& group);

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
