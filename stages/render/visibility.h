#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "format/model/model.h"
#include "stages/base/run_context.h"
#include "stages/render/render_camera.h"
#include "stages/render/render_material.h"

namespace texmesh {

/// What is shown. Textures are given later, so that one Visibility serves many qualities of them. The scales
/// of a nest share one Mesh.
struct RenderScene {
  const Mesh* mesh = nullptr;
  const std::vector<Triangle>* triangles = nullptr;  // index the mesh's wedges
  /// Per triangle: index into mesh->triangle_material. Null: the triangle's own index.
  const std::vector<std::uint32_t>* triangle_source = nullptr;
  const std::vector<RenderMaterial>* materials = nullptr;  // as mesh->triangle_material counts them
  std::size_t texture_count = 0;                           // of the textures that shade() will get

  const RenderMaterial& material_of(std::uint32_t triangle) const {
    const std::uint32_t source = triangle_source ? (*triangle_source)[triangle] : triangle;
    return (*materials)[mesh->triangle_material[source]];
  }
};
/// The whole mesh.
RenderScene render_scene(const Mesh& mesh, const std::vector<RenderMaterial>& materials,
                         std::size_t texture_count);

inline constexpr int kSamplesPerSide = 4;  // of a pixel
inline constexpr std::size_t kMaxLayers = 32;

/// One triangle within one pixel. Sample bit 4 row + column of the mask lies at ((column + 0.5) / 4,
/// (row + 0.5) / 4) of the pixel, row 0 on top.
struct RenderFragment {
  std::uint32_t triangle = 0;
  float weight1 = 0, weight2 = 0;  // of corners 1 and 2 at the mean of the covered samples; in perspective
  std::uint16_t mask = 0;          // samples covered and not hidden; not 0
  std::uint8_t layer = 0;          // 1 = mask or blend: what lies behind may show
  std::uint8_t back = 0;           // 1 = seen from behind, double-sided
};

/// What a camera sees of a scene; independent of textures.
struct Visibility {
  std::uint32_t side_px = 0;
  RenderCamera camera;
  /// [side_px * side_px + 1], raster order: fragments first[p] to first[p + 1] belong to pixel p.
  std::vector<std::uint32_t> first;
  /// Of a pixel: layers from near to far, then opaque ones by triangle, whose masks do not overlap.
  std::vector<RenderFragment> fragments;
};

/// Rows of a picture that are looked at together.
inline constexpr std::uint32_t kBandPx = 32;

/// Finds out what is seen on 4 x 4 samples a pixel. Opaque triangles: the nearest a sample, of equal ones the
/// lowest index. Mask and blend: all that no opaque sample hides, ordered by their depth in the pixel, then
/// index; at most the kMaxLayers nearest. Back faces are seen of double-sided materials only. A sample on an
/// edge that two triangles share belongs to one of them. Triangles without area, and those with a corner that
/// is not finite, are not seen. Same bits on every machine and for any thread count.
/// `bands`: by kBandPx rows, 0 = nothing is looked at, as if nothing were there; empty: everything is.
/// std::invalid_argument for a side of 0 or above 8192, a camera that is not finite, and indices of the scene
/// beyond their tables, and for bands of another number.
Visibility look(const RenderScene& scene, const RenderCamera& camera, std::uint32_t side_px,
                const RunContext& context, std::span<const std::uint8_t> bands = {});

}  // namespace texmesh
