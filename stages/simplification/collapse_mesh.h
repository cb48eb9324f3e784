#pragma once
#include <span>

#include "format/base/buckets.h"
#include "stages/data/conditioned_mesh.h"

namespace texmesh {

/// The triangle mesh that simplification works on. Its vertices are *points*: groups of twin positions, so
/// that the position-welded surface is what keeps its topology. Its wedges are the mesh's, split further by
/// material, so that a border of materials behaves like a seam. Parts of one material that share wedges are
/// one surface to it. Points, wedges and triangles are numbered along a space-filling curve: on a million
/// triangles the collapse loop runs more than twice as fast than in file order.
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
    return members_[p];
  }
  bool is_multiple(std::uint32_t p) const { return members_[p].size() > 1; }
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
  Buckets<std::uint32_t> members_;
  std::vector<Face> faces_;
  std::vector<std::uint32_t> face_source_, face_of_source_;
  std::vector<std::uint32_t> left_;  // triangles of the input that were left at the last snapshot
  std::vector<std::uint32_t> wedge_real_, wedge_position_, wedge_source_;
  std::vector<Vec2f> wedge_uv_, wedge_other_uv_;
  std::vector<NewWedge> new_wedges_;
  std::vector<List> lists_;
  std::vector<std::uint32_t> pool_, moved_;
};

/// The neighbourhood of one point of a CollapseMesh, and what a collapse of that point into one of its
/// neighbours would do to topology, borders, seams and orientation. Scratch memory that is filled again for
/// every point; one per thread.
class CollapseRing {
 public:
  static constexpr std::uint32_t kNone = kNoIndex;
  // Faces at an edge; an edge with more locks. The second is for surfaces that may touch.
  static constexpr std::uint32_t kUsualMaxValence = 4, kMaxValence = 8;
  /// `from`: index into wedges(); `to`: wedge of the neighbour.
  struct Pair {
    std::uint32_t from = 0, to = 0;
  };
  struct Neighbour {
    std::uint32_t point = 0, valence = 0, pairs = 0, faces = 0, far_valence = 0;
    std::array<Pair, kMaxValence> pair;
    // For the caller's choice:
    enum class State : std::uint8_t { kOut, kBounded, kPriced } state = State::kOut;
    double cost = 0, error = 0;
    bool is_seam() const { return pairs == 2 && (pair[0].from != pair[1].from || pair[0].to != pair[1].to); }
  };
  /// `a`, `b`: the face's other two points as indices into neighbours(); `wedge`: index into wedges().
  struct Corner {
    std::uint32_t face = 0, corner = 0, a = 0, b = 0, wedge = 0;
  };
  /// Where the collapse into one neighbour takes the centre's wedges.
  struct WedgeMap {
    std::uint32_t slot = kNone;         // of the neighbour
    std::vector<std::uint32_t> target;  // per wedge of wedges(); kNone = keeps its attributes
  };

  explicit CollapseRing(const CollapseMesh& mesh) : mesh_(mesh), mark_(mesh.point_count()) {}

  /// Looks at point u. Until the mesh changes, every function below is about u.
  void gather(std::uint32_t u);
  void prefetch(std::uint32_t neighbour) const { __builtin_prefetch(&mark_[neighbour]); }
  std::uint32_t centre() const { return centre_; }
  const std::vector<Corner>& corners() const { return corners_; }
  std::vector<Neighbour>& neighbours() { return neighbours_; }
  const std::vector<Neighbour>& neighbours() const { return neighbours_; }
  const std::vector<std::uint32_t>& wedges() const { return wedges_; }

  /// From now on, in the four questions below, surfaces may touch: a tunnel may close to a line, lines may
  /// end anywhere, and wedges that are not beside the edge keep their attributes.
  void let_surfaces_touch() { may_touch_ = true; }
  bool surfaces_may_touch() const { return may_touch_; }

  /// Borders and non-manifold lines shrink along themselves only; where they end, meet or change they stay.
  bool allowed_by_borders(const Neighbour& n) const {
    if (n.valence > (may_touch_ ? kMaxValence : kUsualMaxValence)) return false;
    if (odd_edges_ == 0 || may_touch_) return true;
    return odd_edges_ == 2 && !odd_mixed_ && n.valence == odd_valence_;
  }
  /// Fills `map` from the faces that the collapse into the neighbour removes. False, and `map` for no
  /// neighbour, when not every wedge is mapped to one wedge. A junction of charts may move along a seam or
  /// border all the same; the wedges of charts that are not beside the edge then keep their attributes.
  bool map_wedges(std::uint32_t slot, WedgeMap& map) const;
  /// The position of the neighbour's group that a position of the centre's group goes to: where surfaces
  /// touch, the group's first for one that is not beside the edge.
  std::uint32_t destination(const Neighbour& n, std::uint32_t position) const;
  /// The link condition on the welded surface, twins as one: no new non-manifold edge, no new hole, nothing
  /// vanishes.
  bool keeps_topology(std::uint32_t slot);
  /// No face turns by more than about 78 degrees or loses its area, and no texture triangle turns over, in no
  /// set of texture coordinates that its material uses.
  bool keeps_orientation(const WedgeMap& map) const;

 private:
  struct Mark {
    std::uint32_t stamp = 0, slot = 0;
  };
  std::uint32_t slot_of(std::uint32_t point);
  bool positions_agree(const Neighbour& n) const;
  bool keeps_positions(std::uint32_t slot) const;
  bool turns_over(const Corner& c, const WedgeMap& map, auto&& uv) const;

  const CollapseMesh& mesh_;
  std::uint32_t centre_ = kNone, now_ = 0;
  std::vector<Corner> corners_;
  std::vector<Neighbour> neighbours_;
  std::vector<std::uint32_t> wedges_;
  std::vector<Mark> mark_;  // per point: the neighbour's slot where the stamp is now_
  // Edges that are not inside a surface of two faces per edge (or of four where two sheets lie on each
  // other):
  std::uint32_t odd_edges_ = 0, odd_valence_ = 0, usual_valence_ = 2;
  bool odd_mixed_ = false, may_touch_ = false;
};

}  // namespace texmesh
