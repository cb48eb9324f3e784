#include "tests/support/hostile_meshes.h"

#include <array>
#include <map>

#include <utility>

namespace texmesh::testing {

Mesh bare_mesh(std::vector<Vec3f> positions, std::vector<Triangle> triangles) {
  Mesh m;
  m.positions = std::move(positions);
  for (std::uint32_t p = 0; p < m.positions.size(); ++p) m.wedge_position.push_back(p);
  m.triangles = std::move(triangles);
  m.triangle_material.assign(m.triangles.size(), 0);
  m.triangle_part.assign(m.triangles.size(), 0);
  m.part_names = {"part"};
  return m;
}

Mesh random_soup(Random& random, std::uint32_t points, std::uint32_t triangles, std::uint32_t grid) {
  const auto coordinate = [&] {
    return grid > 0 ? static_cast<float>(random.next() % grid) : static_cast<float>(random.uniform());
  };
  std::vector<Vec3f> positions;
  for (std::uint32_t p = 0; p < points; ++p) positions.push_back({coordinate(), coordinate(), coordinate()});
  std::vector<Triangle> corners;
  for (std::uint32_t t = 0; t < triangles; ++t)
    corners.push_back({random.next() % points, random.next() % points, random.next() % points});
  return bare_mesh(std::move(positions), std::move(corners));
}

Mesh sliver_sheet(int n) {
  Mesh m = sheet(n, 0.1f);
  for (Vec3f& p : m.positions)
    if (p.y < 0.45f) p.y *= 1e-12f, p.z = 0;
  return m;
}

Mesh dust(int count, float side) {
  Random random{3};
  std::vector<Vec3f> points;
  std::vector<Triangle> triangles;
  for (int i = 0; i < count; ++i) {
    auto place = [&] { return static_cast<float>(random.uniform()); };
    const Vec3f at{place(), place(), place()};
    const float s = i == 0 ? 4 * side : side * (0.5f + 0.5f * place());
    const auto first = static_cast<std::uint32_t>(points.size());
    for (Vec3f corner : {Vec3f{0, 0, 0}, Vec3f{1, place(), 0}, Vec3f{place(), 1, 1}})
      points.push_back(at + corner * s);
    triangles.push_back({first, first + 1, first + 2});
  }
  return bare_mesh(std::move(points), std::move(triangles));
}

Mesh sieve(int n) {
  const auto solid = [n](std::array<int, 3> at) {
    return at[0] >= 0 && at[0] < n && at[1] >= 0 && at[1] < n && at[2] == 0 && !(at[0] % 2 && at[1] % 2);
  };
  std::vector<Vec3f> points;
  std::vector<Triangle> triangles;
  std::map<std::array<int, 3>, std::uint32_t> numbers;
  const auto number = [&](std::array<int, 3> at) {
    const auto [it, fresh] = numbers.try_emplace(at, static_cast<std::uint32_t>(points.size()));
    if (fresh)
      points.push_back({static_cast<float>(at[0]), static_cast<float>(at[1]), static_cast<float>(at[2])});
    return it->second;
  };
  for (int cell = 0; cell < n * n; ++cell) {
    const std::array<int, 3> at{cell % n, cell / n, 0};
    if (!solid(at)) continue;
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (const int side : {0, 1}) {
        std::array<int, 3> beyond = at;
        beyond[axis] += side ? 1 : -1;
        if (solid(beyond)) continue;
        std::array<std::uint32_t, 4> corner;
        for (std::size_t k = 0; k < 4; ++k) {
          std::array<int, 3> p = at;
          p[axis] += side;
          p[(axis + 1) % 3] += k == 1 || k == 2;
          p[(axis + 2) % 3] += k >= 2;
          corner[side ? k : 3 - k] = number(p);
        }
        triangles.push_back({corner[0], corner[1], corner[2]});
        triangles.push_back({corner[0], corner[2], corner[3]});
      }
  }
  return bare_mesh(std::move(points), std::move(triangles));
}

void repeat_triangles(Mesh& m) {
  const std::size_t n = m.triangles.size();
  for (std::size_t t = 0; t < n; ++t) {
    m.triangles.push_back(m.triangles[t]);
    m.triangle_material.push_back(m.triangle_material[t]);
    m.triangle_part.push_back(m.triangle_part[t]);
  }
}

Mesh inside_out(Mesh m) {
  for (Triangle& t : m.triangles) std::swap(t[1], t[2]);
  return m;
}

}  // namespace texmesh::testing
