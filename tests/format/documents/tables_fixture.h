#pragma once
#include <vector>

#include "format/documents/tables.h"

namespace texmesh::testing {

/// Tables of a plane that follow every rule, of so many scales; with more than one fragment the last one is
/// not stored.
inline PlaneTables make_tables(std::uint32_t columns, std::uint32_t rows, std::uint32_t rungs,
                               std::uint32_t scales) {
  PlaneTables t;
  t.columns = columns;
  t.rows = rows;
  const std::size_t fragments = t.fragment_count(), stored = fragments > 1 ? fragments - 1 : 1;
  std::uint32_t state = 12345;
  const auto random = [&state] { return (state = state * 1664525u + 1013904223u) >> 8; };  // 24 bits
  const auto fraction = [&] { return static_cast<float>(random()) * 0x1p-24f; };
  for (std::uint32_t r = 0; r < rungs; ++r) {
    t.rung_quality.push_back(static_cast<std::uint8_t>(5 + 90 * r / rungs));
    t.table_bytes.push_back(500 + r);
    for (std::size_t f = 0; f < fragments; ++f) {
      t.size_bytes.push_back(f < stored ? 600 + 100 * r + random() % 50 : 0);
      t.digest.push_back(f < stored ? std::uint64_t{random()} << 40 | random() : 0);
      t.mse.push_back(f < stored ? 1000 * fraction() : 0);
      t.dssim.push_back(f < stored ? fraction() : 0);
    }
  }
  for (std::size_t f = 0; f < fragments; ++f) {
    t.covered_texels.push_back(f < stored ? random() % 65536 + 1 : 0);
    t.surface_fraction.push_back(f < stored ? 1 / static_cast<float>(stored) : 0);
    t.skip_dssim.push_back(f < stored ? 0.5f + fraction() : 0);
    if (f < stored) t.order.push_back(static_cast<std::uint16_t>(stored - 1 - f));
  }
  if (rungs > 1 && rungs <= 30) {  // between the first two, which lie apart
    t.knot_quality = {static_cast<std::uint8_t>(t.rung_quality[0] + 1),
                      static_cast<std::uint8_t>(t.rung_quality[0] + 2)};
    t.knot_position = {0.25f, 0.625f};
  }
  for (std::uint32_t k = 0; k < scales; ++k) {
    for (std::size_t f = 0; f < fragments; ++f) t.features.push_back(f < stored ? random() % 3000 : 0);
    t.quality.push_back(80 - 40 * static_cast<float>(k) / static_cast<float>(scales));
  }
  return t;
}

}  // namespace texmesh::testing
