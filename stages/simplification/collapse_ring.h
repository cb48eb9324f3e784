#pragma once

#include "stages/simplification/collapse_mesh.h"

namespace texmesh {

/// The neighbourhood of one point of a CollapseMesh, and what a collapse of that point into one of its
/// neighbours would do to topology, borders, seams and orientation. Scratch memory that is filled again for
/// every point; one per thread.
class CollapseRing {
 public:
  static constexpr std::uint32_t kNone = kNoIndex;
  static constexpr std::uint32_t kMaxValence = 4;  // faces at an edge; an edge with more locks
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

  /// Borders and non-manifold lines shrink along themselves only; where they end, meet or change they stay.
  bool allowed_by_borders(const Neighbour& n) const {
    if (n.valence > kMaxValence) return false;
    if (odd_edges_ == 0) return true;
    return odd_edges_ == 2 && !odd_mixed_ && n.valence == odd_valence_;
  }
  /// Fills `map` from the faces that the collapse into the neighbour removes. False, and `map` for no
  /// neighbour, when not every wedge is mapped to one wedge. A junction of charts may move along a seam or
  /// border all the same; the wedges of charts that are not beside the edge then keep their attributes.
  bool map_wedges(std::uint32_t slot, WedgeMap& map) const;
  /// The position of the neighbour's group that a position of the centre's group goes to.
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
  bool odd_mixed_ = false;
};

}  // namespace texmesh
