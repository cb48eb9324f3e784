#pragma once
#include <span>

#include "stages/skeletonization/contraction/contraction.h"

namespace texmesh {

/// The poles (voronoi_poles.h) of the surface's points that were contracted to a node.
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

}  // namespace texmesh
