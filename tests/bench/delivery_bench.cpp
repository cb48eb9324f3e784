// What the policies of a transfer come to over links that behave badly, what round trips cost, and how long
// decisions take. Everything but the times is deterministic.
//   delivery_bench [--runs N] [PACKAGE]     the list of a package instead of one made by code
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "delivery/cpp/decide/fragment_list.h"
#include "format/rules/allocation.h"
#include "lab/transfer/chapter_4.h"
#include "lab/transfer/policies.h"

namespace {

using namespace texmesh;  // NOLINT: a program's main file
using Clock = std::chrono::steady_clock;

constexpr double kLink_s = 41.68e3, kLimit_s = 10;

/// Fragments whose losses are mean squared errors (8-bit scale), so that a result has a PSNR; weights sum
/// to 1.
struct List {
  std::vector<FragmentOffer> offers;
  double bytes = 0;  // planned
};

/// The thesis's list at ten rungs. Errors as photographs have them: 32 dB at quality 50, 40 dB at 90.
List list_by_code() {
  List list;
  constexpr int kRungs[] = {5, 10, 20, 30, 45, 60, 75, 85, 92, 97};
  for (FragmentOffer f : table_4_2_offers()) {
    const std::vector<std::uint32_t> all = f.bytes;
    // The offers have 26 rungs: 5, 10 .. 90, 92, 94, 95 .. 100.
    const auto at = [](int q) { return static_cast<std::size_t>(q <= 90 ? q / 5 - 1 : q == 92 ? 18 : 22); };
    f.bytes.clear();
    f.loss = {800.0 / 256};
    for (const int q : kRungs) {
      const double scale = q < 50 ? 50.0 / q : 2 - q / 50.0;
      f.bytes.push_back(all[at(q)]);
      f.loss.push_back(40 * std::pow(scale, 1.1) / 256);
    }
    f.low_rung = 4;
    f.high_rung = 9;
    f.planned_bytes = std::min<double>(f.planned_bytes, f.bytes.back());  // qualities are clipped to 5 .. 97
    list.bytes += f.planned_bytes;
    list.offers.push_back(std::move(f));
  }
  return list;
}

List list_of(const std::string& path) {
  PackageReader package(open_store(path));
  ListOptions options;
  const FragmentList fragments = fragment_list(package, full_size(package), options);
  List list;
  for (std::size_t i = 0; i < fragments.offers.size(); ++i) {
    FragmentOffer f = fragments.offers[i];
    const auto [plane, fragment] = fragments.fragments[i];
    const PlaneTables& t = package.tables().planes[plane];
    if (package.textures()[plane].role != "base-colour") continue;  // PSNR of base colour
    const double weight = t.surface_fraction[fragment];
    // What a preview leaves is not in the tables as a mean squared error; as much worse as its SSIM says.
    const double lowest = t.mse[fragment],
                 skip = lowest * std::max(1.0, static_cast<double>(t.skip_dssim[fragment]) /
                                                   std::max(1e-3f, t.dssim[fragment]));
    f.loss = {weight * skip};
    for (std::size_t r = 0; r < f.bytes.size(); ++r)
      f.loss.push_back(weight * t.mse[r * t.fragment_count() + fragment]);
    list.bytes += f.planned_bytes;
    list.offers.push_back(std::move(f));
  }
  return list;
}

struct Link {
  const char* name;
  BandwidthTrace (*trace)(double mean, std::uint64_t seed);
};

BandwidthTrace on_off(double mean, std::uint64_t seed) {
  BandwidthTrace t{{}, {}};
  TraceRandom random(seed);
  for (int i = 0; i < 4000; ++i) {
    t.time_s.push_back(0.02 * i);
    t.bytes_s.push_back(random.uniform() < 0.5 ? 2 * mean : 1);
  }
  t.time_s.push_back(80);
  t.bytes_s.push_back(mean);
  return t;
}
const Link kLinks[] = {
    {"steady", [](double m, std::uint64_t s) { return random_trace(m, 0.02, 0.9, 0.1, 60, s); }},
    {"bursty cv 0.5", [](double m, std::uint64_t s) { return random_trace(m, 0.5, 0.9, 0.1, 60, s); }},
    {"bursty cv 0.9", [](double m, std::uint64_t s) { return random_trace(m, 0.9, 0.9, 0.1, 60, s); }},
    {"on/off 20 ms", on_off},
    {"stall 2 s",
     [](double m, std::uint64_t) {
       return BandwidthTrace{{0, 3, 5}, {m, 1, m}};
     }},
    {"stall 4 s",
     [](double m, std::uint64_t) {
       return BandwidthTrace{{0, 3, 7}, {m, 1, m}};
     }},
    {"drop 3x",
     [](double m, std::uint64_t) {
       return BandwidthTrace{{0, 4}, {m, m / 3}};
     }},
    {"drop 10x",
     [](double m, std::uint64_t) {
       return BandwidthTrace{{0, 4}, {m, m / 10}};
     }},
};

struct Way {
  const char* name;
  LabPolicy policy;
  bool hard;
};
const Way kWays[] = {{"htca, hard limits", LabPolicy::kHtc, true},
                     {"htca", LabPolicy::kHtc, false},
                     {"guard", LabPolicy::kGuard, false},
                     {"price", LabPolicy::kPrice, false},
                     {"proportional", LabPolicy::kProportional, false},
                     {"static", LabPolicy::kStatic, false}};

HtcOptions options_of(const Way& way) {
  HtcOptions o = texmesh::options_of({.policy = way.policy, .estimator = default_estimator(way.policy)});
  o.hard_limits = way.hard;
  o.time_limit_s = kLimit_s;
  o.initial_bytes_s = kLink_s;
  return o;
}

double psnr(double mse) { return 10 * std::log10(65025 / std::max(mse, 1e-9)); }

void print_policies(const List& list, double weight, int runs) {
  const double rate = list.bytes / kLimit_s;  // what the plan needs
  std::printf(
      "policies over links of %.1f kB/s in the mean, T_0 = %.0f s, %zu fragments, one request at a time, no "
      "latency\n"
      "deviation: mean and p95 of |.| in %% of T_0 | latest in %% | PSNR in dB | skipped in %%\n",
      rate / 1e3, kLimit_s, list.offers.size());
  for (const Link& link : kLinks) {
    std::printf("  %s\n", link.name);
    for (const Way& way : kWays) {
      std::vector<double> deviation;
      double late = 0, loss = 0, skipped = 0;
      for (int seed = 1; seed <= runs; ++seed) {
        HtcOptions o = options_of(way);
        o.initial_bytes_s = rate;
        const SimulationResult r =
            simulate_serial_trace(list.offers, o, link.trace(rate, static_cast<std::uint64_t>(seed)));
        deviation.push_back(std::abs(r.deviation_percent));
        late = std::max(late, -r.deviation_percent);
        loss += r.loss / runs;
        skipped += 100.0 * r.skipped / static_cast<double>(list.offers.size()) / runs;
      }
      std::ranges::sort(deviation);
      double mean = 0;
      for (const double d : deviation) mean += d / runs;
      std::printf("    %-18s %8.3f %8.3f | %8.3f | %6.2f | %5.1f\n", way.name, mean,
                  deviation[deviation.size() * 95 / 100], late, psnr(loss / weight), skipped);
    }
  }
}

void print_round_trips(const List& list, double weight, int runs) {
  const double rate = list.bytes / kLimit_s;
  std::printf(
      "\nround trips: guard, %.1f kB/s cv 0.3, T_0 = %.0f s; deviation mean and p95 of |.| in %%, PSNR in "
      "dB, by requests in flight\n"
      "  RTT [ms]  T_0/RTT |            1               2               4               8            auto\n",
      rate / 1e3, kLimit_s);
  for (const double rtt_s : {0.02, 0.05, 0.1, 0.2, 0.33, 0.5}) {
    std::printf("  %8.0f  %7.0f |", 1000 * rtt_s, kLimit_s / rtt_s);
    for (const int window : {1, 2, 4, 8, 0}) {
      std::vector<double> deviation;
      double loss = 0, mean = 0;
      for (int seed = 1; seed <= runs; ++seed) {
        HtcOptions o = options_of({"", LabPolicy::kGuard, false});
        o.initial_bytes_s = rate;
        o.rtt_s = rtt_s;
        o.window = window;
        NetworkOptions network;
        network.link = random_trace(rate, 0.3, 0.9, 0.1, 60, static_cast<std::uint64_t>(seed));
        network.rtt_s = rtt_s;
        network.connections = 64;
        const SimulationResult r = simulate(list.offers, o, network);
        deviation.push_back(std::abs(r.deviation_percent));
        mean += deviation.back() / runs;
        loss += r.loss / runs;
      }
      std::ranges::sort(deviation);
      std::printf(" %5.2f %5.2f %4.1f", mean, deviation[deviation.size() * 95 / 100], psnr(loss / weight));
    }
    std::printf("\n");
  }
}

template <class F>
double seconds(F&& run) {
  const auto start = Clock::now();
  run();
  return std::chrono::duration<double>(Clock::now() - start).count();
}

void print_times(const List& list) {
  const std::size_t n = list.offers.size();
  std::printf("\ntimes, %zu fragments of %zu rungs\n", n, list.offers[0].bytes.size());
  for (const Way& way : kWays) {
    double least = 1e9;
    for (int i = 0; i < 20; ++i) {
      HarmonicTimePlan plan(list.offers, options_of(way));
      double now = 0;
      least = std::min(least, seconds([&] {
                         while (const HtcStep* step = plan.next(now)) {
                           now += step->bytes / kLink_s;
                           plan.completed(step->offer, now);
                         }
                       }));
    }
    std::printf("  decision, %-18s %7.2f us\n", way.name, 1e6 * least / static_cast<double>(n));
  }
  std::vector<RdCurve> curves;
  for (const FragmentOffer& f : list.offers) {
    RdCurve c{{0}, {}};
    c.bytes.insert(c.bytes.end(), f.bytes.begin(), f.bytes.end());
    for (const double loss : f.loss) c.loss.push_back(static_cast<std::uint64_t>(loss * (1 << 20)));
    curves.push_back(std::move(c));
  }
  double least = 1e9;
  for (int i = 0; i < 20; ++i)
    least = std::min(least, seconds([&] { spend_bytes(curves, static_cast<std::uint64_t>(list.bytes)); }));
  std::printf("  allocation of bytes          %7.3f ms\n", 1e3 * least);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Policies, round trips and times of delivery"};
  std::string package;
  int runs = 24;
  app.add_option("package", package, "Take its base colour fragments");
  app.add_option("--runs", runs, "Traces per link")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  const List list = package.empty() ? list_by_code() : list_of(package);
  double weight = 1;
  if (!package.empty()) {
    PackageReader reader(open_store(package));
    weight = 0;
    for (std::uint32_t p = 0; p < full_size(reader).size(); ++p)
      if (reader.textures()[p].role == "base-colour")
        for (const float s : reader.tables().planes[p].surface_fraction) weight += s;
  }
  print_policies(list, weight, runs);
  print_round_trips(list, weight, runs);
  print_times(list);
}
