#pragma once
// Inside the room only.
#include <cstdint>
#include <vector>

#include "format/base/no_index.h"
#include "format/split/split_source.h"
#include "stages/data/nested_scales.h"
#include "stages/scales/corner_lists.h"
#include "stages/scales/rounded_mesh.h"

namespace texmesh {

/// Steps by which memory is asked for what a collapse will read.
enum class ReplayStep : std::uint8_t {
  kPositions,   // which points it joins
  kPoints,      // the points, and where their corners are listed
  kCorners,     // of the point that goes
  kFaces,       // at these corners
  kNeighbours,  // the points around
  kCount
};

/// Replays the collapses from fine to coarse on faces of wedges, recording what each did.
class CollapseReplay {
 public:
  CollapseReplay(const NestedScales& scales, RoundedMesh& rounded);
  // The parts refer to each other.
  CollapseReplay(const CollapseReplay&) = delete;
  CollapseReplay& operator=(const CollapseReplay&) = delete;

  /// From scale `fine` to `coarse`; the chapter leads back.
  SplitSource::Chapter run(const NestedScale& fine, const NestedScale& coarse);
  /// All faces there are now.
  SplitSource::Chapter remaining_faces(int scale) const;

 private:
  /// Who has used a point since, for the order of splits: a collapse uses its two points alone, the points
  /// around shared.
  struct PointUse {
    std::uint32_t alone = kNoIndex;   // last collapse that had it alone
    std::uint32_t shared = kNoIndex;  // head of a list of those that shared it since
  };

  // What is asked together lies together: collapses come in the order of their cost, anywhere on the surface.
  struct Point {
    std::uint32_t mark = 0;  // the last collapse that used it; up to begin_, `use` is of an earlier chapter
    PointUse use;
  };
  struct Mapping {
    std::uint32_t from, group, to;
  };
  struct Share {
    std::uint32_t collapse, next;
  };

  std::uint32_t point(std::uint32_t face, std::uint32_t corner) const {
    return faces_[face].point[corner % 3];
  }
  void put_wedge(std::uint32_t face, std::uint32_t corner, std::uint32_t wedge);
  void look_ahead(std::uint32_t collapse, std::uint32_t end) const;
  void look_at(const Collapse& collapse, ReplayStep step) const;
  void note_final(const NestedScale& coarse);
  void replay(std::uint32_t u, std::uint32_t v);
  void gather_corners(std::uint32_t u);
  void look_around(std::uint32_t v);
  bool has_edge_to(std::uint32_t v, std::uint32_t corner) const;
  void remove_face(std::uint32_t face);
  void move_corner(std::uint32_t corner, std::uint32_t v);
  void list_moved_corners(std::uint32_t move_begin, std::uint32_t v);
  std::uint32_t group(std::uint32_t face) const;
  std::uint32_t target(std::uint32_t wedge, std::uint32_t group, std::uint32_t v);
  void order(std::uint32_t number, std::uint32_t u, std::uint32_t v);
  void patch_leftovers();

  const NestedScales& scales_;
  RoundedMesh& rounded_;
  std::vector<Point> points_;
  std::vector<ReplayFace> faces_;
  std::vector<std::uint32_t> alive_;  // faces, rising; dead ones go when a chapter ends
  CornerLists corners_;
  std::vector<Share> shares_;
  std::vector<std::uint32_t> ring_, gathered_;
  std::vector<Mapping> map_;
  std::uint32_t now_ = 0, begin_ = 0;  // collapses replayed so far, and when the chapter began
  SplitSource::Chapter* chapter_ = nullptr;
};

}  // namespace texmesh
