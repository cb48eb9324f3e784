#include "delivery/cpp/decide/throughput.h"

#include <algorithm>

namespace texmesh {
namespace {
constexpr std::size_t kRing = 64;
}  // namespace

Throughput::Throughput(double initial_bytes_s)
    : initial_bytes_s_(initial_bytes_s), ring_(kRing), start_bytes_s_(initial_bytes_s) {}

void Throughput::add(double bytes, double seconds, const OtherTransfers& others) {
  const Sample sample{bytes, std::max(seconds, kLeastSeconds)};
  ring_[count_++ % kRing] = sample;
  const Sample before = sums_.empty() ? Sample{} : sums_.back();
  sums_.push_back({before.bytes + sample.bytes, before.seconds + sample.seconds});
  starting_ = starting_ && count_ <= others.count;
  const Sample all = sums_.back();
  start_bytes_s_ =
      std::clamp(initial_bytes_s_, all.bytes / all.seconds, (all.bytes + others.bytes) / all.seconds);
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
  if (from <= 0) return (all.bytes - from * initial_bytes_s_) / seconds;
  const auto cut = std::upper_bound(sums_.begin(), sums_.end() - 1, from,
                                    [](double s, const Sample& sum) { return s < sum.seconds; });
  const Sample before = cut == sums_.begin() ? Sample{} : cut[-1];
  const double part = (cut->seconds - from) / (cut->seconds - before.seconds);
  return (all.bytes - cut->bytes + part * (cut->bytes - before.bytes)) / seconds;
}

}  // namespace texmesh
