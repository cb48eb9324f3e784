#pragma once
// A source JPEG as baseline JPEGs of its fragments, which keep its components, and such fragments put
// together to one JPEG again, coefficient by coefficient.
#include <optional>

#include "format/base/bytes.h"
#include "stages/base/run_context.h"
#include "stages/data/fragments.h"
#include "stages/image/decode_jpeg.h"
#include "stages/jpeg/jpeg_stream.h"

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

/// The fragments of an image, row by row, each a JPEG of their sides.
struct JpegFragments {
  std::string entry;                          // for messages
  std::uint32_t width_px = 0, height_px = 0;  // of the image
  std::uint32_t fragment_width_px = 0, fragment_height_px = 0, columns = 0;
  std::uint32_t channels = 0;
  std::vector<std::uint8_t> stored;                 // by fragment: 1 = it has a file
  std::function<Bytes(std::size_t fragment)> file;  // may be called by several threads
};

/// The quantised coefficients of all fragments side by side: an image with the components, sampling and
/// quantisers of the fragments. Two bytes for every sample.
class JoinedJpeg {
 public:
  /// A block of a fragment that is not stored has no AC coefficients and the mean of the block to the left of
  /// it, or above it. FormatError for fragments that are no such parts of one image. Same for any number of
  /// threads.
  JoinedJpeg(const JpegFragments& fragments, const RunContext& context);

  std::uint32_t width_px() const { return width_px_; }
  std::uint32_t height_px() const { return height_px_; }
  std::uint32_t channels() const { return static_cast<std::uint32_t>(components_.size()); }

  /// What nobody sees continues what is seen, so that smaller copies of the image do not mix other colours
  /// into it, and is cheap. A block of which no sample is read for a covered texel, and which has no AC
  /// coefficients, as packages store such blocks, takes its mean from the blocks around it, ring by ring.
  /// Blocks keep their mean alone where neither their MCU nor one of its eight neighbours has a covered
  /// texel. `coverage`: bits as TexturePlane::coverage.
  void fill_unseen(const std::vector<std::uint8_t>& coverage);

  /// A progressive JPEG with Huffman tables of its own. At quality 100 the coefficients are those of the
  /// fragments, but for what fill_unseen() has changed; below (1..100) steps are at least those of
  /// texture_step(), and coefficients are rounded to them. Same bytes for the same input.
  std::vector<std::uint8_t> file(double quality = 100) const;

 private:
  using Block = std::array<std::int16_t, 64>;  // row by row
  struct Component {
    std::uint32_t across = 1, down = 1;                // sampling factors
    std::uint32_t blocks_across = 0, blocks_down = 0;  // of the image
    std::array<std::uint16_t, 64> quantisers{};        // row by row
    std::vector<Block> blocks;
  };
  void set_components(const JpegFragments& fragments, std::size_t first);
  void put_fragment(const JpegFragments& fragments, std::size_t fragment);
  void fill_gaps(const std::vector<std::uint8_t>& stored);
  std::vector<std::uint8_t> known_blocks(const Component& component, const CoverageMask& mask) const;
  static void continue_means(Component& component, std::vector<std::uint8_t> known);
  void flatten(const CoverageMask& mask);
  std::array<std::uint32_t, 2> mcu_px() const;

  std::uint32_t width_px_ = 0, height_px_ = 0;
  std::uint32_t fragment_width_px_ = 0, fragment_height_px_ = 0, columns_ = 0;
  bool rgb_ = false;
  std::vector<Component> components_;
};

}  // namespace texmesh
