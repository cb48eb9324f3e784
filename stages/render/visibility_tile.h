#pragma once
// Inside the room only: what is seen in one square of a picture. A camera sees triangles in homogeneous
// coordinates (Olano and Greer 1997), so that nothing has to be cut at the near plane.
#include "stages/render/visibility.h"

namespace texmesh {

/// Places of a picture in samples from its middle, x to the right and y down.
struct SampleFrame {
  double half = 0;   // samples from the middle to a side
  double pitch = 0;  // of a sample at distance 1
  explicit SampleFrame(const RenderCamera& camera, std::uint32_t side_px)
      : half(side_px * (kSamplesPerSide * 0.5)), pitch(camera.tan_half_fov / half) {}
};

/// Homogeneous positions: a point is seen at (x / w, y / w) of the frame, w in front of the eye.
inline Vec3d seen_from(const RenderCamera& camera, const SampleFrame& frame, Vec3f position) {
  const Vec3d d = to_double(position) - camera.eye;
  return {dot(d, camera.x) / frame.pitch, -dot(d, camera.y) / frame.pitch, -dot(d, camera.z)};
}

/// value(x, y) = a x + b y + c
struct EdgePlane {
  double a = 0, b = 0, c = 0;
  double at(double x, double y) const { return a * x + (b * y + c); }
};

/// Positive on the side of the edge where the triangle lies. Two triangles that share an edge, one beside the
/// other, see it with exactly opposite numbers: every operation keeps its value when the signs change. So no
/// sample falls between them.
struct EdgePlanes {
  std::array<EdgePlane, 3> edge;  // opposite to corner k: its weight, but for a common factor
  EdgePlane nearness;             // 1 / w
  bool front = false;
  bool visible = false;  // has an area and is finite
};
inline EdgePlanes edge_planes(const std::array<Vec3d, 3>& corner) {
  EdgePlanes out;
  const Vec3d normal[3] = {cross(corner[1], corner[2]), cross(corner[2], corner[0]),
                           cross(corner[0], corner[1])};
  // Of differences: small triangles keep their digits.
  const Vec3d face = cross(corner[1] - corner[0], corner[2] - corner[0]);
  const double volume = dot(corner[0], face);
  const double inverse = volume != 0 ? 1 / volume : 0;
  if (volume == 0 || !std::isfinite(volume) || !std::isfinite(inverse)) return out;
  out.visible = true;
  out.front = volume < 0;  // corners counter-clockwise, y down
  const double sign = volume < 0 ? -1 : 1;
  for (std::size_t k = 0; k < 3; ++k)
    out.edge[k] = {normal[k].x * sign, normal[k].y * sign, normal[k].z * sign};
  out.nearness = {face.x * inverse, face.y * inverse, face.z * inverse};
  return out;
}

/// Bits of a mask. Without the instruction, which not every processor has, std::popcount is a call.
constexpr int sample_count(std::uint16_t mask) {
  unsigned n = mask;
  n = (n & 0x5555u) + (n >> 1 & 0x5555u);
  n = (n & 0x3333u) + (n >> 2 & 0x3333u);
  n = (n + (n >> 4)) & 0x0F0Fu;
  return static_cast<int>((n + (n >> 8)) & 0x1Fu);
}

/// The mean column and row, 0..3, of the samples of a mask that is not 0.
inline Vec2d mean_of_samples(std::uint16_t mask) {
  auto count = [mask](unsigned bits) { return sample_count(static_cast<std::uint16_t>(mask & bits)); };
  const double columns = count(0xAAAAu) + 2 * count(0xCCCCu), rows = count(0xF0F0u) + 2 * count(0xFF00u);
  const double samples = sample_count(mask);
  return {columns / samples, rows / samples};
}

/// Whether a sample just on the edge belongs to the triangle: of two neighbours to one.
inline bool owns_edge(const EdgePlane& edge) { return edge.a > 0 || (edge.a == 0 && edge.b > 0); }

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
