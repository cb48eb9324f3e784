#include "stages/ssf/ssf_component.h"

#include "format/base/portable_math.h"
#include "stages/base/parallel.h"
#include "stages/ssf/heat_kernel.h"

namespace texmesh {
namespace {

/// The response of a surface without relief is what discretisation makes of its curvature, some percent of
/// it. Contrast is measured against at least this share of the curvature's rms, and this many roundings of a
/// coordinate.
constexpr double kBaseShare = 0.15, kNoiseFactor = 4;

/// Where more edges than this have a capped rate, scales are 20 % off on an unevenly sampled head.
constexpr double kManyCapped = 0.1;
/// What is closer than this, in mean edges, is one vertex then.
constexpr double kCluster = 0.5;

constexpr double kTrimmed = 0.02;  // of a level; with 0 a saxophone takes a third longer
/// What the accumulators of one recurrence may take; simplification takes more. Splitting costs more terms.
constexpr std::size_t kFlowBytes = std::size_t{256} << 20, kLeastTimesAtOnce = 8;
constexpr std::size_t kCrossingGrain = 4096;
constexpr std::uint8_t kExtremum = 1, kCrossing = 2;

Vec3d moved(Vec3d point, Vec3f by) { return point + to_double(by); }

std::vector<Vec3d> moved(const std::vector<Vec3d>& points, const HeatFlow& flow) {
  std::vector<Vec3d> out(points.size());
  for (std::size_t v = 0; v < points.size(); ++v) out[v] = moved(points[v], flow.moved[v]);
  return out;
}

double rms(const std::vector<float>& values) {
  double squares = 0;
  for (float x : values) squares += double{x} * x;
  return std::sqrt(squares / static_cast<double>(values.size()));
}

/// Finds feature points of one response on one level.
class FeatureFinder {
 public:
  /// The response is taken about its mean, which is what heat flow makes of the shape as a whole (a sphere
  /// shrinks) and would leave convex shapes without zero crossings above mid scale. `least` stands in for its
  /// rms where that is lower.
  FeatureFinder(const HeatLevel& level, std::vector<float> g, double sigma, double least, double contrast)
      : FeatureFinder(level, std::move(g), sigma) {
    double sum = 0;
    for (float x : g_) sum += double{x};
    const auto mean = static_cast<float>(sum / static_cast<double>(g_.size()));
    threshold_ = contrast * std::max(rms(g_), least);
    for (float& x : g_) x -= mean;
  }

  /// As it is; `noise`: what differences in it are rounding.
  static FeatureFinder as_printed(const HeatLevel& level, std::vector<float> g, double sigma, double noise) {
    FeatureFinder finder(level, std::move(g), sigma);
    finder.threshold_ = noise;
    return finder;
  }

  /// 1-ring extrema, and zero crossings at the endpoint that is closer to zero, both with the contrast rule;
  /// none of a kind closer than `apart` to another along the surface.
  std::vector<std::uint8_t> find(double apart, const RunContext& context) const {
    std::vector<std::uint8_t> found(g_.size(), 0);
    parallel_each(context, found.size(), kCrossingGrain,
                  [&](std::size_t v) { found[v] = feature_kind(static_cast<std::uint32_t>(v)); });
    for (std::uint8_t kind : {kExtremum, kCrossing}) thin_out(found, kind, apart);
    return found;
  }

 private:
  FeatureFinder(const HeatLevel& level, std::vector<float> g, double sigma)
      : level_(level), g_(std::move(g)), sigma_(sigma) {}

  std::uint8_t feature_kind(std::uint32_t v) const {
    const HeatOperator& graph = level_.laplacian;
    bool highest = true, lowest = true, crossing = false;
    double edges = 0, difference = 0;
    for (std::uint32_t k = graph.first[v]; k < graph.first[v + 1]; ++k) {
      const std::uint32_t u = graph.column[k];
      const double edge = length(level_.points[u] - level_.points[v]), step = double{g_[v]} - double{g_[u]};
      edges += edge;
      difference += step;
      highest = highest && (g_[v] > g_[u] || (g_[v] == g_[u] && v < u));
      lowest = lowest && (g_[v] < g_[u] || (g_[v] == g_[u] && v < u));
      const float here = std::fabs(g_[v]), there = std::fabs(g_[u]);
      crossing = crossing || ((g_[v] < 0) != (g_[u] < 0) && (here < there || (here == there && v < u)) &&
                              std::fabs(step) * sigma_ > threshold_ * edge);
    }
    // A response of scale sigma falls off by about (edge / sigma)^2 / 2 around its extremum; ripples of the
    // mesh on a plateau do not.
    const double degree = std::max(1u, graph.first[v + 1] - graph.first[v]), mean = edges / degree;
    const double fall = 2 * std::fabs(difference) / degree * (sigma_ / mean) * (sigma_ / mean);
    const bool extremum = (highest || lowest) && std::fabs(g_[v]) > threshold_ && fall > threshold_;
    return static_cast<std::uint8_t>((extremum ? kExtremum : 0) | (crossing ? kCrossing : 0));
  }

