#include "stages/skeletonization/shape_thickness.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "format/base/portable_math.h"
#include "stages/base/parallel.h"

namespace texmesh {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kFilterPasses = 2;

/// Rays of the cone in the frame (tangent, other tangent, inwards): one along the normal and two rings. A
/// narrow cone (0.5 rad) follows walls that run a little apart; the usual 120 degrees are meant for
/// segmentation, not for measuring.
struct ConeRay {
  Vec3d direction;
  double cosine;
};
std::array<ConeRay, TriangleTree::kRays> cone() {
  std::array<ConeRay, TriangleTree::kRays> rays{};
  rays[0] = {{0, 0, 1}, 1};
  std::size_t next = 1;
  for (const auto& [angle, count] : {std::pair{0.25, 5}, std::pair{0.5, 10}})
    for (int i = 0; i < count; ++i) {
      const double around = 2 * portable::kPi * (i + 0.5) / count, s = portable::sin(angle);
      const double c = portable::cos(angle);
      rays[next++] = {{s * portable::cos(around), s * portable::sin(around), c}, c};
    }
  return rays;
}

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double measure(const TriangleTree& tree, const std::array<ConeRay, TriangleTree::kRays>& rays, Vec3d centre,
               Vec3d normal) {
  const Vec3d inwards = normal * -1.0;
  const Vec3d side = normalized(cross(inwards, std::fabs(inwards.y) < 0.9 ? Vec3d{0, 1, 0} : Vec3d{1, 0, 0}));
  const Vec3d other = cross(inwards, side);
  TriangleTree::Rays directions;
  for (std::size_t r = 0; r < rays.size(); ++r) {
    const Vec3d& d = rays[r].direction;
    directions[r] = side * d.x + other * d.y + inwards * d.z;
  }
  const auto exits = tree.exits(centre, directions);
  std::vector<double> lengths;
  for (std::size_t r = 0; r < rays.size(); ++r)
    if (exits[r] < kInfinity) lengths.push_back(exits[r] * rays[r].cosine);
  return lengths.empty() ? kInfinity : median(lengths) / 2;
}

/// For each point the triangles around it.
struct Fans {
  std::vector<std::uint32_t> begin, triangles;
  explicit Fans(const TriangleSoup& soup) : begin(soup.points.size() + 1, 0) {
    for (const Triangle& t : soup.triangles)
      for (std::uint32_t p : t) ++begin[p + 1];
    for (std::size_t p = 0; p < soup.points.size(); ++p) begin[p + 1] += begin[p];
    triangles.resize(begin.back());
    std::vector<std::uint32_t> at(begin.begin(), begin.end() - 1);
    for (std::uint32_t t = 0; t < soup.triangles.size(); ++t)
      for (std::uint32_t p : soup.triangles[t]) triangles[at[p]++] = t;
  }
};

std::vector<double> filtered(const TriangleSoup& soup, const Fans& fans, const std::vector<double>& value) {
  std::vector<double> out(value.size()), near;
  for (std::size_t t = 0; t < value.size(); ++t) {
    near.clear();
    for (std::uint32_t p : soup.triangles[t])
      for (std::uint32_t i = fans.begin[p]; i < fans.begin[p + 1]; ++i)
        near.push_back(value[fans.triangles[i]]);
    out[t] = median(near);
  }
  return out;
}

}  // namespace

std::vector<double> half_thickness(const TriangleSoup& closed, const TriangleTree& tree,
                                   const RunContext& context) {
  const std::array<ConeRay, TriangleTree::kRays> rays = cone();
  std::vector<double> face(closed.triangles.size()), area(face.size());
  parallel_for(context, face.size(), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const auto [a, b, c] = closed.triangles[t];
      const Vec3d p = closed.points[a], q = closed.points[b], r = closed.points[c];
      const Vec3d n = cross(q - p, r - p);
      area[t] = length(n);
      face[t] = area[t] > 0 ? measure(tree, rays, (p + q + r) * (1.0 / 3), normalized(n)) : kInfinity;
    }
  });
  const Fans fans(closed);
  for (int pass = 0; pass < kFilterPasses; ++pass) face = filtered(closed, fans, face);
  std::vector<double> point(closed.points.size(), kInfinity);
  for (std::size_t p = 0; p < point.size(); ++p) {
    double sum = 0, weight = 0;
    for (std::uint32_t i = fans.begin[p]; i < fans.begin[p + 1]; ++i) {
      const std::uint32_t t = fans.triangles[i];
      if (face[t] == kInfinity) continue;
      sum += face[t] * area[t], weight += area[t];
    }
    if (weight > 0) point[p] = sum / weight;
  }
  return point;
}

}  // namespace texmesh
