#pragma once
#include <cstdint>
#include <vector>

namespace texmesh {

/// One fragment as the plan sees it.
struct FragmentOffer {
  std::vector<std::uint32_t> bytes;  // by rung, lowest first; at least one, all > 0
  std::vector<double> loss;  // [rungs + 1]: what is lost when it is skipped, then by rung; any unit, >= 0
  double eta = 0;            // feature density times weights; orders the list
  double planned_bytes = 0;  // d_g > 0: what it gets by Eq. 3.2
  std::uint16_t low_rung = 0, high_rung = 0xffff;  // limits of quality, see HtcOptions::hard_limits
};

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
