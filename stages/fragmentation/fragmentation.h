#pragma once
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "format/base/fields.h"
#include "format/model/model.h"
#include "stages/base/run_context.h"
#include "stages/condition/condition.h"
#include "stages/image/decode_image.h"
#include "stages/ssf/ssf.h"

namespace texmesh {

inline constexpr int kFragmentationVersion = 7;

enum class Fill : std::uint8_t { kPushPull, kNone };
template <>
struct EnumNames<Fill> {
  static constexpr std::array<std::string_view, 2> names{"push-pull", "none"};
};

struct FragmentationOptions {
  int max_fragments = 256;    // per texture plane
  int min_fragment_px = 128;  // side, where the image allows
  Fill fill = Fill::kPushPull;
  bool mips = true;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("max_fragments", s.max_fragments, Range{1, 256}, "most fragments of one texture");
    v("min_fragment_px", s.min_fragment_px, Range{16, 4096},
      "least side of a fragment, where the image allows; 256 instead of the default with ladder.mode "
      "progressive");
    v("fill", s.fill,
      "push-pull = smooth colours where no chart covers the texture; none = the source's texels");
    v("mips", s.mips, "smaller copies of every texture, half by half, for small displays");
  }
};

enum class TextureRole : std::uint8_t {
  kBaseColour = 0,
  kEmissive = 1,
  kNormal = 2,
  kOcclusionRoughnessMetallic = 3,
  kAlpha = 4,
  kColour = 5,  // of material extensions: sheen, specular colours, ...
  kData = 6     // of material extensions: clearcoat, transmission, thickness, ...
};
template <>
struct EnumNames<TextureRole> {
  static constexpr std::array<std::string_view, 7> names{
      "base-colour", "emissive", "normal", "occlusion-roughness-metallic", "alpha", "colour", "data"};
};

/// sRGB encoded; the others hold linear numbers.
constexpr bool is_colour(TextureRole role) {
  return role == TextureRole::kBaseColour || role == TextureRole::kEmissive || role == TextureRole::kColour;
}

/// One coded image of the package: the colour or data channels of a source image, or its alpha channel, at
/// full size or, as a mip, at a half, a quarter, ... of it. A source image with an alpha channel that some
/// material uses (mask, blend, or a number that an extension keeps there) gives two full-size planes, colour
/// first. A mip is a plane like any other, with a grid, coverage and features of its own.
struct TexturePlane {
  std::uint32_t image = 0;  // index into Model::images
  std::uint32_t mip = 0;    // sides are 1 / 2^mip of the image's, rounded up; 0 = full size
  std::uint32_t base = 0;   // of a mip: index of its full-size plane
  TextureRole role = TextureRole::kBaseColour;
  std::uint32_t width_px = 0, height_px = 0, channels = 3;                             // 1 or 3
  std::uint32_t fragment_width_px = 0, fragment_height_px = 0, columns = 0, rows = 0;  // multiples of 16
  std::string grid_reason;                                                             // why this grid
  std::vector<std::uint8_t> coverage;  // 1 bit per texel, rows of ceil(width / 8) bytes, bit 7 first
  // Per fragment, row by row from the top left:
  std::vector<std::uint32_t> covered_texels;  // 0 = never stored
  std::vector<float> surface_fraction;        // of the object's whole surface area
  std::vector<std::uint32_t> features;  // [scale * fragments + fragment], scale 0..ScaleMap::scales: f_i
  std::vector<float> eta;               // same shape: eta_i (3.1), 0..1, min-max over covered fragments
  std::size_t fragment_count() const { return static_cast<std::size_t>(columns) * rows; }
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.image, s.mip, s.base, s.role, s.width_px, s.height_px, s.channels, s.fragment_width_px,
      s.fragment_height_px, s.columns, s.rows, s.grid_reason, s.coverage, s.covered_texels,
      s.surface_fraction, s.features, s.eta);
  }
};

struct Fragments {
  int scales = 0;  // as ScaleMap::scales
  // Full-size planes by image index, colour before alpha; then mips by (base, mip), without gaps in a chain.
  // Empty for untextured models.
  std::vector<TexturePlane> planes;
  Notes notes;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.scales, s.planes, s.notes);
  }
};

/// Cuts the images that materials use into planes and fragments (thesis 3.2):
/// - An image used for several things gives one plane; the role that comes first in TextureRole wins, with a
/// note.
/// - Mips: halves down to, and without, the size of the preview: 1/2 and 1/4, and 1/8 where that has more
/// than
///   32768 texels (the preview may be 1/16 then), each while its longer side has at least 128 texels. Below
///   that all of a mip's finest rung is no more than its tables.
/// - Grid: at most max_fragments fragments, sides multiples of 16 and at least min_fragment_px where the
/// image allows.
/// - Coverage: the texels that bilinear sampling of the triangles can touch, conservatively and after the
/// texture's
///   transform and wrap modes. Triangles whose UVs are absent or not finite cover nothing (a note says so).
/// - Surface: each triangle's area in space, spread over fragments by its area on the texture.
/// - Features f_i: positions with ScaleMap::crossing >= i, twins as one, counted once in every fragment in
/// which a
///   corner lies (a corner on the border between two fragments lies where its triangle does).
/// - eta_i (3.1) is 0 everywhere at a scale where all covered fragments have the same count.
/// Throws StageError when the scale map or a triangle's material does not fit. Same result for any thread
/// count.
Fragments fragment_textures(const ConditionedMesh& mesh, const std::vector<Material>& materials,
                            const std::vector<Image>& images, const ScaleMap& scale_map,
                            const FragmentationOptions& options, const RunContext& context);

/// What blocks of 16 x 16 texels become that are covered in part: kSparse makes their uncovered texels such
/// that any codec finds few coefficients (fill_blocks.h); kSmooth leaves the smooth fill, for an encoder that
/// knows which texels are free, as the ladder's baseline JPEG does, and costs a sixth of the time.
enum class PartBlocks : std::uint8_t { kSparse, kSmooth };

/// The pixels of every plane: decoded, uncovered texels filled, and extended to columns x fragment_width by
/// rows x fragment_height: edges repeated to the end of their 16 x 16 block, flat blocks beyond (never seen,
/// nearly free). A mip is the next finer plane, filled smoothly, halved (stages/image/halve_pixels.h), its
/// blocks made cheap in turn. Derived data, never stored: zim, ladder and lut share one copy. Throws
/// InputError for an image that does not decode, StageError for planes that do not fit the images or each
/// other.
std::vector<Pixels> fill_planes(const Fragments& fragments, const std::vector<Image>& images, Fill fill,
                                const RunContext& context, PartBlocks part = PartBlocks::kSparse);

/// Push-pull: gives every texel whose coverage bit (as TexturePlane::coverage) is 0 a smooth continuation of
/// the covered ones, and fill_blocks.h makes that cheap for JPEG; covered ones keep their value. Without any
/// covered texel nothing changes.
void fill_uncovered(Pixels& pixels, const std::vector<std::uint8_t>& coverage, const RunContext& context);

}  // namespace texmesh
