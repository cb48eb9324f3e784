#include "stages/ssf.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>

#include "format/portable_math.h"
#include "stages/heat_kernel.h"
#include "stages/mesh_topology.h"
#include "stages/parallel.h"

namespace texmesh {
namespace {

/// Components below this many vertices are solved whole by one thread each, many at a time.
constexpr std::size_t kSmallComponent = 8192;
/// Edges whose rate is capped, beyond which fine scales of the response are off by 20 %, as
/// measured on an unevenly sampled head.
constexpr double kManyCapped = 0.1;

/// The response of a surface without relief is what discretisation makes of its curvature, some percent of
/// it. Contrast is measured against at least this share of the curvature's rms, and this many roundings of a
/// coordinate.
constexpr double kBaseShare = 0.15, kNoise = 4;

/// One connected component with its twins joined: the surface as heat sees it.
struct Component {
  std::vector<std::uint32_t> positions;  // per vertex: the position (lowest twin); in Morton order
  std::vector<std::uint32_t> corners;    // three vertices per triangle
  std::vector<bool>
      fan_of_position;        // per corner: the triangle belongs to the vertex's own position, not a twin's
  std::vector<Vec3d> points;  // centred, in units of the mean edge
  double mean_edge = 0, diagonal = 0;  // object units
  double noise = 0;                    // rounding of the stored coordinates, in units of the mean edge
};

/// A component's scales. Times are in units of the mean edge squared; the last `band` ones only serve as
/// subtrahends.
struct Ladder {
  std::vector<double> sigma;  // [scales + band]
  std::vector<double> time;
  std::size_t band = 0;  // C_i = t_i (H(sigma_i) - H(sigma_{i + band}))
  bool lowered = false;  // by the work cap
};

constexpr std::uint8_t kExtremum = 1, kCrossing = 2;

struct Features {
  std::vector<std::uint64_t> any, crossing;  // per vertex: bit i = a feature point at scale i + 1
  std::vector<float> convergence;            // [scales + 1]
  std::vector<double> sigma;  // [scales], object units; empty for a component below its first scale
  bool lowered = false;
  double capped = 0;
};

std::uint64_t spread_bits(std::uint64_t x) {
  x &= 0x1fffff;
  x = (x | x << 32) & 0x1f00000000ffffull;
  x = (x | x << 16) & 0x1f0000ff0000ffull;
  x = (x | x << 8) & 0x100f00f00f00f00full;
  x = (x | x << 4) & 0x10c30c30c30c30c3ull;
  return (x | x << 2) & 0x1249249249249249ull;
}

/// Lowest twins, grouped by component and within it along a Morton curve: neighbours in space are neighbours
/// in memory.
std::vector<std::vector<std::uint32_t>> group_positions(const ConditionedMesh& mesh) {
  const auto& positions = mesh.mesh.positions;
  Vec3d lo = to_double(positions[0]), hi = lo;
  for (Vec3f p : positions)
    for (int k = 0; k < 3; ++k) {
      lo[k] = std::min(lo[k], double{p[k]});
      hi[k] = std::max(hi[k], double{p[k]});
    }
  const double side = std::max({hi.x - lo.x, hi.y - lo.y, hi.z - lo.z, 1e-300});
  const auto code = [&](std::uint32_t p) {
    std::uint64_t bits = 0;
    for (int k = 0; k < 3; ++k)
      bits |= spread_bits(static_cast<std::uint64_t>((double{positions[p][k]} - lo[k]) / side * 0x1fffff))
              << k;
    return bits;
  };
  std::vector<std::vector<std::pair<std::uint64_t, std::uint32_t>>> keyed(mesh.component_count);
  for (std::uint32_t p = 0; p < positions.size(); ++p)
    if (mesh.twin[p] == p) keyed[mesh.component[p]].emplace_back(code(p), p);
  std::vector<std::vector<std::uint32_t>> groups(mesh.component_count);
  for (std::size_t c = 0; c < keyed.size(); ++c) {
    std::sort(keyed[c].begin(), keyed[c].end());
    for (const auto& [bits, p] : keyed[c]) groups[c].push_back(p);
  }
  return groups;
}

void measure(Component& c, const Mesh& mesh) {
  Vec3d lo = to_double(mesh.positions[c.positions[0]]), hi = lo;
  double largest = 0;
  for (std::uint32_t p : c.positions)
    for (int k = 0; k < 3; ++k) {
      const double x = mesh.positions[p][k];
      lo[k] = std::min(lo[k], x);
      hi[k] = std::max(hi[k], x);
      largest = std::max(largest, std::fabs(x));
    }
  const Vec3d centre = (lo + hi) * 0.5;
  c.diagonal = length(hi - lo);
  for (std::uint32_t p : c.positions) c.points.push_back(to_double(mesh.positions[p]) - centre);
  double sum = 0;
  for (std::uint32_t h = 0; h < c.corners.size(); ++h)
    sum += length(c.points[c.corners[h]] - c.points[c.corners[next_corner(h)]]);
  c.mean_edge = sum / static_cast<double>(c.corners.size());
  for (Vec3d& p : c.points) p = p * (1 / c.mean_edge);
  c.noise = largest * 0x1p-24 / c.mean_edge;
}

std::vector<Component> split_components(const ConditionedMesh& mesh) {
  const Mesh& m = mesh.mesh;
  std::vector<std::vector<std::uint32_t>> groups = group_positions(mesh);
  std::vector<Component> components(groups.size());
  std::vector<std::uint32_t> vertex(m.positions.size(), 0);  // of a lowest twin within its component
  for (std::size_t c = 0; c < groups.size(); ++c) {
    for (std::uint32_t v = 0; v < groups[c].size(); ++v) vertex[groups[c][v]] = v;
    components[c].positions = std::move(groups[c]);
  }
  for (std::uint32_t t = 0; t < m.triangles.size(); ++t) {
    Component& c = components[mesh.component[m.position_of(t, 0)]];
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t p = m.position_of(t, k);
      c.corners.push_back(vertex[mesh.twin[p]]);
      c.fan_of_position.push_back(mesh.twin[p] == p);
    }
  }
  for (Component& c : components) measure(c, m);
  return components;
}

/// Geometric from the mean edge to sigma_max (in mean edges). The band ratio is rounded to whole steps of the
/// ladder, so that the subtrahends are scales of it too.
Ladder make_ladder(double sigma_max, double bound, const SsfOptions& options) {
  Ladder ladder;
  const auto lay = [&](double last) {
    const double step =
        options.scales > 1 ? portable::log(last) / (options.scales - 1) : portable::log(options.band);
    ladder.band =
        static_cast<std::size_t>(std::max(1.0, std::floor(portable::log(options.band) / step + 0.5)));
    // A ladder that spans less than the band has small steps; its subtrahends are as many as its scales then.
    ladder.band = std::min(ladder.band, static_cast<std::size_t>(options.scales));
    ladder.sigma.clear();
    for (std::size_t i = 0; i < static_cast<std::size_t>(options.scales) + ladder.band; ++i)
      ladder.sigma.push_back(portable::exp(step * static_cast<double>(i)));
    return ladder.sigma.back();
  };
  const double last = lay(sigma_max), limit = std::sqrt(2 * heat_time(options.max_terms, bound));
  // The band grows a little when the steps shrink: take the share off and, where that was not enough, once
  // more.
  double reduced = sigma_max;
  for (double reached = last; reached > limit && reduced > 1.05;) {
    ladder.lowered = true;
    reduced = std::max(1.05, reduced * 0.98 * limit / reached);
    reached = lay(reduced);
  }
  for (double s : ladder.sigma) ladder.time.push_back(0.5 * s * s);
  return ladder;
}

std::vector<Vec3d> vertex_normals(const Component& c, const HeatFlow& flow, std::size_t time) {
  std::vector<Vec3d> normal(c.points.size());
  for (std::size_t h = 0; h < c.corners.size(); h += 3) {
    const Vec3d a = to_double(flow.at(c.corners[h], time).smooth);
    const Vec3d n = cross(to_double(flow.at(c.corners[h + 1], time).smooth) - a,
                          to_double(flow.at(c.corners[h + 2], time).smooth) - a);
    // One fan decides where twins are joined: the two sides of a sheet would cancel out.
    for (std::size_t k = 0; k < 3; ++k)
      if (c.fan_of_position[h + k]) normal[c.corners[h + k]] = normal[c.corners[h + k]] + n;
  }
  return normal;
}

/// t H per time and vertex. With L positive semi-definite, L x = 2 H n.
std::vector<std::vector<float>> curvatures(const Component& c, const HeatFlow& flow,
                                           const RunContext& context) {
  std::vector<std::vector<float>> curvature(flow.times);
  parallel_for(context, flow.times, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t s = begin; s < end; ++s) {
      const std::vector<Vec3d> normal = vertex_normals(c, flow, s);
      curvature[s].resize(c.points.size());
      for (std::size_t v = 0; v < c.points.size(); ++v)
        curvature[s][v] =
            static_cast<float>(0.5 * dot(to_double(flow.at(v, s).response), normalized(normal[v])));
    }
  });
  return curvature;
}

