#pragma once
// Small atlases made by hand.
#include "stages/charts/charts.h"
#include "stages/render/render_texture.h"
#include "tests/stages/render/render_fixtures.h"

namespace texmesh::testing {

/// A square of side 2 around the origin that faces +Z, over the whole of a texture.
inline AtlasMesh square_atlas(std::uint32_t side_px, std::uint32_t group = 0, float z = 0) {
  AtlasMesh out;
  const Mesh square = testing::square();
  for (const Vec3f p : square.positions) out.positions.push_back({p.x, p.y, z});
  out.uvs = square.uv0;
  out.position_of = {0, 1, 2, 3};
  out.triangles = square.triangles;
  out.chart_of = {0, 0};
  out.group_of = {group, group};
  out.chart_count = 1;
  out.width_px = out.height_px = side_px;
  return out;
}

/// A texture of these texels, rows from the top.
inline RenderTexture texture_of(std::uint32_t side_px, std::uint32_t channels, bool srgb, auto&& texel) {
  Pixels p{side_px, side_px, channels, {}};
  for (std::uint32_t y = 0; y < side_px; ++y)
    for (std::uint32_t x = 0; x < side_px; ++x)
      for (std::uint32_t c = 0; c < channels; ++c)
        p.data.push_back(static_cast<std::uint8_t>(texel(x, y, c)));
  return render_texture(std::move(p), srgb, 0, {});
}

inline void use_texture(RenderMaterial& material, TextureUse use, std::int32_t texture) {
  material.slot(use).texture = texture;
  material.slot(use).wrap_s = material.slot(use).wrap_t = Wrap::kClamp;
}

}  // namespace texmesh::testing
