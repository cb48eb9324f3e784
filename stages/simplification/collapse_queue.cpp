#include "stages/simplification/collapse_queue.h"

#include <algorithm>

namespace texmesh {

void CollapseQueue::append(Removable item, double key) {
  heap_.push_back({key, item});
  at(item) = static_cast<std::uint32_t>(heap_.size() - 1);
}

void CollapseQueue::order() {
  for (std::size_t i = heap_.size() / 4 + 1; i-- > 0;)
    if (i < heap_.size()) sift_down(i);
}

void CollapseQueue::set(Removable item, double key) {
  const std::uint32_t i = at(item);
  if (i == kNoIndex) {
    append(item, key);
    sift_up(heap_.size() - 1);
    return;
  }
  const double old = heap_[i].key;
  heap_[i].key = key;
  if (key < old)
    sift_up(i);
  else if (key > old)
    sift_down(i);
}

void CollapseQueue::erase(Removable item) {
  const std::uint32_t i = at(item);
  if (i == kNoIndex) return;
  at(item) = kNoIndex;
  const Entry last = heap_.back();
  heap_.pop_back();
  if (last.item == item) return;
  place(i, last);
  sift_up(i);
  sift_down(at(last.item));
}

void CollapseQueue::sift_up(std::size_t i) {
  const Entry entry = heap_[i];
  while (i > 0 && entry < heap_[(i - 1) / 4]) {
    place(i, heap_[(i - 1) / 4]);
    i = (i - 1) / 4;
  }
  place(i, entry);
}

void CollapseQueue::sift_down(std::size_t i) {
  const Entry entry = heap_[i];
  for (;;) {
    std::size_t least = 4 * i + 1;
    if (least >= heap_.size()) break;
    const std::size_t end = std::min(least + 4, heap_.size());
    for (std::size_t c = least + 1; c < end; ++c)
      if (heap_[c] < heap_[least]) least = c;
    if (!(heap_[least] < entry)) break;
    place(i, heap_[least]);
    i = least;
  }
  place(i, entry);
}

}  // namespace texmesh
