#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace texmesh {

/// Measured quality of scale x rung samples: quality.json.
struct QualityTable {
  std::vector<int> scales;        // scale numbers, rising (0 = S_0)
  std::vector<int> rungs;         // IJG qualities, rising; {100} for models without planes
  std::vector<float> ssim;        // [scale index * rungs + rung index], 0..1, 1 = equal
  std::vector<float> difference;  // mean FLIP, 0..1, 0 = equal
  std::uint32_t views = 0, size_px = 0;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.scales, s.rungs, s.ssim, s.difference, s.views, s.size_px);
  }
  friend bool operator==(const QualityTable&, const QualityTable&) = default;
};

std::string write_quality(const QualityTable& table);           // canonical JSON
QualityTable read_quality(std::span<const std::uint8_t> json);  // strict; FormatError

}  // namespace texmesh