std::vector<float> band_pass(const std::vector<std::vector<float>>& curvature, const Ladder& ladder,
                             std::size_t i) {
  const std::vector<float>&fine = curvature[i], &coarse = curvature[i + ladder.band];
  const auto ratio = static_cast<float>(ladder.time[i] / ladder.time[i + ladder.band]);
  std::vector<float> g(fine.size());
  for (std::size_t v = 0; v < g.size(); ++v) g[v] = fine[v] - ratio * coarse[v];
  return g;
}

double rms(const std::vector<float>& values) {
  double squares = 0;
  for (float x : values) squares += double{x} * x;
  return std::sqrt(squares / static_cast<double>(values.size()));
}

/// Features of one response: 1-ring extrema, and zero crossings at the endpoint that is closer to zero, both
/// with the contrast rule. The response is taken about its mean, which is what heat flow makes of the shape
/// as a whole (a sphere shrinks) and would leave convex shapes without zero crossings above mid scale.
/// `least` stands in for its rms where that is lower.
std::vector<std::uint8_t> find_features(const Component& c, const HeatOperator& graph, std::vector<float> g,
                                        double sigma, double least, double contrast) {
  const std::size_t n = g.size();
  double sum = 0;
  for (float x : g) sum += x;
  const auto mean_response = static_cast<float>(sum / static_cast<double>(n));
  const double threshold = contrast * std::max(rms(g), least);
  for (float& x : g) x -= mean_response;
  std::vector<std::uint8_t> found(n, 0);
  for (std::uint32_t v = 0; v < n; ++v) {
    bool highest = true, lowest = true;
    double edges = 0, difference = 0;
    for (std::uint32_t k = graph.first[v]; k < graph.first[v + 1]; ++k) {
      const std::uint32_t u = graph.column[k];
      const double edge = length(c.points[u] - c.points[v]);
      edges += edge;
      difference += double{g[v]} - g[u];
      highest = highest && (g[v] > g[u] || (g[v] == g[u] && v < u));
      lowest = lowest && (g[v] < g[u] || (g[v] == g[u] && v < u));
      if (v < u && (g[v] < 0) != (g[u] < 0) && std::fabs(double{g[v]} - g[u]) * sigma > threshold * edge)
        found[std::fabs(g[v]) <= std::fabs(g[u]) ? v : u] |= kCrossing;
    }
    // A response of scale sigma falls off by about (edge / sigma)^2 / 2 around its extremum; ripples of the
    // mesh on a plateau do not.
    const double degree = graph.first[v + 1] - graph.first[v], mean = edges / degree;
    const double fall = 2 * std::fabs(difference) / degree * (sigma / mean) * (sigma / mean);
    if ((highest || lowest) && std::fabs(g[v]) > threshold && fall > threshold) found[v] |= kExtremum;
  }
  return found;
}

