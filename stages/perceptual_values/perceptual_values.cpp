#include "stages/perceptual_values/perceptual_values.h"

#include "format/base/portable_math.h"
#include "stages/base/parallel.h"
#include "stages/geometry/distance.h"

namespace texmesh {
namespace {

/// A point on a scale.
struct ScalePoint {
  Vec3d at;
  double radius = 0;  // the skeleton distance there, which stands for the size of the shape around it
  std::uint32_t position = 0;  // the corner of its triangle that weighs most
};

/// Distances of the points of finer scales to one scale. Only the largest are asked for, so that few points
/// need a search: guesses bound the others. Safe to ask from many threads.
class ScaleComparison {
 public:
  /// `survivor`: of the scale, per position of S_0. The arguments must outlive the comparison.
  ScaleComparison(const Mesh& mesh, const NestedScale& scale, std::span<const std::uint32_t> survivor)
      : surface_(mesh.positions, mesh.wedge_position, scale.triangles),
        walk_(mesh, scale.triangles, survivor, surface_) {}

  /// The largest `count` distances, at most one for each point, falling; `relative`: over the point's radius.
  std::vector<double> largest(std::span<const ScalePoint> points, std::size_t count, bool relative) const {
    struct Candidate {
      double most;
      std::uint32_t point;
      SurfaceDistance::Hint hint;
      bool is_quick;
      bool operator<(const Candidate& o) const {
        return most < o.most || (most == o.most && point < o.point);
      }
    };
    const auto divisor = [&](std::uint32_t p) { return relative ? points[p].radius : 1; };
    std::vector<Candidate> candidates;
    candidates.reserve(points.size());
    const auto candidate = [&](std::uint32_t p, const ScaleWalk::Guess& guess, bool is_quick) {
      candidates.push_back({std::sqrt(guess.distance2) / divisor(p), p, guess.hint, is_quick});
    };
    for (std::uint32_t p = 0; p < points.size(); ++p)
      candidate(p, walk_.quick_from(points[p].position, points[p].at), true);
    std::make_heap(candidates.begin(), candidates.end());
    count = std::min(count, points.size());
    std::vector<double> found;  // a heap, the least on top
    while (!candidates.empty() && (found.size() < count || candidates.front().most > found.front())) {
      std::pop_heap(candidates.begin(), candidates.end());
      auto [most, p, hint, is_quick] = candidates.back();
      candidates.pop_back();
      if (is_quick) {
        candidate(p, walk_.from(points[p].position, points[p].at), false);
        std::push_heap(candidates.begin(), candidates.end());
        continue;
      }
      found.push_back(surface_(points[p].at, hint) / divisor(p));
      std::push_heap(found.begin(), found.end(), std::greater<>());
      if (found.size() <= count) continue;
      std::pop_heap(found.begin(), found.end(), std::greater<>());
      found.pop_back();
    }
    std::sort(found.begin(), found.end(), std::greater<>());
    return found;
  }

