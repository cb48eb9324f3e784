#pragma once
// Inside stages only. Baseline JPEG data of images that have uncovered texels, which nobody sees.
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/jpeg/huffman_table.h"
#include "stages/jpeg/jpeg_coder.h"
#include "stages/jpeg/masked_block.h"

namespace texmesh {

/// How the blocks of one rung are coded. One element for each component.
using MaskedRung = std::vector<BlockCoding>;

/// `quantisers`: one array for each component, in zigzag order. `tables`: as for JpegCoder::use_tables().
MaskedRung masked_rung(const JpegKind& kind, const std::vector<std::array<std::uint16_t, 64>>& quantisers,
                       const HuffmanTables& tables);

/// True when every texel of the window is covered. JpegCoder codes such windows.
bool wholly_covered(const PixelWindow& image);

/// Codes an image at many rungs at once. The sides of the image are multiples of 16 px. Only the error at
/// covered texels counts:
/// - A block without a covered texel takes two codes. It has no AC coefficient, and its DC is that of the
///   block before unless that is far off.
/// - A block that is covered in part gets cheap coefficients whose error is small at the covered texels
///   (MaskedBlock). Uncovered texels have a small weight, so that they stay near the colours of the fill.
/// - A block that is wholly covered loses every coefficient that costs more than it shows.
/// Chroma of half resolution: a sample's weight is the number of covered texels that interpolate from the
/// sample. One object serves one thread. Equal input gives equal bytes.
class MaskedJpeg {
 public:
  explicit MaskedJpeg(const JpegKind& kind);
  /// Appends the image at rung r to streams[r], as JpegCoder::append_body() does: SOI data EOI.
  void append_bodies(const PixelWindow& image, std::span<const MaskedRung> rungs,
                     std::span<std::vector<std::uint8_t>> streams);
  /// Adds the symbols of the image at rung r to counts[r].
  void count_symbols(const PixelWindow& image, std::span<const MaskedRung> rungs,
                     std::span<SymbolCounts> counts);

 private:
  /// The samples of a component, after the level shift.
  struct Component {
    std::uint32_t width = 0, height = 0;
    std::vector<float> values;
  };
  void load(const PixelWindow& image);
  void weigh_halved(std::uint32_t width, std::uint32_t height);
  void halve(Component& chroma) const;
  template <class Sink>
  void code(const PixelWindow& image, std::span<const MaskedRung> rungs, std::span<Sink> sinks);
  template <class Sink>
  void code_block(std::size_t component, std::uint32_t left, std::uint32_t top,
                  std::span<const MaskedRung> rungs, std::span<Sink> sinks);

  JpegKind kind_;
  bool halved_;  // chroma has half the resolution
  std::vector<Component> components_;
  std::vector<float> weights_, halved_weights_;  // of samples of full and of half resolution
  std::vector<std::array<int, 3>> dc_before_;    // [rung][component]
  MaskedBlock block_;
};

}  // namespace texmesh