/// Extent of the smoothed points along the axis where it is largest.
double extent(const HeatFlow& flow, std::size_t vertices, std::size_t time) {
  Vec3f lo = flow.at(0, time).smooth, hi = lo;
  for (std::size_t v = 1; v < vertices; ++v)
    for (int k = 0; k < 3; ++k) {
      lo[k] = std::min(lo[k], flow.at(v, time).smooth[k]);
      hi[k] = std::max(hi[k], flow.at(v, time).smooth[k]);
    }
  return double{std::max({hi.x - lo.x, hi.y - lo.y, hi.z - lo.z})};
}

double extent(std::span<const Vec3d> points) {
  Vec3d lo = points[0], hi = lo;
  for (Vec3d p : points)
    for (int k = 0; k < 3; ++k) {
      lo[k] = std::min(lo[k], p[k]);
      hi[k] = std::max(hi[k], p[k]);
    }
  return std::max({hi.x - lo.x, hi.y - lo.y, hi.z - lo.z});
}

void merge(const std::vector<std::vector<std::uint8_t>>& found, Features& out) {
  for (std::size_t i = 0; i < found.size(); ++i)
    for (std::size_t v = 0; v < found[i].size(); ++v) {
      out.any[v] |= std::uint64_t{found[i][v] != 0} << i;
      out.crossing[v] |= std::uint64_t{(found[i][v] & kCrossing) != 0} << i;
    }
}

