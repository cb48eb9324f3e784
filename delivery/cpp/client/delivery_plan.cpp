#include "delivery/cpp/client/delivery_plan.h"
#include "format/documents/allocation.h"
#include "format/documents/rate_distortion.h"

#include <algorithm>
#include <cmath>

namespace texmesh {
namespace {

constexpr float kSeenSsim = 0.004f;
constexpr double kBelowLowest =
    2;  // the line through the two lowest rungs goes on for so many of their steps
constexpr double kWorthwhileSsim = 1e-4;  // a coarser scale must look better, not only as good

/// SSIM of a scale with textures as good as the table knows them.
double best_ssim(const QualityTable& table, int scale) {
  double best = 0;
  for (const int quality : table.rungs) best = std::max(best, predicted_ssim(table, scale, quality));
  return best;
}

BandwidthTrace shifted(const BandwidthTrace& trace, double by_s) {
  BandwidthTrace out{{0}, {trace.at(by_s)}};
  for (std::size_t i = 0; i < trace.time_s.size(); ++i)
    if (trace.time_s[i] > by_s) {
      out.time_s.push_back(trace.time_s[i] - by_s);
      out.bytes_s.push_back(trace.bytes_s[i]);
    }
  return out;
}

NetworkOptions shifted(NetworkOptions network, double by_s) {
  network.link = shifted(network.link, by_s);
  for (MirrorModel& m : network.mirrors) {
    m.rate = shifted(m.rate, by_s);
    m.dead_from_s = std::max(0.0, m.dead_from_s - by_s);
  }
  return network;
}

void rate_textures(PackageReader& package, const FragmentList& list, DeliveryPlan& plan) {
  double weight = 0, mean = 0;
  plan.worst_quality = list.offers.empty() ? 100 : 1e9;
  for (std::size_t i = 0; i < list.offers.size(); ++i) {
    const PlaneTables& t = package.tables().planes[list.fragments[i].plane];
    const std::int32_t rung = plan.textures.rungs[i];
    const double quality = rung < 0 ? 0 : t.rung_quality[static_cast<std::size_t>(rung)];
    const double w = t.surface_fraction[list.fragments[i].fragment];
    mean += w * quality;
    weight += w;
    plan.worst_quality = std::min(plan.worst_quality, quality);
  }
  plan.mean_quality = list.offers.empty() ? 100 : weight > 0 ? mean / weight : 0;
  plan.texture_dssim =
      list.total_weight > 0 ? (plan.textures.loss + list.preview_loss) / list.total_weight : 0;
}

/// Bytes of a range that the first request has not brought yet.
std::uint64_t beyond_bootstrap(std::uint64_t offset, std::uint64_t bytes) {
  return offset >= kBootstrapBytes ? bytes : bytes - std::min(bytes, kBootstrapBytes - offset);
}

/// The table streams behind the previews, which the coarsest mesh has as its images.
std::uint64_t table_stream_bytes(const Manifest& m) {
  std::uint64_t before = m.scales.back().glb.bytes;
  for (const ByteRange& preview : m.previews) before += preview.bytes;
  return m.first_picture_bytes - std::min(before, m.first_picture_bytes);
}

/// What every delivery takes besides fragments.
void count_fixed_bytes(const Manifest& m, int scale, DeliveryPlan& plan) {
  plan.bootstrap_bytes = kBootstrapBytes;
  plan.first_picture_bytes = beyond_bootstrap(m.scales.back().glb.offset, m.scales.back().glb.bytes);
  // Index, tables, textures.json: asked for together with the first picture's end.
  plan.table_bytes = table_stream_bytes(m);
  for (const EntryRef& e : {static_cast<EntryRef>(m.index), static_cast<EntryRef>(m.tables), m.textures})
    plan.table_bytes += beyond_bootstrap(e.offset, e.bytes);
  const bool coarsest = scale == m.scales.back().scale;
  for (const ManifestScale& s : m.scales)
    if (s.scale == scale && !coarsest) plan.mesh_bytes = s.glb.bytes;
}

DeliveryPlan plan_at_scale(PackageReader& package, const DeliveryRequest& request, int scale) {
  const Manifest& m = package.manifest();
  DeliveryPlan plan;
  plan.scale = scale;
  count_fixed_bytes(m, scale, plan);
  const double manifest_s = fetched_s(request.network, 0, plan.bootstrap_bytes);
  plan.first_picture_s = fetched_s(request.network, manifest_s, plan.first_picture_bytes);
  plan.mesh_s =
      fetched_s(request.network, manifest_s, plan.first_picture_bytes + plan.mesh_bytes + plan.table_bytes);

  HtcOptions htc = request.htc;
  htc.time_limit_s = request.time_limit_s - plan.mesh_s;
  htc.rtt_s = request.network.rtt_s;
  const double moved = static_cast<double>(plan.first_picture_bytes + plan.mesh_bytes + plan.table_bytes);
  const double moved_s =
      std::isfinite(plan.mesh_s) ? plan.mesh_s - manifest_s - request.network.rtt_s : moved;
  htc.throughput.initial_bytes_s =
      request.beta0_bytes_s > 0 ? request.beta0_bytes_s : moved / std::max(1e-9, moved_s);
  ListOptions options;
  options.scale = scale;
  TextureBudget budget = texture_for_budget(
      package, request.displayed_px, options,
      static_cast<std::uint64_t>(std::max(0.0, htc.time_limit_s) * htc.throughput.initial_bytes_s));
  plan.planes = budget.planes;
  const FragmentList& list = budget.list;
  if (htc.time_limit_s <= 0) {
    plan.warnings.push_back("no time is left for textures: previews are shown");
    plan.textures.rungs.assign(list.offers.size(), -1);
    for (const FragmentOffer& f : list.offers) plan.textures.loss += f.loss[0];
    plan.textures.skipped = static_cast<std::uint32_t>(list.offers.size());
    plan.complete_s = plan.mesh_s;
  } else {
    if (htc.time_limit_s < 30 * htc.rtt_s)
      plan.warnings.push_back(
          "less than 30 round trips are left for textures: the limit may be missed by more than 2 %");
    const NetworkOptions network = without_dead_mirrors(request.network, plan.mesh_s);
    plan.textures = simulate(list.offers, htc, shifted(network, plan.mesh_s));
    plan.complete_s = plan.mesh_s + plan.textures.end_s;
  }
  plan.texture_bytes = plan.textures.bytes;
  rate_textures(package, list, plan);
  plan.texture_dssim =
      1 - (1 - plan.texture_dssim) * (1 - mip_loss(package, plan.planes, request.displayed_px));
  // Where not even the first picture comes nothing is shown.
  plan.ssim = std::isfinite(plan.first_picture_s)
                  ? predicted_ssim(package, request.displayed_px, scale, plan.texture_dssim)
                  : 0;
  return plan;
}

}  // namespace

int finer_where_seen(const QualityTable& table, int scale, double displayed_px) {
  const auto it = std::ranges::find(table.scales, scale);
  if (it == table.scales.end() || displayed_px < table.size_px) return scale;
  const auto best = [&](std::size_t i) { return table.ssim[(i + 1) * table.rungs.size() - 1]; };
  auto i = static_cast<std::size_t>(it - table.scales.begin());
  while (i > 0 && best(i - 1) - best(i) >= kSeenSsim) --i;
  return table.scales[i];
}

int wanted_scale(PackageReader& package, const DeliveryRequest& request) {
  if (request.scale >= 0) return request.scale;
  const int scale = scale_at(step_function(package.manifest().scales, request.rule), request.displayed_px);
  return request.measured && request.rule == StepRule::kDefault
             ? finer_where_seen(package.quality(), scale, request.displayed_px)
             : scale;
}

double predicted_ssim(PackageReader& package, double displayed_px, int scale, double texture_dssim) {
  const std::vector<PlaneChoice> planes = planes_for_display(package, displayed_px);
  return predicted_ssim(package.quality(), scale, equivalent_quality(package, planes, texture_dssim));
}

double predicted_ssim(const QualityTable& table, int scale, double quality) {
  if (table.scales.empty() || table.rungs.empty()) return 0;
  const auto place = [](const auto& values, double at, double least, auto&& axis) {
    std::size_t i = 0;
    while (i + 2 < values.size() && axis(values[i + 1]) < at) ++i;
    const double a = axis(values[i]), b = axis(values[std::min(i + 1, values.size() - 1)]);
    return std::pair(i, b > a ? std::clamp((at - a) / (b - a), least, 1.0) : 0.0);
  };
  const auto [s, u] = place(table.scales, scale, 0, [](int v) { return static_cast<double>(v); });
  // Textures of which little more than a preview has come are worse than the lowest rung.
  const auto [r, v] = place(table.rungs, log_quantiser(std::clamp(quality, 1.0, 100.0)), -kBelowLowest,
                            [](int q) { return log_quantiser(q); });
  const std::size_t s1 = std::min(s + 1, table.scales.size() - 1),
                    r1 = std::min(r + 1, table.rungs.size() - 1);
  const auto at = [&](std::size_t i, std::size_t j) {
    return static_cast<double>(table.ssim[i * table.rungs.size() + j]);
  };
  const double ssim =
      (1 - u) * ((1 - v) * at(s, r) + v * at(s, r1)) + u * ((1 - v) * at(s1, r) + v * at(s1, r1));
  return std::max(0.0, ssim);
}

double equivalent_quality(PackageReader& package, const std::vector<PlaneChoice>& planes,
                          double texture_dssim) {
  double heaviest = 0;
  for (const PlaneChoice& p : planes)
    heaviest = std::max(heaviest, role_weight(package.textures()[p.plane].role));
  // Mean loss of uniform rungs, by quality, over the planes that are shown.
  std::vector<std::pair<double, double>> curve;  // quality, loss
  double weight = 0;
  std::vector<double> loss;
  std::vector<int> quality;
  for (const PlaneChoice& p : planes) {
    const PlaneTables& t = package.tables().planes[p.plane];
    if (role_weight(package.textures()[p.plane].role) < heaviest) continue;
    if (quality.empty()) {
      quality.assign(t.rung_quality.begin(), t.rung_quality.end());
      loss.assign(quality.size(), 0);
    }
    if (t.rung_count() != quality.size()) continue;
    const std::vector<float> weights = surface_weights(t);
    for (const std::uint16_t f : t.order) {
      weight += weights[f];
      for (std::size_t r = 0; r < quality.size(); ++r)
        loss[r] += weights[f] * t.dssim[r * t.fragment_count() + f];
    }
  }
  if (quality.empty() || !(weight > 0)) return 100;
  for (std::size_t r = 0; r < quality.size(); ++r) curve.emplace_back(quality[r], loss[r] / weight);
  if (texture_dssim >= curve.front().second)
    return std::max(1.0, curve.front().first * curve.front().second / std::max(texture_dssim, 1e-9));
  for (std::size_t r = 1; r < curve.size(); ++r) {
    if (texture_dssim < curve[r].second) continue;
    const double span = curve[r - 1].second - curve[r].second;
    const double u = span > 0 ? (curve[r - 1].second - texture_dssim) / span : 1;
    return curve[r - 1].first + u * (curve[r].first - curve[r - 1].first);
  }
  return curve.back().first;
}

DeliveryPlan plan_delivery(PackageReader& package, const DeliveryRequest& request) {
  const Manifest& m = package.manifest();
  const int wanted = wanted_scale(package, request);
  DeliveryPlan best;
  bool first = true;
  for (const ManifestScale& s : m.scales) {
    if (s.scale < wanted || (request.scale >= 0 && s.scale != wanted)) continue;
    // A mesh that comes too late is no picture in the time.
    const bool needed = first || best.mesh_s >= request.time_limit_s;
    if (!needed && best_ssim(package.quality(), s.scale) <= best.ssim + kWorthwhileSsim) continue;
    DeliveryPlan plan = plan_at_scale(package, request, s.scale);
    if (needed || plan.ssim > best.ssim + kWorthwhileSsim) best = std::move(plan);
    first = false;
  }
  if (first) package.scale_index(wanted);  // says which there are
  if (best.scale != wanted)
    best.warnings.push_back("S_" + std::to_string(wanted) + " would suit the display, but in this time S_" +
                            std::to_string(best.scale) + " leaves more for the texture and looks better");
  return best;
}

DeliveryPlan plan_budget(PackageReader& package, const DeliveryRequest& request, std::uint64_t bytes) {
  const Manifest& m = package.manifest();
  const int wanted = wanted_scale(package, request);
  std::optional<DeliveryPlan> best;
  for (const ManifestScale& s : m.scales) {
    if (s.scale < wanted || (request.scale >= 0 && s.scale != wanted)) continue;
    DeliveryPlan plan;
    plan.scale = s.scale;
    count_fixed_bytes(m, s.scale, plan);
    const std::uint64_t fixed = plan.bytes();
    ListOptions options;
    options.scale = s.scale;
    const TextureBudget budget =
        texture_for_budget(package, request.displayed_px, options, bytes > fixed ? bytes - fixed : 0);
    plan.planes = budget.planes;
    plan.texture_bytes = budget.bytes;
    plan.textures.rungs = budget.rungs;
    plan.textures.bytes = budget.bytes;
    plan.textures.skipped = static_cast<std::uint32_t>(std::ranges::count(budget.rungs, -1));
    rate_textures(package, budget.list, plan);
    plan.texture_dssim = budget.dssim;
    plan.ssim = predicted_ssim(package, request.displayed_px, s.scale, budget.dssim);
    if (fixed > bytes)
      plan.warnings.push_back("mesh and tables alone take " + std::to_string(fixed) + " bytes");
    const bool fits = fixed <= bytes, best_fits = best && best->bytes() <= bytes;
    if (!best || (fits && !best_fits) ||
        (fits == best_fits && (fits ? plan.ssim > best->ssim : plan.bytes() < best->bytes())))
      best = std::move(plan);
  }
  if (!best) package.scale_index(wanted);  // says which there are
  return *best;
}

}  // namespace texmesh
