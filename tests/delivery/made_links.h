#pragma once
// Links and lists that tests are made of: the same numbers on every machine.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "delivery/cpp/decide/harmonic_time.h"
#include "delivery/cpp/simulate/simulation.h"
#include "format/base/portable_math.h"
#include "format/rules/split_mix.h"

namespace texmesh::testing {

class MadeNumbers {
 public:
  explicit MadeNumbers(std::uint64_t seed) : numbers_(seed) {}
  double uniform() { return numbers_.next() + 1 / 9007199254740992.0; }  // (0, 1]
  double normal() {
    const double u = uniform(), v = uniform();
    return std::sqrt(-2 * portable::log(u)) * portable::cos(2 * portable::kPi * v);
  }

 private:
  SplitMix numbers_;
};

/// A link whose rate varies by `cv` of its mean around it, with correlation `rho` from step to step.
inline BandwidthTrace made_link(double mean_bytes_s, double cv, double rho, double step_s, double length_s,
                                std::uint64_t seed) {
  const double variance = portable::log(1 + cv * cv), sigma = std::sqrt(variance);
  MadeNumbers random(seed);
  BandwidthTrace trace{{}, {}};
  double x = random.normal();
  for (std::size_t i = 0; i <= static_cast<std::size_t>(std::ceil(length_s / step_s)); ++i) {
    trace.time_s.push_back(static_cast<double>(i) * step_s);
    trace.bytes_s.push_back(mean_bytes_s * portable::exp(sigma * x - variance / 2));
    x = rho * x + std::sqrt(1 - rho * rho) * random.normal();
  }
  return trace;
}

/// 256 fragments of 418 kB as planned, with eight rungs of 1/8 to 16 times that, as photographs have them.
inline std::vector<FragmentOffer> photo_offers() {
  MadeNumbers random(42);
  std::vector<FragmentOffer> offers(256);
  double total = 0;
  for (FragmentOffer& f : offers) {
    f.eta = (random.uniform() + random.uniform() + random.uniform()) / 3;
    total += f.planned_bytes = portable::exp(0.5 * random.normal()) * (0.5 + f.eta);
  }
  for (FragmentOffer& f : offers) {
    f.planned_bytes *= 418e3 / total;
    f.loss.push_back(0.4 / 256);
    for (int r = -3; r <= 4; ++r) {
      f.bytes.push_back(static_cast<std::uint32_t>(std::max(1.0, std::ldexp(f.planned_bytes, r))));
      f.loss.push_back(std::ldexp(0.03, -r) / 256);
    }
  }
  return offers;
}

}  // namespace texmesh::testing
