#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "format/base/sha256.h"

namespace texmesh {

/// Tables of one texture plane. F = columns * rows fragments (row by row from the top left), R rungs (rising
/// quality, rung 0 here is the lowest stored one; "skipped" has no entry), N = scales + 1 feature scales.
struct PlaneTables {
  std::uint32_t columns = 0, rows = 0;
  std::uint32_t scales = 0;  // N - 1
  bool incremental = false;  // a rung's streams continue those of the rungs below (CodecTraits::incremental)
  std::vector<std::uint8_t> rung_quality;  // [R], IJG quality, strictly rising
  std::vector<std::uint32_t> table_bytes;  // [R]: size of the rung's table stream
  // [R * F], index rung * F + fragment; 0 where the fragment is not stored:
  std::vector<std::uint32_t> size_bytes;  // of the abbreviated stream, exact
  std::vector<std::uint64_t> digest;      // first 8 bytes of the stream's SHA-256, as a big-endian number
  // over covered texels of luma (8-bit scale, 0..65025) | 1 - SSIM (0..2); stored as IEEE binary16:
  std::vector<float> mse, dssim;
  // [F]:
  std::vector<std::uint32_t> covered_texels;
  std::vector<float> surface_fraction;    // of the object's surface
  std::vector<float> z, i, zeta, m, vqp;  // 0..1, stored as multiples of 1 / 65535
  std::vector<std::uint16_t>
      order;  // fragments that are stored, by falling importance (eta_0, surface, index)
  // [F], 1 - SSIM when the preview stands for the fragment, binary16; empty: format 1.0 did not say
  std::vector<float> skip_dssim;
  // Where sizes between two rungs are (format 1.1; empty: not measured): whole qualities that lie between
  // rungs, strictly rising, and the part of the way from the rung below to the one above that the bytes have
  // gone there, 0..1, not falling between two rungs, stored as multiples of 1 / 65535
  std::vector<std::uint8_t> knot_quality;
  std::vector<float> knot_position;
  // [N * F], index scale * F + fragment:
  std::vector<std::uint32_t> features;  // f_i < 2^24
  // [N]:
  std::vector<float> quality;  // Q_i
  // [N * 21]: D_i(Gamma), Gamma = 0, 0.05 .. 1: bytes of the plane at the rungs nearest to q_i(x, y)
  std::vector<std::uint64_t> total_bytes;
  // 0 thesis (3.2), 1 log-quantiser, 2 rate-distortion within the bytes of 1; with the widths and clip used:
  std::uint8_t allocation = 1;
  float quality_width = 60, log_width = 0.7f, quality_min = 5, quality_max = 97;
  // Size model S = A R^Q + c with exponent B from (8.8), fitted over the plane's rungs (thesis 8.6-8.8)
  float model_a = 0, model_b = 0, model_r = 0, model_correlation = 0,
        model_error = 0;  // error: mean |S' - S| / S

  std::size_t fragment_count() const { return static_cast<std::size_t>(columns) * rows; }
  std::size_t rung_count() const { return rung_quality.size(); }
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.columns, s.rows, s.scales, s.incremental, s.rung_quality, s.table_bytes, s.size_bytes, s.digest,
      s.mse, s.dssim, s.covered_texels, s.surface_fraction, s.z, s.i, s.zeta, s.m, s.vqp, s.order,
      s.skip_dssim, s.knot_quality, s.knot_position, s.features, s.quality, s.total_bytes, s.allocation,
      s.quality_width, s.log_width, s.quality_min, s.quality_max, s.model_a, s.model_b, s.model_r,
      s.model_correlation, s.model_error);
  }
};

/// What a client must have of a fragment to show it at a rung: the rung's stream, with incremental tables
/// those below it, too. 0 when it is not stored there.
std::uint64_t bytes_to_show(const PlaneTables& tables, std::size_t rung, std::size_t fragment);
/// eta_i (3.1) of one scale: feature counts min-max over covered fragments; 0 for the others.
std::vector<float> eta_of(const PlaneTables& tables, std::uint32_t scale);
/// q_i(x, y): the quality that the tables' allocation asks for (3.2, or its log-quantiser form), clipped.
/// Gamma in 0..1; the default Gamma is the mean of eta over covered fragments. With allocation 2 these are
/// the qualities whose bytes, D_i(Gamma), rungs_of() then spends better.
std::vector<float> quality_of(const PlaneTables& tables, std::uint32_t scale, double gamma);
double mean_eta(const PlaneTables& tables, std::uint32_t scale);
/// g(Q) = -ln(IJG's scale of the quantisers): grows with quality, by ln 2 where the quantisers halve.
double log_quantiser(double quality);
/// Index of the rung whose quality is nearest in log-quantiser space (ties: the lower).
std::uint32_t nearest_rung(const PlaneTables& tables, double quality);

