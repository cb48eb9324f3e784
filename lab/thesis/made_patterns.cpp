#include "lab/thesis/made_patterns.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "format/base/portable_math.h"
#include "lab/study/covered_plane.h"
#include "lab/thesis/made_scans.h"

namespace texmesh {
namespace {

enum class Form { kPlain, kRamp, kSoft, kStripes, kBoard, kDots, kGrain, kMixed };

struct Pattern {
  const char* text;
  Form form;
  double ground, contrast;  // 0..1
  double size_px;
  double hue;  // how much the channels differ, 0..1
};

constexpr std::array<Pattern, kMadePatterns> kPatterns{{
    {"plain, dark", Form::kPlain, 0.15, 0, 1, 0},
    {"ramp, middle", Form::kRamp, 0.40, 0.5, 64, 0.1},
    {"soft, bright", Form::kSoft, 0.75, 0.15, 32, 0.1},
    {"plain, bright", Form::kPlain, 0.85, 0, 1, 0.1},
    {"soft, dark", Form::kSoft, 0.25, 0.2, 24, 0},
    {"soft, middle", Form::kSoft, 0.5, 0.35, 16, 0.2},
    {"wide stripes, dark", Form::kStripes, 0.3, 0.3, 16, 0.1},
    {"wide stripes, bright", Form::kStripes, 0.7, 0.3, 16, 0.1},
    {"irregular, dark", Form::kSoft, 0.30, 0.36, 5, 0.3},
    {"irregular, bright", Form::kSoft, 0.60, 0.72, 5, 0.3},
    {"dots, dark", Form::kDots, 0.25, 0.4, 16, 0.2},
    {"edges, dark ground", Form::kBoard, 0.25, 0.45, 16, 0},
    {"ramp, colours", Form::kRamp, 0.5, 0.6, 32, 0.8},
    {"grooves, dark", Form::kStripes, 0.25, 0.30, 6, 0.1},
    {"dots, bright", Form::kDots, 0.75, 0.45, 16, 0.2},
    {"grooves, bright", Form::kStripes, 0.50, 0.60, 6, 0.1},
    {"edges, middle ground", Form::kBoard, 0.4, 0.5, 12, 0.2},
    {"grain, dark", Form::kGrain, 0.35, 0.4, 1, 0.2},
    {"sharp edges, bright ground", Form::kBoard, 0.65, 0.7, 20, 0.1},
    {"grain, bright", Form::kGrain, 0.65, 0.6, 1, 0.2},
    {"mixed, dark", Form::kMixed, 0.35, 0.5, 10, 0.5},
    {"mixed, bright", Form::kMixed, 0.65, 0.6, 10, 0.5},
    {"narrow board", Form::kBoard, 0.5, 0.9, 4, 0.3},
    {"eyes, colours", Form::kMixed, 0.6, 1.0, 12, 1.0},
}};

/// -0.5..0.5
double form_value(const Pattern& p, double x, double y, std::uint32_t seed) {
  const auto cell = [&](double v) { return static_cast<int>(std::floor(v / p.size_px)); };
  const double noise = lattice_noise(x / p.size_px, y / p.size_px, seed) - 0.5;
  switch (p.form) {
    case Form::kPlain:
      return 0;
    case Form::kRamp:
      return x / kPatternPx - 0.5;
    case Form::kSoft:
      return noise;
    case Form::kStripes:
      return 0.5 * portable::sin(2 * portable::kPi * x / p.size_px);
    case Form::kBoard:
      return (cell(x) + cell(y)) % 2 == 0 ? 0.5 : -0.5;
    case Form::kDots: {
      const double u = x - p.size_px * (cell(x) + 0.5), v = y - p.size_px * (cell(y) + 0.5);
      return u * u + v * v < 0.1 * p.size_px * p.size_px ? 0.5 : -0.2;
    }
    case Form::kGrain:
      return lattice_noise(7 * x + 0.5, 7 * y + 0.5, seed) - 0.5;
    case Form::kMixed:
      return 0.6 * noise + 0.3 * ((cell(x) + cell(y)) % 2) +
             0.4 * (lattice_noise(x / 2, y / 2, seed + 1) - 0.5) - 0.15;
  }
  return 0;
}

std::uint8_t pattern_value(std::size_t pattern, std::uint32_t x, std::uint32_t y, std::uint32_t channel) {
  const Pattern& p = kPatterns[pattern];
  // Dark and bright of a pair have the same form: the seed goes by form and size.
  const auto seed = static_cast<std::uint32_t>(100 * static_cast<int>(p.form) + static_cast<int>(p.size_px));
  const double tint = (lattice_noise(x / 16.0, y / 16.0, seed + 50 + channel) - 0.5) * p.hue * p.contrast;
  return static_cast<std::uint8_t>(
      255 * std::clamp(p.ground + p.contrast * form_value(p, x, y, seed) + tint, 0.0, 1.0) + 0.5);
}

}  // namespace

std::string pattern_name(std::size_t pattern) {
  return std::string("(") + static_cast<char>('a' + pattern) + ") " + kPatterns[pattern].text;
}

PatternPlane pattern_plane(const std::vector<std::size_t>& patterns, std::uint32_t columns) {
  TexturePlane plane =
      covered_plane(columns, static_cast<std::uint32_t>(patterns.size()) / columns, kPatternPx, kPatternPx);
  Pixels pixels{plane.width_px, plane.height_px, 3, {}};
  for (std::uint32_t y = 0; y < plane.height_px; ++y)
    for (std::uint32_t x = 0; x < plane.width_px; ++x)
      for (std::uint32_t c = 0; c < 3; ++c)
        pixels.data.push_back(pattern_value(patterns[y / kPatternPx * columns + x / kPatternPx],
                                            x % kPatternPx, y % kPatternPx, c));
  PatternPlane out;
  out.fragments.planes.push_back(std::move(plane));
  out.pixels.push_back(std::move(pixels));
  return out;
}

}  // namespace texmesh
