#include "format/rules/allocation.h"

#include <limits>

#include "format/base/number16.h"
#include "format/base/portable_math.h"

namespace texmesh {

// Two ways to choose rungs. Thesis 3.2-3.3: feature counts give the quality that a fragment is asked to have.
// allocate_rd(): a budget is spent on the rungs that save most surface-weighted 1 - SSIM for a byte, along
// convex hulls and with one price for all (Everett 1963, Shoham and Gersho 1988).

namespace {

/// IJG's scale of the quantisers for a quality (1 = the tables of the standard), not under 0.01 so that its
/// logarithm exists at quality 100.
double ijg_scale(double quality) {
  const double q = std::clamp(quality, 1.0, 100.0);
  return std::max(q < 50 ? 50 / q : 2 - q / 50, 0.01);
}

double quality_of_scale(double scale) { return scale > 1 ? 50 / scale : 100 - 50 * scale; }

/// As the file has it, so that tables fresh from the compiler and read back ones give the same choice.
double half_of(float dssim) { return static_cast<double>(from_half(to_half(std::clamp(dssim, 0.0f, 2.0f)))); }

/// A step from one vertex of a curve's hull to the next: `way` instead of the one before.
struct Step {
  double slope = 0;  // loss saved per byte
  std::uint32_t curve = 0, way = 0;
  std::uint32_t bytes = 0;  // more than before
};

/// Walks along the lower convex hull of a curve from way 0. Each step takes the steepest way on (ties: the
/// one that costs more), so the slopes fall.
void add_steps(const RdCurve& curve, std::uint32_t index, std::vector<Step>& steps) {
  std::uint32_t at = 0;
  for (;;) {
    Step best;
    for (std::uint32_t way = 1; way < curve.bytes.size(); ++way) {
      if (curve.bytes[way] <= curve.bytes[at] || curve.loss[way] >= curve.loss[at]) continue;
      const std::uint32_t bytes = curve.bytes[way] - curve.bytes[at];
      const double slope = static_cast<double>(curve.loss[at] - curve.loss[way]) / bytes;
      if (slope > best.slope || (slope == best.slope && bytes > best.bytes))
        best = {slope, index, way, bytes};
    }
    if (best.way == 0) return;
    steps.push_back(best);
    at = best.way;
  }
}

}  // namespace

double log_quantiser(double quality) { return -portable::log(ijg_scale(quality)); }

std::vector<float> density_of(const PlaneTables& tables, std::size_t row) {
  const std::size_t n = tables.fragment_count();
  const std::uint32_t* features = tables.features.data() + row * n;
  std::uint32_t lo = 0xffffffffu, hi = 0;
  for (std::size_t f = 0; f < n; ++f) {
    if (tables.covered_texels[f] == 0) continue;
    lo = std::min(lo, features[f]);
    hi = std::max(hi, features[f]);
  }
  std::vector<float> eta(n, 0.0f);
  if (hi <= lo) return eta;  // equal everywhere: nobody is asked for more than the mean
  for (std::size_t f = 0; f < n; ++f)
    if (tables.covered_texels[f] > 0)
      eta[f] = static_cast<float>(static_cast<double>(features[f] - lo) / static_cast<double>(hi - lo));
  return eta;
}

std::vector<float> eta_of(const PlaneTables& tables, std::size_t row) {
  std::vector<float> eta = density_of(tables, row);
  if (tables.allocation != kByVqp) return eta;
  const std::vector<float> finest = density_of(tables, 0);
  for (std::size_t f = 0; f < eta.size(); ++f) {
    const double moved = static_cast<double>(tables.density_weight) *
                         (static_cast<double>(eta[f]) - static_cast<double>(finest[f]));
    eta[f] = static_cast<float>(std::clamp(static_cast<double>(tables.vqp[f]) + moved, 0.0, 1.0));
  }
  return eta;
}

double mean_eta(const PlaneTables& tables, std::size_t row) {
  const std::vector<float> eta = eta_of(tables, row);
  double sum = 0;
  std::size_t covered = 0;
  for (std::size_t f = 0; f < eta.size(); ++f) {
    if (tables.covered_texels[f] == 0) continue;
    sum += static_cast<double>(eta[f]);
    ++covered;
  }
  return covered > 0 ? sum / static_cast<double>(covered) : 0;
}

std::vector<float> quality_of(const PlaneTables& tables, std::size_t row, double gamma) {
  std::vector<float> result = eta_of(tables, row);
  const double middle = static_cast<double>(tables.quality[row]);
  const double g = log_quantiser(middle);
  for (float& value : result) {
    const double away = static_cast<double>(value) - gamma;
    const double q =
        tables.allocation == 0 || tables.allocation == kByVqp
            ? middle + away * static_cast<double>(tables.quality_width)
            : quality_of_scale(portable::exp(-(g + away * static_cast<double>(tables.log_width))));
    value = std::clamp(static_cast<float>(q), tables.quality_min, tables.quality_max);
  }
  return result;
}

std::uint32_t nearest_rung(const PlaneTables& tables, double quality) {
  const double g = log_quantiser(quality);
  std::uint32_t best = 0;
  double best_distance = std::numeric_limits<double>::infinity();
  for (std::uint32_t r = 0; r < tables.rung_count(); ++r) {
    const double distance = std::fabs(log_quantiser(tables.rung_quality[r]) - g);
    if (distance < best_distance) {
      best = r;
      best_distance = distance;
    }
  }
  return best;
}

std::uint64_t bytes_asked_for(const PlaneTables& tables, std::size_t row, double gamma) {
  const std::vector<float> quality = quality_of(tables, row, gamma);
  std::uint64_t sum = 0;
  for (const std::uint16_t f : tables.order)
    sum += bytes_to_show(tables, nearest_rung(tables, static_cast<double>(quality[f])), f);
  return sum;
}

std::vector<std::int16_t> rungs_of(const PlaneTables& tables, std::size_t row, double gamma) {
  const std::vector<float> quality = quality_of(tables, row, gamma);
  std::vector<std::int16_t> rungs(tables.fragment_count(), kSkipped);
  for (const std::uint16_t f : tables.order)
    rungs[f] = static_cast<std::int16_t>(nearest_rung(tables, static_cast<double>(quality[f])));
  return tables.allocation != 2 ? rungs : allocate_rd(tables, sum_of(bytes_of(tables, rungs)));
}

std::vector<std::uint32_t> bytes_of(const PlaneTables& tables, const std::vector<std::int16_t>& rungs) {
  std::vector<std::uint32_t> bytes(tables.fragment_count(), 0);
  for (std::size_t f = 0; f < bytes.size(); ++f)
    if (rungs[f] != kSkipped)
      bytes[f] = static_cast<std::uint32_t>(bytes_to_show(tables, static_cast<std::size_t>(rungs[f]), f));
  return bytes;
}

std::uint64_t bytes_to_show(const PlaneTables& tables, std::size_t rung, std::size_t fragment) {
  const std::size_t fragments = tables.fragment_count();
  const std::uint64_t stream_bytes = tables.size_bytes[rung * fragments + fragment];
  if (!tables.incremental || stream_bytes == 0) return stream_bytes;
  std::uint64_t bytes = 0;
  for (std::size_t r = 0; r <= rung; ++r) bytes += tables.size_bytes[r * fragments + fragment];
  return bytes;
}

std::uint64_t bytes_of_rung(const PlaneTables& tables, std::size_t rung) {
  const std::size_t fragments = tables.fragment_count();
  std::uint64_t bytes = 0;
  for (std::size_t k = tables.incremental ? 0 : rung * fragments; k < (rung + 1) * fragments; ++k)
    bytes += tables.size_bytes[k];
  return bytes;
}

std::uint64_t sum_of(const std::vector<std::uint32_t>& bytes) {
  std::uint64_t sum = 0;
  for (const std::uint32_t b : bytes) sum += b;
  return sum;
}

std::vector<std::uint32_t> spend_bytes(const std::vector<RdCurve>& curves, std::uint64_t budget_bytes) {
  std::vector<Step> steps;
  for (std::uint32_t c = 0; c < curves.size(); ++c) add_steps(curves[c], c, steps);
  // Stable: steps of one curve stand in their order, and where slopes are equal, so do the curves.
  std::stable_sort(steps.begin(), steps.end(),
                   [](const Step& a, const Step& b) { return a.slope > b.slope; });
  std::vector<std::uint32_t> way(curves.size(), 0);
  std::vector<bool> ended(curves.size(), false);
  std::uint64_t left = budget_bytes;
  for (const Step& step : steps) {
    if (ended[step.curve]) continue;
    // Rejected: smaller steps of ended curves with what is left, and the best quality for all where that
    // loses less. Neither changed a third decimal of the bytes at equal loss on eight scans: rd is at most
    // 0.5 % above what parts of steps would give, the price of whole fragments (64 of them).
    if (step.bytes > left) {
      ended[step.curve] = true;
      continue;
    }
    left -= step.bytes;
    way[step.curve] = step.way;
  }
  return way;
}

std::vector<float> surface_weights(const PlaneTables& tables) {
  struct Density {
    double area_per_texel;
    std::uint32_t texels, fragment;
  };
  std::vector<Density> densities;
  std::uint64_t texels = 0;
  for (std::uint32_t f = 0; f < tables.fragment_count(); ++f) {
    const std::uint32_t covered = tables.covered_texels[f];
    if (covered == 0) continue;
    densities.push_back({static_cast<double>(tables.surface_fraction[f]) / covered, covered, f});
    texels += covered;
  }
  std::vector<float> weights(tables.fragment_count(), 0.0f);
  if (densities.empty()) return weights;
  std::stable_sort(densities.begin(), densities.end(),
                   [](const Density& a, const Density& b) { return a.area_per_texel < b.area_per_texel; });
  std::uint64_t below = 0;
  double cap = 0;
  for (const Density& d : densities) {
    if (100 * below >= 99 * texels) break;
    below += d.texels;
    cap = d.area_per_texel;
  }
  for (const Density& d : densities)
    weights[d.fragment] = static_cast<float>(std::min(d.area_per_texel, cap) * d.texels);
  return weights;
}

std::vector<RdCurve> rd_curves(const PlaneTables& tables, const std::vector<float>& weights, double share) {
  float largest = 0;
  for (const std::uint16_t f : tables.order) largest = std::max(largest, weights.at(f));
  std::vector<RdCurve> curves;
  const std::size_t fragments = tables.fragment_count();
  std::vector<bool> stored(fragments, false);
  for (const std::uint16_t f : tables.order) stored[f] = true;
  for (std::size_t f = 0; f < fragments; ++f) {
    if (!stored[f]) continue;
    const double unit =
        largest > 0 ? std::floor(static_cast<double>(weights[f]) / largest * share * 0x1p20 + 0.5) : 0;
    // A binary16 is a multiple of 2^-24 up to 2, so that the product is a whole number below 2^46.
    const auto loss = [&](double dssim) { return static_cast<std::uint64_t>(unit * (dssim * 0x1p24)); };
    RdCurve& curve = curves.emplace_back();
    curve.bytes.push_back(0);
    curve.loss.push_back(loss(half_of(tables.skip_dssim[f])));
    for (std::size_t r = 0; r < tables.rung_count(); ++r) {
      const std::size_t at = r * fragments + f;
      // A rung that leaves this fragment out is no way to show it: as dear as skipping, and no better.
      curve.bytes.push_back(bytes_to_show(tables, r, f));
      curve.loss.push_back(tables.size_bytes[at] > 0 ? loss(half_of(tables.dssim[at])) : curve.loss[0]);
    }
  }
  return curves;
}

std::vector<std::int16_t> allocate_rd(const PlaneTables& tables, std::uint64_t budget_bytes,
                                      const std::vector<float>& weights) {
  const std::vector<std::uint32_t> ways =
      spend_bytes(rd_curves(tables, weights.empty() ? surface_weights(tables) : weights), budget_bytes);
  std::vector<std::int16_t> rungs(tables.fragment_count(), kSkipped);
  std::vector<std::uint16_t> stored = tables.order;
  std::sort(stored.begin(), stored.end());
  for (std::size_t k = 0; k < stored.size(); ++k)
    rungs[stored[k]] = static_cast<std::int16_t>(static_cast<int>(ways[k]) - 1);
  return rungs;
}

double surface_dssim(const PlaneTables& tables, const std::vector<std::int16_t>& rungs) {
  const std::vector<float> weights = surface_weights(tables);
  double sum = 0, total = 0;
  for (std::size_t f = 0; f < tables.fragment_count(); ++f) {
    const double w = static_cast<double>(weights[f]);
    const auto skipped = static_cast<double>(tables.skip_dssim[f]);
    const double dssim =
        rungs[f] == kSkipped
            ? skipped
            : static_cast<double>(
                  tables.dssim[static_cast<std::size_t>(rungs[f]) * tables.fragment_count() + f]);
    sum += w * dssim;
    total += w;
  }
  return total > 0 ? sum / total : 0;
}

}  // namespace texmesh
