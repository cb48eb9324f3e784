#pragma once
#include "format/documents/tables.h"

namespace texmesh {

/// What a client must have of a fragment to show it at a rung: the rung's stream, with incremental tables
/// those below it, too. 0 when it is not stored there.
std::uint64_t bytes_to_show(const PlaneTables& tables, std::size_t rung, std::size_t fragment);
/// Of all fragments.
std::uint64_t bytes_of_rung(const PlaneTables& tables, std::size_t rung);
/// eta_i (3.1) of one scale, by its row in the tables: feature counts min-max over covered fragments; 0 for
/// the others.
std::vector<float> density_of(const PlaneTables& tables, std::size_t row);
/// What quality goes by in the place of eta_i: density_of(), and with allocation 3 VQP (8.4), since 8.3
/// assigns quality by it: that of S_0, which is row 0, with the density of the scale in the place of S_0's.
std::vector<float> eta_of(const PlaneTables& tables, std::size_t row);
/// q_i(x, y): the quality that the tables' allocation asks for (3.2, or its log-quantiser form), clipped.
/// Gamma in 0..1; the default Gamma is the mean of eta over covered fragments. With allocation 2 these are
/// the qualities whose bytes, D_i(Gamma), rungs_of() then spends better.
std::vector<float> quality_of(const PlaneTables& tables, std::size_t row, double gamma);
double mean_eta(const PlaneTables& tables, std::size_t row);
/// g(Q) = -ln(IJG's scale of the quantisers): grows with quality, by ln 2 where the quantisers halve.
double log_quantiser(double quality);
/// Index of the rung whose quality is nearest in log-quantiser space (ties: the lower).
std::uint32_t nearest_rung(const PlaneTables& tables, double quality);

/// D_i(Gamma): bytes of the stored fragments, each at the rung nearest to its q_i(x, y). Table streams are
/// not counted.
std::uint64_t bytes_asked_for(const PlaneTables& tables, std::size_t row, double gamma);

/// A fragment that shows the preview instead of a rung of its own.
inline constexpr std::int16_t kSkipped = -1;
/// The rung of every fragment at a scale and Gamma: nearest to q_i(x, y), or with allocation 2 what
/// allocate_rd() buys for D_i(Gamma). kSkipped for fragments that are not stored.
std::vector<std::int16_t> rungs_of(const PlaneTables& tables, std::size_t row, double gamma);
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
/// fragment streams, skipping included. `weights` default to surface_weights().
std::vector<std::int16_t> allocate_rd(const PlaneTables& tables, std::uint64_t budget_bytes,
                                      const std::vector<float>& weights = {});

}  // namespace texmesh
