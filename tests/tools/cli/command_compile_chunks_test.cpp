// A surface that comes as chunks, each rounded in a way of its own, is shown as the whole is: no scale and no
// proxy gapes where chunks meet, and scales are as near to the surface. Chunks that were not rounded come to
// the whole's scales.
#include "pipeline/import/import.h"
#include "stages/geometry/distance.h"
#include "stages/geometry/mesh_topology.h"
#include "tests/support/chunks.h"
#include "tests/support/images.h"
#include "tests/support/memory_resolver.h"
#include "tests/support/small_builds.h"

namespace texmesh::testing::command_compile_chunks_test {

/// Edges of one triangle, between points that are not at the very same place.
std::size_t open_edges(const Mesh& mesh) {
  const std::vector<std::uint32_t> weld = weld_positions(mesh.positions, 0);
  std::vector<std::uint32_t> corners;
  for (const Triangle& t : mesh.triangles) {
    std::array<std::uint32_t, 3> p{};
    for (std::size_t k = 0; k < 3; ++k) p[k] = weld[mesh.wedge_position[t[k]]];
    if (p[0] != p[1] && p[1] != p[2] && p[2] != p[0]) corners.insert(corners.end(), p.begin(), p.end());
  }
  const EdgeTable edges = group_edges(corners, mesh.positions.size());
  std::size_t open = 0;
  for (std::size_t e = 0; e < edges.edge_count(); ++e) open += edges.edge(e).size() == 1;
  return open;
}

/// No more than this far from `mesh` are 95 of 100 points of the surface.
double p95(const Mesh& surface, const Mesh& mesh) {
  const SurfaceDistance distance(mesh.positions, mesh.wedge_position, mesh.triangles);
  std::vector<double> far;
  for (const SurfaceSample& s :
       sample_surface(surface.positions, surface.wedge_position, surface.triangles, 4000)) {
    Vec3d p;
    for (int k = 0; k < 3; ++k)
      p = p + to_double(surface.positions[surface.position_of(s.triangle, k)]) * s.weight[k];
    far.push_back(distance(p));
  }
  const auto at = far.begin() + static_cast<std::ptrdiff_t>(far.size() * 95 / 100);
  std::nth_element(far.begin(), at, far.end());
  return *at;
}

class Chunks : public ::testing::Test {
 protected:
  void SetUp() override {
    auto profile = nlohmann::json::parse(kCheapProfile);
    profile["scales"]["stream"] = true;
    profile["ssf"].erase("scales");
    profile["simplification"]["min_triangles"] = 100;
    write_text(folder_ / "profile.json", profile.dump());
  }

  nlohmann::json compile(const std::string& model) {
    package_ = folder_ / (model + ".texmesh");
    const CommandResult made =
        run_command({TEXMESH_BINARY, "compile", folder_ / model, "-o", package_, "--no-cache", "--profile",
                     folder_ / "profile.json", "--proxies.mode", "always", "--proxies.sizes", "12000"});
    EXPECT_EQ(made.exit_code, 0) << made.output << made.errors;
    EXPECT_EQ(made.output.find("rounded-position") != std::string::npos,
              model != "whole.glb" && model != "exact.glb")
        << made.output;
    const CommandResult dumped = run_command({TEXMESH_BINARY, "dump", package_, "--json"});
    return nlohmann::json::parse(dumped.output);
  }

  Mesh extract(const std::string& what, std::size_t number) {
    const std::string glb = folder_ / "x.glb";
    const CommandResult made =
        run_command({TEXMESH_BINARY, "extract", package_, what, std::to_string(number), "-o", glb});
    EXPECT_EQ(made.exit_code, 0) << made.output << made.errors;
    MemoryResolver files;
    return import_model("x.glb", bytes_of(read_text(glb)), files, {}, {}).model.mesh;
  }

  TemporaryFolder folder_;
  std::string package_;
};

TEST_F(Chunks, NoScaleAndNoProxyGapes) {
  const Mesh whole = textured_sphere(4, .1);
  const Bytes picture = png_bytes(64, 64, 3);
  Random random{5};
  const auto write = [&](const std::string& name, const Bytes& bytes) {
    write_text(folder_ / name, {bytes.begin(), bytes.end()});
  };
  constexpr std::uint32_t kParts = 7;
  write("whole.glb", chunks_glb(whole, 1, ChunkKind::kExact, random, picture));
  write("exact.glb", chunks_glb(whole, kParts, ChunkKind::kExact, random, picture));
  write("float.glb", chunks_glb(whole, kParts, ChunkKind::kFloat, random, picture));
  write("int16.glb", chunks_glb(whole, kParts, ChunkKind::kInt16, random, picture));
  write("draco.glb", chunks_glb(whole, kParts, ChunkKind::kDraco, random, picture));
  write_text(folder_ / "text.obj", chunks_obj(whole, kParts, 5, random));
  write_text(folder_ / "m.mtl", "newmtl m\nmap_Kd t.png\n");
  write("t.png", picture);
  std::map<std::size_t, double> triangles, far;  // of the scales of the whole
  for (const std::string model :
       {"whole.glb", "exact.glb", "float.glb", "int16.glb", "draco.glb", "text.obj"}) {
    SCOPED_TRACE(model);
    const nlohmann::json dump = compile(model);
    ASSERT_GE(dump["stream"].size(), 3u);
    double ratios = 0;
    for (const auto& scale : dump["stream"]) {
      const auto number = scale["scale"].get<std::size_t>();
      const Mesh mesh = extract("--scale", number);
      EXPECT_EQ(open_edges(mesh), 0u) << "scale " << number;
      const auto count = static_cast<double>(mesh.triangles.size());
      const double away = p95(whole, mesh);
      if (model == "whole.glb") triangles[number] = count, far[number] = away;
      EXPECT_NEAR(count, triangles.at(number), std::max(2., .01 * triangles[number])) << "scale " << number;
      if (number == 0) continue;  // has what rounding did, and no more
      EXPECT_LE(away, (model == "exact.glb" ? 1.0001 : 1.04) * far.at(number)) << "scale " << number;
      ratios += std::log(away / far[number]);
    }
    EXPECT_LE(ratios / static_cast<double>(dump["stream"].size() - 1), std::log(1.02));
    EXPECT_GE(dump["proxies"].size(), 1u);
    for (std::size_t p = 0; p < dump["proxies"].size(); ++p)
      EXPECT_EQ(open_edges(extract("--proxy", p)), 0u) << "proxy " << p;
  }
}

}  // namespace texmesh::testing::command_compile_chunks_test
