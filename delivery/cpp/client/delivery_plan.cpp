#include "delivery/cpp/client/delivery_plan.h"

#include "delivery/cpp/decide/request_groups.h"
#include "format/rules/jnd_choice.h"

namespace texmesh {
namespace {

constexpr double kWorthwhileFlip = 1e-4;  // a coarser scale must look better, not only as good
// Where a picture is so many times as far off as its bytes could show, textures are chosen again for so much
// of the bytes.
constexpr double kFarFromPlanned = 1.05, kFewerBytes = 0.7;
// A scale finer than the rule's takes the time that is left where its picture is at most so far off, and
// where its mesh leaves so much of the time to the textures.
constexpr double kFinerPays = 0.9, kFinerLeaves = 0.5;

/// Of the textures' rungs in the plan.
void rate(PackageReader& package, double displayed_px, const FragmentList& list, DeliveryPlan& plan) {
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
  const PerGroup losses = losses_of(list, plan.textures.rungs);
  plan.group_weights = list.group_weights;
  plan.texture_flip = texture_flip(package.quality(), losses);
  plan.flip = picture_flip(package.quality(), displayed_px, plan.scale, losses);
}

/// Bytes of begin .. end behind those that the first request has brought.
std::uint64_t beyond_start(std::uint64_t begin, std::uint64_t end) {
  return end - std::min(end, std::max(begin, kStartBytes));
}

/// What the first picture takes.
void count_start_bytes(const Manifest& m, DeliveryPlan& plan) {
  plan.bootstrap_bytes = std::min(kStartBytes, m.provenance.offset + m.provenance.bytes);  // the last entry
  plan.first_picture_bytes = beyond_start(first_picture(m).offset, start_bytes(m));
}

/// What every delivery of a scale takes besides fragments. Behind a proxy the coarsest GLB comes with the
/// tables: it has the materials and previews of all scales.
void count_fixed_bytes(const Manifest& m, int scale, DeliveryPlan& plan) {
  count_start_bytes(m, plan);
  // One range: index, textures.json, quality.json, table streams and tables.
  plan.table_bytes = beyond_start(m.index.offset, m.tables.offset + m.tables.bytes);
  const bool coarsest = scale == m.scales.back().scale;
  for (const ManifestScale& s : m.scales)
    if (s.scale == scale && !coarsest) plan.mesh_bytes = s.glb.bytes;
  const EntryRef& materials = m.scales.back().glb;
  if (!m.proxies.empty())
    plan.mesh_bytes += beyond_start(materials.offset, materials.offset + materials.bytes);
}

/// A proxy alone, without its times.
DeliveryPlan plan_of_proxy(const Manifest& m, double displayed_px, std::size_t proxy) {
  DeliveryPlan plan;
  plan.scale = m.scales.back().scale;
  plan.proxy = static_cast<std::uint32_t>(proxy);
  count_start_bytes(m, plan);
  plan.mesh_bytes = proxy_bytes_beyond_start(m, proxy);
  plan.mean_quality = plan.worst_quality = 100;  // nothing is left out
  plan.flip = plan.texture_flip = proxy_loss(m, proxy, displayed_px).flip;
  return plan;
}

DeliveryPlan timed_plan_of_proxy(const Manifest& m, const DeliveryRequest& request, std::size_t proxy) {
  DeliveryPlan plan = plan_of_proxy(m, request.displayed_px, proxy);
  const double manifest_s = fetched_s(request.network, 0, plan.bootstrap_bytes);
  plan.first_picture_s = fetched_s(request.network, manifest_s, plan.first_picture_bytes);
  plan.mesh_s = fetched_s(request.network, manifest_s, plan.first_picture_bytes + plan.mesh_bytes);
  plan.complete_s = plan.mesh_s;
  if (!std::isfinite(plan.mesh_s)) plan.flip = plan.texture_flip = 1;
  return plan;
}

/// The smallest proxy is shown first, whatever it takes.
bool proxy_fits(const Manifest& m, const DeliveryRequest& request, std::size_t proxy) {
  return proxy == 0 || static_cast<double>(gpu_proxy(m.proxies[proxy]).all()) <= request.memory_bytes;
}

/// What the first request has shown, bytes/s.
double first_throughput(const DeliveryPlan& plan, double manifest_s, double rtt_s) {
  return static_cast<double>(plan.bootstrap_bytes) / std::max(1e-9, manifest_s - rtt_s);
}

/// What the transfers up to the mesh have shown, bytes/s, behind a step those after it; where the first
/// request has brought it all, that one.
double shown_throughput(const DeliveryPlan& plan, double manifest_s, double rtt_s) {
  const std::uint64_t first_bytes = plan.step ? 0 : plan.first_picture_bytes;
  const double moved = static_cast<double>(first_bytes + plan.mesh_bytes + plan.table_bytes);
  if (moved == 0) return first_throughput(plan, manifest_s, rtt_s);
  const double from_s = plan.step ? plan.step_s : manifest_s;
  const double moved_s = std::isfinite(plan.mesh_s) ? plan.mesh_s - from_s - rtt_s : moved;
  return moved / std::max(1e-9, moved_s);
}

/// The larger proxy that comes before documents and mesh, where one pays.
void take_step(const Manifest& m, const DeliveryRequest& request, double manifest_s, DeliveryPlan& plan) {
  if (!request.proxy_steps || m.proxies.empty() || !std::isfinite(plan.first_picture_s)) return;
  const double rtt_s = request.network.rtt_s;
  const double bytes_s =
      request.beta0_bytes_s > 0 ? request.beta0_bytes_s : first_throughput(plan, manifest_s, rtt_s);
  const std::optional<std::size_t> step =
      proxy_on_the_way(m, request, {bytes_s, rtt_s, request.time_limit_s - plan.first_picture_s});
  if (!step) return;
  plan.step = static_cast<std::uint32_t>(*step);
  plan.step_bytes = proxy_bytes_beyond_start(m, *step);
  plan.step_s = fetched_s(request.network, plan.first_picture_s, plan.step_bytes);
}

ListOptions list_options(const DeliveryRequest& request, int scale) {
  ListOptions options;
  options.scale = scale;
  options.displayed_px = request.displayed_px;
  return options;
}

void count_memory(PackageReader& package, const DeliveryRequest& request, DeliveryPlan& plan) {
  plan.gpu = plan.proxy ? gpu_proxy(package.manifest().proxies[*plan.proxy])
                        : gpu_scale(package, plan.scale, plan.planes);
  if (static_cast<double>(plan.gpu.all()) > request.memory_bytes)
    plan.warnings.push_back("even the least takes " + std::to_string(plan.gpu.all()) + " bytes on the GPU");
}

/// What the policy spends its bytes on.
struct ChosenTextures {
  std::vector<PlaneChoice> planes;
  FragmentList list;
  double flip = 1;  // where all that was planned comes
  double gamma = -1;
};

ChosenTextures choose_textures(TextureLoss& loss, const DeliveryRequest& request, const ListOptions& options,
                               double bytes) {
  if (request.htc.policy == Policy::kThesis) {
    ThesisTextures printed = thesis_textures(loss, options, bytes);
    return {std::move(printed.planes), std::move(printed.list), 1, printed.options.gamma};
  }
  TextureBudget budget = texture_for_budget(loss, options, static_cast<std::uint64_t>(bytes),
                                            texture_memory(loss.package(), request, options.scale));
  return {std::move(budget.planes), std::move(budget.list), budget.flip, options.gamma};
}

/// What became of the list's fragments: each as if it had been asked for by itself when its group was.
SimulationResult ungrouped(const SimulationResult& grouped, const GroupedOffers& groups,
                           const FragmentList& list) {
  SimulationResult out = grouped;
  out.rungs.clear(), out.steps.clear();
  out.skipped = out.given_up = 0;
  std::vector<std::uint32_t> first;
  for (std::size_t g = 0; g < groups.counts.size(); ++g) {
    first.push_back(static_cast<std::uint32_t>(out.rungs.size()));
    out.rungs.insert(out.rungs.end(), groups.counts[g], grouped.rungs[g]);
  }
  for (HtcStep step : grouped.steps) {
    const std::uint32_t g = step.offer;
    const double of_planned = step.target_bytes / groups.offers[g].planned_bytes;
    const bool given_up = step.rung < 0 && step.bytes > 0;
    for (std::uint32_t i = first[g]; i < first[g] + groups.counts[g]; ++i) {
      const FragmentOffer& offer = list.offers[i];
      step.offer = i;
      step.position = static_cast<std::uint32_t>(out.steps.size() + 1);
      if (step.rung >= 0) step.bytes = offer.bytes[static_cast<std::size_t>(step.rung)];
      step.target_bytes = of_planned * offer.planned_bytes;
      out.steps.push_back(step);
      out.given_up += given_up;
    }
  }
  out.skipped = static_cast<std::uint32_t>(std::ranges::count(out.rungs, -1));
  return out;
}

/// How the list's fragments come in the time: in groups, as clients ask for them. The thesis asks for them
/// one by one, and so does who sets the window.
SimulationResult played(const DeliveryRequest& request, int scale, const FragmentList& list,
                        const HtcOptions& htc, const NetworkOptions& network) {
  const auto play = [&](const std::vector<FragmentOffer>& offers) {
    return request.play ? request.play(scale, offers, htc, network) : simulate(offers, htc, network);
  };
  if (htc.policy == Policy::kThesis || htc.window > 0) return play(list.offers);
  const double bytes_each = group_bytes(htc.initial_bytes_s, htc.rtt_s, htc.time_limit_s);
  const GroupedOffers groups = grouped_offers(list, bytes_each, htc.initial_bytes_s * htc.time_limit_s);
  return ungrouped(play(groups.offers), groups, list);
}

/// Textures for so many bytes, and what of them comes in the time.
DeliveryPlan with_textures(TextureLoss& loss, const DeliveryRequest& request, const HtcOptions& htc,
                           const ChosenTextures& chosen, DeliveryPlan plan) {
  plan.planes = chosen.planes;
  plan.gamma = chosen.gamma;
  const FragmentList& list = chosen.list;
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
    const NetworkOptions network =
        network_from(without_dead_mirrors(request.network, plan.mesh_s), plan.mesh_s);
    plan.textures = played(request, plan.scale, list, htc, network);
    plan.complete_s = plan.mesh_s + plan.textures.end_s;
  }
  plan.texture_bytes = plan.textures.bytes;
  rate(loss.package(), request.displayed_px, list, plan);
  return plan;
}

DeliveryPlan plan_at_scale(TextureLoss& loss, const DeliveryRequest& request, int scale) {
  const Manifest& m = loss.package().manifest();
  DeliveryPlan plan;
  plan.scale = scale;
  count_fixed_bytes(m, scale, plan);
  const double manifest_s = fetched_s(request.network, 0, plan.bootstrap_bytes);
  plan.first_picture_s = fetched_s(request.network, manifest_s, plan.first_picture_bytes);
  take_step(m, request, manifest_s, plan);
  const std::uint64_t fixed = plan.mesh_bytes + plan.table_bytes;
  plan.mesh_s = plan.step ? fetched_s(request.network, plan.step_s, fixed)
                          : fetched_s(request.network, manifest_s, plan.first_picture_bytes + fixed);

  const HtcOptions htc = request_htc(request, request.time_limit_s - plan.mesh_s,
                                     shown_throughput(plan, manifest_s, request.network.rtt_s));
  const auto choose = [&](double bytes) {
    return choose_textures(loss, request, list_options(request, scale), bytes);
  };
  const double bytes = std::max(0.0, htc.time_limit_s) * htc.initial_bytes_s;
  const ChosenTextures chosen = choose(bytes);
  const DeliveryPlan fixed_parts = plan;
  plan = with_textures(loss, request, htc, chosen, fixed_parts);
  // A transfer spends bytes less well than a plan that knows them: then fewer texels look better in the time.
  if (plan.flip > kFarFromPlanned * chosen.flip) {
    DeliveryPlan again = with_textures(loss, request, htc, choose(kFewerBytes * bytes), fixed_parts);
    if (again.flip < plan.flip) plan = std::move(again);
  }
  if (!std::isfinite(plan.first_picture_s)) plan.flip = plan.texture_flip = 1;
  return plan;
}

/// The scale of finest .. end - 1 that looks best in the time, if it looks better than `best` does: than a
/// scale that is enough for the display by much.
void take_scale(TextureLoss& loss, const DeliveryRequest& request, int finest, int end,
                std::optional<DeliveryPlan>& best) {
  bool is_enough = best.has_value();
  const double least_left_s = best ? kFinerLeaves * (request.time_limit_s - best->mesh_s) : 0;
  for (const ManifestScale& s : loss.package().manifest().scales) {
    if (s.scale < finest || s.scale >= end) continue;
    // A mesh that comes too late is no picture in the time.
    const bool needed = !best || best->mesh_s >= request.time_limit_s;
    const double most = needed      ? std::numeric_limits<double>::infinity()
                        : is_enough ? kFinerPays * best->flip
                                    : best->flip - kWorthwhileFlip;
    if (picture_flip(loss.package().quality(), request.displayed_px, s.scale, {}) >= most) continue;
    DeliveryPlan plan = plan_at_scale(loss, request, s.scale);
    const double left_s = request.time_limit_s - plan.mesh_s;
    if (!needed && (plan.flip >= most || left_s <= 0 || left_s < least_left_s)) continue;
    best = std::move(plan);
    is_enough = false;
  }
}

/// Mesh and textures. A scale finer than the one that is enough is looked at where textures are not all that
/// is off.
std::optional<DeliveryPlan> scale_in_time(TextureLoss& loss, const DeliveryRequest& request, int enough,
                                          bool only) {
  const std::vector<ManifestScale>& scales = loss.package().manifest().scales;
  std::optional<DeliveryPlan> best;
  take_scale(loss, request, enough, only ? enough + 1 : scales.back().scale + 1, best);
  const bool by_pictures = !only && request.rule == StepRule::kFlip && !(request.jnd > 0);
  if (by_pictures && best && best->scale == enough && best->mesh_s < request.time_limit_s &&
      best->texture_flip < kFinerPays * best->flip) {
    const int finest = finest_shown(scales, request.displayed_px);
    take_scale(loss, request, scale_within(scales, finest, request.memory_bytes), enough, best);
  }
  return best;
}

/// What fits, and of that what looks best; where nothing fits, what takes the fewest bytes.
void take_better(DeliveryPlan plan, std::uint64_t bytes, std::optional<DeliveryPlan>& best) {
  const bool fits = plan.bytes() <= bytes, best_fits = best && best->bytes() <= bytes;
  if (!best || (fits && !best_fits) ||
      (fits == best_fits && (fits ? plan.flip < best->flip : plan.bytes() < best->bytes())))
    best = std::move(plan);
}

/// The coarsest scale of the package that nobody with the request's JND can tell from that one.
int coarsest_alike_scale(PackageReader& package, int scale, const DeliveryRequest& request) {
  const PerceptualTable* t = package.perceptual_table();
  if (t == nullptr)
    throw InputError("", "jnd", "a package with perceptual values, in thesis.bin", "one without");
  const std::vector<float> value = request.htc.policy == Policy::kThesis
                                       ? pair_values(*t, PerceptualStatistic::kAverage, ChainRule::kSurvivor)
                                       : pair_values(*t, PerceptualStatistic::kP95);
  const auto row = static_cast<std::size_t>(std::ranges::find(t->scale, scale) - t->scale.begin());
  if (row == t->scale.size()) return scale;  // nothing is said of it
  const std::size_t most = refine_to(value, t->scale.size(), t->scale.size() - 1, row, request.jnd);
  for (const ManifestScale& s : package.manifest().scales)
    if (s.scale <= t->scale[most]) scale = std::max(scale, s.scale);
  return scale;
}

}  // namespace

