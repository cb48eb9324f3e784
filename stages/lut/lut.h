#pragma once
#include "format/documents/tables.h"
#include "format/documents/thesis_tables.h"
#include "stages/data/fragments.h"
#include "stages/data/ladder.h"
#include "stages/data/perceptual_values.h"
#include "stages/data/pixels.h"
#include "stages/data/previews.h"
#include "stages/data/stage.h"

namespace texmesh {

inline constexpr int kLutVersion = 10;

enum class Allocation : std::uint8_t { kThesis, kLog, kRd, kVqp };
template <>
struct EnumNames<Allocation> {
  static constexpr std::array<std::string_view, 4> names{"thesis", "log", "rd", "vqp"};
};

/// What gives a scale its default quality Q_i, between quality_coarse and quality_fine. kDistance: the
/// viewing distance (8.3), which is the scale's number where scales are mapped over distance (7.5).
/// kFeatures: the number of its feature points (chapter 4) over S_0's.
enum class DefaultQuality : std::uint8_t { kDistance, kFeatures };
template <>
struct EnumNames<DefaultQuality> {
  static constexpr std::array<std::string_view, 2> names{"distance", "features"};
};

struct LutOptions {
  Allocation allocate = Allocation::kLog;
  DefaultQuality default_quality = DefaultQuality::kDistance;
  double quality_fine = 80, quality_coarse = 40;  // Q_i of S_0, and what it falls to
  double quality_width = 60;                      // dQ of (3.2)
  double log_width = 0.42;                        // dg of the log-quantiser form
  double quality_min = 5, quality_max = 97;       // q_i is clipped to them
  double normal_quality_min = 30, data_quality_min = 18, alpha_quality_min = 18;  // beside quality_min
  static void fields(auto& s, auto&& v) {
    v("allocate", s.allocate, ProfileOnly{},
      "how bytes are shared among fragments: thesis = equation 3.2 in quality; vqp = the same by VQP (8.4) in "
      "the place of feature density; log = the same in the "
      "logarithm of the quantiser; rd = the bytes of log, spent where they save most visible error (1 - "
      "SSIM x surface)");
    v("default_quality", s.default_quality, ProfileOnly{},
      "what gives Q_i between quality_coarse and quality_fine: distance = the scale's number, which is its "
      "distance (7.5, 8.3); features = its number of feature points over S_0's (chapter 4)");
    v("quality_fine", s.quality_fine, Range{1, 100}, ProfileOnly{}, "Q_i asked for at S_0");
    v("quality_coarse", s.quality_coarse, Range{1, 100}, ProfileOnly{},
      "Q_i asked for at the coarsest scale, and where no feature points are left");
    v("quality_width", s.quality_width, Range{0, 100}, ProfileOnly{},
      "dQ: how far feature density moves the quality");
    v("log_width", s.log_width, Range{0, 4}, ProfileOnly{},
      "dg: how far feature density moves the logarithm of the quantiser; below 0.6 by at most one of the "
      "default rungs");
    v("quality_min", s.quality_min, Range{1, 100}, ProfileOnly{}, "no fragment is asked to be worse");
    v("normal_quality_min", s.normal_quality_min, Range{1, 100}, ProfileOnly{},
      "least quality asked for in normal maps; quality_min where that is more, quality_max where that is "
      "less");
    v("data_quality_min", s.data_quality_min, Range{1, 100}, ProfileOnly{},
      "as normal_quality_min, for occlusion, roughness, metalness and other data");
    v("alpha_quality_min", s.alpha_quality_min, Range{1, 100}, ProfileOnly{},
      "as normal_quality_min, for alpha channels");
    v("quality_max", s.quality_max, Range{1, 100}, ProfileOnly{}, "no fragment is asked to be better");
  }
};

/// Of all scales of the chain, by scale number; stage package takes the rows of those that it stores.
struct LutTables {
  PackageTables tables;
  ThesisTables thesis;
};

/// Quality and size of every fragment (thesis 3.3, 8.4). Streams are decoded again for it.
/// - Per rung and fragment: the exact bytes, the digest, MSE and 1 - SSIM over covered texels, of luma, or of
///   every channel of data.
/// - Per fragment 1 - SSIM of the preview, scaled up bilinearly, for where no rung is shown.
/// - The order of falling importance: eta of scale 0, with `allocate = vqp` VQP, then surface, then index.
/// - Q_i, and for the thesis D_i over 21 values of Gamma: bytes of the fragments' streams, table streams not
///   counted. With `allocate = rd` they are the bytes of log, which rungs_of() spends.
/// - For the thesis the predictors, and the size models.
/// `pixels` are fill_planes()'s, `previews` make_previews()'s. Throws StageError for parts that do not fit
/// each other, FormatError for a stream that does not decode. Same result for any thread count.
LutTables build_tables(const Fragments& fragments, const std::vector<Pixels>& pixels,
                       const Predictors& predictors, const Ladder& ladder, const Previews& previews,
                       const LutOptions& options, const RunContext& context);

/// The size model (thesis 8.5 to 8.8) of every fragment of a plane whose sizes, qualities and order are
/// there: S = A R^Q by least squares on ln S over the rungs, Q = quality / 100, and R = (100 p)^B for the
/// fragment's VQP p. The rung of a source's coefficients never takes part: its bytes are not a quality's.
/// [F]; all 0 for fragments that are not stored, whose p is below kLeastModelVqp, or whose bytes do not grow,
/// and for fewer than two rungs. `vqp` [F] are the plane's.
std::vector<SizeModel> fit_size_models(const PlaneLadder& ladder, const PlaneTables& tables,
                                       const std::vector<float>& vqp);

}  // namespace texmesh
