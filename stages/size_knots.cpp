#include "stages/size_knots.h"

#include <algorithm>
#include <memory>

#include "format/tables.h"
#include "stages/parallel.h"

namespace texmesh {
namespace {

constexpr std::size_t kWindowsPerTask = 16;  // an encoder is made for each

/// Whole qualities evenly between every two rungs.
std::vector<std::uint8_t> knot_qualities(const std::vector<int>& rungs, int step) {
  std::vector<std::uint8_t> out;
  for (std::size_t r = 0; r + 1 < rungs.size(); ++r) {
    const int width = rungs[r + 1] - rungs[r];
    const int knots = width > 1 ? std::clamp(width / step, 1, width - 1) : 0;
    for (int k = 1; k <= knots; ++k)
      out.push_back(static_cast<std::uint8_t>(rungs[r] + (2 * width * k + knots + 1) / (2 * (knots + 1))));
  }
  return out;
}

/// Bytes of the whole sample at every quality of the plane.
std::vector<double> sample_bytes(const PlaneCoding& plane, std::span<const PixelWindow> sample,
                                 const RunContext& context) {
  const std::unique_ptr<TextureCodec> codec = make_texture_codec(Codec::kJpeg, plane);
  codec->train({}, context);  // own tables take as long again for 1.0 instead of 1.1 % on a turtle
  std::vector<std::vector<std::size_t>> sizes(sample.size());
  parallel_for(context, sample.size(), kWindowsPerTask, [&](std::size_t begin, std::size_t end) {
    const std::unique_ptr<FragmentEncoder> encoder = codec->encoder();
    std::vector<std::vector<std::uint8_t>> streams(plane.qualities.size());
    for (std::size_t k = begin; k < end; ++k) {
      encoder->encode(sample[k], streams);
      for (auto& stream : streams) {
        sizes[k].push_back(stream.size());
        stream.clear();
      }
    }
  });
  std::vector<double> sum(plane.qualities.size());
  for (const auto& window : sizes)
    for (std::size_t q = 0; q < sum.size(); ++q) sum[q] += static_cast<double>(window[q]);
  return sum;
}

}  // namespace

SizeKnots measure_size_knots(const PlaneCoding& plane, std::span<const PixelWindow> sample, int step,
                             const RunContext& context) {
  SizeKnots out;
  const std::vector<std::uint8_t> knots = knot_qualities(plane.qualities, step);
  if (sample.empty() || knots.empty()) return out;
  PlaneCoding dense = plane;
  dense.qualities.insert(dense.qualities.end(), knots.begin(), knots.end());
  std::sort(dense.qualities.begin(), dense.qualities.end());
  const std::vector<double> bytes = sample_bytes(dense, sample, context);
  std::vector<std::uint8_t> rung_quality;
  std::vector<double> rung_bytes, knot_bytes;
  for (std::size_t k = 0; k < bytes.size(); ++k) {
    const int quality = dense.qualities[k];
    const bool knot = std::binary_search(knots.begin(), knots.end(), quality);
    (knot ? knot_bytes : rung_bytes).push_back(bytes[k]);
    if (!knot) rung_quality.push_back(static_cast<std::uint8_t>(quality));
  }
  out.quality = knots;
  out.position = knot_positions(rung_quality, rung_bytes, knots, knot_bytes);
  return out;
}

}  // namespace texmesh
