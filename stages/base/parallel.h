#pragma once

#include "stages/base/run_context.h"

namespace texmesh {

/// Calls body(begin, end) over disjoint pieces that cover [0, count), on at most context.threads threads;
/// pieces hold at least `grain` items. The body must write to places that depend on the index alone; sums go
/// through per-piece slots of a *fixed* size added up in order, never through atomics, so that results do not
/// depend on the threads. Rethrows the first exception of a piece; checks for cancellation between pieces.
void parallel_for(const RunContext& context, std::size_t count, std::size_t grain,
                  const std::function<void(std::size_t begin, std::size_t end)>& body);

/// The same for body(index).
void parallel_each(const RunContext& context, std::size_t count, std::size_t grain, const auto& body) {
  parallel_for(context, count, grain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) body(i);
  });
}

/// Deterministic sum: pieces of exactly `piece` items are summed by part(begin, end) and added in index
/// order.
double parallel_sum(const RunContext& context, std::size_t count, std::size_t piece,
                    const std::function<double(std::size_t begin, std::size_t end)>& part);

}  // namespace texmesh
