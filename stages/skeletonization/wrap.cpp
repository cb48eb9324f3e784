// What is wrapped of a mesh: its triangles, clustered where there are many, with fans over holes. Behind the
// alpha wrap and its decimation stand its connected parts.
#include "stages/skeletonization/wrap.h"

#include <meshoptimizer.h>

#include "format/base/numbering.h"
#include "stages/geometry/mesh_topology.h"

namespace texmesh {
namespace {

constexpr std::size_t kMaxSoup = 100000;
constexpr double kMaxCap = 0.25;  // area of a fan that closes a hole, of its component's area

/// Points and triangles that are still being gathered.
struct Gathered {
  std::vector<Vec3d> points;
  std::vector<std::uint32_t> indices;
};

double twice_area(const Gathered& g, std::size_t i) {
  const Vec3d a = g.points[g.indices[i]];
  return length(cross(g.points[g.indices[i + 1]] - a, g.points[g.indices[i + 2]] - a));
}

/// Per position: the next one along the border that leaves it, kNoIndex inside. A conditioned position has
/// one fan of triangles, so at most one border edge leaves it.
std::vector<std::uint32_t> border_of(const Mesh& mesh) {
  std::vector<std::pair<std::uint64_t, std::uint64_t>> edges;  // undirected key, directed key
  edges.reserve(3 * mesh.triangles.size());
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) {
      const std::uint64_t a = mesh.position_of(t, k), b = mesh.position_of(t, (k + 1) % 3);
      edges.emplace_back(std::min(a, b) << 32 | std::max(a, b), a << 32 | b);
    }
  std::sort(edges.begin(), edges.end());
  std::vector<std::uint32_t> next(mesh.positions.size(), kNoIndex);
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const bool alone = (i == 0 || edges[i - 1].first != edges[i].first) &&
                       (i + 1 == edges.size() || edges[i + 1].first != edges[i].first);
    // The hole's loop runs against the triangle's edge.
    if (alone) next[edges[i].second & 0xffffffffu] = static_cast<std::uint32_t>(edges[i].second >> 32);
  }
  return next;
}

void close_hole(const std::vector<std::uint32_t>& loop, double component_area, Gathered& g) {
  Vec3d middle;
  for (std::uint32_t p : loop) middle = middle + g.points[p];
  middle = middle * (1 / static_cast<double>(loop.size()));
  double area = 0;
  for (std::size_t i = 0; i < loop.size(); ++i)
    area +=
        length(cross(g.points[loop[(i + 1) % loop.size()]] - g.points[loop[i]], middle - g.points[loop[i]]));
  if (!(area < kMaxCap * component_area)) return;
  const auto tip = static_cast<std::uint32_t>(g.points.size());
  g.points.push_back(middle);
  for (std::size_t i = 0; i < loop.size(); ++i)
    g.indices.insert(g.indices.end(), {loop[i], loop[(i + 1) % loop.size()], tip});
}

void close_holes(const ConditionedMesh& mesh, Gathered& g) {
  std::vector<std::uint32_t> next = border_of(mesh.mesh);
  std::vector<double> area(mesh.component_count, 0);
  for (std::size_t i = 0; i + 2 < g.indices.size(); i += 3)
    area[mesh.component[g.indices[i]]] += twice_area(g, i);
  for (std::uint32_t start = 0; start < next.size(); ++start) {
    std::vector<std::uint32_t> loop;
    for (std::uint32_t p = start; next[p] != kNoIndex;) {
      loop.push_back(p);
      p = std::exchange(next[p], kNoIndex);
    }
    if (loop.size() > 2) close_hole(loop, area[mesh.component[start]], g);
  }
}

