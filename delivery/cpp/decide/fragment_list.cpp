#include "delivery/cpp/decide/fragment_list.h"

#include "format/rules/allocation.h"
#include "format/rules/size_curve.h"

namespace texmesh {
namespace {

constexpr int kGammaBisections = 20;

/// Rungs of a plane whose quality is within the limits, as near as there are any.
std::uint16_t limit_rung(const PlaneTables& t, double quality, bool low) {
  std::size_t rung = low ? t.rung_count() - 1 : 0;
  if (low)
    while (rung > 0 && t.rung_quality[rung - 1] >= quality) --rung;
  else
    while (rung + 1 < t.rung_count() && t.rung_quality[rung + 1] <= quality) ++rung;
  return static_cast<std::uint16_t>(rung);
}

/// How the fragments of a plane enter the list.
struct PlaneEntry {
  std::uint32_t plane = 0;
  PlaneGroup group = PlaneGroup::kColour;
  double group_surface = 0, group_weight = 1;
  bool thesis = false;
};

void add_fragment(const PlaneTables& t, const TextureLoss::Plane& losses, const PlaneEntry& entry,
                  std::uint16_t f, FragmentOffer o, FragmentList& list) {
  const double share = static_cast<double>(losses.weights[f]) / entry.group_surface;
  const std::size_t fragments = t.fragment_count();
  bool shows_more = false;
  for (std::size_t way = 0; way <= t.rung_count(); ++way) {
    const double shown = losses.shown[way * fragments + f];
    o.loss.push_back(entry.group_weight * share * shown);
    shows_more = shows_more || shown < losses.shown[f];
  }
  if (!shows_more && !entry.thesis) {
    list.preview_loss[static_cast<std::size_t>(entry.group)] += share * losses.shown[f];
    return;
  }
  if (!entry.thesis) o.eta *= o.loss[0] - *std::ranges::min_element(o.loss);
  list.fragments.push_back({entry.plane, f});
  list.groups.push_back(entry.group);
  list.offers.push_back(std::move(o));
}

/// The least and the highest. dQ is the tolerance on both sides of Q_i (3.3.3).
std::pair<double, double> quality_limits(const PlaneTables& t, std::size_t row, const ListOptions& options) {
  if (!options.thesis) return {options.quality_low, options.quality_high};
  const auto middle = static_cast<double>(t.quality[row]), width = static_cast<double>(t.quality_width);
  return {std::max(options.quality_low, middle - width), std::min(kHighestPrinted, middle + width)};
}

/// F-bar, the fragment nearest to Gamma, is sent at Q_i itself.
void give_middle_quality(PackageReader& package, int scale, FragmentList& list) {
  const auto nearest =
      std::ranges::min_element(list.offers, {}, [](const FragmentOffer& f) { return std::abs(f.eta); });
  if (nearest == list.offers.end()) return;
  const auto [plane, fragment] = list.fragments[static_cast<std::size_t>(nearest - list.offers.begin())];
  const PlaneTables& t = package.tables().planes[plane];
  const auto middle = static_cast<double>(t.quality[package.scale_index(scale)]);
  nearest->planned_bytes = std::max(1.0, interpolated_bytes(t, fragment, middle));
}

void add_plane(TextureLoss& loss, const PlaneEntry& entry, const ListOptions& options, FragmentList& list) {
  const TextureLoss::Plane& losses = loss.plane(entry.plane);
  const PlaneTables& t = loss.package().tables().planes[entry.plane];
  const std::size_t row = loss.package().scale_index(options.scale);
  const std::vector<float> eta = eta_of(t, row);
  const double gamma = options.gamma < 0 ? mean_eta(t, row) : options.gamma;
  const std::vector<float> quality = quality_of(t, row, gamma);
  const auto [least, highest] = quality_limits(t, row, options);
  const std::uint16_t low = limit_rung(t, least, true), high = limit_rung(t, highest, false);
  for (const std::uint16_t f : t.order) {
    FragmentOffer o;
    bool stored = true;
    for (std::size_t r = 0; r < t.rung_count(); ++r) {
      const std::uint64_t bytes = bytes_to_show(t, r, f);
      stored = stored && bytes > 0 && bytes <= 0xffffffffu;
      o.bytes.push_back(static_cast<std::uint32_t>(bytes));
    }
    if (!stored) continue;
    o.eta = options.thesis ? static_cast<double>(eta[f]) - gamma : static_cast<double>(eta[f]);
    o.planned_bytes = std::max(1.0, interpolated_bytes(t, f, quality[f]));
    o.low_rung = std::min(low, high);
    o.high_rung = high;
    add_fragment(t, losses, entry, f, std::move(o), list);
  }
}

}  // namespace

FragmentList fragment_list(PackageReader& package, const std::vector<PlaneChoice>& planes,
                           const ListOptions& options) {
  TextureLoss loss(package, options.displayed_px);
  return fragment_list(loss, planes, options);
}

FragmentList fragment_list(TextureLoss& loss, const std::vector<PlaneChoice>& planes,
                           const ListOptions& options) {
  FragmentList list;
  list.group_weights = options.group_weights;
  const PerGroup surface = loss.weights(planes);
  for (const PlaneChoice& p : planes) {
    const PlaneGroup group = loss.group_of(p.plane);
    const auto g = static_cast<std::size_t>(group);
    // A group without any surface loses nothing, whatever its rungs.
    add_plane(loss,
              {p.plane, group, surface[g] > 0 ? surface[g] : 1, options.group_weights[g], options.thesis},
              options, list);
  }
  if (options.thesis) give_middle_quality(loss.package(), options.scale, list);
  return list;
}

double gamma_for_bytes(PackageReader& package, const std::vector<PlaneChoice>& planes, int scale,
                       double bytes) {
  const std::size_t row = package.scale_index(scale);
  const auto bytes_at = [&](double gamma) {
    double sum = 0;
    for (const PlaneChoice& p : planes) {
      const PlaneTables& t = package.tables().planes[p.plane];
      const std::vector<float> quality = quality_of(t, row, gamma);
      for (const std::uint16_t f : t.order)
        sum += std::max(1.0, interpolated_bytes(t, f, static_cast<double>(quality[f])));
    }
    return sum;
  };
  double low = 0, high = 1;
  if (bytes_at(low) <= bytes) return low;
  if (bytes_at(high) >= bytes) return high;
  for (int i = 0; i < kGammaBisections; ++i) {
    const double middle = (low + high) / 2;
    (bytes_at(middle) > bytes ? low : high) = middle;
  }
  return high;
}

PerGroup losses_of(const FragmentList& list, std::span<const std::int32_t> rungs) {
  PerGroup weighted{};
  for (std::size_t i = 0; i < list.offers.size(); ++i)
    weighted[static_cast<std::size_t>(list.groups[i])] +=
        list.offers[i].loss[static_cast<std::size_t>(rungs[i] + 1)];
  PerGroup losses = list.preview_loss;
  for (std::size_t g = 0; g < kPlaneGroups; ++g) losses[g] += weighted[g] / list.group_weights[g];
  return losses;
}

}  // namespace texmesh
