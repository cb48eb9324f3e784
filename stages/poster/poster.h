#pragma once

#include "stages/data/fragments.h"
#include "stages/data/nested_scales.h"
#include "stages/data/pixels.h"
#include "stages/data/previews.h"
#include "stages/data/stage.h"

namespace texmesh {

inline constexpr int kPosterVersion = 5;

struct PosterOptions {
  int size_px = 512;
  int max_bytes = 40000;
  static void fields(auto& s, auto&& v) {
    v("size_px", s.size_px, Range{0, 4096},
      "side of the poster, the picture of the object for lists and search engines; 0 = no poster");
    v("max_bytes", s.max_bytes, Range{1000, 1000000}, ProfileOnly{}, "most bytes of the poster's JPEG");
  }
};

/// A picture of S_0 with the source's texels by the reference renderer (stages/render), in the light that
/// viewers have, on grey.
/// - View: the direction that viewers begin with, or one that shows much more of the object's area.
/// Directions
///   near the front, a little from above, count more than those from high above, from behind and from below.
/// - Frame: a square, in which the object has the size and place that it has in viewers
/// (kFirstLookFovDegrees).
///   Where strays make the object tiny, the picture shows the place in which nearly all positions lie.
/// - File: 4:2:0, the highest quality (IJG) that fits `max_bytes`. Where not even quality 1 fits, the sides
///   are halved.
/// An object of which nothing is seen gives a picture of the background. `pixels` are fill_planes()'s.
/// StageError for pixels that do not fit the planes. Same bytes for any thread count and machine.
Poster make_poster(const NestedScales& scales, const std::vector<Material>& materials,
                   const Fragments& fragments, const std::vector<Pixels>& pixels,
                   const PosterOptions& options, const RunContext& context);

}  // namespace texmesh
