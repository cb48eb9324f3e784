#include "format/rules/ordinary_loads.h"

#include <cstdint>

#include "format/base/portable_math.h"

namespace texmesh {
namespace {

/// Numbers by SplitMix64 (Steele, Lea, Flood 2014).
class Draws {
 public:
  /// Logarithms are equally likely.
  double between(double least, double most) {
    return least * portable::exp(unit() * portable::log(most / least));
  }

 private:
  double unit() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15ull);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    return static_cast<double>((z ^ (z >> 31)) >> 11) / 9007199254740992.0;
  }
  std::uint64_t state_ = 18;
};

}  // namespace

std::vector<OrdinaryLoad> ordinary_loads(std::size_t count) {
  std::vector<OrdinaryLoad> out;
  Draws draws;
  for (std::size_t k = 0; k < count; ++k) {
    OrdinaryLoad load;
    load.bytes_s = draws.between(2e6, 50e6) / 8;
    load.displayed_px = draws.between(200, 2000);
    load.time_limit_s = draws.between(1, 10);
    out.push_back(load);
  }
  return out;
}

}  // namespace texmesh
