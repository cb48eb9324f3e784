#include "format/model/tangents.h"

#include <map>
#include <numeric>

#include "format/base/portable_math.h"
#include "format/model/add_wedge.h"
#include "format/model/material_extensions.h"

namespace texmesh {
namespace {

/// A triangle's texture on its plane.
struct TexturePlane {
  Vec3d along;            // of growing u, unit; zero without an area of texture
  bool mirrored = false;  // v grows with cross(normal, along), where images have it the other way round
  bool any = false;       // without an area of texture: takes part in any group
};

/// Corners that share a tangent.
struct TangentGroup {
  std::uint32_t vertex = 0;
  bool mirrored = false;
  Vec3d sum;
};

constexpr Vec4f kAnyTangent{1, 0, 0, 1};
constexpr double kLeastFloat = std::numeric_limits<float>::min();

class TangentMaker {
 public:
  TangentMaker(const Mesh& mesh, const std::vector<Vec2f>& uv, std::vector<std::uint32_t> triangles)
      : mesh_(mesh), uv_(uv), triangles_(std::move(triangles)) {
    number_vertices();
    for (const std::uint32_t t : triangles_) planes_.push_back(plane_of(t));
    join_neighbours();
    group_corners();
  }
  /// Those of the triangles given that have their corners in three places.
  const std::vector<std::uint32_t>& triangles() const { return triangles_; }
  /// Per corner of these; kNoIndex where only triangles without an area of texture meet.
  const std::vector<std::uint32_t>& groups() const { return group_of_; }
  Vec4f tangent(std::uint32_t group) const {
    const Vec3f t = to_float(normalized(groups_[group].sum));
    if (t == Vec3f{}) return kAnyTangent;
    return {t.x, t.y, t.z, groups_[group].mirrored ? -1.0f : 1.0f};
  }

 private:
  void number_vertices();
  TexturePlane plane_of(std::uint32_t triangle) const;
  void join_neighbours();
  void group_corners();
  void spread(std::uint32_t group, std::uint32_t corner);
  bool take(std::uint32_t group, std::uint32_t triangle);
  std::uint32_t wedge(std::uint32_t corner) const {
    return mesh_.triangles[triangles_[corner / 3]][corner % 3];
  }
  std::uint32_t vertex(std::uint32_t corner) const { return vertex_[wedge(corner)]; }
  Vec3d point(std::uint32_t corner) const {
    return to_double(mesh_.positions[mesh_.wedge_position[wedge(corner)]]);
  }
  static std::uint32_t next(std::uint32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }
  static std::uint32_t previous(std::uint32_t corner) { return corner % 3 == 0 ? corner + 2 : corner - 1; }

  const Mesh& mesh_;
  const std::vector<Vec2f>& uv_;
  std::vector<std::uint32_t> triangles_;  // of the mesh; without those that have two corners in one place
  std::vector<std::uint32_t> vertex_;     // per wedge: one number for equal position, normal, coordinates
  std::vector<TexturePlane> planes_;      // per triangle
  std::vector<std::uint32_t> neighbour_;  // per corner: the triangle across the edge to the next corner
  std::vector<std::uint32_t> group_of_;   // per corner
  std::vector<TangentGroup> groups_;
};

void TangentMaker::number_vertices() {
  const auto values = [this](std::uint32_t w) {
    const Vec3f p = mesh_.positions[mesh_.wedge_position[w]], n = mesh_.normals[w];
    return std::array<float, 8>{p.x, p.y, p.z, n.x, n.y, n.z, uv_[w].x, uv_[w].y};
  };
  std::vector<std::uint32_t> order(mesh_.wedge_count());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    const auto x = values(a), y = values(b);
    return x != y ? x < y : a < b;
  });
  vertex_.resize(order.size());
  for (std::size_t i = 0; i < order.size(); ++i)
    vertex_[order[i]] = i > 0 && values(order[i]) == values(order[i - 1]) ? vertex_[order[i - 1]] : order[i];
  std::erase_if(triangles_, [&](std::uint32_t t) {
    const auto at = [&](std::size_t k) {
      return mesh_.positions[mesh_.wedge_position[mesh_.triangles[t][k]]];
    };
    return at(0) == at(1) || at(1) == at(2) || at(2) == at(0);
  });
}

