#pragma once
#include <array>
#include <cstdint>
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

/// A table in which every one of `symbols` has a code of at most 16 bits, made from `weights` (same length,
/// all > 0) as ISO 10918-1 annex K.2 does: no code consists of ones only. Ties by the symbol's value, the
/// higher one shorter.
HuffmanTable make_huffman_table(const std::vector<std::uint8_t>& symbols,
                                const std::vector<std::uint64_t>& weights);

}  // namespace texmesh
