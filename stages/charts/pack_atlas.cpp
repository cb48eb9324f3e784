// How charts are packed. All have one scale. The scale falls until all charts find a place one after the
// other, and rises again by halves of what lies between. Then other orders of the charts are tried for a
// larger one.
#include <bit>
#include <numeric>

#include "stages/charts/chart_parts.h"
#include "stages/charts/charts.h"

namespace texmesh {
namespace {

// Larger textures are packed in cells of several texels: the search's time grows with the third power of the
// grid's side.
constexpr std::uint32_t kMostCells = 512;
// Covers that are tried, as shares of the texture: first down from kFirstCover until all charts fit, then
// halves of what lies between.
constexpr double kFirstCover = 0.7, kCoverStep = 0.85;
constexpr int kCoverSteps = 40, kHalvings = 3;

struct TextureSize {
  std::uint32_t width_px, height_px, gutter_px;
};

/// Where a chart lies: its box of texels, turned by quarters.
struct PlacedChart {
  std::uint32_t x_px = 0, y_px = 0, width_px = 0, height_px = 0, quarter_turns = 0;
};

/// A corner of a chart's box, after turns as quarter_turned makes them. y grows downwards.
Vec2d turned(Vec2d p, Vec2d box, std::uint32_t quarter_turns) {
  for (std::uint32_t i = 0; i < quarter_turns; ++i) {
    p = {box.y - p.y, p.x};
    box = {box.y, box.x};
  }
  return p;
}

/// A chart at the scale in hand, turned by quarters.
struct ScaledChart {
  PlacedChart box;                 // without a place
  std::array<ChartMask, 4> masks;  // by quarter turns, so many as are made
  std::size_t made = 0;            // 0: too large
  const ChartMask& mask(std::size_t turns) {
    for (; made <= turns; ++made) masks[made] = quarter_turned(masks[made - 1]);
    return masks[turns];
  }
};

class AtlasPacking {
 public:
  AtlasPacking(const SurfaceCharts& charts, TextureSize size)
      : charts_(charts),
        size_(size),
        cell_px_((std::max(size.width_px, size.height_px) + kMostCells - 1) / kMostCells),
        triangles_(charts.chart_count),
        placed_(charts.chart_count) {
    for (std::uint32_t t = 0; t < charts.chart_of.size(); ++t) {
      triangles_[charts.chart_of[t]].push_back(t);
      const Vec2d* p = &charts.plane[3 * std::size_t{t}];
      area_ += std::fabs(cross(p[1] - p[0], p[2] - p[0])) / 2;
    }
    // Which order packs best differs from atlas to atlas by 1 to 7 % of the texture.
    add_order([](Vec2d box) { return box.x * box.y; });
    add_order([](Vec2d box) { return std::max(box.x, box.y); });
    add_order([](Vec2d box) { return box.x + box.y; });
  }

  /// Texels per object unit where the charts would cover the share of the texture.
  double scale_of(double cover) const {
    return area_ > 0 ? std::sqrt(cover * size_.width_px * size_.height_px / area_) : 0;
  }

  std::size_t order_count() const { return orders_.size(); }
  /// Whether all charts fit in that order; then placed() is theirs.
  bool place_all(double scale, std::size_t order, const RunContext& context) {
    if (scale != scale_) scaled_.assign(charts_.chart_count, {});
    scale_ = scale;
    const std::uint32_t width = size_.width_px / cell_px_, height = size_.height_px / cell_px_;
    if (width == 0 || height == 0) return false;
    PackingGrid grid(width, height, (size_.gutter_px + cell_px_ - 1) / cell_px_);
    std::uint64_t room = std::uint64_t{width} * height;
    return std::ranges::all_of(orders_[order], [&](std::uint32_t chart) {
      context.check_cancelled();
      return place(chart, grid, scale, room);
    });
  }

  const std::vector<PlacedChart>& placed() const { return placed_; }
  /// A corner's texel coordinates.
  Vec2d texel(std::size_t corner, const PlacedChart& at) const {
    const Vec2d box{double(at.width_px), double(at.height_px)};
    const Vec2d p = turned(in_box(corner, box), box, at.quarter_turns);
    return {p.x + at.x_px, p.y + at.y_px};
  }

 private:
  /// Charts by falling size of their boxes.
  void add_order(double (*size_of)(Vec2d box)) {
    std::vector<std::uint32_t>& order = orders_.emplace_back(charts_.chart_count);
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      const double x = size_of(charts_.size[a]), y = size_of(charts_.size[b]);
      return x != y ? x > y : a < b;
    });
  }

