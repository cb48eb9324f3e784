// The grid that positions and texture coordinates of all scales lie on.
#include "pipeline/import/import_images.h"
#include "tests/stages/scales/scales_checks.h"

namespace texmesh::scale_grid_test {

using namespace testing;  // NOLINT: fixtures and checks

TEST(Scales, HugeRangesOfTextureCoordinatesStayFine) {
  Mesh m = testing::bumpy_sphere(14, 20);
  for (std::size_t w = 0; w < m.wedge_count(); ++w)
    m.uv0[w] = {m.uv0[w].x + (w % 2 ? 1500.f : -700.f), m.uv0[w].y * 3};
  Case c(m);
  c.add_image(TextureRole::kBaseColour);
  c.materials[0].base_colour_texture.image = 0;
  for (MeshCodec codec : kCodecs) {
    SCOPED_TRACE(std::string(enum_name(codec)));
    Vec3d translation;
    double step = 1;
    std::multiset<float> want, got;
    for (std::uint32_t w = 0; w < c.scales.mesh.wedge_count(); ++w) want.insert(c.scales.mesh.uv0[w].y);
    const std::vector<Primitive> primitives = read(open(c.write(codec).files[0].glb), translation, step);
    float worst = 0;
    for (const Primitive& p : primitives)
      for (const auto& uv : p.uv0) {
        auto near = want.lower_bound(uv[1]);
        float distance = near != want.end() ? *near - uv[1] : 9.f;
        if (near != want.begin()) distance = std::min(distance, uv[1] - *std::prev(near));
        worst = std::max(worst, distance);
      }
    EXPECT_LE(worst * 512, 0.5f);  // texels
  }
}

TEST(Scales, BitsFollowTheOptionsAndTheEdges) {
  const Case c(testing::bumpy_sphere(16, 24));
  const ScaleFiles automatic = c.write(MeshCodec::kDraco);
  EXPECT_EQ(automatic.position_bits, 16);
  EXPECT_EQ(automatic.uv_bits, 15);  // 1/8 texel of 4096
  const ScaleFiles by_edges = c.write(MeshCodec::kDraco, {.least_position_bits = 1, .least_uv_bits = 1});
  EXPECT_GE(by_edges.position_bits, 6);
  EXPECT_LE(by_edges.position_bits, 12);
  EXPECT_GT(by_edges.position_error, automatic.position_error);
  EXPECT_EQ(by_edges.uv_bits, 15);
  double mean = 0, count = 0;
  const Mesh& m = c.scales.mesh;
  for (const Triangle& t : m.triangles)
    for (std::size_t k = 0; k < 3; ++k)
      mean += length(m.positions[m.wedge_position[t[k]]] - m.positions[m.wedge_position[t[(k + 1) % 3]]]),
          ++count;
  EXPECT_LE(by_edges.position_error * 1.7321, mean / count / 4);
  EXPECT_GT(automatic.position_error, 0);
  ScalesOptions options;
  options.position_bits = 20, options.uv_bits = 15;
  const ScaleFiles asked = c.write(MeshCodec::kDraco, options);
  EXPECT_EQ(asked.position_bits, 20);
  EXPECT_EQ(asked.uv_bits, 15);
  EXPECT_LT(asked.position_error, automatic.position_error / 4);
  EXPECT_TRUE(asked.notes.empty());
  const ScaleFiles shorts = c.write(MeshCodec::kQuantized, options);
  EXPECT_EQ(shorts.position_bits, 16);
  ASSERT_EQ(shorts.notes.size(), 1u);
  EXPECT_EQ(shorts.notes[0].code, "fewer-bits");
  options.position_bits = 24, options.uv_bits = 24;
  expect_round_trip(c, MeshCodec::kDraco, options);
  EXPECT_EQ(c.write(MeshCodec::kNone).position_error, 0);
  EXPECT_EQ(c.write(MeshCodec::kNone).position_bits, 0);
}

TEST(Scales, SaysHowManyTrianglesTheGridFlattens) {
  const Case c(testing::bumpy_sphere(30, 44));
  const ScaleFiles fine = c.write(MeshCodec::kDraco, {.position_bits = 16});
  EXPECT_TRUE(fine.notes.empty());
  const ScaleFiles coarse = c.write(MeshCodec::kDraco, {.position_bits = 4});
  ASSERT_LT(coarse.files[0].triangles, fine.files[0].triangles);
  ASSERT_EQ(coarse.notes.size(), 1u);
  EXPECT_EQ(coarse.notes[0].code, "flattened-triangles");
  EXPECT_EQ(coarse.notes[0].severity, Severity::kWarning);
  const std::string count = std::to_string(fine.files[0].triangles - coarse.files[0].triangles);
  EXPECT_EQ(coarse.notes[0].text.find(count + " of "), 0u) << coarse.notes[0].text;
}

TEST(Scales, ASmallPartBesideALargeOneKeepsItsShape) {
  // As under nodes of different scales: few triangles, a hundredth of the size.
  Mesh small = testing::bumpy_sphere(8, 12);
  for (Vec3f& p : small.positions) p = p * 0.01f;
  Mesh m = testing::side_by_side({testing::bumpy_sphere(40, 60), small});
  const std::size_t first = m.triangles.size() - small.triangles.size();
  m.part_names = {"large", "small"};
  for (std::size_t t = 0; t < m.triangles.size(); ++t) m.triangle_part[t] = t >= first;
  const Case c(m, 1, 1);
  double edges = 0;
  for (const Triangle& t : small.triangles)
    edges +=
        length(small.positions[small.wedge_position[t[0]]] - small.positions[small.wedge_position[t[1]]]);
  for (MeshCodec codec : kCodecs) {
    SCOPED_TRACE(std::string(enum_name(codec)));
    const ScaleFiles files = c.write(codec);
    EXPECT_EQ(files.files[0].triangles, c.scales.scales[0].triangles.size());
    EXPECT_LE(files.position_error, edges / static_cast<double>(small.triangles.size()) / 8);
  }
}

TEST(Scales, TrianglesThatTheGridCollapsesAreDropped) {
  const Case c(testing::bumpy_sphere(40, 60), 1, 1);
  ScalesOptions options;
  options.position_bits = 4;
  for (MeshCodec codec : {MeshCodec::kDraco, MeshCodec::kMeshopt, MeshCodec::kQuantized}) {
    SCOPED_TRACE(std::string(enum_name(codec)));
    const ScaleFiles files = c.write(codec, options);
    EXPECT_LT(files.files[0].triangles, c.scales.scales[0].triangles.size());
    EXPECT_GT(files.files[0].triangles, 100u);
    Vec3d translation;
    double step = 1;
    for (const Primitive& p : read(open(files.files[0].glb), translation, step))
      for (std::size_t i = 0; i < p.indices.size(); i += 3) {
        EXPECT_NE(p.positions[p.indices[i]], p.positions[p.indices[i + 1]]);
        EXPECT_NE(p.positions[p.indices[i + 1]], p.positions[p.indices[i + 2]]);
        EXPECT_NE(p.positions[p.indices[i + 2]], p.positions[p.indices[i]]);
      }
  }
}

}  // namespace texmesh::scale_grid_test
