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

}  // namespace texmesh