  Vec2d in_box(std::size_t corner, Vec2d box) const {
    const Vec2d size = charts_.size[charts_.chart_of[corner / 3]], p = charts_.plane[corner];
    const auto share = [](double x, double of) { return of > 0 ? std::clamp(x / of, 0.0, 1.0) : 0; };
    return {share(p.x, size.x) * box.x, (1 - share(p.y, size.y)) * box.y};
  }

  ChartMask mask_at(std::uint32_t chart, const PlacedChart& at) const {
    const Vec2d box{double(at.width_px), double(at.height_px)};
    std::vector<std::array<Vec2d, 3>> flat;
    for (const std::uint32_t t : triangles_[chart]) {
      flat.emplace_back();
      for (std::size_t k = 0; k < 3; ++k)
        flat.back()[k] = in_box(3 * std::size_t{t} + k, box) * (1.0 / cell_px_);
    }
    const auto cells = [&](std::uint32_t px) { return (px + cell_px_ - 1) / cell_px_; };
    return mask_of(flat, cells(at.width_px), cells(at.height_px));
  }

  ScaledChart& scaled(std::uint32_t chart, double scale) {
    ScaledChart& out = scaled_[chart];
    if (out.made > 0) return out;
    // A box of whole texels wastes none on its border. That changes the density of small charts a little.
    const auto texels = [&](double size) {
      constexpr double kMost = 1e6;  // more than any texture has
      return static_cast<std::uint32_t>(std::clamp(std::round(size * scale), 1.0, kMost));
    };
    out.box = {0, 0, texels(charts_.size[chart].x), texels(charts_.size[chart].y), 0};
    const std::uint32_t longest_px = std::max(size_.width_px, size_.height_px);
    if (out.box.width_px > longest_px || out.box.height_px > longest_px) return out;
    out.masks[0] = mask_at(chart, out.box);
    out.made = 1;
    return out;
  }

  bool place(std::uint32_t chart, PackingGrid& grid, double scale, std::uint64_t& room) {
    ScaledChart& chart_here = scaled(chart, scale);
    if (chart_here.made == 0) return false;
    const std::uint64_t cells = chart_here.masks[0].cell_count();
    if (cells > room) return false;
    room -= cells;
    PlacedChart& at = placed_[chart];
    at = chart_here.box;
    std::uint32_t least_bottom = kNoIndex;
    PackingGrid::Place best;
    for (std::uint32_t turns = 0; turns < 4; ++turns) {
      const ChartMask& mask = chart_here.mask(turns);
      if (mask.height >= least_bottom) continue;
      const auto found = grid.first_free(mask, least_bottom - mask.height - 1);
      if (!found) continue;
      least_bottom = found->y + mask.height;
      best = *found;
      at.quarter_turns = turns;
    }
    if (least_bottom == kNoIndex) return false;
    grid.take(chart_here.mask(at.quarter_turns), best);
    at.x_px = best.x * cell_px_;
    at.y_px = best.y * cell_px_;
    return true;
  }

  const SurfaceCharts& charts_;
  TextureSize size_;
  std::uint32_t cell_px_;
  double area_ = 0;
  std::vector<std::vector<std::uint32_t>> orders_;     // of charts, to try
  std::vector<std::vector<std::uint32_t>> triangles_;  // per chart
  double scale_ = -1;                                  // of scaled_
  std::vector<ScaledChart> scaled_;
  std::vector<PlacedChart> placed_;
};

/// The placement of the largest scale found: by the first order, then by the others as far as they are
/// better.
std::optional<std::vector<PlacedChart>> pack_largest(AtlasPacking& packing, const RunContext& context) {
  std::vector<PlacedChart> best;
  const auto fits = [&](double cover, std::size_t order) {
    if (!packing.place_all(packing.scale_of(cover), order, context)) return false;
    best = packing.placed();
    return true;
  };
  double low = kFirstCover, high = 1;
  for (int step = 0; !fits(low, 0); high = low, low *= kCoverStep) {
    if (++step < kCoverSteps) continue;
    for (std::size_t order = 0; order < packing.order_count(); ++order)
      if (fits(0, order)) return best;
    return std::nullopt;
  }
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = (low + high) / 2;
    (fits(middle, 0) ? low : high) = middle;
  }
  const double step = high - low;
  for (std::size_t order = 1; order < packing.order_count(); ++order)
    while (low + step < 1 && fits(low + step, order)) low += step;
  return best;
}

// What reaches less than this into a cell, in cells, comes from rounding.
constexpr double kMostRounding = 1e-6;

class MaskBits {
 public:
  MaskBits(std::uint32_t width, std::uint32_t height)
      : width_(width), height_(height), bits_(std::size_t{width} * height, 0) {}

