#pragma once
// Inside stages only: baseline JPEGs of fragments that keep the components of a source JPEG.
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "format/base/bytes.h"
#include "stages/image/decode_jpeg.h"
#include "stages/jpeg/huffman_table.h"

namespace texmesh {

/// How the fragments' files are laid out.
struct SourceLayout {
  /// A component's quantisers in zigzag order, as DQT segments have them.
  using Quantisers = std::array<std::uint16_t, 64>;
  struct Component {
    std::uint32_t across = 1, down = 1;                // sampling factors: 1, 2 or 4
    std::uint32_t blocks_across = 0, blocks_down = 0;  // of the image
  };
  std::vector<Component> components;  // 1 or 3
  bool rgb = false;                   // three components that are not YCbCr
  std::uint32_t mcu_width_px = 8, mcu_height_px = 8;
  std::vector<Quantisers> quantisers;  // the source's, by component
  /// The pair of Huffman tables (DC, AC) of each component: the first one's, and that of the others.
  std::vector<std::size_t> pairs;
  std::uint32_t most_across() const { return mcu_width_px / 8; }
  std::uint32_t most_down() const { return mcu_height_px / 8; }
};

/// The layout of `source`, whose fragments have the given sides; nothing, with the reason in `why_not`, where
/// baseline JPEGs of such fragments cannot hold its components. Factors that all components share are divided
/// out: they mean no subsampling, however large.
std::optional<SourceLayout> source_layout(const JpegCoefficients& source, std::uint32_t fragment_width_px,
                                          std::uint32_t fragment_height_px, std::string& why_not);

/// SOI [APP14] DQT DHT SOF0 SOS EOI of the fragments' files. `quantisers` 1..255 by component; `tables` by
/// pair, DC before AC.
Bytes source_head(const SourceLayout& layout, const std::vector<SourceLayout::Quantisers>& quantisers,
                  const HuffmanTables& tables, std::uint32_t width_px, std::uint32_t height_px);

/// The quality of IJG's scale, 1..100, that quantises about as finely: of all luma tables of that scale the
/// one whose mean of 1 / (step + 1) has the nearest logarithm (SPEC.md, rungQuality); the lower of two.
int quality_of(const SourceLayout::Quantisers& quantisers);

}  // namespace texmesh
