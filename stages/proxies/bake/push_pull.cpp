#include "stages/proxies/bake/push_pull.h"

#include <algorithm>

namespace texmesh::proxies {
namespace {

struct PullLevel {
  std::uint32_t width = 0, height = 0;
  std::vector<Vec3f> value;
  std::vector<float> weight;  // 0 = nothing is known here
};

/// Means of 2 x 2 by their weights; a weight of 1 is full knowledge.
PullLevel halved(const PullLevel& fine) {
  PullLevel out{(fine.width + 1) / 2, (fine.height + 1) / 2, {}, {}};
  out.value.resize(std::size_t{out.width} * out.height);
  out.weight.resize(out.value.size(), 0);
  for (std::uint32_t y = 0; y < fine.height; ++y)
    for (std::uint32_t x = 0; x < fine.width; ++x) {
      const std::size_t from = std::size_t{y} * fine.width + x, to = std::size_t{y / 2} * out.width + x / 2;
      out.value[to] = out.value[to] + fine.value[from] * fine.weight[from];
      out.weight[to] += fine.weight[from];
    }
  for (std::size_t i = 0; i < out.value.size(); ++i)
    if (out.weight[i] > 0) {
      out.value[i] = out.value[i] * (1 / out.weight[i]);
      out.weight[i] = std::min(out.weight[i], 1.0f);
    }
  return out;
}

/// The coarse level in the middle of a fine texel, bilinear.
Vec3f read_coarse(const PullLevel& coarse, std::uint32_t x, std::uint32_t y) {
  const auto clamp = [](std::int64_t i, std::uint32_t size) {
    return static_cast<std::size_t>(std::clamp<std::int64_t>(i, 0, std::int64_t{size} - 1));
  };
  const std::int64_t cx = x / 2, cy = y / 2;
  const std::size_t x0 = clamp(cx, coarse.width), x1 = clamp(x % 2 == 0 ? cx - 1 : cx + 1, coarse.width);
  const std::size_t y0 = clamp(cy, coarse.height), y1 = clamp(y % 2 == 0 ? cy - 1 : cy + 1, coarse.height);
  const auto at = [&](std::size_t i, std::size_t j) { return coarse.value[j * coarse.width + i]; };
  return (at(x0, y0) * 0.75f + at(x1, y0) * 0.25f) * 0.75f +
         (at(x0, y1) * 0.75f + at(x1, y1) * 0.25f) * 0.25f;
}

}  // namespace

void push_pull(std::vector<Vec3f>& values, const std::vector<std::uint8_t>& covered, std::uint32_t width,
               std::uint32_t height) {
  if (std::find(covered.begin(), covered.end(), 1) == covered.end()) return;
  std::vector<PullLevel> levels(1);
  levels[0] = {width, height, std::move(values), {}};
  for (const std::uint8_t c : covered) levels[0].weight.push_back(c ? 1 : 0);
  while (levels.back().width > 1 || levels.back().height > 1) levels.push_back(halved(levels.back()));
  for (std::size_t l = levels.size() - 1; l-- > 0;) {
    PullLevel& fine = levels[l];
    for (std::uint32_t y = 0; y < fine.height; ++y)
      for (std::uint32_t x = 0; x < fine.width; ++x) {
        const std::size_t i = std::size_t{y} * fine.width + x;
        if (fine.weight[i] >= 1) continue;
        const Vec3f known = fine.weight[i] > 0 ? fine.value[i] : Vec3f{};
        fine.value[i] = known * fine.weight[i] + read_coarse(levels[l + 1], x, y) * (1 - fine.weight[i]);
      }
  }
  values = std::move(levels[0].value);
}

}  // namespace texmesh::proxies
