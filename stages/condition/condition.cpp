#include "stages/condition/condition.h"

#include <cassert>
#include <tuple>

#include "format/base/buckets.h"
#include "format/base/text_bytes.h"
#include "format/model/add_wedge.h"
#include "stages/base/run_context.h"
#include "stages/geometry/mesh_topology.h"

namespace texmesh {
namespace {

/// What split_non_manifold needs to know to pair the triangles of an edge that more than two share.
struct Surface {
  std::span<const Vec3f> positions;
  std::span<const Triangle> wedges;                // per triangle: the same corners with their attributes
  std::span<const std::uint16_t> material;         // per triangle
  std::span<const std::uint32_t> corner_position;  // three per triangle, all different
};

struct ManifoldSplit {
  std::vector<std::uint32_t> corner_position;  // as Surface's, with new numbers for positions that were split
  // Per new number (position_count, position_count + 1 and so on): the old one.
  std::vector<std::uint32_t> split_from;
  std::uint64_t non_manifold_edges = 0;  // edges of more than two triangles, or of two that disagree on front
  std::uint64_t bow_ties = 0;            // positions split although none of their edges is non-manifold
};

/// More triangles than this at one edge are not paired at all: pairs are tried all against all.
constexpr std::size_t kMaxPaired = 32;
/// Rounds of undoing pairs that still meet at one edge, before all pairs of non-manifold edges are undone.
constexpr int kRounds = 6;

class Splitter {
 public:
  Splitter(const Surface& surface, const EdgeTable& edges)
      : surface_(surface), edges_(edges), partner_(surface.corner_position.size(), kNoIndex) {}

  ManifoldSplit run() {
    pair_all();
    result_.non_manifold_edges = singular_.size() - folded_;
    for (int round = 0;; ++round) {
      number_fans();
      if (!undo_clashes(round == kRounds)) break;
    }
    count_bow_ties();
    return std::move(result_);
  }

 private:
  std::uint32_t from(std::uint32_t h) const { return surface_.corner_position[h]; }
  std::uint32_t opposite(std::uint32_t h) const { return surface_.corner_position[previous_corner(h)]; }
  bool forward(std::uint32_t h) const { return from(h) < surface_.corner_position[next_corner(h)]; }

  void pair_all() {
    for (std::size_t e = 0; e < edges_.edge_count(); ++e) {
      const auto halves = edges_.edge(e);
      if (halves.size() == 1) continue;
      const bool opposed = halves.size() == 2 && forward(halves[0]) != forward(halves[1]);
      if (opposed && opposite(halves[0]) != opposite(halves[1])) {
        join(halves[0], halves[1]);
        continue;
      }
      singular_.push_back(e);
      folded_ += opposed;
      if (halves.size() > 2 && halves.size() <= kMaxPaired) pair_best(halves);
    }
  }

  void join(std::uint32_t a, std::uint32_t b) {
    partner_[a] = b;
    partner_[b] = a;
  }

  void pair_best(std::span<const std::uint32_t> halves) {
    struct Candidate {
      int shared;
      double flatness;
      std::uint32_t a, b;
    };
    std::vector<Candidate> candidates;
    for (std::uint32_t a : halves)
      for (std::uint32_t b : halves)
        if (forward(a) && !forward(b) && opposite(a) != opposite(b))
          candidates.push_back({shared(a, b), dot(normal(a / 3), normal(b / 3)), a, b});
    std::sort(candidates.begin(), candidates.end(), [](const Candidate& x, const Candidate& y) {
      return std::tuple(-x.shared, -x.flatness, x.a, x.b) < std::tuple(-y.shared, -y.flatness, y.a, y.b);
    });
    for (const Candidate& c : candidates)
      if (partner_[c.a] == kNoIndex && partner_[c.b] == kNoIndex) join(c.a, c.b);
  }

  /// How much of texture and material runs on across the edge: 0..3.
  int shared(std::uint32_t a, std::uint32_t b) const {
    const auto wedge = [&](std::uint32_t corner) { return surface_.wedges[corner / 3][corner % 3]; };
    return (wedge(a) == wedge(next_corner(b))) + (wedge(next_corner(a)) == wedge(b)) +
           (surface_.material[a / 3] == surface_.material[b / 3]);
  }

