#include "stages/ladder/size_knots.h"

#include <algorithm>

#include "format/rules/size_curve.h"
#include "stages/jpeg/jpeg_bits.h"

namespace texmesh {

SizeKnots measure_size_knots(const PlaneCoding& plane, std::span<const PixelWindow> sample,
                             const RunContext& context) {
  if (sample.empty() || plane.qualities.size() < 2) return {};
  std::vector<int> qualities;
  for (int q = plane.qualities.front(); q <= plane.qualities.back(); ++q) qualities.push_back(q);
  JpegKind kind;
  kind.channels = plane.channels;
  kind.subsampling = plane.subsampling;
  std::vector<double> bits(101);
  std::ranges::copy(jpeg_bits(kind, sample, qualities, context), bits.begin() + qualities.front());
  if (qualities.back() == kFinestQuality && plane.channels == 3) {
    kind.rgb = true;
    bits.back() = jpeg_bits(kind, sample, std::span(&kFinestQuality, 1), context).front();
  }
  return size_knots(plane.qualities, bits);
}

SizeKnots size_knots(const std::vector<int>& rungs, const std::vector<double>& bits) {
  SizeKnots out;
  if (bits.empty() || rungs.size() < 2) return out;
  std::vector<std::uint8_t> rung_quality;
  std::vector<double> rung_bits, knot_bits;
  for (int q = rungs.front(); q <= rungs.back(); ++q) {
    const bool rung = q == rungs[rung_quality.size()];
    (rung ? rung_quality : out.quality).push_back(static_cast<std::uint8_t>(q));
    (rung ? rung_bits : knot_bits).push_back(bits[static_cast<std::size_t>(q)]);
  }
  out.position = knot_positions(rung_quality, rung_bits, out.quality, knot_bits);
  return out;
}

}  // namespace texmesh
