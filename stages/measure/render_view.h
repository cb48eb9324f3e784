#pragma once
#include <cstdint>
#include <vector>

#include "format/model/model.h"
#include "stages/measure/image_compare.h"

namespace texmesh {

/// An orthographic camera that looks along -z at a sphere of radius `radius` around `centre`.
struct ViewCamera {
  Vec3d x, y, z;  // unit; x right, y up, z towards the viewer
  Vec3d centre;
  double radius = 1;
};
/// View `index` of `count` directions spread evenly over the sphere, the same for every model.
ViewCamera camera_of(int index, int count, Vec3d centre, double radius);

/// A texture in linear light, prefiltered: level l has sides ceil(width / 2^l).
struct MipTexture {
  struct Level {
    std::uint32_t width = 0, height = 0;
    std::vector<Vec3f> texels;
  };
  std::uint32_t width_px = 0, height_px = 0;  // of level 0, which may not be kept
  std::uint32_t first_level = 0;
  std::vector<Level> levels;  // first_level, first_level + 1, ... 1 x 1
};
/// Makes the further levels of the chain from its first level, which must be there.
void build_mips(MipTexture& texture);

/// One sample of a view: where it lies and what to look up; independent of the texture's content.
struct ViewSample {
  std::uint32_t pixel = 0;
  std::int32_t base_plane = -1, emissive_plane = -1;  // index into the textures that draw() gets, -1 = none
  Vec2f base_uv, emissive_uv;              // texel units of the level / its size: 0..1 inside the image
  float base_area = 0, emissive_area = 0;  // footprint, texels of level 0
  bool base_repeat_s = true, base_repeat_t = true, emissive_repeat_s = true, emissive_repeat_t = true;
  Vec3f factor, emission;  // multiply the textures
};

/// What a view shows of a mesh. 2 x 2 samples a pixel.
struct ViewBuffer {
  std::uint32_t side_px = 0;
  std::vector<ViewSample> samples;  // the samples that hit, in raster order
  std::vector<std::uint8_t> hits;   // per pixel: 0..4
};

/// `base_plane` and `emissive_plane`: per material, the texture it samples, -1 = none. `sizes`: sides of
/// those textures.
struct ViewScene {
  const Mesh* mesh = nullptr;
  const std::vector<Triangle>* triangles = nullptr;
  const std::vector<std::uint32_t>* triangle_source = nullptr;  // indexes mesh->triangle_material
  const std::vector<Material>* materials = nullptr;
  std::vector<std::int32_t> base_plane, emissive_plane;
  std::vector<Vec2<std::uint32_t>> sizes;
};

ViewBuffer look_at(const ViewScene& scene, const ViewCamera& camera, std::uint32_t side_px);
Picture draw(const ViewBuffer& view, const std::vector<MipTexture>& textures);

}  // namespace texmesh
