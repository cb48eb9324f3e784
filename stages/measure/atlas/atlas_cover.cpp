// How much of a texture triangles show, and how much more than once: the triangles are filled on a grid.
#include <algorithm>
#include <tuple>

#include "stages/measure/atlas/atlas_parts.h"

namespace texmesh {
namespace {

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
  template <class F>
  void fill(std::uint32_t width_px, std::uint32_t height_px, Wrap wrap_s, Wrap wrap_t, F&& span) const;

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

template <class F>
void TexelTriangle::fill(std::uint32_t width_px, std::uint32_t height_px, Wrap wrap_s, Wrap wrap_t,
                         F&& span) const {
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
