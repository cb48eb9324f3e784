#include "stages/scales/rounded_mesh.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace texmesh {
namespace {

std::int32_t place(const QuantisationGrid& grid, float x, int axis) {
  const auto largest = (std::uint32_t{1} << grid.bits) - 1;
  return static_cast<std::int32_t>(std::min(grid.index(x, axis), largest));
}

}  // namespace

RoundedMesh::RoundedMesh(const NestedScales& scales, const VertexSplitCoding& coding)
    : mesh_(scales.mesh), coding_(coding), point_(scales.mesh.positions.size()) {
  for (std::size_t p = 0; p < point_.size(); ++p) {
    const std::uint32_t twin = scales.twin.empty() ? static_cast<std::uint32_t>(p) : scales.twin[p];
    point_[p] = twin == p ? static_cast<std::uint32_t>(places_.size()) : point_[twin];
    if (twin != p) continue;
    const Vec3f at = mesh_.positions[p];
    places_.push_back(
        {place(coding.position, at.x, 0), place(coding.position, at.y, 1), place(coding.position, at.z, 2)});
  }
  add_attributes();
  std::vector<std::vector<std::int32_t>> all(attributes_.size());
  for (std::size_t w = 0; w < mesh_.wedge_count(); ++w)
    for (std::size_t k = 0; k < attributes_.size(); ++k) append_value(attributes_[k], w, all[k]);
  merge_wedges(all);
}

std::uint32_t RoundedMesh::add_wedge(std::uint32_t wedge, std::uint32_t point) {
  wedge_point_.push_back(point);
  for (std::size_t k = 0; k < values_.size(); ++k) {
    const auto n = static_cast<std::size_t>(split_components(attributes_[k].kind));
    for (std::size_t i = 0; i < n; ++i) values_[k].push_back(values_[k][wedge * n + i]);
  }
  return static_cast<std::uint32_t>(wedge_point_.size() - 1);
}

void RoundedMesh::move_to(SplitSource& source) {
  const QuantisationGrid& g = coding_.position;
  source.position = {g.bits, {g.origin.x, g.origin.y, g.origin.z}, g.range};
  source.attributes = std::move(attributes_);
  source.points = std::move(places_);
  source.wedge_point = std::move(wedge_point_);
  source.values = std::move(values_);
}

void RoundedMesh::add_attributes() {
  auto grid = [](const QuantisationGrid& g) {
    return SplitGrid{g.bits, {g.origin.x, g.origin.y, 0}, g.range};
  };
  if (coding_.uv[0].bits > 0) attributes_.push_back({SplitKind::kUv0, grid(coding_.uv[0])});
  if (coding_.uv[1].bits > 0) attributes_.push_back({SplitKind::kUv1, grid(coding_.uv[1])});
  if (!mesh_.normals.empty()) attributes_.push_back({SplitKind::kNormal, {coding_.normal_bits, {}, 1}});
  if (coding_.colour_bits > 0) attributes_.push_back({SplitKind::kColour, {coding_.colour_bits, {}, 1}});
}

void RoundedMesh::append_value(const SplitAttribute& a, std::size_t w, std::vector<std::int32_t>& out) const {
  if (a.kind == SplitKind::kNormal) {
    const Vec3f n = mesh_.normals[w];
    const auto code = octahedral_code({n.x, n.y, n.z}, a.grid.bits);
    out.insert(out.end(), code.begin(), code.end());
  } else if (a.kind == SplitKind::kColour) {
    const float one = static_cast<float>((1 << a.grid.bits) - 1);
    const Vec4f c = mesh_.colours[w];
    for (float x : {c.x, c.y, c.z, c.w})
      out.push_back(static_cast<std::int32_t>(std::floor(std::clamp(x, 0.0f, 1.0f) * one + 0.5f)));
  } else {
    const int set = a.kind == SplitKind::kUv1 ? 1 : 0;
    const Vec2f uv = set == 1 ? mesh_.uv1[w] : mesh_.uv0[w];
    out.push_back(place(coding_.uv[set], uv.x, 0));
    out.push_back(place(coding_.uv[set], uv.y, 1));
  }
}

/// The wedges of each point together, rising. `end`: per point, where its wedges end.
std::vector<std::uint32_t> RoundedMesh::by_points(std::vector<std::uint32_t>& end) const {
  end.assign(places_.size() + 1, 0);
  const auto point_of = [&](std::uint32_t w) { return point_[mesh_.wedge_position[w]]; };
  const auto n = static_cast<std::uint32_t>(mesh_.wedge_count());
  for (std::uint32_t w = 0; w < n; ++w) ++end[point_of(w) + 1];
  std::partial_sum(end.begin(), end.end(), end.begin());
  std::vector<std::uint32_t> order(n);
  for (std::uint32_t w = 0; w < n; ++w) order[end[point_of(w)]++] = w;
  return order;
}

void RoundedMesh::merge_wedges(const std::vector<std::vector<std::int32_t>>& all) {
  const std::size_t n = mesh_.wedge_count();
  const auto compare = [&](std::uint32_t a, std::uint32_t b) {
    for (std::size_t k = 0; k < attributes_.size(); ++k) {
      const auto c = static_cast<std::size_t>(split_components(attributes_[k].kind));
      for (std::size_t i = 0; i < c; ++i)
        if (all[k][a * c + i] != all[k][b * c + i]) return all[k][a * c + i] < all[k][b * c + i] ? -1 : 1;
    }
    return 0;
  };
  std::vector<std::uint32_t> end;  // by point
  std::vector<std::uint32_t> order = by_points(end);
  std::vector<std::uint32_t> same(n);  // the lowest equal wedge
  for (std::size_t p = 0, i = 0; p < places_.size(); ++p) {
    const auto at = [&](std::size_t k) { return order.begin() + static_cast<std::ptrdiff_t>(k); };
    std::sort(at(i), at(end[p]), [&](std::uint32_t a, std::uint32_t b) {
      const int c = compare(a, b);
      return c < 0 || (c == 0 && a < b);
    });
    for (const std::size_t begin = i; i < end[p]; ++i)
      same[order[i]] = i > begin && compare(order[i - 1], order[i]) == 0 ? same[order[i - 1]] : order[i];
  }
  wedge_.resize(n);
  values_.resize(attributes_.size());
  for (std::uint32_t w = 0; w < n; ++w) {
    if (same[w] != w) {
      wedge_[w] = wedge_[same[w]];
      continue;
    }
    wedge_[w] = static_cast<std::uint32_t>(wedge_point_.size());
    wedge_point_.push_back(point_[mesh_.wedge_position[w]]);
    for (std::size_t k = 0; k < attributes_.size(); ++k) {
      const auto c = static_cast<std::size_t>(split_components(attributes_[k].kind));
      for (std::size_t i = 0; i < c; ++i) values_[k].push_back(all[k][w * c + i]);
    }
  }
}

}  // namespace texmesh
