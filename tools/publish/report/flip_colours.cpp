#include "tools/publish/report/flip_colours.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace texmesh {
namespace {

// Every eighth of the map "magma" (van der Walt and Smith, 2015), the one that FLIP's authors use.
constexpr std::array<std::array<int, 3>, 9> kStops{{{0, 0, 4},
                                                    {28, 16, 68},
                                                    {79, 18, 123},
                                                    {129, 37, 129},
                                                    {181, 54, 122},
                                                    {229, 80, 100},
                                                    {251, 135, 97},
                                                    {254, 194, 135},
                                                    {252, 253, 191}}};

}  // namespace

Vec3<std::uint8_t> heat_colour(double value) {
  const double at = std::clamp(value, 0.0, 1.0) * (kStops.size() - 1);
  const std::size_t stop = std::min(static_cast<std::size_t>(at), kStops.size() - 2);
  const double part = at - static_cast<double>(stop);
  const auto channel = [&](std::size_t c) {
    const double mixed = kStops[stop][c] * (1 - part) + kStops[stop + 1][c] * part;
    return static_cast<std::uint8_t>(std::lround(mixed));
  };
  return {channel(0), channel(1), channel(2)};
}

Pixels heat_picture(const std::vector<float>& values, std::uint32_t side_px, double full) {
  Pixels out{side_px, side_px, 3, {}};
  out.data.reserve(values.size() * 3);
  for (const float v : values) {
    const Vec3<std::uint8_t> c = heat_colour(static_cast<double>(v) / full);
    out.data.insert(out.data.end(), {c.x, c.y, c.z});
  }
  return out;
}

std::string heat_hex(double value) {
  const Vec3<std::uint8_t> c = heat_colour(value);
  return fmt::format("#{:02x}{:02x}{:02x}", c.x, c.y, c.z);
}

}  // namespace texmesh
