#include "stages/proxies/surface/corner_rings.h"

#include <utility>

#include "format/base/no_index.h"

namespace texmesh {

CornerRings::CornerRings(std::vector<Triangle> triangles, std::size_t vertex_count)
    : triangles_(std::move(triangles)),
      live_(triangles_.size(), 1),
      next_(3 * triangles_.size()),
      first_(vertex_count, kNoIndex),
      valence_(vertex_count, 0),
      live_count_(triangles_.size()) {
  for (std::uint32_t c = 0; c < next_.size(); ++c) {
    const std::uint32_t v = triangles_[c / 3][c % 3];
    if (first_[v] == kNoIndex)
      first_[v] = next_[c] = c;
    else
      next_[c] = std::exchange(next_[first_[v]], c);
    ++valence_[v];
  }
}

void CornerRings::triangles_at(std::uint32_t vertex, std::vector<std::uint32_t>& out) {
  out.clear();
  const std::uint32_t start = first_[vertex];
  if (start == kNoIndex) return;
  std::uint32_t last = kNoIndex, head = kNoIndex, c = start;
  do {
    const std::uint32_t following = next_[c];
    if (live_[c / 3]) {
      out.push_back(c / 3);
      if (last == kNoIndex)
        head = c;
      else
        next_[last] = c;
      last = c;
    }
    c = following;
  } while (c != start);
  if (last != kNoIndex) next_[last] = head;
  first_[vertex] = head;
}

void CornerRings::remove(std::uint32_t triangle) {
  live_[triangle] = 0;
  --live_count_;
  for (const std::uint32_t v : triangles_[triangle]) --valence_[v];
}

void CornerRings::merge(std::uint32_t from, std::uint32_t to) {
  const std::uint32_t start = std::exchange(first_[from], kNoIndex);
  if (start == kNoIndex) return;
  std::uint32_t c = start;
  do {
    triangles_[c / 3][c % 3] = to;
    c = next_[c];
  } while (c != start);
  if (first_[to] == kNoIndex)
    first_[to] = start;
  else
    std::swap(next_[first_[to]], next_[start]);
  valence_[to] += std::exchange(valence_[from], 0);
}

}  // namespace texmesh
