#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "format/fields.h"
#include "format/model.h"
#include "stages/condition.h"
#include "stages/run_context.h"

namespace texmesh {

inline constexpr int kSkeletonizationVersion = 1;

struct SkeletonizationOptions {
  int alpha_divisor = 40;      // alpha = diagonal / this
  int offset_divisor = 600;    // offset = diagonal / this
  int max_wrap_faces = 5000;   // the wrap is decimated to this before contraction
  double radius_floor = 0.25;  // R_eff = max(R, floor * median R)
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("alpha_divisor", s.alpha_divisor, Range{5, 400}, "alpha of the wrap = bounding-box diagonal / this");
    v("offset_divisor", s.offset_divisor, Range{50, 6000},
      "offset of the wrap = bounding-box diagonal / this");
    v("max_wrap_faces", s.max_wrap_faces, Range{100, 100000},
      "faces of the wrap that is contracted to the skeleton");
    v("radius_floor", s.radius_floor, Range{0, 1}, "least skeleton distance, as a fraction of its median");
  }
};

/// The curve skeleton and the skeleton distance R(v) (thesis 6.2): alpha wrap, mean curvature flow, distance
/// to segments. Parts that contract to a point, and the centroids of the fallback, are segments of no length.
struct Skeleton {
  std::vector<Vec3f> nodes;                            // mesh-local coordinates
  std::vector<std::array<std::uint32_t, 2>> segments;  // node indices
  std::vector<float> distance;     // R(v) per position: shortest distance to a segment, object units, >= 0
  std::vector<float> radius;       // R_eff(v) per position = max(R, floor * median R); > 0
  bool fallback_centroid = false;  // contraction failed: distance to the component's centroid
  Notes notes;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.nodes, s.segments, s.distance, s.radius, s.fallback_centroid, s.notes);
  }
};

/// Works for any conditioned mesh (open, several components, one triangle): where the wrap or the contraction
/// fails it falls back to component centroids with a warning, it never fails (but for Cancelled and
/// bad_alloc). Meshes of more than 100,000 triangles are clustered to that first. Wrap and contraction run on
/// one thread. Deterministic.
Skeleton skeletonize(const ConditionedMesh& mesh, const SkeletonizationOptions& options,
                     const RunContext& context);

}  // namespace texmesh