int wanted_scale(PackageReader& package, const DeliveryRequest& request) {
  if (request.scale >= 0) return request.scale;
  const int wanted = scale_at(step_function(package.manifest().scales, request.rule), request.displayed_px);
  return request.jnd > 0 ? coarsest_alike_scale(package, wanted, request) : wanted;
}

DeliveryRequest as_printed(DeliveryRequest request) {
  request.rule = StepRule::kDistance;
  request.htc.policy = Policy::kThesis;
  request.htc.window = 1;
  request.htc.hard_limits = true;
  return request;
}

HtcOptions request_htc(const DeliveryRequest& request, double left_s, double shown_bytes_s) {
  HtcOptions htc = request.htc;
  htc.time_limit_s = left_s;
  htc.rtt_s = request.network.rtt_s;
  htc.sites = static_cast<int>(std::clamp<std::size_t>(request.network.mirrors.size(), 1, 64));
  htc.initial_bytes_s = request.beta0_bytes_s > 0 ? request.beta0_bytes_s : shown_bytes_s;
  return htc;
}

ThesisTextures thesis_textures(TextureLoss& loss, const ListOptions& options, double bytes) {
  ThesisTextures out{planes_for_display(loss.package(), options.displayed_px), options, {}};
  out.options.thesis = true;
  out.options.gamma = gamma_for_bytes(loss.package(), out.planes, options.scale, bytes);
  out.list = fragment_list(loss, out.planes, out.options);
  return out;
}