  Vec3d normal(std::uint32_t t) const {
    const auto point = [&](std::uint32_t k) { return to_double(surface_.positions[from(3 * t + k)]); };
    return normalized(cross(point(1) - point(0), point(2) - point(0)));
  }

  void number_fans() {
    const auto corners = static_cast<std::uint32_t>(partner_.size());
    DisjointSets fans(corners);
    for (std::uint32_t h = 0; h < corners; ++h) {
      const std::uint32_t other = partner_[h];
      if (other == kNoIndex || other < h) continue;
      fans.join(h, next_corner(other));
      fans.join(next_corner(h), other);
    }
    const auto count = static_cast<std::uint32_t>(surface_.positions.size());
    std::vector<bool> taken(count, false);
    result_.corner_position.assign(corners, kNoIndex);
    result_.split_from.clear();
    for (std::uint32_t c = 0; c < corners; ++c) {
      const std::uint32_t fan = fans.find(c), position = from(c);
      if (fan != c) {
        result_.corner_position[c] = result_.corner_position[fan];
      } else if (!taken[position]) {
        taken[position] = true;
        result_.corner_position[c] = position;
      } else {
        result_.corner_position[c] = count + static_cast<std::uint32_t>(result_.split_from.size());
        result_.split_from.push_back(position);
      }
    }
  }

  /// A fan can pass through the same edge twice; then pairs that were kept apart there share both ends again.
  /// Returns whether pairs had to be undone. With no pairs left at any non-manifold edge this cannot happen:
  /// a fan is then a path that begins and ends at such edges, so at most two half-edges meet again, and they
  /// run in opposite ways.
  bool undo_clashes(bool undo_all) {
    bool undone = false;
    for (std::size_t e : singular_) {
      const auto halves = edges_.edge(e);
      const bool paired =
          std::any_of(halves.begin(), halves.end(), [&](auto h) { return partner_[h] != kNoIndex; });
      if (!paired || !(undo_all || clashes(halves))) continue;
      for (std::uint32_t h : halves) partner_[h] = kNoIndex;
      undone = true;
    }
    return undone;
  }

  bool clashes(std::span<const std::uint32_t> halves) const {
    std::vector<std::tuple<std::uint32_t, std::uint32_t, bool>> ends;
    for (std::uint32_t h : halves) {
      std::uint32_t a = result_.corner_position[h], b = result_.corner_position[next_corner(h)];
      const bool swapped = !forward(h);
      if (swapped) std::swap(a, b);
      ends.emplace_back(a, b, swapped);
    }
    std::sort(ends.begin(), ends.end());
    // Two equal neighbours are two triangles that run through the edge in the same direction, and any third
    // one is that.
    return std::adjacent_find(ends.begin(), ends.end()) != ends.end();
  }

  void count_bow_ties() {
    std::vector<bool> at_edge(surface_.positions.size(), false);
    for (std::size_t e : singular_) {
      const std::uint32_t h = edges_.edge(e)[0];
      at_edge[from(h)] = at_edge[from(next_corner(h))] = true;
    }
    std::vector<std::uint32_t> split = result_.split_from;
    std::sort(split.begin(), split.end());
    split.erase(std::unique(split.begin(), split.end()), split.end());
    for (std::uint32_t p : split) result_.bow_ties += !at_edge[p];
  }

