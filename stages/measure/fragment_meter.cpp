#include "stages/measure/fragment_meter.h"

#include <algorithm>
#include <utility>

#include "stages/data/coverage.h"
#include "stages/fragment_codec/decode_rung.h"

namespace texmesh {
namespace {

/// Channel `c` of `measured` of a row of texels.
template <std::size_t kChannels>
void measure_row(const std::uint8_t* texels, std::size_t count, std::size_t measured, std::size_t c,
                 std::uint8_t* to) {
  if (kChannels == 1 || measured > 1)
    for (std::size_t i = 0; i < count; ++i) to[i] = texels[kChannels * i + c];
  else
    for (std::size_t i = 0; i < count; ++i) to[i] = measured_value(texels + kChannels * i, kChannels, 1, 0);
}
void measure_row(const std::uint8_t* texels, std::size_t channels, std::size_t count, std::size_t measured,
                 std::size_t c, std::uint8_t* to) {
  const auto rows = channels == 1   ? measure_row<1>
                    : channels == 2 ? measure_row<2>
                    : channels == 3 ? measure_row<3>
                                    : measure_row<4>;
  rows(texels, count, measured, c, to);
}

bool varies(const std::vector<std::uint8_t>& values, const std::vector<std::uint8_t>& mask) {
  std::uint8_t low = 255, high = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!mask[i]) continue;
    low = std::min(low, values[i]);
    high = std::max(high, values[i]);
  }
  return low < high;
}

}  // namespace

std::size_t measured_channels(const TexturePlane& plane) {
  return is_colour(plane.role) ? 1 : plane.channels;
}

Samples rectangle_samples(const TexturePlane& plane, const Pixels& pixels, const TexelRectangle& rectangle) {
  const std::size_t measured = measured_channels(plane);
  Samples out(measured);
  for (std::size_t c = 0; c < measured; ++c) {
    out[c].resize(std::size_t{rectangle.width_px} * rectangle.height_px);
    std::uint8_t* to = out[c].data();
    for (std::uint32_t y = rectangle.top_px; y < rectangle.bottom_px(); ++y, to += rectangle.width_px)
      measure_row(pixels.at(rectangle.left_px, y), pixels.channels, rectangle.width_px, measured, c, to);
  }
  return out;
}

std::vector<std::uint8_t> coverage_samples(const TexturePlane& plane, const TexelRectangle& rectangle) {
  const CoverageMask mask(plane);
  std::vector<std::uint8_t> out(std::size_t{rectangle.width_px} * rectangle.height_px);
  for (std::uint32_t v = 0; v < rectangle.height_px && rectangle.top_px + v < plane.height_px; ++v)
    for (std::uint32_t u = 0; u < rectangle.width_px && rectangle.left_px + u < plane.width_px; ++u)
      if (mask.covered(rectangle.left_px + u, rectangle.top_px + v))
        out[std::size_t{v} * rectangle.width_px + u] = 255;
  return out;
}

Samples split_samples(const Pixels& pixels, std::size_t measured) {
  const std::size_t texels = std::size_t{pixels.width_px} * pixels.height_px;
  if (pixels.channels == 1) return {pixels.data};
  Samples out(measured, std::vector<std::uint8_t>(texels));
  for (std::size_t c = 0; c < measured; ++c)
    measure_row(pixels.data.data(), pixels.channels, texels, measured, c, out[c].data());
  return out;
}

Samples decode_samples(const PlaneLadder& ladder, std::size_t rung, std::size_t fragment,
                       std::uint64_t max_pixels, std::size_t measured) {
  if (measured > 1) return split_samples(decode_fragment(ladder, rung, fragment, max_pixels), measured);
  return {decode_fragment_luma(ladder, rung, fragment, max_pixels).data};
}

FragmentMeter::FragmentMeter(Samples source, const std::vector<std::uint8_t>& mask, std::uint32_t width,
                             std::uint32_t height) {
  double varying = 0;
  for (const std::vector<std::uint8_t>& channel : source) {
    weights_.push_back(varies(channel, mask) ? 1 : 0);
    varying += weights_.back();
  }
  for (double& weight : weights_)
    weight = varying > 0 ? weight / varying : 1 / static_cast<double>(source.size());
  meters_.reserve(source.size());
  for (std::vector<std::uint8_t>& channel : source)
    meters_.emplace_back(std::move(channel), mask, width, height);
}

Distortion FragmentMeter::against(const Samples& shown) const {
  Distortion out;
  for (std::size_t c = 0; c < meters_.size(); ++c) {
    const Distortion channel = meters_[c].against(shown[c]);
    out.mse += channel.mse / static_cast<double>(meters_.size());
    out.dssim += weights_[c] * channel.dssim;
  }
  return out;
}

}  // namespace texmesh
