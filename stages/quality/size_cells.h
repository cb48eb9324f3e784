#pragma once
// Inside the room only: what is rendered at one of the table's displayed heights, and what follows from it.
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

}  // namespace texmesh
