#pragma once
#include <span>

#include "format/base/fields.h"

namespace texmesh {

/// Planes whose loss shows in the same way.
enum class PlaneGroup : std::uint8_t {
  kColour,  // base colour, alpha, emission, colours of extensions
  kNormal,
  kData  // occlusion, roughness, metalness, data of extensions
};
template <>
struct EnumNames<PlaneGroup> {
  static constexpr std::array<std::string_view, 3> names{"colour", "normal", "data"};
};
inline constexpr std::size_t kPlaneGroups = 3;
/// The group of a role of textures.json.
PlaneGroup group_of(std::string_view role);

/// How lit pictures differ from those of S_0 with the source's texels; arrays of one length.
struct PictureLosses {
  std::vector<float> flip;      // mean FLIP over the pixels that either picture covers, 0..1, 0 = equal
  std::vector<float> flip_p95;  // 95th percentile of FLIP over those pixels, 0..1
  std::vector<float> dssim;     // 1 - mean SSIM of luma, 0..1
  std::size_t size() const { return flip.size(); }
  static void archive(auto& s, auto& a) { a(s.flip, s.flip_p95, s.dssim); }
  friend bool operator==(const PictureLosses&, const PictureLosses&) = default;
};

/// What a group's textures lose at one displayed height, on S_0, with all other groups as in the source.
struct TextureLosses {
  /// Mean of 1 - SSIM of the group's texels over the object's surface, rising, > 0; one per sampled rung. Of
  /// the planes that a client shows at that height (format/rules/viewing.h).
  std::vector<float> texel_dssim;
  /// Per texel_dssim. `flip` is what coding adds to the mips' own loss: together with finer.flip[0], by
  /// QualityTable::exponent, it is the picture's. The others are the picture's.
  PictureLosses coded;
  PictureLosses preview;  // one: with the previews of all the group's textures
  /// With the texels that the planes shown at that height would have without coding, then those of mips that
  /// are 1, 2 .. levels finer, of full size the source's where a rung has them; 1 to kMaxFinerLevels + 1 of
  /// them. `flip` does not rise. A client shows such texels where a rung loses nothing: they may still be
  /// coarser than what the source shows there, and its mips have other charts' borders.
  PictureLosses finer;
  /// The same of mips that are 1, 2 .. levels coarser than the planes shown at that height.
  PictureLosses coarser;
  static void archive(auto& s, auto& a) { a(s.texel_dssim, s.coded, s.preview, s.finer, s.coarser); }
  friend bool operator==(const TextureLosses&, const TextureLosses&) = default;
};

struct GroupLosses {
  PlaneGroup group = PlaneGroup::kColour;
  std::vector<TextureLosses> sizes;  // per QualityTable::sizes_px
  static void archive(auto& s, auto& a) { a(s.group, s.sizes); }
  friend bool operator==(const GroupLosses&, const GroupLosses&) = default;
};

/// What choices of scale and textures change in lit pictures: quality.json. picture_prediction.h
/// reads losses between its samples.
struct QualityTable {
  std::uint32_t views = 0;
  std::vector<std::uint32_t> sizes_px;  // displayed heights of the object, px, rising
  std::vector<int> scales;              // scale numbers, rising (0 = S_0)
  std::vector<PictureLosses> geometry;  // per size; per scale, with the source's texels; S_0 loses nothing
  std::vector<GroupLosses> groups;      // those that the model has, rising
  /// Losses of parts add up as (sum of loss^exponent)^(1 / exponent); 1..4.
  float exponent = 1;
  /// Mean of |predicted - measured| / measured of FLIP, over samples with a coarser scale and coded textures
  /// of all groups together; 0 where nothing was sampled.
  float error = 0;
  static void archive(auto& s, auto& a) {
    a(s.views, s.sizes_px, s.scales, s.geometry, s.groups, s.exponent, s.error);
  }
  friend bool operator==(const QualityTable&, const QualityTable&) = default;
};

/// The least displayed height at which a scale is compared with S_0 for ManifestScale::display_px_flip, px.
inline constexpr double kLeastSwitchPx = 32;
inline constexpr std::size_t kMaxQualitySizes = 8, kMaxQualitySamples = 100, kMaxCoarserLevels = 8,
                             kMaxFinerLevels = 8;

std::string write_quality(const QualityTable& table);           // canonical JSON
QualityTable read_quality(std::span<const std::uint8_t> json);  // strict; FormatError

}  // namespace texmesh
