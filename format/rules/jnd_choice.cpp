#include "format/rules/jnd_choice.h"

#include <algorithm>
#include <cmath>

namespace texmesh {

std::vector<float> chained_values(std::span<const float> step) {
  const std::size_t n = step.size();
  std::vector<float> value(n * n, 0);
  for (std::size_t i = 0; i < n; ++i) {
    double squares = 0;
    for (std::size_t j = i + 1; j < n; ++j) {
      squares += static_cast<double>(step[j]) * static_cast<double>(step[j]);
      value[i * n + j] = static_cast<float>(std::sqrt(squares));
    }
  }
  return value;
}

std::vector<float> pair_values(const PerceptualTable& t, PerceptualStatistic statistic, ChainRule chain) {
  const bool average = statistic == PerceptualStatistic::kAverage;
  const bool largest = statistic == PerceptualStatistic::kConservative;
  if (statistic != PerceptualStatistic::kP95 && chain == ChainRule::kRootOfSquares)
    return chained_values(average ? t.average : largest ? t.largest : t.least);
  const std::vector<float>& pairs = statistic == PerceptualStatistic::kP95 ? t.p95
                                    : average                              ? t.chain_average
                                    : largest                              ? t.chain_largest
                                                                           : t.chain_least;
  const std::size_t n = t.scale.size();
  std::vector<float> value(n * n, 0);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = i + 1; j < n; ++j) value[i * n + j] = pairs[pair_index(n, i, j)];
  return value;
}

std::size_t coarsest_alike(std::span<const float> value, std::size_t rows, std::size_t row, double jnd) {
  std::size_t last = row;
  while (last + 1 < rows && static_cast<double>(value[row * rows + last + 1]) < jnd) ++last;
  return last;
}

std::vector<std::uint8_t> major_rows(std::span<const float> value, std::size_t rows, double jnd) {
  std::vector<std::uint8_t> major(rows, 0);
  for (std::size_t i = 0; i + 1 < rows;) {
    i = std::max(i + 1, coarsest_alike(value, rows, i, jnd));
    major[i] = 1;
  }
  return major;
}

std::size_t refine_to(std::span<const float> value, std::size_t rows, std::size_t have, std::size_t want,
                      double jnd) {
  return want < have ? std::min(have, coarsest_alike(value, rows, want, jnd)) : have;
}

}  // namespace texmesh
