#include "lab/transfer/chapter_4.h"

#include <algorithm>
#include <cmath>

#include "format/base/portable_math.h"

namespace texmesh {
namespace {

constexpr std::size_t kFragments = 256;
constexpr double kListBytes = 418e3, kLinkBytes_s = 41.68e3;
constexpr double kQuality = 80, kWidth = 60;  // Q_i and dQ of Eq. 3.2
constexpr int kTenRungs[] = {10, 20, 30, 40, 50, 60, 70, 80, 90, 100};
// Steps of 5 as in the thesis's tables, finer where bytes grow fastest: between 95 and 100 they double.
constexpr int kFineRungs[] = {5,  10, 15, 20, 25, 30, 35, 40, 45, 50, 55, 60, 65,
                              70, 75, 80, 85, 90, 92, 94, 95, 96, 97, 98, 99, 100};
constexpr int kLowestQuality = 40;

/// IJG's scale of the quantisers, 1 at quality 50.
double quantiser_scale(double quality) {
  return quality < 50 ? 50 / quality : std::max(2 - quality / 50, 0.015);
}
/// Bytes of a photograph grow about like this, 1 at quality 50.
double relative_bytes(double quality) { return portable::pow(quantiser_scale(quality), -0.75); }

HtcOptions serial(HtcOptions options) {
  options.window = 1;
  options.rtt_s = 0;
  return options;
}

/// Plays the plan to its end, s.
double play_samples(HarmonicTimePlan& plan, const std::function<double(std::size_t, double)>& rate) {
  double now_s = 0;
  while (const HtcStep* step = plan.next(now_s)) {
    now_s += step->bytes / rate(step->position, now_s);
    plan.completed(step->offer, now_s);
  }
  return now_s;
}

double relative_loss(double quality) { return 0.03 * portable::pow(quantiser_scale(quality), 0.8); }

}  // namespace

std::vector<FragmentOffer> table_4_2_offers(Table42Rungs rungs) {
  const std::span<const int> qualities =
      rungs == Table42Rungs::kTen ? std::span<const int>(kTenRungs) : kFineRungs;
  TraceRandom random(42);
  std::vector<FragmentOffer> offers(kFragments);
  std::vector<double> base(kFragments);
  double mean_eta = 0;
  for (std::size_t i = 0; i < kFragments; ++i) {
    offers[i].eta = (random.uniform() + random.uniform() + random.uniform()) / 3;
    base[i] = portable::exp(0.5 * random.normal());
    mean_eta += offers[i].eta / kFragments;
  }
  double total = 0;
  for (std::size_t i = 0; i < kFragments; ++i) {
    const double q = std::clamp(kQuality + kWidth * (offers[i].eta - mean_eta), 40.0, 100.0);
    offers[i].planned_bytes = base[i] * relative_bytes(q);
    total += offers[i].planned_bytes;
  }
  for (std::size_t i = 0; i < kFragments; ++i) {
    FragmentOffer& f = offers[i];
    const double unit = kListBytes / total;
    f.planned_bytes *= unit;
    f.loss.push_back(0.4 / kFragments);
    for (const int q : qualities) {
      f.bytes.push_back(
          static_cast<std::uint32_t>(std::max(1.0, std::floor(base[i] * unit * relative_bytes(q) + 0.5))));
      f.loss.push_back(relative_loss(q) / kFragments);
    }
    f.low_rung = static_cast<std::uint16_t>(std::ranges::find(qualities, kLowestQuality) - qualities.begin());
  }
  return offers;
}

double lambda_of(const SimulationResult& result) {
  double sum = 0;
  for (std::size_t k = 0; k + 1 < result.steps.size(); ++k) sum += result.steps[k].residual_s;
  return sum / static_cast<double>(std::max<std::size_t>(result.steps.size(), 2) - 1);
}

std::vector<Table42Row> table_4_2(const HtcOptions& base, int seeds, Table42Rungs rungs) {
  const std::vector<FragmentOffer> offers = table_4_2_offers(rungs);
  std::vector<Table42Row> rows;
  for (int beta0 = 20; beta0 <= 53; beta0 += 3) {
    Table42Row row;
    row.beta0_kb_s = beta0;
    row.t0_s = kListBytes / (beta0 * 1e3);
    row.static_percent = 100 * (1 - beta0 * 1e3 / kLinkBytes_s);
    HtcOptions options = base;
    options.time_limit_s = row.t0_s;
    options.initial_bytes_s = beta0 * 1e3;
    for (int seed = 1; seed <= seeds; ++seed) {
      const BandwidthTrace samples =
          random_trace(kLinkBytes_s, 0.2, 0, 1, kFragments, static_cast<std::uint64_t>(seed));
      const SimulationResult by_sample = simulate_samples(
          offers, options, [&](std::size_t k, double) { return samples.bytes_s[std::min(k, kFragments)]; });
      const SimulationResult by_time = simulate_serial_trace(
          offers, options,
          random_trace(kLinkBytes_s, 0.3, 0.9, 0.1, 3 * row.t0_s, static_cast<std::uint64_t>(seed)));
      const double d = std::abs(by_sample.deviation_percent), t = std::abs(by_time.deviation_percent);
      row.deviation_percent += d / seeds;
      row.trace_deviation_percent += t / seeds;
      row.worst_percent = std::max(row.worst_percent, d);
      row.trace_worst_percent = std::max(row.trace_worst_percent, t);
      row.surplus_percent += by_sample.deviation_percent / seeds;
      row.lambda_s += lambda_of(by_sample) / seeds;
    }
    rows.push_back(row);
  }
  return rows;
}

SimulationResult simulate_samples(std::vector<FragmentOffer> offers, const HtcOptions& options,
                                  const std::function<double(std::size_t, double)>& rate) {
  HarmonicTimePlan plan(std::move(offers), serial(options));
  const double end_s = play_samples(plan, rate);
  return result_of(plan, options.time_limit_s, end_s);
}

SimulationResult simulate_serial_trace(std::vector<FragmentOffer> offers, const HtcOptions& options,
                                       const BandwidthTrace& trace) {
  NetworkOptions network;
  network.link = trace;
  network.connections = 1;
  return simulate(std::move(offers), serial(options), network);
}

double TraceRandom::uniform() { return numbers_.next() + 1 / 9007199254740992.0; }

double TraceRandom::normal() {
  const double u = uniform(), v = uniform();
  return std::sqrt(-2 * portable::log(u)) * portable::cos(2 * portable::kPi * v);
}

BandwidthTrace random_trace(double mean_bytes_s, double cv, double rho, double step_s, double length_s,
                            std::uint64_t seed) {
  const double variance = portable::log(1 + cv * cv), sigma = std::sqrt(variance);
  TraceRandom random(seed);
  BandwidthTrace trace{{}, {}};
  double x = random.normal();
  const auto steps = static_cast<std::size_t>(std::ceil(length_s / step_s));
  for (std::size_t i = 0; i <= steps; ++i) {
    trace.time_s.push_back(static_cast<double>(i) * step_s);
    trace.bytes_s.push_back(mean_bytes_s * portable::exp(sigma * x - variance / 2));
    x = rho * x + std::sqrt(1 - rho * rho) * random.normal();
  }
  return trace;
}

HtcTheorem theorem_of(const HarmonicTimePlan& plan) {
  HtcTheorem t;
  const std::vector<HtcStep>& steps = plan.steps();
  if (steps.empty()) return t;
  const std::size_t n = steps.size();
  const HtcStep& last = steps.back();
  t.surplus_s = plan.surplus_s();
  t.last_residual_s = last.residual_s;
  if (last.bytes > 0) {
    const double beta_n = last.bytes / last.spacing_s;
    t.corrected_bound_s = std::abs(last.theta_s) * std::abs(last.throughput_bytes_s / beta_n - 1) +
                          std::abs(last.target_bytes - last.bytes) / beta_n;
  } else {
    t.corrected_bound_s = std::abs(last.theta_s);
  }
  double sum = 0;
  for (std::size_t k = 0; k + 1 < n; ++k) sum += steps[k].residual_s;
  const double mean = n > 1 ? sum / static_cast<double>(n - 1) : 0;
  const double log_n = portable::log(static_cast<double>(std::max<std::size_t>(n, 3)));
  t.published_bound_s =
      last.residual_s + (n > 1 ? steps[n - 2].residual_s / 2 : 0) + (1.088 + portable::log(log_n)) * mean;
  return t;
}

HtcTheorem theorem_run(const HtcOptions& base, const std::vector<FragmentOffer>& offers, int seed, int runs) {
  HtcOptions o = base;
  o.window = 1;
  o.hard_limits = false;
  o.time_limit_s = kTheoremLimit_s;
  o.initial_bytes_s = 20e3 + 33e3 * seed / runs;
  HarmonicTimePlan plan(offers, o);
  const BandwidthTrace samples =
      random_trace(41.68e3, 0.05 * (seed % 20), 0.5, 1, 300, static_cast<std::uint64_t>(seed));
  play_samples(plan, [&](std::size_t k, double) { return samples.bytes_s[k]; });
  return theorem_of(plan);
}

}  // namespace texmesh
