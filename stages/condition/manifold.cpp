#include "stages/condition/manifold.h"

#include <algorithm>
#include <cassert>
#include <tuple>

#include "format/base/no_index.h"
#include "stages/geometry/weld.h"

namespace texmesh {
namespace {

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

}  // namespace

ManifoldSplit split_non_manifold(const Surface& surface, const EdgeTable& edges) {
  return Splitter(surface, edges).run();
}

}  // namespace texmesh
