#include "delivery/cpp/decide/throughput.h"

#include <algorithm>

namespace texmesh {
namespace {
constexpr std::size_t kRing = 64;
constexpr double kLeastSeconds = 1e-9;
}  // namespace

Throughput::Throughput(const ThroughputOptions& options)
    : options_(options),
      ring_(kRing),
      ewma_(options.initial_bytes_s),
      start_bytes_s_(options.initial_bytes_s) {}

void Throughput::add(double bytes, double seconds, const OtherTransfers& others) {
  const Sample sample{bytes, std::max(seconds, kLeastSeconds)};
  ring_[count_++ % kRing] = sample;
  const Sample before = sums_.empty() ? Sample{} : sums_.back();
  sums_.push_back({before.bytes + sample.bytes, before.seconds + sample.seconds});
  starting_ = starting_ && count_ <= others.count;
  const Sample all = sums_.back();
  start_bytes_s_ =
      std::clamp(options_.initial_bytes_s, all.bytes / all.seconds, (all.bytes + others.bytes) / all.seconds);
  const double weight = options_.ewma * std::min(1.0, bytes / options_.small_bytes);
  ewma_ += weight * (sample.bytes / sample.seconds - ewma_);
}

double Throughput::bytes_s() const {
  if (starting_) return start_bytes_s_;
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
  if (n == 0 || starting_) return start_bytes_s_;
  double bytes = 0, seconds = 0;
  for (std::size_t i = 1; i <= n; ++i) {
    const Sample& s = ring_[(count_ - i) % kRing];
    bytes += s.bytes;
    seconds += s.seconds;
  }
  return bytes / seconds;
}

double Throughput::mean_bytes_s(double seconds) const {
  const Sample all = sums_.empty() ? Sample{} : sums_.back();
  const double from = all.seconds - seconds;
  if (from <= 0) return (all.bytes - from * options_.initial_bytes_s) / seconds;
  const auto cut = std::upper_bound(sums_.begin(), sums_.end() - 1, from,
                                    [](double s, const Sample& sum) { return s < sum.seconds; });
  const Sample before = cut == sums_.begin() ? Sample{} : cut[-1];
  const double part = (cut->seconds - from) / (cut->seconds - before.seconds);
  return (all.bytes - cut->bytes + part * (cut->bytes - before.bytes)) / seconds;
}

}  // namespace texmesh
