#pragma once
// Inside stages only: libjpeg-turbo's compressor behind an interface that neither leaks its headers nor its
// longjmp.
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "stages/jpeg.h"

namespace texmesh {

/// One Huffman table as a DHT segment has it: bits[k] codes of length k = 1..16 (bits[0] = 0), symbols by
/// rising length.
struct HuffmanTable {
  std::array<std::uint8_t, 17> bits{};
  std::vector<std::uint8_t> symbols;
};

/// The tables of one kind of stream: luma DC, luma AC and, for three channels, chroma DC, chroma AC.
using HuffmanTables = std::vector<HuffmanTable>;

/// A rectangle of interleaved 8-bit pixels within a larger image.
struct PixelWindow {
  const std::uint8_t* data = nullptr;
  std::size_t stride_bytes = 0;
  std::uint32_t width_px = 0, height_px = 0;
};

/// Compresses many images of one kind (channels, quality, subsampling). Not for concurrent use. Throws
/// StageError.
class JpegCoder {
 public:
  JpegCoder(std::uint32_t channels, int quality, Subsampling subsampling);
  ~JpegCoder();
  JpegCoder(const JpegCoder&) = delete;
  JpegCoder& operator=(const JpegCoder&) = delete;

  /// The Huffman tables that are best for this very image. The coder keeps them.
  HuffmanTables train(const PixelWindow& image);
  void use_tables(const HuffmanTables& tables);
  /// Those in use; a new coder has the typical ones of ISO 10918-1 annex K.3, which have a code for every
  /// symbol.
  HuffmanTables tables() const;
  /// SOI DQT DHT EOI of the tables in use.
  std::vector<std::uint8_t> table_stream();
  /// An abbreviated stream, SOI SOF0 SOS data EOI, coded with the tables in use. Every symbol needs a code
  /// there.
  std::vector<std::uint8_t> abbreviated(const PixelWindow& image);
  /// A whole JFIF file with optimised tables of its own.
  std::vector<std::uint8_t> complete(const PixelWindow& image);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// A table in which every one of `symbols` has a code of at most 16 bits, made from `weights` (same length,
/// all > 0) as ISO 10918-1 annex K.2 does: no code consists of ones only. Ties by the symbol's value, the
/// higher one shorter.
HuffmanTable make_huffman_table(const std::vector<std::uint8_t>& symbols,
                                const std::vector<std::uint64_t>& weights);

}  // namespace texmesh