  const Surface& surface_;
  const EdgeTable& edges_;
  std::vector<std::uint32_t> partner_;  // per half-edge: the one it stays joined with
  std::vector<std::size_t> singular_;   // edges that are not simply shared by two triangles
  std::uint64_t folded_ = 0;            // those of a two-sided sheet's rim among them
  ManifoldSplit result_;
};

/// Gives every fan of triangles around a position a position of its own. The result is an oriented 2-manifold
/// with boundary: an edge has one triangle, or two that run through it in opposite directions, and the
/// triangles of a position form one fan.
/// - Where more triangles meet at an edge, the pairs that agree best in wedges, material and direction stay
///   together.
/// - The two triangles of a two-sided sheet are never joined to each other.
/// - The fan with the lowest triangle keeps the old number. Nothing moves.
/// O(n log n).
ManifoldSplit split_non_manifold(const Surface& surface, const EdgeTable& edges) {
  return Splitter(surface, edges).run();
}

void require(bool sound, const char* place, const char* expected, std::size_t found) {
  if (!sound) throw StageError("condition", place, expected, std::to_string(found));
}

void check_indices(const Mesh& m) {
  require(m.triangles.size() <= kNoIndex / 3, "triangles", "at most 2^32 / 3", m.triangles.size());
  for (std::uint32_t p : m.wedge_position)
    require(p < m.positions.size(), "wedge_position", "an index of a position", p);
  for (const Triangle& t : m.triangles)
    for (std::uint32_t w : t) require(w < m.wedge_count(), "triangles", "an index of a wedge", w);
  require(m.triangle_material.size() == m.triangles.size(), "triangle_material", "one per triangle",
          m.triangle_material.size());
  require(m.triangle_part.size() == m.triangles.size(), "triangle_part", "one per triangle",
          m.triangle_part.size());
  for (std::size_t size : {m.uv0.size(), m.uv1.size(), m.normals.size(), m.colours.size(), m.tangents.size()})
    require(size == 0 || size == m.wedge_count(), "wedge attributes", "none or one per wedge", size);
}

bool finite(float x) { return std::isfinite(x); }

/// Turns -0 into +0, so that equal attributes have equal bits, and what is not finite into `fallback`.
bool clean(float& x, float fallback) {
  const bool sound = finite(x);
  x = sound ? x + 0.0f : fallback;
  return sound;
}

/// Unit length; zero where there is no direction, to be filled in by smooth normals.
bool clean_normal(Vec3f& n) {
  const double l = finite(n.x) && finite(n.y) && finite(n.z) ? length(to_double(n)) : 0;
  if (l == 0) {
    n = {};
    return false;
  }
  // Normals of a source are rounded; renormalising those that are unit within 1e-6 would only churn their
  // bits.
  if (std::fabs(l - 1) > 1e-6) n = to_float(to_double(n) * (1 / l));
  n = n + Vec3f{0, 0, 0};
  return true;
}

/// A copy of the wedges and attributes of `in` (nothing else) with sound attributes.
Mesh clean_attributes(const Mesh& in, std::uint64_t& repaired) {
  Mesh m;
  m.wedge_position = in.wedge_position;
  m.uv0 = in.uv0;
  m.uv1 = in.uv1;
  m.normals = in.normals;
  m.colours = in.colours;
  m.tangents = in.tangents;
  m.positions = in.positions;
  for (std::size_t w = 0; w < m.wedge_count(); ++w) {
    bool sound = true;
    for (auto* uv : {&m.uv0, &m.uv1})
      if (!uv->empty()) {
        sound = clean((*uv)[w].x, 0) && sound;
        sound = clean((*uv)[w].y, 0) && sound;
      }
    if (!m.colours.empty())
      for (float* x : {&m.colours[w].x, &m.colours[w].y, &m.colours[w].z, &m.colours[w].w})
        sound = clean(*x, 1) && sound;
    if (!m.normals.empty()) sound = clean_normal(m.normals[w]) && sound;
    if (!m.tangents.empty())
      for (float* x : {&m.tangents[w].x, &m.tangents[w].y, &m.tangents[w].z, &m.tangents[w].w})
        sound = clean(*x, 0) && sound;
    repaired += !sound;
  }
  return m;
}

/// The triangles that stay, with welded wedges and, in `corner`, welded positions (numbers of the input).
struct Kept {
  std::vector<std::uint32_t> source;
  std::vector<Triangle> wedges;
  std::vector<std::uint32_t> corner;

