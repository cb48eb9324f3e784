// Models that coarse meshes with an atlas of their own are hard to make of: each has a proxy of every size or
// a note why not, and a package that verifies.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>

#include "tests/support/gltf_builder.h"
#include "tests/support/hostile_meshes.h"
#include "tests/support/images.h"
#include "tests/support/meshes.h"
#include "tests/support/small_builds.h"

namespace texmesh::testing::command_compile_proxies_test {

using Json = nlohmann::json;

Json textured_material(int texture = 0) {
  return {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", texture}}}, {"metallicFactor", 0}}}};
}

/// Primitives of one mesh, each with a material of its own, as a GLB.
class Model {
 public:
  explicit Model(int images = 1, int side_px = 64) {
    for (int i = 0; i < images; ++i) {
      const std::vector<std::uint8_t> png = png_bytes(side_px + i % 7, side_px, 4);
      builder_.push("images", {{"bufferView", builder_.view_of(png)}, {"mimeType", "image/png"}});
      builder_.push("textures", {{"source", i}});
    }
  }
  Model& add(const Mesh& mesh, const Json& material, bool coordinates = true) {
    std::vector<float> positions, uvs;
    for (std::size_t w = 0; w < mesh.wedge_position.size(); ++w) {
      const Vec3f& p = mesh.positions[mesh.wedge_position[w]];
      positions.insert(positions.end(), {p.x, p.y, p.z});
      if (coordinates) uvs.insert(uvs.end(), {mesh.uv0[w].x, mesh.uv0[w].y});
    }
    std::vector<std::uint32_t> indices;
    for (const Triangle& t : mesh.triangles) indices.insert(indices.end(), t.begin(), t.end());
    Json attributes{{"POSITION", builder_.attribute(positions, "VEC3")}};
    if (coordinates) attributes["TEXCOORD_0"] = builder_.attribute(uvs, "VEC2");
    primitives_.push_back({{"attributes", attributes},
                           {"indices", builder_.attribute(indices, "SCALAR")},
                           {"material", builder_.push("materials", material)}});
    return *this;
  }
  Bytes glb() {
    builder_.push("meshes", {{"primitives", primitives_}});
    builder_.node({{"mesh", 0}});
    builder_.json["extensionsUsed"] = {"KHR_materials_unlit"};
    return builder_.glb();
  }

 private:
  GltfBuilder builder_;
  Json primitives_ = Json::array();
};

Mesh changed(Mesh mesh, const std::function<void(Mesh&)>& change) {
  change(mesh);
  return mesh;
}

Mesh sphere_mesh() { return bumpy_sphere(30, 60); }

Model open_sheets() {
  Model out;
  for (int i = 0; i < 5; ++i)
    out.add(changed(sheet(30),
                    [&](Mesh& m) {
                      for (Vec3f& p : m.positions) p.z += 0.3f * static_cast<float>(i);
                    }),
            textured_material());
  return out;
}

Model inside_out_parts() {
  const Mesh some_turned = changed(sphere_mesh(), [](Mesh& m) {
    for (std::size_t t = 0; t < m.triangles.size(); t += 3) std::swap(m.triangles[t][1], m.triangles[t][2]);
  });
  return Model().add(side_by_side({some_turned, inside_out(bumpy_sphere(20, 40))}), textured_material());
}

Model leaves(const char* mode) {
  std::vector<Mesh> sheets;
  for (int i = 0; i < 600; ++i)
    sheets.push_back(changed(sheet(1, 0.1f), [&](Mesh& m) {
      for (Vec3f& p : m.positions)
        p = i % 3 == 0 ? p : i % 3 == 1 ? Vec3f{p.z, p.x, p.y} : Vec3f{p.y, p.z, p.x};
    }));
  Json material = textured_material();
  material["alphaMode"] = mode;
  material["doubleSided"] = true;
  return Model().add(side_by_side(sheets, -0.9f), material);
}

Model many_materials() {
  constexpr std::size_t kCount = 220;
  Model out(static_cast<int>(kCount), 16);
  const Mesh all = sphere_mesh();
  for (std::size_t i = 0; i < kCount; ++i) {
    Mesh part = all;
    part.triangles.assign(
        all.triangles.begin() + static_cast<std::ptrdiff_t>(i * all.triangles.size() / kCount),
        all.triangles.begin() + static_cast<std::ptrdiff_t>((i + 1) * all.triangles.size() / kCount));
    Json material = textured_material(static_cast<int>(i));
    material["doubleSided"] = i % 3 == 0;
    material["alphaMode"] = i % 7 == 0 ? "BLEND" : i % 11 == 0 ? "MASK" : "OPAQUE";
    if (i % 5 == 0) material["extensions"]["KHR_materials_unlit"] = Json::object();
    out.add(part, material);
  }
  return out;
}

Model one_triangle() {
  Mesh mesh = bare_mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
  mesh.uv0 = {{0, 0}, {1, 0}, {0, 1}};
  return Model().add(mesh, textured_material());
}

struct BadInput {
  const char* name;
  std::function<Model()> model;
};

class BadInputForProxies : public ::testing::TestWithParam<BadInput> {
 protected:
  /// Notes that say that a size has no proxy, and proxies: one for each size.
  void expect_each_size_decided(const std::string& mode) {
    const std::string package = folder_ / (mode + ".texmesh");
    const CommandResult made = run_command({TEXMESH_BINARY, "compile", folder_ / "m.glb", "-o", package,
                                            "--no-cache", "-v", "--profile", folder_ / "profile.json",
                                            "--proxies.mode", mode, "--proxies.sizes", "8000,32000"});
    ASSERT_EQ(made.exit_code, 0) << made.output << made.errors;
    std::size_t notes = 0;
    for (std::size_t at = 0; (at = made.output.find("note: no-proxy: ", at)) != std::string::npos; ++at)
      ++notes;
    const CommandResult dumped = run_command({TEXMESH_BINARY, "dump", package, "--json"});
    ASSERT_EQ(dumped.exit_code, 0) << dumped.errors;
    const std::size_t proxies = Json::parse(dumped.output)["proxies"].size();
    EXPECT_EQ(proxies + notes, 2u) << mode << ": " << made.output;
    if (mode == "always") EXPECT_GE(proxies, 1u) << made.output;
    EXPECT_EQ(run_command({TEXMESH_BINARY, "verify", package}).exit_code, 0);
    for (std::size_t k = 0; mode == "always" && k < proxies; ++k) expect_shown(package, std::to_string(k));
  }

  /// The file of a proxy is one that we read, and it shows something.
  void expect_shown(const std::string& package, const std::string& proxy) {
    const std::string glb = folder_ / "p.glb";
    ASSERT_EQ(run_command({TEXMESH_BINARY, "extract", package, "--proxy", proxy, "-o", glb}).exit_code, 0);
    const CommandResult shown =
        run_command({TEXMESH_BINARY, "render", glb, "--size", "64", "-o", folder_ / "p.png", "--json"});
    ASSERT_EQ(shown.exit_code, 0) << shown.output << shown.errors;
    EXPECT_GT(Json::parse(shown.output)["views"][0]["covered_px"], 0) << shown.output;
  }

  TemporaryFolder folder_;
};

TEST_P(BadInputForProxies, HasAProxyOrANoteAndNeverFails) {
  const Bytes glb = GetParam().model().glb();
  write_text(folder_ / "m.glb", {glb.begin(), glb.end()});
  write_text(folder_ / "profile.json", kCheapProfile);
  expect_each_size_decided("always");
  expect_each_size_decided("auto");
}

INSTANTIATE_TEST_SUITE_P(
    All, BadInputForProxies,
    ::testing::Values(
        BadInput{"OpenSheets", open_sheets},
        BadInput{
            "ThousandsOfComponents",
            [] { return Model().add(side_by_side(std::vector<Mesh>(2000, cube())), textured_material()); }},
        BadInput{"PartsInsideOut", inside_out_parts},
        BadInput{"CoordinatesWithoutArea",
                 [] {
                   return Model().add(changed(sphere_mesh(),
                                              [](Mesh& m) {
                                                for (Vec2f& uv : m.uv0) uv = {0.5f, 0.5f};
                                              }),
                                      textured_material());
                 }},
        BadInput{"NoCoordinatesInOneMaterial",
                 [] {
                   return Model()
                       .add(sphere_mesh(), textured_material())
                       .add(changed(sphere_mesh(),
                                    [](Mesh& m) {
                                      for (Vec3f& p : m.positions) p.x += 3;
                                    }),
                            {{"pbrMetallicRoughness", {{"baseColorFactor", {0.3, 0.7, 0.2, 1}}}}}, false);
                 }},
        BadInput{"BlendedLeaves", [] { return leaves("BLEND"); }},
        BadInput{"MaskedLeaves", [] { return leaves("MASK"); }},
        BadInput{"FarAway",
                 [] {
                   return Model().add(changed(sphere_mesh(),
                                              [](Mesh& m) {
                                                for (Vec3f& p : m.positions)
                                                  p = p * 1000.0f + Vec3f{1e7f, 1e7f, -1e7f};
                                              }),
                                      textured_material());
                 }},
        BadInput{"Huge",
                 [] {
                   return Model().add(changed(sphere_mesh(),
                                              [](Mesh& m) {
                                                for (Vec3f& p : m.positions) p = p * 1e7f;
                                              }),
                                      textured_material());
                 }},
        BadInput{"OneTriangle", one_triangle}, BadInput{"ManyMaterials", many_materials}),
    [](const auto& one) { return std::string(one.param.name); });

}  // namespace texmesh::testing::command_compile_proxies_test
