#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/jpeg/huffman_table.h"

namespace texmesh {

/// Of a block of 8 x 8 samples.
inline constexpr std::size_t kBlockCoefficients = 64;

/// The place in an 8 x 8 block, row by row, of the k-th coefficient of a JPEG's order.
inline constexpr std::array<std::uint8_t, 64> kNaturalOfZigzag{
    0,  1,  8,  16, 9,  2,  3,  10, 17, 24, 32, 25, 18, 11, 4,  5,  12, 19, 26, 33, 40, 48,
    41, 34, 27, 20, 13, 6,  7,  14, 21, 28, 35, 42, 49, 56, 57, 50, 43, 36, 29, 22, 15, 23,
    30, 37, 44, 51, 58, 59, 52, 45, 38, 31, 39, 46, 53, 60, 61, 54, 47, 55, 62, 63};

/// And back.
inline constexpr std::array<std::uint8_t, 64> kZigzagOfNatural = [] {
  std::array<std::uint8_t, 64> out{};
  for (std::size_t k = 0; k < 64; ++k) out[kNaturalOfZigzag[k]] = static_cast<std::uint8_t>(k);
  return out;
}();

/// Adds the symbols of `blocks` 8 x 8 blocks of entropy-coded baseline data without restart markers. Block b
/// is coded with the DC table 2 t and the AC table 2 t + 1, t = mcu[b % mcu.size()]. FormatError when the
/// data end before the blocks do or a code is none of the tables'.
void count_symbols(std::span<const std::uint8_t> data, std::span<const std::uint8_t> mcu, std::size_t blocks,
                   const HuffmanTables& tables, SymbolCounts& counts);

/// Offsets behind the entropy-coded data of every scan in bytes that follow a JPEG frame header, lowest
/// first; the last one is where EOI stands, or the end. FormatError for bytes that are no segments and scans.
std::vector<std::size_t> scan_ends(std::span<const std::uint8_t> body);

}  // namespace texmesh
