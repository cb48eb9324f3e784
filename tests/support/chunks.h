#pragma once
// One surface as the chunks that tilers, LOD tools and photogrammetry write of it, each rounded in a way of
// its own. Normals and the first texture coordinates go with the positions.
#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "tests/support/even_sphere.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/meshes.h"

namespace texmesh::testing {

/// kExact: without a place of their own.
enum class ChunkKind : std::uint8_t { kExact, kFloat, kNested, kInt16, kUint16, kInt8, kDraco };

/// even_sphere() with normals and with the picture seen along z: no seam anywhere.
inline Mesh textured_sphere(int levels, double amplitude) {
  Mesh m = even_sphere(levels, amplitude);
  for (const Vec3f& p : m.positions) {
    m.normals.push_back(to_float(normalized(to_double(p))));
    m.uv0.push_back({.5f + .35f * p.x, .5f - .35f * p.y});
  }
  return m;
}

/// A turn, a scale and a shift of a chunk's own; the columns of its matrix.
struct Placement {
  Vec3d x, y, z, shift;
  Vec3d undo_direction(const Vec3d& d) const {
    return {dot(d, x) / dot(x, x), dot(d, y) / dot(y, y), dot(d, z) / dot(z, z)};
  }
  Vec3d undo(const Vec3d& p) const { return undo_direction(p - shift); }
  nlohmann::json matrix() const {
    return {x.x, x.y, x.z, 0, y.x, y.y, y.z, 0, z.x, z.y, z.z, 0, shift.x, shift.y, shift.z, 1};
  }
};

inline Placement random_placement(Random& random, double far) {
  const auto number = [&] { return 2 * random.uniform() - 1; };
  const Vec3d x = normalized(Vec3d{number(), number(), number() + 2}),
              y = normalized(cross(x, {number() + 2, number(), number()}));
  const auto single = [](const Vec3d& v) { return to_double(to_float(v)); };  // as exporters store them
  const double scale = std::exp(4 * number());
  return {single(x * scale), single(y * scale), single(cross(x, y) * scale),
          single(Vec3d{number(), number(), number()} * far)};
}

struct Chunk {
  Placement placement;
  std::vector<Vec3d> points;  // in the chunk's own space
  std::vector<Vec3f> normals;
  std::vector<Vec2f> uvs;
  std::vector<std::uint32_t> indices;
};

/// `far`: how far places lie from the origin, 0 = none have one. Cuts the surface by the direction of its
/// triangles' centres into wedges around an axis.
inline std::vector<Chunk> chunks_of(const Mesh& whole, std::uint32_t parts, double far, Random& random) {
  std::vector<Chunk> chunks;
  for (std::uint32_t part = 0; part < parts; ++part) {
    Chunk chunk;
    chunk.placement =
        far > 0 ? random_placement(random, far) : Placement{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {}};
    std::map<std::uint32_t, std::uint32_t> number;
    for (std::uint32_t t = 0; t < whole.triangles.size(); ++t) {
      Vec3d centre;
      for (int k = 0; k < 3; ++k) centre = centre + to_double(whole.positions[whole.position_of(t, k)]);
      const double turn = (std::atan2(centre.y, centre.x) / 6.2831853 + .5) * parts;
      if (std::min(static_cast<std::uint32_t>(turn), parts - 1) != part) continue;
      for (const std::uint32_t w : whole.triangles[t]) {
        const auto [at, added] = number.try_emplace(w, static_cast<std::uint32_t>(number.size()));
        chunk.indices.push_back(at->second);
        if (!added) continue;
        chunk.points.push_back(chunk.placement.undo(to_double(whole.positions[whole.wedge_position[w]])));
        if (!whole.uv0.empty()) chunk.uvs.push_back(whole.uv0[w]);
        if (!whole.normals.empty())
          chunk.normals.push_back(
              to_float(normalized(chunk.placement.undo_direction(to_double(whole.normals[w])))));
      }
    }
    if (!chunk.indices.empty()) chunks.push_back(std::move(chunk));
  }
  return chunks;
}

inline int draco_view(GltfBuilder& b, const Chunk& chunk, int bits, nlohmann::json& attributes) {
  draco::TriangleSoupMeshBuilder soup;
  soup.Start(static_cast<int>(chunk.indices.size() / 3));
  const auto add = [&](const char* name, draco::GeometryAttribute::Type type, std::int8_t components,
                       auto&& value) {
    const int id = soup.AddAttribute(type, components, draco::DT_FLOAT32);
    for (std::uint32_t t = 0; 3 * t < chunk.indices.size(); ++t) {
      const auto p = value(chunk.indices[3 * t]), q = value(chunk.indices[3 * t + 1]),
                 r = value(chunk.indices[3 * t + 2]);
      soup.SetAttributeValuesForFace(id, draco::FaceIndex(t), &p, &q, &r);
    }
    attributes[name] = id;
  };
  using Attribute = draco::GeometryAttribute;
  add("POSITION", Attribute::POSITION, 3, [&](std::uint32_t v) { return to_float(chunk.points[v]); });
  if (!chunk.normals.empty())
    add("NORMAL", Attribute::NORMAL, 3, [&](std::uint32_t v) { return chunk.normals[v]; });
  if (!chunk.uvs.empty())
    add("TEXCOORD_0", Attribute::TEX_COORD, 2, [&](std::uint32_t v) { return chunk.uvs[v]; });
  draco::Encoder encoder;
  encoder.SetAttributeQuantization(Attribute::POSITION, bits);
  encoder.SetAttributeQuantization(Attribute::NORMAL, 10);
  encoder.SetAttributeQuantization(Attribute::TEX_COORD, 12);
  draco::EncoderBuffer out;
  EXPECT_TRUE(encoder.EncodeMeshToBuffer(*soup.Finalize(), &out).ok());
  return b.view_of(std::vector<std::uint8_t>(out.data(), out.data() + out.size()));
}

/// Whole numbers of 0 .. `most` per axis over the chunk's box, and the node that undoes them.
template <class T>
int grid_accessor(GltfBuilder& b, const Chunk& chunk, bool normalized, nlohmann::json& node) {
  const double most = std::numeric_limits<T>::max();
  Vec3d low = chunk.points[0], high = low;
  for (const Vec3d& p : chunk.points)
    for (int i = 0; i < 3; ++i) low[i] = std::min(low[i], p[i]), high[i] = std::max(high[i], p[i]);
  const double side = std::max({high.x - low.x, high.y - low.y, high.z - low.z});
  std::vector<T> values;
  for (const Vec3d& p : chunk.points) {
    for (int i = 0; i < 3; ++i) values.push_back(static_cast<T>(std::lround((p[i] - low[i]) / side * most)));
    values.push_back(0);  // a multiple of 4 bytes
  }
  const double unit = normalized ? side : side / most;
  node["translation"] = {static_cast<float>(low.x), static_cast<float>(low.y), static_cast<float>(low.z)};
  node["scale"] = {static_cast<float>(unit), static_cast<float>(unit), static_cast<float>(unit)};
  return b.accessor(b.view_of(values, 4 * static_cast<int>(sizeof(T))), "VEC3",
                    GltfBuilder::component_type<T>(), chunk.points.size(),
                    {{"normalized", normalized}, {"min", {0, 0, 0}}, {"max", {most, most, most}}});
}

template <class T>
std::vector<float> components_of(const std::vector<T>& values) {
  std::vector<float> out(values.size() * sizeof(T) / sizeof(float));
  if (!values.empty()) std::memcpy(out.data(), values.data(), values.size() * sizeof(T));
  return out;
}

inline void add_chunk(GltfBuilder& b, const Chunk& chunk, ChunkKind kind, Random& random) {
  nlohmann::json node = nlohmann::json::object(), attributes, more;
  more["indices"] = b.attribute<std::uint32_t>(chunk.indices, "SCALAR");
  if (kind == ChunkKind::kDraco) {
    nlohmann::json ids;
    const int view = draco_view(b, chunk, 11 + static_cast<int>(random.next() % 6), ids);
    more["extensions"] = {{"KHR_draco_mesh_compression", {{"bufferView", view}, {"attributes", ids}}}};
    for (const auto& [name, id] : ids.items())
      attributes[name] = b.accessor(-1, name == "TEXCOORD_0" ? "VEC2" : "VEC3", 5126, chunk.points.size(),
                                    {{"min", {0, 0, 0}}, {"max", {1, 1, 1}}});
  } else {
    if (kind == ChunkKind::kInt16)
      attributes["POSITION"] = grid_accessor<std::int16_t>(b, chunk, true, node);
    else if (kind == ChunkKind::kUint16)
      attributes["POSITION"] = grid_accessor<std::uint16_t>(b, chunk, false, node);
    else if (kind == ChunkKind::kInt8)
      attributes["POSITION"] = grid_accessor<std::int8_t>(b, chunk, true, node);
    else
      attributes["POSITION"] = b.attribute<float>(
          [&] {
            std::vector<float> values;
            for (const Vec3d& p : chunk.points)
              for (int i = 0; i < 3; ++i) values.push_back(static_cast<float>(p[i]));
            return values;
          }(),
          "VEC3");
    if (!chunk.normals.empty()) attributes["NORMAL"] = b.attribute(components_of(chunk.normals), "VEC3");
    if (!chunk.uvs.empty()) attributes["TEXCOORD_0"] = b.attribute(components_of(chunk.uvs), "VEC2");
  }
  if (b.json.contains("materials")) more["material"] = 0;
  node["mesh"] = b.mesh(attributes, more);
  const int child = b.node(node);
  b.json["scenes"][0]["nodes"].push_back(
      b.node({{"matrix", chunk.placement.matrix()}, {"children", {child}}}));
}

/// `picture`: a PNG, the texture of all chunks; or nothing.
inline Bytes chunks_glb(const Mesh& whole, std::uint32_t parts, ChunkKind kind, Random& random,
                        const Bytes& picture = {}) {
  GltfBuilder b;
  b.json["extensionsUsed"] = {"KHR_draco_mesh_compression", "KHR_mesh_quantization"};
  if (!picture.empty()) {
    b.push("images", {{"bufferView", b.view_of(picture)}, {"mimeType", "image/png"}});
    b.push("textures", {{"source", 0}});
    b.push("materials",
           {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}, {"metallicFactor", 0}}}});
  }
  const double far = kind == ChunkKind::kExact ? 0 : kind == ChunkKind::kNested ? 5000 : 10;
  for (const Chunk& chunk : chunks_of(whole, parts, far, random)) add_chunk(b, chunk, kind, random);
  return b.glb();
}

