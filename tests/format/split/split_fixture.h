#pragma once
#include <algorithm>
#include <set>
#include <vector>

#include "format/split/split_stream.h"
#include "format/split/split_writer.h"

namespace texmesh::testing {

/// Group and corners (place, then every attribute) of faces, from the least corner on, sorted.
using Corners = std::vector<std::vector<std::int32_t>>;

inline void add_corners(Corners& list, std::int32_t group, std::array<std::vector<std::int32_t>, 3> corners) {
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = 0; b < a; ++b)
      if (std::equal(corners[a].begin(), corners[a].begin() + 3, corners[b].begin()))
        return;  // shows nothing
  std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
  std::vector<std::int32_t> face{group};
  for (const auto& c : corners) face.insert(face.end(), c.begin(), c.end());
  list.push_back(std::move(face));
}

inline Corners corners_of(const SplitMesh& mesh) {
  Corners list;
  for (std::uint32_t f = 0; f < mesh.face_count(); ++f) {
    std::array<std::vector<std::int32_t>, 3> corners;
    for (std::uint32_t k = 0; k < 3; ++k) {
      const std::uint32_t w = mesh.wedge_at(f, k);
      const auto& place = mesh.points()[mesh.wedge_point()[w]];
      corners[k].assign(place.begin(), place.end());
      for (std::size_t a = 0; a < mesh.attributes(); ++a)
        for (int i = 0; i < mesh.components(a); ++i)
          corners[k].push_back(
              mesh.values(a)[w * static_cast<std::size_t>(mesh.components(a)) + static_cast<std::size_t>(i)]);
    }
    add_corners(list, mesh.face_group()[f], std::move(corners));
  }
  std::sort(list.begin(), list.end());
  return list;
}

/// Edges with one face, and with more than two.
struct SplitEdges {
  std::size_t border = 0, non_manifold = 0;
};
inline SplitEdges count_split_edges(const SplitMesh& mesh) {
  std::vector<std::uint64_t> edges;
  for (std::uint32_t f = 0; f < mesh.face_count(); ++f)
    for (std::uint32_t k = 0; k < 3; ++k) {
      const auto [a, b] = std::minmax({mesh.point_at(f, k), mesh.point_at(f, k + 1)});
      edges.push_back(std::uint64_t{a} << 32 | b);
    }
  std::sort(edges.begin(), edges.end());
  SplitEdges counts;
  for (std::size_t i = 0, end = 0; i < edges.size(); i = end) {
    while (end < edges.size() && edges[end] == edges[i]) ++end;
    counts.border += end - i == 1 ? 1u : 0u;
    counts.non_manifold += end - i > 2 ? 1u : 0u;
  }
  return counts;
}

/// A source, and what each of its scales must decode to, coarsest first.
struct SplitFixture {
  SplitSource source;
  std::vector<Corners> scales;
};

/// A height field of n x n points, n = 2^k + 1, whose columns go one half at a time, each point onto its left
/// neighbour; a seam of UV, colour and group down the middle; a lone triangle that only the finest scale has.
class GridCollapser {
 public:
  explicit GridCollapser(std::uint32_t n) : n_(n) {
    SplitSource& s = fixture_.source;
    s.position = {12, {-1, 2, 0.5f}, 3};
    s.attributes = {{SplitKind::kUv0, {11, {0, 0, 0}, 1}},
                    {SplitKind::kNormal, {8, {}, 1}},
                    {SplitKind::kColour, {8, {}, 1}}};
    s.values.resize(3);
    s.groups = {{0, 0}, {1, 0}, {0, 1}};
    for (std::uint32_t y = 0; y < n; ++y)
      for (std::uint32_t x = 0; x < n; ++x) add_point(x, y);
    for (std::uint32_t y = 0; y + 1 < n; ++y)
      for (std::uint32_t x = 0; x + 1 < n; ++x) {
        const bool right = x >= n / 2;
        const std::uint32_t a = wedge(x, y, right), b = wedge(x + 1, y, right), c = wedge(x, y + 1, right),
                            d = wedge(x + 1, y + 1, right);
        add_face({a, b, d}, right);
        add_face({a, d, c}, right);
      }
  }

