#pragma once
#include <cstddef>

namespace texmesh {

/// Asks memory for what stands there, which will be read soon. Any address will do.
inline void ask_memory(const void* place) { __builtin_prefetch(place); }

/// Items in a row whose data lie anywhere in memory would wait for it a dozen times each. So memory is asked
/// for what the next ones read, in steps, each of which reads what the one before it has asked for. `Step`:
/// the steps in their order, an enumeration that ends with kCount. An item takes a step every `apart` items,
/// the last one `apart` items before its turn.
template <class Step, std::size_t apart>
struct LookAhead {
  static constexpr std::size_t kSteps = static_cast<std::size_t>(Step::kCount);
  static constexpr std::size_t kFarthest =
      kSteps * apart;  // items from the one at hand to that of the first step
  /// For every item: ask(step, ahead) for the one that comes `ahead` items later, the farthest first.
  static void each_step(auto&& ask) {
    for (std::size_t step = 0; step < kSteps; ++step) ask(static_cast<Step>(step), (kSteps - step) * apart);
  }
};

}  // namespace texmesh