Features filter_component(const Component& c, const SsfOptions& options, const RunContext& context) {
  const auto scales = static_cast<std::size_t>(options.scales);
  Features out;
  out.any.assign(c.points.size(), 0);
  out.crossing.assign(c.points.size(), 0);
  out.convergence.assign(scales + 1, 1);
  const double size = c.diagonal / c.mean_edge;
  double sigma_max = options.sigma_max * size;
  if (sigma_max <= 1) return out;  // smaller than its first scale: all of it is detail

  const HeatOperator laplacian = make_heat_operator(c.points, c.corners, 1, options.rate_cap);
  out.capped = laplacian.capped;
  const double range = extent(c.points);
  Ladder ladder;
  HeatFlow flow;
  for (bool converged = false;;) {
    ladder = make_ladder(sigma_max, laplacian.bound, options);
    flow = diffuse(laplacian, c.points, ladder.time, context);
    std::size_t last = scales;
    for (std::size_t i = scales; i-- > 0;) {
      out.convergence[i + 1] = static_cast<float>(extent(flow, c.points.size(), i) / range);
      if (i > 0 && out.convergence[i + 1] < options.convergence) last = i;
    }
    // The ladder is laid anew up to the first scale that has converged, once.
    if (last + 1 >= scales || converged) break;
    converged = true;
    sigma_max = ladder.sigma[last];
  }
  out.lowered = ladder.lowered;
  for (std::size_t i = 0; i < scales; ++i) out.sigma.push_back(ladder.sigma[i] * c.mean_edge);

  const std::vector<std::vector<float>> curvature = curvatures(c, flow, context);
  flow = {};
  std::vector<std::vector<std::uint8_t>> found(scales);
  parallel_for(context, scales, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      found[i] = find_features(c, laplacian, band_pass(curvature, ladder, i), ladder.sigma[i],
                               std::max(kNoise * c.noise, kBaseShare * rms(curvature[i])), options.contrast);
  });
  merge(found, out);
  return out;
}

