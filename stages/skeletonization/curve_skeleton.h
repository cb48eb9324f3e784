#pragma once
// Inside the room only: a surface contracted to a curve, the curve put into the middle, distances to it.

#include "stages/geometry/box_tree.h"
#include "stages/geometry/triangle_tree.h"
#include "stages/skeletonization/wrap.h"

namespace texmesh {

/// Line segments between nodes.
struct CurveSkeleton {
  std::vector<Vec3d> nodes;
  std::vector<std::array<std::uint32_t, 2>> segments;
};

/// The mean curvature flow skeleton (Tagliasacchi et al. 2012, CGAL's defaults) of one connected closed
/// oriented 2-manifold, contracted at most `max_contractions` times and then recentred (recentre()). CGAL's
/// test whether a point is inside tries one random ray after the other until one misses every edge, which
/// never happens on surfaces that lie on themselves (known upstream): after 1,000 rays from one point the
/// contraction is given up. GeometryFailure for a surface that is not closed, where the contraction is given
/// up, and where a check of CGAL fails. Deterministic, single-threaded.
CurveSkeleton contract_to_skeleton(const TriangleSoup& closed, int max_contractions = 500);

/// The poles (voronoi_poles()) of the surface's points that were contracted to a node.
struct NodePoles {
  Vec3d sum;
  double count = 0;
};

/// Moves the nodes of a contracted curve into the middle of the solid: to the mean of their poles, smoothed
/// over neighbouring nodes. Where the curve is thin already the contraction goes on to shorten it, and it
/// cuts the corners of bends. Nodes on the way of the curve and at its ends move across it only, so that it
/// keeps its length; branching points and lone nodes move anywhere. Nodes without poles within reach stay.
/// `poles`: one for each node. Deterministic.
void recentre(CurveSkeleton& curve, std::span<const NodePoles> poles);

/// A bounding-volume tree over line segments for closest-distance queries. Segments of no length are points.
class SegmentTree {
 public:
  /// At least one segment; every index below nodes.size().
  SegmentTree(std::span<const Vec3d> nodes, std::span<const std::array<std::uint32_t, 2>> segments);

  /// The distance from p to the closest segment. Safe to call from many threads.
  double distance(Vec3d p) const;

 private:
  struct Segment {
    Vec3d a, b;
  };
  void build(std::uint32_t first, std::uint32_t count);

  std::vector<Segment> segments_;
  std::vector<BoxNode> nodes_;
};

struct LocalRadiusOptions {
  double plate_ratio = 5;  // a part whose median skeleton distance / half thickness is above it is a plate
  double limb_ratio = 3;   // elsewhere R is at most this many half thicknesses
  double offset = 0;       // how far the wrap stands off the shape; 0: it is the shape, none of it a sheet
};

struct LocalRadius {
  std::vector<double> radius;  // R, per point
  std::size_t parts = 0, plates = 0;
  std::size_t limited = 0;  // points whose skeleton distance the thickness has lowered
};

/// The skeleton distance, corrected by the local thickness of the wrap where a curve cannot be a skeleton.
/// - On plates, whose medial shape is a sheet, R is half the thickness.
/// - On extremities that the contraction has swallowed, R is at most limb_ratio half thicknesses.
/// - Where the wrap's walls are little farther apart than its own offsets, it runs around a sheet and tells
///   nothing of a shape: the skeleton distance stays. Between half an offset and one and a half the two are
///   blended. `parts` are the wrap's; `points` and `distance` are what R is asked for, in the same frame.
///   Same bits for any thread count.
LocalRadius limit_by_thickness(const std::vector<TriangleSoup>& parts, std::span<const Vec3d> points,
                               std::span<const double> distance, const LocalRadiusOptions& options,
                               const RunContext& context);

/// Half the local thickness of a solid at the points of its surface (the shape diameter function, Shapira et
/// al. 2008). From every triangle rays go inwards in a cone. The median of how far they get, measured along
/// the normal, is halved: exact between parallel walls, 0.8 of a ball's radius. The triangles' values are
/// filtered twice by the median over the neighbours and averaged to the points. A ray that leaves the solid
/// nowhere counts as missed; a point all of whose rays miss gets infinity. `closed`: closed oriented triangle
/// meshes, normals outwards; `tree`: a TriangleTree over them. Same bytes for any thread count.
std::vector<double> half_thickness(const TriangleSoup& closed, const TriangleTree& tree,
                                   const RunContext& context);

}  // namespace texmesh
