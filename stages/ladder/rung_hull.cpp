#include "stages/ladder/rung_hull.h"

namespace texmesh::rungs {

Hull hull_of(const TextureWays& texture, const std::vector<std::uint8_t>& keep, std::size_t wanted,
             Levels levels) {
  Hull hull{{kPreview, 0, texture.preview_loss[wanted]}};
  for (;;) {
    const Vertex at = hull.back();
    Vertex best;
    double steepest = 0;
    for (std::size_t k = 0; k < texture.pairs.size(); ++k) {
      const RungPair& pair = texture.pairs[k];
      if (!keep[k] || pair.level < levels.first || pair.level > levels.last) continue;
      const Vertex to{k, static_cast<double>(pair.bytes), pair.loss[wanted]};
      if (to.bytes <= at.bytes || to.loss >= at.loss) continue;
      const double slope = (at.loss - to.loss) / (to.bytes - at.bytes);
      if (slope > steepest || (slope == steepest && to.bytes > best.bytes)) steepest = slope, best = to;
    }
    if (best.pair == kPreview) return hull;
    hull.push_back(best);
  }
}

std::vector<Hull> hulls_of(const TextureWays& texture, const std::vector<std::uint8_t>& keep,
                           std::size_t wanted) {
  std::vector<Hull> out;
  for (std::size_t level = wanted; level < texture.preview_loss.size(); ++level)
    out.push_back(hull_of(texture, keep, wanted, {level, level}));
  return out;
}

std::size_t segment_of(const Hull& hull, double bytes) {
  std::size_t k = 0;
  while (k + 1 < hull.size() && hull[k + 1].bytes <= bytes) ++k;
  return k;
}

double loss_at(const Hull& hull, double bytes) {
  const std::size_t k = segment_of(hull, bytes);
  if (k + 1 == hull.size()) return hull[k].loss;
  const Vertex &a = hull[k], &b = hull[k + 1];
  return a.loss + (b.loss - a.loss) * ((bytes - a.bytes) / (b.bytes - a.bytes));
}

std::size_t best_of(const std::vector<Hull>& hulls, double bytes) {
  std::size_t best = 0;
  for (std::size_t k = 1; k < hulls.size(); ++k)
    if (loss_at(hulls[k], bytes) < loss_at(hulls[best], bytes)) best = k;
  return best;
}

double bytes_of(const TextureWays& texture, const std::vector<std::uint8_t>& keep) {
  double bytes = 0;
  for (std::size_t k = 0; k < keep.size(); ++k)
    if (keep[k]) bytes += static_cast<double>(texture.pairs[k].bytes);
  return bytes;
}

}  // namespace texmesh::rungs
