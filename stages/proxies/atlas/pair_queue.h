#pragma once
// Inside proxies only: pairs of vertices, or of charts, in the order in which they become one.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <tuple>
#include <vector>

namespace texmesh {

/// Two members and what it costs to join them. An entry is stale when one of the two has changed since: then
/// the sum of their versions is another.
struct QueuedPair {
  float cost = 0;
  std::uint32_t a = 0, b = 0, stamp = 0, tries = 0;
  /// True for what is joined later; ties go by index, so that the order is the same everywhere.
  friend bool operator<(const QueuedPair& x, const QueuedPair& y) {
    if (x.cost != y.cost) return x.cost > y.cost;
    return std::tie(x.a, x.b, x.stamp, x.tries) > std::tie(y.a, y.b, y.stamp, y.tries);
  }
};

/// A heap of pairs, four below each: half as deep as one of two, and they lie side by side. Stale entries are
/// swept out when they may be half of all, so memory stays linear.
class PairQueue {
 public:
  explicit PairQueue(std::size_t member_count) : versions_(member_count, 0) {}

  bool empty() const { return heap_.empty(); }
  bool is_fresh(const QueuedPair& e) const { return e.stamp == versions_[e.a] + versions_[e.b]; }
  /// Makes all entries of the member stale.
  void touch(std::uint32_t member) { ++versions_[member]; }
  void push(std::uint32_t a, std::uint32_t b, double cost, std::uint32_t tries = 0) {
    if (heap_.size() >= sweep_at_) sweep();
    const QueuedPair e{static_cast<float>(cost), std::min(a, b), std::max(a, b), versions_[a] + versions_[b],
                       tries};
    std::size_t i = heap_.size();
    heap_.push_back(e);
    for (; i > 0 && heap_[(i - 1) / kBelow] < e; i = (i - 1) / kBelow) heap_[i] = heap_[(i - 1) / kBelow];
    heap_[i] = e;
  }
  QueuedPair pop() {
    const QueuedPair first = heap_.front(), last = heap_.back();
    heap_.pop_back();
    if (!heap_.empty()) put_below(0, last);
    return first;
  }

 private:
  /// Puts an entry at i or below; all that is below is in order.
  void put_below(std::size_t i, const QueuedPair e) {
    for (std::size_t first = kBelow * i + 1; first < heap_.size(); first = kBelow * i + 1) {
      const auto end = heap_.begin() + static_cast<std::ptrdiff_t>(std::min(first + kBelow, heap_.size()));
      const auto next = std::max_element(heap_.begin() + static_cast<std::ptrdiff_t>(first), end);
      if (!(e < *next)) break;
      heap_[i] = *next;
      i = static_cast<std::size_t>(next - heap_.begin());
    }
    heap_[i] = e;
  }

  void sweep() {
    std::erase_if(heap_, [&](const QueuedPair& e) { return !is_fresh(e); });
    for (std::size_t i = heap_.size() / kBelow + 1; i-- > 0;)
      if (i < heap_.size()) put_below(i, heap_[i]);
    sweep_at_ = std::max<std::size_t>(2 * heap_.size(), kLeastSweep);
  }

  static constexpr std::size_t kBelow = 4, kLeastSweep = 1 << 12;
  std::vector<QueuedPair> heap_;
  std::vector<std::uint32_t> versions_;  // per member
  std::size_t sweep_at_ = kLeastSweep;
};

}  // namespace texmesh
