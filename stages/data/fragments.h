#pragma once
#include <algorithm>

#include "format/base/fields.h"
#include "format/base/note.h"

namespace texmesh {

enum class TextureRole : std::uint8_t {
  kBaseColour = 0,
  kEmissive = 1,
  kNormal = 2,
  kOcclusionRoughnessMetallic = 3,
  kAlpha = 4,
  kColour = 5,  // of material extensions: sheen, specular colours and so on
  kData = 6     // of material extensions: clearcoat, transmission, thickness and so on
};

template <>
struct EnumNames<TextureRole> {
  static constexpr std::array<std::string_view, 7> names{
      "base-colour", "emissive", "normal", "occlusion-roughness-metallic", "alpha", "colour", "data"};
};

/// Whether the texture is sRGB encoded. The others hold linear numbers.
constexpr bool is_colour(TextureRole role) {
  return role == TextureRole::kBaseColour || role == TextureRole::kEmissive || role == TextureRole::kColour;
}

/// One coded image of the package: the colour or data channels of a source image, or its alpha channel. It
/// has full size or, as a mip, a half, a quarter or an eighth of that. A source image whose alpha channel
/// some material uses (mask, blend, or a number that an extension keeps there) gives two full-size planes,
/// colour first. A mip is a plane like any other: grid, coverage and features are its own.
struct TexturePlane {
  std::uint32_t image = 0;  // index into Model::images
  std::uint32_t mip = 0;    // sides are 1 / 2^mip of the image's, rounded up; 0 = full size
  std::uint32_t base = 0;   // of a mip: the index of its full-size plane
  TextureRole role = TextureRole::kBaseColour;
  std::uint32_t width_px = 0, height_px = 0;
  std::uint32_t channels = 3;  // 1 or 3
  // The grid of fragments; their sides are multiples of 16.
  std::uint32_t fragment_width_px = 0, fragment_height_px = 0, columns = 0, rows = 0;
  std::string grid_reason;             // why this grid was chosen
  std::vector<std::uint8_t> coverage;  // 1 bit per texel, see CoverageMask
  // Per fragment, row by row from the top left:
  std::vector<std::uint32_t> covered_texels;  // 0 = never stored
  std::vector<float> surface_fraction;        // of the object's whole surface area
  // Per scale and fragment, [scale * fragments + fragment], scales 0..ScaleMap::scales:
  std::vector<std::uint32_t> features;  // f_i
  std::vector<float> eta;               // eta_i (3.1), 0..1, min-max over covered fragments
  std::size_t fragment_count() const { return static_cast<std::size_t>(columns) * rows; }
  static void archive(auto& s, auto& a) {
    a(s.image, s.mip, s.base, s.role, s.width_px, s.height_px, s.channels, s.fragment_width_px,
      s.fragment_height_px, s.columns, s.rows, s.grid_reason, s.coverage, s.covered_texels,
      s.surface_fraction, s.features, s.eta);
  }
};

/// A part of an image, in texels from its left upper corner.
struct TexelRectangle {
  std::uint32_t left_px = 0, top_px = 0, width_px = 0, height_px = 0;
  constexpr std::uint32_t right_px() const { return left_px + width_px; }
  constexpr std::uint32_t bottom_px() const { return top_px + height_px; }
  friend bool operator==(const TexelRectangle&, const TexelRectangle&) = default;
};

/// Where the fragment lies in the plane's pixels, which are padded to whole fragments: the last column and
/// row may reach beyond the plane. `fragment` < fragment_count().
constexpr TexelRectangle padded_fragment_rectangle(const TexturePlane& plane, std::size_t fragment) {
  return {static_cast<std::uint32_t>(fragment % plane.columns) * plane.fragment_width_px,
          static_cast<std::uint32_t>(fragment / plane.columns) * plane.fragment_height_px,
          plane.fragment_width_px, plane.fragment_height_px};
}

/// The part of the fragment that lies on the plane. `fragment` < fragment_count().
constexpr TexelRectangle fragment_rectangle(const TexturePlane& plane, std::size_t fragment) {
  TexelRectangle out = padded_fragment_rectangle(plane, fragment);
  out.width_px = std::min(out.right_px(), plane.width_px) - std::min(out.left_px, plane.width_px);
  out.height_px = std::min(out.bottom_px(), plane.height_px) - std::min(out.top_px, plane.height_px);
  return out;
}

struct Fragments {
  int scales = 0;  // as ScaleMap::scales
  // Full-size planes by image index, colour before alpha; then mips by (base, mip), without gaps in a chain.
  // An untextured model has none.
  std::vector<TexturePlane> planes;
  Notes notes;
  static void archive(auto& s, auto& a) { a(s.scales, s.planes, s.notes); }
};

/// What texels become that no chart covers: a smooth continuation of the covered ones, or the source's
/// texels.
enum class Fill : std::uint8_t { kPushPull, kNone };
template <>
struct EnumNames<Fill> {
  static constexpr std::array<std::string_view, 2> names{"push-pull", "none"};
};

/// Bytes of one row of coverage bits: ceil(width / 8).
constexpr std::size_t coverage_stride_bytes(std::uint32_t width_px) {
  return (std::size_t{width_px} + 7) / 8;
}

/// Bytes of the coverage bits of an image.
constexpr std::size_t coverage_size_bytes(std::uint32_t width_px, std::uint32_t height_px) {
  return coverage_stride_bytes(width_px) * height_px;
}

/// Coverage bits of an image, as TexturePlane::coverage has them: 1 bit per texel, rows of
/// coverage_stride_bytes(), bit 7 first. A view: whoever owns the bits keeps them alive.
struct CoverageMask {
  const std::uint8_t* bits = nullptr;
  std::size_t stride_bytes = 0;
  std::uint32_t width_px = 0, height_px = 0;

  CoverageMask() = default;
  /// `coverage` holds coverage_size_bytes(width, height) bytes.
  CoverageMask(const std::vector<std::uint8_t>& coverage, std::uint32_t width, std::uint32_t height)
      : bits(coverage.data()),
        stride_bytes(coverage_stride_bytes(width)),
        width_px(width),
        height_px(height) {}
  explicit CoverageMask(const TexturePlane& plane)
      : CoverageMask(plane.coverage, plane.width_px, plane.height_px) {}

  /// Without bits, which stands for a mask of full coverage.
  bool empty() const { return bits == nullptr; }
  /// x < width_px, y < height_px.
  bool covered(std::uint32_t x, std::uint32_t y) const { return byte_at(x, y) >> (7 - x % 8) & 1; }
  /// The byte that holds the texel's bit: the eight texels from x / 8 * 8 on.
  std::uint8_t byte_at(std::uint32_t x, std::uint32_t y) const { return bits[y * stride_bytes + x / 8]; }
};

}  // namespace texmesh
