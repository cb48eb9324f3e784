#pragma once
#include "format/documents/thesis_tables.h"

namespace texmesh {

// The thesis's size model of a fragment (8.5 to 8.9); `vqp` is its p, in 0..1. Pure functions, the same bits
// everywhere.

/// Least VQP that has a model: (8.8) divides by log(100 p), which is 0 at 0.01 and negative below.
inline constexpr double kLeastModelVqp = 0.02;

/// (8.5): bytes at a quality in 0..1; 0 without a model.
double modelled_bytes(const SizeModel& model, double vqp, double quality);
/// (8.9): the quality whose bytes these are (> 0). Not clipped to 0..1; 0 without a model.
double modelled_quality(const SizeModel& model, double vqp, double bytes);

}  // namespace texmesh
