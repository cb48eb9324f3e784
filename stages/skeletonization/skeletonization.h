#pragma once
#include "stages/data/conditioned_mesh.h"
#include "stages/data/scale_map.h"
#include "stages/data/stage.h"

namespace texmesh {

inline constexpr int kSkeletonizationVersion = 9;

struct SkeletonizationOptions {
  // At 40 a turtle has no hind legs, at 60 the skeleton of a saxophone's neck cuts its corner.
  int alpha_divisor = 80;
  int offset_divisor = 600;
  int max_wrap_faces = 8000;
  double radius_floor = 0.25;  // R_eff = max(R, floor * median R)
  double plate_ratio = 5;
  double limb_ratio = 3;
  // Where CGAL would not end, the caps do, and a note names the fallback.
  int max_wrap_steps = 1000000;
  static constexpr int max_contractions = 500;
  static void fields(auto& s, auto&& v) {
    v("alpha_divisor", s.alpha_divisor, Range{5, 400}, ProfileOnly{},
      "alpha of the wrap = bounding-box diagonal / this");
    v("offset_divisor", s.offset_divisor, Range{50, 6000}, ProfileOnly{},
      "offset of the wrap = bounding-box diagonal / this");
    v("max_wrap_faces", s.max_wrap_faces, Range{100, 100000}, ProfileOnly{},
      "most faces of the wrap that is contracted to the skeleton");
    v("radius_floor", s.radius_floor, Range{0, 1}, ProfileOnly{},
      "least skeleton distance, as a fraction of its median");
    v("plate_ratio", s.plate_ratio, Range{1, 1e9}, ProfileOnly{},
      "a part whose median distance to the skeleton is more than this many half thicknesses is a plate: "
      "its R is half the local thickness");
    v("limb_ratio", s.limb_ratio, Range{1, 1e9}, ProfileOnly{},
      "R is at most this many half thicknesses (thin parts that the skeleton does not reach)");
    v("max_wrap_steps", s.max_wrap_steps, Range{1000, 2e9}, ProfileOnly{},
      "work cap: steps of a wrap before a coarser one; they may look at 50 times as many triangles");
  }
};

/// The skeleton of any conditioned mesh (open, several components, one triangle): an alpha wrap, its mean
/// curvature flow skeleton, and distances to it that the local thickness corrects where a curve is no
/// skeleton (local_radius.h). Meshes of more than 100,000 triangles are clustered to that first. Of few
/// triangles n alpha_divisor is at most 80 (n / 6400)^1.5, or 24 (the default is whole from 6,400 on), and
/// the wrap has at most n^3 / 8,000,000 faces, or 1,000. Where it would be the coarsest and the mesh is one
/// closed surface of at least 1,000 triangles, none with an edge of more than a quarter of the diagonal, the
/// mesh itself is contracted. No mesh makes it fail. Every fallback gives a warning:
/// - "skeleton-coarser-wrap": a wrap that takes more than max_wrap_steps, or looks at 50 times as many
///   triangles (thousands of needles around one point), is tried with twice and four times its alpha.
/// - "skeleton-part-centroid": a part of the wrap that cannot be contracted has its centroid for a skeleton.
/// - "skeleton-fallback": where there is no wrap, R is the distance to the component's centroid.
/// Plates and thin limbs give notes ("skeleton-plates", "skeleton-thin-parts"). Wrap and contraction run on
/// one thread. Deterministic.
Skeleton skeletonize(const ConditionedMesh& mesh, const SkeletonizationOptions& options,
                     const RunContext& context);

}  // namespace texmesh
