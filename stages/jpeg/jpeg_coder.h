#pragma once
// Inside stages only. The interface hides libjpeg-turbo's headers and its longjmp.
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "stages/data/subsampling.h"
#include "stages/image/pixel_window.h"
#include "stages/jpeg/huffman_table.h"

namespace texmesh {

/// The kind of images that a coder compresses.
struct JpegKind {
  std::uint32_t channels = 3;  // 1 or 3
  int quality = 75;            // IJG, 1..100
  Subsampling subsampling = Subsampling::k420;
  /// The three channels hold data. The coder stores them without conversion to YCbCr and without subsampling.
  /// An Adobe marker in the stream says so; every decoder knows that marker.
  /// The alternatives were measured at equal bytes, on maps that had never been JPEGs. YCbCr 4:4:4 turns
  /// normals by 1.1 to 1.5 times the angle and has 1.3 to 2 times the error in other data. YCbCr 4:2:0 turns
  /// normals by 1.1 to 2.5 times the angle and has 1.6 to 4.5 times the error in other data.
  bool rgb = false;
  bool progressive =
      false;  // successive approximation; progressive_scans() in jpeg_coder.cpp lists the scans
};

/// Compresses many images of one kind. One object serves one thread. Errors are StageErrors. Equal input
/// gives equal bytes.
class JpegCoder {
 public:
  explicit JpegCoder(const JpegKind& kind);
  ~JpegCoder();
  JpegCoder(const JpegCoder&) = delete;
  JpegCoder& operator=(const JpegCoder&) = delete;

  /// Sets the Huffman tables that append_body() codes with.
  void use_tables(const HuffmanTables& tables);
  /// The Huffman tables in use. A new coder has the typical tables of ISO 10918-1 annex K.3. Those tables
  /// have a code for every symbol.
  HuffmanTables tables() const;
  /// The quantisers of every component, in zigzag order.
  std::vector<std::array<std::uint16_t, 64>> quantisers() const;
  /// For each Huffman table, the symbols that an image can need. Quantisers bound the coefficients, so coarse
  /// quantisers leave few symbols.
  std::vector<std::vector<std::uint8_t>> possible_symbols() const;
  /// The part of a file that depends on the size of the image only: SOI [APP14] DQT [DHT] SOF [SOS] EOI. A
  /// progressive coder leaves out DHT and SOS, because every scan brings its own.
  std::vector<std::uint8_t> head_stream(std::uint32_t width_px, std::uint32_t height_px);
  /// Appends the part of a file that follows head_stream(), between an SOI and an EOI: SOI data EOI. The
  /// Huffman tables in use must have a code for every symbol of the image. A progressive coder appends the
  /// scans, without SOI and EOI.
  void append_body(const PixelWindow& image, std::vector<std::uint8_t>& out);
  /// A whole JFIF file, whose Huffman tables are optimised for the image.
  std::vector<std::uint8_t> complete(const PixelWindow& image);
  /// Adds the symbols of the image to `counts`. The coder must not be progressive.
  void count_symbols(const PixelWindow& image, SymbolCounts& counts);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace texmesh
