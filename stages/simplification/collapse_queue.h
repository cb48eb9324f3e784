#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "format/base/no_index.h"

namespace texmesh {

/// 4-ary heap of items with changeable keys; equal keys come out by rising item number. The keys stand in the
/// heap itself, so that a sift touches no other memory but the places it writes.
class CollapseQueue {
 public:
  explicit CollapseQueue(std::size_t items) : at_(items, kNoIndex) {}
  bool empty() const { return heap_.empty(); }
  std::uint32_t top() const { return heap_[0].item; }
  /// The heap itself: what comes out after top() is among items 1 to 4, what comes next among 1 to 20.
  std::size_t size() const { return heap_.size(); }
  std::uint32_t item(std::size_t i) const { return heap_[i].item; }
  bool contains(std::uint32_t item) const { return at_[item] != kNoIndex; }
  double key(std::uint32_t item) const { return heap_[at_[item]].key; }  // of one that it contains
  bool less(std::size_t i, std::size_t j) const { return heap_[i] < heap_[j]; }
  /// For an empty queue: all items at once, in linear time; call order() behind the last.
  void append(std::uint32_t item, double key);
  void order();
  void set(std::uint32_t item, double key);  // inserts or moves
  void erase(std::uint32_t item);

 private:
  struct Entry {
    double key;
    std::uint32_t item;
    bool operator<(const Entry& o) const { return key < o.key || (key == o.key && item < o.item); }
  };
  void place(std::size_t i, const Entry& entry) {
    heap_[i] = entry;
    at_[entry.item] = static_cast<std::uint32_t>(i);
  }
  void sift_up(std::size_t i);
  void sift_down(std::size_t i);
  std::vector<Entry> heap_;
  std::vector<std::uint32_t> at_;
};

}  // namespace texmesh
