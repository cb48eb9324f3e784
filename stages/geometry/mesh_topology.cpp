#include "stages/geometry/mesh_topology.h"

#include <bit>
#include <cstring>
#include <numeric>
#include <utility>

#include "format/base/buckets.h"

namespace texmesh {
namespace {

bool finite(Vec3f p) { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }

std::vector<std::uint32_t> weld_equal(const std::vector<Vec3f>& positions) {
  struct Key {
    std::uint64_t xy;
    std::uint32_t z, index;
  };
  const auto bits = [](float x) { return std::bit_cast<std::uint32_t>(x + 0.0f); };  // + 0 turns -0 into +0
  std::vector<Key> keys;
  keys.reserve(positions.size());
  for (std::size_t i = 0; i < positions.size(); ++i)
    if (const Vec3f p = positions[i]; finite(p))
      keys.push_back({std::uint64_t{bits(p.x)} << 32 | bits(p.y), bits(p.z), static_cast<std::uint32_t>(i)});
  std::sort(keys.begin(), keys.end(), [](const Key& a, const Key& b) {
    if (a.xy != b.xy) return a.xy < b.xy;
    return a.z != b.z ? a.z < b.z : a.index < b.index;
  });
  std::vector<std::uint32_t> weld(positions.size(), kNoIndex);
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const bool first = i == 0 || keys[i].xy != keys[i - 1].xy || keys[i].z != keys[i - 1].z;
    weld[keys[i].index] = first ? keys[i].index : weld[keys[i - 1].index];
  }
  return weld;
}

/// Positions that were welded with one that is now welded itself go with it. Lower indices are right already.
void follow(std::vector<std::uint32_t>& weld) {
  for (std::uint32_t& w : weld)
    if (w != kNoIndex) w = weld[w];
}

/// Points in cells of a side: all that lie within a side's length of a point in every coordinate stand in the
/// 27 cells around it. Points are named by their number in `points`, and kept one by one.
class WeldGrid {
 public:
  using Cell = std::array<std::int64_t, 3>;
  WeldGrid(std::vector<Vec3f> points, double side) : points_(std::move(points)), side_(side) {
    for (std::uint32_t i = 0; i < points_.size(); ++i) cells_.push_back(cell_of(i));
    std::sort(cells_.begin(), cells_.end());
    cells_.erase(std::unique(cells_.begin(), cells_.end()), cells_.end());
    head_.assign(cells_.size(), kNoIndex);
    next_.assign(points_.size(), kNoIndex);
  }

  /// The lowest kept point j in the cells around point i with near(j); looks at kMostLooks of a row of three
  /// cells at most, since strangers' points may all be in one.
  template <class Near>
  std::uint32_t find(std::uint32_t i, const Near& near) const {
    const Cell at = cell_of(i);
    std::uint32_t best = kNoIndex;
    for (std::int64_t dx = -1; dx <= 1; ++dx)
      for (std::int64_t dy = -1; dy <= 1; ++dy)
        best = std::min(best, find_in_row({at[0] + dx, at[1] + dy, at[2] - 1}, near));
    return best;
  }

  void keep(std::uint32_t i) {
    const auto c =
        static_cast<std::size_t>(std::lower_bound(cells_.begin(), cells_.end(), cell_of(i)) - cells_.begin());
    next_[i] = head_[c];
    head_[c] = i;
  }

 private:
  static constexpr int kMostLooks = 1000;

  Cell cell_of(std::uint32_t i) const {
    const auto index = [&](float x) { return static_cast<std::int64_t>(std::floor(x / side_)); };
    return {index(points_[i].x), index(points_[i].y), index(points_[i].z)};
  }

  template <class Near>
  std::uint32_t find_in_row(Cell first, const Near& near) const {
    std::uint32_t best = kNoIndex;
    int looks = 0;
    auto c = static_cast<std::size_t>(std::lower_bound(cells_.begin(), cells_.end(), first) - cells_.begin());
    for (; c < cells_.size() && cells_[c] <= Cell{first[0], first[1], first[2] + 2}; ++c)
      for (std::uint32_t j = head_[c]; j != kNoIndex && looks < kMostLooks; j = next_[j], ++looks)
        if (near(j)) best = std::min(best, j);
    return best;
  }

  const std::vector<Vec3f> points_;
  const double side_;
  std::vector<Cell> cells_;
  std::vector<std::uint32_t> head_, next_;
};

/// All attributes of a wedge, compared as bits.
struct Attributes {
  std::array<float, 15> values{};
  Attributes(const Mesh& m, std::uint32_t w) {
    if (!m.uv0.empty()) std::memcpy(&values[0], &m.uv0[w], sizeof(Vec2f));
    if (!m.uv1.empty()) std::memcpy(&values[2], &m.uv1[w], sizeof(Vec2f));
    if (!m.normals.empty()) std::memcpy(&values[4], &m.normals[w], sizeof(Vec3f));
    if (!m.colours.empty()) std::memcpy(&values[7], &m.colours[w], sizeof(Vec4f));
    if (!m.tangents.empty()) std::memcpy(&values[11], &m.tangents[w], sizeof(Vec4f));
  }
  int compare(const Attributes& other) const {
    return std::memcmp(values.data(), other.values.data(), sizeof values);
  }
};

}  // namespace

