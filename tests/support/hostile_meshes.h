#pragma once
// What is wrong with the geometry of scans, or meant to be.
#include <cstdint>
#include <vector>

#include "format/model/model.h"
#include "tests/support/meshes.h"

namespace texmesh::testing {

/// A mesh without UVs and normals; every corner's wedge is its position.
Mesh bare_mesh(std::vector<Vec3f> positions, std::vector<Triangle> triangles);

/// `triangles` triangles whose corners are drawn from `points` points, so that edges have many faces and some
/// triangles have no area. Coordinates lie in [0, 1), or are the integers below `grid`, so that points
/// coincide.
Mesh random_soup(Random& random, std::uint32_t points, std::uint32_t triangles, std::uint32_t grid = 0);

/// sheet(n, 0.1) of which nearly half has been squeezed along y, into slivers of next to no area.
Mesh sliver_sheet(int n);

/// `count` triangles without a common point, of side `side` at most, in the unit cube; the first is larger.
Mesh dust(int count, float side);

/// A closed slab of n x n x 1 cubes without those of odd row and column: as many tunnels, each a cube wide.
/// No UVs.
Mesh sieve(int n);

/// Appends a copy of every triangle.
void repeat_triangles(Mesh& m);

/// The same surface seen from its back.
Mesh inside_out(Mesh m);

}  // namespace texmesh::testing
