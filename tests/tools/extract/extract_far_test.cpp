// What import takes can be extracted: coordinates up to the largest that it takes, on grids whose places lie
// beyond.
#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/compile/compile_model.h"
#include "pipeline/import/mesh_builder.h"
#include "stages/gltf/check_glb.h"
#include "tests/support/command.h"
#include "tests/support/meshes.h"
#include "tests/support/packages.h"
#include "tools/extract/extract.h"
#include "tools/extract/package_model.h"
#include "tools/inspect/package_mesh.h"
#include "tools/inspect/verify/verify.h"

namespace texmesh::extract_far_test {

constexpr int kCells = 6;
constexpr std::uint64_t kTriangles = 2 * kCells * kCells;

/// A bumpy sheet that ends at `farthest` along x and y. The grid is that of the longest side, so it has no
/// place there along y, and the nearest one lies beyond.
Mesh far_sheet(float farthest) {
  Mesh m = testing::sheet(kCells);
  for (Vec3f& p : m.positions)
    p = {p.x == 1 ? farthest : (1.6f * p.x - 0.6f) * farthest,
         p.y == 1 ? farthest : (0.701f * p.y + 0.299f) * farthest, p.z * farthest};
  m.normals.clear();
  return m;
}

class ExtractFar : public ::testing::TestWithParam<float> {
 protected:
  void compile(MeshCodec codec, int position_bits) {
    const Bytes glb = testing::make_glb(far_sheet(GetParam()), {}).glb();
    testing::write_text(folder_ / "a.glb", {glb.begin(), glb.end()});
    CompileRequest request;
    request.input = folder_ / "a.glb";
    request.output = folder_ / "a.texmesh";
    request.options.quality = {1, 32, 1};
    request.options.scales.mesh_codec = codec;
    request.options.scales.position_bits = position_bits;
    NullStore store;
    for (const Note& n : compile_model(request, store, {}, {}).notes)
      EXPECT_NE(n.code, "non-finite-position") << n.text;
    const auto package = open_store(request.output);
    for (const Finding& f : verify_package(*package, {}).findings) ADD_FAILURE() << to_string(f);
  }
  GlbFacts extract(const ExtractRequest& request) {
    PackageReader package(open_store(folder_ / "a.texmesh"));
    const Extracted e = extract_model(package, request, {});
    Findings findings;
    const GlbFacts facts = check_glb(e.glb, "x.glb", findings, GlbRules::kStandalone);
    for (const Finding& f : findings.list()) ADD_FAILURE() << to_string(f);
    return facts;
  }
  testing::TemporaryFolder folder_;
};

TEST_P(ExtractFar, EveryTriangleIsExtracted) {
  for (const auto& [codec, bits] : {std::pair{MeshCodec::kNone, 0}, {MeshCodec::kDraco, 8}}) {
    SCOPED_TRACE(enum_name(codec));
    compile(codec, bits);
    ExtractScale scale;
    scale.scale = 0;
    const GlbFacts whole = extract({scale});
    EXPECT_EQ(whole.triangles, kTriangles);
    if (bits) EXPECT_GT(whole.bounds_max.y, kLargestCoordinate) << "the test's mesh tests nothing";
    scale.form = ExtractScale::Form::kPlain;
    EXPECT_EQ(extract({scale}).triangles, kTriangles);
    ExtractBudget budget;
    budget.bytes = {10'000'000};
    budget.display_px = 64;
    EXPECT_EQ(extract({budget}).triangles, kTriangles);
    PackageReader package(open_store(folder_ / "a.texmesh"));
    EXPECT_EQ(bare_scale(package, 0, {}).mesh.triangles.size(), kTriangles);
    EXPECT_EQ(finest_scale(package, {}).model.mesh.triangles.size(), kTriangles);
  }
}

const float kAt = static_cast<float>(kLargestCoordinate);  // rounded down, so not beyond
INSTANTIATE_TEST_SUITE_P(Bounds, ExtractFar, ::testing::Values(kAt, std::nextafter(kAt, 0.0f)));

}  // namespace texmesh::extract_far_test
