#pragma once
// Inside stages only: the coefficients of an 8 x 8 block of which perhaps only some samples are ever seen.
#include <array>
#include <cstdint>

#include "stages/jpeg/block_transform.h"
#include "stages/jpeg/huffman_table.h"

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

}  // namespace texmesh
