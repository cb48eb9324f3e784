#pragma once
#include <cstdint>
#include <functional>

namespace texmesh {

struct Stage;

enum class StageEvent : std::uint8_t { kStarted, kProgress, kHit, kRan };

/// Told from any thread, one call at a time. `fraction` is 0..1 for kProgress; `seconds` is wall time of
/// kRan.
using StageObserver =
    std::function<void(const Stage& stage, StageEvent event, double fraction, double seconds)>;

}  // namespace texmesh
