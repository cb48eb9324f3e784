#include "stages/proxies/coding/proxy_glb.h"

#include <meshoptimizer.h>

#include "stages/gltf/glb_writer.h"

namespace texmesh {
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

std::uint8_t signed8(float x) {
  return static_cast<std::uint8_t>(static_cast<int>(std::floor(std::clamp(x, -1.0f, 1.0f) * 127 + 0.5f)));
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
    out.has_normals = !normals.empty();
    std::vector<std::uint8_t> raw;
    const auto put16 = [&](std::uint32_t x) {
      raw.push_back(static_cast<std::uint8_t>(x));
      raw.push_back(static_cast<std::uint8_t>(x >> 8));
    };
    for (const std::uint32_t v : group.vertices) {
      const std::array<std::uint32_t, 3> at = grid_.places(mesh_.positions[v]);
      extend(out, at);
      for (const std::uint32_t x : {at[0], at[1], at[2], 0u}) put16(x);
      put16(uv_grid_.place(mesh_.uvs[v].x, 0));
      put16(uv_grid_.place(mesh_.uvs[v].y, 1));
      if (!out.has_normals) continue;
      const Vec3f n = normals[v];
      raw.insert(raw.end(), {signed8(n.x), signed8(n.y), signed8(n.z), 0});
    }
    out.vertex_stream = {{}, out.has_normals ? 16u : 12u, group.vertices.size()};
    out.vertex_stream.packed =
        meshopt_attributes(raw, out.vertex_stream.count, out.vertex_stream.stride, "proxies");
    out.indices = index_stream(group);
  }

  void code_draco(const GroupMesh& group, const std::vector<Vec3f>& normals, CodedGroup& out) const {
    constexpr int kSpeed = 3;  // slower ones gain less than 1 % on small meshes
    constexpr int kNormalBits = 8;
    DracoMesh mesh(group.indices, group.vertices.size());
    mesh.add("POSITION", {coding_.position_bits, grid_.origin, grid_.step * static_cast<float>(grid_.last)},
             [&](std::uint32_t i) {
               const std::array<std::uint32_t, 3> at = grid_.places(mesh_.positions[group.vertices[i]]);
               extend(out, at);
               return position_at(grid_, at);
             });
    out.has_normals = !normals.empty();
    if (out.has_normals)
      mesh.add("NORMAL", {kNormalBits, {}, 1}, [&](std::uint32_t i) { return normals[group.vertices[i]]; });
    mesh.add("TEXCOORD_0", {uv_bits(mesh_), {}, 1},
             [&](std::uint32_t i) { return mesh_.uvs[group.vertices[i]]; });
    try {
      out.draco = mesh.encode(kSpeed);
    } catch (const StageError&) {  // what Draco refuses is left to meshopt
    }
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
    sum += g.draco.bytes.size() + g.vertex_stream.packed.size() + g.indices.packed.size();
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
    // Draco's positions and meshopt's places cannot share a node.
    if (coding.draco && !out.groups.back().is_draco())
      return code_mesh(mesh, normals, with_normals, {false, coding.position_bits});
  }
  return out;
}

RoundedMesh rounded_mesh(const AtlasMesh& mesh, const std::vector<Vec3f>& normals, const MeshCoding& coding) {
  const GroupCoder coder(mesh, coding);
  RoundedMesh out;
  for (const Vec3f p : mesh.positions)
    out.positions.push_back(position_at(coder.grid(), coder.grid().places(p)));
  const auto component = [](float x) { return static_cast<float>(static_cast<std::int8_t>(signed8(x))); };
  for (const Vec3f n : normals)
    out.normals.push_back(normalized(Vec3f{component(n.x), component(n.y), component(n.z)}));
  const Vec2f step = coder.uv_grid().step();
  for (const Vec2f uv : mesh.uvs)
    out.uvs.push_back({static_cast<float>(coder.uv_grid().place(uv.x, 0)) * step.x,
                       static_cast<float>(coder.uv_grid().place(uv.y, 1)) * step.y});
  return out;
}

}  // namespace texmesh
