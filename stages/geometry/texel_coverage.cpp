#include "stages/geometry/texel_coverage.h"

#include "format/base/portable_math.h"
#include "stages/data/fragments.h"

namespace texmesh {
namespace {

constexpr double kFarTexels = 1099511627776.0;  // 2^40
constexpr double kMaxTilesHigh = 4;
// Rounding of the clip below is about 1e-10 texels at the far end of what is traced.
constexpr double kSlack = 1e-6;

/// The tile that the smallest coordinate lies in, an even one for MIRROR, in texels.
double tile_origin(double smallest, std::uint32_t size, Wrap wrap) {
  if (wrap == Wrap::kClamp) return 0;
  const double period = wrap == Wrap::kMirror ? 2.0 * size : size;
  return std::floor(smallest / period) * period;
}

}  // namespace

TexelMap::TexelMap(const UvTransform& transform, std::uint32_t width_px, std::uint32_t height_px)
    : offset_(to_double(transform.offset)),
      scale_(to_double(transform.scale)),
      width_(width_px),
      height_(height_px) {
  if (transform.rotation != 0) {
    cos_ = portable::cos(transform.rotation);
    sin_ = portable::sin(transform.rotation);
  }
}

std::uint32_t wrapped(std::int64_t index, std::uint32_t size, Wrap wrap) {
  const std::int64_t n = size;
  if (wrap == Wrap::kClamp) return static_cast<std::uint32_t>(std::clamp<std::int64_t>(index, 0, n - 1));
  const std::int64_t period = wrap == Wrap::kMirror ? 2 * n : n;
  std::int64_t m = index % period;
  if (m < 0) m += period;
  return static_cast<std::uint32_t>(m < n ? m : 2 * n - 1 - m);
}

TexelCoverage::TexelCoverage(std::uint32_t width_px, std::uint32_t height_px, Wrap wrap_s, Wrap wrap_t)
    : width_(width_px),
      height_(height_px),
      wrap_s_(wrap_s),
      wrap_t_(wrap_t),
      bits_(coverage_size_bytes(width_px, height_px)),
      row_full_(height_px) {}

void TexelCoverage::mark(std::uint32_t row, std::uint32_t first, std::uint32_t last) {
  std::uint8_t* bytes = bits_.data() + coverage_stride_bytes(width_) * row;
  const std::uint32_t a = first / 8, b = last / 8;
  const auto head = static_cast<std::uint8_t>(0xff >> (first % 8));
  const auto tail = static_cast<std::uint8_t>(0xff << (7 - last % 8));
  if (a == b) {
    bytes[a] |= head & tail;
    return;
  }
  bytes[a] |= head;
  for (std::uint32_t k = a + 1; k < b; ++k) bytes[k] = 0xff;
  bytes[b] |= tail;
}

void TexelCoverage::mark_everything() {
  for (std::uint32_t row = 0; row < height_; ++row) mark(row, 0, width_ - 1);
  row_full_.assign(height_, 1);
  full_rows_ = height_;
}

void TexelCoverage::add_row(std::uint32_t row, Extent extent) {
  if (row_full_[row]) return;
  const std::int64_t width = width_;
  const double period = wrap_s_ == Wrap::kMirror ? 2.0 * width_ : width_;
  if (wrap_s_ != Wrap::kClamp && extent.hi - extent.lo >= period) {
    mark(row, 0, width_ - 1);
    row_full_[row] = 1;
    ++full_rows_;
    return;
  }
  auto first = static_cast<std::int64_t>(std::ceil(extent.lo - 1.5 - kSlack));
  auto last = static_cast<std::int64_t>(std::floor(extent.hi + 0.5 + kSlack));
  if (wrap_s_ == Wrap::kClamp) {
    mark(row, wrapped(first, width_, wrap_s_), wrapped(last, width_, wrap_s_));
    return;
  }
  while (first <= last) {  // tile by tile, at most four of them
    const std::int64_t tile = first >= 0 ? first / width : -((width - 1 - first) / width);
    const std::int64_t end = std::min(last, tile * width + width - 1);
    const std::uint32_t a = wrapped(first, width_, wrap_s_), b = wrapped(end, width_, wrap_s_);
    mark(row, std::min(a, b), std::max(a, b));
    first = end + 1;
  }
}

/// Fills slabs_[k - first] with the extent in x of the triangle within y in [k - 0.5, k + 0.5], k =
/// first..last; what lies above or below goes to the first and last slab.
void TexelCoverage::trace(const std::array<Vec2d, 3>& triangle, std::int64_t first, std::int64_t last) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  slabs_.assign(static_cast<std::size_t>(last - first + 1), {kInfinity, -kInfinity});
  const auto slab_of = [&](double y) {
    return std::clamp(static_cast<std::int64_t>(std::floor(y + 0.5)), first, last);
  };
  const auto widen_slab = [&](std::int64_t slab, double x) {
    Extent& e = slabs_[static_cast<std::size_t>(slab - first)];
    e.lo = std::min(e.lo, x);
    e.hi = std::max(e.hi, x);
  };
  for (int edge = 0; edge < 3; ++edge) {
    Vec2d a = triangle[static_cast<std::size_t>(edge)],
          b = triangle[static_cast<std::size_t>((edge + 1) % 3)];
    if (a.y > b.y) std::swap(a, b);
    const std::int64_t from = slab_of(a.y), to = slab_of(b.y);
    widen_slab(from, a.x);
    widen_slab(to, b.x);
    for (std::int64_t k = from; k < to; ++k) {
      const double y = static_cast<double>(k) + 0.5;
      const double x =
          std::clamp(a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y)), std::min(a.x, b.x), std::max(a.x, b.x));
      widen_slab(k, x);
      widen_slab(k + 1, x);
    }
  }
}