/// Clustering may leave nothing of a soup of crumbs; then all of it is wrapped.
void thin_out(Gathered& g) {
  if (g.indices.size() <= kMaxSoup * 3) return;
  std::vector<float> points;
  points.reserve(3 * g.points.size());
  for (const Vec3d& p : g.points)
    for (int k = 0; k < 3; ++k) points.push_back(static_cast<float>(p[k]));
  std::vector<std::uint32_t> fewer(g.indices.size());
  fewer.resize(meshopt_simplifySloppy(fewer.data(), g.indices.data(), g.indices.size(), points.data(),
                                      g.points.size(), 3 * sizeof(float), kMaxSoup * 3, 1.0f, nullptr));
  if (!fewer.empty()) g.indices = std::move(fewer);
}

/// Points that no triangle uses are left out: the wrap's search tree would take them in.
TriangleSoup used_part(const Gathered& g) {
  TriangleSoup soup;
  std::vector<std::uint32_t> number(g.points.size(), kNoIndex);
  for (std::size_t i = 0; i + 2 < g.indices.size(); i += 3) {
    if (!(twice_area(g, i) > 0)) continue;
    Triangle t{};
    for (std::size_t k = 0; k < 3; ++k)
      t[k] = numbered(number[g.indices[i + k]], soup.points, g.points[g.indices[i + k]]);
    soup.triangles.push_back(t);
  }
  return soup;
}

/// Parts in the order of their first triangles, triangles in the order of the whole.
std::vector<TriangleSoup> split_parts(const TriangleSoup& wrap) {
  DisjointSets sets(wrap.points.size());
  for (const Triangle& t : wrap.triangles) sets.join(t[0], t[1]), sets.join(t[0], t[2]);
  std::vector<TriangleSoup> parts;
  std::vector<std::uint32_t> part(wrap.points.size(), kNoIndex), number(wrap.points.size(), kNoIndex);
  for (const Triangle& t : wrap.triangles) {
    TriangleSoup& to = parts[numbered(part[sets.find(t[0])], parts, {})];
    Triangle& triangle = to.triangles.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) triangle[k] = numbered(number[t[k]], to.points, wrap.points[t[k]]);
  }
  return parts;
}

}  // namespace

UnitFrame unit_frame_of(const std::vector<Vec3f>& positions) {
  const Box3d box = to_double(bounding_box(positions));
  return {box.centre(), box.diagonal()};
}

TriangleSoup make_wrap_soup(const ConditionedMesh& mesh, const UnitFrame& frame) {
  Gathered g;
  // Float, as clustering has it: the wrap does not depend on whether there was something to cluster.
  for (Vec3f p : mesh.mesh.positions) g.points.push_back(to_double(to_float(frame.to_unit(p))));
  for (std::uint32_t t = 0; t < mesh.mesh.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) g.indices.push_back(mesh.mesh.position_of(t, k));
  close_holes(mesh, g);
  thin_out(g);
  TriangleSoup soup = used_part(g);
  if (soup.triangles.empty()) throw GeometryFailure("no triangle has an area");
  return soup;
}

bool is_closed_surface(const TriangleSoup& soup, double longest) {
  DisjointSets sets(soup.points.size());
  std::vector<std::uint64_t> there, back;  // along each edge
  double volume = 0;
  for (const Triangle& t : soup.triangles) {
    volume += dot(soup.points[t[0]], cross(soup.points[t[1]], soup.points[t[2]]));
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t a = t[k], b = t[(k + 1) % 3];
      if (!(length(soup.points[a] - soup.points[b]) <= longest)) return false;
      sets.join(t[0], t[k]);
      there.push_back(a << 32 | b);
      back.push_back(b << 32 | a);
    }
  }
  std::sort(there.begin(), there.end());
  std::sort(back.begin(), back.end());
  if (there != back || std::ranges::adjacent_find(there) != there.end() || !(volume > 0)) return false;
  for (std::uint32_t p = 0; p < soup.points.size(); ++p)
    if (sets.find(p) != sets.find(0)) return false;
  return true;
}

std::vector<TriangleSoup> wrap_surface(const TriangleSoup& soup, double alpha, double offset,
                                       std::size_t max_faces, std::size_t max_steps,
                                       const RunContext& context) {
  return split_parts(decimate(alpha_wrap(soup, alpha, offset, max_steps, context), max_faces));
}

}  // namespace texmesh