std::optional<std::size_t> proxy_instead(const Manifest& m, const DeliveryRequest& request) {
  if (request.scale >= 0 || request.rule != StepRule::kFlip) return std::nullopt;
  const std::optional<std::size_t> proxy = serving_proxy(m, request.displayed_px);
  return proxy && proxy_fits(m, request, *proxy) ? proxy : std::nullopt;
}

std::optional<std::size_t> proxy_on_the_way(const Manifest& m, const DeliveryRequest& request,
                                            const StepLink& link) {
  if (request.scale >= 0 || request.rule != StepRule::kFlip || request.htc.policy == Policy::kThesis)
    return std::nullopt;
  const int wanted = scale_at(step_function(m.scales, request.rule), request.displayed_px);
  const std::optional<std::size_t> step =
      proxy_step(m, scale_within(m.scales, wanted, request.memory_bytes), request.displayed_px, link);
  return step && proxy_fits(m, request, *step) ? step : std::nullopt;
}

double texture_memory(PackageReader& package, const DeliveryRequest& request, int scale) {
  return request.memory_bytes - static_cast<double>(gpu_scale(package, scale, {}).mesh);
}

FragmentList list_of(PackageReader& package, const DeliveryRequest& request, const DeliveryPlan& plan) {
  ListOptions options = list_options(request, plan.scale);
  options.group_weights = plan.group_weights;
  options.gamma = plan.gamma;
  options.thesis = plan.gamma >= 0;
  return fragment_list(package, plan.planes, options);
}