  SplitFixture run() {
    SplitSource& s = fixture_.source;
    int scale = 0;
    note_scale();
    for (std::uint32_t step = 1; step < n_ - 1; step *= 2) {
      chapter_ = {};
      chapter_.scale = scale++;
      around_.clear();
      for (std::uint32_t y = 0; y < n_; ++y)
        for (std::uint32_t x = step; x < n_; x += 2 * step) collapse(y * n_ + x, y * n_ + x - step);
      if (chapter_.scale == 0) add_lone_triangle();
      turn_round();
      note_scale();
      s.chapters.push_back(chapter_);
    }
    SplitSource::Chapter base;
    base.scale = scale;
    for (std::uint32_t f = 0; f < faces_.size(); ++f)
      if (alive_[f]) base.patch.push_back({f, faces_[f]});
    s.chapters.push_back(base);
    std::reverse(s.chapters.begin(), s.chapters.end());
    std::reverse(fixture_.scales.begin(), fixture_.scales.end());
    s.splits_per_block = 7;
    return fixture_;
  }

 private:
  std::int32_t bump(std::uint32_t x, std::uint32_t y) const {
    return static_cast<std::int32_t>((x * 7919u + y * 104729u + x * y * 31u) % 23u);
  }
  void add_point(std::uint32_t x, std::uint32_t y) {
    SplitSource& s = fixture_.source;
    const auto i = static_cast<std::int32_t>(x), j = static_cast<std::int32_t>(y);
    const auto p = static_cast<std::uint32_t>(s.points.size());
    s.points.push_back({40 * i + bump(x, y), 40 * j + bump(y, x), 500 + 3 * i * j + bump(x + y, x)});
    first_wedge_.push_back(static_cast<std::uint32_t>(s.wedge_point.size()));
    for (std::int32_t side = 0; side < (x == n_ / 2 ? 2 : 1); ++side)
      add_wedge(p, x > n_ / 2 ? 1 : side, i, j);
  }
  void add_wedge(std::uint32_t p, std::int32_t side, std::int32_t i, std::int32_t j) {
    SplitSource& s = fixture_.source;
    s.wedge_point.push_back(p);
    for (std::int32_t v : {100 * side + 50 * i + bump(3, p), 60 * j + bump(p, 5)}) s.values[0].push_back(v);
    for (std::int32_t v : {127 + bump(p, 1) - 11, 127 + bump(1, p) - 11}) s.values[1].push_back(v);
    for (std::int32_t v : {10 * i, 20 * j, 200 * side, 255}) s.values[2].push_back(v % 256);
  }
  std::uint32_t wedge(std::uint32_t x, std::uint32_t y, bool right) const {
    return first_wedge_[y * n_ + x] + (x == n_ / 2 && right ? 1u : 0u);
  }
  void add_face(std::array<std::uint32_t, 3> wedges, bool right) {
    faces_.push_back(wedges);
    alive_.push_back(true);
    fixture_.source.face_group.push_back(right ? 1 : 0);
  }
  std::uint32_t point(std::uint32_t f, std::size_t k) const {
    return fixture_.source.wedge_point[faces_[f][k % 3]];
  }

