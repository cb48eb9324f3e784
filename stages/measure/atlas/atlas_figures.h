#pragma once
#include <optional>
#include <span>

#include "format/model/model.h"
#include "stages/base/run_context.h"
#include "stages/data/pixels.h"

namespace texmesh {

/// A chart is thin when its width (ChartFigures::width_texels) is less: three halvings of the texture leave
/// it no texel of its own, and blocks of JPEG, 8 texels wide, mix it with what lies beside it.
inline constexpr double kThinTexels = 8;
/// A chart of so few triangles is small.
inline constexpr std::uint32_t kSmallChart = 8;

/// An image as an atlas: its sides, and its colours where they are known.
struct AtlasImage {
  std::uint32_t width_px = 0, height_px = 0;
  const Pixels* colours = nullptr;  // sRGB, same sides; nullptr = seams are not compared
};

/// Triangles of one material that hang together in the texture: neighbours whose common edge has the same
/// texture coordinates on both sides.
struct ChartFigures {
  std::uint32_t atlas = 0;  // index into AtlasReport::atlases
  std::uint32_t triangles = 0;
  std::uint32_t corners = 0;  // of its border: places where other than two seams or borders of the mesh meet
  double texels = 0, border_texels = 0;  // area and length of the border, as laid out
  double turned_texels = 0;              // area that shows the texture mirrored
  /// The shorter side of the rectangle that has this area and this border; of what is rounder than a square,
  /// the square's. Ragged borders make charts narrower, as they should: what is lost is lost along borders.
  double width_texels() const;
  bool is_thin() const { return width_texels() < kThinTexels; }
  bool is_mirrored() const { return turned_texels > texels / 2; }
};

/// Percentiles over the surface: a triangle counts by its area in space.
struct SurfacePercentiles {
  double p5 = 0, p50 = 0, p95 = 0, p99 = 0;
};

/// Colours on both sides of seams: CIE 1976 differences (2.3 can just be seen), weighed by length in space.
/// `inside`: how much colours change anyway, from the seam to one texel further into the chart, in the mean.
struct SeamColours {
  double mean = 0, p95 = 0, inside = 0;
};

/// What one image of a model is like as an atlas. Shares are 0..1; of nothing they are 0.
struct AtlasFigures {
  std::uint32_t image = 0;  // index into the model's images
  std::uint32_t width_px = 0, height_px = 0;
  std::vector<std::uint32_t> materials;  // whose guide texture it is (UvSets)
  std::uint64_t triangles = 0, charts = 0, small_charts = 0, thin_charts = 0, mirrored_charts = 0;
  std::uint64_t flat_triangles = 0;    // without area on the texture, though they have one in space
  double flat_surface = 0;             // their share of the surface that the image is meant for
  std::uint64_t folded_triangles = 0;  // turned the other way than most of their chart
  std::uint64_t far_triangles = 0;     // too far out, or over too many tiles, to be a place on the texture
  double cover = 0;                    // texels, by their centres, that triangles show, of all
  double overlap = 0;                  // of these: shown at two or more places of the surface
  double thin_share = 0;               // of the charts' texels: those of thin charts
  double largest_chart = 0;            // of the charts' texels
  SurfacePercentiles density;          // texels per object unit
  SurfacePercentiles stretch;  // longer axis of a circle of the surface on the texture over its shorter
  std::uint64_t edges = 0, seam_edges = 0;    // edges with two or more triangles; of these, with a seam
  std::uint64_t positions = 0, vertices = 0;  // vertices: positions with different texture coordinates apart
  std::uint64_t triangle_floor = 0;  // fewest triangles of a mesh that keeps every chart with its corners
  std::optional<SeamColours> seam_colours;
  /// How often more texels the densest parts have, per length, than the sparsest.
  double density_spread() const { return density.p5 > 0 ? density.p95 / density.p5 : 0; }
};

struct AtlasReport {
  std::vector<AtlasFigures> atlases;  // by image; images without triangles are left out
  std::vector<ChartFigures> charts;   // by their first triangle
  // Index into charts; kNoIndex = the material has no texture, or two corners are at one position.
  std::vector<std::uint32_t> chart_of_triangle;
  std::uint64_t untextured_triangles = 0;
};

/// Measures the atlases that a mesh is textured with. The guide texture of a material counts: base colour's
/// or, without one, the first. `images`: one for each image that materials speak of. Positions count as one
/// where they are bit-equal. Triangles without area in space are left out of percentiles, those with a
/// texture coordinate that is not finite count as far. Cover and overlap are exact up to kMostSide_px a side
/// and an overlap of a few layers; beyond that a texture of half, a quarter .. of the sides is filled.
/// Stretch: Sander, Snyder, Gortler and Hoppe, "Texture mapping progressive meshes", 2001, whose singular
/// values' ratio this is. O(n log n) in triangles, linear in texels. Same bits for any thread count.
AtlasReport measure_atlases(const Mesh& mesh, const std::vector<Material>& materials,
                            std::span<const AtlasImage> images, const RunContext& context);

/// An atlas as it is laid out, row by row from the top.
struct AtlasMap {
  std::uint32_t width_px = 0, height_px = 0;
  std::vector<std::uint32_t>
      chart;  // AtlasReport::charts; the last triangle's where several lie; kNoIndex = none
  std::vector<std::uint8_t> layers;  // triangles over the texel's centre; 2 = two or more
};

/// The map of an atlas of `report`, which measure_atlases() made of the same mesh, materials and images.
/// Sides are the image's, halved until the longer one is at most most_side_px (1 and more).
AtlasMap map_atlas(const Mesh& mesh, const std::vector<Material>& materials,
                   std::span<const AtlasImage> images, const AtlasReport& report, std::size_t atlas,
                   std::uint32_t most_side_px, const RunContext& context);

}  // namespace texmesh
