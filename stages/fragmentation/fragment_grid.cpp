#include "stages/fragmentation/fragment_grid.h"

#include <bit>

#include "stages/data/fragments.h"
#include "stages/geometry/texel_coverage.h"

namespace texmesh {
namespace {

constexpr std::uint32_t kPreferredPx = 256, kMaxSidePx = 65488;
constexpr std::uint32_t kPreferredCount = 64;
constexpr std::uint64_t kFragmentOverhead = 6400, kFilledTexelOverhead = 1;  // hundredths of a byte
constexpr std::size_t kMaxCells = 4096;
constexpr double kMaxTiles = 64;
constexpr double kFarTexels = 1099511627776.0;  // 2^40; no fraction is left in a float UV there

struct Axis {
  std::uint32_t count, side_px;
};

/// About `side` px each, never below min_px unless the image is smaller.
Axis cut_axis(std::uint32_t size_px, std::uint32_t side, std::uint32_t min_px) {
  const auto up16 = [](std::uint32_t v) { return (v + 15) / 16 * 16; };
  const std::uint32_t most =
      std::max<std::uint32_t>(size_px / min_px, (size_px + kMaxSidePx - 1) / kMaxSidePx);
  const std::uint32_t wanted = std::clamp<std::uint32_t>((size_px + side - 1) / side, 1, std::max(most, 1u));
  const std::uint32_t side_px = up16((size_px + wanted - 1) / wanted);
  return {(size_px + side_px - 1) / side_px, side_px};
}

/// Covered texels of every 16 x 16 block of an image.
class Blocks {
 public:
  Blocks(std::uint32_t width_px, std::uint32_t height_px, const std::vector<std::uint8_t>& coverage)
      : columns_((width_px + 15) / 16),
        rows_((height_px + 15) / 16),
        covered_(std::size_t{columns_} * rows_) {
    const std::size_t stride = coverage_stride_bytes(width_px);
    for (std::uint32_t y = 0; y < height_px; ++y)
      for (std::size_t byte = 0; byte < stride; ++byte) {
        const auto width = std::min<std::size_t>(8, width_px - byte * 8);
        covered_[std::size_t{y / 16} * columns_ + byte / 2] += static_cast<std::uint16_t>(
            coverage.empty() ? width : static_cast<std::size_t>(std::popcount(coverage[y * stride + byte])));
      }
    for (const std::uint16_t n : covered_) texels_ += n;
  }
  std::uint64_t texels() const { return texels_; }
  /// Fragments with a covered texel.
  std::uint32_t stored(const Axis& x, const Axis& y) const {
    std::vector<std::uint8_t> any(std::size_t{x.count} * y.count);
    for (std::uint32_t r = 0; r < rows_; ++r)
      for (std::uint32_t c = 0; c < columns_; ++c)
        if (covered_[std::size_t{r} * columns_ + c] > 0)
          any[std::size_t{r * 16 / y.side_px} * x.count + c * 16 / x.side_px] = 1;
    return static_cast<std::uint32_t>(std::count(any.begin(), any.end(), 1));
  }

