#pragma once
// Inside this room only: what the sources of measure_atlases() share.

#include "stages/geometry/mesh_topology.h"
#include "stages/geometry/texel_coverage.h"
#include "stages/measure/atlas/atlas_figures.h"

namespace texmesh {

/// The guide texture of every material, and where triangles lie on it.
class AtlasLayout {
 public:
  AtlasLayout(const Mesh& mesh, const std::vector<Material>& materials, std::span<const AtlasImage> images);
  const Mesh& mesh() const { return mesh_; }
  /// nullptr = the triangle shows no texture.
  const TextureRef* texture(std::uint32_t triangle) const {
    return guide_[mesh_.triangle_material[triangle]].used() ? &guide_[mesh_.triangle_material[triangle]]
                                                            : nullptr;
  }
  const std::vector<TextureRef>& guides() const { return guide_; }  // by material; unused = no texture
  /// Of a triangle with a texture; as the file has them.
  Vec2f uv(std::uint32_t triangle, std::size_t corner) const {
    const std::uint32_t w = mesh_.triangles[triangle][corner];
    return texture(triangle)->texcoord == 1 ? mesh_.uv1[w] : mesh_.uv0[w];
  }
  /// Of a triangle with a texture; in texels of the image.
  std::array<Vec2d, 3> texels(std::uint32_t triangle) const;
  std::array<Vec3d, 3> points(std::uint32_t triangle) const;

 private:
  const Mesh& mesh_;
  std::vector<TextureRef> guide_;
  std::vector<TexelMap> map_;  // by material
};

/// Twice the area in texels, negative where the texture is shown as it is seen (v grows downwards); 0 where
/// that is no finite number.
double doubled_texels(const std::array<Vec2d, 3>& corners);

/// Two half-edges on both sides of a seam: 3 t + k runs from corner k of triangle t to the next.
struct AtlasSeam {
  std::uint32_t first = 0, second = 0;
  bool opposite = true;  // they run in opposite directions
};

/// Charts, and the edges between and inside them.
struct AtlasCharts {
  std::vector<ChartFigures> charts;
  std::vector<std::uint32_t> chart_of_triangle;
  std::vector<AtlasSeam> seams;
  /// By atlas, as AtlasFigures counts them: edges, seam_edges, positions, vertices.
  struct Counts {
    std::uint64_t edges = 0, seam_edges = 0, positions = 0, vertices = 0;
  };
  std::vector<Counts> counts;
};
/// `atlas_of_triangle`: kNoIndex = no texture.
AtlasCharts find_charts(const AtlasLayout& layout, std::span<const std::uint32_t> atlas_of_triangle,
                        std::size_t atlases);

/// Fills cover, overlap and far_triangles of `figures`. `triangles`: those of the atlas.
void measure_cover(const AtlasLayout& layout, std::span<const std::uint32_t> triangles, AtlasFigures& figures,
                   const RunContext& context);

/// Fills density, stretch and what is said of flat and folded triangles. `charts` as find_charts() gives
/// them.
void measure_shape(const AtlasLayout& layout, const AtlasCharts& charts,
                   std::span<const std::uint32_t> triangles, AtlasFigures& figures);

/// Differences along the seams that begin on each atlas; empty for an atlas without seams or colours.
std::vector<std::optional<SeamColours>> measure_seams(const AtlasLayout& layout, const AtlasCharts& charts,
                                                      std::span<const AtlasImage> images, std::size_t atlases,
                                                      const RunContext& context);

/// A value and how much it counts.
struct WeighedValue {
  double value = 0, weight = 0;
  friend auto operator<=>(const WeighedValue&, const WeighedValue&) = default;
};
/// The value that `share` of the weight does not exceed; 0 of nothing. `sorted`: by value.
double weighed_percentile(std::span<const WeighedValue> sorted, double share);

}  // namespace texmesh
