#include "stages/fragment_codec/coding_space.h"

#include <cmath>

#include "format/base/portable_math.h"
#include "stages/base/parallel.h"
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/jpeg/jpeg.h"
#include "stages/jpeg/jpeg_bits.h"

namespace texmesh {
namespace {

constexpr std::array<int, 3> kQualities{30, 75, 93};
constexpr std::size_t kMostWindows = 32;
constexpr double kMostTimesLeastError = 2;
constexpr int kComparedErrors = 9;
constexpr double kNoError = 1e-9;

constexpr CodingSpace kApart{true, Subsampling::k444, false};
constexpr std::array<CodingSpace, 4> kOthers{{{false, Subsampling::k444, false},
                                              {false, Subsampling::k420, false},
                                              {true, Subsampling::k444, true},
                                              {true, Subsampling::k444, false, true}}};

/// Logarithms of a space's bits and errors, by quality.
struct RateCurve {
  std::array<double, kQualities.size()> bits{}, error{};
  double least_error() const { return *std::ranges::min_element(error); }
  double most_error() const { return *std::ranges::max_element(error); }
  /// At an error between the least and the most.
  double bits_at(double wanted) const {
    for (std::size_t k = 1; k < bits.size(); ++k) {
      const double from = error[k - 1], to = error[k];
      if (wanted < to || from <= to) continue;
      const double part = std::clamp((from - wanted) / (from - to), 0.0, 1.0);
      return bits[k - 1] + part * (bits[k] - bits[k - 1]);
    }
    return bits.back();
  }
};

/// The length between two vectors' ends on the unit sphere: their angle where it is small.
double chord(const std::uint8_t* a, const std::uint8_t* b) {
  if (a[0] == b[0] && a[1] == b[1] && a[2] == b[2]) return 0;
  int aa = 0, bb = 0, ab = 0;
  for (int c = 0; c < 3; ++c) {
    const int x = 2 * a[c] - 255, y = 2 * b[c] - 255;
    aa += x * x, bb += y * y, ab += x * y;
  }
  const double cosine = ab / std::sqrt(static_cast<double>(aa) * bb);  // 255 is odd, so that no vector is 0
  return std::sqrt(std::max(0.0, 2 - 2 * cosine));
}

double squares(const std::uint8_t* a, const std::uint8_t* b) {
  double sum = 0;
  for (int c = 0; c < 3; ++c) sum += (a[c] - b[c]) * (a[c] - b[c]);
  return sum;
}

/// Summed over the covered texels of a window.
double error_of(DataKind kind, const PixelWindow& window, const Pixels& decoded) {
  double sum = 0;
  for (std::uint32_t y = 0; y < window.height_px; ++y)
    for (std::uint32_t x = 0; x < window.width_px; ++x) {
      if (!window.coverage.mask.empty() && !window.coverage.covered(x, y)) continue;
      const std::uint8_t *a = window.data + y * window.stride_bytes + std::size_t{3} * x,
                         *b = decoded.at(x, y);
      sum += kind == DataKind::kVectors ? chord(a, b) : squares(a, b);
    }
  return sum;
}

/// The windows as they are coded, which point into `made` where that is something else.
std::vector<PixelWindow> coded_windows(const CodingSpace& space, std::span<const PixelWindow> windows,
                                       std::vector<Pixels>& made) {
  std::vector<PixelWindow> out(windows.begin(), windows.end());
  if (!space.without_z) return out;
  for (const PixelWindow& window : windows) made.push_back(without_z(window));
  for (std::size_t w = 0; w < out.size(); ++w)
    out[w].data = made[w].data.data(), out[w].stride_bytes = std::size_t{3} * made[w].width_px;
  return out;
}

RateCurve measure(DataKind kind, const CodingSpace& space, std::span<const PixelWindow> windows,
                  const RunContext& context) {
  JpegKind jpeg;
  jpeg.rgb = space.apart;
  jpeg.coarse_last = space.coarse_last;
  jpeg.subsampling = space.subsampling;
  std::vector<Pixels> made;
  const std::vector<PixelWindow> coded = coded_windows(space, windows, made);
  const std::vector<double> bits = jpeg_bits(jpeg, coded, kQualities, context);
  RateCurve out;
  for (std::size_t q = 0; q < kQualities.size(); ++q) {
    jpeg.quality = kQualities[q];
    const double error = parallel_sum(context, windows.size(), 16, [&](std::size_t begin, std::size_t end) {
      JpegCoder coder(jpeg);
      double sum = 0;
      for (std::size_t w = begin; w < end; ++w) {
        const std::uint64_t area = std::uint64_t{windows[w].width_px} * windows[w].height_px;
        Pixels decoded = decode_jpeg(coder.complete_as_is(coded[w]), area);
        if (space.without_z) rebuild_z(decoded);
        sum += error_of(kind, windows[w], decoded);
      }
      return sum;
    });
    out.bits[q] = portable::log(std::max(bits[q], 1.0));
    out.error[q] = portable::log(std::max(error, kNoError));
  }
  return out;
}

/// The mean logarithm of the one's bits over the other's, at errors that both have. A large number where
/// there are none, or where the other's least error is out of reach.
double more_bits(const RateCurve& one, const RateCurve& other) {
  constexpr double kFarMore = 1e9;
  const double least = std::max(one.least_error(), other.least_error());
  const double most = std::min(one.most_error(), other.most_error());
  if (!(least < most) || one.least_error() > other.least_error() + portable::log(kMostTimesLeastError))
    return kFarMore;
  double sum = 0;
  for (int k = 0; k < kComparedErrors; ++k) {
    const double error = least + (most - least) * k / (kComparedErrors - 1);
    sum += one.bits_at(error) - other.bits_at(error);
  }
  return sum / kComparedErrors;
}

}  // namespace

CodingSpace measure_coding_space(DataKind kind, bool needs_z, std::span<const PixelWindow> sample,
                                 const RunContext& context) {
  std::vector<PixelWindow> windows;
  const std::size_t count = std::min(sample.size(), kMostWindows);
  for (std::size_t k = 0; k < count; ++k) windows.push_back(sample[k * sample.size() / count]);
  if (windows.empty()) return kApart;
  RunContext quiet = context;
  quiet.progress = nullptr;
  const RateCurve apart = measure(kind, kApart, windows, quiet);
  CodingSpace best = kApart;
  double least = 0;
  for (const CodingSpace& space : kOthers) {
    if ((space.coarse_last || space.without_z) && kind != DataKind::kVectors) continue;
    if (space.without_z && needs_z) continue;
    const double more = more_bits(measure(kind, space, windows, quiet), apart);
    if (more < least) best = space, least = more;
  }
  return best;
}

}  // namespace texmesh
