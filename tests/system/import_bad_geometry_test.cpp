// Geometry that is wrong, or meant to be, through the whole graph: a package comes out that verifies, and no
// scale of it, as a client reads it, has more cracks or edges of three faces than the input.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>

#include "delivery/cpp/package/package_reader.h"
#include "pipeline/compile/compile_model.h"
#include "tests/support/command.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/hostile_meshes.h"
#include "tests/support/packages.h"
#include "tools/extract/glb/standalone_glb.h"
#include "tools/inspect/verify/verify.h"

namespace texmesh::testing::import_bad_geometry_test {

struct EdgeCounts {
  std::size_t border = 0, non_manifold = 0;
};

/// Of the surface welded by coordinates.
EdgeCounts count_edges(const Mesh& m) {
  std::map<std::array<float, 3>, std::uint32_t> places;
  std::vector<std::uint32_t> place;
  for (Vec3f p : m.positions)
    place.push_back(
        places.try_emplace({p.x, p.y, p.z}, static_cast<std::uint32_t>(places.size())).first->second);
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> faces;
  for (std::uint32_t t = 0; t < m.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k)
      ++faces[std::minmax(place[m.position_of(t, k)], place[m.position_of(t, (k + 1) % 3)])];
  EdgeCounts counts;
  for (const auto& [edge, n] : faces) {
    if (n == 1) ++counts.border;
    if (n > 2) ++counts.non_manifold;
  }
  return counts;
}

class BadGeometry : public ::testing::Test {
 protected:
  /// Compiles with positions as they are and with quantised ones; the first scales of both.
  std::vector<Mesh> compile(const Mesh& mesh) {
    const Bytes glb = make_glb(mesh, {}).glb();
    std::vector<Mesh> finest;
    for (MeshCodec codec : {MeshCodec::kNone, MeshCodec::kDraco}) {
      SCOPED_TRACE(std::string(enum_name(codec)));
      write_text(folder_ / "m.glb", {glb.begin(), glb.end()});
      CompileRequest request;
      request.input = folder_ / "m.glb";
      request.output = folder_ / "m.texmesh";
      CompileOptions& o = request.options;
      o.scales.mesh_codec = codec;
      o.scales.position_bits = position_bits_;
      o.skeletonization.alpha_divisor = 10, o.skeletonization.max_wrap_faces = 500;
      o.quality.views = 1, o.quality.largest_px = 128, o.quality.rung_samples = 1;
      NullStore store;
      RunContext context;
      context.threads = 2;
      notes_ = compile_model(request, store, context, {}).notes;
      const auto package = open_store(request.output);
      for (const Finding& f : verify_package(*package, context).findings) ADD_FAILURE() << to_string(f);
      PackageReader reader(open_store(request.output));
      scales_ = reader.manifest().scales.size();
      Mesh first;
      for (const ManifestScale& scale : reader.manifest().scales) {
        MemoryResolver nothing;
        Mesh read = import_model("scale.glb", scale_file(reader, scale.scale, {}).finish(), nothing, {}, {})
                        .model.mesh;
        EXPECT_EQ(read.triangles.size(), scale.triangles);
        if (first.triangles.empty()) first = read;
        if (codec == MeshCodec::kNone) expect_no_more_cracks(first, read, scale.scale);
      }
      finest.push_back(std::move(first));
    }
    return finest;
  }
  bool warned(const std::string& code) const {
    return std::any_of(notes_.begin(), notes_.end(), [&](const Note& n) { return n.code == code; });
  }
  int position_bits_ = 0;
  std::size_t scales_ = 0;  // of the last package
  Notes notes_;

