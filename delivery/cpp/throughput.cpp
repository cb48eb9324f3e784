#include "delivery/cpp/throughput.h"

#include <algorithm>

namespace texmesh {
namespace {
constexpr std::size_t kRing = 64;
constexpr double kLeastSeconds = 1e-9;
}  // namespace

Throughput::Throughput(const ThroughputOptions& options)
    : options_(options), ring_(kRing), ewma_(options.initial_bytes_s) {}

void Throughput::add(double bytes, double seconds) {
  const Sample sample{bytes, std::max(seconds, kLeastSeconds)};
  ring_[count_++ % kRing] = sample;
  const double weight = options_.ewma * std::min(1.0, bytes / options_.small_bytes);
  ewma_ += weight * (sample.bytes / sample.seconds - ewma_);
}

double Throughput::bytes_s() const {
  if (count_ == 0) return options_.initial_bytes_s;
  switch (options_.estimator) {
    case Estimator::kLast:
      return recent_bytes_s(1);
    case Estimator::kHarmonic:
      return recent_bytes_s(static_cast<std::size_t>(std::max(options_.samples, 1)));
    case Estimator::kEwma:
      return ewma_;
  }
  return ewma_;
}

double Throughput::recent_bytes_s(std::size_t samples) const {
  const std::size_t n = std::min({samples, count_, kRing});
  if (n == 0) return options_.initial_bytes_s;
  double bytes = 0, seconds = 0;
  for (std::size_t i = 1; i <= n; ++i) {
    const Sample& s = ring_[(count_ - i) % kRing];
    bytes += s.bytes;
    seconds += s.seconds;
  }
  return bytes / seconds;
}

}  // namespace texmesh
