#pragma once
// Inputs of the fragmentation stage, for its tests.
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "stages/base/run_context.h"
#include "stages/fragmentation/fragmentation.h"

namespace texmesh::testing {

inline ConditionedMesh conditioned(Mesh mesh) {
  ConditionedMesh out;
  out.twin.resize(mesh.positions.size());
  std::iota(out.twin.begin(), out.twin.end(), 0u);
  out.mesh = std::move(mesh);
  return out;
}

inline Image image_of(std::uint32_t w, std::uint32_t h, std::uint8_t channels = 3) {
  Image image;
  image.name = "image";
  image.width_px = w;
  image.height_px = h;
  image.channels = channels;
  image.bits_per_channel = 8;
  return image;
}

inline ScaleMap scale_map(const Mesh& mesh, int scales = 3) {
  ScaleMap out;
  out.scales = scales;
  for (std::size_t p = 0; p < mesh.positions.size(); ++p)
    out.crossing.push_back(static_cast<std::uint8_t>(p % static_cast<std::size_t>(scales + 1)));
  return out;
}

inline Material with_base(int image) {
  Material m;
  m.base_colour_texture.image = image;
  return m;
}

inline Fragments run_fragmentation(const ConditionedMesh& mesh, const std::vector<Material>& materials,
                                   const std::vector<Image>& images, int threads = 1,
                                   FragmentationOptions options = {}) {
  RunContext context;
  context.threads = threads;
  return fragment_textures(mesh, materials, images, scale_map(mesh.mesh), options, context);
}

inline double total(const std::vector<float>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

}  // namespace texmesh::testing
