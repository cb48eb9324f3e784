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
    return std::tie(x.cost, x.a, x.b, x.stamp, x.tries) > std::tie(y.cost, y.a, y.b, y.stamp, y.tries);
  }
};

/// A heap of pairs. Stale entries are swept out when they may be half of all, so memory stays linear.
class PairQueue {
 public:
  explicit PairQueue(std::size_t member_count) : versions_(member_count, 0) {}

  bool empty() const { return heap_.empty(); }
  bool is_fresh(const QueuedPair& e) const { return e.stamp == versions_[e.a] + versions_[e.b]; }
  /// Makes all entries of the member stale.
  void touch(std::uint32_t member) { ++versions_[member]; }
  void push(std::uint32_t a, std::uint32_t b, double cost, std::uint32_t tries = 0) {
    if (heap_.size() >= sweep_at_) sweep();
    heap_.push_back(
        {static_cast<float>(cost), std::min(a, b), std::max(a, b), versions_[a] + versions_[b], tries});
    std::push_heap(heap_.begin(), heap_.end());
  }
  QueuedPair pop() {
    std::pop_heap(heap_.begin(), heap_.end());
    const QueuedPair e = heap_.back();
    heap_.pop_back();
    return e;
  }

 private:
  void sweep() {
    std::erase_if(heap_, [&](const QueuedPair& e) { return !is_fresh(e); });
    std::make_heap(heap_.begin(), heap_.end());
    sweep_at_ = std::max<std::size_t>(2 * heap_.size(), kLeastSweep);
  }

  static constexpr std::size_t kLeastSweep = 1 << 12;
  std::vector<QueuedPair> heap_;
  std::vector<std::uint32_t> versions_;  // per member
  std::size_t sweep_at_ = kLeastSweep;
};

}  // namespace texmesh