/// An OBJ whose chunks were written with so many decimals twice: about origins of their own, then together.
inline std::string chunks_obj(const Mesh& whole, std::uint32_t parts, int decimals, Random& random) {
  std::string text = "mtllib m.mtl\nusemtl m\n";
  const auto line = [&](const char* word, std::initializer_list<double> numbers, int digits) {
    text += word;
    char number[64];
    for (const double x : numbers) text += (std::snprintf(number, sizeof number, " %.*f", digits, x), number);
    text += "\n";
  };
  std::size_t first = 1;
  const double unit = std::pow(10, decimals);
  for (const Chunk& chunk : chunks_of(whole, parts, 3, random)) {
    const Placement& at = chunk.placement;
    const auto out = [&](const Vec3d& d) { return at.x * d.x + at.y * d.y + at.z * d.z; };
    for (std::size_t i = 0; i < chunk.points.size(); ++i) {
      Vec3d p = out(chunk.points[i]);
      for (int k = 0; k < 3; ++k) p[k] = at.shift[k] + std::round(p[k] * unit) / unit;
      const Vec3d n = normalized(out(to_double(chunk.normals[i])));
      line("v", {p.x, p.y, p.z}, decimals);
      line("vn", {n.x, n.y, n.z}, 4);
      line("vt", {chunk.uvs[i].x, 1 - chunk.uvs[i].y}, 6);
    }
    for (std::size_t i = 0; i < chunk.indices.size(); ++i) {
      const std::string n = std::to_string(first + chunk.indices[i]);
      text += (i % 3 == 0 ? "f " : " ") + n + "/" + n + "/" + n + (i % 3 == 2 ? "\n" : "");
    }
    first += chunk.points.size();
  }
  return text;
}

}  // namespace texmesh::testing
