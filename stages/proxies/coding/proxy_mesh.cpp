#include "stages/proxies/coding/proxy_mesh.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "format/base/box.h"
#include "format/base/no_index.h"
#include "stages/gltf/meshopt_streams.h"

namespace texmesh::proxies {
namespace {

struct PositionGrid {
  Vec3f origin;
  float step = 1;
  std::uint32_t last = 0;
  std::uint32_t place(float x, int axis) const {
    const double at = std::floor(
        (static_cast<double>(x) - static_cast<double>(origin[axis])) / static_cast<double>(step) + 0.5);
    return static_cast<std::uint32_t>(std::clamp(at, 0.0, static_cast<double>(last)));
  }
  std::array<std::uint32_t, 3> places(Vec3f p) const { return {place(p.x, 0), place(p.y, 1), place(p.z, 2)}; }
};

PositionGrid make_position_grid(const AtlasMesh& mesh, int bits) {
  Box3f box;
  for (const Vec3f p : mesh.positions) box.extend(p);
  PositionGrid grid;
  grid.last = (std::uint32_t{1} << bits) - 1;
  if (mesh.positions.empty()) return grid;
  grid.origin = box.min;
  const Vec3f size = box.max - box.min;
  const float longest = std::max({size.x, size.y, size.z});
  if (longest > 0) grid.step = longest / static_cast<float>(grid.last);
  return grid;
}

std::uint16_t unit16(float x) {
  return static_cast<std::uint16_t>(std::floor(std::clamp(x, 0.0f, 1.0f) * 65535 + 0.5f));
}
std::int8_t signed8(float x) {
  return static_cast<std::int8_t>(std::floor(std::clamp(x, -1.0f, 1.0f) * 127 + 0.5f));
}

/// Vertices and triangles of one group, in the order of first use by cache-friendly strips.
struct GroupMesh {
  std::vector<std::uint32_t> vertices;  // of the atlas mesh
  std::vector<std::uint32_t> indices;   // of `vertices`
};

GroupMesh group_mesh(const AtlasMesh& mesh, std::uint32_t group, const PositionGrid& grid) {
  GroupMesh out;
  std::vector<std::uint32_t> index(mesh.positions.size(), kNoIndex);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle& corner = mesh.triangles[t];
    if (mesh.group_of[t] != group) continue;
    std::array<std::array<std::uint32_t, 3>, 3> at;
    for (std::size_t k = 0; k < 3; ++k) at[k] = grid.places(mesh.positions[corner[k]]);
    if (at[0] == at[1] || at[1] == at[2] || at[2] == at[0]) continue;
    for (const std::uint32_t v : corner) {
      if (index[v] == kNoIndex) {
        index[v] = static_cast<std::uint32_t>(out.vertices.size());
        out.vertices.push_back(v);
      }
      out.indices.push_back(index[v]);
    }
  }
  if (out.indices.empty()) return out;
  std::vector<std::uint32_t> ordered(out.indices.size()), remap(out.vertices.size());
  meshopt_optimizeVertexCacheStrip(ordered.data(), out.indices.data(), ordered.size(), out.vertices.size());
  meshopt_optimizeVertexFetchRemap(remap.data(), ordered.data(), ordered.size(), out.vertices.size());
  std::vector<std::uint32_t> vertices(out.vertices.size());
  for (std::size_t i = 0; i < remap.size(); ++i) vertices[remap[i]] = out.vertices[i];
  for (std::uint32_t& i : ordered) i = remap[i];
  return {std::move(vertices), std::move(ordered)};
}

template <class T, std::size_t N, class Value>
MeshStream attribute_stream(const std::vector<std::uint32_t>& vertices, const Value& value) {
  static_assert(sizeof(T) * N % 4 == 0);
  MeshStream out{{}, sizeof(T) * N, vertices.size()};
  std::vector<std::uint8_t> raw(out.stride * out.count);
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const std::array<T, N> element = value(vertices[i]);
    std::memcpy(raw.data() + i * out.stride, element.data(), sizeof element);
  }
  out.packed = meshopt_attributes(raw, out.count, out.stride, "proxies");
  return out;
}

