#pragma once
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "stages/skeletonization/geometry_failure.h"

namespace texmesh {

/// Memory whose addresses have the same order in every run. CGAL's contraction keeps edges in a std::set
/// ordered by address, and with the system's allocator its skeleton varies from run to run (95 to 103 nodes
/// on one scan).
class Arena {
 public:
  explicit Arena(std::size_t capacity)
      : bytes_(std::make_unique_for_overwrite<std::byte[]>(capacity)), capacity_(capacity) {}

  void* allocate(std::size_t size) {
    size = (size + kAlignment - 1) / kAlignment * kAlignment;
    std::vector<void*>& free = free_of(size);
    if (!free.empty()) {
      void* p = free.back();
      free.pop_back();
      return p;
    }
    // Not bad_alloc: the capacity depends on the input alone, a machine's memory does not.
    if (capacity_ - used_ < size) throw GeometryFailure("contraction needs too much memory");
    void* p = bytes_.get() + used_;
    used_ += size;
    return p;
  }

  void release(void* p, std::size_t size) {
    free_of((size + kAlignment - 1) / kAlignment * kAlignment).push_back(p);
  }

 private:
  static constexpr std::size_t kAlignment = alignof(std::max_align_t);

  /// A polyhedron has three kinds of parts: a list is faster than a map.
  std::vector<void*>& free_of(std::size_t size) {
    for (auto& [s, list] : free_)
      if (s == size) return list;
    return free_.emplace_back(size, std::vector<void*>()).second;
  }

  std::unique_ptr<std::byte[]> bytes_;
  std::size_t capacity_, used_ = 0;
  std::vector<std::pair<std::size_t, std::vector<void*>>> free_;
};

/// The arena of the contraction that this thread is in; CGAL default-constructs its allocators, so it cannot
/// be passed.
inline thread_local Arena* current_arena = nullptr;

class ArenaScope {
 public:
  explicit ArenaScope(Arena& arena) : outer_(std::exchange(current_arena, &arena)) {}
  ~ArenaScope() { current_arena = outer_; }
  ArenaScope(const ArenaScope&) = delete;
  ArenaScope& operator=(const ArenaScope&) = delete;

 private:
  Arena* outer_;
};

template <class T>
struct ContractionAllocator {
  using value_type = T;
  ContractionAllocator() = default;
  template <class U>
  ContractionAllocator(const ContractionAllocator<U>&) {}
  T* allocate(std::size_t n) { return static_cast<T*>(current_arena->allocate(n * sizeof(T))); }
  void deallocate(T* p, std::size_t n) { current_arena->release(p, n * sizeof(T)); }
  template <class U>
  bool operator==(const ContractionAllocator<U>&) const {
    return true;
  }
};

}  // namespace texmesh
