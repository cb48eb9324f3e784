#pragma once
// Inside stages only: what baseline JPEGs take, without making them.
#include <span>
#include <vector>

#include "stages/base/run_context.h"
#include "stages/jpeg/jpeg_coder.h"

namespace texmesh {

/// Bits of the entropy-coded data of all windows together at each of `qualities` 1..100, with the Huffman
/// tables that are best for each. Sides of windows are multiples of 16; `kind.quality` does not matter, and
/// progressive ones are not meant. 0 for no windows.
/// Windows without coverage are quantised as libjpeg does it, to the bit but for its rounding in the
/// transform. In the others blocks that have a covered texel count, as they are but for coefficients that
/// MaskedJpeg would leave out: that is a model of it, within 1 % for ratios between qualities on average.
/// Same result for any thread count.
std::vector<double> jpeg_bits(const JpegKind& kind, std::span<const PixelWindow> windows,
                              std::span<const int> qualities, const RunContext& context);

}  // namespace texmesh
