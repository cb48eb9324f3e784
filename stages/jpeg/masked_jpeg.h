#pragma once
// Inside stages only: baseline JPEG data of images in which nobody sees the uncovered texels.

#include "stages/jpeg/block_scan.h"
#include "stages/jpeg/jpeg_coder.h"

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

}  // namespace texmesh
