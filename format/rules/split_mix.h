#pragma once
#include <cstdint>
#include <utility>
#include <vector>

namespace texmesh {

/// SplitMix64 (Steele, Lea, Flood 2014): the same numbers on every machine.
class SplitMix {
 public:
  explicit SplitMix(std::uint64_t seed) : state_(seed) {}
  std::uint64_t bits() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15ull);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    return z ^ (z >> 31);
  }
  double next() { return static_cast<double>(bits() >> 11) / 9007199254740992.0; }  // 0 <= x < 1
  double between(double low, double high) { return low + (high - low) * next(); }
  std::size_t below(std::size_t n) { return static_cast<std::size_t>(next() * static_cast<double>(n)); }
  /// Every order is equally likely (Fisher, Yates).
  void shuffle(auto& list) {
    for (std::size_t i = list.size(); i > 1; --i) {
      using std::swap;
      swap(list[i - 1], list[below(i)]);
    }
  }

 private:
  std::uint64_t state_;
};

}  // namespace texmesh
