#pragma once
#include <cstdint>
#include <span>
#include <vector>

namespace texmesh {

/// Things in buckets by a number, without a list of its own for each bucket; in the order in which they came.
template <class T>
struct Buckets {
  std::vector<std::uint32_t> first;  // of each bucket, and the end of the last one: places in `items`
  std::vector<T> items;

  std::span<const T> operator[](std::size_t bucket) const {
    return {items.data() + first[bucket], items.data() + first[bucket + 1]};
  }
  std::span<T> operator[](std::size_t bucket) {
    return {items.data() + first[bucket], items.data() + first[bucket + 1]};
  }
};

/// `each(put)` calls put(bucket, item) for every item, with buckets below `count`. It is called twice, and
/// does the same both times.
template <class T = std::uint32_t>
Buckets<T> in_buckets(std::size_t count, const auto& each) {
  Buckets<T> out{std::vector<std::uint32_t>(count + 1, 0), {}};
  each([&](std::size_t bucket, const T&) { ++out.first[bucket + 1]; });
  for (std::size_t b = 0; b < count; ++b) out.first[b + 1] += out.first[b];
  out.items.resize(out.first[count]);
  std::vector<std::uint32_t> at(out.first.begin(), out.first.end() - 1);
  each([&](std::size_t bucket, const T& item) { out.items[at[bucket]++] = item; });
  return out;
}

}  // namespace texmesh
