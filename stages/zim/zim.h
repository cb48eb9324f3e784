#pragma once

#include "stages/data/fragments.h"
#include "stages/data/perceptual_values.h"
#include "stages/data/pixels.h"
#include "stages/data/stage.h"

namespace texmesh {

inline constexpr int kZimVersion = 3;

struct ZimOptions {
  int difference = 24;  // neighbours that differ by this in any channel count as different
  static constexpr double weight_intensity = 0.5, weight_complexity = 0.5;  // of M (8.3)
  double weight_eta = 1, weight_z = 1, weight_i = 1, weight_m = 1;  // of VQP (8.4), relative to their sum
  static void fields(auto& s, auto&& v) {
    v("difference", s.difference, Range{1, 255}, ProfileOnly{},
      "neighbouring texels that differ by this in any channel count as different");
    v("weight_eta", s.weight_eta, Range{0, 100}, ProfileOnly{},
      "weight of feature density in VQP, relative to the others");
    v("weight_z", s.weight_z, Range{0, 100}, ProfileOnly{}, "weight of Z, the deviation of colours, in VQP");
    v("weight_i", s.weight_i, Range{0, 100}, ProfileOnly{}, "weight of I, the intensity, in VQP");
    v("weight_m", s.weight_m, Range{0, 100}, ProfileOnly{}, "weight of M, the masking, in VQP");
  }
};

/// Z, I, M (thesis 8.1 to 8.3) and VQP (8.4) of every fragment. `pixels` are fill_planes()'s. Throws
/// StageError when they do not fit and when no weight of VQP is above 0. Same result for any thread count.
Predictors predict_quality(const Fragments& fragments, const std::vector<Pixels>& pixels,
                           const ZimOptions& options, const RunContext& context);

/// The thesis's picture of zeta (Fig. 8.3), row by row over the plane: 1 where a covered texel differs from
/// its east or south neighbour in the same fragment, else 0. `pixels` are the plane's. StageError as above.
std::vector<std::uint8_t> differing_texels(const TexturePlane& plane, const Pixels& pixels,
                                           const ZimOptions& options);

}  // namespace texmesh