  /// Keeps features apart: in the order of the vertices, each feature removes those that are too near to it.
  void thin_out(std::vector<std::uint8_t>& found, std::uint8_t kind, double apart) const {
    const HeatOperator& graph = level_.laplacian;
    std::vector<std::uint32_t> seen_from(found.size(), kNoIndex), near;
    for (std::uint32_t v = 0; v < found.size(); ++v) {
      if (!(found[v] & kind)) continue;
      near.assign(1, v);
      seen_from[v] = v;
      for (std::size_t i = 0; i < near.size(); ++i)
        for (std::uint32_t k = graph.first[near[i]]; k < graph.first[near[i] + 1]; ++k) {
          const std::uint32_t u = graph.column[k];
          if (seen_from[u] == v || length(level_.points[u] - level_.points[v]) > apart) continue;
          seen_from[u] = v;
          near.push_back(u);
          found[u] = static_cast<std::uint8_t>(found[u] & ~kind);
        }
    }
  }

  const HeatLevel& level_;
  std::vector<float> g_;
  double sigma_, threshold_ = 0;
};

/// What heat smooths: the positions, or R(v) in the first coordinate.
std::vector<Vec3d> signal_of(const SurfaceComponent& component) {
  if (component.radius.empty()) return component.points;
  std::vector<Vec3d> signal;
  for (const double r : component.radius) signal.push_back({r, 0, 0});
  return signal;
}

/// The signal on one level and what the next one takes over.
struct LevelState {
  HeatLevel level;
  std::vector<std::uint32_t> vertex;  // per vertex of the level: the component's
  std::vector<Vec3d> points;          // as smoothed by `time`
  double time = 0;
  std::vector<Vec3f> normals;  // at that time; empty on the component's own vertices
};

class ComponentFilter {
 public:
  ComponentFilter(SurfaceComponent component, std::span<const double> whole_sigma, const SsfOptions& options,
                  const RunContext& context)
      : component_(std::move(component)),
        whole_sigma_(whole_sigma),
        options_(options),
        context_(context),
        scales_(static_cast<std::size_t>(options.scales)),
        signal_(signal_of(component_)),
        range_(bounding_box(signal_).longest_side()) {}

  ComponentScales run() {
    double sigma_max = options_.sigma_max * component_.diagonal / component_.mean_edge;
    // The ladder is laid anew up to the first scale that has converged, once.
    for (bool again = true;; again = false) {
      start_ladder(sigma_max);
      const std::size_t converged = filter_levels(again);
      if (converged >= scales_) return std::move(out_);
      sigma_max = ladder_.sigma[converged];
    }
  }

 private:
  void start_ladder(double sigma_max) {
    ladder_ = make_sigma_ladder(sigma_max, options_);
    out_ = {};
    out_.persistence.assign(component_.points.size(), 0);
    out_.crossing.assign(component_.points.size(), 0);
    out_.crossings_at.assign(scales_ + 1, 0);
    out_.convergence.assign(scales_ + 1, 1);
    for (std::size_t i = 0; i < scales_; ++i) out_.sigma.push_back(ladder_.sigma[i] * component_.mean_edge);
    last_ = 0;
    const auto within = [&](double sigma) { return sigma <= options_.component_cap * component_.diagonal; };
    while (last_ < scales_ && within(out_.sigma[last_]) &&
           (whole_sigma_.empty() || within(whole_sigma_[last_])))
      ++last_;
    // The notes give the convergence of the largest component, which therefore goes through all scales.
    if (whole_sigma_.empty()) last_ = scales_;
  }

  /// All scales, level by level. Returns the scale to end at where one before the last has converged and
  /// `may_stop`.
  std::size_t filter_levels(bool may_stop) {
    LevelState state = first_state();
    for (std::size_t begin = 0; begin < last_;) {
      const std::size_t end = reach(state.level, begin);
      const std::size_t converged = filter_on_level(state, begin, end);
      if (may_stop && converged + 1 < scales_) return converged;
      if (end < last_)
        state = next_state(std::move(state), seed_radius(ladder_.sigma[end], options_.error_ratio));
      context_.report(static_cast<double>(end) / static_cast<double>(scales_));
      begin = end;
    }
    return scales_;
  }

  LevelState first_state() {
    LevelState state;
    state.level = finest_level(component_.points, component_.corners, 1, options_.rate_cap);
    trim_spectrum(state.level.laplacian, kTrimmed);
    out_.capped = state.level.laplacian.capped;
    state.points = signal_;
    state.vertex = state.level.vertex;
    if (out_.capped <= kManyCapped) return state;
    out_.clustered = true;
    state.normals = normals_of(state, {});
    return next_state(std::move(state), kCluster);
  }

