#include "lab/transfer/several_objects.h"

namespace texmesh {
namespace {

BandwidthTrace part_of(BandwidthTrace trace, double share) {
  for (double& rate : trace.bytes_s) rate *= share;
  return trace;
}

DeliveryRequest request_for(const DeliveryRequest& page, const PageObject& object, double share) {
  DeliveryRequest r = page;
  r.displayed_px = object.displayed_px;
  r.scale = object.scale;
  r.proxy_steps = false;  // the link is shared with the others' first pictures
  r.memory_bytes = page.memory_bytes * share;
  r.beta0_bytes_s = page.beta0_bytes_s * share;
  r.network.link = part_of(r.network.link, share);
  for (MirrorModel& m : r.network.mirrors) m.rate = part_of(m.rate, share);
  return r;
}

/// Nothing but what the first requests bring.
void keep_first_picture(const PageObject& object, const DeliveryRequest& request, DeliveryPlan& p) {
  PackageReader& package = *object.package;
  const Manifest& m = package.manifest();
  p.scale = m.scales.back().scale;
  p.mesh_bytes = p.table_bytes = p.texture_bytes = 0;
  p.textures = {};
  if (!m.proxies.empty()) {
    p.proxy = 0;
    p.flip = p.texture_flip = proxy_loss(m, 0, object.displayed_px).flip;
    return;
  }
  p.proxy.reset();
  p.planes = full_size(package);
  const FragmentList list = list_of(package, request, p);
  const PerGroup losses = losses_of(list, std::vector<std::int32_t>(list.offers.size(), -1));
  p.texture_flip = texture_flip(package.quality(), losses);
  p.flip = picture_flip(package.quality(), object.displayed_px, p.scale, losses);
}

/// The fragments of all objects in one list.
struct PageList {
  std::vector<FragmentList> lists;    // of each object; empty where a proxy is shown
  std::vector<FragmentOffer> offers;  // one list behind the other, losses weighted
};

/// How much the object's FLIP grows with what each group loses, where its own plan would leave it: losses of
/// different objects are compared by that.
PerGroup slopes(PackageReader& package, const PageObject& object, const FragmentList& list,
                const DeliveryPlan& plan) {
  constexpr double kStep = 0.01;
  const PerGroup losses = losses_of(list, plan.textures.rungs);
  const auto flip = [&](const PerGroup& l) {
    return picture_flip(package.quality(), object.displayed_px, plan.scale, l);
  };
  PerGroup slope{};
  for (std::size_t g = 0; g < kPlaneGroups; ++g) {
    PerGroup more = losses;
    const double step = std::max(kStep * losses[g], 1e-5);
    more[g] += step;
    slope[g] = std::max((flip(more) - flip(losses)) / step, 1e-6);
  }
  return slope;
}

PageList page_list(const std::vector<PageObject>& objects, const DeliveryRequest& request,
                   const std::vector<double>& share, const PagePlan& plan) {
  PageList page;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    page.lists.emplace_back();
    if (plan.objects[i].proxy || plan.first_picture_only[i]) continue;
    page.lists[i] = list_of(*objects[i].package, request_for(request, objects[i], share[i]), plan.objects[i]);
    const FragmentList& list = page.lists[i];
    const PerGroup slope = slopes(*objects[i].package, objects[i], list, plan.objects[i]);
    for (std::size_t k = 0; k < list.offers.size(); ++k) {
      const auto group = static_cast<std::size_t>(list.groups[k]);
      const double weight = share[i] * slope[group] / list.group_weights[group];
      FragmentOffer offer = list.offers[k];
      for (double& loss : offer.loss) loss *= weight;
      offer.eta *= weight;
      page.offers.push_back(std::move(offer));
    }
  }
  return page;
}

void fetch_fixed_parts(const DeliveryRequest& request, PagePlan& plan) {
  std::uint64_t start = 0, pictures = 0, meshes = 0;
  for (const DeliveryPlan& p : plan.objects) {
    start += p.bootstrap_bytes;
    pictures += p.first_picture_bytes;
    meshes += p.mesh_bytes + p.table_bytes;
  }
  const double manifests_s = fetched_s(request.network, 0, start);
  plan.first_pictures_s = pictures > 0 ? fetched_s(request.network, manifests_s, pictures) : manifests_s;
  plan.meshes_s =
      pictures + meshes > 0 ? fetched_s(request.network, manifests_s, pictures + meshes) : manifests_s;
}

/// Bytes per second that the parts before the textures have shown.
double shown_bytes_s(const DeliveryRequest& request, const PagePlan& plan) {
  double bytes = 0;
  for (const DeliveryPlan& p : plan.objects)
    bytes += static_cast<double>(p.bootstrap_bytes + p.first_picture_bytes + p.mesh_bytes + p.table_bytes);
  return bytes / std::max(1e-9, plan.meshes_s - 2 * request.network.rtt_s);
}

void fetch_textures(const DeliveryRequest& request, PageList& page, PagePlan& plan) {
  const double left_s = request.time_limit_s - plan.meshes_s;
  if (left_s <= 0 || page.offers.empty()) {
    plan.textures.rungs.assign(page.offers.size(), -1);
    plan.textures.skipped = static_cast<std::uint32_t>(page.offers.size());
    plan.textures.time_limit_s = left_s;
    plan.complete_s = plan.meshes_s;
    return;
  }
  const HtcOptions htc = request_htc(request, left_s, shown_bytes_s(request, plan));
  const NetworkOptions network = without_dead_mirrors(request.network, plan.meshes_s);
  plan.textures = simulate(std::move(page.offers), htc, network_from(network, plan.meshes_s));
  plan.complete_s = plan.meshes_s + plan.textures.end_s;
}

/// Gives the objects their rungs, and says what they look like.
void predict_objects(const std::vector<PageObject>& objects, const PageList& page, PagePlan& plan) {
  std::size_t at = 0;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    DeliveryPlan& p = plan.objects[i];
    const bool picture_only = plan.first_picture_only[i];
    p.first_picture_s = plan.first_pictures_s;
    p.mesh_s = picture_only ? plan.first_pictures_s : plan.meshes_s;
    p.complete_s = picture_only || p.proxy ? p.mesh_s : plan.complete_s;
    if (picture_only || p.proxy) continue;
    const std::size_t count = page.lists[i].fragments.size();
    const auto first = plan.textures.rungs.begin() + static_cast<std::ptrdiff_t>(at);
    p.textures.rungs.assign(first, first + static_cast<std::ptrdiff_t>(count));
    at += count;
    p.textures.steps.clear();
    p.texture_bytes = 0;
    for (std::size_t k = 0; k < count; ++k)
      if (p.textures.rungs[k] >= 0)
        p.texture_bytes += page.lists[i].offers[k].bytes[static_cast<std::size_t>(p.textures.rungs[k])];
    p.textures.bytes = p.texture_bytes;
    p.textures.skipped = static_cast<std::uint32_t>(std::ranges::count(p.textures.rungs, -1));
    const PerGroup losses = losses_of(page.lists[i], p.textures.rungs);
    PackageReader& package = *objects[i].package;
    p.texture_flip = texture_flip(package.quality(), losses);
    p.flip = std::isfinite(plan.first_pictures_s)
                 ? picture_flip(package.quality(), objects[i].displayed_px, p.scale, losses)
                 : 1;
  }
}

}  // namespace

PagePlan plan_page(const std::vector<PageObject>& objects, const DeliveryRequest& request) {
  if (objects.empty()) throw std::invalid_argument("plan_page: no object");
  double area = 0;
  for (const PageObject& o : objects) area += o.displayed_px * o.displayed_px;
  std::vector<double> share;
  for (const PageObject& o : objects) share.push_back(o.displayed_px * o.displayed_px / area);
  PagePlan plan;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const DeliveryRequest mine = request_for(request, objects[i], share[i]);
    plan.objects.push_back(plan_delivery(*objects[i].package, mine));
    plan.first_picture_only.push_back(!(plan.objects[i].mesh_s < request.time_limit_s));
    if (plan.first_picture_only[i]) keep_first_picture(objects[i], mine, plan.objects[i]);
    plan.alone_flip.push_back(plan.objects[i].flip);
    plan.alone_mean_flip += share[i] * plan.objects[i].flip;
  }
  fetch_fixed_parts(request, plan);
  PageList page = page_list(objects, request, share, plan);
  fetch_textures(request, page, plan);
  predict_objects(objects, page, plan);
  for (std::size_t i = 0; i < objects.size(); ++i) plan.flip += share[i] * plan.objects[i].flip;
  return plan;
}

}  // namespace texmesh
