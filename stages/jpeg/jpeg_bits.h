#pragma once
// Inside stages only: what baseline JPEGs take, without making them.

#include "stages/jpeg/block_scan.h"
#include "stages/jpeg/jpeg_coder.h"
#include "stages/jpeg/source_jpeg.h"

namespace texmesh {

/// Bits of the entropy-coded data of all windows together at each of `qualities` 1..100, with the Huffman
/// tables that are best for each; 0 for no windows. Sides of windows are multiples of 16. `kind` is not
/// progressive, and its quality does not matter.
/// - Windows without a coverage mask are quantised as libjpeg does it, to the bit but for its rounding in the
///   transform.
/// - In the others only blocks that have a covered texel count, without the coefficients that MaskedJpeg
///   would leave out. This is a model of MaskedJpeg: ratios between qualities are within 1 % on average.
/// Same result for any thread count.
std::vector<double> jpeg_bits(const JpegKind& kind, std::span<const PixelWindow> windows,
                              std::span<const int> qualities, const RunContext& context);

/// Quantisers of all components, by component.
struct QuantiserSet {
  std::vector<SourceLayout::Quantisers> steps;
  bool exact = false;  // they are the source's: nothing is left out
};

/// The same of windows into the image of a source JPEG, from its coefficients: a model of RequantisedJpeg.
/// `kinds` by component. Windows begin at borders of its MCUs and hold whole ones.
std::vector<double> requantised_bits(const JpegCoefficients& source, const SourceLayout& layout,
                                     std::span<const BlockKind> kinds, std::span<const PixelWindow> windows,
                                     std::span<const QuantiserSet> sets, const RunContext& context);

}  // namespace texmesh
