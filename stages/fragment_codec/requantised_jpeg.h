#pragma once
// Inside stages only: fragments of a source JPEG from its coefficients, without a transform where all is
// seen.

#include "stages/jpeg/block_scan.h"
#include "stages/jpeg/source_jpeg.h"

namespace texmesh {

/// How one rung is coded.
struct SourceRung {
  MaskedRung coding;
  bool exact = false;  // the quantisers are the source's, and seen blocks keep the source's coefficients
};

/// Codes fragments at many rungs at once.
/// - Blocks of which everything is seen are requantised: the source's coefficients in the rung's quantisers,
///   less those whose bytes are worth more than their effect (quantise_whole()).
/// - Blocks seen in part become what MaskedBlock makes of the source's samples where they are seen, and of
/// the
///   window's pixels, which are filled, elsewhere.
/// - Blocks that nobody sees take two codes: no AC, and the DC of the block before unless that is far off. So
///   do blocks beyond the image.
/// A sample of subsampled components is seen where an interpolating decoder of this fragment takes from it
/// for a covered texel. Same bytes for the same input; one object per thread.
class RequantisedJpeg {
 public:
  /// Both outlive the object.
  RequantisedJpeg(const JpegCoefficients& source, const SourceLayout& layout);
  /// Appends SOI data EOI of rung r to streams[r]. `window` lies in the source's image at its coverage's left
  /// and top; these and its sides are multiples of the MCU's.
  void append_bodies(const PixelWindow& window, std::span<const SourceRung> rungs,
                     std::span<std::vector<std::uint8_t>> streams);
  /// Adds the symbols of rung r to counts[r]. False when baseline JPEG has no symbol for one of the numbers.
  bool count_symbols(const PixelWindow& window, std::span<const SourceRung> rungs,
                     std::span<SymbolCounts> counts);

 private:
  /// A block as its rungs need it.
  struct Seen;
  void load(const PixelWindow& window);
  SampleFactors factors_of(std::size_t component) const;
  BlockValues filled_block(const PixelWindow& window, std::size_t component, std::uint32_t left,
                           std::uint32_t top);
  Seen look(const PixelWindow& window, std::size_t component, std::uint32_t left, std::uint32_t top,
            const std::int16_t* coefficients);
  template <class Sink>
  void code(const PixelWindow& window, std::span<const SourceRung> rungs, std::span<Sink> sinks);
  template <class Sink>
  void code_block(const PixelWindow& window, std::size_t component, std::uint32_t column, std::uint32_t row,
                  std::span<const SourceRung> rungs, std::span<Sink> sinks);
  CodedBlock exact_block(const std::int16_t* coefficients, int dc_before);

  const JpegCoefficients& source_;
  const SourceLayout& layout_;
  bool masked_ = false;                        // some of the window is not covered
  CoveredTexels covered_;                      // of masked windows, and so are
  std::vector<CoveredBlocks> blocks_;          // by component
  std::vector<float> samples_;                 // of one block's texels
  std::vector<std::array<int, 3>> dc_before_;  // [rung][component]
  MaskedBlock block_;
  bool exact_only_ = false;  // no rung chooses coefficients
  bool fits_ = true;
};

}  // namespace texmesh