  void collapse(std::uint32_t u, std::uint32_t v) {
    SplitSource::Split split{v,
                             u,
                             static_cast<std::uint32_t>(chapter_.moves.size()),
                             0,
                             static_cast<std::uint32_t>(chapter_.born.size()),
                             0};
    std::set<std::uint32_t> around{u, v};
    std::vector<std::array<std::uint32_t, 2>> map;
    for (int pass = 0; pass < 2; ++pass)
      for (std::uint32_t f = 0; f < faces_.size(); ++f)
        for (std::size_t k = 0; alive_[f] && k < 3; ++k) {
          if (point(f, k) != u) continue;
          around.insert({point(f, k + 1), point(f, k + 2)});
          const bool next = point(f, k + 1) == v, last = point(f, k + 2) == v;
          if (pass == 0 && (next || last)) {
            map.push_back({faces_[f][k], faces_[f][(k + (next ? 1 : 2)) % 3]});
            chapter_.born.push_back({f, faces_[f]});
            alive_[f] = false;
          } else if (pass == 1) {
            chapter_.moves.push_back({f, faces_[f][k]});
            const auto to =
                std::find_if(map.begin(), map.end(), [&](auto& m) { return m[0] == faces_[f][k]; });
            faces_[f][k] = to == map.end() ? map.at(0)[1] : (*to)[1];
            break;
          }
        }
    split.move_end = static_cast<std::uint32_t>(chapter_.moves.size());
    split.born_end = static_cast<std::uint32_t>(chapter_.born.size());
    // A later collapse that touches the same points is undone first.
    for (std::uint32_t i = 0; i < around_.size(); ++i)
      if (std::any_of(around.begin(), around.end(), [&](std::uint32_t p) { return around_[i].count(p) > 0; }))
        chapter_.before.push_back({static_cast<std::uint32_t>(around_.size()), i});
    around_.push_back(std::move(around));
    chapter_.splits.push_back(split);
  }
  void turn_round() {
    const auto last = static_cast<std::uint32_t>(chapter_.splits.size()) - 1;
    std::reverse(chapter_.splits.begin(), chapter_.splits.end());
    for (auto& [a, b] : chapter_.before) a = last - a, b = last - b;
  }
  void add_lone_triangle() {
    SplitSource& s = fixture_.source;
    const auto w = static_cast<std::uint32_t>(s.wedge_point.size());
    for (std::int32_t k = 0; k < 3; ++k) {
      s.points.push_back({1000 + 50 * (k % 2), 1000 + 50 * (k / 2), 3000});
      add_wedge(static_cast<std::uint32_t>(s.points.size() - 1), 0, k, k);
    }
    s.face_group.push_back(2);
    chapter_.patch.push_back({static_cast<std::uint32_t>(s.face_group.size() - 1), {w, w + 1, w + 2}});
    add_source_face(fixture_.scales[0], {w, w + 1, w + 2}, 2);
    std::sort(fixture_.scales[0].begin(), fixture_.scales[0].end());
  }
  void add_source_face(Corners& list, std::array<std::uint32_t, 3> wedges, std::int32_t group) const {
    const SplitSource& s = fixture_.source;
    std::array<std::vector<std::int32_t>, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto& place = s.points[s.wedge_point[wedges[k]]];
      corners[k].assign(place.begin(), place.end());
      for (std::size_t a = 0; a < s.attributes.size(); ++a) {
        const auto n = static_cast<std::size_t>(split_components(s.attributes[a].kind));
        for (std::size_t i = 0; i < n; ++i) corners[k].push_back(s.values[a][wedges[k] * n + i]);
      }
    }
    add_corners(list, group, std::move(corners));
  }
  void note_scale() {
    Corners list;
    for (std::uint32_t f = 0; f < faces_.size(); ++f)
      if (alive_[f]) add_source_face(list, faces_[f], fixture_.source.face_group[f]);
    std::sort(list.begin(), list.end());
    fixture_.scales.push_back(std::move(list));
  }

  std::uint32_t n_;
  SplitFixture fixture_;
  SplitSource::Chapter chapter_;
  std::vector<std::uint32_t> first_wedge_;
  std::vector<std::array<std::uint32_t, 3>> faces_;
  std::vector<bool> alive_;
  std::vector<std::set<std::uint32_t>> around_;
};

inline SplitFixture split_fixture(std::uint32_t n = 9) { return GridCollapser(n).run(); }

}  // namespace texmesh::testing
