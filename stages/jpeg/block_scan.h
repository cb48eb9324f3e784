#pragma once
// Inside stages only: blocks of a baseline scan, each coded at several rungs by what of it is seen. A block
// becomes coefficients (quantise_whole(), MaskedBlock, flat_block()), these become symbols (emit_block()),
// and a sink writes or counts them.
#include <cstdlib>

#include "format/base/bytes.h"
#include "stages/image/pixel_window.h"
#include "stages/jpeg/block_transform.h"
#include "stages/jpeg/jpeg_stream.h"

namespace texmesh {

/// How the blocks of one component are coded at one rung.
struct BlockCoding {
  BlockValues quantisers{};
  SymbolCodes dc, ac;
  float bit_cost = 0;  // squared error of samples that a bit less may cost: lambda
};

/// Quantised coefficients in zigzag order.
struct CodedBlock {
  std::array<std::int16_t, 64> values{};
  std::uint64_t used = 0;  // bit k: values[k] is not 0
};

/// Coefficients of a block all of which is seen: to the nearest, ties away from zero, and then, from the
/// highest frequency down, AC coefficients one step nearer to zero where that saves more bits than error.
/// Where all quantisers are 1, finest_steps() instead.
CodedBlock quantise_whole(const BlockValues& coefficients, const BlockCoding& coding);

/// A block of which some samples are free.
class MaskedBlock {
 public:
  /// Samples (level shift taken off), and weights 0..1 of their squared errors, not all 0.
  void load(const BlockValues& samples, const BlockValues& weights);
  /// Coefficients of small weighted squared error + bit_cost x coded bits. From all zero on, or, since
  /// load(), from those of the rung before, requantised with what it left of the samples: changes of one
  /// coefficient that gain at least an eighth of what the best one could, until none is worth half a bit
  /// (matching pursuit by rate and distortion). Rungs had best come from the coarsest to the finest. Bits are
  /// those of the Huffman codes, with runs and with the step from the DC before; a symbol without a code is
  /// never chosen.
  CodedBlock quantise(const BlockCoding& coding, int dc_before);

 private:
  CodedBlock requantised(const BlockCoding& coding, int dc_before);
  void recode(const BlockValues& next);

  BlockGram gram_;
  BlockValues samples_{};
  float mean_ = 0;            // of the samples, as the coefficient of frequency 0
  BlockValues per_energy_{};  // 1 / Gram diagonal, 0 where that is nothing
  BlockValues rest_{};        // correlation of basis functions with what is left of the samples, weighted
  BlockValues coded_{};       // coefficients that rest_ goes with
  bool begun_ = false;        // a rung has been quantised since load()
};

/// Appends the entropy-coded bits of a JPEG to `out`, the first bit highest, with a zero behind every 0xff.
/// `out` is larger than what is written until finish().
class BitWriter {
 public:
  explicit BitWriter(Bytes& out) : out_(&out), used_(out.size()) {}
  /// Before put(): room for so many bytes, zeros behind 0xff included.
  void reserve(std::size_t bytes) {
    if (out_->size() - used_ < bytes + kMostHeldBytes)
      out_->resize(2 * out_->size() + bytes + kMostHeldBytes);
  }
  /// The lowest `count` bits of `value`, whose others are 0; count <= 32.
  void put(std::uint32_t value, unsigned count) {
    held_ = held_ << count | value;
    count_ += count;
    while (count_ >= 32) {
      count_ -= 32;
      write_word(static_cast<std::uint32_t>(held_ >> count_));
    }
  }
  /// Fills the last byte with ones and cuts `out` to what was written.
  void finish() {
    reserve(0);
    if (count_ > 0) {
      const unsigned fill = (8 - count_ % 8) % 8;
      put((1u << fill) - 1, fill);
    }
    while (count_ > 0) write(static_cast<std::uint8_t>(held_ >> (count_ -= 8)));
    out_->resize(used_);
  }

 private:
  static constexpr std::size_t kMostHeldBytes = 8;  // 31 bits and the zeros behind them
  void write_word(std::uint32_t word) {
    const bool has_ff = ((~word - 0x01010101u) & word & 0x80808080u) != 0;
    std::uint8_t* to = out_->data() + used_;
    for (unsigned shift = 32; shift > 0;) {
      *to++ = static_cast<std::uint8_t>(word >> (shift -= 8));
      if (has_ff && to[-1] == 0xff) *to++ = 0;
    }
    used_ = static_cast<std::size_t>(to - out_->data());
  }
  void write(std::uint8_t byte) {
    (*out_)[used_++] = byte;
    if (byte == 0xff) (*out_)[used_++] = 0;
  }
  Bytes* out_;
  std::size_t used_;
  std::uint64_t held_ = 0;
  unsigned count_ = 0;
};

/// How one rung's blocks are coded, by component.
using MaskedRung = std::vector<BlockCoding>;

/// What the block coder minds in a component: the luma of colours, or anything else.
enum class BlockKind : std::uint8_t { kLuma, kOther };

/// BlockCoding::bit_cost; `quantisers` in zigzag order.
float bit_cost_of(BlockKind kind, const std::array<std::uint16_t, 64>& quantisers);

/// `quantisers` in zigzag order; `dc` and `ac` are the component's Huffman tables.
BlockCoding block_coding(BlockKind kind, const std::array<std::uint16_t, 64>& quantisers,
                         const HuffmanTable& dc, const HuffmanTable& ac);

/// Of an uncovered sample, so that it does not run away; .001 to .01 make 0.1 % of the bytes.
inline constexpr float kUncoveredWeight = 0.003f;

/// How much of a block is covered, by the weights of its samples.
enum class BlockCoverage : std::uint8_t { kNothing, kPart, kAll };

float mean_of(const BlockValues& samples);

/// Samples of a component, row by row.
struct SamplePlane {
  std::uint32_t width = 0, height = 0;
  std::vector<float> values;
  BlockValues block(std::uint32_t left, std::uint32_t top) const;
};

/// By how many a component has fewer samples than the image, along both axes: 1, 2 or 4.
struct SampleFactors {
  std::uint32_t across = 1, down = 1;
};

/// Which texels of a window are covered.
class CoveredTexels {
 public:
  /// The window's width is a multiple of 8.
  void load(const PixelWindow& window);
  std::uint32_t width_px() const { return width_px_; }
  std::uint32_t height_px() const { return height_px_; }
  /// 1 or 0.
  float at(std::uint32_t x, std::uint32_t y) const {
    return static_cast<float>(bits_[std::size_t{y} * (width_px_ / 8) + x / 8] >> (7 - x % 8) & 1);
  }
  /// What interpolation of covered texels takes from the samples of a component's block at (left, top), by a
  /// triangle of twice the factor's width, which is how decoders interpolate; 1 where they all are covered.
  /// The window's outermost texels are repeated.
  BlockValues weights(SampleFactors factors, std::uint32_t left, std::uint32_t top) const;
  /// What the weights of that block are.
  BlockCoverage block(SampleFactors factors, std::uint32_t left, std::uint32_t top) const;

