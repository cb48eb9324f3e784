#pragma once
#include <span>

#include "format/model/model.h"

namespace texmesh {

/// The set of texture coordinates (0 or 1) along which the material's normal map wants tangents; -1 where no
/// texture of the material is given in tangent space.
int tangent_texcoord(const Material& material);

/// Gives the mesh the tangents of the MikkTSpace rule (Mikkelsen 2008), which glTF 2.0 names for meshes
/// without TANGENT: at a corner the mean direction of growing u over the triangles around that are joined by
/// edges of equal position, normal and texture coordinates and turn their texture the same way round,
/// weighted by the angle at the corner. Per material: `texcoord`, as tangent_texcoord(). Tangents that the
/// mesh has are replaced; wedges that no such triangle uses have none (all 0). Nothing is left where the mesh
/// has no normals or not these coordinates.
/// - Corners of a wedge that are mirrored against each other, or meet at a point only, get wedges of their
///   own, which stand behind the others.
/// - Triangles without an area of texture take part as their neighbours need them; corners that only such
///   triangles share, or triangles with two corners in one place, have (1, 0, 0, 1).
/// Same bits on every machine. About 0.6 us per triangle.
void make_tangents(Mesh& mesh, std::span<const int> texcoord);

}  // namespace texmesh
