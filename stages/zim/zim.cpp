#include "stages/zim/zim.h"

#include <charconv>
#include <cmath>
#include <cstdlib>
#include <map>
#include <sstream>

#include "stages/base/parallel.h"

namespace texmesh {
namespace {

[[noreturn]] void fail(std::string place, std::string expected, std::string found) {
  throw StageError("zim", std::move(place), std::move(expected), std::move(found));
}

std::map<std::string, Predictor, std::less<>>& named_predictors() {
  static std::map<std::string, Predictor, std::less<>> all;
  return all;
}

struct WeightedPredictor {
  Predictor predictor;
  double weight = 0;
};
using FurtherPredictors = std::vector<WeightedPredictor>;

FurtherPredictors further_predictors(const ZimOptions& options) {
  constexpr double kMostWeight = 100;  // as the other weights' range
  const auto refuse = [&] {
    std::string known;
    for (const auto& [name, unused] : named_predictors()) known += (known.empty() ? "" : ", ") + name;
    fail("weights", "NAME=WEIGHT,.. of 0 to 100, each once; known: " + (known.empty() ? "none" : known),
         options.weights);
  };
  std::map<std::string, WeightedPredictor> out;
  std::istringstream in(options.weights);
  for (std::string part; std::getline(in, part, ',');) {
    const std::string name = part.substr(0, part.find('='));
    const auto found = named_predictors().find(name);
    double weight = -1;
    const char* const end = part.data() + part.size();
    const char* const from = name.size() == part.size() ? end : part.data() + name.size() + 1;
    const auto read = std::from_chars(from, end, weight);
    if (found == named_predictors().end() || read.ec != std::errc() || read.ptr != end ||
        !(weight >= 0 && weight <= kMostWeight) ||
        !out.try_emplace(name, WeightedPredictor{found->second, weight}).second)
      refuse();
  }
  if (options.weights.ends_with(',')) refuse();
  FurtherPredictors list;
  for (const auto& [name, predictor] : out) list.push_back(predictor);
  return list;
}

void check_plane(const TexturePlane& plane, const Pixels& pixels, std::size_t p) {
  if (pixels.width_px < plane.width_px || pixels.height_px < plane.height_px ||
      pixels.channels != plane.channels ||
      pixels.data.size() != std::size_t{pixels.width_px} * pixels.height_px * plane.channels ||
      plane.covered_texels.size() != plane.fragment_count() || plane.eta.size() < plane.fragment_count() ||
      plane.coverage.size() != coverage_size_bytes(plane.width_px, plane.height_px))
    fail("plane " + std::to_string(p), "pixels, coverage and counts that fit each other",
         std::to_string(pixels.width_px) + " x " + std::to_string(pixels.height_px));
}

void check(const Fragments& fragments, const std::vector<Pixels>& pixels) {
  if (pixels.size() != fragments.planes.size())
    fail("pixels", std::to_string(fragments.planes.size()) + " planes", std::to_string(pixels.size()));
  for (std::size_t p = 0; p < pixels.size(); ++p) check_plane(fragments.planes[p], pixels[p], p);
}

double sum_of(const ZimOptions& options, const FurtherPredictors& further) {
  double sum = options.weight_eta + options.weight_z + options.weight_i + options.weight_m;
  for (const WeightedPredictor& p : further) sum += p.weight;
  if (!(sum > 0))
    fail("weight_eta", "> 0, or weight_z, weight_i, weight_m or one of weights > 0", std::to_string(sum));
  return sum;
}

void predict_fragment(const TexelSums& sums, std::uint32_t channels, const ZimOptions& options, std::size_t f,
                      PlanePredictors& out) {
  const auto count = static_cast<double>(sums.count);
  double deviation = 0, mean = 0;
  for (std::uint32_t c = 0; c < channels; ++c) {
    const double m = static_cast<double>(sums.sum[c]) / count;
    mean += m / channels;
    deviation += std::sqrt(std::max(0.0, static_cast<double>(sums.square[c]) / count - m * m)) / channels;
  }
  const double z = std::min(1.0, deviation / 127.5), i = mean / 255;
  const double zeta =
      sums.pairs > 0 ? static_cast<double>(sums.different) / static_cast<double>(sums.pairs) : 0;
  const double m = 1 - (options.weight_intensity * (1 - i) + options.weight_complexity * zeta);
  out.z[f] = static_cast<float>(z);
  out.i[f] = static_cast<float>(i);
  out.zeta[f] = static_cast<float>(zeta);
  out.m[f] = static_cast<float>(std::clamp(m, 0.0, 1.0));
}

/// Adds `weight` times where each covered fragment's value stands between the least and largest of them; 0
/// where all are alike.
void add_spread(const TexturePlane& plane, const std::vector<float>& values, double weight,
                std::vector<double>& to) {
  double lo = 0, hi = 0;
  bool first = true;
  for (std::size_t f = 0; f < plane.fragment_count(); ++f) {
    if (plane.covered_texels[f] == 0) continue;
    const auto value = static_cast<double>(values[f]);
    lo = first ? value : std::min(lo, value);
    hi = first ? value : std::max(hi, value);
    first = false;
  }
  if (!(hi > lo)) return;
  for (std::size_t f = 0; f < plane.fragment_count(); ++f)
    if (plane.covered_texels[f] > 0) to[f] += weight * (static_cast<double>(values[f]) - lo) / (hi - lo);
}

std::vector<float> predict_further(const FragmentReader& reader, Predictor predictor,
                                   const RunContext& context) {
  const TexturePlane& plane = reader.plane();
  std::vector<float> out(plane.fragment_count());
  parallel_each(context, out.size(), 1, [&](std::size_t f) {
    if (plane.covered_texels[f] > 0) out[f] = static_cast<float>(predictor(reader, f));
    if (!std::isfinite(out[f]))
      fail("fragment " + std::to_string(f), "a finite number from each predictor", std::to_string(out[f]));
  });
  return out;
}

/// (8.4)
std::vector<float> visual_quality(const FragmentReader& reader, const PlanePredictors& predictors,
                                  const ZimOptions& options, const FurtherPredictors& further, double sum,
                                  const RunContext& context) {
  const TexturePlane& plane = reader.plane();
  std::vector<double> vqp(plane.fragment_count());
  add_spread(plane, plane.eta, options.weight_eta / sum, vqp);
  add_spread(plane, predictors.z, options.weight_z / sum, vqp);
  add_spread(plane, predictors.i, options.weight_i / sum, vqp);
  add_spread(plane, predictors.m, options.weight_m / sum, vqp);
  for (const auto& [predictor, weight] : further)
    add_spread(plane, predict_further(reader, predictor, context), weight / sum, vqp);
  std::vector<float> out;
  for (const double value : vqp) out.push_back(static_cast<float>(std::min(value, 1.0)));
  return out;
}

}  // namespace

NamedPredictor::NamedPredictor(const std::string& name, Predictor predictor) {
  const bool is_name = !name.empty() && name.size() <= 32 &&
                       name.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_") == std::string::npos;
  if (!is_name || !named_predictors().try_emplace(name, predictor).second)
    throw std::logic_error("the name of a predictor is taken or none: " + name);
}

double vqp_weight_sum(const ZimOptions& options) { return sum_of(options, further_predictors(options)); }

TexelSums FragmentReader::read(std::size_t fragment) const {
  const TexelRectangle at = fragment_rectangle(plane_, fragment);
  const std::uint32_t right = at.right_px(), bottom = at.bottom_px();
  TexelSums out;
  for (std::uint32_t y = at.top_px; y < bottom; ++y)
    for (std::uint32_t x = at.left_px; x < right; ++x) {
      if (!mask_.covered(x, y)) {
        if (mask_.byte_at(x, y) == 0) x |= 7;  // on to the next byte
        continue;
      }
      add_texel(x, y, out);
      if (x + 1 < right && y + 1 < bottom) {
        add_pair(x, y, x + 1, y, out);
        add_pair(x, y, x, y + 1, out);
      }
    }
  return out;
}

bool FragmentReader::differ(std::uint32_t x, std::uint32_t y, std::uint32_t u, std::uint32_t v) const {
  TexelSums sums;
  if (mask_.covered(x, y)) add_pair(x, y, u, v, sums);
  return sums.different > 0;
}

void FragmentReader::add_texel(std::uint32_t x, std::uint32_t y, TexelSums& out) const {
  ++out.count;
  const std::uint8_t* p = pixels_.at(x, y);
  for (std::uint32_t c = 0; c < pixels_.channels; ++c) {
    out.sum[c] += p[c];
    out.square[c] += static_cast<std::uint64_t>(p[c]) * p[c];
  }
}

void FragmentReader::add_pair(std::uint32_t x, std::uint32_t y, std::uint32_t u, std::uint32_t v,
                              TexelSums& out) const {
  if (!mask_.covered(u, v)) return;
  ++out.pairs;
  const std::uint8_t *a = pixels_.at(x, y), *b = pixels_.at(u, v);
  for (std::uint32_t c = 0; c < pixels_.channels; ++c)
    if (std::abs(a[c] - b[c]) >= difference_) {
      ++out.different;
      return;
    }
}

Predictors predict_quality(const Fragments& fragments, const std::vector<Pixels>& pixels,
                           const ZimOptions& options, const RunContext& context) {
  const FurtherPredictors further = further_predictors(options);
  const double sum = sum_of(options, further);
  check(fragments, pixels);
  Predictors out;
  out.planes.resize(fragments.planes.size());
  out.density_weight = options.weight_eta / sum;
  for (std::size_t p = 0; p < out.planes.size(); ++p) {
    const TexturePlane& plane = fragments.planes[p];
    PlanePredictors& predictors = out.planes[p];
    for (auto* values : {&predictors.z, &predictors.i, &predictors.zeta, &predictors.m})
      values->resize(plane.fragment_count());
    const FragmentReader reader(plane, pixels[p], options.difference);
    parallel_each(context, plane.fragment_count(), 1, [&](std::size_t f) {
      if (plane.covered_texels[f] == 0) return;
      const TexelSums sums = reader.read(f);
      if (sums.count != plane.covered_texels[f])
        fail("plane " + std::to_string(p) + " fragment " + std::to_string(f),
             std::to_string(plane.covered_texels[f]) + " covered texels", std::to_string(sums.count));
      predict_fragment(sums, plane.channels, options, f, predictors);
    });
    predictors.vqp = visual_quality(reader, predictors, options, further, sum, context);
    context.report(static_cast<double>(p + 1) / static_cast<double>(out.planes.size()));
  }
  return out;
}

std::vector<std::uint8_t> differing_texels(const TexturePlane& plane, const Pixels& pixels,
                                           const ZimOptions& options) {
  check_plane(plane, pixels, 0);
  const FragmentReader reader(plane, pixels, options.difference);
  std::vector<std::uint8_t> out(std::size_t{plane.width_px} * plane.height_px, 0);
  for (std::size_t f = 0; f < plane.fragment_count(); ++f) {
    const TexelRectangle at = fragment_rectangle(plane, f);
    for (std::uint32_t y = at.top_px; y + 1 < at.bottom_px(); ++y)
      for (std::uint32_t x = at.left_px; x + 1 < at.right_px(); ++x)
        out[std::size_t{y} * plane.width_px + x] =
            reader.differ(x, y, x + 1, y) || reader.differ(x, y, x, y + 1);
  }
  return out;
}

}  // namespace texmesh