std::vector<Features> filter_components(const std::vector<Component>& components, const SsfOptions& options,
                                        const RunContext& context) {
  std::vector<Features> features(components.size());
  std::vector<std::uint32_t> small;
  std::size_t total = 0, done = 0;
  for (const Component& c : components) total += c.points.size();
  for (std::uint32_t c = 0; c < components.size(); ++c) {
    if (components[c].points.size() < kSmallComponent) {
      small.push_back(c);
      continue;
    }
    features[c] = filter_component(components[c], options, context);
    done += components[c].points.size();
    context.report(static_cast<double>(done) / static_cast<double>(total));
  }
  RunContext alone = context;
  alone.threads = 1;
  alone.progress = nullptr;
  parallel_for(context, small.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      features[small[i]] = filter_component(components[small[i]], options, alone);
  });
  return features;
}

std::size_t largest_component(const std::vector<Component>& components,
                              const std::vector<Features>& features) {
  std::size_t best = 0;
  const auto rank = [&](std::size_t c) {
    return std::pair(!features[c].sigma.empty(), components[c].points.size());
  };
  for (std::size_t c = 1; c < components.size(); ++c)
    if (rank(c) > rank(best)) best = c;
  return best;
}

/// The last scale whose sigma, its own and that of the largest component, is within the cap of a component's
/// size.
std::size_t last_scale(const Component& c, const Features& own, const std::vector<float>& sigma, double cap) {
  std::size_t last = 0;
  while (last < own.sigma.size() && std::max(own.sigma[last], double{sigma[last + 1]}) <= cap * c.diagonal)
    ++last;
  return last;
}

void describe(const std::vector<Features>& features, std::size_t largest, Notes& notes) {
  const auto lowered =
      std::count_if(features.begin(), features.end(), [](const Features& f) { return f.lowered; });
  if (lowered)
    add_info(notes, "scale-space-work-cap", "",
             "largest sigmas of " + std::to_string(lowered) + " component(s) lowered to fit max_terms");
  if (features[largest].capped > kManyCapped)
    add_info(
        notes, "scale-space-rate-cap", "",
        std::to_string(static_cast<int>(100 * features[largest].capped)) +
            " % of the edges of the largest component have a capped rate; its finest scales are approximate");
}

}  // namespace

ScaleMap filter_scale_space(const ConditionedMesh& mesh, const SsfOptions& options,
                            const RunContext& context) {
  const std::vector<Component> components = split_components(mesh);
  const std::vector<Features> features = filter_components(components, options, context);
  const std::size_t largest = largest_component(components, features);

  ScaleMap map;
  map.scales = options.scales;
  map.sigma.assign(static_cast<std::size_t>(options.scales) + 1, 0);
  std::copy(features[largest].sigma.begin(), features[largest].sigma.end(), map.sigma.begin() + 1);
  map.convergence = features[largest].convergence;
  map.crossings_at.assign(static_cast<std::size_t>(options.scales) + 1, 0);
  map.crossings_at[0] = static_cast<std::uint32_t>(mesh.mesh.positions.size());
  map.persistence.assign(mesh.mesh.positions.size(), 0);
  map.crossing.assign(mesh.mesh.positions.size(), 0);
  for (std::size_t c = 0; c < components.size(); ++c) {
    const std::size_t last = last_scale(components[c], features[c], map.sigma, options.component_cap);
    const std::uint64_t within = (std::uint64_t{1} << last) - 1;
    for (std::size_t v = 0; v < components[c].positions.size(); ++v) {
      const std::uint64_t any = features[c].any[v] & within, crossing = features[c].crossing[v] & within;
      map.persistence[components[c].positions[v]] = static_cast<std::uint8_t>(std::bit_width(any));
      map.crossing[components[c].positions[v]] = static_cast<std::uint8_t>(std::bit_width(crossing));
      for (std::size_t i = 1; i <= last; ++i) map.crossings_at[i] += crossing >> (i - 1) & 1;
    }
  }
  for (std::size_t p = 0; p < map.persistence.size(); ++p) {
    map.persistence[p] = map.persistence[mesh.twin[p]];
    map.crossing[p] = map.crossing[mesh.twin[p]];
  }
  describe(features, largest, map.notes);
  context.report(1);
  return map;
}

}  // namespace texmesh
