#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "stages/measure/atlas/atlas_figures.h"

namespace texmesh {

/// An atlas as it is laid out, row by row from the top.
struct AtlasMap {
  std::uint32_t width_px = 0, height_px = 0;
  std::vector<std::uint32_t>
      chart;  // AtlasReport::charts; the last triangle's where several lie; kNoIndex = none
  std::vector<std::uint8_t> layers;  // triangles over the texel's centre; 2 = two or more
};

/// The map of an atlas of `report`, which measure_atlases() made of the same mesh, materials and images.
/// Sides are the image's, halved until the longer one is at most most_side_px (1 and more).
AtlasMap map_atlas(const Mesh& mesh, const std::vector<Material>& materials,
                   std::span<const AtlasImage> images, const AtlasReport& report, std::size_t atlas,
                   std::uint32_t most_side_px, const RunContext& context);

}  // namespace texmesh
