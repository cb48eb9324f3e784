#pragma once
#include "format/fields.h"
#include "format/tables.h"
#include "stages/lut.h"
#include "stages/perceptual_values.h"
#include "stages/simplification.h"

namespace texmesh {

inline constexpr int kQualityVersion = 1;

struct QualityOptions {
  int views = 4;           // fixed directions, spread over the sphere
  int size_px = 192;       // of a rendered view
  int rung_samples = 4;    // rungs that are rendered, spread over the ladder
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("views", s.views, Range{1, 64}, "directions from which every sample is rendered");
    v("size_px", s.size_px, Range{32, 2048}, "side of a rendered view");
    v("rung_samples", s.rung_samples, Range{1, 16}, "rungs that are rendered, spread over the ladder");
  }
};

/// Renders kept scales x sampled rungs from fixed views (base colour times a fixed head-light; Embree on one fixed
/// instruction set) and compares them with S_0 and the source's texture over covered pixels: SSIM of luma and a
/// FLIP-like colour difference. Untextured models get one column (rung quality 100).
QualityTable measure_quality(const NestedScales& scales, const PerceptualValues& perceptual,
                             const std::vector<Material>& materials, const Fragments& fragments,
                             const std::vector<Pixels>& pixels, const Ladder& ladder, const QualityOptions& options,
                             const RunContext& context);

}  // namespace texmesh
