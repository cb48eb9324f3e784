#include "stages/proxies/atlas/packing_grid.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <functional>
#include <utility>

namespace texmesh {
namespace {

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