TexturePlane TangentMaker::plane_of(std::uint32_t triangle) const {
  const Triangle& t = mesh_.triangles[triangle];
  const auto at = [&](std::size_t k) { return to_double(mesh_.positions[mesh_.wedge_position[t[k]]]); };
  const Vec2d first = to_double(uv_[t[0]]), u = to_double(uv_[t[1]]) - first,
              v = to_double(uv_[t[2]]) - first;
  const double area = cross(u, v);
  const Vec3d d1 = at(1) - at(0), d2 = at(2) - at(0);
  const Vec3d s = d1 * v.y - d2 * u.y, across = d2 * u.x - d1 * v.x;
  TexturePlane out;
  out.mirrored = area > 0;
  const double a = std::fabs(area);
  out.any = !(a > kLeastFloat && length(s) > a * kLeastFloat && length(across) > a * kLeastFloat);
  if (!out.any) out.along = normalized(s * (area > 0 ? 1.0 : -1.0));
  return out;
}

/// Of several triangles at an edge the first finds the first that runs along it the other way.
void TangentMaker::join_neighbours() {
  const auto corners = static_cast<std::uint32_t>(3 * triangles_.size());
  std::vector<std::array<std::uint32_t, 3>> edges;
  for (std::uint32_t c = 0; c < corners; ++c) {
    const std::uint32_t a = vertex(c), b = vertex(next(c));
    edges.push_back({std::min(a, b), std::max(a, b), c});
  }
  std::sort(edges.begin(), edges.end());
  neighbour_.assign(corners, kNoIndex);
  std::size_t waiting = 0;
  for (std::size_t i = 0; i < edges.size(); ++i) {
    if (i == 0 || edges[i][0] != edges[i - 1][0] || edges[i][1] != edges[i - 1][1]) waiting = i;
    const std::uint32_t c = edges[i][2];
    while (waiting < i && neighbour_[edges[waiting][2]] != kNoIndex) ++waiting;
    const std::uint32_t other = edges[waiting][2];
    if (waiting == i || vertex(other) == vertex(c)) continue;
    neighbour_[c] = other / 3;
    neighbour_[other] = c / 3;
  }
}

/// False where the triangle is no member and does not become one.
bool TangentMaker::take(std::uint32_t group, std::uint32_t triangle) {
  const TangentGroup& g = groups_[group];
  std::uint32_t corner = 3 * triangle;
  while (corner < 3 * triangle + 2 && vertex(corner) != g.vertex) ++corner;
  if (group_of_[corner] != kNoIndex) return false;
  TexturePlane& plane = planes_[triangle];
  const auto free = [&](std::uint32_t k) { return group_of_[3 * triangle + k] == kNoIndex; };
  if (plane.any && free(0) && free(1) && free(2)) plane.mirrored = g.mirrored;
  if (plane.mirrored != g.mirrored) return false;
  group_of_[corner] = group;
  return true;
}

/// Triangles that are joined by edges at the corner's vertex, depth first.
void TangentMaker::spread(std::uint32_t group, std::uint32_t corner) {
  std::vector<std::uint32_t> next_triangles{corner / 3};
  while (!next_triangles.empty()) {
    const std::uint32_t triangle = next_triangles.back();
    next_triangles.pop_back();
    if (triangle == kNoIndex || !take(group, triangle)) continue;
    std::uint32_t c = 3 * triangle;
    while (group_of_[c] != group) ++c;
    next_triangles.push_back(neighbour_[previous(c)]);
    next_triangles.push_back(neighbour_[c]);
    if (planes_[triangle].any) continue;
    const Vec3d n = to_double(mesh_.normals[wedge(c)]);
    const auto flat = [&](Vec3d v) { return normalized(v - n * dot(n, v)); };
    const Vec3d a = flat(point(previous(c)) - point(c)), b = flat(point(next(c)) - point(c));
    const double angle = portable::atan2(length(cross(a, b)), dot(a, b));
    groups_[group].sum = groups_[group].sum + flat(planes_[triangle].along) * angle;
  }
}

