#include "delivery/cpp/simulation.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "format/portable_math.h"

namespace texmesh {
namespace {

constexpr double kRetryFactor = 4, kLeastRetryRtts = 8, kLeastRetry_s = 0.5;
constexpr double kForEver = 1e9;

double loss_of(const FragmentOffer& f, std::int32_t rung) {
  return f.loss[static_cast<std::size_t>(rung + 1)];
}

std::int32_t nearest_rung_to(const FragmentOffer& f, double bytes) {
  std::int32_t best = 0;
  for (std::size_t r = 1; r < f.bytes.size(); ++r)
    if (std::abs(f.bytes[r] - bytes) < std::abs(f.bytes[static_cast<std::size_t>(best)] - bytes))
      best = static_cast<std::int32_t>(r);
  return best;
}

SimulationResult result_of(const HarmonicTimePlan& plan, double limit_s, double end_s) {
  SimulationResult r;
  r.time_limit_s = limit_s;
  r.end_s = end_s;
  r.deviation_percent = 100 * (limit_s - end_s) / limit_s;
  r.late_s = std::max(0.0, end_s - limit_s);
  r.steps = plan.steps();
  r.rungs = plan.rungs();
  for (const HtcStep& s : r.steps) {
    r.bytes += s.rung < 0 ? 0 : s.bytes;
    r.skipped += s.rung < 0;
  }
  for (std::size_t i = 0; i < r.rungs.size(); ++i) {
    const FragmentOffer& f = plan.offers()[i];
    r.loss += loss_of(f, r.rungs[i]);
    r.planned_loss += loss_of(f, nearest_rung_to(f, f.planned_bytes));
  }
  return r;
}

/// Which mirror delivers first, by what each has delivered so far and has to deliver yet.
class Mirrors {
 public:
  Mirrors(std::size_t count, double initial_bytes_s) {
    ThroughputOptions options;
    options.initial_bytes_s = initial_bytes_s;
    for (std::size_t m = 0; m < count; ++m) mirrors_.push_back({Throughput(options), 0, 0, true});
  }
  std::uint32_t choose(double bytes) const {
    std::size_t best = mirrors_.size();
    double best_s = 0;
    for (std::size_t m = 0; m < mirrors_.size(); ++m) {
      if (!mirrors_[m].alive) continue;
      const double s = (mirrors_[m].owed_bytes + bytes) / mirrors_[m].throughput.bytes_s();
      if (best == mirrors_.size() || s < best_s) best = m, best_s = s;
    }
    return static_cast<std::uint32_t>(best == mirrors_.size() ? 0 : best);
  }
  double asked(std::uint32_t m, double bytes) {
    mirrors_[m].owed_bytes += bytes;
    return mirrors_[m].owed_bytes / mirrors_[m].throughput.bytes_s();
  }
  void delivered(std::uint32_t m, double bytes, double from_s, double now_s) {
    Mirror& mirror = mirrors_[m];
    mirror.throughput.add(bytes, now_s - std::max(mirror.last_s, from_s));
    mirror.last_s = now_s;
    mirror.owed_bytes -= bytes;
  }
  void silent(std::uint32_t m, double bytes) {
    mirrors_[m].owed_bytes -= bytes;
    std::size_t alive = 0;
    for (const Mirror& mirror : mirrors_) alive += mirror.alive;
    if (alive > 1) mirrors_[m].alive = false;
  }

 private:
  struct Mirror {
    Throughput throughput;
    double owed_bytes = 0, last_s = 0;
    bool alive = true;
  };
  std::vector<Mirror> mirrors_;
};

struct Asked {
  std::uint32_t mirror = 0;
  double at_s = 0, patience_s = 0, bytes = 0;
};

}  // namespace

SimulationResult simulate(std::vector<FragmentOffer> offers, const HtcOptions& options,
                          const NetworkOptions& network) {
  HarmonicTimePlan plan(std::move(offers), options);
  NetworkModel model(network);
  Mirrors mirrors(network.mirrors.size(), options.throughput.initial_bytes_s);
  std::map<std::uint32_t, Asked> asked;
  double end_s = 0;
  const bool retries = network.mirrors.size() > 1;  // a single one can only be waited for
  const auto ask = [&](std::uint32_t offer, double bytes) {
    const std::uint32_t m = mirrors.choose(bytes);
    const double expected = mirrors.asked(m, bytes);
    const double patience =
        std::max({kLeastRetry_s, kLeastRetryRtts * network.rtt_s, kRetryFactor * expected});
    asked[offer] = {m, model.now_s(), patience, bytes};
    model.request(offer, m, bytes);
  };
  while (!plan.finished()) {
    while (const HtcStep* step = plan.next(model.now_s())) ask(step->offer, step->bytes);
    if (plan.finished()) break;
    double until = kForEver;
    if (retries)
      for (const auto& [offer, a] : asked) until = std::min(until, a.at_s + a.patience_s);
    if (const auto arrival = model.advance(until)) {
      const Asked a = asked.at(arrival->request);
      asked.erase(arrival->request);
      mirrors.delivered(a.mirror, a.bytes, a.at_s + network.rtt_s, arrival->time_s);
      plan.completed(arrival->request, arrival->time_s);
      end_s = arrival->time_s;
      continue;
    }
    if (model.now_s() >= kForEver) break;
    std::vector<std::pair<std::uint32_t, Asked>> late;
    for (const auto& [offer, a] : asked)
      if (a.at_s + a.patience_s <= model.now_s()) late.emplace_back(offer, a);
    for (const auto& [offer, a] : late) {
      model.cancel(offer);
      mirrors.silent(a.mirror, a.bytes);
      asked.erase(offer);
      ask(offer, a.bytes);
    }
  }
  return result_of(plan, options.time_limit_s, end_s);
}

SimulationResult simulate_samples(std::vector<FragmentOffer> offers, const HtcOptions& options,
                                  const std::function<double(std::size_t, double)>& rate) {
  HtcOptions serial = options;
  serial.window = 1;
  serial.rtt_s = 0;
  HarmonicTimePlan plan(std::move(offers), serial);
  double now_s = 0;
  while (const HtcStep* step = plan.next(now_s)) {
    now_s += step->bytes / rate(step->position, now_s);
    plan.completed(step->offer, now_s);
  }
  return result_of(plan, options.time_limit_s, now_s);
}

SimulationResult simulate_serial_trace(std::vector<FragmentOffer> offers, const HtcOptions& options,
                                       const BandwidthTrace& trace) {
  HtcOptions serial = options;
  serial.window = 1;
  serial.rtt_s = 0;
  NetworkOptions network;
  network.link = trace;
  network.connections = 1;
  return simulate(std::move(offers), serial, network);
}

double TraceRandom::uniform() {
  state_ += 0x9e3779b97f4a7c15ull;
  std::uint64_t z = state_;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  z ^= z >> 31;
  return (static_cast<double>(z >> 11) + 1.0) / 9007199254740992.0;
}

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

}  // namespace texmesh
