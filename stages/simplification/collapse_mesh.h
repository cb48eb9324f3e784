#pragma once
#include <span>

#include "stages/data/conditioned_mesh.h"

namespace texmesh {

/// The triangle mesh that simplification works on. Its vertices are *points*: groups of twin positions, so
/// that the position-welded surface is what keeps its topology. Its wedges are the mesh's, split further by
/// material and part, so that a border of materials behaves like a seam. Points, wedges and triangles are
/// numbered along a space-filling curve: on a million triangles the collapse loop runs more than twice as
/// fast than in file order.
class CollapseMesh {
 public:
  struct Face {
    std::uint32_t wedge[3], point[3];
    bool alive() const { return wedge[0] != kNoIndex; }
  };
  /// A wedge record that did not exist in the input: a relaxed junction's chart wedge at another position.
  struct NewWedge {
    std::uint32_t source;    // wedge of the input whose attributes it carries
    std::uint32_t position;  // position of the input
  };

  explicit CollapseMesh(const ConditionedMesh& input);

  std::uint32_t point_count() const { return static_cast<std::uint32_t>(points_.size()); }
  std::uint32_t wedge_count() const { return static_cast<std::uint32_t>(wedge_real_.size()); }
  const std::vector<Face>& faces() const { return faces_; }
  /// In a frame where the bounding box is centred and its diagonal is 1.
  Vec3d point(std::uint32_t p) const { return points_[p]; }
  double diagonal() const { return diagonal_; }  // object units
  /// Corners at a point, as face * 4 + corner. Those of removed faces may stand among them where there are
  /// many.
  std::span<const std::uint32_t> corners(std::uint32_t p) const {
    return {pool_.data() + lists_[p].begin, lists_[p].count};
  }
  std::span<const std::uint32_t> members(std::uint32_t p) const {  // positions of the input
    return {members_.data() + member_begin_[p], member_begin_[p + 1] - member_begin_[p]};
  }
  bool is_multiple(std::uint32_t p) const { return member_begin_[p + 1] - member_begin_[p] > 1; }
  std::uint32_t wedge_position(std::uint32_t w) const { return wedge_position_[w]; }  // position of the input
  std::uint32_t wedge_source(std::uint32_t w) const { return wedge_source_[w]; }  // wedge with the attributes
  /// Texture coordinates that guide collapses: of the set that the wedge's material uses for its colours;
  /// zero for all where there are none.
  bool has_uv() const { return !wedge_uv_.empty(); }
  Vec2d wedge_uv(std::uint32_t w) const { return to_double(wedge_uv_[w]); }
  /// Those of the other set where the wedge's material has textures in both, otherwise zero.
  bool has_other_uv() const { return !wedge_other_uv_.empty(); }
  Vec2d wedge_other_uv(std::uint32_t w) const { return to_double(wedge_other_uv_[w]); }
  std::uint32_t face_source(std::uint32_t f) const { return face_source_[f]; }  // triangle of the input
  std::uint32_t alive_faces() const { return alive_faces_; }
  std::uint32_t alive_positions() const { return alive_positions_; }
  bool is_alive(std::uint32_t p) const { return lists_[p].count != lists_[p].dead; }
  std::uint32_t corner_count(std::uint32_t p) const { return lists_[p].count - lists_[p].dead; }

  /// A wedge with the attributes of `wedge` at `position`.
  std::uint32_t add_wedge(std::uint32_t wedge, std::uint32_t position);
  /// Merges `from` into `to`: faces with both are removed, other corners of `from` get point `to` and the
  /// wedge that `wedge_map(old wedge)` names.
  void collapse(std::uint32_t from, std::uint32_t to, auto&& wedge_map) {
    moved_.clear();
    const List list = lists_[from];
    for (std::uint32_t i = 0; i < list.count; ++i) {
      const std::uint32_t entry = pool_[list.begin + i];
      Face& face = faces_[entry / 4];
      if (!face.alive()) continue;
      const std::uint32_t c = entry % 4;
      if (face.point[(c + 1) % 3] == to || face.point[(c + 2) % 3] == to) {
        remove_face(entry / 4, from);
      } else {
        face.point[c] = to;
        face.wedge[c] = wedge_map(face.wedge[c]);
        moved_.push_back(entry);
      }
    }
    lists_[from].count = lists_[from].dead = 0;
    alive_positions_ -= static_cast<std::uint32_t>(members(from).size());
    append(to);
  }

  /// Ask memory for what a look at a point will read, before it is read; each needs what the one before it
  /// asked for.
  void prefetch_list(std::uint32_t p) const { __builtin_prefetch(&lists_[p]); }
  void prefetch_corners(std::uint32_t p) const { __builtin_prefetch(pool_.data() + lists_[p].begin); }
  void prefetch_faces(std::uint32_t p) const {
    for (std::uint32_t entry : corners(p)) __builtin_prefetch(&faces_[entry / 4]);
  }
  void prefetch_point(std::uint32_t p) const {
    __builtin_prefetch(&points_[p]);
    __builtin_prefetch(&lists_[p]);
  }

  /// Removes what is left of a component: all its points, with their faces.
  void remove(std::span<const std::uint32_t> points);

  /// The faces left, in the input's order, as wedges of the input followed by new_wedges().
  void snapshot(std::vector<Triangle>& triangles, std::vector<std::uint32_t>& source);
  const std::vector<NewWedge>& new_wedges() const { return new_wedges_; }

 private:
  struct List {
    std::uint32_t begin = 0, count = 0, capacity = 0;
    std::uint32_t dead = 0;  // entries of removed faces; they go when they are half of a long list
  };
  static constexpr std::uint32_t kLongList = 64;
  void number_points(const ConditionedMesh& input, std::vector<std::uint32_t>& point_of_position);
  void add_faces(const Mesh& mesh, const std::vector<std::uint32_t>& point_of_position);
  void number_wedges(const Mesh& mesh);
  void copy_uvs(const ConditionedMesh& input);
  void build_lists();
  void remove_face(std::uint32_t face, std::uint32_t except_point);
  void append(std::uint32_t to);
  void drop_dead(List& list);

  std::uint32_t input_wedges_ = 0, alive_faces_ = 0, alive_positions_ = 0;
  double diagonal_ = 1;
  std::vector<Vec3d> points_;
  std::vector<std::uint32_t> members_, member_begin_;
  std::vector<Face> faces_;
  std::vector<std::uint32_t> face_source_, face_of_source_;
  std::vector<std::uint32_t> left_;  // triangles of the input that were left at the last snapshot
  std::vector<std::uint32_t> wedge_real_, wedge_position_, wedge_source_;
  std::vector<Vec2f> wedge_uv_, wedge_other_uv_;
  std::vector<NewWedge> new_wedges_;
  std::vector<List> lists_;
  std::vector<std::uint32_t> pool_, moved_;
};

}  // namespace texmesh
