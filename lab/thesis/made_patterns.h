#pragma once
#include <string>
#include <vector>

#include "stages/data/fragments.h"
#include "stages/data/pixels.h"

namespace texmesh {

/// Texture patterns made by code, from plain to complex, named (a) to (x) as the thesis's 24 of Fig. 8.2.
/// Pairs that the thesis compares are pairs here: (i) is (j) darkened, (n) is (p) darkened, (s) has the
/// sharpest edges on the brightest ground.
inline constexpr std::size_t kMadePatterns = 24;
inline constexpr std::uint32_t kPatternPx = 64;
std::string pattern_name(std::size_t pattern);
/// Index of the pattern with this letter.
inline std::size_t pattern_of(char letter) { return static_cast<std::size_t>(letter - 'a'); }

/// One plane, a fragment for each of these patterns, all covered, without feature points.
struct PatternPlane {
  Fragments fragments;
  std::vector<Pixels> pixels;
};
PatternPlane pattern_plane(const std::vector<std::size_t>& patterns, std::uint32_t columns);

}  // namespace texmesh