  void set(std::uint32_t x, std::uint32_t y) { bits_[std::size_t{y} * width_ + x] = 1; }
  void add(const std::array<Vec2d, 3>& triangle) {
    const auto [top, bottom] = std::minmax({triangle[0].y, triangle[1].y, triangle[2].y});
    const Cells rows = cells_of(top, bottom, height_);
    for (std::uint32_t y = rows.first; y < rows.end; ++y) {
      const auto [left, right] = extent_in_row(triangle, y);
      const Cells cells = cells_of(left, right, width_);
      for (std::uint32_t x = cells.first; x < cells.end; ++x) set(x, y);
    }
  }
  ChartMask mask() const {
    ChartMask out{width_, height_, {}};
    for (std::uint32_t y = 0; y < height_; ++y)
      for (std::uint32_t x = 0; x < width_; ++x) {
        if (!bits_[std::size_t{y} * width_ + x]) continue;
        if (x > 0 && bits_[std::size_t{y} * width_ + x - 1])
          ++out.runs.back().count;
        else
          out.runs.push_back({y, x, 1});
      }
    return out;
  }

 private:
  struct Cells {
    std::uint32_t first, end;
  };
  /// The cells of [low, high], at least one.
  static Cells cells_of(double low, double high, std::uint32_t count) {
    const double first = std::clamp(std::floor(low + kMostRounding), 0.0, count - 1.0);
    const double end = std::clamp(std::ceil(high - kMostRounding), first + 1, static_cast<double>(count));
    return {static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(end)};
  }
  /// From where to where the part of the triangle between y and y + 1 reaches.
  static std::pair<double, double> extent_in_row(const std::array<Vec2d, 3>& triangle, std::uint32_t y) {
    const double top = y, bottom = y + 1.0;
    double left = 1e300, right = -1e300;
    const auto reach = [&](double x) { left = std::min(left, x), right = std::max(right, x); };
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2d a = triangle[k], b = triangle[(k + 1) % 3];
      if (a.y >= top && a.y <= bottom) reach(a.x);
      for (const double line : {top, bottom})
        if ((a.y < line) != (b.y < line)) reach(a.x + (b.x - a.x) * ((line - a.y) / (b.y - a.y)));
    }
    return left <= right ? std::pair{left, right} : std::pair{triangle[0].x, triangle[0].x};
  }

  std::uint32_t width_, height_;
  std::vector<std::uint8_t> bits_;
};

/// out[x] |= in[x + offset]; `in` has one word of 0 behind its `words`.
void join_moved(const std::uint64_t* in, std::uint64_t* out, std::uint32_t words, std::uint32_t offset) {
  const std::uint32_t whole = offset / 64, part = offset % 64;
  in += whole;
  if (part == 0)
    for (std::uint32_t w = 0; w + whole < words; ++w) out[w] |= in[w];
  else
    for (std::uint32_t w = 0; w + whole < words; ++w) out[w] |= in[w] >> part | in[w + 1] << (64 - part);
}

void set_bits(std::uint64_t* row, std::uint32_t first, std::uint32_t end) {
  for (std::uint32_t x = first; x < end; ++x) row[x / 64] |= std::uint64_t{1} << x % 64;
}

}  // namespace

std::optional<AtlasMesh> pack_atlas(const ProxySurface& surface, const SurfaceCharts& charts,
                                    std::uint32_t width_px, std::uint32_t height_px, std::uint32_t gutter_px,
                                    const RunContext& context) {
  AtlasPacking packing(charts, {width_px, height_px, gutter_px});
  const auto placed = pack_largest(packing, context);
  if (!placed) return std::nullopt;
  AtlasMesh mesh;
  mesh.chart_of = charts.chart_of;
  mesh.group_of = surface.group;
  mesh.chart_count = charts.chart_count;
  mesh.width_px = width_px, mesh.height_px = height_px, mesh.gutter_px = gutter_px;
  mesh.triangles.resize(surface.triangles.size());
  mesh.positions.resize(charts.vertex_count);
  mesh.uvs.resize(charts.vertex_count);
  mesh.position_of.resize(charts.vertex_count);
  for (std::size_t c = 0; c < charts.vertex_of.size(); ++c) {
    const std::uint32_t vertex = charts.vertex_of[c];
    const Vec2d p = packing.texel(c, (*placed)[charts.chart_of[c / 3]]);
    mesh.triangles[c / 3][c % 3] = vertex;
    mesh.position_of[vertex] = surface.triangles[c / 3][c % 3];
    mesh.positions[vertex] = surface.positions[mesh.position_of[vertex]];
    mesh.uvs[vertex] = {static_cast<float>(p.x / width_px), static_cast<float>(p.y / height_px)};
  }
  return mesh;
}

std::uint64_t ChartMask::cell_count() const {
  std::uint64_t sum = 0;
  for (const Run& run : runs) sum += run.count;
  return sum;
}

