#pragma once
#include <cstdint>

#include "format/model/model.h"

namespace texmesh::testing {

/// A closed cube of 12 triangles, side 2, one UV chart per face in a 3 x 2 atlas (seams on every edge), no
/// normals.
Mesh cube();
/// A UV sphere with `rings` x `segments` quads, radius 1, one chart with a seam, poles as triangle fans;
/// smooth normals.
Mesh sphere(int rings, int segments);
/// An open height field of n x n quads over [0,1]^2 in x, y with z = amplitude * waves; one chart covering
/// 0..1.
Mesh sheet(int n, float amplitude = 0.05f);
/// A sphere displaced by deterministic bumps: an organic closed object for feature tests.
Mesh bumpy_sphere(int rings, int segments, float amplitude = 0.05f);
/// `meshes` side by side as one mesh (positions offset along x by `gap`).
Mesh side_by_side(const std::vector<Mesh>& meshes, float gap = 0.5f);
/// A small deterministic generator; the same sequence everywhere.
struct Random {
  std::uint64_t state;
  std::uint32_t next() {
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    return static_cast<std::uint32_t>(state >> 33);
  }
  double uniform() { return next() / 2147483648.0; }  // [0, 1)
};

}  // namespace texmesh::testing
