#pragma once
#include <cstdint>
#include <functional>

namespace texmesh {

inline constexpr double kLowestQuality = 1, kHighestQuality = 100;

/// The quality, of those tried, for which bytes(quality) comes nearest to `wanted` from below; the lowest one
/// where none does. By the secant of the bytes' logarithm from `start`, until `near` of `wanted` is reached.
/// Calls bytes() at most `tries` times; it should grow with the quality.
double quality_for(double wanted, double start, double near, int tries,
                   const std::function<std::uint64_t(double)>& bytes);

}  // namespace texmesh
