#pragma once
#include <string_view>
#include <vector>

#include "format/fields.h"
#include "format/tables.h"
#include "stages/fragmentation.h"
#include "stages/ladder.h"
#include "stages/zim.h"

namespace texmesh {

inline constexpr int kLutVersion = 1;

enum class Allocation : std::uint8_t { kThesis, kLog };
template <>
struct EnumNames<Allocation> {
  static constexpr std::array<std::string_view, 2> names{"thesis", "log"};
};

struct LutOptions {
  Allocation allocate = Allocation::kLog;
  double quality_fine = 80, quality_coarse = 40;   // Q_i falls linearly from S_0 to S_max
  double quality_width = 60;                       // dQ of (3.2)
  double log_width = 0.7;                          // dg of the log-quantiser form
  double quality_min = 5, quality_max = 97;        // clip
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("allocate", s.allocate, "thesis = equation 3.2 in quality; log = the same in the logarithm of the quantiser");
    v("quality_fine", s.quality_fine, Range{1, 100}, "Q_i asked for at S_0");
    v("quality_coarse", s.quality_coarse, Range{1, 100}, "Q_i asked for at the coarsest scale");
    v("quality_width", s.quality_width, Range{0, 100}, "dQ: how far feature density moves the quality");
    v("log_width", s.log_width, Range{0, 4}, "dg: how far feature density moves the logarithm of the quantiser");
    v("quality_min", s.quality_min, Range{1, 100}, "no fragment is asked to be worse");
    v("quality_max", s.quality_max, Range{1, 100}, "no fragment is asked to be better");
  }
};

/// Quality and size tables (thesis 3.3, 8.4): exact bytes and measured distortion (MSE and 1 - SSIM of luma or grey
/// over covered texels) per rung and fragment, the digest of every stored stream, q_i and the nearest rung, d_i, D_i
/// over 21 values of Gamma, the size model A, B, R, and the order of falling importance.
PackageTables build_tables(const Fragments& fragments, const std::vector<Pixels>& pixels, const Predictors& predictors,
                           const Ladder& ladder, const LutOptions& options, const RunContext& context);

}  // namespace texmesh