/// A fragment that shows the preview instead of a rung of its own.
inline constexpr std::int16_t kSkipped = -1;
/// The rung of every fragment at a scale and Gamma: nearest to q_i(x, y), or with allocation 2 what
/// allocate_rd() buys for D_i(Gamma). kSkipped for fragments that are not stored.
std::vector<std::int16_t> rungs_of(const PlaneTables& tables, std::uint32_t scale, double gamma);
/// d_i(x, y) of such a choice, and the sum of it.
std::vector<std::uint32_t> bytes_of(const PlaneTables& tables, const std::vector<std::int16_t>& rungs);
std::uint64_t sum_of(const std::vector<std::uint32_t>& bytes);
/// Mean of 1 - SSIM over the object's surface for such a choice, by surface_weights(); 0 without a surface.
double surface_dssim(const PlaneTables& tables, const std::vector<std::int16_t>& rungs);

/// What a fragment's quality is worth: its surface fraction, with the area per texel capped at the 99th
/// percentile of all covered texels (a few stretched texels must not take the whole budget). [F]
std::vector<float> surface_weights(const PlaneTables& tables);

/// One fragment as the rate-distortion choice sees it: what each way of showing it costs and loses. Way 0 is
/// skipping (0 bytes); others may stand in any order.
struct RdCurve {
  std::vector<std::uint32_t> bytes;
  std::vector<std::uint64_t> loss;  // same length; at most 2^46, so that differences are exact as doubles
};
/// Per curve the way to show it, so that the sum of losses is least that the convex hulls of the curves allow
/// within the budget: steps along the hulls are taken by falling (loss saved / byte), ties by curve; a step
/// that does not fit ends its curve, others go on. One rounded division per step decides, so that every
/// implementation chooses alike. O(steps log steps).
std::vector<std::uint32_t> spend_bytes(const std::vector<RdCurve>& curves, std::uint64_t budget_bytes);
/// The curves of a plane's stored fragments, in index order. `weights` [F] >= 0 are scaled so that the
/// largest becomes 2^20 units; `share` scales them all (0..1: the plane's own importance beside others).
std::vector<RdCurve> rd_curves(const PlaneTables& tables, const std::vector<float>& weights,
                               double share = 1);
/// The rung of every fragment that loses least surface-weighted (1 - SSIM) for at most `budget_bytes` of
/// fragment streams, skipping included. `weights` default to surface_weights(). Without skip_dssim (format
/// 1.0) a skipped fragment counts as having nothing of the source (1 - SSIM = 1).
std::vector<std::int16_t> allocate_rd(const PlaneTables& tables, std::uint64_t budget_bytes,
                                      const std::vector<float>& weights = {});

/// Bytes that the fragment's stream would have at a quality that no rung has: monotone cubic interpolation of
/// log bytes between the rungs (exact there) along the plane's knots, constant outside them; 0 when it is not
/// stored.
double interpolated_bytes(const PlaneTables& tables, std::size_t fragment, double quality);
/// The knots' positions with which interpolated_bytes() of a stream of `rung_bytes` [R] > 0 at `rung_quality`
/// is `knot_bytes` at `knot_quality`, as far as they lie between those of the rungs around them. Where these
/// do not rise the knots lie as without any. Same bits everywhere.
std::vector<float> knot_positions(const std::vector<std::uint8_t>& rung_quality,
                                  const std::vector<double>& rung_bytes,
                                  const std::vector<std::uint8_t>& knot_quality,
                                  const std::vector<double>& knot_bytes);

struct PackageTables {
  std::vector<PlaneTables> planes;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.planes);
  }
};

/// tables.bin, see SPEC.md. The reader checks magic, version, every count against the bytes, and every
/// value's range, and throws FormatError. write(read(x)) == x; values that the file stores in 16 bits are
/// rounded by the writer.
std::vector<std::uint8_t> write_tables(const PackageTables& tables);
PackageTables read_tables(std::span<const std::uint8_t> bytes);
/// The head alone tells where each plane's section stands, so that a client can read one plane by a range.
struct TablesSection {
  std::uint64_t offset = 0, bytes = 0;  // within tables.bin
  Sha256 digest{};
};
struct TablesHead {
  int minor = 0;
  std::uint64_t bytes = 0;  // of the head itself
  std::vector<TablesSection> planes;
};
TablesHead read_tables_head(std::span<const std::uint8_t> bytes);  // `bytes` may stop after the head
PlaneTables read_tables_section(const TablesHead& head, std::size_t plane,
                                std::span<const std::uint8_t> section);

/// Measured quality of scale x rung samples: quality.json.
struct QualityTable {
  std::vector<int> scales;        // scale numbers, rising (0 = S_0)
  std::vector<int> rungs;         // IJG qualities, rising; {100} for untextured models
  std::vector<float> ssim;        // [scale index * rungs + rung index], 0..1, 1 = equal
  std::vector<float> difference;  // FLIP-like mean colour difference, 0..1, 0 = equal
  std::uint32_t views = 0, size_px = 0;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.scales, s.rungs, s.ssim, s.difference, s.views, s.size_px);
  }
  friend bool operator==(const QualityTable&, const QualityTable&) = default;
};

std::string write_quality(const QualityTable& table);           // canonical JSON
QualityTable read_quality(std::span<const std::uint8_t> json);  // strict; FormatError

}  // namespace texmesh
