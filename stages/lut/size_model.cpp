#include "stages/lut/size_model.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "format/base/portable_math.h"
#include "format/base/vec.h"
#include "format/rules/allocation.h"

namespace texmesh {
namespace {

// (8.8) divides by log(100 p): singular at 0.01, negative below.
constexpr double kLeastPredictor = 0.02;

/// 8 x 8 blocks of all components of an image, by the frame header (SOF0) in a table stream.
double blocks_of(std::span<const std::uint8_t> tables, std::uint32_t width_px, std::uint32_t height_px) {
  const auto across = [](std::uint32_t size, std::uint32_t unit) {
    return static_cast<double>((size + unit - 1) / unit);
  };
  for (std::size_t at = 2; at + 4 <= tables.size() && tables[at] == 0xff;) {
    const std::size_t length = std::size_t{tables[at + 2]} << 8 | tables[at + 3];
    if (tables[at + 1] != 0xc0) {
      at += 2 + length;
      continue;
    }
    constexpr std::size_t kComponents = 10;  // marker, length, bits, height, width, number: then 3 bytes each
    if (at + kComponents > tables.size()) break;
    const std::size_t count = tables[at + kComponents - 1];
    std::uint32_t widest = 1, highest = 1, blocks = 0;
    for (std::size_t c = 0; c < count && at + kComponents + 3 * c + 1 < tables.size(); ++c) {
      const std::uint32_t sampling = tables[at + kComponents + 3 * c + 1];
      widest = std::max(widest, sampling >> 4);
      highest = std::max(highest, sampling & 15);
      blocks += (sampling >> 4) * (sampling & 15);
    }
    if (count == 1) widest = highest = blocks = 1;  // a scan of one component is not interleaved
    return across(width_px, 8 * widest) * across(height_px, 8 * highest) * blocks;
  }
  return across(width_px, 8) * across(height_px, 8);
}

/// The rungs that the model is fitted on. Not those whose quantisers stand at an end of their range: steps of
/// 255 below quality 10 and of 1 above 95 do not follow the exponential, and with them the mean error of
/// scans' textures is half again as large. Nor that of a source's coefficients, whose bytes are not a
/// quality's.
std::vector<std::size_t> modelled_rungs(const PlaneLadder& ladder) {
  constexpr int kLeast = 10, kMost = 95;
  std::vector<std::size_t> all, within;
  for (std::size_t r = 0; r + (ladder.source_rung ? 1 : 0) < ladder.rungs.size(); ++r) {
    all.push_back(r);
    if (ladder.rungs[r].quality >= kLeast && ladder.rungs[r].quality <= kMost) within.push_back(r);
  }
  return within.size() > 2 ? within : all;
}

/// y = offset + slope x.
struct Line {
  double slope = 0, offset = 0, correlation = 0;
};

Line least_squares(const std::vector<double>& x, const std::vector<double>& y) {
  const auto n = static_cast<double>(x.size());
  double mean_x = 0, mean_y = 0, xx = 0, xy = 0, yy = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    mean_x += x[k] / n;
    mean_y += y[k] / n;
  }
  for (std::size_t k = 0; k < x.size(); ++k) {
    xx += (x[k] - mean_x) * (x[k] - mean_x);
    xy += (x[k] - mean_x) * (y[k] - mean_y);
    yy += (y[k] - mean_y) * (y[k] - mean_y);
  }
  const double slope = xy / xx;
  return {slope, mean_y - slope * mean_x, yy > 0 ? xy / std::sqrt(xx * yy) : 0};
}

}  // namespace

double constant_bytes(const PlaneLadder& ladder, std::uint32_t width_px, std::uint32_t height_px) {
  constexpr double kMarkers = 4, kBytesOfBlock = 0.25, kWebpHeaders = 30;
  if (ladder.codec == Codec::kWebp) return kWebpHeaders;
  if (ladder.codec == Codec::kJpegProgressive || ladder.rungs.empty()) return 0;
  return kMarkers + kBytesOfBlock * blocks_of(ladder.rungs[0].table_stream, width_px, height_px);
}

SizeModel fit_size_model(const PlaneLadder& ladder, std::uint32_t width_px, std::uint32_t height_px,
                         const PlaneTables& t, const std::vector<float>& vqp) {
  const std::vector<std::size_t> modelled = modelled_rungs(ladder);
  if (t.order.empty() || modelled.size() < 2) return {};
  const auto stored = static_cast<double>(t.order.size());
  const double constant = constant_bytes(ladder, width_px, height_px) * stored;
  std::vector<double> quality, size, log_size;
  double predictor = 0;
  for (const std::size_t r : modelled) {
    double bytes = 0;
    for (const std::uint16_t f : t.order) bytes += static_cast<double>(bytes_to_show(t, r, f));
    quality.push_back(t.rung_quality[r]);
    size.push_back(bytes);
    log_size.push_back(portable::log(std::max(bytes - constant, 1.0)));
  }
  for (const std::uint16_t f : t.order) predictor += static_cast<double>(vqp[f]) / stored;
  const Line line = least_squares(quality, log_size);
  double error = 0;
  for (std::size_t k = 0; k < size.size(); ++k)
    error += std::fabs(portable::exp(line.offset + line.slope * quality[k]) + constant - size[k]) / size[k];
  SizeModel model;
  model.a = static_cast<float>(portable::exp(line.offset));
  model.r = static_cast<float>(portable::exp(line.slope));
  model.b = static_cast<float>(line.slope / portable::log(100 * std::clamp(predictor, kLeastPredictor, 1.0)));
  model.correlation = static_cast<float>(line.correlation);
  model.error = static_cast<float>(error / static_cast<double>(size.size()));
  return model;
}

}  // namespace texmesh