 private:
  std::uint32_t columns_, rows_;
  std::vector<std::uint16_t> covered_;
  std::uint64_t texels_ = 0;
};

struct Candidate {
  Axis x, y;
  std::uint32_t stored = 0;
  std::uint64_t filled = 0;  // texels of stored fragments that are not covered
  std::uint64_t overhead() const { return stored * kFragmentOverhead + filled * kFilledTexelOverhead; }
};

std::string text(std::uint64_t v) { return std::to_string(v); }

std::string tenths(std::uint64_t part, std::uint64_t whole) {
  const std::uint64_t v = part * 10 / whole;
  return text(v / 10) + "." + text(v % 10);
}

std::string reason_of(const FragmentGrid& g, const Candidate& chosen, std::size_t candidates,
                      std::uint32_t max_fragments, std::uint32_t min_px) {
  std::string why;
  if (g.columns == 1 && g.rows == 1)
    why = max_fragments == 1 ? "one fragment asked for"
                             : "too small for two fragments of " + text(min_px) + " px";
  else if (std::max(g.fragment_width_px, g.fragment_height_px) > std::max(kPreferredPx, min_px + 15))
    why = "larger than " + text(kPreferredPx) + " px to stay within " + text(max_fragments) + " fragments";
  else if (candidates == 1)
    why = "the only grid that keeps the limits";
  else
    why = "least overhead of " + text(candidates) + " grids";
  return text(g.width_px) + " x " + text(g.height_px) + " px in " + text(g.columns) + " x " + text(g.rows) +
         " fragments of " + text(g.fragment_width_px) + " x " + text(g.fragment_height_px) + " px, " +
         text(chosen.stored) + " stored (" + why + "; overhead weighed as " +
         tenths(chosen.overhead(), 100000) + " kB: " + text(chosen.stored) + " fragments at " +
         text(kFragmentOverhead / 100) + " B, " + tenths(chosen.filled, 1000) +
         "k uncovered texels at 0.01 B)";
}

/// The part of a convex polygon with lo <= axis <= hi.
void clip(std::vector<Vec2d>& polygon, std::vector<Vec2d>& scratch, bool along_x, double lo, double hi) {
  const auto half = [&](double bound, double sign) {
    scratch.clear();
    const auto inside = [&](Vec2d p) { return sign * (bound - (along_x ? p.x : p.y)); };
    for (std::size_t k = 0; k < polygon.size(); ++k) {
      const Vec2d a = polygon[k], b = polygon[(k + 1) % polygon.size()];
      const double da = inside(a), db = inside(b);
      if (da >= 0) scratch.push_back(a);
      if ((da > 0 && db < 0) || (da < 0 && db > 0)) scratch.push_back(a + (b - a) * (da / (da - db)));
    }
    polygon.swap(scratch);
  };
  half(lo, -1);
  half(hi, 1);
}

double area_of(const std::vector<Vec2d>& polygon) {
  double twice = 0;
  for (std::size_t k = 2; k < polygon.size(); ++k)
    twice += cross(polygon[k - 1] - polygon[0], polygon[k] - polygon[0]);
  return std::fabs(twice) / 2;
}

}  // namespace

FragmentGrid choose_grid(std::uint32_t width_px, std::uint32_t height_px,
                         const std::vector<std::uint8_t>& coverage, std::uint32_t max_fragments,
                         std::uint32_t min_px) {
  min_px = (std::max(min_px, 16u) + 15) / 16 * 16;
  const std::uint64_t most = std::max<std::uint64_t>(max_fragments, 1);
  const Blocks blocks(width_px, height_px, coverage);
  std::vector<Candidate> candidates;
  const auto consider = [&](std::uint32_t side, bool at_any_rate) {
    Candidate c{cut_axis(width_px, side, min_px), cut_axis(height_px, side, min_px)};
    if (std::uint64_t{c.x.count} * c.y.count > most && !at_any_rate) return;
    for (const Candidate& other : candidates)
      if (other.x.side_px == c.x.side_px && other.y.side_px == c.y.side_px) return;
    c.stored = blocks.stored(c.x, c.y);
    c.filled = std::uint64_t{c.stored} * c.x.side_px * c.y.side_px - blocks.texels();
    candidates.push_back(c);
  };
  std::uint32_t side = std::max(kPreferredPx, min_px);
  for (std::uint32_t s = side; s >= min_px; s -= 16) consider(s, false);
  for (; candidates.empty(); side = std::min(side + 16, kMaxSidePx)) consider(side, side == kMaxSidePx);

  std::uint32_t wanted = 0;
  for (const Candidate& c : candidates) wanted = std::max(wanted, std::min(c.stored, kPreferredCount));
  const Candidate* best = nullptr;
  for (const Candidate& c : candidates)
    if (c.stored >= wanted && (best == nullptr || c.overhead() < best->overhead())) best = &c;
  FragmentGrid grid{width_px, height_px, best->x.side_px, best->y.side_px, best->x.count, best->y.count, {}};
  grid.reason = reason_of(grid, *best, candidates.size(), max_fragments, min_px);
  return grid;
}

/// False when there are too many tiles.
bool AreaSpreader::cut(double lo, double hi, std::uint32_t size, std::uint32_t step, Wrap wrap,
                       std::vector<Cell>& out) {
  out.clear();
  const std::uint32_t count = (size + step - 1) / step;
  if (wrap == Wrap::kClamp) {
    for (std::uint32_t c = 0; c < count; ++c) {
      const double begin = c == 0 ? -kFarTexels : static_cast<double>(std::uint64_t{c} * step);
      const double end = c + 1 == count ? kFarTexels : static_cast<double>(std::uint64_t{c + 1} * step);
      if (end > lo && (begin < hi || begin == lo)) out.push_back({begin, end, c});
    }
    return true;
  }
  const double first = std::floor(lo / size), last = std::floor(hi / size);
  if (last - first > kMaxTiles) return false;
  for (auto tile = static_cast<std::int64_t>(first); tile <= static_cast<std::int64_t>(last); ++tile) {
    const bool mirrored = wrap == Wrap::kMirror && tile % 2 != 0;
    const double origin = static_cast<double>(tile) * size;
    for (std::uint32_t k = 0; k < count; ++k) {
      const std::uint32_t c = mirrored ? count - 1 - k : k;
      const auto begin = static_cast<double>(std::uint64_t{c} * step);
      const auto end = static_cast<double>(std::min<std::uint64_t>(std::uint64_t{c + 1} * step, size));
      const Cell cell{origin + (mirrored ? size - end : begin), origin + (mirrored ? size - begin : end), c};
      if (cell.end > lo && (cell.begin < hi || cell.begin == lo)) out.push_back(cell);
    }
  }
  return true;
}

void AreaSpreader::add_evenly(double amount, std::vector<double>& fragments) const {
  const double whole = static_cast<double>(grid_.width_px) * grid_.height_px;
  for (std::uint32_t r = 0; r < grid_.rows; ++r)
    for (std::uint32_t c = 0; c < grid_.columns; ++c) {
      const double w = std::min(grid_.fragment_width_px, grid_.width_px - c * grid_.fragment_width_px);
      const double h = std::min(grid_.fragment_height_px, grid_.height_px - r * grid_.fragment_height_px);
      fragments[std::size_t{r} * grid_.columns + c] += amount * w * h / whole;
    }
}

void AreaSpreader::add_longest_edge(const std::array<Vec2d, 3>& triangle, Wrap wrap_s, Wrap wrap_t,
                                    double amount, std::vector<double>& fragments) const {
  std::size_t longest = 0;
  const auto squared = [&](std::size_t k) {
    const Vec2d d = triangle[(k + 1) % 3] - triangle[k];
    return dot(d, d);
  };
  for (std::size_t k = 1; k < 3; ++k)
    if (squared(k) > squared(longest)) longest = k;
  const Vec2d a = triangle[longest], d = triangle[(longest + 1) % 3] - a;
  constexpr int kPieces = 16;
  for (int k = 0; k < kPieces; ++k)
    fragments[fragment_at(grid_, a + d * ((k + 0.5) / kPieces), wrap_s, wrap_t)] += amount / kPieces;
}

void AreaSpreader::add_clipped(const std::array<Vec2d, 3>& triangle, double amount,
                               std::vector<double>& fragments) const {
  std::vector<Vec2d> band, piece, scratch;
  double whole = 0;
  std::vector<double> parts(columns_.size() * rows_.size());
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    band.assign(triangle.begin(), triangle.end());
    clip(band, scratch, false, rows_[r].begin, rows_[r].end);
    for (std::size_t c = 0; c < columns_.size() && band.size() > 2; ++c) {
      piece = band;
      clip(piece, scratch, true, columns_[c].begin, columns_[c].end);
      whole += parts[r * columns_.size() + c] = area_of(piece);
    }
  }
  for (std::size_t k = 0; k < parts.size(); ++k)
    fragments[std::size_t{rows_[k / columns_.size()].index} * grid_.columns +
              columns_[k % columns_.size()].index] += amount * (parts[k] / whole);
}