void TexelCoverage::add(const std::array<Vec2d, 3>& triangle) {
  if (full_rows_ == height_) return;
  for (const Vec2d p : triangle)
    if (std::fabs(p.x) > kFarTexels || std::fabs(p.y) > kFarTexels) return mark_everything();
  const auto [x0, x1] = std::minmax({triangle[0].x, triangle[1].x, triangle[2].x});
  const auto [y0, y1] = std::minmax({triangle[0].y, triangle[1].y, triangle[2].y});
  const Vec2d origin{tile_origin(x0, width_, wrap_s_), tile_origin(y0, height_, wrap_t_)};
  if (wrap_t_ != Wrap::kClamp && y1 - y0 > kMaxTilesHigh * height_) {
    for (std::uint32_t row = 0; row < height_; ++row) add_row(row, {x0 - origin.x, x1 - origin.x});
    return;
  }
  const std::array<Vec2d, 3> local{triangle[0] - origin, triangle[1] - origin, triangle[2] - origin};
  auto first = static_cast<std::int64_t>(std::floor(y0 - origin.y + 0.5 - kSlack));
  auto last = static_cast<std::int64_t>(std::floor(y1 - origin.y + 0.5 + kSlack));
  const std::int64_t height = height_;
  if (wrap_t_ == Wrap::kClamp) {
    first = std::clamp<std::int64_t>(first, -1, height);
    last = std::clamp<std::int64_t>(last, -1, height);
  }
  trace(local, first, last);
  // Row j reads y in [j - 0.5, j + 1.5]: slabs j and j + 1.
  const auto slab = [&](std::int64_t k) {
    return k < first || k > last
               ? Extent{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()}
               : slabs_[static_cast<std::size_t>(k - first)];
  };
  for (std::int64_t j = first - 1; j <= last; ++j) {
    const Extent a = slab(j), b = slab(j + 1);
    const Extent both{std::min(a.lo, b.lo), std::max(a.hi, b.hi)};
    if (both.lo <= both.hi) add_row(wrapped(j, height_, wrap_t_), both);
  }
}

}  // namespace texmesh
