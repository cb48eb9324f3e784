#pragma once
// Inside stages only: the coefficients of an 8 x 8 block of which perhaps only some samples are ever seen.
#include <array>
#include <cstdint>

namespace texmesh {

/// Samples, row by row, or coefficients in zigzag order.
using BlockValues = std::array<float, 64>;
/// Quantised coefficients in zigzag order.
using BlockCoefficients = std::array<std::int16_t, 64>;

/// Codes of one Huffman table by symbol; bits = 0: the table has none.
struct SymbolCodes {
  std::array<std::uint16_t, 256> code{};
  std::array<std::uint8_t, 256> bits{};
};

/// How the blocks of one component are coded at one rung.
struct BlockCoding {
  BlockValues quantisers{};  // zigzag order
  SymbolCodes dc, ac;
  float bit_cost = 0;  // squared error of samples that a bit less may cost: lambda
};

/// Orthonormal DCT, which is JPEG's.
BlockValues block_dct(const BlockValues& samples);

/// Coefficients of a block all of which is seen: to the nearest, ties away from zero, and then, from the
/// highest frequency down, AC coefficients one step nearer to zero where that saves more bits than error.
BlockCoefficients quantise_whole(const BlockValues& coefficients, const BlockCoding& coding);

/// A block of which some samples are free.
class MaskedBlock {
 public:
  /// Samples (level shift taken off), and weights 0..1 of their squared errors, not all 0.
  void load(const BlockValues& samples, const BlockValues& weights);
  /// Coefficients of small weighted squared error + bit_cost x coded bits: from all zero on, changes of
  /// one coefficient that gain at least an eighth of what the best one could, until none is worth half a bit
  /// (matching pursuit by rate and distortion).
  /// Bits are those of the Huffman codes, with runs and with the step from the DC before; a symbol without a
  /// code is never chosen.
  BlockCoefficients quantise(const BlockCoding& coding, int dc_before);

 private:
  const BlockValues& gram_column(std::size_t k);

  std::array<float, 15 * 15> spectrum_{};  // of the weights: sums over samples of w cos() cos()
  BlockValues correlation_{};              // of basis functions with the samples, weighted
  BlockValues diagonal_{};                 // of basis functions with themselves
  std::array<BlockValues, 64> gram_;       // of basis functions with each other, columns as they are wanted
  std::uint64_t has_column_ = 0;
};

}  // namespace texmesh