 private:
  SurfaceDistance surface_;
  ScaleWalk walk_;
};

std::vector<ScalePoint> sample_scale(const Mesh& mesh, const NestedScale& scale,
                                     const std::vector<float>& radius, std::size_t count) {
  std::vector<ScalePoint> out;
  for (const SurfaceSample& s : sample_surface(mesh.positions, mesh.wedge_position, scale.triangles, count)) {
    ScalePoint p;
    float most = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t position = mesh.wedge_position[scale.triangles[s.triangle][k]];
      p.at = p.at + to_double(mesh.positions[position]) * static_cast<double>(s.weight[k]);
      p.radius += static_cast<double>(s.weight[k]) * radius[position];
      if (s.weight[k] > most) most = s.weight[k], p.position = position;
    }
    out.push_back(p);
  }
  return out;
}

/// The index of a percentile among rising values.
std::size_t nearest_rank(std::size_t count, double percent) {
  return static_cast<std::size_t>(std::floor(percent / 100 * static_cast<double>(count - 1) + 0.5));
}

/// Nearest-rank percentile; reorders the values. 0 for none.
double percentile(std::vector<double>& values, double percent) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(nearest_rank(values.size(), percent));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// rho of a removed vertex against the one that is left.
double collapse_value(const Skeleton& skeleton, std::uint32_t removed, std::uint32_t left) {
  return std::fabs(static_cast<double>(skeleton.distance[removed]) - skeleton.distance[left]) /
         skeleton.radius[left];
}

/// The column of scale j of the tables of chains.
void chain_statistics(const NestedScales& scales, std::size_t j, std::span<const std::uint32_t> survivor,
                      const Skeleton& skeleton, PerceptualValues& out) {
  const std::size_t n = scales.scales.size();
  double sum = 0, least = 0, most = 0;
  std::size_t count = 0;
  for (std::size_t k = j; k > 0; --k) {
    for (std::size_t c = scales.scales[k - 1].collapse_count; c < scales.scales[k].collapse_count; ++c) {
      const std::uint32_t removed = scales.collapses[c].from;
      const double rho = collapse_value(skeleton, removed, survivor[removed]);
      sum += rho;
      least = count == 0 ? rho : std::min(least, rho);
      most = std::max(most, rho);
      ++count;
    }
    const std::size_t at = (k - 1) * n + j;
    out.chain_average[at] = static_cast<float>(sum / static_cast<double>(std::max<std::size_t>(count, 1)));
    out.chain_largest[at] = static_cast<float>(most);
    out.chain_least[at] = static_cast<float>(least);
  }
}

/// Table 7.1: one scale change.
CollapseStatistics collapse_statistics(const NestedScales& scales, std::size_t k,
                                       std::span<const std::uint32_t> survivor, const Skeleton& skeleton) {
  const std::size_t begin = scales.scales[k - 1].collapse_count, end = scales.scales[k].collapse_count;
  CollapseStatistics out;
  double sum = 0, squares = 0, least = 0, most = 0;
  for (std::size_t i = begin; i < end; ++i) {
    const std::uint32_t removed = scales.collapses[i].from;
    const double rho = collapse_value(skeleton, removed, survivor[removed]);
    sum += rho, squares += rho * rho;
    least = i == begin ? rho : std::min(least, rho);
    most = std::max(most, rho);
  }
  const auto n = static_cast<double>(end - begin);
  if (end == begin) return out;
  const double mean = sum / n;
  out.collapses = static_cast<std::uint32_t>(end - begin);
  out.mean = static_cast<float>(mean), out.max = static_cast<float>(most),
  out.min = static_cast<float>(least);
  out.deviation = static_cast<float>(std::sqrt(std::max(squares / n - mean * mean, 0.0)));
  out.sum = static_cast<float>(sum), out.rss = static_cast<float>(std::sqrt(squares));
  return out;
}

/// Fills p95 and p99 of the pairs that end at scale j; returns the 95th percentile of S_0's distance in
/// object units.
double compare_finer(const NestedScales& scales, std::size_t j, std::span<const std::uint32_t> survivor,
                     const std::vector<std::vector<ScalePoint>>& sampled, const RunContext& context,
                     PerceptualValues& out) {
  const std::size_t n = scales.scales.size();
  const ScaleComparison comparison(scales.mesh, scales.scales[j], survivor);
  double error = 0;
  for (std::size_t i = 0; i < j; ++i) {
    context.check_cancelled();
    const std::size_t count = sampled[i].size();
    if (count == 0) continue;
    const std::size_t asked = count - nearest_rank(count, 95);
    const std::vector<double> rho = comparison.largest(sampled[i], asked, true);
    out.p95[i * n + j] = static_cast<float>(rho.back());
    out.p99[i * n + j] = static_cast<float>(rho[count - 1 - nearest_rank(count, 99)]);
    if (i == 0) error = comparison.largest(sampled[i], asked, false).back();
  }
  return error;
}

/// All that is measured scale by scale: chains, steps, p95 and p99. Returns per scale the 95th percentile of
/// S_0's distance in object units.
std::vector<double> compare_scales(const NestedScales& scales, const Skeleton& skeleton, std::size_t samples,
                                   const RunContext& context, PerceptualValues& out) {
  const std::size_t n = scales.scales.size();
  std::vector<std::vector<ScalePoint>> sampled(n);
  parallel_each(context, n - 1, 1, [&](std::size_t i) {
    sampled[i] = sample_scale(scales.mesh, scales.scales[i], skeleton.radius,
                              enough_samples(scales.scales[i].triangles.size(), samples));
  });
  std::vector<double> error(n, 0);
  std::atomic<std::size_t> done = 0;
  parallel_for(context, n - 1, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t j = begin + 1; j <= end; ++j) {
      const std::vector<std::uint32_t> survivor =
          survivors(scales.mesh.positions.size(), scales.collapses, scales.scales[j].collapse_count);
      out.step[j] = collapse_statistics(scales, j, survivor, skeleton);
      chain_statistics(scales, j, survivor, skeleton, out);
      error[j] = compare_finer(scales, j, survivor, sampled, context, out);
      context.report(static_cast<double>(++done) / static_cast<double>(n));
    }
  });
  return error;
}

