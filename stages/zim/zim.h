#pragma once
#include <array>
#include <string>

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
  std::string weights = {};                                         // of further predictors
  static void fields(auto& s, auto&& v) {
    v("difference", s.difference, Range{1, 255}, ProfileOnly{},
      "neighbouring texels that differ by this in any channel count as different");
    v("weight_eta", s.weight_eta, Range{0, 100}, ProfileOnly{},
      "weight of feature density in VQP, relative to the others");
    v("weight_z", s.weight_z, Range{0, 100}, ProfileOnly{}, "weight of Z, the deviation of colours, in VQP");
    v("weight_i", s.weight_i, Range{0, 100}, ProfileOnly{}, "weight of I, the intensity, in VQP");
    v("weight_m", s.weight_m, Range{0, 100}, ProfileOnly{}, "weight of M, the masking, in VQP");
    v("weights", s.weights, ProfileOnly{},
      "weights of further predictors in VQP, which the program was built with: NAME=WEIGHT,.. (0 to 100)");
  }
};

/// Sums over the covered texels of one fragment, and over its pairs of covered neighbours, east and south. At
/// most 2^32 texels of 255: squares fit 64 bits.
struct TexelSums {
  std::uint64_t count = 0, pairs = 0, different = 0;
  std::array<std::uint64_t, 3> sum{}, square{};  // per channel
};

/// Reads the fragments of one plane. Plane and pixels outlive it.
class FragmentReader {
 public:
  /// Neighbours that differ by `difference` in any channel count as different.
  FragmentReader(const TexturePlane& plane, const Pixels& pixels, int difference)
      : plane_(plane), mask_(plane), pixels_(pixels), difference_(difference) {}
  const TexturePlane& plane() const { return plane_; }
  const Pixels& pixels() const { return pixels_; }
  TexelSums read(std::size_t fragment) const;
  /// Whether two texels are both covered and differ.
  bool differ(std::uint32_t x, std::uint32_t y, std::uint32_t u, std::uint32_t v) const;

 private:
  void add_texel(std::uint32_t x, std::uint32_t y, TexelSums& out) const;
  void add_pair(std::uint32_t x, std::uint32_t y, std::uint32_t u, std::uint32_t v, TexelSums& out) const;

  const TexturePlane& plane_;
  CoverageMask mask_;
  const Pixels& pixels_;
  int difference_;
};

/// A predictor of quality beside those of the thesis: a finite number for a fragment with covered texels. VQP
/// takes where it stands between the plane's least and largest one. Threads call it at the same time.
using Predictor = double (*)(const FragmentReader& reader, std::size_t fragment);

/// Gives a predictor the name that ZimOptions::weights has: 1 to 32 of a-z, 0-9 and _. It is a static object
/// in the predictor's source file, stages/zim/predictors/NAME.cpp, which the programs link by themselves. One
/// that changes gets another name: keys of caches have the name. Throws std::logic_error for a name that is
/// none or is taken.
struct NamedPredictor {
  NamedPredictor(const std::string& name, Predictor predictor);
};

/// The sum of all weights of VQP. StageError, at "weights" or "weight_eta", for a text that is no list of
/// known predictors with weights from 0 to 100, and where none is above 0.
double vqp_weight_sum(const ZimOptions& options);

/// Z, I, M (thesis 8.1 to 8.3) and VQP (8.4) of every fragment. `pixels` are fill_planes()'s. Throws
/// StageError when they do not fit, for weights that vqp_weight_sum() refuses, and for a further predictor
/// that is not finite. Same result for any thread count.
Predictors predict_quality(const Fragments& fragments, const std::vector<Pixels>& pixels,
                           const ZimOptions& options, const RunContext& context);

/// The thesis's picture of zeta (Fig. 8.3), row by row over the plane: 1 where a covered texel differs from
/// its east or south neighbour in the same fragment, else 0. `pixels` are the plane's. StageError as above.
std::vector<std::uint8_t> differing_texels(const TexturePlane& plane, const Pixels& pixels,
                                           const ZimOptions& options);

}  // namespace texmesh
