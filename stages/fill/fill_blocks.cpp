#include "stages/fill/fill_blocks.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "stages/base/parallel.h"
#include "stages/data/coverage.h"
#include "stages/jpeg/block_transform.h"

namespace texmesh {
namespace {

constexpr int kIterations = 16;
constexpr float kLastThreshold = 8;  // of orthonormal DCT coefficients: about what quality 75 rounds to 0
constexpr int kSameLevel = 6;        // flat neighbours that differ by no more get one value

using Mask = std::array<bool, 64>;

/// Unknown values become those of a block with few coefficients that agrees with the known ones.
void extrapolate(BlockValues& values, const Mask& known) {
  float first = 0;
  for (int step = 0; step < kIterations; ++step) {
    BlockValues x = block_dct(values);
    if (step == 0)
      for (std::size_t k = 1; k < 64; ++k) first = std::max(first, std::fabs(x[k]));
    first = std::max(first, kLastThreshold);
    const float threshold = first + (kLastThreshold - first) * static_cast<float>(step + 1) / kIterations;
    for (std::size_t k = 1; k < 64; ++k)
      if (std::fabs(x[k]) < threshold) x[k] = 0;
    x = block_inverse_dct(x);
    for (std::size_t k = 0; k < 64; ++k)
      if (!known[k]) values[k] = x[k];
  }
}

/// The values that a block had: what is made up stays between them, so that mips do not see colours that the
/// texture does not have.
struct ByteRange {
  std::uint8_t lo = 255, hi = 0;
  void add(std::uint8_t v) { lo = std::min(lo, v), hi = std::max(hi, v); }
  std::uint8_t cut(double v) const {
    return static_cast<std::uint8_t>(std::clamp(v, static_cast<double>(lo), static_cast<double>(hi)) + 0.5);
  }
};

/// One 16 x 16 block of the image as JPEG sees it: luma, and chroma of half the resolution.
template <int C>
class Mcu {
 public:
  Mcu(Pixels& pixels, const std::vector<std::uint8_t>& coverage, std::uint32_t left, std::uint32_t top)
      : pixels_(pixels), left_(left), top_(top) {
    const CoverageMask mask(coverage, pixels.width_px, pixels.height_px);
    for (std::uint32_t y = 0; y < kMcu; ++y)
      rows_[y] = std::uint32_t{mask.byte_at(left, top + y)} << 8 | mask.byte_at(left + 8, top + y);
  }

  bool covered(std::uint32_t x, std::uint32_t y) const { return rows_[y] >> (15 - x) & 1; }
  bool all_covered() const {
    return std::ranges::all_of(rows_, [](std::uint32_t r) { return r == 0xffff; });
  }
  bool none_covered() const {
    return std::ranges::all_of(rows_, [](std::uint32_t r) { return r == 0; });
  }

  /// Sets all texels to their mean, or to `before` where that differs little; returns what they became.
  std::array<int, C> flatten(const std::array<int, C>* before) {
    std::array<int, C> mean{};
    for (std::uint32_t y = 0; y < kMcu; ++y)
      for (std::uint32_t x = 0; x < kMcu; ++x)
        for (int c = 0; c < C; ++c) mean[static_cast<std::size_t>(c)] += at(x, y)[c];
    bool same = before != nullptr;
    for (std::size_t c = 0; c < C; ++c) {
      mean[c] = (mean[c] + 128) / 256;
      same = same && std::abs(mean[c] - (*before)[c]) <= kSameLevel;
    }
    if (same) mean = *before;
    for (std::uint32_t y = 0; y < kMcu; ++y)
      for (std::uint32_t x = 0; x < kMcu; ++x)
        for (int c = 0; c < C; ++c)
          at(x, y)[c] = static_cast<std::uint8_t>(mean[static_cast<std::size_t>(c)]);
    return mean;
  }

