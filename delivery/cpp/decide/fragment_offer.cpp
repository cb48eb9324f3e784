#include "delivery/cpp/decide/fragment_offer.h"

#include <queue>

namespace texmesh {
namespace {

/// The upgrade that saves most loss per byte, from this rung on; gain 0 when none saves any.
Upgrade best_upgrade(const FragmentOffer& f, std::uint32_t offer, std::int32_t rung, bool incremental) {
  Upgrade best{offer, rung, 0, 0};
  std::uint64_t bytes = 0;
  for (std::size_t r = static_cast<std::size_t>(rung + 1); r < f.bytes.size(); ++r) {
    bytes = incremental ? bytes + f.bytes[r] : f.bytes[r];
    const double gain =
        (f.loss[static_cast<std::size_t>(rung + 1)] - f.loss[r + 1]) / static_cast<double>(bytes);
    if (gain > best.gain_per_byte) best = {offer, static_cast<std::int32_t>(r), bytes, gain};
  }
  return best;
}

}  // namespace

std::vector<Upgrade> upgrades_in_order(const std::vector<FragmentOffer>& offers,
                                       const std::vector<std::int32_t>& rungs, bool incremental) {
  const auto later = [](const Upgrade& a, const Upgrade& b) {
    return a.gain_per_byte != b.gain_per_byte ? a.gain_per_byte < b.gain_per_byte : a.offer > b.offer;
  };
  std::priority_queue<Upgrade, std::vector<Upgrade>, decltype(later)> heap(later);
  const auto push = [&](std::uint32_t offer, std::int32_t rung) {
    const Upgrade u = best_upgrade(offers[offer], offer, rung, incremental);
    if (u.gain_per_byte > 0) heap.push(u);
  };
  for (std::uint32_t i = 0; i < offers.size(); ++i) push(i, rungs[i]);
  std::vector<Upgrade> order;
  while (!heap.empty()) {
    order.push_back(heap.top());
    heap.pop();
    push(order.back().offer, order.back().rung);
  }
  return order;
}

}  // namespace texmesh
