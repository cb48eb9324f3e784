#pragma once

#include "format/documents/tables.h"

namespace texmesh {

/// What a client must have of a fragment to show it at a rung: the rung's stream, with incremental tables
/// those below it, too. 0 when it is not stored there.
std::uint64_t bytes_to_show(const PlaneTables& tables, std::size_t rung, std::size_t fragment);
/// eta_i (3.1) of one scale, by its row in the tables: feature counts min-max over covered fragments; 0 for
/// the others. With allocation 3 VQP (8.4) at every scale, since 8.3 assigns quality by it.
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

}  // namespace texmesh
