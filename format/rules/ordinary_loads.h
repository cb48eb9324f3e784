#pragma once
#include <cstddef>
#include <vector>

namespace texmesh {

/// Somebody loads an object.
struct OrdinaryLoad {
  double bytes_s = 0;       // of the link: 2 to 50 Mbit/s
  double displayed_px = 0;  // height of the object: 200 to 2,000
  double time_limit_s = 0;  // 1 to 10
};

/// The loads that a writer chooses rungs for. Each number is drawn from a logarithmic scale, the three of
/// them independently; the same ones on every machine. Fewer loads are the first ones of more.
std::vector<OrdinaryLoad> ordinary_loads(std::size_t count = 1000);

}  // namespace texmesh
