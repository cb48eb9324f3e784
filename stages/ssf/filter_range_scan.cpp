#include "format/base/portable_math.h"
#include "stages/base/parallel.h"
#include "stages/geometry/mesh_topology.h"
#include "stages/ssf/ssf.h"

namespace texmesh {
namespace {

/// Response differences below this many roundings of the largest radius are the sensor's number format, not
/// shape.
constexpr double kRoundingNoise = 4 * 0x1p-24;

/// Samples of r(alpha, y) or of something computed from it; `valid` where there is one.
struct Grid {
  std::uint32_t columns = 0, rows = 0;
  bool periodic = false;
  std::vector<double> value;
  std::vector<std::uint8_t> valid;
  std::size_t index(std::uint32_t x, std::uint32_t y) const { return std::size_t{y} * columns + x; }
};

/// One axis of the grid, with its step measured in object units: the roots of phi and psi of (2.4). One step
/// for all rows, or one for each.
struct Axis {
  bool vertical = false;
  std::vector<double> step;
};

Grid read_grid(const RangeGrid& range) {
  const std::size_t count = std::size_t{range.columns} * range.rows;
  if (count == 0 || range.radius.size() != count || range.position.size() != count)
    throw StageError("ssf", "range grid", "columns x rows samples, at least one",
                     std::to_string(range.radius.size()));
  if (!(range.alpha_step_rad > 0) || !(range.y_step > 0) || !std::isfinite(range.alpha_step_rad) ||
      !std::isfinite(range.y_step))
    throw StageError("ssf", "range grid", "positive steps",
                     std::to_string(range.alpha_step_rad) + " and " + std::to_string(range.y_step));
  Grid grid{range.columns, range.rows, range.full_turn, std::vector<double>(count),
            std::vector<std::uint8_t>(count)};
  for (std::size_t i = 0; i < count; ++i) {
    grid.valid[i] = std::isfinite(range.radius[i]) && range.radius[i] > 0;
    grid.value[i] = grid.valid[i] ? double{range.radius[i]} : 0;
  }
  return grid;
}

/// Weights of one 1-D pass for offsets 0, 1, ...: the Gaussian, or its second derivative times sigma^2. Both
/// share the window; the second derivative is shifted by a share of the Gaussian so that a constant gives no
/// response there.
struct Kernel {
  std::vector<double> gauss, derivative;
};

Kernel make_kernel(double sigma, double step, double window, std::uint32_t size) {
  const auto half =
      static_cast<std::size_t>(std::clamp(std::floor(window * sigma / step), 1.0, std::max(1.0, size - 1.0)));
  Kernel k;
  double sum = 0, curved = 0;
  for (std::size_t u = 0; u <= half; ++u) {
    const double x = static_cast<double>(u) * step / sigma, g = portable::exp(-0.5 * x * x);
    k.gauss.push_back(g);
    k.derivative.push_back((x * x - 1) * g);
    sum += u == 0 ? g : 2 * g;
    curved += (u == 0 ? 1 : 2) * k.derivative.back();
  }
  for (std::size_t u = 0; u <= half; ++u) {
    k.derivative[u] = (k.derivative[u] - curved / sum * k.gauss[u]) / sum;
    k.gauss[u] /= sum;
  }
  return k;
}

/// One for all rows, or one for each.
std::vector<Kernel> make_kernels(double sigma, const Axis& axis, double window, std::uint32_t size) {
  std::vector<Kernel> kernels;
  for (const double step : axis.step) kernels.push_back(make_kernel(sigma, step, window, size));
  return kernels;
}

/// sum_u w(u) (f(x + u) - f(x)) over the samples there are; `smooth` adds f(x) and makes up for weights that
/// are missing at borders and holes.
Grid filter(const Grid& in, const Axis& axis, const std::vector<Kernel>& kernels,
            std::vector<double> Kernel::*part, bool smooth, const RunContext& context) {
  Grid out = in;
  const auto size = static_cast<std::int64_t>(axis.vertical ? in.rows : in.columns);
  const auto wrap = [&](std::int64_t at) {
    if (in.periodic && !axis.vertical) return (at % size + size) % size;
    return at < 0 || at >= size ? std::int64_t{-1} : at;
  };
  parallel_for(context, in.rows, 4, [&](std::size_t begin, std::size_t end) {
    for (auto y = static_cast<std::uint32_t>(begin); y < end; ++y) {
      const std::vector<double>& weight = kernels[kernels.size() > 1 ? y : 0].*part;
      const auto reach = static_cast<std::int64_t>(weight.size()) - 1;
      for (std::uint32_t x = 0; x < in.columns; ++x) {
        const std::size_t i = in.index(x, y);
        if (!in.valid[i]) continue;
        double sum = 0, used = 0;
        for (std::int64_t u = -reach; u <= reach; ++u) {
          const std::int64_t at = wrap((axis.vertical ? y : x) + u);
          if (at < 0) continue;
          const auto k = static_cast<std::uint32_t>(at);
          const std::size_t j = axis.vertical ? in.index(x, k) : in.index(k, y);
          if (!in.valid[j]) continue;
          const double w = weight[static_cast<std::size_t>(u < 0 ? -u : u)];
          sum += w * (in.value[j] - in.value[i]);
          used += w;
        }
        out.value[i] = smooth ? in.value[i] + sum / used : sum;
      }
    }
  });
  return out;
}

struct Response {
  Grid smooth, curvature;  // G * r, and sigma^2 times its Laplacian
};

/// Two 1-D passes each (the filters are separable): smoothed along alpha then y; LoG = G''(alpha) G(y) +
/// G(alpha) G''(y).
Response response_at(const Grid& grid, const Axis& alpha, const Axis& y, double sigma, double window,
                     const RunContext& context) {
  const std::vector<Kernel> a = make_kernels(sigma, alpha, window, grid.columns),
                            b = make_kernels(sigma, y, window, grid.rows);
  const auto smoothed = [&](const Grid& in, const Axis& axis, const std::vector<Kernel>& kernels) {
    return filter(in, axis, kernels, &Kernel::gauss, true, context);
  };
  const Grid along = smoothed(grid, alpha, a);
  Response r{smoothed(along, y, b), filter(along, y, b, &Kernel::derivative, false, context)};
  const Grid across = filter(smoothed(grid, y, b), alpha, a, &Kernel::derivative, false, context);
  for (std::size_t i = 0; i < across.value.size(); ++i) r.curvature.value[i] += across.value[i];
  return r;
}

/// The response as meshes have it: t (H(sigma) - H(band sigma)), the base shape's curvature taken off.
void subtract_wide_band(const Grid& grid, const Axis& alpha, const Axis& y, double sigma,
                        const SsfOptions& options, Response& r, const RunContext& context) {
  const double band = options.range_band;
  if (band <= 1) return;
  const Response wide = response_at(grid, alpha, y, sigma * band, options.window, context);
  for (std::size_t i = 0; i < r.curvature.value.size(); ++i)
    r.curvature.value[i] -= wide.curvature.value[i] / (band * band);
}

/// Samples whose response changes sign towards a neighbour and is the smaller of the two.
std::vector<std::uint8_t> find_crossings(const Grid& g, double noise) {
  std::vector<std::uint8_t> found(g.value.size(), 0);
  const auto compare = [&](std::size_t i, std::size_t j) {
    if (!g.valid[i] || !g.valid[j] || (g.value[i] < 0) == (g.value[j] < 0)) return;
    if (std::fabs(g.value[i] - g.value[j]) <= noise) return;
    found[std::fabs(g.value[i]) <= std::fabs(g.value[j]) ? i : j] = 1;
  };
  for (std::uint32_t y = 0; y < g.rows; ++y)
    for (std::uint32_t x = 0; x < g.columns; ++x) {
      if (x + 1 < g.columns)
        compare(g.index(x, y), g.index(x + 1, y));
      else if (g.periodic && g.columns > 2)
        compare(g.index(x, y), g.index(0, y));
      if (y + 1 < g.rows) compare(g.index(x, y), g.index(x, y + 1));
    }
  return found;
}

double value_range(const Grid& g) {
  double lo = std::numeric_limits<double>::infinity(), hi = -lo;
  for (std::size_t i = 0; i < g.value.size(); ++i)
    if (g.valid[i]) {
      lo = std::min(lo, g.value[i]);
      hi = std::max(hi, g.value[i]);
    }
  return hi > lo ? hi - lo : 0;
}

class RangeFilter {
 public:
  RangeFilter(const RangeGrid& range, std::size_t position_count, const SsfOptions& options,
              const RunContext& context)
      : range_(range), options_(options), context_(context), grid_(read_grid(range)) {
    map_.scales = options.scales;
    map_.persistence.assign(position_count, 0);
    const auto entries = static_cast<std::size_t>(options.scales) + 1;
    map_.sigma.assign(entries, 0);
    map_.convergence.assign(entries, 1);
    map_.crossings_at.assign(entries, 0);
  }