DeliveryPlan plan_delivery(PackageReader& package, const DeliveryRequest& request) {
  const Manifest& m = package.manifest();
  const bool printed = request.htc.policy == Policy::kThesis, only = request.scale >= 0 || printed;
  if (const auto proxy = printed ? std::nullopt : proxy_instead(m, request)) {
    DeliveryPlan serving = timed_plan_of_proxy(m, request, *proxy);
    if (serving.complete_s <= request.time_limit_s) return count_memory(package, request, serving), serving;
  }
  const int asked = wanted_scale(package, request);
  const int wanted = only ? asked : scale_within(m.scales, asked, request.memory_bytes);
  TextureLoss loss(package, request.displayed_px);
  std::optional<DeliveryPlan> chosen = scale_in_time(loss, request, wanted, only);
  if (!chosen) package.scale_index(wanted);  // says which there are
  DeliveryPlan& best = *chosen;
  for (std::size_t k = 0; k < m.proxies.size() && !only; ++k) {
    if (!proxy_fits(m, request, k)) continue;
    DeliveryPlan plan = timed_plan_of_proxy(m, request, k);
    const bool needed = best.mesh_s >= request.time_limit_s && plan.mesh_s < best.mesh_s;
    const bool in_time = plan.mesh_s < request.time_limit_s;
    if (needed || (in_time && plan.flip < best.flip - kWorthwhileFlip)) best = std::move(plan);
  }
  if (best.proxy)
    best.warnings.push_back("S_" + std::to_string(wanted) +
                            " would suit the display, but in this time a proxy looks better");
  else if (best.scale < wanted)
    best.warnings.push_back("S_" + std::to_string(wanted) +
                            " would do for the display, but time is left for S_" +
                            std::to_string(best.scale) + ", which looks better");
  else if (best.scale != wanted)
    best.warnings.push_back("S_" + std::to_string(wanted) + " would suit the display, but in this time S_" +
                            std::to_string(best.scale) + " leaves more for the texture and looks better");
  if (wanted != asked)
    best.warnings.push_back("S_" + std::to_string(asked) + " would take more than half of the memory");
  count_memory(package, request, best);
  return best;
}

