// Tilers, LOD tools and photogrammetry write one surface as many chunks, each rounded in its own way.
// Whatever the way, the chunks that meet are one surface again.
#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "pipeline/import/import.h"
#include "stages/condition/condition.h"
#include "tests/support/even_sphere.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/hostile_meshes.h"

namespace texmesh {
namespace {

using nlohmann::json;
using testing::GltfBuilder;
using testing::Random;

enum class Kind : std::uint8_t { kFloat, kNested, kInt16, kUint16, kInt8, kDraco };

/// A turn, a scale and a shift of a chunk's own; the columns of its matrix.
struct Placement {
  Vec3d x, y, z, shift;
  Vec3d undo(const Vec3d& p) const {
    const Vec3d d = p - shift;
    return {dot(d, x) / dot(x, x), dot(d, y) / dot(y, y), dot(d, z) / dot(z, z)};
  }
  json matrix() const {
    return {x.x, x.y, x.z, 0, y.x, y.y, y.z, 0, z.x, z.y, z.z, 0, shift.x, shift.y, shift.z, 1};
  }
};

Placement random_placement(Random& random, double far) {
  const auto number = [&] { return 2 * random.uniform() - 1; };
  const Vec3d x = normalized(Vec3d{number(), number(), number() + 2}),
              y = normalized(cross(x, {number() + 2, number(), number()}));
  const auto single = [](const Vec3d& v) { return to_double(to_float(v)); };  // as exporters store them
  const double scale = std::exp(4 * number());
  return {single(x * scale), single(y * scale), single(cross(x, y) * scale),
          single(Vec3d{number(), number(), number()} * far)};
}

struct Chunk {
  std::vector<Vec3d> points;  // in the chunk's own space
  std::vector<std::uint32_t> indices;
};

int draco_view(GltfBuilder& b, const Chunk& chunk, int bits, int& id) {
  draco::TriangleSoupMeshBuilder soup;
  soup.Start(static_cast<int>(chunk.indices.size() / 3));
  id = soup.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  for (std::uint32_t t = 0; 3 * t < chunk.indices.size(); ++t) {
    Vec3f p[3];
    for (std::size_t k = 0; k < 3; ++k) p[k] = to_float(chunk.points[chunk.indices[3 * t + k]]);
    soup.SetAttributeValuesForFace(id, draco::FaceIndex(t), &p[0], &p[1], &p[2]);
  }
  draco::Encoder encoder;
  encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, bits);
  draco::EncoderBuffer out;
  EXPECT_TRUE(encoder.EncodeMeshToBuffer(*soup.Finalize(), &out).ok());
  return b.view_of(std::vector<std::uint8_t>(out.data(), out.data() + out.size()));
}

/// Whole numbers of 0 .. `most` per axis over the chunk's box, and the node that undoes them.
template <class T>
int grid_accessor(GltfBuilder& b, const Chunk& chunk, bool normalized, json& node) {
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

void add_chunk(GltfBuilder& b, const Chunk& chunk, const Placement& placement, Kind kind, Random& random) {
  json node = json::object(), extensions;
  const int indices = b.attribute<std::uint32_t>(chunk.indices, "SCALAR");
  int position = -1;
  if (kind == Kind::kInt16) {
    position = grid_accessor<std::int16_t>(b, chunk, true, node);
  } else if (kind == Kind::kUint16) {
    position = grid_accessor<std::uint16_t>(b, chunk, false, node);
  } else if (kind == Kind::kInt8) {
    position = grid_accessor<std::int8_t>(b, chunk, true, node);
  } else if (kind == Kind::kDraco) {
    int id = 0;
    const int view = draco_view(b, chunk, 11 + static_cast<int>(random.next() % 6), id);
    extensions = {{"KHR_draco_mesh_compression", {{"bufferView", view}, {"attributes", {{"POSITION", id}}}}}};
    position = b.accessor(-1, "VEC3", 5126, chunk.points.size(), {{"min", {0, 0, 0}}, {"max", {1, 1, 1}}});
  } else {
    std::vector<float> values;
    for (const Vec3d& p : chunk.points)
      for (int i = 0; i < 3; ++i) values.push_back(static_cast<float>(p[i]));
    position = b.attribute<float>(values, "VEC3");
  }
  json more = {{"indices", indices}};
  if (!extensions.is_null()) more["extensions"] = extensions;
  node["mesh"] = b.mesh({{"POSITION", position}}, more);
  const int child = b.node(node);
  b.json["scenes"][0]["nodes"].push_back(b.node({{"matrix", placement.matrix()}, {"children", {child}}}));
}

/// Cuts the surface by the direction of its triangles' centres into `parts` wedges around an axis.
Model chunks_of(const Mesh& whole, std::uint32_t parts, Kind kind, Random& random) {
  GltfBuilder b;
  b.json["extensionsUsed"] = {"KHR_draco_mesh_compression", "KHR_mesh_quantization"};
  for (std::uint32_t part = 0; part < parts; ++part) {
    const Placement placement = random_placement(random, kind == Kind::kNested ? 5000 : 10);
    Chunk chunk;
    std::map<std::uint32_t, std::uint32_t> number;
    for (std::uint32_t t = 0; t < whole.triangles.size(); ++t) {
      Vec3d centre;
      for (int k = 0; k < 3; ++k) centre = centre + to_double(whole.positions[whole.position_of(t, k)]);
      const double turn = (std::atan2(centre.y, centre.x) / 6.2831853 + .5) * parts;
      if (std::min(static_cast<std::uint32_t>(turn), parts - 1) != part) continue;
      for (int k = 0; k < 3; ++k) {
        const std::uint32_t p = whole.position_of(t, k);
        const auto [at, added] = number.try_emplace(p, static_cast<std::uint32_t>(number.size()));
        if (added) chunk.points.push_back(placement.undo(to_double(whole.positions[p])));
        chunk.indices.push_back(at->second);
      }
    }
    if (!chunk.indices.empty()) add_chunk(b, chunk, placement, kind, random);
  }
  testing::MemoryResolver resolver;
  return import_gltf("chunks.glb", b.glb(), resolver, {}, {}).model;
}

TEST(ImportGltfChunksTest, ChunksThatMeetAreOneSurfaceAgain) {
  Random random{7};
  for (const Kind kind :
       {Kind::kFloat, Kind::kNested, Kind::kInt16, Kind::kUint16, Kind::kInt8, Kind::kDraco})
    for (int level = 2; level <= 4; ++level)
      for (const std::uint32_t parts : {2, 7, 16}) {
        if (kind == Kind::kInt8 && level > 2) continue;  // a step is over 1/16 of an edge
        SCOPED_TRACE(::testing::Message()
                     << "kind " << static_cast<int>(kind) << " level " << level << " parts " << parts);
        const Mesh whole = testing::even_sphere(level, .1);
        const Model model = chunks_of(whole, parts, kind, random);
        const ConditionedMesh c = condition_mesh(model.mesh, true, {}, RunContext{});
        EXPECT_EQ(c.report.boundary_edges, 0u);
        EXPECT_EQ(c.component_count, 1u);
        EXPECT_EQ(c.mesh.triangles.size(), whole.triangles.size());
        EXPECT_EQ(c.mesh.positions.size(), whole.positions.size());
        EXPECT_GT(c.report.rounded_positions, 0u);
      }
}

// What lies close together by design stays apart: thin sheets with open edges, and detail that is finer than
// the rounding of a far part.
TEST(ImportGltfChunksTest, WhatIsNoRoundingStaysApart) {
  const auto sheets = [](float gap, float side) {
    return testing::bare_mesh(
        {{0, 0, 0}, {side, 0, 0}, {0, side, 0}, {0, 0, gap}, {side, 0, gap}, {0, side, gap}},
        {{0, 1, 2}, {3, 4, 5}});
  };
  Mesh thin = sheets(1e-5f, 1);
  EXPECT_EQ(condition_mesh(thin, true, {}, RunContext{}).component_count, 2u);
  thin = sheets(.1f, 1);
  thin.rounding = {1};  // four units would take everything
  EXPECT_EQ(condition_mesh(thin, true, {}, RunContext{}).component_count, 2u) << "over 1/16 of an edge";
  thin = sheets(.05f, 1);
  thin.rounding = {.013f};
  EXPECT_EQ(condition_mesh(thin, true, {}, RunContext{}).component_count, 1u);
  thin.rounding = {.012f};
  EXPECT_EQ(condition_mesh(thin, true, {}, RunContext{}).component_count, 2u) << "over four units";
}

}  // namespace
}  // namespace texmesh
