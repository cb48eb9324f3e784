#pragma once
// Inside stages only: baseline JPEG data of images in which nobody sees the uncovered texels, and what
// baseline JPEGs take, without making them.
#include "stages/jpeg/block_scan.h"
#include "stages/jpeg/jpeg_coder.h"
#include "stages/jpeg/source_jpeg.h"

namespace texmesh {

/// `quantisers` by component, zigzag order; tables as JpegCoder::use_tables() takes them.
MaskedRung masked_rung(const JpegKind& kind, const std::vector<std::array<std::uint16_t, 64>>& quantisers,
                       const HuffmanTables& tables);

/// Whether every texel of the window is covered. JpegCoder codes such windows.
bool wholly_covered(const PixelWindow& image);

/// Codes images at many rungs at once; sides are multiples of 16. The decoder's samples at covered texels are
/// what counts:
/// - Blocks without a covered texel take two codes: no AC, and the DC of the block before unless that is far
///   off.
/// - Blocks covered in part get coefficients that are cheap and right at covered texels (MaskedBlock).
///   Uncovered texels have a small weight towards the window's values, so that they stay near the fill's
///   colours.
/// - Blocks covered wholly lose coefficients whose bytes are worth more than their effect.
/// A halved chroma sample weighs as much as the covered texels that interpolation takes from it. Same bytes
/// for the same input; one object per thread.
class MaskedJpeg {
 public:
  explicit MaskedJpeg(const JpegKind& kind);
  /// Appends SOI data EOI of rung r to streams[r], as JpegCoder::append_body() does.
  void append_bodies(const PixelWindow& image, std::span<const MaskedRung> rungs,
                     std::span<std::vector<std::uint8_t>> streams);
  /// Adds the symbols that coding the image at rung r takes to counts[r].
  void count_symbols(const PixelWindow& image, std::span<const MaskedRung> rungs,
                     std::span<SymbolCounts> counts);

 private:
  void load(const PixelWindow& image);
  void halve(SamplePlane& chroma) const;
  template <class Sink>
  void code(const PixelWindow& image, std::span<const MaskedRung> rungs, std::span<Sink> sinks);
  template <class Sink>
  void code_block(std::size_t component, std::uint32_t left, std::uint32_t top,
                  std::span<const MaskedRung> rungs, std::span<Sink> sinks);

  JpegKind kind_;
  bool halved_;                          // chroma
  std::vector<std::size_t> pairs_;       // of Huffman tables, by component
  std::vector<SamplePlane> components_;  // level shift taken off
  CoveredTexels covered_;
  std::array<CoveredBlocks, 2> blocks_;        // of samples; of those of halved chroma
  std::vector<std::array<int, 3>> dc_before_;  // [rung][component]
  MaskedBlock block_;
};

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
