#include "lab/psychometrics/psychometric.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "format/base/portable_math.h"

namespace texmesh {
namespace {

/// Logarithm of the threshold, logarithm of the slope, lapse.
using Place = std::array<double, 3>;

struct Box {
  Place low, high;
  Place clamp(Place p) const {
    for (std::size_t k = 0; k < 3; ++k) p[k] = std::clamp(p[k], low[k], high[k]);
    return p;
  }
};

struct Vertex {
  Place place;
  double value = 0;  // the likelihood's logarithm, negated
};

void check_counts(std::span<const LevelCount> counts) {
  std::uint64_t answers = 0;
  for (const LevelCount& c : counts) {
    if (!std::isfinite(c.level) || c.level <= 0) throw std::invalid_argument("a level is not above 0");
    if (c.right > c.answers) throw std::invalid_argument("more right answers than answers");
    answers += c.answers;
  }
  if (answers == 0) throw std::invalid_argument("no answers");
}

Psychometric curve_at(const Place& p) { return {portable::exp(p[0]), portable::exp(p[1]), p[2]}; }

double log_likelihood(std::span<const LevelCount> counts, const Psychometric& curve) {
  double sum = 0;
  for (const LevelCount& c : counts) {
    const double p = curve.share_right(c.level);
    if (c.right > 0) sum += c.right * portable::log(p);
    // A share of 1 leaves no room for a wrong answer.
    if (c.right < c.answers) sum += (c.answers - c.right) * portable::log(std::max(1 - p, 1e-12));
  }
  return sum;
}

/// The simplex of Nelder and Mead (1965) within the box.
class Simplex {
 public:
  Simplex(std::span<const LevelCount> counts, const Box& box, const Vertex& start)
      : counts_(counts), box_(box) {
    vertices_[0] = start;
    const Place step{0.15, 0.25, 0.02};
    for (std::size_t k = 0; k < 3; ++k) {
      Place p = start.place;
      p[k] += p[k] + step[k] > box.high[k] ? -step[k] : step[k];
      vertices_[k + 1] = at(p);
    }
  }
  Vertex descend() {
    for (int i = 0; i < 400; ++i) {
      std::ranges::stable_sort(vertices_, {}, &Vertex::value);
      if (vertices_[3].value - vertices_[0].value < 1e-9) break;
      step();
    }
    return *std::ranges::min_element(vertices_, {}, &Vertex::value);
  }

 private:
  Vertex at(const Place& p) const {
    const Place inside = box_.clamp(p);
    return {inside, -log_likelihood(counts_, curve_at(inside))};
  }
  /// From the worst vertex through the middle of the others, `factor` of the way beyond it.
  Vertex beyond(double factor) const {
    Place p{};
    for (std::size_t k = 0; k < 3; ++k) {
      const double middle = (vertices_[0].place[k] + vertices_[1].place[k] + vertices_[2].place[k]) / 3;
      p[k] = middle + factor * (middle - vertices_[3].place[k]);
    }
    return at(p);
  }
  void step() {
    const Vertex reflected = beyond(1);
    if (reflected.value < vertices_[0].value) {
      const Vertex expanded = beyond(2);
      vertices_[3] = expanded.value < reflected.value ? expanded : reflected;
    } else if (reflected.value < vertices_[2].value) {
      vertices_[3] = reflected;
    } else {
      const Vertex contracted = beyond(reflected.value < vertices_[3].value ? 0.5 : -0.5);
      if (contracted.value < std::min(reflected.value, vertices_[3].value))
        vertices_[3] = contracted;
      else
        shrink();
    }
  }
  void shrink() {
    for (std::size_t v = 1; v < 4; ++v) {
      Place p{};
      for (std::size_t k = 0; k < 3; ++k) p[k] = (vertices_[v].place[k] + vertices_[0].place[k]) / 2;
      vertices_[v] = at(p);
    }
  }

  std::span<const LevelCount> counts_;
  const Box& box_;
  std::array<Vertex, 4> vertices_;
};

/// The best of a coarse grid, so that the descent begins in the right valley.
Vertex best_of_grid(std::span<const LevelCount> counts, const Box& box) {
  constexpr int kThresholds = 10, kSlopes = 4;
  Vertex best{{}, std::numeric_limits<double>::infinity()};
  for (int t = 0; t <= kThresholds; ++t)
    for (int s = 0; s <= kSlopes; ++s)
      for (const double lapse : {0.0, kMostLapses / 2}) {
        const Place p{box.low[0] + (box.high[0] - box.low[0]) * t / kThresholds,
                      box.low[1] + (box.high[1] - box.low[1]) * s / kSlopes, lapse};
        const double value = -log_likelihood(counts, curve_at(p));
        if (value < best.value) best = {p, value};
      }
  return best;
}

double deviance_of(std::span<const LevelCount> counts, double fitted) {
  double saturated = 0;
  for (const LevelCount& c : counts) {
    if (c.answers == 0) continue;
    const double wrong = c.answers - c.right, n = c.answers;
    if (c.right > 0) saturated += c.right * portable::log(c.right / n);
    if (wrong > 0) saturated += wrong * portable::log(wrong / n);
  }
  return std::max(0.0, 2 * (saturated - fitted));
}

}  // namespace

std::vector<LevelCount> merge_levels(std::span<const LevelCount> counts) {
  std::vector<LevelCount> sorted(counts.begin(), counts.end()), out;
  std::ranges::stable_sort(sorted, {}, &LevelCount::level);
  for (const LevelCount& c : sorted) {
    if (c.answers == 0) continue;
    if (out.empty() || out.back().level != c.level)
      out.push_back(c);
    else
      out.back().answers += c.answers, out.back().right += c.right;
  }
  return out;
}

double Psychometric::share_right(double level) const {
  if (!(level > 0)) return 0.5;
  // The factor puts kThresholdShare, not the curve's middle, at the threshold.
  const double odds = (1 - 4 * lapse) * portable::exp(slope * portable::log(threshold / level));
  return 0.5 + (0.5 - lapse) / (1 + odds);
}

PsychometricFit fit_psychometric(std::span<const LevelCount> counts) {
  check_counts(counts);
  const std::vector<LevelCount> all = merge_levels(counts);
  const double least = all.front().level, most = all.back().level;
  const Box box{{portable::log(least / 4), portable::log(0.5), 0},
                {portable::log(most * 4), portable::log(20), kMostLapses}};
  Vertex best = best_of_grid(all, box);
  for (int again = 0; again < 2; ++again) best = Simplex(all, box, best).descend();
  PsychometricFit fit;
  fit.curve = curve_at(best.place);
  fit.log_likelihood = -best.value;
  fit.deviance = deviance_of(all, fit.log_likelihood);
  fit.within = fit.curve.threshold >= least && fit.curve.threshold <= most;
  return fit;
}

LineFit fit_line(std::span<const LevelCount> counts) {
  check_counts(counts);
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (const LevelCount& c : counts) {
    n += c.answers, x += c.answers * c.level, y += c.right;
    xx += c.answers * c.level * c.level, xy += c.right * c.level;
  }
  const double spread = xx - x * x / n;
  LineFit fit;
  fit.slope = spread > 1e-12 * xx ? (xy - x * y / n) / spread : 0;
  fit.intercept = y / n - fit.slope * x / n;
  fit.threshold = fit.slope > 0 ? (kThresholdShare - fit.intercept) / fit.slope
                                : std::numeric_limits<double>::quiet_NaN();
  return fit;
}

}  // namespace texmesh