DeliveryPlan plan_budget(PackageReader& package, const DeliveryRequest& request, std::uint64_t bytes) {
  const Manifest& m = package.manifest();
  const int wanted = wanted_scale(package, request);
  const int finest = scale_within(m.scales, 0, request.memory_bytes);
  TextureLoss loss(package, request.displayed_px);
  std::optional<DeliveryPlan> best;
  for (const ManifestScale& s : m.scales) {
    if (request.scale >= 0 ? s.scale != wanted : s.scale < finest) continue;
    DeliveryPlan plan;
    plan.scale = s.scale;
    count_fixed_bytes(m, s.scale, plan);
    const std::uint64_t fixed = plan.bytes();
    const TextureBudget budget =
        texture_for_budget(loss, list_options(request, s.scale), bytes > fixed ? bytes - fixed : 0,
                           texture_memory(package, request, s.scale));
    plan.planes = budget.planes;
    plan.texture_bytes = budget.bytes;
    plan.textures.rungs = budget.rungs;
    plan.textures.bytes = budget.bytes;
    plan.textures.skipped = static_cast<std::uint32_t>(std::ranges::count(budget.rungs, -1));
    rate(package, request.displayed_px, budget.list, plan);
    take_better(std::move(plan), bytes, best);
  }
  for (std::size_t k = 0; k < m.proxies.size() && request.scale < 0; ++k)
    if (proxy_fits(m, request, k)) take_better(plan_of_proxy(m, request.displayed_px, k), bytes, best);
  if (!best) package.scale_index(wanted);  // says which there are
  if (best->bytes() > bytes)
    best->warnings.push_back(std::to_string(bytes) + " bytes cannot be kept: the least that is shown takes " +
                             std::to_string(best->bytes()));
  count_memory(package, request, *best);
  return *best;
}

}  // namespace texmesh
