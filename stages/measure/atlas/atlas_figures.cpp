// What one image of a model is like as an atlas: where triangles lie on it, how they are stretched there, and
// what charts, seams (atlas_charts.cpp) and cover add up to.
#include <tuple>

#include "stages/measure/atlas/atlas_parts.h"

namespace texmesh {
namespace {

/// Base colour's texture; without one, the first that is used.
TextureRef guide_of(const Material& material, const Mesh& mesh, std::span<const AtlasImage> images) {
  TextureRef guide;
  for_each_texture(material, [&](const TextureRef& t) {
    const bool has_uv = t.texcoord == 1 ? !mesh.uv1.empty() : t.texcoord == 0 && !mesh.uv0.empty();
    if (guide.used() || !t.used() || !has_uv) return;
    const auto image = static_cast<std::size_t>(t.image);
    if (image < images.size() && images[image].width_px > 0 && images[image].height_px > 0) guide = t;
  });
  return guide;
}

/// A triangle on a texture of width x height texels, for filling. Corners are rounded to 1/256 texel, so that
/// all that follows is exact: triangles that share an edge share no texel and leave none out.
class TexelTriangle {
 public:
  static constexpr std::int64_t kSteps = 256;   // of a texel
  static constexpr int kMostSide_px = 8192;     // of a texture; products of coordinates stay in 64 bits
  static constexpr double kMostTiles = 64;      // that a triangle may reach over
  static constexpr double kFarTexels = 0x1p40;  // where no fraction is left of a float

  /// Corners in texels. Nothing when a corner is not finite or further off than kFarTexels, and when the
  /// triangle reaches over more than kMostTiles tiles: that is no place on a texture.
  static std::optional<TexelTriangle> of(const std::array<Vec2d, 3>& corners, std::uint32_t width_px,
                                         std::uint32_t height_px);

  /// Rows and texels that fill() goes through, at most; those of a clamped direction are clipped.
  double work(Wrap wrap_t, std::uint32_t height_px) const {
    const double rows = static_cast<double>(bottom_ - top_) / kSteps + 1;
    const double clipped = wrap_t == Wrap::kClamp ? std::min<double>(rows, height_px) : rows;
    return clipped * (1 + static_cast<double>(right_ - left_) / kSteps);
  }

  /// Calls span(row, first, end) with the texels whose centres lie inside, after wrapping. What is outside of
  /// a clamped direction is left out.
  void fill(std::uint32_t width_px, std::uint32_t height_px, Wrap wrap_s, Wrap wrap_t, auto&& span) const;

 private:
  struct Point {
    std::int64_t x = 0, y = 0;
  };
  static std::int64_t ceil_div(std::int64_t a, std::int64_t b) {
    return a >= 0 ? (a + b - 1) / b : -(-a / b);
  }
  /// First texel of the row whose centre is not left of the edge; none where the edge does not cross the row.
  static std::optional<std::int64_t> crossing(Point a, Point b, std::int64_t centre_y);

