#include "format/split/split_fill.h"
#include "format/base/no_index.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace texmesh {
namespace {

/// A neighbour in the chart of the point: texture coordinates relative to the point's, and its place.
struct Neighbour {
  std::uint32_t point;
  double u, v;
};

/// The point's neighbours over the corners that have this wedge, each once.
std::vector<Neighbour> neighbours_in_chart(const SplitMesh& mesh, std::size_t k, std::uint32_t point,
                                           std::uint32_t wedge) {
  const std::vector<std::int32_t>& uv = mesh.values(k);
  std::vector<Neighbour> out;
  mesh.each_corner(point, [&](std::uint32_t face, std::uint32_t corner) {
    if (mesh.wedge_at(face, corner) != wedge) return;
    for (std::uint32_t i = 1; i <= 2; ++i) {
      const std::uint32_t w = mesh.wedge_at(face, corner + i), p = mesh.point_at(face, corner + i);
      if (std::ranges::find(out, p, &Neighbour::point) != out.end()) continue;
      out.push_back({p, static_cast<double>(uv[2 * w]) - uv[2 * wedge],
                     static_cast<double>(uv[2 * w + 1]) - uv[2 * wedge + 1]});
    }
  });
  return out;
}

/// The wedge that most corners of the point have (ties: the first met).
std::uint32_t main_wedge(const SplitMesh& mesh, std::uint32_t point) {
  std::vector<std::pair<std::uint32_t, int>> counts;
  mesh.each_corner(point, [&](std::uint32_t face, std::uint32_t corner) {
    const std::uint32_t w = mesh.wedge_at(face, corner);
    const auto it = std::ranges::find(counts, w, [](const auto& c) { return c.first; });
    if (it == counts.end())
      counts.emplace_back(w, 1);
    else
      ++it->second;
  });
  if (counts.empty()) return kNoIndex;
  return std::ranges::max_element(counts, {}, [](const auto& c) { return c.second; })->first;
}

}  // namespace

void fill_lost_point(const SplitStreamHead& head, SplitMesh& mesh, std::uint32_t point) {
  std::size_t k = 0;
  while (k < head.attributes.size() && head.attributes[k].kind != SplitKind::kUv0) ++k;
  const std::uint32_t wedge = main_wedge(mesh, point);
  if (k == head.attributes.size() || wedge == kNoIndex) return;
  const std::vector<Neighbour> ring = neighbours_in_chart(mesh, k, point, wedge);
  if (ring.size() < 3) return;
  // Least squares of place = c + a u + b v with weights 1 / distance^2: c is the place at the point. The
  // normal equations are solved for c alone, by Cramer's rule.
  double w0 = 0, wu = 0, wv = 0, wuu = 0, wuv = 0, wvv = 0;
  std::array<double, 3> p0{}, pu{}, pv{};
  for (const Neighbour& n : ring) {
    const double w = 1 / (n.u * n.u + n.v * n.v + 1);
    w0 += w, wu += w * n.u, wv += w * n.v;
    wuu += w * n.u * n.u, wuv += w * n.u * n.v, wvv += w * n.v * n.v;
    for (std::size_t i = 0; i < 3; ++i) {
      const double x = mesh.points()[n.point][i];
      p0[i] += w * x, pu[i] += w * n.u * x, pv[i] += w * n.v * x;
    }
  }
  const double a = wuu * wvv - wuv * wuv, b = wuv * wv - wu * wvv, c = wu * wuv - wuu * wv;
  const double determinant = w0 * a + wu * b + wv * c;
  // Coordinates that lie on a line, or on one side of the point only, would be extrapolated.
  if (!(determinant > 1e-3 * w0 * wuu * wvv)) return;
  const std::int32_t largest = (1 << head.position.bits) - 1;
  SplitMesh::Point place{};
  for (std::size_t i = 0; i < 3; ++i) {
    const double x = (p0[i] * a + pu[i] * b + pv[i] * c) / determinant;
    double low = 1e300, high = -1e300;
    for (const Neighbour& n : ring) {
      low = std::min<double>(low, mesh.points()[n.point][i]);
      high = std::max<double>(high, mesh.points()[n.point][i]);
    }
    place[i] = std::clamp(static_cast<std::int32_t>(std::floor(std::clamp(x, low, high) + 0.5)), 0, largest);
  }
  mesh.point(point) = place;
}

}  // namespace texmesh
