#pragma once
// Inside stages only: what bytes do between two rungs.
#include <cstdint>
#include <span>
#include <vector>

#include "stages/base/run_context.h"
#include "stages/data/ladder.h"
#include "stages/fragment_codec/fragment_codec.h"

namespace texmesh {

/// Measures how the bytes of a plane of colours grow between the rungs of its baseline JPEGs: what `sample`
/// takes at `plane.qualities` and at every whole quality between them (jpeg_bits()). What bends sizes there
/// most are the quantisers of the JPEG that the texture has been before, and these are the same everywhere in
/// a plane, so that a small sample tells it for all fragments. None for an empty sample and for fewer than
/// two qualities. Same result for any thread count.
SizeKnots measure_size_knots(const PlaneCoding& plane, std::span<const PixelWindow> sample,
                             const RunContext& context);

/// The same from what a sample takes at every whole quality, `bits` [0..100]; none for empty `bits`.
SizeKnots size_knots(const std::vector<int>& rungs, const std::vector<double>& bits);

}  // namespace texmesh
