#pragma once
#include "format/model/model.h"

namespace texmesh {

/// Moves charts (wedges joined by triangles) that lie far from 0..1 near to it, by whole repeats of their
/// textures: nobody sees a difference, and coordinates keep the bits that a place 1,500 repeats away costs.
/// Only where there are textures and every one of the chart's materials repeats in that direction under the
/// move (wrap mode and texture transform allow it); charts within two repeats stay where they are, and so do
/// those so long that their other end would only get as far away.
void bring_uvs_near(Model& model);

}  // namespace texmesh
