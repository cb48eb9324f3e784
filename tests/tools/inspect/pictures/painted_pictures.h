#pragma once
// A ball to paint, and what painted models look like as files.
#include "stages/condition/condition.h"
#include "stages/gltf/check_glb.h"
#include "stages/image/decode_image.h"
#include "tests/support/meshes.h"
#include "tools/inspect/pictures/painted_model.h"

namespace texmesh::testing {

inline ConditionedMesh ball() { return condition_mesh(sphere(12, 18), false, {}, {}); }

inline std::string faults(const Bytes& glb) {
  Findings findings;
  check_glb(glb, "painted.glb", findings);
  std::string text;
  for (const Finding& f : findings.release()) text += to_string(f) + "\n";
  return text;
}

inline Pixels picture_of(const PaintedModel& view, std::uint32_t side = 64) {
  return decode_image(probe_image("painted.png", write_painted_png(view, side), {}));
}

/// How many pixels of the picture have about this colour.
inline int count_near(const Pixels& p, Srgb colour, int tolerance = 40) {
  int count = 0;
  for (std::uint32_t y = 0; y < p.height_px; ++y)
    for (std::uint32_t x = 0; x < 2 * p.height_px; ++x) {
      bool near = true;
      for (std::size_t k = 0; k < 3; ++k) near = near && std::abs(p.at(x, y)[k] - colour[k]) <= tolerance;
      count += near;
    }
  return count;
}

}  // namespace texmesh::testing
