#pragma once
#include <array>
#include <cstdint>

#include "format/split/split_coder.h"

namespace texmesh {

/// Probabilities of the connectivity part; they go on learning through the whole stream.
struct SplitModels {
  static constexpr std::uint8_t kLimit = 200;
  static constexpr int kDegrees = 14, kAsks = 4, kLeft = 12, kRun = 7, kRing = 8, kValence = 5;
  using Pair = std::array<BitModel, 2>;
  using PerValence = std::array<BitModel, kValence>;
  // [degree][refusals][split before][last]
  std::array<std::array<std::array<Pair, 2>, kAsks>, kDegrees> ask;

  // A fan's corners change from staying to moving and back.
  std::array<Pair, kLeft> first;                                     // [corners][not the first fan]
  std::array<std::array<std::array<PerValence, kLeft>, 2>, 2> turn;  // [open][moving][left][valence]
  // [open][moving][run][ring][valence]
  std::array<std::array<std::array<std::array<PerValence, kRing>, kRun>, 2>, 2> turn_back;
  std::array<Pair, 2> turn_again;  // [open][moving]

  Pair target_expected;            // [has one]
  Pair target_copied;              // [the parent loses the wedge]
  BitModel listed;                 // this wedge of a list
  std::array<Pair, 4> more_faces;  // [kind of edge][has one]
  BitModel flipped, extra_face, same_group;
  std::array<BitModel, 3> beside_moving;  // [what differs]
  std::array<Pair, 3> corner_expected;    // [parent, child, third][seam]

  // Patches:
  BitModel seed_exists;
  std::array<std::array<BitModel, 8>, 8> gate_open, third_new, third_left;  // [fan at start][fan at end]
  BitModel third_right;
  std::array<BitModel, 4> patch_expected;  // [corner of the edge; third beside the start, beside the end]
};

}  // namespace texmesh