/// Of kept scales with nearly the same number of triangles only the finest stays, and the coarsest of all.
/// The finest is enough wherever the others are, major ones too, and the others would only add bytes to the
/// package. Atlases whose vertices are nearly all locked give rows of such scales.
void drop_neighbours(std::size_t n, const auto& log_triangles, std::vector<std::uint8_t>& kept) {
  const double least = portable::log(1.5);
  std::size_t finer = 0;
  for (std::size_t k = 1; k + 1 < n; ++k) {
    if (!kept[k]) continue;
    const bool near =
        log_triangles(finer) - log_triangles(k) < least || log_triangles(k) - log_triangles(n - 1) < least;
    if (near)
      kept[k] = 0;
    else
      finer = k;
  }
}

void choose_kept(const NestedScales& scales, int kept_scales, PerceptualValues& out) {
  const std::size_t n = scales.scales.size();
  out.kept = out.major;
  out.kept[0] = out.kept[n - 1] = 1;
  if (kept_scales == 0) return;
  auto log_triangles = [&](std::size_t k) {
    return portable::log(static_cast<double>(scales.scales[k].triangles.size()));
  };
  const double top = log_triangles(0), span = top - log_triangles(n - 1);
  const double step = std::max(span / kept_scales, portable::log(2));
  for (int m = 1; m <= kept_scales; ++m) {
    const double want = top - step * m;
    std::size_t nearest = 0;
    for (std::size_t k = 1; k < n; ++k)
      if (std::fabs(log_triangles(k) - want) < std::fabs(log_triangles(nearest) - want)) nearest = k;
    out.kept[nearest] = 1;
  }
  drop_neighbours(n, log_triangles, out.kept);
}

double shortest_edge(const Mesh& mesh, const NestedScale& scale, double percent) {
  std::vector<double> edges;
  edges.reserve(3 * scale.triangles.size());
  for (const Triangle& t : scale.triangles)
    for (std::size_t k = 0; k < 3; ++k)
      edges.push_back(length(to_double(mesh.positions[mesh.wedge_position[t[k]]]) -
                             to_double(mesh.positions[mesh.wedge_position[t[(k + 1) % 3]]])));
  return percentile(edges, percent);
}

float height_px(double numerator, double denominator) {
  const double px = denominator > 0 ? numerator / denominator : kAnyHeightPx;
  return static_cast<float>(std::min<double>(px, kAnyHeightPx));
}

/// The height up to which a scale of that value passes for S_0: where jnd (reference / height)^exponent is
/// the value.
float jnd_height_px(const PerceptualValuesOptions& options, double value) {
  const double exponent = options.jnd_distance_exponent;
  if (exponent == 1 || !(value > 0)) return height_px(options.jnd_reference_px * options.jnd, value);
  if (exponent == 0) return value < options.jnd ? kAnyHeightPx : 0;
  // pow() would overflow for exponents near 0.
  const double log_height =
      portable::log(options.jnd_reference_px) + portable::log(options.jnd / value) / exponent;
  return log_height > portable::log(kAnyHeightPx) ? kAnyHeightPx
                                                  : static_cast<float>(portable::exp(log_height));
}

