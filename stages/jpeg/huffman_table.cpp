#include "stages/jpeg/huffman_table.h"

#include <algorithm>

namespace texmesh {

HuffmanTable make_huffman_table(const std::vector<std::uint8_t>& symbols,
                                const std::vector<std::uint64_t>& weights) {
  // The reserved symbol 256 of weight 1 takes the code of ones only and is dropped afterwards.
  constexpr int kReserved = 256;
  struct Node {
    std::uint64_t weight;
    int symbol;               // the highest one beneath, for ties
    std::vector<int> leaves;  // symbols beneath
  };
  std::vector<Node> nodes{{1, kReserved, {kReserved}}};
  for (std::size_t k = 0; k < symbols.size(); ++k) nodes.push_back({weights[k], symbols[k], {symbols[k]}});
  std::array<int, 257> length{};
  const auto lighter = [](const Node& a, const Node& b) {
    return a.weight != b.weight ? a.weight > b.weight : a.symbol < b.symbol;
  };
  std::make_heap(nodes.begin(), nodes.end(), lighter);
  while (nodes.size() > 1) {
    std::pop_heap(nodes.begin(), nodes.end(), lighter);
    Node a = std::move(nodes.back());
    nodes.pop_back();
    std::pop_heap(nodes.begin(), nodes.end(), lighter);
    Node& b = nodes.back();
    b.weight += a.weight;
    b.symbol = std::max(a.symbol, b.symbol);
    b.leaves.insert(b.leaves.end(), a.leaves.begin(), a.leaves.end());
    for (int leaf : b.leaves) ++length[static_cast<std::size_t>(leaf)];
    std::push_heap(nodes.begin(), nodes.end(), lighter);
  }
  // Codes longer than 16 bits move up: of a pair of the longest, one takes the parent's place and the other
  // shares the place of a shorter code (annex K.2, figure K.3).
  std::vector<std::size_t> count(symbols.size() + 2);
  for (int l : length) ++count[static_cast<std::size_t>(l)];
  count[0] = 0;  // numbers that are no symbol
  for (std::size_t l = count.size() - 1; l > 16; --l)
    while (count[l] > 0) {
      std::size_t shorter = l - 2;
      while (count[shorter] == 0) --shorter;
      count[l] -= 2;
      ++count[l - 1];
      count[shorter + 1] += 2;
      --count[shorter];
    }
  std::size_t longest = std::min<std::size_t>(16, count.size() - 1);
  while (count[longest] == 0) --longest;
  --count[longest];  // the reserved one
  HuffmanTable out;
  for (std::size_t l = 1; l <= longest; ++l) out.bits[l] = static_cast<std::uint8_t>(count[l]);
  out.symbols = symbols;
  std::sort(out.symbols.begin(), out.symbols.end(), [&](std::uint8_t a, std::uint8_t b) {
    return length[a] != length[b] ? length[a] < length[b] : a < b;
  });
  return out;
}

SymbolCodes symbol_codes(const HuffmanTable& table) {
  SymbolCodes out;
  unsigned code = 0;
  std::size_t index = 0;
  for (std::size_t l = 1; l <= 16; ++l, code <<= 1)
    for (unsigned n = table.bits[l]; n > 0; --n, ++code, ++index) {
      out.code[table.symbols[index]] = static_cast<std::uint16_t>(code);
      out.bits[table.symbols[index]] = static_cast<std::uint8_t>(l);
    }
  return out;
}

}  // namespace texmesh
