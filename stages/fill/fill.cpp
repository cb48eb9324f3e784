#include "stages/fill/fill.h"

#include "stages/base/parallel.h"
#include "stages/image/decode_image.h"
#include "stages/image/resize.h"
#include "stages/jpeg/block_transform.h"

namespace texmesh {
namespace {

/// The side in pixels of what a JPEG codes together with 4:2:0.
inline constexpr std::uint32_t kMcu = 16;

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
  parallel_each(context, pixels.height_px / kMcu, 1, [&](std::size_t row) {
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
  });
}

/// Makes texels that nobody sees cheap for a JPEG whose blocks start at the image's corner. `pixels` (1 or 3
/// channels) have been filled smoothly; texels whose coverage bit is 1 stay as they are. Only 16 x 16 blocks
/// that lie wholly inside the image are touched:
/// - without a covered texel: flat, of the smooth fill's mean, and of the block's to the left where that one
///   is flat and hardly differs, so that neither AC nor DC coefficients cost more than their least code;
/// - covered in part, when these are to be sparse: uncovered texels of each 8 x 8 block of luma, and of
///   halved chroma, are chosen so that the block has few DCT coefficients: alternating projections with a
///   falling threshold (the sparse extrapolation of Guleryuz 2006; Papoulis and Gerchberg's iteration).
/// Plain single precision in a fixed order (stages/jpeg/block_transform.h): same bytes for any thread count.
void flatten_unseen(Pixels& pixels, const std::vector<std::uint8_t>& coverage, PartBlocks part,
                    const RunContext& context) {
  if (pixels.channels == 1)
    flatten_rows<1>(pixels, coverage, part, context);
  else
    flatten_rows<3>(pixels, coverage, part, context);
}

constexpr std::size_t kRowsPerPiece = 64;

/// One step of the pyramid; a texel with mask 0 has no colour yet.
struct Level {
  std::uint32_t width = 0, height = 0;
  std::vector<std::uint8_t> data, mask;
};

/// How the texels that nobody sees are made up.
struct FillChoice {
  Fill fill;
  PartBlocks part;
};

/// The coarse texels that a fine one lies between: it is three quarters of the near and one of the far one.
struct CoarseTexels {
  std::uint32_t near, far;
};

CoarseTexels coarse_texels(std::uint32_t fine, std::uint32_t coarse_size) {
  const std::uint32_t near = fine / 2;
  if (fine % 2) return {near, std::min(near + 1, coarse_size - 1)};
  return {near, near > 0 ? near - 1 : 0};
}

std::uint8_t mean_of(std::uint32_t sum, std::uint32_t count) {
  switch (count) {  // by constants: a division by a variable doubles the time of the whole push
    case 1:
      return static_cast<std::uint8_t>(sum);
    case 2:
      return static_cast<std::uint8_t>((sum + 1) / 2);
    case 3:
      return static_cast<std::uint8_t>((sum + 1) / 3);
    default:
      return static_cast<std::uint8_t>((sum + 2) / 4);
  }
}

template <int C>
class PushPull {
 public:
  PushPull(Pixels& pixels, const std::vector<std::uint8_t>& coverage, const RunContext& context)
      : pixels_(pixels), mask_(coverage, pixels.width_px, pixels.height_px), context_(context) {}

  void run() {
    std::vector<Level> levels;
    levels.push_back(push_base());
    while (levels.back().width > 1 || levels.back().height > 1) levels.push_back(push(levels.back()));
    if (levels.back().mask[0] == 0) return;
    for (std::size_t k = levels.size() - 1; k-- > 0;) pull(levels[k + 1], levels[k]);
    pull_base(levels[0]);
  }

 private:
  static Level half_of(std::uint32_t width, std::uint32_t height) {
    Level out{(width + 1) / 2, (height + 1) / 2, {}, {}};
    out.mask.resize(std::size_t{out.width} * out.height);
    out.data.resize(out.mask.size() * C);
    return out;
  }

