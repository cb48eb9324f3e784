#pragma once
// Inside the room only: what is seen in one square of a picture.

#include "stages/render/edge_planes.h"

namespace texmesh {

inline constexpr std::uint32_t kTilePx = 32;
inline constexpr std::uint32_t kTileSamples = kTilePx * kSamplesPerSide;

/// Whole samples, the last ones included; empty when last < first.
struct SampleBox {
  std::int32_t x_first = 0, y_first = 0, x_last = -1, y_last = -1;
  bool empty() const { return x_last < x_first || y_last < y_first; }
};

/// What all tiles of a picture read.
struct TileInput {
  const RenderScene* scene = nullptr;
  SampleFrame frame;
  double near = 0;
  std::uint32_t side_px = 0;
  std::vector<Vec3d> seen;       // per position, as seen_from gives it
  std::vector<SampleBox> boxes;  // per triangle; empty for those that are not seen
  bool pairs = true;             // of samples at once, where the processor can: the same bits
  std::array<Vec3d, 3> corners_of(std::uint32_t triangle) const;
};

/// The samples that a triangle may cover; empty when all of it is nearer than `near` or beyond the picture.
SampleBox sample_box(const std::array<Vec3d, 3>& corner, const SampleFrame& frame, double near);

/// The fragments of a tile, pixel after pixel in raster order within it.
struct TileFragments {
  std::vector<std::uint32_t> count;  // [kTilePx * kTilePx]
  std::vector<RenderFragment> fragments;
};

/// `triangles`: all whose box touches the tile, by rising index. (tile_x, tile_y) counts tiles.
TileFragments look_into_tile(const TileInput& input, std::uint32_t tile_x, std::uint32_t tile_y,
                             std::span<const std::uint32_t> triangles);

}  // namespace texmesh
