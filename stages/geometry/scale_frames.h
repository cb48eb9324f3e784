#pragma once
#include <span>

#include "stages/base/run_context.h"
#include "stages/data/nested_scales.h"

namespace texmesh {

/// Where a surface is lit how: places, unit normals, and the area that each stands for.
struct NormalSamples {
  std::vector<Vec3d> places;
  std::vector<Vec3f> normals;
  std::vector<double> areas;
};

/// The wedges of a mesh; of very fine ones every so many. Empty when the mesh has no normals.
NormalSamples normal_samples(const Mesh& mesh);

/// Normals for a coarser mesh with which it is lit as the samples say: its own are those that the surface has
/// in the very points of its vertices, which stand for nothing around them. Each sample is put where the mesh
/// is nearest (not on faces that look away from it), then least squares by a few damped steps, interpolation
/// along the faces included. Vertices without samples keep theirs. `points` and `normals` are alike in
/// number, `triangles` index them. Same bits for any number of threads.
std::vector<Vec3f> fit_normals(std::span<const Vec3d> points, std::span<const Triangle> triangles,
                               std::vector<Vec3f> normals, const NormalSamples& samples,
                               const RunContext& context);

/// What a scale is lit by, per wedge of NestedScales::mesh; empty where that mesh has none.
struct ScaleFrames {
  std::vector<Vec3f> normals;   // unit
  std::vector<Vec4f> tangents;  // at right angles to the normals
};

/// Normals with which scale `index` is lit as S_0 is. S_0's own are those that the surface has in the very
/// points of the scale's vertices, which stand for nothing around them. Each sample, a wedge of S_0, is put
/// where the scale is nearest: first among the triangles around the vertex that the sample's position has
/// collapsed into, then from place to place as long as triangles come nearer; never on triangles that look
/// away from the sample. Then least squares by a few damped steps, interpolation along the triangles
/// included. Wedges without samples keep S_0's normal. Tangents of S_0 are turned to the new normals. S_0
/// itself, and wedges that the scale does not use, have S_0's values. Same bits for any thread count. About
/// 0.5 us per wedge of S_0 on one core, less for coarse scales.
ScaleFrames scale_frames(const NestedScales& scales, std::size_t index, const RunContext& context);

/// extract_scale() with normals and tangents of scale_frames(), or with those.
Mesh lit_scale(const NestedScales& scales, std::size_t index, const ScaleFrames& frames);
Mesh lit_scale(const NestedScales& scales, std::size_t index, const RunContext& context);

/// What stands for S_0 where small pictures are all that is asked for: the index of the finest scale of at
/// most so many triangles. A finer one where scales are missing in between or are farther (root mean square)
/// from S_0 than `farthest`, object units; 0, S_0 itself, for meshes that have no more.
std::size_t stand_in_scale(const NestedScales& scales, std::size_t most_triangles, double farthest);

}  // namespace texmesh
