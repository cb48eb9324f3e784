#include "tests/support/meshes.h"

#include "format/base/portable_math.h"

namespace texmesh::testing {
namespace {

std::uint32_t add_wedge(Mesh& m, std::uint32_t position, Vec2f uv) {
  m.wedge_position.push_back(position);
  m.uv0.push_back(uv);
  return static_cast<std::uint32_t>(m.wedge_position.size() - 1);
}

void finish(Mesh& m) {
  m.triangle_material.assign(m.triangles.size(), 0);
  m.triangle_part.assign(m.triangles.size(), 0);
  m.part_names = {"part"};
}

Mesh radial(int rings, int segments, float amplitude) {
  Mesh m;
  auto radius = [&](double theta, double phi) {
    return 1.0 + amplitude * (portable::sin(5 * theta + 1) * portable::sin(4 * phi) +
                              0.5 * portable::sin(9 * phi + 2) * portable::sin(7 * theta));
  };
  auto point = [&](int ring, int segment) {
    const double phi = portable::kPi * ring / rings, theta = 2 * portable::kPi * segment / segments;
    const double r = ring == 0 || ring == rings ? 1.0 : radius(theta, phi);
    return to_float(Vec3d{r * portable::sin(phi) * portable::cos(theta), r * portable::cos(phi),
                          r * portable::sin(phi) * portable::sin(theta)});
  };
  m.positions.push_back(point(0, 0));
  for (int i = 1; i < rings; ++i)
    for (int j = 0; j < segments; ++j) m.positions.push_back(point(i, j));
  m.positions.push_back(point(rings, 0));
  const auto last = static_cast<std::uint32_t>(m.positions.size() - 1);
  auto position = [&](int ring, int segment) -> std::uint32_t {
    if (ring == 0) return 0;
    if (ring == rings) return last;
    return static_cast<std::uint32_t>(1 + (ring - 1) * segments + segment % segments);
  };
  std::vector<std::uint32_t> wedge(static_cast<std::size_t>(rings + 1) * (segments + 1));
  for (int i = 0; i <= rings; ++i)
    for (int j = 0; j <= segments; ++j)
      wedge[static_cast<std::size_t>(i) * (segments + 1) + j] =
          add_wedge(m, position(i, j), {static_cast<float>(j) / segments, static_cast<float>(i) / rings});
  auto w = [&](int i, int j) { return wedge[static_cast<std::size_t>(i) * (segments + 1) + j]; };
  for (int i = 0; i < rings; ++i)
    for (int j = 0; j < segments; ++j) {
      if (i != rings - 1) m.triangles.push_back({w(i, j), w(i + 1, j + 1), w(i + 1, j)});
      if (i != 0) m.triangles.push_back({w(i, j), w(i, j + 1), w(i + 1, j + 1)});
    }
  for (std::uint32_t p : m.wedge_position) m.normals.push_back(normalized(m.positions[p]));
  finish(m);
  return m;
}

}  // namespace

Mesh cube() {
  Mesh m;
  for (int i = 0; i < 8; ++i)
    m.positions.push_back({i & 1 ? 1.f : -1.f, i & 2 ? 1.f : -1.f, i & 4 ? 1.f : -1.f});
  static constexpr std::uint32_t kFaces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                                 {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (int f = 0; f < 6; ++f) {
    const float u = static_cast<float>(f % 3) / 3, v = static_cast<float>(f / 3) / 2, s = 0.3f, t = 0.45f;
    const Vec2f corner[4] = {{u, v}, {u + s, v}, {u + s, v + t}, {u, v + t}};
    std::uint32_t w[4];
    for (int k = 0; k < 4; ++k) w[k] = add_wedge(m, kFaces[f][k], corner[k]);
    m.triangles.push_back({w[0], w[1], w[2]});
    m.triangles.push_back({w[0], w[2], w[3]});
  }
  finish(m);
  return m;
}

Mesh sphere(int rings, int segments) { return radial(rings, segments, 0); }
Mesh bumpy_sphere(int rings, int segments, float amplitude) { return radial(rings, segments, amplitude); }

Mesh sheet(int n, float amplitude) {
  Mesh m;
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i) {
      const double x = static_cast<double>(i) / n, y = static_cast<double>(j) / n;
      m.positions.push_back(to_float(Vec3d{x, y, amplitude * portable::sin(9 * x) * portable::cos(7 * y)}));
      add_wedge(m, static_cast<std::uint32_t>(j * (n + 1) + i),
                {static_cast<float>(x), static_cast<float>(1 - y)});
    }
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const auto a = static_cast<std::uint32_t>(j * (n + 1) + i), b = a + 1,
                 c = a + static_cast<std::uint32_t>(n) + 1, d = c + 1;
      m.triangles.push_back({a, b, d});
      m.triangles.push_back({a, d, c});
    }
  finish(m);
  return m;
}

Mesh side_by_side(const std::vector<Mesh>& meshes, float gap) {
  Mesh out;
  float at = 0;
  for (const Mesh& m : meshes) {
    float lo = m.positions[0].x, hi = lo;
    for (Vec3f p : m.positions) {
      lo = p.x < lo ? p.x : lo;
      hi = p.x > hi ? p.x : hi;
    }
    const auto positions = static_cast<std::uint32_t>(out.positions.size());
    const auto wedges = static_cast<std::uint32_t>(out.wedge_position.size());
    for (Vec3f p : m.positions) out.positions.push_back({p.x - lo + at, p.y, p.z});
    for (std::size_t w = 0; w < m.wedge_count(); ++w) {
      out.wedge_position.push_back(m.wedge_position[w] + positions);
      out.uv0.push_back(m.uv0[w]);
    }
    for (Triangle t : m.triangles) out.triangles.push_back({t[0] + wedges, t[1] + wedges, t[2] + wedges});
    at += hi - lo + gap;
  }
  finish(out);
  return out;
}

}  // namespace texmesh::testing
