#include "stages/ladder/size_knots.h"

#include "format/rules/size_curve.h"
#include "stages/jpeg/jpeg_bits.h"

namespace texmesh {

SizeKnots measure_size_knots(const PlaneCoding& plane, std::span<const PixelWindow> sample,
                             const RunContext& context) {
  SizeKnots out;
  if (sample.empty() || plane.qualities.size() < 2) return out;
  std::vector<int> qualities;
  for (int q = plane.qualities.front(); q <= plane.qualities.back(); ++q) qualities.push_back(q);
  JpegKind kind;
  kind.channels = plane.channels;
  kind.subsampling = plane.subsampling;
  const std::vector<double> bits = jpeg_bits(kind, sample, qualities, context);
  std::vector<std::uint8_t> rung_quality;
  std::vector<double> rung_bits, knot_bits;
  for (std::size_t k = 0; k < bits.size(); ++k) {
    const bool rung = qualities[k] == plane.qualities[rung_quality.size()];
    (rung ? rung_quality : out.quality).push_back(static_cast<std::uint8_t>(qualities[k]));
    (rung ? rung_bits : knot_bits).push_back(bits[k]);
  }
  out.position = knot_positions(rung_quality, rung_bits, out.quality, knot_bits);
  return out;
}

}  // namespace texmesh
