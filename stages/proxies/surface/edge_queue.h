#pragma once
// Inside proxies only: edges in the order in which they collapse.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <tuple>
#include <vector>

namespace texmesh {

/// An edge between two vertices, and what its collapse costs. An entry is stale when one of the vertices has
/// changed since: then the sum of their versions is another.
struct QueuedEdge {
  float cost = 0;
  std::uint32_t a = 0, b = 0, stamp = 0, tries = 0;
  /// True for what collapses later; ties go by index, so that the order is the same everywhere.
  friend bool operator<(const QueuedEdge& x, const QueuedEdge& y) {
    return std::tie(x.cost, x.a, x.b, x.stamp, x.tries) > std::tie(y.cost, y.a, y.b, y.stamp, y.tries);
  }
};

/// A heap of edges. Stale entries are swept out when they may be half of all, so memory stays linear.
class EdgeQueue {
 public:
  explicit EdgeQueue(std::size_t vertex_count) : versions_(vertex_count, 0) {}

  bool empty() const { return heap_.empty(); }
  bool is_fresh(const QueuedEdge& e) const { return e.stamp == versions_[e.a] + versions_[e.b]; }
  /// Makes all entries of the vertex stale.
  void touch(std::uint32_t vertex) { ++versions_[vertex]; }
  void push(std::uint32_t a, std::uint32_t b, double cost, std::uint32_t tries = 0) {
    if (heap_.size() >= sweep_at_) sweep();
    heap_.push_back(
        {static_cast<float>(cost), std::min(a, b), std::max(a, b), versions_[a] + versions_[b], tries});
    std::push_heap(heap_.begin(), heap_.end());
  }
  QueuedEdge pop() {
    std::pop_heap(heap_.begin(), heap_.end());
    const QueuedEdge e = heap_.back();
    heap_.pop_back();
    return e;
  }

 private:
  void sweep() {
    std::erase_if(heap_, [&](const QueuedEdge& e) { return !is_fresh(e); });
    std::make_heap(heap_.begin(), heap_.end());
    sweep_at_ = std::max<std::size_t>(2 * heap_.size(), kLeastSweep);
  }

  static constexpr std::size_t kLeastSweep = 1 << 12;
  std::vector<QueuedEdge> heap_;
  std::vector<std::uint32_t> versions_;  // per vertex
  std::size_t sweep_at_ = kLeastSweep;
};

}  // namespace texmesh
