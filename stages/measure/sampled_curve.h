#pragma once
#include <algorithm>
#include <array>
#include <cstddef>

namespace texmesh {

/// A function of 0 .. 1 by linear interpolation between kSteps + 1 samples.
template <int kSteps>
class SampledCurve {
 public:
  template <class F>
  explicit SampledCurve(F f) {
    for (std::size_t i = 0; i < table_.size(); ++i)
      table_[i] = static_cast<float>(f(static_cast<double>(i) / kSteps));
  }
  float operator()(float x) const {
    const float at = std::clamp(x, 0.f, 1.f) * kSteps;
    const auto i = std::min(static_cast<std::size_t>(at), static_cast<std::size_t>(kSteps - 1));
    return table_[i] + (table_[i + 1] - table_[i]) * (at - static_cast<float>(i));
  }

 private:
  std::array<float, kSteps + 1> table_;
};

}  // namespace texmesh
