#pragma once
#include <cstdint>
#include <vector>

#include "delivery/cpp/decide/fragment_offer.h"

namespace texmesh {

/// What may be fetched after the deadline: upgrades of fragments in order of loss saved per byte, each from
/// the rung before. `rungs` by offer, -1 = skipped. With `incremental` rungs (each continues the one below)
/// only the missing bytes count.
struct Upgrade {
  std::uint32_t offer = 0;
  std::int32_t rung = 0;
  std::uint64_t bytes = 0;
  double gain_per_byte = 0;
};
std::vector<Upgrade> upgrades_in_order(const std::vector<FragmentOffer>& offers,
                                       const std::vector<std::int32_t>& rungs, bool incremental = false);

}  // namespace texmesh
