#pragma once
#include <cmath>
#include <utility>
#include <vector>

#include "stages/ssf/heat_kernel.h"
#include "stages/ssf/ssf_component.h"

namespace texmesh::testing {

/// Of responses against the truth: relative error, and the share of their coordinates that have the wrong
/// sign, of all of them and of those above a tenth of the rms.
struct ResponseDifference {
  double error = 0, flips = 0, significant = 0;
};

/// `vertex`: for every vertex of the flow, the one of the truth.
inline ResponseDifference compare_responses(const HeatFlow& flow, const HeatFlow& truth,
                                            const std::vector<std::uint32_t>& vertex) {
  double difference = 0, size = 0;
  for (std::size_t v = 0; v < vertex.size(); ++v)
    for (int k = 0; k < 3; ++k) {
      const double a = flow.response[v][k], b = truth.response[vertex[v]][k];
      difference += (a - b) * (a - b);
      size += b * b;
    }
  const double count = 3 * static_cast<double>(vertex.size()), limit = 0.1 * std::sqrt(size / count);
  ResponseDifference out{std::sqrt(difference / size), 0, 0};
  for (std::size_t v = 0; v < vertex.size(); ++v)
    for (int k = 0; k < 3; ++k) {
      const double a = flow.response[v][k], b = truth.response[vertex[v]][k];
      const bool flip = (a < 0) != (b < 0);
      out.flips += flip / count;
      out.significant += (flip && std::fabs(b) > limit) / count;
    }
  return out;
}

/// One scale of a component.
struct ScaleAccuracy {
  double sigma = 0;                    // mean edges
  std::size_t vertices = 0;            // of the pyramid's level
  double bound = 0;                    // of its Laplacian, in 1 / spacing^2
  ResponseDifference single, pyramid;  // one level in single precision; the pyramid
};

/// Climbs the pyramid as scale-space filtering does and compares every scale with one level in double
/// precision.
inline std::vector<ScaleAccuracy> measure_pyramid(const SurfaceComponent& c, const SsfOptions& options,
                                                  const RunContext& context) {
  const SigmaLadder ladder = make_sigma_ladder(options.sigma_max * c.diagonal / c.mean_edge, options);
  const std::span<const double> times(ladder.time.data(), static_cast<std::size_t>(options.scales));
  HeatLevel level = finest_level(c.points, c.corners, 1, options.rate_cap);
  const auto truth = diffuse(level.laplacian, c.points, 0, times, context, HeatPrecision::kDouble);
  const auto single = diffuse(level.laplacian, c.points, 0, times, context);
  std::vector<std::uint32_t> vertex = level.vertex;
  const std::vector<std::uint32_t> all = vertex;
  std::vector<ScaleAccuracy> out;
  // States of the level, from the one that it started from on: the next level takes over one of them.
  std::vector<std::vector<Vec3d>> states{c.points};
  std::vector<double> state_times{0};
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (i > 0 && !carries(level, ladder.sigma[i], options.error_ratio)) {
      HeatLevel coarse = coarsen(level, seed_radius(ladder.sigma[i], options.error_ratio), options.rate_cap);
      std::size_t s = states.size() - 1;
      const double wanted = handover_sigma(ladder.sigma[i]);
      while (s > 0 && state_times[s - 1] > 0 && std::sqrt(2 * state_times[s]) > wanted) --s;
      std::vector<Vec3d> points;
      for (std::size_t v = 0; v < coarse.vertex.size(); ++v) {
        vertex[v] = vertex[coarse.vertex[v]];
        points.push_back(states[s][coarse.vertex[v]]);
      }
      vertex.resize(coarse.vertex.size());
      states = {std::move(points)};
      state_times = {state_times[s]};
      level = std::move(coarse);
    }
    const std::vector<HeatFlow> flow =
        diffuse(level.laplacian, states.back(), state_times.back(), times.subspan(i, 1), context);
    out.push_back({ladder.sigma[i], vertex.size(), level.laplacian.bound * level.spacing * level.spacing,
                   compare_responses(single[i], truth[i], all),
                   compare_responses(flow[0], truth[i], vertex)});
    states.push_back(states.back());
    for (std::size_t v = 0; v < vertex.size(); ++v)
      states.back()[v] = states.back()[v] + to_double(flow[0].moved[v]);
    state_times.push_back(times[i]);
  }
  return out;
}

}  // namespace texmesh::testing
