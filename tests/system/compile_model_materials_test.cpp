// Every kind of material and set of textures compiles into a package that verify passes, with a quality table
// whose rungs are those of its planes.
#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>

#include "delivery/cpp/package/package_reader.h"
#include "format/container/container.h"
#include "format/rules/picture_prediction.h"
#include "pipeline/compile/compile_model.h"
#include "tests/support/command.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/images.h"
#include "tests/support/wide_jpeg.h"
#include "tools/inspect/verify/verify.h"

namespace texmesh::compile_model_materials_test {

using Json = nlohmann::json;
using testing::GltfBuilder;

constexpr int kQuads = 6;

/// A bumpy sheet with both sets of texture coordinates.
GltfBuilder sheet() {
  GltfBuilder b;
  std::vector<float> positions, uv0, uv1;
  std::vector<std::uint16_t> indices;
  for (int y = 0; y <= kQuads; ++y)
    for (int x = 0; x <= kQuads; ++x) {
      const float u = static_cast<float>(x) / kQuads, v = static_cast<float>(y) / kQuads;
      positions.insert(positions.end(), {static_cast<float>(x), static_cast<float>(y),
                                         0.25f * static_cast<float>((x * 7 + y * 5) % 4)});
      uv0.insert(uv0.end(), {u, v});
      uv1.insert(uv1.end(), {v, 0.5f * u});
    }
  for (int y = 0; y < kQuads; ++y)
    for (int x = 0; x < kQuads; ++x) {
      const int a = y * (kQuads + 1) + x, c = a + kQuads + 1;
      for (const int i : {a, a + 1, c + 1, a, c + 1, c}) indices.push_back(static_cast<std::uint16_t>(i));
    }
  const Json bounds = {{"min", {0, 0, 0}}, {"max", {kQuads, kQuads, 1}}};
  b.mesh({{"POSITION", b.attribute(positions, "VEC3", bounds)},
          {"TEXCOORD_0", b.attribute(uv0, "VEC2")},
          {"TEXCOORD_1", b.attribute(uv1, "VEC2")}},
         {{"indices", b.attribute(indices, "SCALAR")}});
  b.node({{"mesh", 0}, {"name", "sheet"}});
  return b;
}

Json& primitive(GltfBuilder& b, std::size_t mesh = 0) { return b.json["meshes"][mesh]["primitives"][0]; }

std::size_t vertices(GltfBuilder& b) {
  return b.json["accessors"][primitive(b)["attributes"]["POSITION"].get<std::size_t>()]["count"];
}

Json texture_of(GltfBuilder& b, const Bytes& file, const char* mime) {
  const int image = b.push("images", {{"bufferView", b.view_of(file)}, {"mimeType", mime}});
  return {{"index", b.push("textures", {{"source", image}})}};
}

/// A reference to a new texture of that side, smooth with a grid of dots. Its content differs from call to
/// call.
Json texture(GltfBuilder& b, int channels, int side_px = 48) {
  std::vector<std::uint8_t> samples;
  for (int y = 0; y < side_px; ++y)
    for (int x = 0; x < side_px; ++x)
      for (int c = 0; c < channels; ++c)
        samples.push_back(
            static_cast<std::uint8_t>(60 + 2 * x + y + 10 * c + (x % 8 == 3 && y % 8 == 3 ? 20 : 0)));
  samples[0] = static_cast<std::uint8_t>(b.bin.size() % 251);
  return texture_of(b,
                    testing::encode_image("png", side_px, side_px, channels, samples, OIIO::TypeDesc::UINT8),
                    "image/png");
}

/// Gives the first mesh a material.
void use(GltfBuilder& b, const Json& material) { primitive(b)["material"] = b.push("materials", material); }

Json coloured(const Json& texture) { return {{"pbrMetallicRoughness", {{"baseColorTexture", texture}}}}; }

Json full_material(GltfBuilder& b, int side_px = 48) {
  Json m = coloured(texture(b, 3, side_px));
  m["pbrMetallicRoughness"]["metallicRoughnessTexture"] = texture(b, 3, side_px);
  m["normalTexture"] = texture(b, 3, side_px);
  m["occlusionTexture"] = texture(b, 1, side_px);
  return m;
}

/// The same with an alpha channel, and an emission.
Json blended_material(GltfBuilder& b, int side_px = 48) {
  Json m = full_material(b, side_px);
  m["pbrMetallicRoughness"]["baseColorTexture"] = texture(b, 4, side_px);
  m["alphaMode"] = "BLEND";
  m["emissiveTexture"] = texture(b, 3, side_px);
  m["emissiveFactor"] = {0.5, 0.5, 0.5};
  return m;
}

struct Kind {
  std::string name;
  std::function<void(GltfBuilder&)> change;
};

const std::vector<Kind> kKinds{
    {"none", [](GltfBuilder&) {}},
    {"normal only",
     [](GltfBuilder& b) {
       use(b, {{"normalTexture", texture(b, 3)}});
     }},
    {"metallic-roughness only",
     [](GltfBuilder& b) {
       use(b, {{"pbrMetallicRoughness", {{"metallicRoughnessTexture", texture(b, 3)}}}});
     }},
    {"occlusion only",
     [](GltfBuilder& b) {
       use(b, {{"occlusionTexture", texture(b, 1)}});
     }},
    {"alpha only",
     [](GltfBuilder& b) {
       Json m = coloured(texture(b, 2));
       m["alphaMode"] = "MASK";
       use(b, m);
     }},
    {"emissive only",
     [](GltfBuilder& b) {
       use(b, {{"emissiveTexture", texture(b, 3)}, {"emissiveFactor", {1, 1, 1}}});
     }},
    {"emission without light",
     [](GltfBuilder& b) {
       use(b, {{"emissiveTexture", texture(b, 3)}});
     }},
    {"of an extension only",
     [](GltfBuilder& b) {
       use(b, {{"extensions", {{"KHR_materials_clearcoat", {{"clearcoatTexture", texture(b, 3)}}}}}});
     }},
    {"vertex colours only",
     [](GltfBuilder& b) {
       std::vector<float> colours;
       for (std::size_t v = 0; v < vertices(b); ++v)
         colours.insert(colours.end(), {static_cast<float>(v % 3) / 2, 0.5f, static_cast<float>(v % 7) / 6});
       primitive(b)["attributes"]["COLOR_0"] = b.attribute(colours, "VEC3");
     }},
    {"two UV sets",
     [](GltfBuilder& b) {
       Json m = full_material(b);
       m["occlusionTexture"]["texCoord"] = 1;
       m["normalTexture"]["texCoord"] = 1;
       use(b, m);
     }},
    {"unlit",
     [](GltfBuilder& b) {
       Json m = full_material(b);
       m["extensions"]["KHR_materials_unlit"] = Json::object();
       use(b, m);
     }},
    {"unlit, normal only",
     [](GltfBuilder& b) {
       use(b, {{"normalTexture", texture(b, 3)}, {"extensions", {{"KHR_materials_unlit", Json::object()}}}});
     }},
    {"several materials",
     [](GltfBuilder& b) {
       const Json first = primitive(b);
       use(b, full_material(b));
       for (const Json& m : {blended_material(b), Json{{"normalTexture", texture(b, 3)}}, Json::object()}) {
         Json more = first;
         more["material"] = b.push("materials", m);
         const int mesh = b.push("meshes", {{"primitives", {more}}});
         b.node({{"mesh", mesh}, {"translation", {(kQuads + 1) * mesh, 0, 0}}});
       }
     }},
    {"base colour, normal and data", [](GltfBuilder& b) { use(b, full_material(b)); }},
    {"JPEG of 12 bits",
     [](GltfBuilder& b) {
       std::vector<std::uint16_t> samples;
       for (int i = 0; i < 48 * 48 * 3; ++i)
         samples.push_back(static_cast<std::uint16_t>(i % 3 * 1000 + i / 5));
       use(b, coloured(texture_of(b, testing::wide_jpeg(48, 48, samples, 12), "image/jpeg")));
     }},
    {"JPEG that ends early",
     [](GltfBuilder& b) {
       Bytes jpeg = testing::jpeg_bytes(64, 64, 3);
       jpeg.resize(jpeg.size() - jpeg.size() / 8);
       Json m = coloured(texture_of(b, jpeg, "image/jpeg"));
       m["pbrMetallicRoughness"]["metallicRoughnessTexture"] = texture(b, 3);
       use(b, m);
     }},
    {"textures of 1 px", [](GltfBuilder& b) { use(b, blended_material(b, 1)); }},
    {"all transparent",
     [](GltfBuilder& b) {
       Json m = blended_material(b);
       m["pbrMetallicRoughness"]["baseColorFactor"] = {1, 1, 1, 0};
       use(b, m);
     }},
    {"a single triangle",
     [](GltfBuilder& b) {
       use(b, full_material(b));
       primitive(b)["indices"] = b.attribute<std::uint16_t>({0, 1, kQuads + 1}, "SCALAR");
     }},
    {"tangents of length 0",
     [](GltfBuilder& b) {
       use(b, full_material(b));
       std::vector<float> normals, tangents(4 * vertices(b), 0.f);
       for (std::size_t v = 0; v < vertices(b); ++v) normals.insert(normals.end(), {0, 0, 1});
       primitive(b)["attributes"]["NORMAL"] = b.attribute(normals, "VEC3");
       primitive(b)["attributes"]["TANGENT"] = b.attribute(tangents, "VEC4");
     }},
    {"negative scale of the node",
     [](GltfBuilder& b) {
       use(b, full_material(b));
       b.json["nodes"][0]["scale"] = {-1, 2, 1};
     }},
};

CompileOptions cheap_options() {
  CompileOptions o;
  o.skeletonization.alpha_divisor = 5;
  o.skeletonization.offset_divisor = 50;
  o.skeletonization.max_wrap_faces = 100;
  o.ssf.scales = 3;
  o.quality.views = 2;
  o.quality.largest_px = 128;
  o.perceptual_values.samples = 100;
  return o;
}

class Materials : public ::testing::TestWithParam<Kind> {};

/// The path of the package.
std::string compiled(const Kind& kind, const testing::TemporaryFolder& folder) {
  GltfBuilder b = sheet();
  kind.change(b);
  const Bytes glb = b.glb();
  testing::write_text(folder / "m.glb", {glb.begin(), glb.end()});
  CompileRequest request;
  request.input = folder / "m.glb";
  request.output = folder / "m.texmesh";
  request.options = cheap_options();
  NullStore store;
  compile_model(request, store, {}, {});
  return request.output;
}

TEST_P(Materials, CompileIntoSoundPackages) {
  const testing::TemporaryFolder folder;
  const std::string path = compiled(GetParam(), folder);
  PackageReader package(open_store(path));
  const auto opened = open_store(path);
  std::string findings;
  for (const Finding& f : verify_package(*opened, {}).findings) findings += to_string(f) + "\n";
  EXPECT_EQ(findings, "");

  const QualityTable& q = package.quality();
  EXPECT_EQ(q.groups.empty(), package.tables().planes.empty());
  EXPECT_EQ(q.geometry[0].flip[0], 0);
  // At the best rung S_0 is nearly what the source is, whatever shows of it.
  for (const GroupLosses& group : q.groups)
    for (const TextureLosses& losses : group.sizes) {
      EXPECT_LT(losses.coded.flip.front(), 0.1f) << enum_name(group.group);
      EXPECT_LT(losses.coded.dssim.front(), 0.1f) << enum_name(group.group);
    }
}

TEST(Prediction, WithoutColoursFollowsTheOtherMaps) {
  for (const Kind& kind : kKinds) {
    if (kind.name != "normal only" && kind.name != "emissive only") continue;
    const testing::TemporaryFolder folder;
    PackageReader package(open_store(compiled(kind, folder)));
    const GroupCurve curve(package.quality(), package.quality().groups.at(0).group, 100);
    EXPECT_GT(curve.coded(0.3), 1.2 * curve.coded(0.1)) << kind.name;
  }
}

std::string test_name(const ::testing::TestParamInfo<Kind>& kind) {
  std::string name;
  for (const char c : kind.param.name) name += std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
  return name;
}
INSTANTIATE_TEST_SUITE_P(All, Materials, ::testing::ValuesIn(kKinds), test_name);

}  // namespace texmesh::compile_model_materials_test
