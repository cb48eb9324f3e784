#include "stages/proxies/packing/packing_grid.h"

#include <algorithm>
#include <bit>
#include <cstddef>
#include <functional>

namespace texmesh {
namespace {

/// out[x] |= in[x + offset]; rows of `words` words with one word of 0 behind them, in == out allowed.
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

PackingGrid::PackingGrid(std::uint32_t width, std::uint32_t height, std::uint32_t gutter)
    : width_(width),
      height_(height),
      gutter_(gutter),
      words_((width + 63) / 64),
      taken_(std::size_t{height} * words_, 0),
      gaps_(height, width),
      forbidden_(words_),
      joined_(words_ + 1) {}

void PackingGrid::forbid_run(const std::uint64_t* taken, const ChartMask::Run& run) {
  std::copy(taken, taken + words_, joined_.begin());
  for (std::uint32_t length = 1; length < run.count;) {  // joined_ holds offsets 0 .. length - 1
    const std::uint32_t step = std::min(length, run.count - length);
    join_moved(joined_.data(), joined_.data(), words_, step);
    length += step;
  }
  join_moved(joined_.data(), forbidden_.data(), words_, run.first);
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
    forbid_run(row(y + run.row), run);
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
      set_bits(row(r), first, end);
  }
  const std::uint32_t end = std::min(height_, place.y + mask.height + gutter_);
  for (std::uint32_t r = place.y - std::min(place.y, gutter_); r < end; ++r) gaps_[r] = widest_gap(r);
}

}  // namespace texmesh
