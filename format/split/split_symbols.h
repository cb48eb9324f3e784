#pragma once
#include <cstdint>
#include <limits>
#include <vector>

namespace texmesh {

/// Symbols of one value part of one block: residuals, and kSame or kOther where the stream says whether a
/// value is that of another wedge.
inline constexpr std::int32_t kSame = std::numeric_limits<std::int32_t>::min(), kOther = kSame + 1;
using Symbols = std::vector<std::int32_t>;

/// Where the probabilities of one value part start: in 256ths, by how often each was 1 in the whole stream.
/// `blocks`: per block the symbols of every part; `components`: numbers per value.
std::vector<std::uint8_t> start_models(const std::vector<std::vector<Symbols>>& blocks, std::size_t part,
                                       int components);
/// Bytes of one part of one block; none for no symbols.
std::vector<std::uint8_t> code_symbols(const Symbols& symbols, const std::vector<std::uint8_t>& models,
                                       int components);

}  // namespace texmesh