  /// Mean of the covered among the four texels at (2x, 2y).
  static void push_texel(const std::uint8_t* from, std::uint32_t width, std::uint32_t height, std::uint32_t x,
                         std::uint32_t y, const auto& is_covered, Level& to) {
    std::uint32_t sum[C] = {}, count = 0;
    for (std::uint32_t v = 2 * y; v < std::min(2 * y + 2, height); ++v)
      for (std::uint32_t u = 2 * x; u < std::min(2 * x + 2, width); ++u) {
        if (!is_covered(u, v)) continue;
        ++count;
        for (int c = 0; c < C; ++c) sum[c] += from[(std::size_t{v} * width + u) * C + c];
      }
    if (count == 0) return;
    const std::size_t at = std::size_t{y} * to.width + x;
    to.mask[at] = 1;
    for (int c = 0; c < C; ++c) to.data[at * C + c] = mean_of(sum[c], count);
  }

  Level push_base() const {
    Level to = half_of(pixels_.width_px, pixels_.height_px);
    const auto is_covered = [this](std::uint32_t u, std::uint32_t v) { return mask_.covered(u, v); };
    parallel_for(context_, to.height, kRowsPerPiece, [&](std::size_t begin, std::size_t end) {
      for (auto y = static_cast<std::uint32_t>(begin); y < end; ++y)
        for (std::uint32_t byte = 0; byte < mask_.stride_bytes; ++byte) {
          const bool second = 2 * y + 1 < pixels_.height_px;
          const std::uint8_t below = second ? mask_.byte_at(byte * 8, 2 * y + 1) : std::uint8_t{0};
          if ((mask_.byte_at(byte * 8, 2 * y) | below) == 0) continue;
          for (std::uint32_t x = byte * 4; x < std::min(byte * 4 + 4, to.width); ++x)
            push_texel(pixels_.data.data(), pixels_.width_px, pixels_.height_px, x, y, is_covered, to);
        }
    });
    return to;
  }

  Level push(const Level& from) const {
    Level to = half_of(from.width, from.height);
    const auto is_covered = [&](std::uint32_t u, std::uint32_t v) {
      return from.mask[std::size_t{v} * from.width + u] != 0;
    };
    parallel_for(context_, to.height, kRowsPerPiece, [&](std::size_t begin, std::size_t end) {
      for (auto y = static_cast<std::uint32_t>(begin); y < end; ++y)
        for (std::uint32_t x = 0; x < to.width; ++x)
          push_texel(from.data.data(), from.width, from.height, x, y, is_covered, to);
    });
    return to;
  }

  /// Bilinear interpolation of the coarse level at a fine texel, whose coarse rows are given.
  static void pull_texel(const Level& coarse, const std::uint8_t* near_row, const std::uint8_t* far_row,
                         std::uint32_t x, std::uint8_t* to) {
    const CoarseTexels n = coarse_texels(x, coarse.width);
    const std::uint8_t *a = near_row + std::size_t{n.near} * C, *b = near_row + std::size_t{n.far} * C;
    const std::uint8_t *c = far_row + std::size_t{n.near} * C, *d = far_row + std::size_t{n.far} * C;
    for (int k = 0; k < C; ++k)
      to[k] = static_cast<std::uint8_t>((9 * a[k] + 3 * b[k] + 3 * c[k] + d[k] + 8) >> 4);
  }

  void pull(const Level& coarse, Level& fine) const {
    parallel_for(context_, fine.height, kRowsPerPiece, [&](std::size_t begin, std::size_t end) {
      for (auto y = static_cast<std::uint32_t>(begin); y < end; ++y) {
        const CoarseTexels n = coarse_texels(y, coarse.height);
        const std::uint8_t* near_row = coarse.data.data() + std::size_t{n.near} * coarse.width * C;
        const std::uint8_t* far_row = coarse.data.data() + std::size_t{n.far} * coarse.width * C;
        for (std::uint32_t x = 0; x < fine.width; ++x) {
          const std::size_t at = std::size_t{y} * fine.width + x;
          if (fine.mask[at] == 0) pull_texel(coarse, near_row, far_row, x, fine.data.data() + at * C);
        }
      }
    });
  }

