#pragma once
// Inside the room only: directions as places of a square (Cigolle et al. 2014).
#include "format/base/vec.h"

namespace texmesh::render {

/// -1..1 in both; |x| + |y| > 1 is the lower half, y < 0. The vector need not be unit; of no direction the
/// place is the middle.
inline Vec2f octahedral(Vec3f d) {
  auto size = [](float v) { return v < 0 ? -v : v; };
  const float sum = size(d.x) + size(d.y) + size(d.z);
  const float scale = sum > 0 ? 1 / sum : 0;
  const float x = d.x * scale, y = d.z * scale;
  if (d.y >= 0) return {x, y};
  return {(1 - size(y)) * (x < 0 ? -1.f : 1.f), (1 - size(x)) * (y < 0 ? -1.f : 1.f)};
}

/// The reverse, unit. Places up to 1 beyond a border are those on the other side of the same edge.
inline Vec3f octahedral_direction(Vec2f place) {
  auto size = [](float v) { return v < 0 ? -v : v; };
  float x = place.x, y = place.y;
  if (size(x) > 1) x = (x < 0 ? -2.f : 2.f) - x, y = -y;
  if (size(y) > 1) y = (y < 0 ? -2.f : 2.f) - y, x = -x;
  const float up = 1 - size(x) - size(y);
  if (up >= 0) return normalized(Vec3f{x, up, y});
  return normalized(Vec3f{(1 - size(y)) * (x < 0 ? -1.f : 1.f), up, (1 - size(x)) * (y < 0 ? -1.f : 1.f)});
}

}  // namespace texmesh::render