  ScaleMap run() {
    measure();
    filter_scales();
    if (const std::size_t last = converged_at(); last < static_cast<std::size_t>(options_.scales)) {
      sigma_max_ = map_.sigma[last];
      std::fill(map_.persistence.begin(), map_.persistence.end(), std::uint8_t{0});
      filter_scales();
    }
    map_.crossing = map_.persistence;
    context_.report(1);
    return std::move(map_);
  }

 private:
  void measure() {
    double sum = 0, count = 0;
    for (std::size_t i = 0; i < grid_.value.size(); ++i)
      if (grid_.valid[i]) {
        largest_ = std::max(largest_, grid_.value[i]);
        sum += grid_.value[i];
        ++count;
      }
    const double radius = count > 0 ? sum / count : 1;
    alpha_ = {false, alpha_steps(radius)};
    y_ = {true, {double{range_.y_step}}};
    const double height = range_.y_step * static_cast<double>(range_.rows);
    const double alpha_step = range_.alpha_step_rad * radius;
    sigma_min_ = grid_.rows > 1 ? 0.5 * (alpha_step + double{range_.y_step}) : alpha_step;
    sigma_max_ = std::max(options_.sigma_max * std::sqrt(8 * largest_ * largest_ + height * height),
                          1.01 * sigma_min_);
  }

