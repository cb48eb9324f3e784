#include "stages/base/parallel.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <vector>

namespace texmesh {

void parallel_for(const RunContext& context, std::size_t count, std::size_t grain,
                  const std::function<void(std::size_t, std::size_t)>& body) {
  if (count == 0) return;
  grain = std::max<std::size_t>(grain, 1);
  if (context.threads <= 1 || count <= grain) {
    for (std::size_t begin = 0; begin < count; begin += std::max(grain, count / 64 + 1)) {
      context.check_cancelled();
      body(begin, std::min(count, begin + std::max(grain, count / 64 + 1)));
    }
    return;
  }
  tbb::task_arena arena(context.threads);
  arena.execute([&] {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, grain), [&](const auto& range) {
      context.check_cancelled();
      body(range.begin(), range.end());
    });
  });
}

double parallel_sum(const RunContext& context, std::size_t count, std::size_t piece,
                    const std::function<double(std::size_t, std::size_t)>& part) {
  piece = std::max<std::size_t>(piece, 1);
  std::vector<double> sums((count + piece - 1) / piece);
  parallel_for(context, sums.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) sums[i] = part(i * piece, std::min(count, (i + 1) * piece));
  });
  double total = 0;
  for (double s : sums) total += s;
  return total;
}

}  // namespace texmesh
