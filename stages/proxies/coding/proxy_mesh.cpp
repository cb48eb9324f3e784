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

// Coordinates need not be finer than this part of a texel.
constexpr std::uint32_t kStepsPerTexel = 4;

/// Places from 0 to 1 along both axes.
struct UvGrid {
  std::array<std::uint32_t, 2> last{};
  std::uint32_t place(float x, std::size_t axis) const {
    return static_cast<std::uint32_t>(
        std::floor(std::clamp(x, 0.0f, 1.0f) * static_cast<float>(last[axis]) + 0.5f));
  }
  Vec2f step() const { return {1 / static_cast<float>(last[0]), 1 / static_cast<float>(last[1])}; }
};

int uv_bits(const AtlasMesh& mesh) {
  int bits = 6;
  while (bits < 16 && (std::uint32_t{1} << bits) < kStepsPerTexel * std::max(mesh.width_px, mesh.height_px))
    ++bits;
  return bits;
}

UvGrid make_uv_grid(const AtlasMesh& mesh, bool draco) {
  if (draco) {
    const std::uint32_t last = (std::uint32_t{1} << uv_bits(mesh)) - 1;
    return {{last, last}};
  }
  const auto steps = [](std::uint32_t texels) { return std::clamp(kStepsPerTexel * texels, 1u, 65535u); };
  return {{steps(mesh.width_px), steps(mesh.height_px)}};
}

/// The lower half of the octahedron is folded over the upper one (Meyer et al. 2010). The third number stands
/// for 1.
std::array<std::int8_t, 4> octahedral(Vec3f n, int bits) {
  const auto one = static_cast<float>((1 << (bits - 1)) - 1);
  const float sum = std::fabs(n.x) + std::fabs(n.y) + std::fabs(n.z);
  const float scale = sum > 0 ? 1 / sum : 0;
  float x = n.x * scale, y = n.y * scale;
  if (n.z < 0) {
    const float folded = (1 - std::fabs(y)) * (x < 0 ? -1.0f : 1.0f);
    y = (1 - std::fabs(x)) * (y < 0 ? -1.0f : 1.0f);
    x = folded;
  }
  const auto whole = [&](float v) { return static_cast<std::int8_t>(std::floor(v * one + 0.5f)); };
  return {whole(x), whole(y), static_cast<std::int8_t>(one), 0};
}

