#include "lab/study/covered_plane.h"

#include "stages/data/coverage.h"

namespace texmesh {

TexturePlane covered_plane(std::uint32_t columns, std::uint32_t rows, std::uint32_t fragment_width_px,
                           std::uint32_t fragment_height_px) {
  TexturePlane plane;
  plane.columns = columns, plane.rows = rows;
  plane.fragment_width_px = fragment_width_px, plane.fragment_height_px = fragment_height_px;
  plane.width_px = columns * fragment_width_px, plane.height_px = rows * fragment_height_px;
  plane.coverage.assign(coverage_size_bytes(plane.width_px, plane.height_px), 0xff);
  const std::size_t count = plane.fragment_count();
  plane.covered_texels.assign(count, fragment_width_px * fragment_height_px);
  plane.surface_fraction.assign(count, 1.0f / static_cast<float>(count));
  plane.features.assign(count, 0);
  plane.eta.assign(count, 0);
  return plane;
}

}  // namespace texmesh