MeshStream index_stream(const GroupMesh& group) {
  MeshStream out{{}, group.vertices.size() > 65535 ? 4u : 2u, group.indices.size()};
  out.packed = meshopt_triangles(group.indices, group.vertices.size(), "proxies");
  return out;
}

CodedGroup code_group(const AtlasMesh& mesh, const std::vector<Vec3f>& normals, const GroupMesh& group,
                      const PositionGrid& grid) {
  CodedGroup out;
  out.least.fill(grid.last);
  out.positions = attribute_stream<std::uint16_t, 4>(group.vertices, [&](std::uint32_t v) {
    const std::array<std::uint32_t, 3> at = grid.places(mesh.positions[v]);
    for (std::size_t k = 0; k < 3; ++k) {
      out.least[k] = std::min(out.least[k], at[k]);
      out.most[k] = std::max(out.most[k], at[k]);
    }
    return std::array<std::uint16_t, 4>{static_cast<std::uint16_t>(at[0]), static_cast<std::uint16_t>(at[1]),
                                        static_cast<std::uint16_t>(at[2]), 0};
  });
  if (!normals.empty())
    out.normals = attribute_stream<std::int8_t, 4>(group.vertices, [&](std::uint32_t v) {
      const Vec3f n = normals[v];
      return std::array<std::int8_t, 4>{signed8(n.x), signed8(n.y), signed8(n.z), 0};
    });
  out.uvs = attribute_stream<std::uint16_t, 2>(group.vertices, [&](std::uint32_t v) {
    return std::array<std::uint16_t, 2>{unit16(mesh.uvs[v].x), unit16(mesh.uvs[v].y)};
  });
  out.indices = index_stream(group);
  return out;
}

}  // namespace

std::size_t CodedMesh::bytes() const {
  std::size_t sum = 0;
  for (const CodedGroup& g : groups)
    for (const MeshStream* s : {&g.positions, &g.normals, &g.uvs, &g.indices}) sum += s->packed.size();
  return sum;
}

CodedMesh code_mesh(const AtlasMesh& mesh, const std::vector<Vec3f>& normals,
                    const std::vector<bool>& with_normals, int position_bits) {
  const PositionGrid grid = make_position_grid(mesh, position_bits);
  CodedMesh out{grid.origin, grid.step, {}};
  const std::vector<Vec3f> none;
  for (std::uint32_t g = 0; g < with_normals.size(); ++g) {
    const GroupMesh group = group_mesh(mesh, g, grid);
    if (group.indices.empty()) continue;
    out.groups.push_back(code_group(mesh, with_normals[g] ? normals : none, group, grid));
    out.groups.back().group = g;
  }
  return out;
}

RoundedMesh rounded_mesh(const AtlasMesh& mesh, const std::vector<Vec3f>& normals, int position_bits) {
  const PositionGrid grid = make_position_grid(mesh, position_bits);
  RoundedMesh out;
  for (const Vec3f p : mesh.positions) {
    const std::array<std::uint32_t, 3> at = grid.places(p);
    const Vec3f place{static_cast<float>(at[0]), static_cast<float>(at[1]), static_cast<float>(at[2])};
    out.positions.push_back(grid.origin + place * grid.step);
  }
  for (const Vec3f n : normals)
    out.normals.push_back(normalized(Vec3f{static_cast<float>(signed8(n.x)), static_cast<float>(signed8(n.y)),
                                           static_cast<float>(signed8(n.z))}));
  for (const Vec2f uv : mesh.uvs)
    out.uvs.push_back({static_cast<float>(unit16(uv.x)) / 65535, static_cast<float>(unit16(uv.y)) / 65535});
  return out;
}

}  // namespace texmesh::proxies