  LevelState next_state(LevelState fine, double radius) const {
    LevelState coarse;
    coarse.level = coarsen(fine.level, radius, options_.rate_cap);
    trim_spectrum(coarse.level.laplacian, kTrimmed);
    coarse.time = fine.time;
    for (std::uint32_t v : coarse.level.vertex) {
      coarse.vertex.push_back(fine.vertex[v]);
      coarse.points.push_back(fine.points[v]);
      coarse.normals.push_back(fine.normals[v]);
    }
    return coarse;
  }

  /// One past the last scale that a level carries, at least one.
  std::size_t reach(const HeatLevel& level, std::size_t begin) const {
    std::size_t end = begin + 1;
    while (end < last_ && carries(level, ladder_.sigma[end], options_.error_ratio)) ++end;
    return end;
  }

  /// One past the scale, of [begin, end), whose points the next level starts from; `begin` for those that
  /// this level started from, unless nothing has smoothed them.
  std::size_t handover_scale(const LevelState& state, std::size_t begin, std::size_t end) const {
    const std::size_t first = state.time > 0 ? begin : begin + 1;
    std::size_t scale = end;
    while (scale > first && ladder_.sigma[scale - 1] > handover_sigma(ladder_.sigma[end])) --scale;
    return scale;
  }

  /// Features of the scales [begin, end), whose subtrahends are taken on the same level: operators of
  /// different levels differ by more than shallow relief. Leaves `state` where the next level starts. Returns
  /// the first scale after the first one that has converged, or `scales`.
  std::size_t filter_on_level(LevelState& state, std::size_t begin, std::size_t end) {
    limit_terms(state, ladder_.time[end - 1 + ladder_.band]);
    std::size_t converged = scales_;
    std::vector<std::vector<float>> curvature;
    LevelState walker{{}, {}, state.points, state.time, state.normals};
    const std::size_t handover = handover_scale(state, begin, end);
    const std::size_t times_at_once =
        std::max(kLeastTimesAtOnce, kFlowBytes / (2 * sizeof(Vec3f) * state.points.size()));
    for (std::size_t i = begin; i < end + ladder_.band;) {
      const std::size_t stop = std::min(i + times_at_once, end + ladder_.band);
      const std::span<const double> times(ladder_.time.data() + i, stop - i);
      const std::vector<HeatFlow> flows =
          diffuse(state.level.laplacian, walker.points, walker.time, times, context_);
      curvature.resize(curvature.size() + flows.size());
      parallel_each(context_, flows.size(), 1, [&](std::size_t f) {
        curvature[i - begin + f] = curvature_of(state, walker.points, flows[f]);
      });
      for (std::size_t s = i; s < std::min(stop, scales_) && s < end; ++s)
        if (has_converged(walker.points, flows[s - i], s)) converged = std::min(converged, s);
      if (i < handover && handover <= stop) {
        state.time = ladder_.time[handover - 1];
        state.points = moved(walker.points, flows[handover - 1 - i]);
        state.normals = normals_of(state, state.points);
      }
      walker.time = times.back();
      walker.points = moved(walker.points, flows.back());
      i = stop;
    }
    for (std::size_t i = begin; i < end; ++i)
      mark(state, i, curvature[i - begin], curvature[i - begin + ladder_.band]);
    return converged;
  }

  /// The work cap: rates are slowed down until the level's last time needs no more than max_terms.
  void limit_terms(LevelState& state, double last_time) {
    HeatOperator& l = state.level.laplacian;
    const double allowed = options_.max_terms, needed = heat_terms(last_time - state.time, l.bound);
    if (needed <= allowed) return;
    out_.slowed = true;
    limit_spectrum(l, l.bound * (allowed / needed) * (allowed / needed));
  }

  bool has_converged(const std::vector<Vec3d>& points, const HeatFlow& flow, std::size_t scale) {
    const double now = bounding_box(moved(points, flow)).longest_side();
    out_.convergence[scale + 1] = static_cast<float>(now / range_);
    return scale > 0 && now / range_ < options_.convergence;
  }

