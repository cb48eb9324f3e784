#pragma once
#include <array>

namespace texmesh {

/// How finely Draco codes a scale in a file that is to have few bytes, and what that costs.
struct ScaleFineness {
  /// Along the longest side of the object, of texture coordinates along the image, of normals, of vertex
  /// colours; for pictures 512 px high.
  int position_bits, uv_bits, normal_bits, colour_bits;
  double loss;   // square of FLIP, beside the finest
  double bytes;  // times those of kUsualFineness
};

/// From the leanest to the finest. Losses and bytes are means of turtle, saxophone, helmet and bust at
/// several scales, on which a coding loses and saves about alike.
inline constexpr std::array<ScaleFineness, 6> kScaleFineness{{{10, 10, 7, 5, 270e-6, 0.81},
                                                              {11, 11, 7, 6, 150e-6, 0.88},
                                                              {12, 12, 8, 7, 60e-6, 1},
                                                              {13, 13, 8, 8, 35e-6, 1.1},
                                                              {14, 14, 9, 8, 15e-6, 1.23},
                                                              {15, 14, 11, 8, 0, 1.36}}};
inline constexpr int kUsualFineness = 2;

}  // namespace texmesh
