#pragma once
#include "format/model/model.h"

namespace texmesh {

/// The axis on which the object probably stands upright: 'y' or 'z', or '\0' where its shape does not tell.
/// It stands on a bottom: a plane at its low end that looks down, or the plane of the rim of its only
/// opening. The bottom must lie beneath the centre of its surface, which lies low, and be three times as
/// large as what any other end has. Thin objects tell nothing: a floor of z up and a painting of y up are one
/// shape. Linear in the triangles, but for a sort of the edges of meshes that are open.
char guessed_up(const Mesh& mesh);

/// Turns the mesh with its origin so that `up`, x, y or z, becomes y: a quarter about the axis that neither
/// is nor becomes up, as OutputTransform turns.
void turn_up(Mesh& mesh, char up);

}  // namespace texmesh