EdgeTable group_edges(std::span<const std::uint32_t> corner_position, std::size_t position_count) {
  // One bucket per lower end, then a sort within the bucket: several times faster than one sort over all
  // edges.
  const auto count = static_cast<std::uint32_t>(corner_position.size());
  using Entry = std::pair<std::uint32_t, std::uint32_t>;  // higher end, half-edge
  Buckets<Entry> entries = in_buckets<Entry>(position_count, [&](auto&& put) {
    for (std::uint32_t h = 0; h < count; ++h) {
      const auto [lo, hi] = std::minmax(corner_position[h], corner_position[next_corner(h)]);
      put(lo, {hi, h});
    }
  });
  EdgeTable table;
  table.half_edges.reserve(count);
  table.first.reserve(count / 2 + 2);
  for (std::size_t p = 0; p < position_count; ++p) {
    const std::span<Entry> bucket = entries[p];
    std::ranges::sort(bucket);
    for (std::size_t i = 0; i < bucket.size(); ++i) {
      if (i == 0 || bucket[i].first != bucket[i - 1].first)
        table.first.push_back(static_cast<std::uint32_t>(table.half_edges.size()));
      table.half_edges.push_back(bucket[i].second);
    }
  }
  table.first.push_back(static_cast<std::uint32_t>(table.half_edges.size()));
  return table;
}

std::vector<Vec3f> position_normals(const Mesh& mesh) {
  std::vector<Vec3d> sum(mesh.positions.size());
  for (const Triangle& t : mesh.triangles) {
    const auto [a, b, c] = corner_points(mesh, t);
    const Vec3d n = cross(b - a, c - a);
    for (const std::uint32_t w : t) sum[mesh.wedge_position[w]] = sum[mesh.wedge_position[w]] + n;
  }
  std::vector<Vec3f> out;
  for (const Vec3d& n : sum) {
    const double l = length(n);
    // No direction: slivers only, or a fold that cancels out. Any unit vector is as good as another.
    out.push_back(l > 0 ? to_float(n * (1 / l)) : Vec3f{0, 1, 0});
  }
  return out;
}

