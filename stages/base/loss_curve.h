#pragma once
// Curves of what bytes buy: ways to code something, each with `bytes` and `loss`.
#include <algorithm>
#include <utility>
#include <vector>

namespace texmesh {

/// The ways that no mix of two others beats, by rising bytes and falling loss.
template <class Way>
std::vector<Way> convex_curve(std::vector<Way> ways) {
  std::ranges::stable_sort(ways, {}, [](const Way& w) { return std::pair(w.bytes, w.loss); });
  std::vector<Way> out;
  for (const Way& w : ways) {
    if (!out.empty() && w.loss >= out.back().loss) continue;
    while (out.size() >= 2) {
      const Way &a = out[out.size() - 2], &b = out.back();
      if ((b.loss - a.loss) * (w.bytes - a.bytes) < (w.loss - a.loss) * (b.bytes - a.bytes)) break;
      out.pop_back();
    }
    out.push_back(w);
  }
  return out;
}

/// The curve whose next way, behind the one that it stands `at`, gains most for its bytes, times
/// weight(curve); the first of equals. The number of curves where none gains.
template <class Way>
std::size_t best_step(const std::vector<std::vector<Way>>& curves, const std::vector<std::size_t>& at,
                      const auto& weight) {
  std::size_t best = curves.size();
  double most = 0;
  for (std::size_t c = 0; c < curves.size(); ++c) {
    if (at[c] + 1 >= curves[c].size()) continue;
    const Way &now = curves[c][at[c]], &next = curves[c][at[c] + 1];
    const double gain = (now.loss - next.loss) / (next.bytes - now.bytes) * weight(c);
    if (gain > most) most = gain, best = c;
  }
  return best;
}

}  // namespace texmesh
