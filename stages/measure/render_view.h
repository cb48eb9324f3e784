#pragma once
#include <cstdint>
#include <vector>

#include "format/model/model.h"
#include "stages/measure/image_compare.h"

namespace texmesh {

/// An orthographic camera. It looks along -z at the sphere of radius `radius` around `centre`.
struct ViewCamera {
  Vec3d x, y, z;  // unit vectors: x to the right, y up, z towards the viewer
  Vec3d centre;
  double radius = 1;
};
/// The camera of view `index`, 0 <= index < count. The `count` directions are spread evenly over the sphere.
/// The directions are the same for every model.
ViewCamera camera_of(int index, int count, Vec3d centre, double radius);

/// A prefiltered texture in linear light. Level l has ceil(width_px / 2^l) by ceil(height_px / 2^l) texels.
struct MipTexture {
  struct Level {
    std::uint32_t width = 0, height = 0;
    std::vector<Vec3f> texels;
  };
  std::uint32_t width_px = 0, height_px = 0;  // of level 0, whether it is kept or not
  std::uint32_t first_level = 0;              // the finest level that is kept
  std::vector<Level> levels;                  // first_level, first_level + 1, ... 1 x 1
};
/// Appends the coarser levels. levels[0] must be there.
void build_mips(MipTexture& texture);

/// One sample of a view: the pixel, and what the sample looks up in textures. The texels themselves play no
/// part.
struct ViewSample {
  std::uint32_t pixel = 0;
  std::int32_t base_plane = -1, emissive_plane = -1;  // indices of draw()'s textures, -1 = none
  Vec2f base_uv, emissive_uv;                         // 0..1 inside the image
  float base_area = 0, emissive_area = 0;             // area of the sample's footprint in texels of level 0
  bool base_repeat_s = true, base_repeat_t = true, emissive_repeat_s = true, emissive_repeat_t = true;
  Vec3f factor, emission;  // factors of the base colour and of the emission
};

/// What a view shows of a mesh, with 2 x 2 samples per pixel.
struct ViewBuffer {
  std::uint32_t side_px = 0;        // the view is a square
  std::vector<ViewSample> samples;  // the samples that hit the mesh, in raster order
  std::vector<std::uint8_t> hits;   // for each pixel, how many of its samples hit the mesh: 0..4
};

/// A mesh with its materials and the sizes of its textures.
struct ViewScene {
  const Mesh* mesh = nullptr;
  const std::vector<Triangle>* triangles = nullptr;
  const std::vector<std::uint32_t>* triangle_source = nullptr;  // indexes mesh->triangle_material
  const std::vector<Material>* materials = nullptr;
  std::vector<std::int32_t> base_plane, emissive_plane;  // for each material, its texture's index, -1 = none
  std::vector<Vec2<std::uint32_t>> sizes;                // width and height of each texture in px
};

/// Finds what each sample of a view of side_px by side_px pixels hits.
ViewBuffer look_at(const ViewScene& scene, const ViewCamera& camera, std::uint32_t side_px);
/// The picture of a view. `textures` has an element for each of ViewScene::sizes.
Picture draw(const ViewBuffer& view, const std::vector<MipTexture>& textures);

}  // namespace texmesh
