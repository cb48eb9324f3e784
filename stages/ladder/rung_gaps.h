#pragma once
// Inside the ladder only: pairs of rungs far apart in bytes, between which a budget buys little more than the
// cheaper one.
#include <cstdint>
#include <vector>

#include "stages/ladder/rung_hull.h"

namespace texmesh::rungs {

/// Neighbours, of all pairs of any level that no other one beats in bytes and loss, have at most so many
/// times the bytes of each other, when the finer one saves more than kUnseen. Pairs above the lower hull
/// count, too: clients cannot mix levels. The preview is no neighbour.
inline constexpr double kMostApart = 2.5;

/// Pairs without which there is a gap where some level is wanted that loads want.
std::vector<std::uint8_t> gap_closers(const TextureWays& texture, const std::vector<std::uint8_t>& keep,
                                      const GivenBytes& given);

/// Adds pairs, takes them away and puts others in their place, one at a time, as long as that makes gaps
/// smaller, or at equal gaps the mean loss of the loads. Fixed pairs stay, one of each level does, and all
/// take at most TextureWays::most_bytes, if they did before. Same result anywhere.
void swap_pairs(const TextureWays& texture, const GivenBytes& given, std::vector<std::uint8_t>& keep);

}  // namespace texmesh::rungs
