#pragma once
#include <string>
#include <vector>

#include "stages/data/fragments.h"
#include "stages/data/pixels.h"
#include "stages/data/predictors.h"
#include "stages/data/stage.h"
#include "stages/zim/predictors.h"

namespace texmesh {

inline constexpr int kZimVersion = 2;

struct ZimOptions {
  int difference = 24;  // neighbours that differ by this in any channel count as different
  double weight_intensity = 0.5, weight_complexity = 0.5;  // of M (8.3)
  std::string weights = "eta=1,z=1,i=1,m=1";               // of VQP (8.4), scaled to sum 1; parse_weights()
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("difference", s.difference, Range{1, 255},
      "neighbouring texels that differ by this in any channel count as different");
    v("weight_intensity", s.weight_intensity, Range{0, 1}, "weight of (1 - I) in the masking predictor M");
    v("weight_complexity", s.weight_complexity, Range{0, 1}, "weight of zeta in the masking predictor M");
    v("weights", s.weights,
      "weights of VQP's predictors, NAME=WEIGHT,...: eta (feature density), z (colour deviation), i "
      "(intensity), "
      "m (masking), zeta (neighbours that differ), area (covered share), surface (share of the object's), "
      "gradient (mean difference of neighbours)");
  }
};

/// `pixels` are fill_planes()'s. Throws StageError when they do not fit, and as parse_weights() does. Same
/// result for any thread count. `registry` is where the names of the weights come from: a program that links
/// stages may add its own.
Predictors predict_quality(const Fragments& fragments, const std::vector<Pixels>& pixels,
                           const ZimOptions& options, const RunContext& context,
                           const PredictorRegistry& registry = PredictorRegistry::standard());

}  // namespace texmesh
