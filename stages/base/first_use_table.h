#pragma once
#include <bit>
#include <vector>

#include "format/base/vec.h"

namespace texmesh {

/// One more word of a record's hash; begin with 0. Any mix serves: records decide about what is equal.
constexpr std::uint64_t hash_with(std::uint64_t hash, std::uint64_t word) {
  hash = (hash ^ word) * 0x9e3779b97f4a7c15u;
  return hash ^ hash >> 29;
}

/// Which records are equal: equal ones have one number, and numbers are given in the order of first use.
/// Open addressing in a power of two, of which at most half is taken; fewer than 2^31 numbers.
class FirstUseTable {
 public:
  explicit FirstUseTable(std::size_t expected = 0) : slots_(slots_for(expected), kNoIndex) {}

  /// Of a record with this hash: the number n that `same(n)` holds for, or the next new one, which is
  /// size() - 1 then. `hash_of(n)` is asked when the table grows.
  std::uint32_t number_of(std::uint64_t hash, const auto& same, const auto& hash_of) {
    if (2 * std::size_t{size_} >= slots_.size()) grow(hash_of);
    std::size_t at = slot_of(hash);
    for (; slots_[at] != kNoIndex; at = next(at))
      if (same(slots_[at])) return slots_[at];
    return slots_[at] = size_++;
  }
  std::uint32_t size() const { return size_; }

 private:
  static std::size_t slots_for(std::size_t expected) {
    return std::bit_ceil(std::max<std::size_t>(1024, 2 * expected + 2));
  }
  std::size_t slot_of(std::uint64_t hash) const {
    return hash * 0xbf58476d1ce4e5b9u >> (64 - std::countr_zero(slots_.size()));
  }
  std::size_t next(std::size_t at) const { return (at + 1) & (slots_.size() - 1); }
  void grow(const auto& hash_of) {
    slots_.assign(slots_.size() * 4, kNoIndex);
    for (std::uint32_t n = 0; n < size_; ++n) {
      std::size_t at = slot_of(hash_of(n));
      while (slots_[at] != kNoIndex) at = next(at);
      slots_[at] = n;
    }
  }

  std::vector<std::uint32_t> slots_;  // numbers, kNoIndex = free
  std::uint32_t size_ = 0;
};

}  // namespace texmesh
