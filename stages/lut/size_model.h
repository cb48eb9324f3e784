#pragma once
#include <cstdint>
#include <vector>

#include "format/documents/tables.h"
#include "format/documents/thesis_tables.h"
#include "stages/data/ladder.h"

namespace texmesh {

/// Bytes that a stored fragment of width x height texels costs whatever its quality: of baseline JPEGs SOI,
/// EOI and two bits for each 8 x 8 block, the shortest codes of a DC difference and of a block's end; of WebP
/// the headers of the container and the frame. Blocks are counted by the frame header of the first rung's
/// tables (without one: one component). What of a nearly flat texture is more than that is a few percent of
/// its bytes, so that S alone follows no exponential there: the correlation of a blurred scan of 4096 px was
/// 0.929 with SOI and EOI for c, and is 0.987.
double constant_bytes(const PlaneLadder& ladder, std::uint32_t width_px, std::uint32_t height_px);

/// The size model (thesis 8.6 to 8.8) of a plane whose sizes, qualities and order are there: S = A R^Q + c by
/// least squares on ln(S - c), c = constant_bytes() of all stored fragments, over the rungs of quality
/// 10 to 95, or all where those are fewer than three; that of a source's coefficients never takes part. B
/// makes R = (100 p)^B
/// for the mean VQP p, not below 0.02. Correlation is that of Q and ln(S - c), error the mean of |model - S|
/// / S. `vqp` [F] are the plane's. All 0 for fewer than two rungs and for planes of which nothing is stored.
SizeModel fit_size_model(const PlaneLadder& ladder, std::uint32_t width_px, std::uint32_t height_px,
                         const PlaneTables& tables, const std::vector<float>& vqp);

}  // namespace texmesh