Vec3f normal_of(const std::array<std::int8_t, 4>& coded) {
  float x = coded[0], y = coded[1];
  const float z = static_cast<float>(coded[2]) - std::fabs(x) - std::fabs(y);
  const float t = std::min(z, 0.0f);
  x += x >= 0 ? t : -t;
  y += y >= 0 ? t : -t;
  return normalized(Vec3f{x, y, z});
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

Vec3f position_at(const PositionGrid& grid, const std::array<std::uint32_t, 3>& at) {
  const Vec3f place{static_cast<float>(at[0]), static_cast<float>(at[1]), static_cast<float>(at[2])};
  return grid.origin + place * grid.step;
}

void extend(CodedGroup& group, const std::array<std::uint32_t, 3>& at) {
  for (std::size_t k = 0; k < 3; ++k) {
    group.least[k] = std::min(group.least[k], at[k]);
    group.most[k] = std::max(group.most[k], at[k]);
  }
}

/// All that the groups of a mesh share.
class GroupCoder {
 public:
  GroupCoder(const AtlasMesh& mesh, const MeshCoding& coding)
      : mesh_(mesh),
        coding_(coding),
        grid_(make_position_grid(mesh, coding.position_bits)),
        uv_grid_(make_uv_grid(mesh, coding.draco)) {}

  const PositionGrid& grid() const { return grid_; }
  const UvGrid& uv_grid() const { return uv_grid_; }
  CodedGroup code(const GroupMesh& group, const std::vector<Vec3f>& normals) const {
    CodedGroup out;
    out.least.fill(grid_.last);
    if (coding_.draco)
      code_draco(group, normals, out);
    else
      code_meshopt(group, normals, out);
    return out;
  }

 private:
  void code_meshopt(const GroupMesh& group, const std::vector<Vec3f>& normals, CodedGroup& out) const {
    out.places = attribute_stream<std::uint16_t, 6>(group.vertices, [&](std::uint32_t v) {
      const std::array<std::uint32_t, 3> at = grid_.places(mesh_.positions[v]);
      extend(out, at);
      const auto u16 = [](std::uint32_t x) { return static_cast<std::uint16_t>(x); };
      return std::array<std::uint16_t, 6>{
          u16(at[0]), u16(at[1]), u16(at[2]), 0, u16(uv_grid_.place(mesh_.uvs[v].x, 0)),
          u16(uv_grid_.place(mesh_.uvs[v].y, 1))};
    });
    if (!normals.empty())
      out.normals = attribute_stream<std::int8_t, 4>(
          group.vertices, [&](std::uint32_t v) { return octahedral(normals[v], coding_.normal_bits); });
    out.indices = index_stream(group);
  }

  void code_draco(const GroupMesh& group, const std::vector<Vec3f>& normals, CodedGroup& out) const {
    DracoInput input;
    for (const std::uint32_t v : group.vertices) {
      const std::array<std::uint32_t, 3> at = grid_.places(mesh_.positions[v]);
      extend(out, at);
      input.positions.push_back(position_at(grid_, at));
      if (!normals.empty()) input.normals.push_back(normals[v]);
      input.uvs.push_back(mesh_.uvs[v]);
    }
    input.indices = group.indices;
    input.origin = grid_.origin;
    input.range = grid_.step * static_cast<float>(grid_.last);
    input.position_bits = coding_.position_bits;
    input.normal_bits = coding_.normal_bits;
    input.uv_bits = uv_bits(mesh_);
    out.draco = code_draco_group(input);
  }

  const AtlasMesh& mesh_;
  const MeshCoding& coding_;
  PositionGrid grid_;
  UvGrid uv_grid_;
};

}  // namespace

std::size_t CodedMesh::bytes() const {
  std::size_t sum = 0;
  for (const CodedGroup& g : groups)
    sum += g.draco.stream.size() + g.places.packed.size() + g.normals.packed.size() + g.indices.packed.size();
  return sum;
}

CodedMesh code_mesh(const AtlasMesh& mesh, const std::vector<Vec3f>& normals,
                    const std::vector<bool>& with_normals, const MeshCoding& coding) {
  const GroupCoder coder(mesh, coding);
  CodedMesh out{coder.grid().origin, coder.grid().step, coder.uv_grid().step(), {}};
  const std::vector<Vec3f> none;
  for (std::uint32_t g = 0; g < with_normals.size(); ++g) {
    const GroupMesh group = group_mesh(mesh, g, coder.grid());
    if (group.indices.empty()) continue;
    out.groups.push_back(coder.code(group, with_normals[g] ? normals : none));
    out.groups.back().group = g;
  }
  return out;
}

RoundedMesh rounded_mesh(const AtlasMesh& mesh, const std::vector<Vec3f>& normals, const MeshCoding& coding) {
  const GroupCoder coder(mesh, coding);
  RoundedMesh out;
  for (const Vec3f p : mesh.positions)
    out.positions.push_back(position_at(coder.grid(), coder.grid().places(p)));
  for (const Vec3f n : normals) out.normals.push_back(normal_of(octahedral(n, coding.normal_bits)));
  const Vec2f step = coder.uv_grid().step();
  for (const Vec2f uv : mesh.uvs)
    out.uvs.push_back({static_cast<float>(coder.uv_grid().place(uv.x, 0)) * step.x,
                       static_cast<float>(coder.uv_grid().place(uv.y, 1)) * step.y});
  return out;
}

}  // namespace texmesh::proxies
