#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

#include "format/split/codec/split_site.h"
#include "format/split/look_ahead.h"

namespace texmesh {

/// Points to be asked whether they split now: first come, first served. A point stands in the queue once.
class SplitQueue {
 public:
  explicit SplitQueue(const SplitMesh& mesh) : mesh_(mesh) {}

  /// Before the first block of a scale.
  void clear() {
    queue_.clear();
    next_ = 0;
    no_split_since_refill_ = false;
    std::fill(queued_.begin(), queued_.end(), false);
    std::fill(history_.begin(), history_.end(), std::uint8_t{0});
  }
  void push(std::uint32_t point) {
    if (point >= queued_.size()) {
      queued_.resize(mesh_.points().size(), false);
      history_.resize(mesh_.points().size(), 0);
    }
    if (queued_[point]) return;
    queued_[point] = true;
    queue_.push_back(point);
  }
  /// The next point. An empty queue is filled with all points of the mesh; FormatError when not one of them
  /// split since it was filled the last time.
  std::uint32_t pop() {
    if (next_ == queue_.size()) refill();
    const std::uint32_t point = queue_[next_++];
    queued_[point] = false;
    return point;
  }
  /// The point that is popped after `more` others, of whose history memory is asked for; kNoIndex where the
  /// queue ends before.
  std::uint32_t look_ahead(std::size_t more) const {
    if (next_ + more >= queue_.size()) return kNoIndex;
    const std::uint32_t point = queue_[next_ + more];
    ask_memory(&history_[point]);
    return point;
  }
  std::size_t refusals(std::uint32_t point) const { return history_[point] & 3u; }  // at most 3
  bool has_split(std::uint32_t point) const { return (history_[point] & kHasSplit) != 0; }
  void note_refusal(std::uint32_t point) {
    if (refusals(point) < 3) ++history_[point];
  }
  void note_split(std::uint32_t point) {
    history_[point] = kHasSplit;
    no_split_since_refill_ = false;
  }
  /// Frees the memory of points that were popped.
  void compact() {
    if (next_ <= 65536 || next_ * 2 <= queue_.size()) return;
    queue_.erase(queue_.begin(), queue_.begin() + static_cast<std::ptrdiff_t>(next_));
    next_ = 0;
  }

 private:
  static constexpr std::uint8_t kHasSplit = 4;
  void refill() {
    if (no_split_since_refill_) fail_split_stream("S19", "a split among all points", "none");
    no_split_since_refill_ = true;
    queue_.clear();
    next_ = 0;
    for (std::uint32_t p = 0; p < mesh_.points().size(); ++p) push(p);
    if (queue_.empty()) fail_split_stream("S19", "points to split", "none");
  }

  const SplitMesh& mesh_;
  std::vector<std::uint32_t> queue_;
  std::size_t next_ = 0;
  bool no_split_since_refill_ = false;
  std::vector<bool> queued_;  // per point
  // Per point: refusals 0 to 3, + kHasSplit after a split in this chapter.
  std::vector<std::uint8_t> history_;
};

}  // namespace texmesh
