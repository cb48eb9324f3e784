#pragma once

#include "format/documents/thesis_tables.h"

namespace texmesh {

// A client's own just-noticeable difference on the values of thesis.bin (thesis 7.2, 7.5). A table of values
// is [i * n + j], i < j, for n rows, S_0 first; all else in it is 0. Pure functions, the same bits
// everywhere.

/// What becomes of the collapses of several scale changes. The thesis prints Table 7.2 and no rule.
/// kRootOfSquares: the root of the sum of the squared values of the changes. kSurvivor: every removed vertex
/// against the vertex that is left at the coarser scale, as 7.2 has it for a chain of collapses.
enum class ChainRule : std::uint8_t { kRootOfSquares, kSurvivor };

/// Values of all pairs from those of the steps: [k] is the change from row k - 1 to row k.
std::vector<float> chained_values(std::span<const float> step);
/// Values of all pairs by one statistic. kP95 is measured for each pair and knows no chain.
std::vector<float> pair_values(const PerceptualTable& table, PerceptualStatistic statistic,
                               ChainRule chain = ChainRule::kRootOfSquares);

/// The coarsest row behind `row` that nobody can tell from it: the values against `row` stay below `jnd` up
/// to there. `row` itself where the next one is noticeable. `value` has `rows` squared elements.
std::size_t coarsest_alike(std::span<const float> value, std::size_t rows, std::size_t row, double jnd);
/// [row]: 1 = major, the last row of its tier. A tier begins behind S_0 or behind a major row and ends before
/// the value against that row reaches `jnd`; a tier has one row at least (Fig. 7.13).
std::vector<std::uint8_t> major_rows(std::span<const float> value, std::size_t rows, double jnd);
/// Where refinement from row `have` towards the finer row `want` may stop: the coarsest row that nobody can
/// tell from `want`. `have` where refining shows nothing, or where `want` is not finer.
std::size_t refine_to(std::span<const float> value, std::size_t rows, std::size_t have, std::size_t want,
                      double jnd);

}  // namespace texmesh
