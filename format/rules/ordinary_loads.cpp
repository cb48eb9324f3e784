#include "format/rules/ordinary_loads.h"

#include "format/base/portable_math.h"
#include "format/rules/split_mix.h"

namespace texmesh {
namespace {

class Draws {
 public:
  /// Logarithms are equally likely.
  double between(double least, double most) {
    return least * portable::exp(random_.next() * portable::log(most / least));
  }

 private:
  SplitMix random_{18};
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
