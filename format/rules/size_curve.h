#pragma once
#include "format/documents/tables.h"
#include "format/documents/thesis_tables.h"

namespace texmesh {

/// How finely quantisers (> 0) quantise: the logarithm of the mean of 1 / (step + 1). Higher is finer.
double fineness_of(std::span<const std::uint16_t> quantisers);
/// That of the luma quantisers of a whole quality 1..100 of IJG's scale. Strictly rising.
double fineness_at_quality(int quality);

/// Bytes that the fragment's stream would have at a quality that no rung has: monotone cubic interpolation
/// of log bytes between the rungs (exact there) along the plane's knots, constant outside them; 0 when it
/// is not stored.
double interpolated_bytes(const PlaneTables& tables, std::size_t fragment, double quality);
/// The knots' positions with which interpolated_bytes() of a stream of `rung_bytes` [R] > 0 at `rung_quality`
/// is `knot_bytes` at `knot_quality`, as far as they lie between those of the rungs around them. Where these
/// do not rise the knots lie as without any. Same bits everywhere.
std::vector<float> knot_positions(const std::vector<std::uint8_t>& rung_quality,
                                  const std::vector<double>& rung_bytes,
                                  const std::vector<std::uint8_t>& knot_quality,
                                  const std::vector<double>& knot_bytes);

// The thesis's size model of a fragment (8.5 to 8.9); `vqp` is its p, in 0..1. Pure functions, the same bits
// everywhere.

/// Least VQP that has a model: (8.8) divides by log(100 p), which is 0 at 0.01 and negative below.
inline constexpr double kLeastModelVqp = 0.02;

/// (8.5): bytes at a quality in 0..1; 0 without a model.
double modelled_bytes(const SizeModel& model, double vqp, double quality);
/// (8.9): the quality whose bytes these are (> 0). Not clipped to 0..1; 0 without a model.
double modelled_quality(const SizeModel& model, double vqp, double bytes);

}  // namespace texmesh
