#pragma once
#include "stages/data/fragments.h"
#include "stages/render/render_texture.h"

namespace texmesh {

struct ShownMaterials {
  std::vector<RenderMaterial> materials;  // their slots count `textures`
  std::vector<RenderTexture> textures;
};

/// Textures come from the coarsest mip whose longer side has `least_side_px`, or from the full size.
/// References to texture coordinates that the mesh does not have show nothing.
ShownMaterials shown_materials(const std::vector<Material>& materials, const Fragments& fragments,
                               const std::vector<Pixels>& pixels, const Mesh& mesh,
                               std::uint32_t least_side_px, const RunContext& context);

}  // namespace texmesh
