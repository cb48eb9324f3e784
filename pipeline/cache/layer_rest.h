#pragma once
#include <chrono>
#include <functional>
#include <optional>

namespace texmesh {

/// Tells the time; tests give one of their own.
using LayerClock = std::function<std::chrono::steady_clock::time_point()>;

/// The time for which a layer that failed is not asked: long enough that a dead server costs a build little,
/// short enough that one that was started again serves the rest of the build.
class LayerRest {
 public:
  static constexpr std::chrono::seconds kRest{60};
  explicit LayerRest(LayerClock clock = {}) : clock_(std::move(clock)) {}
  void begin() { since_ = now(); }
  /// The layer has failed less than kRest ago.
  bool holds() const { return since_ && now() - *since_ < kRest; }

 private:
  std::chrono::steady_clock::time_point now() const {
    return clock_ ? clock_() : std::chrono::steady_clock::now();
  }
  LayerClock clock_;
  std::optional<std::chrono::steady_clock::time_point> since_;
};

}  // namespace texmesh
