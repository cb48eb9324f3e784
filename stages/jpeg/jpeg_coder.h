#pragma once
// Inside stages only: libjpeg-turbo's compressor behind an interface that neither leaks its headers nor its
// longjmp.
// Inside stages only: what a JPEG is made of before it is transformed.
#include <memory>
#include <optional>

#include "stages/image/pixel_window.h"
#include "stages/jpeg/jpeg_stream.h"

namespace texmesh {

inline constexpr unsigned kLastChannelTimes = 4;

/// The steps of a file that stands alone. Qualities need not be whole: whole ones are some percent of bytes
/// apart.
struct FileSteps {
  double quality = 75;       // 1..100
  bool of_textures = false;  // texture_step() instead of IJG's tables
  bool sequential = false;   // a scan: twice as fast to code and to decode, for some percent more bytes
};

/// The step of coefficient i of an 8 x 8 block, row by row, at a quality of 1..100, for pictures of models,
/// where textures are shown smaller, turned and filtered: what is coarse in a block shows everywhere, what is
/// fine hardly. 4 at quality 50 and rising with the square of the frequency, the same for chroma. At equal
/// bytes FLIP was 2 % (turtle) to 33 % (yurt) less than with libjpeg's tables.
std::uint16_t texture_step(std::size_t i, double quality);

/// The kind of JPEG that a coder makes.
struct JpegKind {
  std::uint32_t channels = 3;  // 1 or 3
  int quality = 75;            // IJG, 1..100
  Subsampling subsampling = Subsampling::k420;
  /// Three channels of data, coded as they are instead of as YCbCr, without subsampling. Streams say so by an
  /// Adobe marker, which every decoder knows. Measured at equal bytes on maps that never were JPEGs: 4:4:4
  /// YCbCr turns normals by 1.1 to 1.5 times as much and has 1.3 to 2 times the error in other data; 4:2:0
  /// 1.1 to 2.5 and 1.6 to 4.5 times.
  bool rgb = false;
  /// With `rgb`: the last channel's quantisers are kLastChannelTimes those of the others. z of a normal says
  /// little that x and y do not say.
  bool coarse_last = false;
  bool progressive = false;  // deep successive approximation, see progressive_scans() in the .cpp
  /// For complete() alone: libjpeg's usual progressive scans, or one scan, one pair of Huffman tables for all
  /// channels of `rgb`, and these steps instead of those of `quality`.
  std::optional<FileSteps> file{};
};

/// The quantised coefficients of an image as a file's; refers to everything.
struct CoefficientFile {
  struct Part {                                        // one component
    std::uint32_t across = 1, down = 1;                // sampling factors
    std::uint32_t blocks_across = 0, blocks_down = 0;  // of the image
    std::array<std::uint16_t, 64> steps{};             // row by row
    const std::int16_t* blocks = nullptr;              // 64 each, row by row
  };
  std::uint32_t width_px = 0, height_px = 0;
  bool rgb = false;         // three components that are not YCbCr
  std::vector<Part> parts;  // 1 or 3
};

/// A progressive JPEG of these coefficients with Huffman tables of its own. StageError.
std::vector<std::uint8_t> jpeg_of_coefficients(const CoefficientFile& file);

/// Compresses many images of one kind. Not for concurrent use. Throws StageError.
class JpegCoder {
 public:
  explicit JpegCoder(const JpegKind& kind);
  ~JpegCoder();
  JpegCoder(const JpegCoder&) = delete;
  JpegCoder& operator=(const JpegCoder&) = delete;

  void use_tables(const HuffmanTables& tables);
  /// The Huffman tables in use. A new coder has the typical tables of ISO 10918-1 annex K.3, which have a
  /// code for every symbol.
  HuffmanTables tables() const;
  /// The quantisers by component, in zigzag order.
  std::vector<std::array<std::uint16_t, 64>> quantisers() const;
  /// For each Huffman table, the symbols that coding any image can take: quantisers bound the coefficients,
  /// so coarse quantisers leave few symbols.
  std::vector<std::vector<std::uint8_t>> possible_symbols() const;
  /// The head that images of one size and kind have in common: SOI [APP14] DQT [DHT] SOF [SOS] EOI. The head
  /// of a progressive coder has neither DHT nor SOS: every scan has its own.
  std::vector<std::uint8_t> head_stream(std::uint32_t width_px, std::uint32_t height_px);
  /// Appends the data that follows the head, as SOI data EOI. Codes with the tables in use, which need a code
  /// for every symbol. A progressive coder appends the scans alone, without SOI and EOI.
  void append_body(const PixelWindow& image, std::vector<std::uint8_t>& out);
  /// A whole JFIF file with optimised tables of its own.
  std::vector<std::uint8_t> complete(const PixelWindow& image);
  /// A whole JFIF file with the tables in use, which need a code for every symbol. It shows the same and
  /// takes a third of the time on small images. Not for progressive coders.
  std::vector<std::uint8_t> complete_as_is(const PixelWindow& image);
  /// Adds the symbols that coding the image takes. Not for progressive coders.
  void count_symbols(const PixelWindow& image, SymbolCounts& counts);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// A component's samples before chroma is halved, less 128, row by row. In libjpeg's integers.
void jpeg_samples(const PixelWindow& image, const JpegKind& kind, std::size_t component,
                  std::vector<float>& out);

/// Whether components other than the first have half as many samples each way.
inline bool halves_chroma(const JpegKind& kind) {
  return kind.channels == 3 && !kind.rgb && kind.subsampling == Subsampling::k420;
}

/// The pair of Huffman tables that codes a component.
inline std::size_t table_pair(const JpegKind& kind, std::size_t component) {
  return component > (kind.rgb ? 1u : 0u) ? 1 : 0;  // as JpegCoder
}

}  // namespace texmesh
