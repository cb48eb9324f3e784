#include "stages/base/parallel.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <vector>

#ifdef TEXMESH_TELL_TSAN  // stages/CMakeLists.txt
#include <sanitizer/tsan_interface.h>
#endif

namespace texmesh {
namespace {

/// What the thread sanitizer cannot see, since TBB's library is not built with it: pieces of work begin after
/// what came before parallel_for(), and end before what comes after it.
class PieceOrder {
 public:
#ifdef TEXMESH_TELL_TSAN
  PieceOrder() { __tsan_release(&begun_); }
  ~PieceOrder() { __tsan_acquire(&ended_); }
#endif
  /// Stands around a piece.
  class Piece {
   public:
#ifdef TEXMESH_TELL_TSAN
    explicit Piece(PieceOrder& order) : order_(order) { __tsan_acquire(&order_.begun_); }
    ~Piece() { __tsan_release(&order_.ended_); }

   private:
    PieceOrder& order_;
#else
    explicit Piece(PieceOrder&) {}
    ~Piece() {}
#endif
  };

 private:
  [[maybe_unused]] char begun_ = 0, ended_ = 0;
};

}  // namespace

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
  PieceOrder order;
  tbb::task_arena arena(context.threads);
  arena.execute([&] {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, grain), [&](const auto& range) {
      const PieceOrder::Piece piece(order);
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