  void extrapolate_all() {
    std::array<float, 256> luma;
    for (std::uint32_t y = 0; y < kMcu; ++y)
      for (std::uint32_t x = 0; x < kMcu; ++x) luma[y * kMcu + x] = static_cast<float>(luma_at(x, y));
    for (std::uint32_t b = 0; b < 4; ++b) extrapolate_luma(luma, b % 2 * 8, b / 2 * 8);
    BlockValues cb{}, cr{};
    if (C == 3) extrapolate_chroma(cb, cr);
    std::array<ByteRange, 3> range;
    for (std::uint32_t y = 0; y < kMcu; ++y)
      for (std::uint32_t x = 0; x < kMcu; ++x)
        for (int c = 0; c < C; ++c) range[static_cast<std::size_t>(c)].add(at(x, y)[c]);
    for (std::uint32_t y = 0; y < kMcu; ++y)
      for (std::uint32_t x = 0; x < kMcu; ++x) {
        if (covered(x, y)) continue;
        const double l = static_cast<double>(luma[y * kMcu + x]);
        std::uint8_t* to = at(x, y);
        if (C == 1) {
          to[0] = range[0].cut(l);
          continue;
        }
        const auto b = static_cast<double>(cb[y / 2 * 8 + x / 2]),
                   r = static_cast<double>(cr[y / 2 * 8 + x / 2]);
        to[0] = range[0].cut(l + 1.402 * r);
        to[1 % C] = range[1].cut(l - 0.344136 * b - 0.714136 * r);
        to[2 % C] = range[2].cut(l + 1.772 * b);
      }
  }

 private:
  std::uint8_t* at(std::uint32_t x, std::uint32_t y) {
    return pixels_.data.data() + (std::size_t{top_ + y} * pixels_.width_px + left_ + x) * C;
  }
  double luma_at(std::uint32_t x, std::uint32_t y) {
    const std::uint8_t* p = at(x, y);
    return C == 1 ? p[0] : 0.299 * p[0] + 0.587 * p[1 % C] + 0.114 * p[2 % C];
  }

  void extrapolate_luma(std::array<float, 256>& luma, std::uint32_t left, std::uint32_t top) {
    BlockValues block;
    Mask known;
    std::size_t count = 0;
    float sum = 0;
    for (std::uint32_t k = 0; k < 64; ++k) {
      const std::uint32_t x = left + k % 8, y = top + k / 8;
      block[k] = luma[y * kMcu + x];
      known[k] = covered(x, y);
      count += known[k];
      sum += block[k];
    }
    if (count == 64) return;
    if (count == 0)
      block.fill(sum / 64);
    else
      extrapolate(block, known);
    for (std::uint32_t k = 0; k < 64; ++k) luma[(top + k / 8) * kMcu + left + k % 8] = block[k];
  }

  /// A chroma sample is known where one of its four texels is: the others then get the same, and JPEG's mean
  /// of the four is what the covered ones have.
  void extrapolate_chroma(BlockValues& cb, BlockValues& cr) {
    Mask known;
    for (std::uint32_t k = 0; k < 64; ++k) {
      double sums[2][2] = {};  // covered?, blue and red
      double counts[2] = {};
      for (std::uint32_t t = 0; t < 4; ++t) {
        const std::uint32_t x = k % 8 * 2 + t % 2, y = k / 8 * 2 + t / 2;
        const std::uint8_t* p = at(x, y);
        const double l = luma_at(x, y);
        const int inside = covered(x, y) ? 1 : 0;
        counts[inside] += 1;
        sums[inside][0] += (p[2 % C] - l) / 1.772;
        sums[inside][1] += (p[0] - l) / 1.402;
      }
      known[k] = counts[1] > 0;
      const int from = known[k] ? 1 : 0;
      cb[k] = static_cast<float>(sums[from][0] / counts[from]);
      cr[k] = static_cast<float>(sums[from][1] / counts[from]);
    }
    extrapolate(cb, known);
    extrapolate(cr, known);
  }

  Pixels& pixels_;
  std::uint32_t left_, top_;
  std::array<std::uint32_t, kMcu> rows_{};  // coverage, bit 15 first
};

template <int C>
void flatten_rows(Pixels& pixels, const std::vector<std::uint8_t>& coverage, PartBlocks part,
                  const RunContext& context) {
  parallel_for(context, pixels.height_px / kMcu, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      std::array<int, C> before{};
      bool flat = false;  // is the block to the left?
      for (std::uint32_t x = 0; x + kMcu <= pixels.width_px; x += kMcu) {
        Mcu<C> mcu(pixels, coverage, x, static_cast<std::uint32_t>(row) * kMcu);
        const bool none = mcu.none_covered();
        if (none)
          before = mcu.flatten(flat ? &before : nullptr);
        else if (part == PartBlocks::kSparse && !mcu.all_covered())
          mcu.extrapolate_all();
        flat = none;
      }
    }
  });
}

}  // namespace

void flatten_unseen(Pixels& pixels, const std::vector<std::uint8_t>& coverage, PartBlocks part,
                    const RunContext& context) {
  if (pixels.channels == 1)
    flatten_rows<1>(pixels, coverage, part, context);
  else
    flatten_rows<3>(pixels, coverage, part, context);
}

}  // namespace texmesh
