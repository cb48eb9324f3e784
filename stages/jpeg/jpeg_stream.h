#pragma once
// Huffman tables, and what is in the entropy-coded data of a JPEG.
#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace texmesh {

/// One Huffman table as a DHT segment has it: bits[k] codes of length k = 1..16 (bits[0] = 0), symbols by
/// rising length.
struct HuffmanTable {
  std::array<std::uint8_t, 17> bits{};
  std::vector<std::uint8_t> symbols;
};

/// Codes of one Huffman table by symbol; bits = 0: the table has none.
struct SymbolCodes {
  std::array<std::uint16_t, 256> code{};
  std::array<std::uint8_t, 256> bits{};
};
SymbolCodes symbol_codes(const HuffmanTable& table);

/// The tables of one kind of stream: DC and AC of the first kind of component and, for three channels, DC and
/// AC of the second.
using HuffmanTables = std::vector<HuffmanTable>;

/// How often each symbol of those tables was coded.
using SymbolCounts = std::vector<std::array<std::uint64_t, 256>>;
/// Adds those of other streams, of as many tables.
void add_counts(auto& to, const auto& from) {
  for (std::size_t t = 0; t < from.size(); ++t)
    for (std::size_t s = 0; s < from[t].size(); ++s) to[t][s] += from[t][s];
}

/// A table in which every one of `symbols` has a code of at most 16 bits, made from `weights` (same length,
/// all > 0) as ISO 10918-1 annex K.2 does: no code consists of ones only. Ties by the symbol's value, the
/// higher one shorter.
HuffmanTable make_huffman_table(const std::vector<std::uint8_t>& symbols,
                                const std::vector<std::uint64_t>& weights);

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
