#include "delivery/cpp/decide/texture_budget.h"

#include <algorithm>

#include "format/base/portable_math.h"
#include "format/rules/rate_distortion.h"

namespace texmesh {
namespace {

constexpr int kMostCoarser = 4;  // levels below the display's that are tried
constexpr int kReweightings = 2;
constexpr double kLossUnit = 1099511627776.0;  // 2^40: losses as spend_bytes counts them
constexpr double kLeastWeight = 1e-3;          // of a group beside the others

using Levels = std::array<int, kPlaneGroups>;

/// Spends the bytes on these planes.
TextureBudget spend_on(TextureLoss& loss, std::vector<PlaneChoice> planes, const ListOptions& options,
                       std::uint64_t bytes) {
  TextureBudget out;
  out.list = fragment_list(loss, planes, options);
  std::vector<RdCurve> curves;
  for (const FragmentOffer& f : out.list.offers) {
    RdCurve curve{{0}, {}};
    curve.bytes.insert(curve.bytes.end(), f.bytes.begin(), f.bytes.end());
    for (const double l : f.loss) curve.loss.push_back(static_cast<std::uint64_t>(l * kLossUnit));
    curves.push_back(std::move(curve));
  }
  const std::vector<std::uint32_t> ways = spend_bytes(curves, bytes);
  for (std::size_t i = 0; i < ways.size(); ++i) {
    out.rungs.push_back(static_cast<std::int32_t>(ways[i]) - 1);
    out.bytes += curves[i].bytes[ways[i]];
  }
  out.parts = parts_of(out.list, out.rungs);
  out.flip = picture_flip(loss.package().quality(), options.displayed_px, options.scale, out.parts);
  out.planes = std::move(planes);
  return out;
}

/// The slopes of the predicted FLIP by the groups' losses.
PerGroup slopes(const QualityTable& table, const TextureBudget& at) {
  PerGroup slopes{1, 1, 1};
  for (std::size_t g = 0; g < kPlaneGroups; ++g)
    if (at.flip > 0)
      slopes[g] = std::max(kLeastWeight, portable::pow(std::max(at.parts.coded[g] / at.flip, 1e-9),
                                                       static_cast<double>(table.exponent) - 1));
  return slopes;
}

/// Of all groups together, then of each that the package has.
std::vector<Levels> coarser_steps(const PerGroup& surface) {
  std::vector<Levels> steps{{1, 1, 1}};
  for (std::size_t g = 0; g < kPlaneGroups; ++g) {
    Levels step{};
    step[g] = 1;
    if (surface[g] > 0) steps.push_back(step);
  }
  return steps;
}

}  // namespace

TextureBudget texture_for_budget(PackageReader& package, const ListOptions& options, std::uint64_t bytes) {
  TextureLoss loss(package, options.displayed_px);
  return texture_for_budget(loss, options, bytes);
}

TextureBudget texture_for_budget(TextureLoss& loss, const ListOptions& options, std::uint64_t bytes) {
  PackageReader& package = loss.package();
  const auto spend = [&](const Levels& levels) {
    return spend_on(loss, planes_coarser(package, options.displayed_px, levels), options, bytes);
  };
  Levels at{};
  TextureBudget best = spend(at);
  const std::vector<Levels> steps = coarser_steps(loss.weights(best.planes));
  for (bool better = true; better;) {  // downhill; every step makes something coarser
    better = false;
    const Levels from = at;
    for (const Levels& step : steps) {
      Levels to = from;
      for (std::size_t g = 0; g < kPlaneGroups; ++g) to[g] += step[g];
      if (std::ranges::max(to) > kMostCoarser) continue;
      TextureBudget now = spend(to);
      if (now.flip >= best.flip) continue;
      best = std::move(now);
      at = to;
      better = true;
    }
  }
  ListOptions weighted = options;
  for (int i = 0; i < kReweightings && package.quality().exponent > 1; ++i) {
    weighted.group_weights = slopes(package.quality(), best);
    TextureBudget now = spend_on(loss, best.planes, weighted, bytes);
    if (now.flip >= best.flip) break;
    best = std::move(now);
  }
  return best;
}

}  // namespace texmesh