void find_displayed_heights(const NestedScales& scales, const std::vector<double>& error,
                            const PerceptualValuesOptions& options, const std::vector<float>& value,
                            const RunContext& context, PerceptualValues& out) {
  out.object_height = bounding_box(scales.mesh.positions).longest_side();
  std::vector<double> edge(scales.scales.size());
  parallel_each(context, edge.size(), 1, [&](std::size_t k) {
    edge[k] = shortest_edge(scales.mesh, scales.scales[k], options.edge_percentile);
  });
  for (std::size_t k = 0; k < scales.scales.size(); ++k) {
    out.display_px_edge.push_back(height_px(out.object_height, edge[k]));
    out.display_px_error.push_back(height_px(out.object_height, error[k]));
    out.display_px_jnd.push_back(jnd_height_px(options, static_cast<double>(value[k])));
    if (k == 0) continue;
    for (std::vector<float>* px : {&out.display_px_edge, &out.display_px_error, &out.display_px_jnd})
      (*px)[k] = std::min((*px)[k], (*px)[k - 1]);
  }
}

/// A tier, from behind one major scale to the next, is shown as its last scale at
/// every size at which O_V / E_S matches one of the tier best. S_0's tier is all that cannot be told from
/// S_0.
void step_by_tiers(double jnd, const std::vector<float>& value, PerceptualValues& out) {
  const std::size_t n = out.major.size();
  std::size_t begin = 0;  // the major scale before, or S_0
  for (std::size_t k = 1; k < n; ++k) {
    if (!out.major[k]) continue;
    const double nearest =
        std::sqrt(double{out.display_px_edge[begin]} * double{out.display_px_edge[begin + 1]});
    const bool as_s0 = begin == 0 && double{value[k]} < jnd;
    const auto limit = as_s0 ? kAnyHeightPx : static_cast<float>(std::min<double>(nearest, kAnyHeightPx));
    for (std::size_t i = begin + 1; i <= k; ++i)
      out.display_px_jnd[i] = std::min(limit, out.display_px_jnd[i - 1]);
    begin = k;
  }
}

float strategy_value(const CollapseStatistics& s, PerceptualStatistic strategy) {
  if (strategy == PerceptualStatistic::kConservative) return s.max;
  return strategy == PerceptualStatistic::kAggressive ? s.min : s.mean;
}

}  // namespace

std::vector<float> cumulative_table(const std::vector<CollapseStatistics>& step,
                                    PerceptualStatistic strategy) {
  if (strategy == PerceptualStatistic::kP95)
    throw StageError("perceptual_values", "statistic", "average, conservative or aggressive",
                     std::string(enum_name(strategy)));
  std::vector<float> values;
  for (const CollapseStatistics& s : step) values.push_back(strategy_value(s, strategy));
  return chained_values(values);
}

std::vector<float> value_table(const PerceptualValues& values, PerceptualStatistic statistic,
                               ChainRule chain) {
  if (statistic == PerceptualStatistic::kP95) return values.p95;
  if (chain == ChainRule::kSurvivor)
    return statistic == PerceptualStatistic::kAverage        ? values.chain_average
           : statistic == PerceptualStatistic::kConservative ? values.chain_largest
                                                             : values.chain_least;
  return cumulative_table(values.step, statistic);
}

PerceptualValues measure_perceptual_values(const NestedScales& scales, const Skeleton& skeleton,
                                           const PerceptualValuesOptions& options,
                                           const RunContext& context) {
  const std::size_t n = scales.scales.size(), positions = scales.mesh.positions.size();
  if (skeleton.distance.size() != positions || skeleton.radius.size() != positions)
    throw StageError("perceptual_values", "skeleton", std::to_string(positions) + " positions",
                     std::to_string(skeleton.distance.size()));
  PerceptualValues out;
  out.step.resize(n);
  out.p95.assign(n * n, 0), out.p99.assign(n * n, 0);
  for (std::vector<float>* chain : {&out.chain_average, &out.chain_largest, &out.chain_least})
    chain->assign(n * n, 0);
  const std::vector<double> error =
      compare_scales(scales, skeleton, static_cast<std::size_t>(options.samples), context, out);
  const std::vector<float> value = value_table(out, options.statistic, options.chain);
  out.major = major_rows(value, n, options.jnd);
  choose_kept(scales, options.kept_scales, out);
  find_displayed_heights(scales, error, options, value, context, out);
  if (options.steps == StepsBy::kTiers) step_by_tiers(options.jnd, value, out);
  return out;
}

}  // namespace texmesh
