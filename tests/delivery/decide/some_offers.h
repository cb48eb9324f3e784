#pragma once
#include <cstdint>
#include <vector>

#include "tests/delivery/made_links.h"

namespace texmesh::testing {

/// n fragments with falling eta; rungs of 100, 200, 400 .. bytes times a size of their own.
inline std::vector<FragmentOffer> some_offers(std::size_t n, std::uint64_t seed = 1) {
  MadeNumbers random(seed);
  std::vector<FragmentOffer> offers(n);
  for (FragmentOffer& f : offers) {
    const double size = 0.5 + random.uniform();
    f.eta = random.uniform();
    f.loss.push_back(1);
    for (int r = 0; r < 8; ++r) {
      f.bytes.push_back(static_cast<std::uint32_t>(100 * size * (1 << r)));
      f.loss.push_back(0.5 / (1 << r));
    }
    f.planned_bytes = 800 * size;
  }
  return offers;
}

}  // namespace texmesh::testing