 private:
  /// at() of the block at (left, top), a multiple of 8.
  BlockValues texels(std::uint32_t left, std::uint32_t top) const;
  std::uint32_t width_px_ = 0, height_px_ = 0;
  std::vector<std::uint8_t> bits_;  // rows of width / 8 bytes, bit 7 first
};

/// The blocks of one component of a window.
class CoveredBlocks {
 public:
  /// The window's sides hold whole blocks.
  void load(const CoveredTexels& texels, SampleFactors factors);
  /// Of the block at (left, top).
  BlockCoverage at(std::uint32_t left, std::uint32_t top) const {
    return blocks_[std::size_t{top / 8} * columns_ + left / 8];
  }
  /// How far off the DC before may be that the uncovered block at (left, top) takes for its own.
  float same_level_at(std::uint32_t left, std::uint32_t top) const;

 private:
  std::uint32_t columns_ = 0, rows_ = 0;
  std::vector<BlockCoverage> blocks_;
};

/// A block that nobody sees: the DC before it, unless that is further off than `same_level`.
CodedBlock flat_block(float level, float same_level, const BlockCoding& coding, int dc_before);

/// Writes the blocks of one rung.
class BitSink {
 public:
  BitSink(Bytes& out, const MaskedRung& rung) : writer_(out), rung_(&rung) {}
  void begin_block(std::size_t component) {
    coding_ = &(*rung_)[component];
    writer_.reserve(kMostBlockBytes);
  }
  void dc(unsigned symbol, unsigned value) { put(coding_->dc, symbol, value, symbol); }
  void ac(unsigned symbol, unsigned value) { put(coding_->ac, symbol, value, symbol & 15u); }
  void finish() { writer_.finish(); }

 private:
  // 64 symbols of 16 + 11 bits at most, each byte perhaps with a zero behind it.
  static constexpr std::size_t kMostBlockBytes = 512;

  void put(const SymbolCodes& codes, unsigned symbol, unsigned value, unsigned size) {
    writer_.put(unsigned{codes.code[symbol]} << size | (value & ((1u << size) - 1)),
                codes.bits[symbol] + size);
  }
  BitWriter writer_;
  const MaskedRung* rung_;
  const BlockCoding* coding_ = nullptr;
};

/// Counts the symbols of one rung's blocks. `pairs`: of Huffman tables, by component.
class CountSink {
 public:
  CountSink(std::span<const std::size_t> pairs, SymbolCounts& counts) : pairs_(pairs), counts_(&counts) {}
  void begin_block(std::size_t component) { dc_ = counts_->data() + 2 * pairs_[component]; }
  void dc(unsigned symbol, unsigned) { ++(*dc_)[symbol]; }
  void ac(unsigned symbol, unsigned) { ++dc_[1][symbol]; }
  void finish() {}

 private:
  std::span<const std::size_t> pairs_;
  SymbolCounts* counts_;
  SymbolCounts::value_type* dc_ = nullptr;  // and AC behind it
};

/// The symbols of a block, ISO 10918-1 F.1.2.
void emit_block(const CodedBlock& block, int dc_before, std::size_t component, auto& sink) {
  const auto size = [](int v) {
    return static_cast<unsigned>(std::bit_width(static_cast<unsigned>(std::abs(v))));
  };
  const auto bits = [](int v) { return static_cast<unsigned>(v < 0 ? v - 1 : v); };
  sink.begin_block(component);
  const int step = block.values[0] - dc_before;
  sink.dc(size(step), bits(step));
  unsigned before = 0;
  for (std::uint64_t left = block.used & ~std::uint64_t{1}; left != 0; left &= left - 1) {
    const auto k = static_cast<unsigned>(std::countr_zero(left));
    const int value = block.values[k];
    unsigned zeros = k - before - 1;
    for (; zeros > 15; zeros -= 16) sink.ac(0xf0, 0);
    sink.ac(zeros << 4 | size(value), bits(value));
    before = k;
  }
  if (before < 63) sink.ac(0, 0);
}

}  // namespace texmesh
