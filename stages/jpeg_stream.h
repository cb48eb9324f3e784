#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/huffman_table.h"

namespace texmesh {

/// Adds the symbols of `blocks` 8 x 8 blocks of entropy-coded baseline data without restart markers. Block b
/// is coded with the DC table 2 t and the AC table 2 t + 1, t = mcu[b % mcu.size()]. FormatError when the
/// data end before the blocks do or a code is none of the tables'.
void count_symbols(std::span<const std::uint8_t> data, std::span<const std::uint8_t> mcu, std::size_t blocks,
                   const HuffmanTables& tables, SymbolCounts& counts);

/// Offsets behind the entropy-coded data of every scan in bytes that follow a JPEG frame header, lowest
/// first; the last one is where EOI stands, or the end. FormatError for bytes that are no segments and scans.
std::vector<std::size_t> scan_ends(std::span<const std::uint8_t> body);

}  // namespace texmesh