void AreaSpreader::add(const std::array<Vec2d, 3>& triangle, Wrap wrap_s, Wrap wrap_t, double amount,
                       std::vector<double>& fragments) {
  const auto [x0, x1] = std::minmax({triangle[0].x, triangle[1].x, triangle[2].x});
  const auto [y0, y1] = std::minmax({triangle[0].y, triangle[1].y, triangle[2].y});
  if (std::max({-x0, x1, -y0, y1}) >= kFarTexels ||
      !cut(x0, x1, grid_.width_px, grid_.fragment_width_px, wrap_s, columns_) ||
      !cut(y0, y1, grid_.height_px, grid_.fragment_height_px, wrap_t, rows_) ||
      columns_.size() * rows_.size() > kMaxCells)
    return add_evenly(amount, fragments);
  if (columns_.size() == 1 && rows_.size() == 1) {
    fragments[std::size_t{rows_[0].index} * grid_.columns + columns_[0].index] += amount;
    return;
  }
  const double area = std::fabs(cross(triangle[1] - triangle[0], triangle[2] - triangle[0])) / 2;
  const double extent = std::max(x1 - x0, y1 - y0);
  if (area > 1e-9 * extent * extent)
    add_clipped(triangle, amount, fragments);
  else
    add_longest_edge(triangle, wrap_s, wrap_t, amount, fragments);
}

std::uint32_t fragment_at(const FragmentGrid& grid, Vec2d point, Wrap wrap_s, Wrap wrap_t) {
  const auto texel = [](double v, std::uint32_t size, Wrap wrap) {
    return wrapped(static_cast<std::int64_t>(std::floor(std::clamp(v, -kFarTexels, kFarTexels))), size, wrap);
  };
  return texel(point.y, grid.height_px, wrap_t) / grid.fragment_height_px * grid.columns +
         texel(point.x, grid.width_px, wrap_s) / grid.fragment_width_px;
}

}  // namespace texmesh
