#include "lab/cli/studies/random_plans.h"

#include <algorithm>
#include <array>

#include "format/base/portable_math.h"
#include "format/rules/split_mix.h"

namespace texmesh {
namespace {

constexpr double kLeastDrawnBytes = 50e3, kMostDrawnBytes = 8e6;
constexpr std::array<double, 5> kHeights{256, 362, 512, 724, 1024};

/// Even in the logarithm.
double log_between(SplitMix& random, double low, double high) {
  return low * portable::exp(random.next() * portable::log(high / low));
}

double all_bytes(PackageReader& package) {
  double all = kLeastDrawnBytes;
  for (const EntryRef& e : package.index()) all += static_cast<double>(e.bytes);
  return std::min(all, kMostDrawnBytes);
}

DeliveryPlan drawn_link(PackageReader& package, SplitMix& random, DeliveryRequest& request) {
  request.network.link = BandwidthTrace::constant(log_between(random, 20e3, 2e6));
  request.network.rtt_s = log_between(random, 0.01, 0.2);
  request.time_limit_s = log_between(random, 2, 20);
  return plan_delivery(package, request);
}

DeliveryPlan drawn_mix(PackageReader& package, SplitMix& random, DeliveryRequest& request) {
  std::array<int, kPlaneGroups> levels{};
  for (int& level : levels) level = static_cast<int>(random.below(3));
  const std::vector<PlaneChoice> planes = planes_for_display(package, request.displayed_px, levels);
  ListOptions options;
  options.scale = request.scale;
  options.displayed_px = request.displayed_px;
  std::vector<std::int32_t> rungs;
  for (const FragmentOffer& f : fragment_list(package, planes, options).offers)
    rungs.push_back(static_cast<std::int32_t>(random.below(f.bytes.size() + 1)) - 1);
  return plan_of(package, request, request.scale, planes, rungs);
}

}  // namespace

std::string name_of(DrawnKind kind) {
  return kind == DrawnKind::kBudget ? "budget" : kind == DrawnKind::kLink ? "link" : "mix";
}

DeliveryPlan plan_of(PackageReader& package, const DeliveryRequest& request, int scale,
                     const std::vector<PlaneChoice>& planes, const std::vector<std::int32_t>& rungs) {
  DeliveryPlan plan;
  plan.scale = scale;
  plan.planes = planes;
  plan.textures.rungs = rungs;
  const FragmentList list = list_of(package, request, plan);
  for (std::size_t i = 0; i < rungs.size(); ++i)
    if (rungs[i] >= 0) plan.texture_bytes += list.offers[i].bytes[static_cast<std::size_t>(rungs[i])];
  const PerGroup losses = losses_of(list, rungs);
  plan.texture_flip = texture_flip(package.quality(), losses);
  plan.flip = picture_flip(package.quality(), request.displayed_px, scale, losses);
  return plan;
}

std::vector<DrawnPlan> draw_plans(PackageReader& package, int count, std::uint64_t seed) {
  SplitMix random(seed);
  const double most_bytes = all_bytes(package);
  const std::vector<ManifestScale>& scales = package.manifest().scales;
  std::vector<DrawnPlan> out;
  for (int i = 0; i < count; ++i) {
    DrawnPlan drawn{static_cast<DrawnKind>(i % 3), {}, {}};
    DeliveryRequest& request = drawn.request;
    request.displayed_px = kHeights[random.below(kHeights.size())];
    if (drawn.kind == DrawnKind::kLink) {
      drawn.plan = drawn_link(package, random, request);
    } else {
      request.scale = scales[random.below(scales.size())].scale;
      drawn.plan =
          drawn.kind == DrawnKind::kMix
              ? drawn_mix(package, random, request)
              : plan_budget(package, request,
                            static_cast<std::uint64_t>(log_between(random, kLeastDrawnBytes, most_bytes)));
    }
    out.push_back(std::move(drawn));
  }
  // Pictures of the source are shared by plans of one height.
  std::ranges::stable_sort(out, {}, [](const DrawnPlan& p) { return p.request.displayed_px; });
  return out;
}

}  // namespace texmesh