  void pull_base(const Level& coarse) {
    parallel_for(context_, pixels_.height_px, kRowsPerPiece, [&](std::size_t begin, std::size_t end) {
      for (auto y = static_cast<std::uint32_t>(begin); y < end; ++y) {
        const CoarseTexels n = coarse_texels(y, coarse.height);
        const std::uint8_t* near_row = coarse.data.data() + std::size_t{n.near} * coarse.width * C;
        const std::uint8_t* far_row = coarse.data.data() + std::size_t{n.far} * coarse.width * C;
        std::uint8_t* row = pixels_.data.data() + std::size_t{y} * pixels_.width_px * C;
        for (std::uint32_t byte = 0; byte < mask_.stride_bytes; ++byte) {
          if (mask_.byte_at(byte * 8, y) == 0xff) continue;
          for (std::uint32_t x = byte * 8; x < std::min(byte * 8 + 8, pixels_.width_px); ++x)
            if (!mask_.covered(x, y)) pull_texel(coarse, near_row, far_row, x, row + std::size_t{x} * C);
        }
      }
    });
  }

  Pixels& pixels_;
  CoverageMask mask_;
  const RunContext& context_;
};

/// The plane's channels of a decoded image: its colour, its grey, or its alpha.
Pixels channels_of(const Pixels& image, const TexturePlane& plane) {
  if (image.channels == plane.channels) return image;
  Pixels out{image.width_px, image.height_px, plane.channels, {}};
  const std::size_t texels = std::size_t{image.width_px} * image.height_px;
  out.data.resize(texels * plane.channels);
  const std::uint8_t* from = image.data.data() + (plane.role == TextureRole::kAlpha ? image.channels - 1 : 0);
  std::uint8_t* to = out.data.data();
  for (std::size_t k = 0; k < texels; ++k, from += image.channels)
    for (std::uint32_t c = 0; c < plane.channels; ++c) *to++ = from[c];
  return out;
}

/// Sets the 16 x 16 block at (x, y) to the mean of the 16 texels that start at (u, v) and go right or down.
void flatten_block(Pixels& pixels, std::uint32_t x, std::uint32_t y, std::uint32_t u, std::uint32_t v,
                   bool down) {
  for (std::uint32_t c = 0; c < pixels.channels; ++c) {
    std::uint32_t sum = 0;
    for (std::uint32_t k = 0; k < kMcu; ++k) sum += (down ? pixels.at(u, v + k) : pixels.at(u + k, v))[c];
    const auto mean = static_cast<std::uint8_t>((sum + kMcu / 2) / kMcu);
    for (std::uint32_t row = 0; row < kMcu; ++row)
      for (std::uint32_t column = 0; column < kMcu; ++column)
        pixels.data[(std::size_t{y + row} * pixels.width_px + x + column) * pixels.channels + c] = mean;
  }
}

/// Adds columns and rows until the fragments are whole. Within a 16 x 16 block that holds texels of the image
/// the last ones are repeated; blocks beyond are flat, since nobody sees them: repeating the edge there would
/// cost 3 % of the bytes of a 931 x 647 px image in fragments of 144 px.
Pixels padded(Pixels from, const TexturePlane& plane) {
  Pixels to{
      plane.columns * plane.fragment_width_px, plane.rows * plane.fragment_height_px, from.channels, {}};
  if (to.width_px == from.width_px && to.height_px == from.height_px) return from;
  const std::uint32_t block_width = (from.width_px + kMcu - 1) / kMcu * kMcu;
  const std::uint32_t block_height = (from.height_px + kMcu - 1) / kMcu * kMcu;
  const std::size_t stride = std::size_t{to.width_px} * to.channels,
                    used = std::size_t{from.width_px} * to.channels;
  to.data.resize(stride * to.height_px);
  for (std::uint32_t y = 0; y < block_height; ++y) {
    std::uint8_t* row = to.data.data() + stride * y;
    std::memcpy(row, from.at(0, std::min(y, from.height_px - 1)), used);
    for (std::size_t k = used; k < std::size_t{block_width} * to.channels; ++k) row[k] = row[k - to.channels];
  }
  for (std::uint32_t y = 0; y < block_height; y += kMcu)
    for (std::uint32_t x = block_width; x < to.width_px; x += kMcu)
      flatten_block(to, x, y, block_width - 1, y, true);
  for (std::uint32_t y = block_height; y < to.height_px; y += kMcu)
    for (std::uint32_t x = 0; x < to.width_px; x += kMcu) flatten_block(to, x, y, x, block_height - 1, false);
  return to;
}

Pixels decode_for(const Image& image, const TexturePlane& plane) {
  Pixels out = decode_image(image, is_colour(plane.role) ? FloatEncoding::kSrgb : FloatEncoding::kAsIs);
  const std::uint32_t least = plane.role == TextureRole::kAlpha ? 2 : plane.channels;
  if (out.width_px != plane.width_px || out.height_px != plane.height_px || out.channels < least)
    throw StageError("fragmentation", image.name,
                     std::to_string(plane.width_px) + " x " + std::to_string(plane.height_px) + " px, " +
                         std::to_string(least) + " channels",
                     std::to_string(out.width_px) + " x " + std::to_string(out.height_px) + " px, " +
                         std::to_string(out.channels) + " channels");
  return out;
}

/// The number of full-size planes; they stand first, and every mip follows its next finer plane's size.
std::size_t check_planes(const std::vector<TexturePlane>& planes, std::size_t images) {
  const auto fail = [](std::size_t p, const char* expected, std::uint64_t found) {
    throw StageError("fragmentation", "plane " + std::to_string(p), expected, std::to_string(found));
  };
  std::size_t full = 0;
  while (full < planes.size() && planes[full].mip == 0) ++full;
  for (std::size_t p = 0; p < planes.size(); ++p) {
    const TexturePlane& plane = planes[p];
    if (plane.image >= images) fail(p, "an image of the model", plane.image);
    if (p < full) continue;
    if (plane.mip == 0 || plane.base >= full || (plane.mip > 1 && planes[p - 1].mip + 1 != plane.mip) ||
        (plane.mip > 1 && planes[p - 1].base != plane.base))
      fail(p, "mips behind all full-size planes, by their base and size", plane.mip);
    const TexturePlane& finer = plane.mip == 1 ? planes[plane.base] : planes[p - 1];
    if (plane.width_px != (finer.width_px + 1) / 2 || plane.height_px != (finer.height_px + 1) / 2 ||
        plane.channels != finer.channels || plane.role != finer.role)
      fail(p, "half of the finer plane", plane.width_px);
  }
  return full;
}

void check_coverage(const Pixels& pixels, const std::vector<std::uint8_t>& coverage) {
  const std::size_t bytes = coverage_size_bytes(pixels.width_px, pixels.height_px);
  if (coverage.size() != bytes || bytes == 0)
    throw StageError("fragmentation", "coverage", std::to_string(bytes) + " bytes",
                     std::to_string(coverage.size()));
  if (pixels.channels != 1 && pixels.channels != 3)
    throw StageError("fragmentation", "channels", "1 or 3", std::to_string(pixels.channels));
}

void push_pull(Pixels& pixels, const std::vector<std::uint8_t>& coverage, const RunContext& context) {
  check_coverage(pixels, coverage);
  if (pixels.channels == 1)
    PushPull<1>(pixels, coverage, context).run();
  else
    PushPull<3>(pixels, coverage, context).run();
}

void flatten_where_covered(Pixels& pixels, const std::vector<std::uint8_t>& coverage, PartBlocks part,
                           const RunContext& context) {
  check_coverage(pixels, coverage);
  if (std::ranges::any_of(coverage, [](std::uint8_t bits) { return bits != 0; }))
    flatten_unseen(pixels, coverage, part, context);
}

/// A full-size plane and its mips. Each size is halved before its blocks are made flat, which would show as
/// squares in the next one.
void fill_chain(const std::vector<TexturePlane>& planes, std::size_t base, std::size_t first_mip,
                Pixels pixels, FillChoice choice, const RunContext& context, std::vector<Pixels>& out) {
  if (choice.fill == Fill::kPushPull) push_pull(pixels, planes[base].coverage, context);
  for (std::size_t p = base, next = first_mip;; p = next++) {
    const bool more = next < planes.size() && planes[next].mip > 0 && planes[next].base == base;
    Pixels half = more ? halved(pixels, planes[p].width_px, planes[p].height_px,
                                averaging_of(planes[next].role, planes[next].channels))
                       : Pixels{};
    if (choice.fill == Fill::kPushPull)
      flatten_where_covered(pixels, planes[p].coverage, choice.part, context);
    out[p] = padded(std::move(pixels), planes[p]);
    if (!more) return;
    pixels = std::move(half);
  }
}

/// Where the mips of each full-size plane begin; the number of planes where it has none.
std::vector<std::size_t> first_mips(const std::vector<TexturePlane>& planes, std::size_t full) {
  std::vector<std::size_t> out(full, planes.size());
  for (std::size_t p = full; p < planes.size(); ++p)
    if (planes[p].mip == 1) out[planes[p].base] = p;
  return out;
}

void decode_and_fill(const std::vector<TexturePlane>& planes, std::size_t full,
                     const std::vector<Image>& images, FillChoice choice, const RunContext& context,
                     std::vector<Pixels>& out) {
  const std::vector<std::size_t> mips = first_mips(planes, full);
  std::vector<std::size_t> starts;  // planes of one image stand together; each image is decoded once
  for (std::size_t p = 0; p < full; ++p)
    if (p == 0 || planes[p].image != planes[p - 1].image) starts.push_back(p);
  RunContext inner = context;
  inner.progress = nullptr;
  inner.threads = std::max(1, context.threads / static_cast<int>(std::max<std::size_t>(starts.size(), 1)));
  parallel_each(context, starts.size(), 1, [&](std::size_t s) {
    const Image& image = images[planes[starts[s]].image];
    Pixels decoded = decode_for(image, planes[starts[s]]);
    for (std::size_t p = starts[s]; p < full && planes[p].image == planes[starts[s]].image; ++p) {
      if (planes[p].role == TextureRole::kAlpha && decoded.channels < 2)
        throw StageError("fragmentation", image.name, "an alpha channel", "none");
      const bool last = p + 1 == full || planes[p + 1].image != planes[p].image;
      Pixels plane = last && decoded.channels == planes[p].channels ? std::move(decoded)
                                                                    : channels_of(decoded, planes[p]);
      fill_chain(planes, p, mips[p], std::move(plane), choice, inner, out);
    }
  });
}

}  // namespace

void fill_uncovered(Pixels& pixels, const std::vector<std::uint8_t>& coverage, const RunContext& context,
                    PartBlocks part) {
  push_pull(pixels, coverage, context);
  flatten_where_covered(pixels, coverage, part, context);
}

std::vector<Pixels> fill_planes(const Fragments& fragments, const std::vector<Image>& images, Fill fill,
                                const RunContext& context, PartBlocks part) {
  const std::vector<TexturePlane>& planes = fragments.planes;
  const std::size_t full = check_planes(planes, images.size());
  std::vector<Pixels> out(planes.size());
  decode_and_fill(planes, full, images, {fill, part}, context, out);
  return out;
}

}  // namespace texmesh
