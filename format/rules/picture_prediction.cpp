#include "format/rules/picture_prediction.h"

#include <algorithm>
#include <cmath>

#include "format/base/portable_math.h"

namespace texmesh {
namespace {

constexpr double kLeastFlip = 1e-6;                    // what logarithms take for 0
constexpr double kFlattest = 0.25, kSteepest = 1;      // of the lines that go on beyond the samples
constexpr double kBehindOneSample = 0.5;               // slope of the line that goes on behind a single one
constexpr double kLeastDssim = 1e-9, kMostFlip = 1.0;  // 0 of texels is 0 of the picture
constexpr double kPreviewLevels = 3;                   // previews have 1/8 of the sides, large ones 1/16

/// Two neighbours on an axis and the way between them.
struct Between {
  std::size_t first = 0, second = 0;
  double part = 0;
};
Between between(std::size_t count, double at, auto&& axis, auto&& value) {
  Between b;
  while (b.first + 2 < count && axis(b.first + 1) < at) ++b.first;
  b.second = std::min(b.first + 1, count - 1);
  if (b.second > b.first) {
    const double from = value(axis(b.first)), to = value(axis(b.second));
    b.part = std::clamp((value(at) - from) / (to - from), 0.0, 1.0);
  }
  return b;
}

Between size_at(const QualityTable& table, double displayed_px) {
  return between(
      table.sizes_px.size(), std::max(displayed_px, 1.0),
      [&](std::size_t i) { return static_cast<double>(table.sizes_px[i]); },
      [](double px) { return portable::log(px); });
}

/// How much more a picture of a fixed number of texels loses than at the nearest height of the table.
double beyond_sizes(const QualityTable& table, double displayed_px) {
  const double px = std::max(displayed_px, 1.0);
  const double nearest =
      std::clamp(px, static_cast<double>(table.sizes_px.front()), static_cast<double>(table.sizes_px.back()));
  return px == nearest
             ? 1
             : portable::pow(GroupCurve::kLossPerDoubling, portable::log(px / nearest) / portable::kLn2);
}

double mixed(double a, double b, double part) { return (1 - part) * a + part * b; }

}  // namespace

SizesAround sizes_around(const QualityTable& table, double displayed_px) {
  if (table.sizes_px.empty()) return {1, 1};
  const Between size = size_at(table, displayed_px);
  return {static_cast<double>(table.sizes_px[size.first]), static_cast<double>(table.sizes_px[size.second])};
}

GroupCurve::GroupCurve(const QualityTable& table, PlaneGroup group, double displayed_px) {
  const auto found = std::ranges::find(table.groups, group, &GroupLosses::group);
  if (found == table.groups.end() || table.sizes_px.empty()) return;
  const Between size = size_at(table, displayed_px);
  part_ = size.part;
  for (const std::size_t i : {size.first, size.second}) {
    const TextureLosses& losses = found->sizes[i];
    Curve curve;
    double least = kLeastFlip;
    for (std::size_t k = 0; k < losses.texel_dssim.size(); ++k) {
      least = std::max(least, static_cast<double>(losses.coded.flip[k]));
      curve.log_dssim.push_back(portable::log(static_cast<double>(losses.texel_dssim[k])));
      curve.log_flip.push_back(portable::log(least));
    }
    const std::vector<float>&finer = losses.finer.flip, &coarser = losses.coarser.flip;
    curve.finest_level = finer.empty() ? 0 : 1 - static_cast<double>(finer.size());
    curve.mips.assign(finer.rbegin(), finer.rend());
    if (finer.empty()) curve.mips.push_back(0);
    curve.mips.insert(curve.mips.end(), coarser.begin(), coarser.end());
    curve.preview =
        std::min(kMostFlip, static_cast<double>(losses.preview.flip[0]) * beyond_sizes(table, displayed_px));
    curves_.push_back(std::move(curve));
  }
}

double GroupCurve::Curve::at(double texel_dssim) const {
  const double x = portable::log(texel_dssim);
  const std::size_t n = log_dssim.size();
  if (n == 1) {
    const double from = x - log_dssim[0];
    return portable::exp(log_flip[0] + (from < 0 ? kSteepest : kBehindOneSample) * from);
  }
  std::size_t i = 0;
  while (i + 2 < n && log_dssim[i + 1] < x) ++i;
  double slope = (log_flip[i + 1] - log_flip[i]) / (log_dssim[i + 1] - log_dssim[i]);
  if (x < log_dssim[0] || x > log_dssim[n - 1]) slope = std::clamp(slope, kFlattest, kSteepest);
  if (x > log_dssim[n - 1]) i = n - 1;
  return portable::exp(log_flip[i] + slope * (x - log_dssim[i]));
}

double GroupCurve::Curve::at_level(double level, double preview_level) const {
  if (mips.size() == 1) return mips[0];
  const double at = std::max(0.0, level - finest_level), last = static_cast<double>(mips.size() - 1);
  const double first = std::min(std::floor(at), last - 1);
  const auto i = static_cast<std::size_t>(first);
  const double along_line = mixed(mips[i], mips[i + 1], at - first);
  const double to_preview = preview_level - finest_level - last;
  if (at <= last || to_preview <= 0) return along_line;
  // The line alone is too low by half for a turtle's normals, the preview, which is coded coarsely, too high
  // by a half for its colours.
  const double line = mixed(mips[i], mips[i + 1], to_preview + 1);
  const double expected = std::max(line, std::sqrt(line * preview));
  return along_line + (expected - line) * (at - last) / to_preview;
}

double GroupCurve::coded(double texel_dssim, const TexelGrowth& growth) const {
  if (!(texel_dssim > kLeastDssim)) return 0;
  if (curves_.empty()) return std::min(texel_dssim, kMostFlip);
  const auto at = [&](std::size_t i) {
    const double per_level = growth[i] < 0 ? kLossPerHalving : kLossPerDoubling;
    const double grown = growth[i] == 0 ? 1 : portable::pow(per_level, growth[i]);
    return curves_[i].at(texel_dssim) * grown;
  };
  return std::min(kMostFlip, mixed(at(0), at(1), part_));
}

double GroupCurve::preview() const {
  return curves_.empty() ? kMostFlip : mixed(curves_[0].preview, curves_[1].preview, part_);
}

double GroupCurve::halved(const TexelGrowth& growth, std::uint32_t mip) const {
  if (curves_.empty()) return 0;
  const auto at = [&](std::size_t i) {
    const Curve& c = curves_[i];
    const double full_level = growth[i] - mip, preview_level = full_level + kPreviewLevels;
    const double full_size = c.at_level(full_level, preview_level) - c.mips.front();
    return std::clamp(c.at_level(growth[i], preview_level) - std::max(0.0, full_size), 0.0, kMostFlip);
  };
  return mixed(at(0), at(1), part_);
}

double geometry_flip(const QualityTable& table, double displayed_px, double scale) {
  if (table.sizes_px.empty() || table.scales.empty()) return 0;
  const Between size = size_at(table, displayed_px);
  const Between s = between(
      table.scales.size(), scale, [&](std::size_t i) { return static_cast<double>(table.scales[i]); },
      [](double v) { return v; });
  const auto at = [&](std::size_t i) {
    const std::vector<float>& flip = table.geometry[i].flip;
    return mixed(static_cast<double>(flip[s.first]), static_cast<double>(flip[s.second]), s.part);
  };
  return mixed(at(size.first), at(size.second), size.part);
}

double combined_flip(const QualityTable& table, std::span<const double> losses) {
  double sum = 0;
  for (const double loss : losses)
    if (loss > 0) sum += portable::pow(loss, static_cast<double>(table.exponent));
  return sum > 0 ? std::min(kMostFlip, portable::pow(sum, 1 / static_cast<double>(table.exponent))) : 0;
}

}  // namespace texmesh
