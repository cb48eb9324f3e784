#pragma once
#include <optional>

#include "format/model/model.h"

namespace texmesh {

/// The directions of a triangle's texture axes across a normal, as renderers derive them from the texture
/// coordinates (Schueler 2013): the longer one is unit, none is where the coordinates have no area.
struct TextureFrame {
  Vec3d along_u, along_v;
};
TextureFrame texture_frame(const std::array<Vec3d, 3>& corner, const std::array<Vec2d, 3>& uv, Vec3d normal);

/// The frame that a mesh's wedges carry in a place of a triangle: mean tangent and bitangent, unit. Nothing
/// where a corner has no tangent.
std::optional<TextureFrame> vertex_frame(const Mesh& mesh, std::uint32_t triangle,
                                         const std::array<double, 3>& weight);

}  // namespace texmesh