ChartMask mask_of(std::span<const std::array<Vec2d, 3>> triangles, std::uint32_t width,
                  std::uint32_t height) {
  MaskBits bits(width, height);
  for (const std::array<Vec2d, 3>& triangle : triangles) bits.add(triangle);
  return bits.mask();
}

ChartMask quarter_turned(const ChartMask& mask) {
  MaskBits bits(mask.height, mask.width);
  for (const ChartMask::Run& run : mask.runs)
    for (std::uint32_t x = run.first; x < run.first + run.count; ++x) bits.set(mask.height - 1 - run.row, x);
  return bits.mask();
}

PackingGrid::PackingGrid(std::uint32_t width, std::uint32_t height, std::uint32_t gutter)
    : width_(width),
      height_(height),
      gutter_(gutter),
      words_((width + 63) / 64),
      powers_(static_cast<std::uint32_t>(std::bit_width(width))),
      taken_(std::size_t{height} * powers_ * (words_ + 1), 0),
      made_(height, 1),
      gaps_(height, width),
      forbidden_(words_) {}

/// The row's taken cells at the offsets 0 .. 2^power - 1.
const std::uint64_t* PackingGrid::joined(std::uint32_t y, std::uint32_t power) {
  for (; made_[y] <= power; ++made_[y]) {
    const std::uint64_t* half = row(y, made_[y] - 1u);
    std::uint64_t* whole = row(y, made_[y]);
    std::copy(half, half + words_, whole);
    join_moved(half, whole, words_, 1u << (made_[y] - 1u));
  }
  return row(y, power);
}

void PackingGrid::forbid_run(std::uint32_t y, const ChartMask::Run& run) {
  const auto power = static_cast<std::uint32_t>(std::bit_width(run.count)) - 1;
  const std::uint64_t* from = joined(y, power);
  join_moved(from, forbidden_.data(), words_, run.first);
  if (const std::uint32_t rest = run.count - (1u << power); rest > 0)
    join_moved(from, forbidden_.data(), words_, run.first + rest);
}

/// False where a run finds no gap of its length.
bool PackingGrid::may_hold(std::span<const ChartMask::Run> runs, std::uint32_t y) const {
  return std::ranges::all_of(runs,
                             [&](const ChartMask::Run& run) { return run.count <= gaps_[y + run.row]; });
}

std::uint32_t PackingGrid::widest_gap(std::uint32_t y) {
  std::uint32_t widest = 0, gap = 0;
  for (std::uint32_t x = 0; x < width_; ++x) {
    gap = row(y)[x / 64] >> x % 64 & 1 ? 0 : gap + 1;
    widest = std::max(widest, gap);
  }
  return widest;
}

/// Whether places are left in the row.
bool PackingGrid::forbid(std::span<const ChartMask::Run> runs, std::uint32_t width, std::uint32_t y) {
  std::fill(forbidden_.begin(), forbidden_.end(), 0);
  set_bits(forbidden_.data(), width_ - width + 1, 64 * words_);
  for (const ChartMask::Run& run : runs) {
    forbid_run(y + run.row, run);
    if (std::all_of(forbidden_.begin(), forbidden_.end(), [](std::uint64_t w) { return w == ~0ull; }))
      return false;
  }
  return true;
}

std::optional<PackingGrid::Place> PackingGrid::first_free(const ChartMask& mask, std::uint32_t last_row) {
  if (mask.width > width_ || mask.height > height_) return std::nullopt;
  std::vector<ChartMask::Run> runs = mask.runs;  // long ones forbid most
  std::ranges::stable_sort(runs, std::greater(), &ChartMask::Run::count);
  for (std::uint32_t y = 0; y <= std::min(last_row, height_ - mask.height); ++y) {
    if (!may_hold(runs, y) || !forbid(runs, mask.width, y)) continue;
    for (std::uint32_t w = 0; w < words_; ++w)
      if (forbidden_[w] != ~0ull)
        return Place{64 * w + static_cast<std::uint32_t>(std::countr_one(forbidden_[w])), y};
  }
  return std::nullopt;
}

void PackingGrid::take(const ChartMask& mask, Place place) {
  for (const ChartMask::Run& run : mask.runs) {
    const std::uint32_t x = place.x + run.first, y = place.y + run.row;
    const std::uint32_t first = x - std::min(x, gutter_), end = std::min(width_, x + run.count + gutter_);
    for (std::uint32_t r = y - std::min(y, gutter_); r < std::min(height_, y + gutter_ + 1); ++r)
      set_bits(row(r), first, end), made_[r] = 1;
  }
  const std::uint32_t end = std::min(height_, place.y + mask.height + gutter_);
  for (std::uint32_t r = place.y - std::min(place.y, gutter_); r < end; ++r) gaps_[r] = widest_gap(r);
}

}  // namespace texmesh
