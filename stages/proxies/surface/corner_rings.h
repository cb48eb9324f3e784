#pragma once
// Inside proxies only: which triangles meet at a vertex, for a soup whose vertices merge.
#include <cstdint>
#include <vector>

#include "format/model/model.h"

namespace texmesh {

/// Triangles of vertices that merge pairwise. The corners at a vertex form a ring, so that two vertices merge
/// in the time that the smaller number of corners takes to be renamed; any soup will do.
class CornerRings {
 public:
  CornerRings(std::vector<Triangle> triangles, std::size_t vertex_count);

  std::size_t live_count() const { return live_count_; }
  std::size_t vertex_count() const { return first_.size(); }
  const std::vector<Triangle>& triangles() const { return triangles_; }
  bool is_live(std::uint32_t triangle) const { return live_[triangle] != 0; }
  /// How many live triangles the vertex has.
  std::uint32_t valence(std::uint32_t vertex) const { return valence_[vertex]; }

  /// Live triangles at the vertex, in the ring's order. Forgets dead ones.
  void triangles_at(std::uint32_t vertex, std::vector<std::uint32_t>& out);
  void remove(std::uint32_t triangle);
  /// The vertex `from` becomes `to`. Triangles that have both are removed before.
  void merge(std::uint32_t from, std::uint32_t to);

 private:
  std::vector<Triangle> triangles_;
  std::vector<std::uint8_t> live_;      // per triangle
  std::vector<std::uint32_t> next_;     // per corner 3 t + k: the next one of the ring
  std::vector<std::uint32_t> first_;    // per vertex: a corner of its ring, or kNoIndex
  std::vector<std::uint32_t> valence_;  // per vertex
  std::size_t live_count_;
};

}  // namespace texmesh
