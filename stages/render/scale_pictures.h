#pragma once
#include <map>

// How a model looks beside S_0, and how nested scales with whole textures look for a number of bytes.
#include "stages/data/nested_scales.h"
#include "stages/render/shade.h"

namespace texmesh {

/// False where viewers read all base colours of the source without mip levels. A proxy read with them would
/// look soft beside it: .060 instead of .043 for a building of 150 kB.
bool reads_mip_levels(const std::vector<Material>& materials);

/// Sides of textures, as finer ones show nothing more in small pictures of a model of these materials.
/// Without mip levels they all show.
std::uint32_t enough_side_px(const std::vector<Material>& materials);

/// Displayed heights of the longest side of the bounding box.
inline constexpr double kSmallPx = 128, kMiddlePx = 256, kLargePx = 512, kHugePx = 1024;

/// Pictures of S_0 at one displayed height, from four sides; at kLargePx from two, above from one. Constant
/// once made.
struct ReferenceViews {
  struct View {
    RenderCamera camera;
    std::uint32_t side_px = 0;
    std::vector<std::uint8_t> bands;  // as look() takes them; empty: all
    FlipPicture picture;
    Visibility seen(const RenderScene& scene, const RunContext& context) const {
      return look(scene, camera, side_px, context, bands);
    }
    /// What one of the pictures of seen() differs by. `spans`: theirs; `picture`: empty, or what the last
    /// call has left.
    FlipSum loss_of(const PictureVariants& pictures, std::size_t variant, const PixelSpans& spans,
                    Picture& picture) const;
  };
  RenderEnvironment environment;
  std::vector<View> views;
};
/// `one_of`: only one of so many bands of rows is there, others in each view; at most 4.
ReferenceViews reference_views(const Mesh& mesh, const ShownMaterials& shown, double displayed_px,
                               const RunContext& context, std::uint32_t one_of = 1);

/// What pictures of the scene from the same places differ by. Half of the views will do where their mean is
/// more than `hopeless`.
FlipSum picture_loss(const ReferenceViews& reference, const RenderScene& scene,
                     const std::vector<RenderTexture>& textures, const RunContext& context,
                     double hopeless = 1);

/// Textures without so many of their finest levels; of each at least one stays.
std::vector<RenderTexture> without_finest(const std::vector<RenderTexture>& textures, std::size_t dropped);

/// What bytes buy of nested scales and of textures without losses of coding.
struct RivalPrices {
  double mesh = 1;              // times an estimate of Draco's meshes
  double bits_per_texel = 1.2;  // of a JPEG of middle quality, the texels of the whole image
  double besides = 0;           // bytes of what else is fetched
  double loss = 1;              // by coding, times FLIP
};

/// Nested scales with textures that a proxy's bytes buy. Bytes are estimated, and textures are those of the
/// mip that fits, without losses of coding. By the default prices such a scale is better than the real one.
/// Losses are mean FLIP beside `views`.
class CompetingScales {
 public:
  /// All must outlive it.
  CompetingScales(const NestedScales& scales, const ShownMaterials& shown, const ReferenceViews& views);

  /// Whether one of them loses at most as much as a proxy of so many bytes.
  bool win(std::uint64_t bytes, double flip, const RivalPrices& prices, const RunContext& context);
  /// Whether the likeliest one does; the others are not looked at.
  bool likeliest_wins(std::uint64_t bytes, double flip, const RivalPrices& prices, const RunContext& context);
  /// What plans of a package with proxies pay for a scale that looks like those: besides mesh and textures
  /// they take tables and the coarsest scale's mesh, with which materials come.
  RivalPrices prices_in_plans() const;

 private:
  struct Competitor {
    std::size_t scale = 0, dropped_levels = 0;  // of the textures
    auto operator<=>(const Competitor&) const = default;
  };
  std::vector<Competitor> competitors(std::uint64_t bytes, const RivalPrices& prices) const;
  double flip_of(const Competitor& competitor, double flip, const RunContext& context);

  const NestedScales& scales_;
  const ShownMaterials& shown_;
  const ReferenceViews& views_;
  std::vector<double> mesh_bytes_;      // per scale
  std::map<Competitor, double> known_;  // FLIP of all views; found once
};

/// Bytes of the scales' meshes, coded by Draco as compile codes them; within 20 % for scans.
std::vector<double> estimated_mesh_bytes(const NestedScales& scales);
/// Those of S_0.
double whole_mesh_bytes(const NestedScales& scales);

/// Whether S_0's whole mesh, coded, leaves so much of the bytes to the source's textures that no atlas of
/// a proxy's own can win. An atlas in pieces costs more than its texels, so it leaves its proxies a chance
/// for longer.
bool whole_mesh_is_small(const NestedScales& scales, std::uint64_t bytes);

}  // namespace texmesh
