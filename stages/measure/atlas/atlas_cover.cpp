#include <algorithm>

#include "stages/base/run_context.h"
#include "stages/measure/atlas/atlas_map.h"
#include "stages/measure/atlas/atlas_parts.h"
#include "stages/measure/atlas/texel_spans.h"

namespace texmesh {
namespace {

/// What filling may cost, in texels: four layers of the largest texture, and a few texels for each triangle.
constexpr double kMostWork = 4.0 * TexelTriangle::kMostSide_px * TexelTriangle::kMostSide_px;
constexpr double kWorkPerTriangle = 64;

/// The texture that is filled: sides halved `halvings` times.
struct Grid {
  std::uint32_t width_px, height_px;
  Vec2d scale;
  Grid(const AtlasFigures& figures, int halvings)
      : width_px(std::max(1u, figures.width_px >> halvings)),
        height_px(std::max(1u, figures.height_px >> halvings)),
        scale{static_cast<double>(width_px) / figures.width_px,
              static_cast<double>(height_px) / figures.height_px} {}
  std::optional<TexelTriangle> triangle(const AtlasLayout& layout, std::uint32_t t) const {
    std::array<Vec2d, 3> at = layout.texels(t);
    for (Vec2d& p : at) p = {p.x * scale.x, p.y * scale.y};
    return TexelTriangle::of(at, width_px, height_px);
  }
};

double work_on(const Grid& grid, const AtlasLayout& layout, std::span<const std::uint32_t> triangles) {
  double work = 0;
  for (const std::uint32_t t : triangles)
    if (const auto triangle = grid.triangle(layout, t))
      work += triangle->work(layout.texture(t)->wrap_t, grid.height_px);
  return work;
}

/// The finest grid whose sides and whose filling keep within bounds: many layers of large triangles, as
/// hostile files have them, are filled coarsely.
Grid grid_for(const AtlasLayout& layout, std::span<const std::uint32_t> triangles,
              const AtlasFigures& figures, std::uint32_t most_side_px) {
  const double most = kMostWork + kWorkPerTriangle * static_cast<double>(triangles.size());
  for (int halvings = 0;; ++halvings) {
    const Grid grid(figures, halvings);
    const std::uint32_t side = std::max(grid.width_px, grid.height_px);
    if (side == 1) return grid;
    if (side <= most_side_px && work_on(grid, layout, triangles) <= most) return grid;
  }
}

/// Calls mark(triangle, texel) for every texel of every triangle; returns how many triangles have no place.
template <class F>
std::uint64_t fill_triangles(const Grid& grid, const AtlasLayout& layout,
                             std::span<const std::uint32_t> triangles, const RunContext& context, F&& mark) {
  std::uint64_t far = 0;
  std::size_t done = 0;
  for (const std::uint32_t t : triangles) {
    if (done++ % 65536 == 0) context.check_cancelled();
    const auto triangle = grid.triangle(layout, t);
    if (!triangle) {
      ++far;
      continue;
    }
    const TextureRef& texture = *layout.texture(t);
    triangle->fill(grid.width_px, grid.height_px, texture.wrap_s, texture.wrap_t,
                   [&](std::uint32_t row, std::uint32_t first, std::uint32_t end) {
                     const std::size_t start = std::size_t{row} * grid.width_px;
                     for (std::size_t x = first; x < end; ++x) mark(t, start + x);
                   });
  }
  return far;
}

void count_layer(std::uint8_t& layers) { layers = layers == 0 ? 1 : 2; }

}  // namespace

void measure_cover(const AtlasLayout& layout, std::span<const std::uint32_t> triangles, AtlasFigures& figures,
                   const RunContext& context) {
  const Grid grid = grid_for(layout, triangles, figures, TexelTriangle::kMostSide_px);
  std::vector<std::uint8_t> layers(std::size_t{grid.width_px} * grid.height_px);  // 2 = two or more
  figures.far_triangles =
      fill_triangles(grid, layout, triangles, context,
                     [&](std::uint32_t, std::size_t texel) { count_layer(layers[texel]); });
  std::uint64_t covered = 0, twice = 0;
  for (const std::uint8_t n : layers) covered += n > 0, twice += n > 1;
  figures.cover = static_cast<double>(covered) / static_cast<double>(layers.size());
  if (covered > 0) figures.overlap = static_cast<double>(twice) / static_cast<double>(covered);
}

AtlasMap map_atlas(const Mesh& mesh, const std::vector<Material>& materials,
                   std::span<const AtlasImage> images, const AtlasReport& report, std::size_t atlas,
                   std::uint32_t most_side_px, const RunContext& context) {
  const AtlasLayout layout(mesh, materials, images);
  std::vector<std::uint32_t> triangles;
  for (std::uint32_t t = 0; t < report.chart_of_triangle.size(); ++t) {
    const std::uint32_t chart = report.chart_of_triangle[t];
    if (chart != kNoIndex && report.charts[chart].atlas == atlas) triangles.push_back(t);
  }
  const Grid grid = grid_for(layout, triangles, report.atlases.at(atlas), most_side_px);
  const std::size_t texels = std::size_t{grid.width_px} * grid.height_px;
  AtlasMap map{grid.width_px, grid.height_px, std::vector<std::uint32_t>(texels, kNoIndex),
               std::vector<std::uint8_t>(texels)};
  fill_triangles(grid, layout, triangles, context, [&](std::uint32_t t, std::size_t texel) {
    map.chart[texel] = report.chart_of_triangle[t];
    count_layer(map.layers[texel]);
  });
  return map;
}

}  // namespace texmesh
