// Whatever the way in which chunks were rounded, those that meet are one surface again.
#include "pipeline/import/import.h"
#include "stages/condition/condition.h"
#include "tests/support/chunks.h"
#include "tests/support/hostile_meshes.h"
#include "tests/support/memory_resolver.h"

namespace texmesh::import_gltf_chunks_test {

using testing::ChunkKind;
using testing::Random;

ConditionedMesh conditioned(const std::string& name, const Bytes& bytes) {
  testing::MemoryResolver files;
  const ImportedModel m = import_model(name, bytes, files, {}, {});
  return condition_mesh(m.model.mesh, m.normals_by_specification, {}, RunContext{});
}

void expect_as(const Mesh& whole, const ConditionedMesh& c) {
  EXPECT_EQ(c.report.boundary_edges, 0u);
  EXPECT_EQ(c.component_count, 1u);
  EXPECT_EQ(c.mesh.triangles.size(), whole.triangles.size());
  EXPECT_EQ(c.mesh.positions.size(), whole.positions.size());
  EXPECT_GT(c.report.rounded_positions, 0u);
  if (!whole.normals.empty()) EXPECT_EQ(c.mesh.wedge_count(), whole.wedge_count()) << "borders are no seams";
}

TEST(ImportGltfChunksTest, ChunksThatMeetAreOneSurfaceAgain) {
  Random random{7};
  for (const ChunkKind kind : {ChunkKind::kFloat, ChunkKind::kNested, ChunkKind::kInt16, ChunkKind::kUint16,
                               ChunkKind::kInt8, ChunkKind::kDraco})
    for (int level = 2; level <= 4; ++level)
      for (const std::uint32_t parts : {2, 7, 16})
        for (const bool textured : {false, true}) {
          if (kind == ChunkKind::kInt8 && level > 2) continue;  // a step is over 1/16 of an edge
          SCOPED_TRACE(::testing::Message() << "kind " << static_cast<int>(kind) << " level " << level
                                            << " parts " << parts << " textured " << textured);
          const Mesh whole = textured ? testing::textured_sphere(level, .1) : testing::even_sphere(level, .1);
          expect_as(whole, conditioned("chunks.glb", testing::chunks_glb(whole, parts, kind, random)));
        }
}

TEST(ImportGltfChunksTest, ChunksOfATextThatMeetAreOneSurfaceAgain) {
  Random random{8};
  for (const int decimals : {4, 5, 6, 7})
    for (const std::uint32_t parts : {2, 7, 16}) {
      SCOPED_TRACE(::testing::Message() << decimals << " decimals, parts " << parts);
      const Mesh whole = testing::textured_sphere(3, .1);
      expect_as(whole, conditioned("chunks.obj",
                                   testing::bytes_of(testing::chunks_obj(whole, parts, decimals, random))));
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
  // Numbers of few digits or decimals are design.
  EXPECT_EQ(
      conditioned("box.obj", testing::bytes_of("v 0 0 0\nv 20000 0 0\nv 0 20000 0\nv 0 0 1\nv 20000 0 1\n"
                                               "v 0 20000 1\nf 1 2 3\nf 4 5 6\n"))
          .component_count,
      2u);
  EXPECT_EQ(conditioned("box.obj", testing::bytes_of("v 0 0 0\nv 2.5 0 0\nv 0 2.5 0\nv 0 0 0.1\nv 2.5 0 0.1\n"
                                                     "v 0 2.5 0.1\nf 1 2 3\nf 4 5 6\n"))
                .component_count,
            2u);
}

// At a border that is joined, a seam of the picture or a crease stays one.
TEST(ImportGltfChunksTest, SeamsAndCreasesAtBordersStay) {
  const auto halves = [](Vec2f uv, Vec3f normal) {
    Mesh m = testing::bare_mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1e-7f, 0}, {1, 1, 0}, {1e-7f, 1, 0}},
                                {{0, 1, 2}, {3, 4, 5}});
    m.rounding = {1e-7f};
    m.uv0 = {{0, 0}, {1, 0}, {0, 1}, uv, {1, 1}, {uv.y, uv.x}};
    m.normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, normal, {0, 0, 1}, normal};
    const ConditionedMesh c = condition_mesh(m, true, {}, RunContext{});
    EXPECT_EQ(c.mesh.positions.size(), 4u);
    return c.mesh.wedge_count();
  };
  const Vec3f up{0, 0, 1};
  EXPECT_EQ(halves({1, 0}, up), 4u);
  EXPECT_EQ(halves({1 - 0x1p-13f, 0}, up), 4u);
  EXPECT_EQ(halves({1 - 0x1p-11f, 0}, up), 6u);
  EXPECT_EQ(halves({1, 0}, {0, .01f, 1}), 4u);
  EXPECT_EQ(halves({1, 0}, {0, .03f, 1}), 6u);
}

}  // namespace texmesh::import_gltf_chunks_test
