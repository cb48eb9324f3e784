#include "pipeline/import/near_uvs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

namespace texmesh {
namespace {

/// Least move in u and in v that a chart's textures do not notice, in repeats; 0 = none.
struct Period {
  std::array<int, 2> move{1, 1};
  void restrict_by(int axis, int other) {
    int& along = move[static_cast<std::size_t>(axis)];
    along = along == 0 || other == 0 ? 0 : std::max(along, other);  // 1 or 2
  }
};

int period_of(Wrap wrap) { return wrap == Wrap::kRepeat ? 1 : wrap == Wrap::kMirror ? 2 : 0; }

Period period_of(const Material& material, int set) {
  Period period;
  bool used = false;
  for_each_texture(material, [&](const TextureRef& t) {
    if (!t.used() || t.texcoord != set) return;
    used = true;
    // A scale by whole numbers takes whole moves to whole moves.
    const Vec2f s = t.transform.scale;
    const bool whole = t.transform.rotation == 0 && s.x == std::floor(s.x) && s.y == std::floor(s.y);
    period.restrict_by(0, whole ? period_of(t.wrap_s) : 0);
    period.restrict_by(1, whole ? period_of(t.wrap_t) : 0);
  });
  // No texture uses these coordinates: only the application that they are for knows what they mean.
  if (!used) period.move = {0, 0};
  return period;
}

/// Per wedge the lowest wedge of its chart.
std::vector<std::uint32_t> charts_of(const Mesh& mesh) {
  std::vector<std::uint32_t> chart(mesh.wedge_count());
  std::iota(chart.begin(), chart.end(), 0u);
  const auto root = [&chart](std::uint32_t w) {
    while (chart[w] != w) w = chart[w] = chart[chart[w]];
    return w;
  };
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 1; k < 3; ++k) {
      const std::uint32_t a = root(t[0]), b = root(t[k]);
      chart[std::max(a, b)] = std::min(a, b);
    }
  for (std::uint32_t w = 0; w < chart.size(); ++w) chart[w] = root(w);
  return chart;
}

void bring_near(const Model& model, const std::vector<std::uint32_t>& chart, int set,
                std::vector<Vec2f>& uvs) {
  constexpr float kFar = 2;
  const auto is_far = [](Vec2f uv) { return !(std::fabs(uv.x) < kFar && std::fabs(uv.y) < kFar); };
  if (std::none_of(uvs.begin(), uvs.end(), is_far)) return;
  const Mesh& mesh = model.mesh;
  std::vector<Period> period_of_material, period(uvs.size());
  for (const Material& m : model.materials) period_of_material.push_back(period_of(m, set));
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Period& p = period_of_material[mesh.triangle_material[t]];
    for (int axis = 0; axis < 2; ++axis)
      period[chart[mesh.triangles[t][0]]].restrict_by(axis, p.move[static_cast<std::size_t>(axis)]);
  }
  constexpr float kMost = std::numeric_limits<float>::max();
  std::vector<Vec2f> lowest(uvs.size(), {kMost, kMost}), highest(uvs.size(), {-kMost, -kMost});
  for (std::size_t w = 0; w < uvs.size(); ++w) {
    Vec2f &lo = lowest[chart[w]], &hi = highest[chart[w]];
    lo = {std::min(lo.x, uvs[w].x), std::min(lo.y, uvs[w].y)};
    hi = {std::max(hi.x, uvs[w].x), std::max(hi.y, uvs[w].y)};
  }
  const auto move = [](float lo, float hi, int repeats) {
    if (repeats == 0) return 0.0f;
    const float whole = std::floor(lo / static_cast<float>(repeats)) * static_cast<float>(repeats);
    const bool nearer = hi - whole < std::max(std::fabs(lo), std::fabs(hi));
    return std::fabs(whole) >= kFar && nearer ? whole : 0.0f;
  };
  for (std::size_t w = 0; w < uvs.size(); ++w) {
    const std::array<int, 2>& p = period[chart[w]].move;
    const Vec2f lo = lowest[chart[w]], hi = highest[chart[w]];
    uvs[w] = {uvs[w].x - move(lo.x, hi.x, p[0]), uvs[w].y - move(lo.y, hi.y, p[1])};
  }
}

}  // namespace

void bring_uvs_near(Model& model) {
  if (model.mesh.uv0.empty() && model.mesh.uv1.empty()) return;
  const std::vector<std::uint32_t> chart = charts_of(model.mesh);
  bring_near(model, chart, 0, model.mesh.uv0);
  bring_near(model, chart, 1, model.mesh.uv1);
}

}  // namespace texmesh
