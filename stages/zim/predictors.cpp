#include "stages/zim/predictors.h"
#include "format/base/errors.h"

#include <charconv>
#include <cstdlib>

namespace texmesh {
namespace {

[[noreturn]] void fail(std::string expected, std::string_view found) {
  throw StageError("zim", "weights", std::move(expected), std::string(found));
}

std::uint32_t grey_of(const std::uint8_t* texel, std::uint32_t channels) {
  return channels == 1 ? texel[0] : (texel[0] + 2u * texel[1] + texel[2] + 2) / 4;
}

/// Mean difference of grey between covered neighbours, east and south, as a share of white: how busy the
/// texture is without the threshold that zeta has.
double mean_gradient(const PredictorInput& in) {
  std::uint64_t sum = 0, pairs = 0;
  const std::uint32_t channels = in.pixels.channels;
  for (std::uint32_t y = in.top(); y < in.bottom(); ++y)
    for (std::uint32_t x = in.left(); x < in.right(); ++x) {
      if (!in.covered(x, y)) continue;
      const auto here = static_cast<int>(grey_of(in.pixels.at(x, y), channels));
      const auto add = [&](std::uint32_t u, std::uint32_t v) {
        if (u >= in.right() || v >= in.bottom() || !in.covered(u, v)) return;
        sum += static_cast<std::uint64_t>(
            std::abs(static_cast<int>(grey_of(in.pixels.at(u, v), channels)) - here));
        ++pairs;
      };
      add(x + 1, y);
      add(x, y + 1);
    }
  return pairs > 0 ? static_cast<double>(sum) / (255.0 * static_cast<double>(pairs)) : 0;
}

double covered_share(const PredictorInput& in) {
  return in.plane.covered_texels[in.fragment] /
         (static_cast<double>(in.plane.fragment_width_px) * in.plane.fragment_height_px);
}

double number_of(std::string_view text, std::string_view item) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(value >= 0 && value <= 100))
    fail("NAME=WEIGHT with a weight of 0 to 100", item);
  return value;
}

std::string_view trimmed(std::string_view text) {
  const auto begin = text.find_first_not_of(' ');
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(' ') - begin + 1);
}

}  // namespace

PredictorRegistry PredictorRegistry::standard() {
  PredictorRegistry r;
  r.add({"eta", "feature density (3.1) at scale 0",
         [](const PredictorInput& in) { return static_cast<double>(in.plane.eta[in.fragment]); }});
  r.add({"z", "Z, the colours' deviation (8.1)", [](const PredictorInput& in) { return in.z; }});
  r.add({"i", "I, the intensity (8.2)", [](const PredictorInput& in) { return in.i; }});
  r.add({"m", "M, the masking (8.3)", [](const PredictorInput& in) { return in.m; }});
  r.add({"zeta", "share of neighbours that differ", [](const PredictorInput& in) { return in.zeta; }});
  r.add({"area", "share of the fragment that is covered", covered_share});
  r.add({"surface", "share of the object's surface", [](const PredictorInput& in) {
           return static_cast<double>(in.plane.surface_fraction[in.fragment]);
         }});
  r.add({"gradient", "mean difference of neighbours", mean_gradient});
  return r;
}

void PredictorRegistry::add(Predictor predictor) {
  const bool plain =
      !predictor.name.empty() && std::all_of(predictor.name.begin(), predictor.name.end(), [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_';
      });
  if (!plain || !predictor.value || find(predictor.name))
    fail("a predictor of a new name made of a-z, 0-9 and _", predictor.name);
  predictors_.push_back(std::move(predictor));
}

const Predictor* PredictorRegistry::find(std::string_view name) const {
  for (const Predictor& p : predictors_)
    if (p.name == name) return &p;
  return nullptr;
}

std::string PredictorRegistry::names() const {
  std::string out;
  for (const Predictor& p : predictors_) out += (out.empty() ? "" : ", ") + p.name;
  return out;
}

std::vector<WeightedPredictor> parse_weights(const PredictorRegistry& registry, std::string_view text) {
  std::vector<WeightedPredictor> out;
  std::vector<const Predictor*> seen;
  double sum = 0;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string_view item = trimmed(text.substr(begin, end - begin));
    begin = end + 1;
    const std::size_t equal = std::min(item.find('='), item.size());
    const Predictor* predictor = registry.find(trimmed(item.substr(0, equal)));
    if (!predictor || equal == item.size()) fail("NAME=WEIGHT, NAME one of " + registry.names(), item);
    if (std::count(seen.begin(), seen.end(), predictor)) fail("each predictor once", item);
    seen.push_back(predictor);
    const double weight = number_of(trimmed(item.substr(equal + 1)), item);
    sum += weight;
    if (weight > 0) out.push_back({predictor, weight});
  }
  if (!(sum > 0)) fail("at least one weight above 0", text);
  for (WeightedPredictor& p : out) p.weight /= sum;
  return out;
}

}  // namespace texmesh