  void add(std::uint32_t t, const Triangle& w, const Triangle& p) {
    source.push_back(t);
    wedges.push_back(w);
    corner.insert(corner.end(), p.begin(), p.end());
  }
  Triangle positions(std::size_t i) const { return {corner[3 * i], corner[3 * i + 1], corner[3 * i + 2]}; }
  Kept filter(const std::vector<bool>& drop) const {
    Kept out;
    for (std::size_t i = 0; i < source.size(); ++i)
      if (!drop[i]) out.add(source[i], wedges[i], positions(i));
    return out;
  }
};

bool has_area(const std::vector<Vec3f>& positions, const Triangle& t) {
  const Vec3d a = to_double(positions[t[0]]), b = to_double(positions[t[1]]), c = to_double(positions[t[2]]);
  return !(cross(b - a, c - a) == Vec3d{});
}

Kept keep_sound_triangles(const Mesh& in, const std::vector<std::uint32_t>& position_weld,
                          const std::vector<std::uint32_t>& wedge_weld, ConditionReport& report) {
  Kept kept;
  for (std::uint32_t t = 0; t < in.triangles.size(); ++t) {
    Triangle w{}, p{};
    for (std::size_t k = 0; k < 3; ++k) {
      p[k] = position_weld[in.wedge_position[in.triangles[t][k]]];
      w[k] = wedge_weld[in.triangles[t][k]];
    }
    if (p[0] == kNoIndex || p[1] == kNoIndex || p[2] == kNoIndex)
      ++report.non_finite_triangles;
    else if (p[0] == p[1] || p[1] == p[2] || p[2] == p[0])
      ++report.degenerate_triangles;
    else
      kept.add(t, w, p);
  }
  return kept;
}

Kept drop_duplicates(const Mesh& in, const Kept& kept, ConditionReport& report) {
  struct Key {
    Triangle wedges;
    std::uint32_t material_part, index;
    auto tie() const { return std::tie(wedges, material_part); }
  };
  // Buckets by the lowest wedge keep the sorts short.
  Buckets<Key> keys = in_buckets<Key>(in.wedge_count(), [&](auto&& put) {
    for (std::uint32_t i = 0; i < kept.wedges.size(); ++i) {
      Triangle w = kept.wedges[i];
      std::rotate(w.begin(), std::min_element(w.begin(), w.end()), w.end());
      const std::uint32_t t = kept.source[i];
      put(w[0], {w, std::uint32_t{in.triangle_material[t]} << 16 | in.triangle_part[t], i});
    }
  });
  std::vector<bool> drop(kept.source.size(), false);
  std::uint64_t dropped = 0;
  for (std::size_t w = 0; w < in.wedge_count(); ++w) {
    const std::span<Key> bucket = keys[w];
    std::ranges::sort(bucket, [](const Key& a, const Key& b) {
      return a.tie() != b.tie() ? a.tie() < b.tie() : a.index < b.index;
    });
    for (std::size_t i = 1; i < bucket.size(); ++i)
      if (bucket[i].tie() == bucket[i - 1].tie()) {
        drop[bucket[i].index] = true;
        ++dropped;
      }
  }
  report.duplicate_triangles = dropped;
  return dropped ? kept.filter(drop) : kept;
}

/// Triangles without area whose edges have at most one neighbour: nothing gapes without them.
Kept drop_slivers(const Mesh& in, const Kept& kept, EdgeTable& edges, ConditionReport& report) {
  std::vector<bool> drop(kept.source.size(), false);
  std::uint64_t dropped = 0;
  std::vector<std::uint8_t> shared;
  for (std::size_t i = 0; i < kept.source.size(); ++i) {
    if (has_area(in.positions, kept.positions(i))) continue;
    if (shared.empty()) {
      shared.assign(kept.source.size(), 0);
      for (std::size_t e = 0; e < edges.edge_count(); ++e)
        if (edges.edge(e).size() > 1)
          for (std::uint32_t h : edges.edge(e)) ++shared[h / 3];
    }
    drop[i] = shared[i] < 2;
    ++(drop[i] ? dropped : report.slivers_kept);
  }
  report.degenerate_triangles += dropped;
  if (dropped == 0) return kept;
  Kept out = kept.filter(drop);
  edges = group_edges(out.corner, in.positions.size());
  return out;
}

void require_area(const Mesh& mesh, const Kept& kept) {
  bool any = false;
  for (std::size_t i = 0; i < kept.source.size() && !any; ++i)
    any = has_area(mesh.positions, kept.positions(i));
  if (!any)
    throw StageError("condition", "triangles", "at least one with three finite corners and an area",
                     "none of " + std::to_string(mesh.triangles.size()));
}

/// The positions at edges that do not simply join two triangles, with what rounding may have done to them.
std::vector<RoundedPosition> open_positions(const Mesh& in, const std::vector<std::uint32_t>& weld,
                                            const Kept& kept, const EdgeTable& edges) {
  const std::vector<std::uint32_t>& corner = kept.corner;
  std::vector<float> shortest(in.positions.size(), 0);  // 0: not at such an edge
  const auto from = [&](std::uint32_t h) { return corner[h]; };
  const auto to = [&](std::uint32_t h) { return corner[next_corner(h)]; };
  const auto opposite = [&](std::uint32_t h) { return corner[previous_corner(h)]; };
  for (std::size_t e = 0; e < edges.edge_count(); ++e) {
    const auto halves = edges.edge(e);
    const bool joins =
        halves.size() == 2 && from(halves[0]) == to(halves[1]) && opposite(halves[0]) != opposite(halves[1]);
    if (!joins) shortest[from(halves[0])] = shortest[to(halves[0])] = std::numeric_limits<float>::max();
  }
  for (std::uint32_t h = 0; h < corner.size(); ++h) {
    if (shortest[from(h)] == 0 && shortest[to(h)] == 0) continue;
    const double l = length(to_double(in.positions[to(h)]) - to_double(in.positions[from(h)]));
    for (const std::uint32_t p : {from(h), to(h)}) shortest[p] = std::min(shortest[p], static_cast<float>(l));
  }
  std::vector<float> rounding(in.positions.size(), 0);  // of all positions that are one
  for (std::size_t p = 0; p < weld.size(); ++p) {
    if (weld[p] == kNoIndex || shortest[weld[p]] == 0) continue;
    const Vec3f at = in.positions[p];
    const float given = in.rounding.size() > 1 ? in.rounding[p] : in.rounding.empty() ? 0 : in.rounding[0];
    const float own = float_unit(std::max({std::fabs(at.x), std::fabs(at.y), std::fabs(at.z)}));
    rounding[weld[p]] = std::max({rounding[weld[p]], given, own});
  }
  std::vector<RoundedPosition> open;
  for (std::uint32_t p = 0; p < shortest.size(); ++p)
    if (shortest[p] > 0) open.push_back({p, rounding[p], shortest[p]});
  return open;
}

void count_edges(const EdgeTable& edges, ConditionReport& report) {
  for (std::size_t e = 0; e < edges.edge_count(); ++e) {
    report.boundary_edges += edges.edge(e).size() == 1;
    report.non_manifold_edges_found += edges.edge(e).size() > 2;
  }
}

/// New numbers for the positions in use: those of the input in its order, then those that splits added.
std::vector<std::uint32_t> number_positions(const Mesh& in, const ManifoldSplit& split,
                                            ConditionedMesh& out) {
  const auto old_count = static_cast<std::uint32_t>(in.positions.size());
  std::vector<std::uint32_t> number(old_count + split.split_from.size(), kNoIndex);
  for (std::uint32_t p : split.corner_position) number[p] = 0;
  for (std::uint32_t p = 0; p < number.size(); ++p) {
    if (number[p] == kNoIndex) continue;
    number[p] = static_cast<std::uint32_t>(out.mesh.positions.size());
    const std::uint32_t source = p < old_count ? p : split.split_from[p - old_count];
    out.mesh.positions.push_back(in.positions[source] + Vec3f{0, 0, 0});
    out.position_source.push_back(source);
    out.twin.push_back(number[source]);
  }
  return number;
}

/// Wedges in the input's order, then one for every wedge and position that a split added.
void number_wedges(const Mesh& attributes, const Kept& kept, const ManifoldSplit& split,
                   const std::vector<std::uint32_t>& position_number, Mesh& out) {
  const auto old_count = static_cast<std::uint32_t>(attributes.positions.size());
  std::vector<std::uint32_t> number(attributes.wedge_count(), kNoIndex);
  std::vector<std::pair<std::uint32_t, std::uint32_t>> added;  // position, wedge
  for (std::size_t c = 0; c < split.corner_position.size(); ++c) {
    const std::uint32_t w = kept.wedges[c / 3][c % 3], p = split.corner_position[c];
    if (p < old_count)
      number[w] = p;
    else
      added.emplace_back(p, w);
  }
  for (std::uint32_t w = 0; w < number.size(); ++w) {
    if (number[w] == kNoIndex) continue;
    const std::uint32_t position = position_number[number[w]];
    number[w] = static_cast<std::uint32_t>(out.wedge_count());
    add_wedge(out, attributes, w, position);
  }
  std::sort(added.begin(), added.end());
  added.erase(std::unique(added.begin(), added.end()), added.end());
  const auto first_added = static_cast<std::uint32_t>(out.wedge_count());
  for (const auto& [p, w] : added) add_wedge(out, attributes, w, position_number[p]);
  out.triangles.resize(kept.source.size());
  for (std::size_t c = 0; c < split.corner_position.size(); ++c) {
    const std::uint32_t w = kept.wedges[c / 3][c % 3], p = split.corner_position[c];
    const auto find = [&] {
      return static_cast<std::uint32_t>(std::lower_bound(added.begin(), added.end(), std::pair(p, w)) -
                                        added.begin());
    };
    out.triangles[c / 3][c % 3] = p < old_count ? number[w] : first_added + find();
  }
}

void fill_normals(Mesh& m, bool add_missing) {
  const bool missing = m.normals.empty();
  if (missing && !add_missing) return;
  if (!missing && std::find(m.normals.begin(), m.normals.end(), Vec3f{}) == m.normals.end()) return;
  const std::vector<Vec3f> smooth = position_normals(m);
  m.normals.resize(m.wedge_count());
  for (std::size_t w = 0; w < m.wedge_count(); ++w)
    if (m.normals[w] == Vec3f{}) m.normals[w] = smooth[m.wedge_position[w]];
}

void number_components(ConditionedMesh& out) {
  DisjointSets sets(out.mesh.positions.size());
  for (std::uint32_t t = 0; t < out.mesh.triangles.size(); ++t)
    for (int k = 1; k < 3; ++k) sets.join(out.mesh.position_of(t, 0), out.mesh.position_of(t, k));
  for (std::uint32_t p = 0; p < out.twin.size(); ++p) sets.join(p, out.twin[p]);
  out.component.resize(out.mesh.positions.size());
  for (std::uint32_t p = 0; p < out.component.size(); ++p) {
    const std::uint32_t root = sets.find(p);
    out.component[p] = root == p ? out.component_count++ : out.component[root];
  }
  out.report.components = out.component_count;
}

Notes describe(const ConditionReport& r) {
  Notes notes;
  if (r.non_finite_triangles)
    add_warning(notes, "non-finite-position", "",
                counted(r.non_finite_triangles, "triangle") + " with a corner that is not finite dropped");
  if (r.rounded_positions)
    add_info(notes, "rounded-position", "",
             counted(r.rounded_positions, "position") +
                 " at open edges joined with a neighbour that differs by rounding alone");
  if (r.repaired_wedges)
    add_warning(notes, "bad-attribute", "",
                counted(r.repaired_wedges, "wedge") +
                    " with a UV, colour or normal that is not finite, or a normal of no length, repaired");
  if (r.degenerate_triangles)
    add_warning(notes, "degenerate-triangle", "",
                counted(r.degenerate_triangles, "triangle") + " without area dropped");
  if (r.duplicate_triangles)
    add_warning(notes, "duplicate-triangle", "",
                counted(r.duplicate_triangles, "triangle") + " that repeated another dropped");
  if (r.slivers_kept)
    add_info(notes, "sliver", "",
             counted(r.slivers_kept, "triangle") + " without area kept, to leave no crack");
  if (r.split_non_manifold_edges)
    add_info(notes, "non-manifold-edge", "",
             counted(r.split_non_manifold_edges, "non-manifold edge") + " split");
  if (r.split_bow_ties)
    add_info(notes, "bow-tie", "",
             counted(r.split_bow_ties, "position") + " where surfaces touch in a point split");
  return notes;
}

std::uint64_t count_welded(const std::vector<std::uint32_t>& weld) {
  std::uint64_t welded = 0;
  for (std::uint32_t i = 0; i < weld.size(); ++i) welded += weld[i] != kNoIndex && weld[i] != i;
  return welded;
}

double diagonal(const std::vector<Vec3f>& positions) {
  Box3f box;
  for (const Vec3f p : positions)
    if (finite(p.x) && finite(p.y) && finite(p.z)) box.extend(p);
  return to_double(box).diagonal();
}

}  // namespace

ConditionedMesh condition_mesh(const Mesh& mesh, bool normals_by_specification,
                               const ConditionOptions& options, const RunContext& context) {
  check_indices(mesh);
  ConditionedMesh out;
  ConditionReport& report = out.report;

  const Mesh attributes = clean_attributes(mesh, report.repaired_wedges);
  std::vector<std::uint32_t> position_weld =
      weld_positions(mesh.positions, options.weld_distance * diagonal(mesh.positions));
  std::vector<std::uint32_t> wedge_weld = weld_wedges(attributes, position_weld);
  context.check_cancelled();
  context.report(0.3);

  const ConditionReport before = report;
  Kept kept = drop_duplicates(mesh, keep_sound_triangles(mesh, position_weld, wedge_weld, report), report);
  EdgeTable edges = group_edges(kept.corner, mesh.positions.size());
  const std::vector<std::uint32_t> exact = position_weld;
  if (const std::uint64_t joined =
          weld_rounded(mesh.positions, open_positions(mesh, position_weld, kept, edges), position_weld)) {
    report = before;
    report.rounded_positions = joined;
    wedge_weld = weld_wedges(attributes, position_weld);
    weld_rounded_wedges(attributes, exact, position_weld, wedge_weld);
    kept = drop_duplicates(mesh, keep_sound_triangles(mesh, position_weld, wedge_weld, report), report);
    edges = group_edges(kept.corner, mesh.positions.size());
  }
  kept = drop_slivers(mesh, kept, edges, report);
  require_area(mesh, kept);
  context.check_cancelled();
  context.report(0.6);

  std::vector<std::uint16_t> material(kept.source.size());
  for (std::size_t i = 0; i < kept.source.size(); ++i) material[i] = mesh.triangle_material[kept.source[i]];
  const ManifoldSplit split = split_non_manifold({mesh.positions, kept.wedges, material, kept.corner}, edges);
  count_edges(edges, report);
  report.split_non_manifold_edges = split.non_manifold_edges;
  report.split_bow_ties = split.bow_ties;

  const std::vector<std::uint32_t> position_number = number_positions(mesh, split, out);
  number_wedges(attributes, kept, split, position_number, out.mesh);
  out.mesh.origin = mesh.origin;
  out.mesh.triangle_material = std::move(material);
  for (std::uint32_t t : kept.source) out.mesh.triangle_part.push_back(mesh.triangle_part[t]);
  out.mesh.part_names = mesh.part_names;
  out.triangle_source = std::move(kept.source);
  fill_normals(out.mesh, options.normals == NormalsPolicy::kSmooth ||
                             (options.normals == NormalsPolicy::kAuto && !normals_by_specification));
  number_components(out);

  report.welded_positions = count_welded(position_weld);
  report.welded_wedges = count_welded(wedge_weld);
  const std::size_t used = out.mesh.positions.size() - split.split_from.size();
  report.unused_positions = mesh.positions.size() - report.welded_positions - used;
  out.notes = describe(report);
  context.report(1);
  return out;
}

}  // namespace texmesh