 private:
  void expect_no_more_cracks(const Mesh& finest, const Mesh& read, int scale) {
    const EdgeCounts most = count_edges(finest), here = count_edges(read);
    EXPECT_LE(here.border, most.border) << "scale " << scale;
    EXPECT_LE(here.non_manifold, most.non_manifold) << "scale " << scale;
  }
  TemporaryFolder folder_;
};

/// The files of this test have UVs.
Mesh with_uvs(Mesh m) {
  m.uv0.assign(m.positions.size(), {});
  return m;
}
Mesh bare(std::vector<Vec3f> positions, std::vector<Triangle> triangles) {
  return with_uvs(bare_mesh(std::move(positions), std::move(triangles)));
}

TEST_F(BadGeometry, SliversOfNextToNoArea) {
  const Mesh m = sliver_sheet(24);
  const std::vector<Mesh> finest = compile(m);
  EXPECT_EQ(finest[0].triangles.size(), m.triangles.size());
  EXPECT_GT(scales_, 1u);
}

/// On a coarse grid most faces of the stream show nothing, and the files have none of them.
TEST_F(BadGeometry, GridsOfFewBits) {
  const Mesh m = sliver_sheet(48);
  for (const int bits : {1, 6, 7}) {
    position_bits_ = bits;
    SCOPED_TRACE(position_bits_);
    compile(m);
    EXPECT_TRUE(warned("flattened-triangles"));
  }
}

TEST_F(BadGeometry, AStrayTriangleFarFromTheScan) {
  for (float away : {1e3f, 1e5f}) {
    SCOPED_TRACE(away);
    Mesh stray = bare({{0, 0, 0}, {0.1f, 0, 0}, {0, 0.1f, 0}}, {{0, 1, 2}});
    Mesh scan = bumpy_sphere(24, 36);
    stray.normals.assign(3, {0, 0, 1});
    compile(side_by_side({scan, stray}, away));
    EXPECT_TRUE(warned("far-outliers"));
  }
  compile(bare({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1e5f, 0, 0}, {1e5f + 1, 0, 0}, {1e5f, 1, 0}},
               {{0, 1, 2}, {3, 4, 5}}));
  EXPECT_TRUE(warned("quality-not-measured"));
}

TEST_F(BadGeometry, FacesTwiceOver) {
  const Mesh once = bumpy_sphere(20, 30);
  Mesh twice = once;
  twice.triangles.insert(twice.triangles.end(), once.triangles.begin(), once.triangles.end());
  EXPECT_EQ(compile(twice)[0].triangles.size(), once.triangles.size());
  EXPECT_TRUE(warned("duplicate-triangle"));
}

TEST_F(BadGeometry, InsideOutBesideRightWayRound) {
  const Mesh m = side_by_side({bumpy_sphere(16, 24), inside_out(bumpy_sphere(16, 24))});
  for (const Mesh& finest : compile(m)) {
    // Which way a surface faces is what a viewer sees: it stays.
    double inside = 0;
    for (std::uint32_t t = 0; t < finest.triangles.size(); ++t) {
      const auto at = [&](int k) { return to_double(finest.positions[finest.position_of(t, k)]); };
      inside += dot(at(0), cross(at(1), at(2)));
    }
    EXPECT_NEAR(inside, 0, 0.1);
  }
  EXPECT_GT(scales_, 2u);
}

TEST_F(BadGeometry, OneTriangle) {
  for (float size : {1e-20f, 1e-3f, 1.0f, 1e15f}) {
    SCOPED_TRACE(size);
    const std::vector<Mesh> finest = compile(bare({{0, 0, 0}, {size, 0, 0}, {0, size, 0}}, {{0, 1, 2}}));
    EXPECT_EQ(scales_, 1u);
    for (const Mesh& m : finest)
      for (std::size_t p = 0; p < 3; ++p) {
        const Vec3d at = to_double(m.positions[p]) + m.origin;
        EXPECT_LE(std::max({std::fabs(at.x), std::fabs(at.y), std::fabs(at.z)}), 1.01 * size);
      }
  }
}

TEST_F(BadGeometry, ComponentsOfOneTriangle) {
  const int count = std::getenv("TEXMESH_FULL") ? 1'000'000 : 5'000;
  EXPECT_EQ(compile(with_uvs(dust(count, 0.001f)))[0].triangles.size(), static_cast<std::size_t>(count));
  EXPECT_GE(scales_, 2u);
}

TEST_F(BadGeometry, SheetsThatLieOnThemselves) {
  // What CGAL's contraction does not end on: sheets folded onto themselves many times over, both sides at
  // once.
  Mesh m = sheet(30, 0);
  for (Vec3f& p : m.positions) {
    const float folded = std::fabs(std::remainder(p.x * 4, 2.0f));
    p = {folded, p.y, 0};
  }
  compile(m);
  EXPECT_GE(scales_, 1u);
}

}  // namespace texmesh::testing::import_bad_geometry_test