  /// Unit normals of the smoothed surface. Of a joined twin one fan decides on the component's own vertices:
  /// the two sides of a sheet would cancel out. On coarser levels triangles turn to the side of the vertex's
  /// normal before, which also stands where no triangle is left.
  std::vector<Vec3f> normals_of(const LevelState& state, std::span<const Vec3d> smoothed) const {
    if (by_radius()) return std::vector<Vec3f>(state.points.size(), Vec3f{1, 0, 0});  // where R stands
    const std::vector<std::uint32_t>& corners = state.level.corners;
    const std::span<const Vec3d> points = smoothed.empty() ? std::span<const Vec3d>(state.points) : smoothed;
    const std::vector<Vec3f>& before = state.normals;
    std::vector<Vec3d> sum(points.size());
    for (std::size_t h = 0; h < corners.size(); h += 3) {
      const Vec3d a = points[corners[h]], n = cross(points[corners[h + 1]] - a, points[corners[h + 2]] - a);
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t v = corners[h + k];
        if (before.empty() ? component_.fan_of_position[h + k] : dot(n, to_double(before[v])) >= 0)
          sum[v] = sum[v] + n;
        else if (!before.empty())
          sum[v] = sum[v] - n;
      }
    }
    std::vector<Vec3f> normal(points.size());
    for (std::size_t v = 0; v < points.size(); ++v) {
      normal[v] = to_float(normalized(sum[v]));
      if (!before.empty() && dot(sum[v], sum[v]) == 0) normal[v] = before[v];
    }
    return normal;
  }

  /// t H per vertex. With L positive semi-definite, L x = 2 H n.
  std::vector<float> curvature_of(const LevelState& state, const std::vector<Vec3d>& points,
                                  const HeatFlow& flow) const {
    const std::vector<Vec3f> normal = normals_of(state, moved(points, flow));
    std::vector<float> curvature(points.size());
    for (std::size_t v = 0; v < points.size(); ++v)
      curvature[v] = static_cast<float>(0.5 * dot(to_double(flow.response[v]), to_double(normal[v])));
    return curvature;
  }

  bool by_radius() const { return !component_.radius.empty(); }

  FeatureFinder finder_of(const LevelState& state, std::size_t scale, const std::vector<float>& fine,
                          const std::vector<float>& coarse) const {
    const double noise = kNoiseFactor * component_.noise, sigma = ladder_.sigma[scale];
    if (by_radius()) return FeatureFinder::as_printed(state.level, fine, sigma, noise);
    const auto ratio = static_cast<float>(ladder_.time[scale] / ladder_.time[scale + ladder_.band]);
    std::vector<float> g(fine.size());
    for (std::size_t v = 0; v < g.size(); ++v) g[v] = fine[v] - ratio * coarse[v];
    const double least = std::max(noise, kBaseShare * rms(fine));
    return FeatureFinder(state.level, std::move(g), sigma, least, options_.contrast);
  }

  void mark(const LevelState& state, std::size_t scale, const std::vector<float>& fine,
            const std::vector<float>& coarse) {
    const std::vector<std::uint8_t> found =
        finder_of(state, scale, fine, coarse)
            .find(seed_radius(ladder_.sigma[scale], options_.error_ratio), context_);
    const int counted = by_radius() ? kCrossing : kExtremum | kCrossing;
    for (std::size_t v = 0; v < found.size(); ++v) {
      if (!(found[v] & counted)) continue;
      out_.persistence[state.vertex[v]] = static_cast<std::uint8_t>(scale + 1);
      if (!(found[v] & kCrossing)) continue;
      out_.crossing[state.vertex[v]] = static_cast<std::uint8_t>(scale + 1);
      ++out_.crossings_at[scale + 1];
    }
  }

  SurfaceComponent component_;
  std::span<const double> whole_sigma_;
  const SsfOptions& options_;
  const RunContext& context_;
  std::size_t scales_, last_ = 0;  // scales from last_ on cannot count
  std::vector<Vec3d> signal_;
  double range_;
  SigmaLadder ladder_;
  ComponentScales out_;
};

}  // namespace

bool below_first_scale(double diagonal, double mean_edge, const SsfOptions& options) {
  return options.sigma_max * diagonal <= mean_edge;
}

SigmaLadder make_sigma_ladder(double sigma_max, const SsfOptions& options) {
  const auto scales = static_cast<std::size_t>(options.scales);
  const double step =
      options.scales > 1 ? portable::log(sigma_max) / (options.scales - 1) : portable::log(options.band);
  SigmaLadder ladder;
  ladder.band = static_cast<std::size_t>(std::max(1.0, std::floor(portable::log(options.band) / step + 0.5)));
  // A ladder that spans less than the band has small steps; its subtrahends are as many as its scales then.
  ladder.band = std::min(ladder.band, scales);
  for (std::size_t i = 0; i < scales + ladder.band; ++i) {
    ladder.sigma.push_back(portable::exp(step * static_cast<double>(i)));
    ladder.time.push_back(0.5 * ladder.sigma.back() * ladder.sigma.back());
  }
  return ladder;
}

ComponentScales filter_component(SurfaceComponent component, std::span<const double> whole_sigma,
                                 const SsfOptions& options, const RunContext& context) {
  return ComponentFilter(std::move(component), whole_sigma, options, context).run();
}

}  // namespace texmesh
