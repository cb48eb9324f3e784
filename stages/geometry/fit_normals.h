#pragma once
#include <span>

#include "format/model/model.h"
#include "stages/base/run_context.h"

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

}  // namespace texmesh
