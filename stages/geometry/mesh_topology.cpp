#include "stages/geometry/mesh_topology.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace texmesh {

EdgeTable group_edges(std::span<const std::uint32_t> corner_position, std::size_t position_count) {
  // One bucket per lower end, then a sort within the bucket: several times faster than one sort over all
  // edges.
  const auto count = static_cast<std::uint32_t>(corner_position.size());
  const auto ends = [&](std::uint32_t h) {
    return std::minmax(corner_position[h], corner_position[next_corner(h)]);
  };
  std::vector<std::uint32_t> start(position_count + 1, 0);
  for (std::uint32_t h = 0; h < count; ++h) ++start[ends(h).first + 1];
  std::partial_sum(start.begin(), start.end(), start.begin());
  std::vector<std::pair<std::uint32_t, std::uint32_t>> entries(count);  // higher end, half-edge
  std::vector<std::uint32_t> at(start.begin(), start.end() - 1);
  for (std::uint32_t h = 0; h < count; ++h) {
    const auto [lo, hi] = ends(h);
    entries[at[lo]++] = {hi, h};
  }
  EdgeTable table;
  table.half_edges.reserve(count);
  table.first.reserve(count / 2 + 2);
  for (std::size_t p = 0; p < position_count; ++p) {
    std::sort(entries.begin() + start[p], entries.begin() + start[p + 1]);
    for (std::uint32_t i = start[p]; i < start[p + 1]; ++i) {
      if (i == start[p] || entries[i].first != entries[i - 1].first)
        table.first.push_back(static_cast<std::uint32_t>(table.half_edges.size()));
      table.half_edges.push_back(entries[i].second);
    }
  }
  table.first.push_back(static_cast<std::uint32_t>(table.half_edges.size()));
  return table;
}

DisjointSets::DisjointSets(std::size_t count) : parent_(count) {
  std::iota(parent_.begin(), parent_.end(), 0u);
}

std::uint32_t DisjointSets::find(std::uint32_t a) {
  while (parent_[a] != a) {
    parent_[a] = parent_[parent_[a]];
    a = parent_[a];
  }
  return a;
}

void DisjointSets::join(std::uint32_t a, std::uint32_t b) {
  a = find(a);
  b = find(b);
  if (a < b) parent_[b] = a;
  if (b < a) parent_[a] = b;
}

}  // namespace texmesh
