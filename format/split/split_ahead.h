#pragma once
#include <cstdint>

#include "format/split/look_ahead.h"

namespace texmesh {

/// Steps by which memory is asked for what a split of a point will read: of the mesh the corners at the
/// point, one after the other, and of the writer's knowledge what the split makes and moves.
enum class SplitStep : std::uint8_t {
  kPoint,      // where the corners begin; which split it is
  kSplit,      // the first corner; the split
  kLists,      // the second corner; the split's points and lists
  kListed,     // the third; what the lists name
  kFollowing,  // the fourth; what that leads to
  kFifthCorner,
  kSixthCorner,
  kSeventhCorner,
  kCount
};
using SplitAhead = LookAhead<SplitStep, 3>;

}  // namespace texmesh
