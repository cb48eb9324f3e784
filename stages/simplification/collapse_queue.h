#pragma once
#include <compare>
#include <cstddef>
#include <vector>

#include "format/base/vec.h"

namespace texmesh {

/// What can be removed from a mesh at once: a point, by a collapse, or a whole component. Points are less
/// than components; among themselves both stand by their index, which is below 2^31.
class Removable {
 public:
  static Removable point(std::uint32_t index) { return Removable(index); }
  static Removable component(std::uint32_t index) { return Removable(index | kComponent); }
  bool is_component() const { return (value_ & kComponent) != 0; }
  std::uint32_t index() const { return value_ & ~kComponent; }
  friend auto operator<=>(Removable, Removable) = default;

 private:
  static constexpr std::uint32_t kComponent = 0x80000000;
  explicit Removable(std::uint32_t value) : value_(value) {}
  std::uint32_t value_;
};

/// 4-ary heap of points and components with changeable keys; of equal keys the lesser item comes out first.
/// The keys stand in the heap itself, so that a sift touches no other memory but the places it writes.
class CollapseQueue {
 public:
  CollapseQueue(std::size_t points, std::size_t components)
      : points_(points), at_(points + components, kNoIndex) {}
  bool empty() const { return heap_.empty(); }
  Removable top() const { return heap_[0].item; }
  /// The heap itself: what comes out after top() is among items 1 to 4, what comes next among 1 to 20.
  std::size_t size() const { return heap_.size(); }
  Removable item(std::size_t i) const { return heap_[i].item; }
  bool contains(Removable item) const { return at(item) != kNoIndex; }
  /// Of an item that the queue contains.
  double key(Removable item) const { return heap_[at(item)].key; }
  bool less(std::size_t i, std::size_t j) const { return heap_[i] < heap_[j]; }
  /// For an empty queue: all items at once, in linear time; call order() behind the last.
  void append(Removable item, double key);
  void order();
  /// Inserts the item, or moves it to where its new key belongs.
  void set(Removable item, double key);
  void erase(Removable item);

 private:
  struct Entry {
    double key;
    Removable item;
    bool operator<(const Entry& o) const { return key < o.key || (key == o.key && item < o.item); }
  };
  void place(std::size_t i, const Entry& entry) {
    heap_[i] = entry;
    at(entry.item) = static_cast<std::uint32_t>(i);
  }
  std::size_t number(Removable item) const { return (item.is_component() ? points_ : 0) + item.index(); }
  std::uint32_t& at(Removable item) { return at_[number(item)]; }
  std::uint32_t at(Removable item) const { return at_[number(item)]; }
  void sift_up(std::size_t i);
  void sift_down(std::size_t i);
  std::vector<Entry> heap_;
  std::size_t points_;
  std::vector<std::uint32_t> at_;  // per point, then per component: its place in the heap
};

}  // namespace texmesh