void TangentMaker::group_corners() {
  group_of_.assign(neighbour_.size(), kNoIndex);
  for (std::uint32_t c = 0; c < group_of_.size(); ++c) {
    if (planes_[c / 3].any || group_of_[c] != kNoIndex) continue;
    groups_.push_back({vertex(c), planes_[c / 3].mirrored, {}});
    spread(static_cast<std::uint32_t>(groups_.size() - 1), c);
  }
}

void give_tangents(Mesh& mesh, const TangentMaker& maker) {
  // Group of the wedge itself; of another set of coordinates.
  std::vector<std::uint32_t> first(mesh.wedge_count(), kNoIndex);
  for (std::size_t w = 0; w < first.size(); ++w)
    if (mesh.tangents[w].w != 0) first[w] = kNoIndex - 1;
  std::map<std::array<std::uint32_t, 2>, std::uint32_t> others;  // wedge and group, to a wedge of their own
  for (std::uint32_t c = 0; c < maker.groups().size(); ++c) {
    const std::uint32_t group = maker.groups()[c];
    std::uint32_t& wedge = mesh.triangles[maker.triangles()[c / 3]][c % 3];
    if (group == kNoIndex || first[wedge] == group) continue;
    if (first[wedge] == kNoIndex) {
      first[wedge] = group;
      mesh.tangents[wedge] = maker.tangent(group);
      continue;
    }
    const auto [own, is_new] = others.try_emplace({wedge, group}, 0);
    if (is_new) {
      own->second = static_cast<std::uint32_t>(mesh.wedge_count());
      add_wedge(mesh, mesh, wedge, mesh.wedge_position[wedge]);
      mesh.tangents.back() = maker.tangent(group);
    }
    wedge = own->second;
  }
}

}  // namespace

int tangent_texcoord(const Material& material) {
  if (material.normal_texture.used()) return material.normal_texture.texcoord;
  for (const MaterialExtension& e : material.extensions) {
    const MaterialExtensionKind* kind = find_material_extension(e.name);
    for (const ExtensionTexture& t : e.textures)
      if (const ExtensionTextureKind* k = kind ? kind->texture(t.key) : nullptr; k && k->tangent_space)
        return t.texture.texcoord;
  }
  return -1;
}

bool needs_tangents(const Material& material) { return tangent_texcoord(material) >= 0; }

void make_tangents(Mesh& mesh, std::span<const int> texcoord) {
  mesh.tangents.clear();
  if (mesh.normals.empty()) return;
  const std::vector<Triangle> before = mesh.triangles;
  const std::size_t wedges = mesh.wedge_count();
  for (int set = 0; set < 2; ++set) {
    if ((set == 0 ? mesh.uv0 : mesh.uv1).size() < wedges) continue;
    std::vector<std::uint32_t> wanted;
    for (std::uint32_t t = 0; t < before.size(); ++t)
      if (const std::size_t m = mesh.triangle_material[t]; m < texcoord.size() && texcoord[m] == set)
        wanted.push_back(t);
    if (wanted.empty()) continue;
    mesh.tangents.resize(mesh.wedge_count());
    const std::vector<Vec2f> uv = set == 0 ? mesh.uv0 : mesh.uv1;
    give_tangents(mesh, TangentMaker(mesh, uv, wanted));
    for (const std::uint32_t t : wanted)
      for (const std::uint32_t w : mesh.triangles[t])
        if (mesh.tangents[w].w == 0) mesh.tangents[w] = kAnyTangent;
  }
}

}  // namespace texmesh