  std::array<Point, 3> corner_;
  std::int64_t tile_x_ = 0, tile_y_ = 0;  // of the origin of the corners, in tiles
  std::int64_t left_ = 0, right_ = 0, top_ = 0, bottom_ = 0;
};

std::optional<TexelTriangle> TexelTriangle::of(const std::array<Vec2d, 3>& corners, std::uint32_t width_px,
                                               std::uint32_t height_px) {
  TexelTriangle out;
  for (std::size_t k = 0; k < 3; ++k) {
    if (!(std::fabs(corners[k].x) < kFarTexels && std::fabs(corners[k].y) < kFarTexels)) return std::nullopt;
    out.corner_[k] = {static_cast<std::int64_t>(std::floor(corners[k].x * kSteps + 0.5)),
                      static_cast<std::int64_t>(std::floor(corners[k].y * kSteps + 0.5))};
  }
  const auto floor_div = [](std::int64_t a, std::int64_t b) { return -ceil_div(-a, b); };
  const auto& c = out.corner_;
  const std::int64_t tile_w = kSteps * width_px, tile_h = kSteps * height_px;
  out.tile_x_ = floor_div(std::min({c[0].x, c[1].x, c[2].x}), tile_w);
  out.tile_y_ = floor_div(std::min({c[0].y, c[1].y, c[2].y}), tile_h);
  for (Point& p : out.corner_) p.x -= out.tile_x_ * tile_w, p.y -= out.tile_y_ * tile_h;
  std::tie(out.left_, out.right_) = std::minmax({c[0].x, c[1].x, c[2].x});
  std::tie(out.top_, out.bottom_) = std::minmax({c[0].y, c[1].y, c[2].y});
  if (static_cast<double>(out.right_) > kMostTiles * static_cast<double>(tile_w) ||
      static_cast<double>(out.bottom_) > kMostTiles * static_cast<double>(tile_h))
    return std::nullopt;
  return out;
}

std::optional<std::int64_t> TexelTriangle::crossing(Point a, Point b, std::int64_t centre_y) {
  if (a.y > b.y) std::swap(a, b);
  if (centre_y < a.y || centre_y >= b.y) return std::nullopt;
  const std::int64_t height = b.y - a.y;
  const std::int64_t x = a.x * height + (centre_y - a.y) * (b.x - a.x);  // times height
  return ceil_div(x - kSteps / 2 * height, kSteps * height);
}

void TexelTriangle::fill(std::uint32_t width_px, std::uint32_t height_px, Wrap wrap_s, Wrap wrap_t,
                         auto&& span) const {
  const std::int64_t width = width_px, height = height_px;
  std::int64_t row = ceil_div(top_ - kSteps / 2, kSteps), last = ceil_div(bottom_ - kSteps / 2, kSteps);
  if (wrap_t == Wrap::kClamp) {
    row = std::max(row, -tile_y_ * height);
    last = std::min(last, (1 - tile_y_) * height);
  }
  for (; row < last; ++row) {
    std::int64_t first = 0, end = 0;
    bool one = false;
    for (std::size_t k = 0; k < 3; ++k)
      if (const auto x = crossing(corner_[k], corner_[(k + 1) % 3], row * kSteps + kSteps / 2)) {
        (one ? end : first) = *x;
        one = true;
      }
    if (first > end) std::swap(first, end);
    const std::uint32_t y = wrapped(row + tile_y_ * height, height_px, wrap_t);
    if (wrap_s == Wrap::kClamp) {
      first = std::max(first, -tile_x_ * width);
      end = std::min(end, (1 - tile_x_) * width);
      if (first < end)
        span(y, static_cast<std::uint32_t>(first + tile_x_ * width),
             static_cast<std::uint32_t>(end + tile_x_ * width));
      continue;
    }
    while (first < end) {  // tile by tile; corners are not left of tile 0
      const std::int64_t stop = std::min(end, (first / width + 1) * width);
      const std::uint32_t a = wrapped(first + tile_x_ * width, width_px, wrap_s),
                          b = wrapped(stop - 1 + tile_x_ * width, width_px, wrap_s);
      span(y, std::min(a, b), std::max(a, b) + 1);
      first = stop;
    }
  }
}

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
std::uint64_t fill_triangles(const Grid& grid, const AtlasLayout& layout,
                             std::span<const std::uint32_t> triangles, const RunContext& context,
                             auto&& mark) {
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

// Smaller than this, in texels, a triangle is folded to a line: its stretch would be a play of rounding.
constexpr double kFlatTexels = 1e-6;

/// Axes of the ellipse on the texture that a circle of the surface becomes (Sander et al. 2001).
struct Axes {
  double longer = 0, shorter = 0;  // texels per object unit
};

Axes axes_of(const std::array<Vec3d, 3>& p, const std::array<Vec2d, 3>& t) {
  const Vec3d e1 = p[1] - p[0], e2 = p[2] - p[0];
  const double base = length(e1);
  // The triangle in its plane: (0, 0), (base, 0), (x, y).
  const double x = dot(e1, e2) / base, y = length(cross(e1, e2)) / base;
  const Vec2d t1 = t[1] - t[0], t2 = t[2] - t[0];
  const Vec2d along = t1 * (1 / base), across = (t2 - along * x) * (1 / y);
  const double a = dot(along, along), b = dot(along, across), c = dot(across, across);
  const double root = std::sqrt((a - c) * (a - c) + 4 * b * b);
  const double longer = std::sqrt((a + c + root) / 2);
  return {longer, std::fabs(cross(along, across)) / longer};
}

SurfacePercentiles percentiles_of(std::vector<WeighedValue>& values) {
  std::ranges::sort(values);
  return {weighed_percentile(values, 0.05), weighed_percentile(values, 0.5), weighed_percentile(values, 0.95),
          weighed_percentile(values, 0.99)};
}

/// One of every image that triangles show.
std::vector<AtlasFigures> list_atlases(const AtlasLayout& layout, std::span<const AtlasImage> images) {
  std::vector<bool> shown(images.size());
  for (std::uint32_t t = 0; t < layout.mesh().triangles.size(); ++t)
    if (const TextureRef* texture = layout.texture(t)) shown[static_cast<std::size_t>(texture->image)] = true;
  std::vector<AtlasFigures> atlases;
  for (std::uint32_t i = 0; i < images.size(); ++i) {
    if (!shown[i]) continue;
    AtlasFigures figures;
    figures.image = i;
    figures.width_px = images[i].width_px, figures.height_px = images[i].height_px;
    for (std::uint32_t m = 0; m < layout.guides().size(); ++m)
      if (layout.guides()[m].image == static_cast<std::int32_t>(i)) figures.materials.push_back(m);
    atlases.push_back(std::move(figures));
  }
  return atlases;
}

std::vector<std::uint32_t> atlases_of_triangles(const AtlasLayout& layout,
                                                const std::vector<AtlasFigures>& atlases) {
  std::vector<std::uint32_t> of_material(layout.guides().size(), kNoIndex);
  for (std::uint32_t a = 0; a < atlases.size(); ++a)
    for (const std::uint32_t m : atlases[a].materials) of_material[m] = a;
  std::vector<std::uint32_t> out;
  for (const std::uint16_t m : layout.mesh().triangle_material) out.push_back(of_material[m]);
  return out;
}

/// What the charts of every atlas add up to.
void sum_charts(const AtlasCharts& charts, std::vector<AtlasFigures>& atlases) {
  std::vector<double> texels(atlases.size());
  for (const ChartFigures& c : charts.charts) {
    AtlasFigures& a = atlases[c.atlas];
    ++a.charts;
    a.small_charts += c.triangles <= kSmallChart;
    a.thin_charts += c.is_thin();
    a.mirrored_charts += c.is_mirrored();
    a.triangle_floor += c.corners > 3 ? c.corners - 2 : 1;
    a.largest_chart = std::max(a.largest_chart, c.texels);
    a.thin_share += c.is_thin() ? c.texels : 0;
    texels[c.atlas] += c.texels;
  }
  for (std::size_t a = 0; a < atlases.size(); ++a) {
    const double scale = texels[a] > 0 ? 1 / texels[a] : 0;
    atlases[a].largest_chart *= scale, atlases[a].thin_share *= scale;
    const AtlasCharts::Counts& n = charts.counts[a];
    atlases[a].edges = n.edges, atlases[a].seam_edges = n.seam_edges;
    atlases[a].positions = n.positions, atlases[a].vertices = n.vertices;
  }
}

}  // namespace

AtlasLayout::AtlasLayout(const Mesh& mesh, const std::vector<Material>& materials,
                         std::span<const AtlasImage> images)
    : mesh_(mesh) {
  for (const Material& m : materials) {
    guide_.push_back(guide_of(m, mesh, images));
    const TextureRef& g = guide_.back();
    const AtlasImage image = g.used() ? images[static_cast<std::size_t>(g.image)] : AtlasImage{1, 1, nullptr};
    map_.emplace_back(g.transform, image.width_px, image.height_px);
  }
}

std::array<Vec2d, 3> AtlasLayout::texels(std::uint32_t triangle) const {
  const TexelMap& map = map_[mesh_.triangle_material[triangle]];
  return {map(uv(triangle, 0)), map(uv(triangle, 1)), map(uv(triangle, 2))};
}

std::array<Vec3d, 3> AtlasLayout::points(std::uint32_t triangle) const {
  return corner_points(mesh_, mesh_.triangles[triangle]);
}

double doubled_texels(const std::array<Vec2d, 3>& corners) {
  const double twice = cross(corners[1] - corners[0], corners[2] - corners[0]);
  return std::isfinite(twice) ? twice : 0;
}

double weighed_percentile(std::span<const WeighedValue> sorted, double share) {
  double all = 0, sum = 0;
  for (const WeighedValue& v : sorted) all += v.weight;
  for (const WeighedValue& v : sorted) {
    sum += v.weight;
    if (sum >= share * all) return v.value;
  }
  return sorted.empty() ? 0 : sorted.back().value;
}

void measure_shape(const AtlasLayout& layout, const AtlasCharts& charts,
                   std::span<const std::uint32_t> triangles, AtlasFigures& figures) {
  std::vector<WeighedValue> density, stretch;
  double surface = 0, flat = 0;
  for (const std::uint32_t t : triangles) {
    const std::array<Vec3d, 3> p = layout.points(t);
    const double area = length(cross(p[1] - p[0], p[2] - p[0])) / 2;
    if (!(area > 0) || !std::isfinite(area)) continue;
    surface += area;
    const std::array<Vec2d, 3> at = layout.texels(t);
    const double texels = doubled_texels(at) / 2;
    const Axes axes = axes_of(p, at);
    if (!(std::fabs(texels) > kFlatTexels) || !std::isfinite(axes.longer / axes.shorter)) {
      ++figures.flat_triangles;
      flat += area;
      continue;
    }
    density.push_back({std::sqrt(std::fabs(texels) / area), area});
    stretch.push_back({axes.longer / axes.shorter, area});
    const std::uint32_t chart = charts.chart_of_triangle[t];
    if (chart != kNoIndex) figures.folded_triangles += (texels > 0) != charts.charts[chart].is_mirrored();
  }
  if (surface > 0) figures.flat_surface = flat / surface;
  figures.density = percentiles_of(density);
  figures.stretch = percentiles_of(stretch);
}

double ChartFigures::width_texels() const {
  const double half = border_texels / 2, root = half * half - 4 * texels;
  return root > 0 ? 2 * texels / (half + std::sqrt(root)) : std::sqrt(texels);
}

AtlasReport measure_atlases(const Mesh& mesh, const std::vector<Material>& materials,
                            std::span<const AtlasImage> images, const RunContext& context) {
  const AtlasLayout layout(mesh, materials, images);
  AtlasReport report;
  report.atlases = list_atlases(layout, images);
  const std::vector<std::uint32_t> atlas_of = atlases_of_triangles(layout, report.atlases);
  std::vector<std::vector<std::uint32_t>> triangles(report.atlases.size());
  for (std::uint32_t t = 0; t < atlas_of.size(); ++t) {
    if (atlas_of[t] == kNoIndex)
      ++report.untextured_triangles;
    else
      triangles[atlas_of[t]].push_back(t);
  }
  AtlasCharts charts = find_charts(layout, atlas_of, report.atlases.size());
  sum_charts(charts, report.atlases);
  const auto seams = measure_seams(layout, charts, images, report.atlases.size(), context);
  for (std::size_t a = 0; a < report.atlases.size(); ++a) {
    AtlasFigures& figures = report.atlases[a];
    figures.triangles = triangles[a].size();
    figures.seam_colours = seams[a];
    measure_shape(layout, charts, triangles[a], figures);
    measure_cover(layout, triangles[a], figures, context);
  }
  report.charts = std::move(charts.charts);
  report.chart_of_triangle = std::move(charts.chart_of_triangle);
  return report;
}

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
