// The vertex-split stream of real scans: after every block the mesh is sound, at every scale it has its
// triangles. Open borders and several materials, a fragmented atlas with non-manifold edges, an atlas of
// scraps. Skipped where the data folder (TEXMESH_DATA, or shared/data beside the source tree) is not there;
// the larger ones with TEXMESH_FULL=1 only.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "format/split/split_reader.h"
#include "format/split/split_writer.h"
#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "stages/gltf/scale_codecs.h"
#include "stages/scales/vertex_split.h"
#include "tests/format/split/split_fixture.h"
#include "tests/stages/simplification/simplification_checks.h"

namespace texmesh::testing::stream_real_test {
namespace fs = std::filesystem;

fs::path data_folder() {
  if (const char* folder = std::getenv("TEXMESH_DATA")) return folder;
  return fs::path(TEXMESH_SOURCE_DIR) / "../shared/data";
}

NestedScales scales_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  const std::vector<char> text{std::istreambuf_iterator<char>(in), {}};
  const std::vector<std::uint8_t> bytes(text.begin(), text.end());
  FileResolver resolver(path.parent_path());
  const Mesh mesh = import_model(path.filename(), bytes, resolver, {}, kOneThread).model.mesh;
  return run(condition_mesh(mesh, true, {}, kOneThread), {.min_triangles = 100}, 6);
}

VertexSplitCoding coding_of(const Mesh& mesh) {
  VertexSplitCoding coding;
  const ScalesOptions options;
  coding.position = position_grid(mesh, options, 24);
  if (!mesh.uv0.empty()) coding.uv[0] = uv_grid(mesh.uv0, 2048, options, 24);
  coding.colour_bits = mesh.colours.empty() ? 0 : 8;
  return coding;
}

using Places = std::vector<std::array<SplitMesh::Point, 3>>;
Places shown(Places triangles) {
  std::erase_if(triangles, [](const auto& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
  for (auto& t : triangles) std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  std::sort(triangles.begin(), triangles.end());
  return triangles;
}
Places places_of(const Mesh& mesh, const NestedScale& scale, const QuantisationGrid& grid) {
  Places list(scale.triangles.size());
  for (std::size_t i = 0; i < list.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k)
      for (int axis = 0; axis < 3; ++axis)
        list[i][k][static_cast<std::size_t>(axis)] = static_cast<std::int32_t>(
            grid.index(mesh.positions[mesh.wedge_position[scale.triangles[i][k]]][axis], axis));
  return shown(std::move(list));
}
Places places_of(const SplitMesh& mesh) {
  Places list(mesh.face_count());
  for (std::uint32_t f = 0; f < list.size(); ++f)
    for (std::uint32_t k = 0; k < 3; ++k) list[f][k] = mesh.points()[mesh.point_at(f, k)];
  return shown(std::move(list));
}

void expect_sound_block(const SplitMesh& mesh, const SplitEdges& most, std::size_t block) {
  for (std::uint32_t f = 0; f < mesh.face_count(); ++f)
    for (std::uint32_t k = 0; k < 3; ++k) {
      ASSERT_LT(mesh.point_at(f, k), mesh.points().size());
      ASSERT_NE(mesh.point_at(f, k), mesh.point_at(f, k + 1));
    }
  const SplitEdges edges = count_split_edges(mesh);
  EXPECT_LE(edges.border, most.border) << "block " << block;
  EXPECT_LE(edges.non_manifold, most.non_manifold) << "block " << block;
}

void expect_stream(const char* file, bool large) {
  const fs::path path = data_folder() / file;
  if (!fs::exists(path)) GTEST_SKIP() << "no real scan at " << path;
  if (large && !std::getenv("TEXMESH_FULL")) GTEST_SKIP() << "needs TEXMESH_FULL=1";
  const NestedScales scales = scales_of(path);
  const VertexSplitCoding coding = coding_of(scales.mesh);
  std::vector<std::size_t> kept;
  for (std::size_t k = 0; k < scales.scales.size(); ++k) kept.push_back(k);
  ASSERT_GE(kept.size(), 3u);
  const auto stream = write_split_stream(make_vertex_splits(scales, kept, coding, kOneThread));
  const SplitStreamHead head = read_split_head(stream);
  SplitStreamReader whole(head), reader(head);
  whole.read_to_scale(kept.size() - 1, stream);
  const SplitEdges most = count_split_edges(whole.mesh());
  std::size_t scale = 0;
  for (std::size_t i = 0; i < head.blocks.size(); ++i) {
    reader.add_block(std::span(stream).subspan(head.blocks[i].offset, head.blocks[i].bytes()));
    expect_sound_block(reader.mesh(), most, i);
    if (i + 1 != head.scales[scale].blocks) continue;
    const NestedScale& expected = scales.scales[kept.size() - 1 - scale];
    EXPECT_TRUE(places_of(reader.mesh()) == places_of(scales.mesh, expected, coding.position))
        << "scale " << expected.scale;
    ++scale;
  }
  EXPECT_EQ(scale, kept.size());
}

TEST(StreamOfRealScans, Site) { expect_stream("realitycapture_site/site.glb", false); }
TEST(StreamOfRealScans, Yurt) { expect_stream("yurt/yurt.glb", false); }
TEST(StreamOfRealScans, FlightHelmet) { expect_stream("flight_helmet/FlightHelmet.gltf", true); }
TEST(StreamOfRealScans, Saxophone) { expect_stream("saxophone/saxophone.glb", true); }

}  // namespace texmesh::testing::stream_real_test