double surface_area(const Mesh& mesh, const std::vector<Triangle>& triangles) {
  double area = 0;
  for (const Triangle& t : triangles) {
    const auto [a, b, c] = corner_points(mesh, t);
    area += 0.5 * length(cross(b - a, c - a));
  }
  return area;
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

std::vector<std::uint32_t> weld_positions(const std::vector<Vec3f>& positions, double distance) {
  std::vector<std::uint32_t> weld = weld_equal(positions);
  double extent = 0;
  for (std::size_t i = 0; i < positions.size(); ++i)
    if (weld[i] != kNoIndex)
      for (int k = 0; k < 3; ++k) extent = std::max(extent, std::fabs(double{positions[i][k]}));
  // Below 2^-40 of the coordinates cell numbers would lose their meaning, and a float holds 2^-24 of its
  // value anyway.
  if (!(distance > extent * 0x1p-40)) return weld;
  std::vector<std::uint32_t> index;
  std::vector<Vec3f> points;
  for (std::uint32_t i = 0; i < positions.size(); ++i)
    if (weld[i] == i) {
      index.push_back(i);
      points.push_back(positions[i]);
    }
  WeldGrid grid(points, distance);
  for (std::uint32_t n = 0; n < points.size(); ++n) {
    const auto near = [&](std::uint32_t m) {
      return length(to_double(points[m]) - to_double(points[n])) <= distance;
    };
    if (const std::uint32_t kept = grid.find(n, near); kept != kNoIndex)
      weld[index[n]] = index[kept];
    else
      grid.keep(n);
  }
  follow(weld);
  return weld;
}

float float_unit(double magnitude) {
  if (!(magnitude > 0) || !std::isfinite(magnitude)) return 0;
  return std::ldexp(1.0f, std::max(std::ilogb(magnitude) - 23, -149));
}

std::uint64_t weld_rounded(const std::vector<Vec3f>& positions,
                           const std::vector<RoundedPosition>& candidates, std::vector<std::uint32_t>& weld) {
  constexpr double kUnits = 4, kOfEdge = 1 / 16.0;
  std::vector<Vec3f> points;
  double coarsest = 0;
  for (const RoundedPosition& c : candidates) {
    points.push_back(positions[c.index]);
    coarsest = std::max(coarsest, double{c.rounding});
  }
  if (coarsest == 0) return 0;
  WeldGrid grid(points, kUnits * coarsest);
  std::uint64_t joined = 0;
  for (std::uint32_t n = 0; n < candidates.size(); ++n) {
    const RoundedPosition& a = candidates[n];
    const auto near = [&](std::uint32_t m) {
      const RoundedPosition& b = candidates[m];
      const Vec3d d = to_double(points[m]) - to_double(points[n]);
      return std::max({std::fabs(d.x), std::fabs(d.y), std::fabs(d.z)}) <=
                 kUnits * std::max(a.rounding, b.rounding) &&
             length(d) <= kOfEdge * std::min(a.shortest_edge, b.shortest_edge);
    };
    if (const std::uint32_t kept = grid.find(n, near); kept != kNoIndex) {
      weld[a.index] = candidates[kept].index;
      ++joined;
    } else {
      grid.keep(n);
    }
  }
  follow(weld);
  return joined;
}

std::vector<std::uint32_t> weld_wedges(const Mesh& mesh, const std::vector<std::uint32_t>& position_weld) {
  const std::size_t count = mesh.wedge_count();
  Buckets<std::uint32_t> wedges = in_buckets(mesh.positions.size(), [&](auto&& put) {
    for (std::uint32_t w = 0; w < count; ++w)
      if (const std::uint32_t p = position_weld[mesh.wedge_position[w]]; p != kNoIndex) put(p, w);
  });
  std::vector<std::uint32_t> weld(count, kNoIndex);
  for (std::size_t p = 0; p < mesh.positions.size(); ++p) {
    const auto begin = wedges[p].begin(), end = wedges[p].end();
    if (end - begin > 1)
      std::sort(begin, end, [&](std::uint32_t a, std::uint32_t b) {
        const int c = Attributes(mesh, a).compare(Attributes(mesh, b));
        return c != 0 ? c < 0 : a < b;
      });
    for (auto i = begin; i != end; ++i) {
      const bool same = i != begin && Attributes(mesh, *i).compare(Attributes(mesh, *(i - 1))) == 0;
      weld[*i] = same ? weld[*(i - 1)] : *i;
    }
  }
  return weld;
}

namespace {

/// Whether rounding may have parted two wedges of one point.
bool near(const Mesh& mesh, std::uint32_t a, std::uint32_t b) {
  constexpr float kTexture = 0x1p-12f, kDirection = 1 / 64.0f, kColour = 1 / 128.0f;
  const auto apart = [&](const auto& values, float most) {
    if (values.empty()) return false;
    const auto d = values[a] - values[b];
    return dot(d, d) > most * most;
  };
  const auto apart4 = [&](const std::vector<Vec4f>& values, float most) {
    if (values.empty()) return false;
    const Vec4f &u = values[a], &v = values[b];
    return std::max({std::fabs(u.x - v.x), std::fabs(u.y - v.y), std::fabs(u.z - v.z),
                     std::fabs(u.w - v.w)}) > most;
  };
  return !apart(mesh.uv0, kTexture) && !apart(mesh.uv1, kTexture) && !apart(mesh.normals, kDirection) &&
         !apart4(mesh.colours, kColour) && !apart4(mesh.tangents, kDirection);
}

}  // namespace

void weld_rounded_wedges(const Mesh& mesh, const std::vector<std::uint32_t>& exact,
                         const std::vector<std::uint32_t>& position_weld,
                         std::vector<std::uint32_t>& wedge_weld) {
  constexpr std::size_t kMostKept = 32;  // of one position
  std::vector<bool> joined(position_weld.size());
  for (std::size_t p = 0; p < exact.size(); ++p)
    if (exact[p] != position_weld[p]) joined[position_weld[p]] = true;
  const auto position = [&](std::uint32_t w) { return position_weld[mesh.wedge_position[w]]; };
  std::vector<std::uint32_t> wedges;
  for (std::uint32_t w = 0; w < wedge_weld.size(); ++w)
    if (wedge_weld[w] == w && joined[position(w)]) wedges.push_back(w);
  std::sort(wedges.begin(), wedges.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::pair(position(a), a) < std::pair(position(b), b);
  });
  std::vector<std::uint32_t> kept;
  for (const std::uint32_t w : wedges) {
    if (!kept.empty() && position(kept[0]) != position(w)) kept.clear();
    const auto found = std::find_if(kept.begin(), kept.end(), [&](auto k) { return near(mesh, k, w); });
    if (found != kept.end())
      wedge_weld[w] = *found;
    else if (kept.size() < kMostKept)
      kept.push_back(w);
  }
  follow(wedge_weld);
}

std::size_t count_charts(const Mesh& mesh) {
  DisjointSets sets(mesh.wedge_count());
  std::vector<std::uint8_t> used(mesh.wedge_count(), 0);
  for (const Triangle& t : mesh.triangles) {
    sets.join(t[0], t[1]);
    sets.join(t[1], t[2]);
    for (const std::uint32_t w : t) used[w] = 1;
  }
  std::size_t count = 0;
  for (std::uint32_t w = 0; w < used.size(); ++w)
    if (used[w] && sets.find(w) == w) ++count;
  return count;
}

}  // namespace texmesh
