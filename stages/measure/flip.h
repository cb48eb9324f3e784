#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "stages/measure/image_compare.h"

namespace texmesh {

/// The parts of a picture that FLIP compares. They are computed once for a reference.
struct FlipPicture {
  std::uint32_t side_px = 0;
  std::vector<Vec3f> lab;                    // as the eye filters it, Hunt-adjusted
  std::array<std::vector<float>, 2> detail;  // strength of edges, of points
  std::vector<std::uint8_t> covered;
};
FlipPicture prepare_flip(const Picture& picture);

/// Mean LDR-FLIP (Andersson, Nilsson, Akenine-Moeller, Oskarsson, Astrom, Fairchild: FLIP: A Difference
/// Evaluator for Alternating Images, 2020) over the pixels that either picture covers, at its standard 67
/// pixels per degree: 0 = equal, 1 = black against white. Both parts, colours and features, as published;
/// borders are replicated. Same bits on every machine.
double flip_of(const FlipPicture& reference, const FlipPicture& test);

}  // namespace texmesh
