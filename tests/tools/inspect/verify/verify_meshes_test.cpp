// One broken package per rule, caught by that rule: meshes and images.
#include <gtest/gtest.h>

#include <algorithm>

#include "format/container/layout.h"
#include "stages/data/fragments.h"
#include "tests/support/images.h"
#include "tests/tools/inspect/verify/verify_support.h"

namespace texmesh::verify_meshes_test {

// Meshes

TEST(VerifyMeshes, MeshesAgainstManifest) {
  EXPECT_TRUE(catches_only(sealed_with([](Manifest& m) { m.scales[1].triangles -= 1; }), "mesh-counts",
                           mesh_path(5)));
  EXPECT_TRUE(
      catches_only(sealed_with([](Manifest& m) { m.scales[0].vertices += 1; }), "mesh-counts", mesh_path(0)));
  EXPECT_TRUE(catches(sealed_with([](Manifest& m) { m.bounds_max.x = 0.5; }), "mesh-bounds", mesh_path(0)));
  EXPECT_TRUE(catches(
      built_with([](PackageParts& p) { p.meshes[0] = testing::make_glb(testing::fine_mesh(), {}).glb(); }),
      "mesh-images", mesh_path(0)));
  EXPECT_TRUE(catches_only(built_with([](PackageParts& p) {
                             GlbParts g =
                                 testing::make_glb(testing::coarse_mesh(), p.streams[preview_path(0)]);
                             g.json["images"][0]["name"] = "texture/7";
                             p.meshes[5] = g.glb();
                           }),
                           "mesh-images", mesh_path(5)));
  EXPECT_TRUE(catches_only(built_with([](PackageParts& p) { p.meshes[5].back() ^= 1, p.meshes[5][8] ^= 4; }),
                           "glb-container", mesh_path(5)));
}

TEST(VerifyMeshes, PreviewsInMeshes) {
  const auto with_meshes = [](bool finest_names, bool coarsest_names, std::uint8_t change) {
    return built_with([&](PackageParts& p) {
      Bytes preview = p.streams[preview_path(0)];
      GlbParts fine = testing::make_glb(testing::fine_mesh(), preview);
      preview[preview.size() / 2] ^= change;
      GlbParts coarse = testing::make_glb(testing::coarse_mesh(), preview);
      if (finest_names) testing::name_previews(fine);
      if (coarsest_names) testing::name_previews(coarse);
      p.meshes[0] = fine.glb(), p.meshes[5] = coarse.glb();
    });
  };
  EXPECT_EQ(all_of(verify(with_meshes(true, false, 0))), "");
  EXPECT_TRUE(catches_only(with_meshes(false, false, 0), "mesh-images", mesh_path(0)));
  EXPECT_TRUE(catches_only(with_meshes(true, true, 0), "mesh-images", mesh_path(5)));
  EXPECT_TRUE(catches_only(with_meshes(true, false, 1), "mesh-images", mesh_path(5)));
}

TEST(VerifyMeshes, NestedMeshes) {
  EXPECT_TRUE(catches_only(built_with([](PackageParts& p) {
                             Mesh moved = testing::coarse_mesh();
                             moved.positions[9].x *= 1.0001f;
                             p.meshes[5] = testing::make_glb(moved, p.streams[preview_path(0)]).glb();
                           }),
                           "mesh-nested", mesh_path(5)));
}

// Images

TEST(VerifyMeshes, Preview) {
  EXPECT_TRUE(catches(built_with([](PackageParts& p) { p.streams[preview_path(0)].resize(40); }), "preview",
                      preview_path(0)));
  EXPECT_TRUE(catches_only(built_with([](PackageParts& p) { p.textures[0].preview_width_px += 1; }),
                           "preview", preview_path(0)));
}

TEST(VerifyMeshes, TableStreams) {
  EXPECT_TRUE(catches(built_with([](PackageParts& p) { p.streams[table_streams_path(0)][1] = 0xd9; }),
                      "table-stream", table_streams_path(0)));
}

TEST(VerifyMeshes, Fragments) {
  EXPECT_TRUE(catches_only(built_with([](PackageParts& p) { p.tables.planes[0].digest[2] ^= 1; }),
                           "fragment-digest", rung_path(0, 0)));
  const auto broken = [](const std::function<void(Bytes&)>& change) {
    return built_with(
        [&](PackageParts& p) {  // the first fragment of the lower rung, fragment 1, and a digest that fits it
          PlaneTables& t = p.tables.planes[0];
          Bytes& pack = p.streams[rung_path(0, 0)];
          const auto end = pack.begin() + static_cast<std::ptrdiff_t>(t.size_bytes[1]);
          Bytes stream(pack.begin(), end);
          change(stream);
          std::copy(stream.begin(), stream.end(), pack.begin());
          t.digest[1] = truncated(sha256(stream));
        });
  };
  EXPECT_TRUE(catches_only(broken([](Bytes& b) { b[0] = 0; }), "fragment-decode", rung_path(0, 0)));
  EXPECT_TRUE(
      catches_only(broken([](Bytes& b) { b[b.size() - 2] = 0; }), "fragment-decode", rung_path(0, 0)));
  EXPECT_TRUE(catches_only(built_with([](PackageParts& p) {
                             // Another height in the frame header that the lower rung's fragments share:
                             // SOF0, 2 bytes length, precision, height.
                             Bytes& b = p.streams[table_streams_path(0)];
                             for (std::size_t i = 0; i + 8 < p.tables.planes[0].table_bytes[0]; ++i)
                               if (b[i] == 0xff && b[i + 1] == 0xc0) b[i + 6] = 16;
                           }),
                           "fragment-decode", rung_path(0, 0)));
}

}  // namespace texmesh::verify_meshes_test