  /// By the scan's mean radius, or by each row's where the row has any sample.
  std::vector<double> alpha_steps(double mean_radius) const {
    if (options_.range_spacing == RangeSpacing::kMean) return {range_.alpha_step_rad * mean_radius};
    std::vector<double> steps;
    for (std::uint32_t y = 0; y < grid_.rows; ++y) {
      double sum = 0, count = 0;
      for (std::uint32_t x = 0; x < grid_.columns; ++x)
        if (grid_.valid[grid_.index(x, y)]) sum += grid_.value[grid_.index(x, y)], ++count;
      steps.push_back(range_.alpha_step_rad * (count > 0 ? sum / count : mean_radius));
    }
    return steps;
  }

  void filter_scales() {
    const double whole = value_range(grid_),
                 step =
                     options_.scales > 1 ? portable::log(sigma_max_ / sigma_min_) / (options_.scales - 1) : 0;
    // The original's own curvature: second differences, the narrowest window there is.
    const double narrow = 0.5 * sigma_min_;
    mark_crossings(0, response_at(grid_, alpha_, y_, narrow, 1, context_).curvature);
    for (int i = 1; i <= options_.scales; ++i) {
      const double sigma = sigma_min_ * portable::exp(step * (i - 1));
      Response r = response_at(grid_, alpha_, y_, sigma, options_.window, context_);
      subtract_wide_band(grid_, alpha_, y_, sigma, options_, r, context_);
      const auto s = static_cast<std::size_t>(i);
      map_.sigma[s] = static_cast<float>(sigma);
      map_.convergence[s] = whole > 0 ? static_cast<float>(value_range(r.smooth) / whole) : 0;
      mark_crossings(i, r.curvature);
      context_.report(static_cast<double>(i) / options_.scales);
    }
  }

  void mark_crossings(int scale, const Grid& curvature) {
    const std::vector<std::uint8_t> found = find_crossings(curvature, kRoundingNoise * largest_);
    std::uint32_t count = 0;
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (!found[i]) continue;
      ++count;
      const std::uint32_t p = range_.position[i];
      if (p == kNoIndex) continue;
      if (p >= map_.persistence.size())
        throw StageError("ssf", "range grid", "positions of the mesh", std::to_string(p));
      map_.persistence[p] = static_cast<std::uint8_t>(scale);
    }
    map_.crossings_at[static_cast<std::size_t>(scale)] = count;
  }

  /// The first scale beyond the first whose range is under the threshold; past the last one when there is
  /// none.
  std::size_t converged_at() const {
    std::size_t i = 2;
    while (i < map_.convergence.size() && map_.convergence[i] >= options_.convergence) ++i;
    return i;
  }

  const RangeGrid& range_;
  const SsfOptions& options_;
  const RunContext& context_;
  Grid grid_;
  Axis alpha_, y_;
  double largest_ = 0, sigma_min_ = 0, sigma_max_ = 0;
  ScaleMap map_;
};

}  // namespace

RangeGrid grid_on_conditioned(const RangeGrid& grid, std::size_t source_positions,
                              const ConditionedMesh& mesh) {
  const auto check = [&](std::uint32_t position) {
    if (position >= source_positions)
      throw StageError("ssf", "range grid", "positions below " + std::to_string(source_positions),
                       std::to_string(position));
  };
  std::vector<std::uint32_t> conditioned(source_positions, kNoIndex);
  for (std::size_t i = mesh.position_source.size(); i-- > 0;) {
    check(mesh.position_source[i]);
    conditioned[mesh.position_source[i]] = static_cast<std::uint32_t>(i);
  }
  RangeGrid out = grid;
  for (std::uint32_t& p : out.position) {
    if (p == kNoIndex) continue;
    check(p);
    p = conditioned[p];
  }
  return out;
}

ScaleMap filter_range_scan(const RangeGrid& range, std::size_t position_count, const SsfOptions& options,
                           const RunContext& context) {
  return RangeFilter(range, position_count, options, context).run();
}

}  // namespace texmesh
