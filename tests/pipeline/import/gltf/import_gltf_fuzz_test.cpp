// The fuzz target over inputs made here: changed numbers, swapped pieces, damaged bytes of every kind of
// primitive.
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include "tests/fuzz/gltf_fuzz.cpp"
#include "tests/support/gltf_builder.h"
#include "tests/support/meshes.h"

namespace texmesh {
namespace {

using nlohmann::json;

using testing::GltfBuilder;
using testing::Random;

GltfBuilder rich() {
  GltfBuilder b = testing::quad();
  b.json["accessors"][0]["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", b.view_of<std::uint8_t>({1})}, {"componentType", 5121}}},
      {"values", {{"bufferView", b.view_of<float>({1, 0, 0})}}}};
  json& p = b.json["meshes"][0]["primitives"][0];
  p["attributes"]["COLOR_0"] = b.attribute<std::uint16_t>(std::vector<std::uint16_t>(12, 9), "VEC3");
  p["attributes"]["NORMAL"] = b.attribute<std::int8_t>(std::vector<std::int8_t>(12, 9), "VEC3");
  p["material"] = 0;
  b.json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
  b.json["textures"] = {{{"source", 0}, {"sampler", 0}}};
  b.json["samplers"] = {{{"wrapS", 33071}}};
  b.json["images"] = {{{"bufferView", b.view_of(testing::png())}}};
  b.json["nodes"] = {{{"mesh", 0}, {"children", {1}}, {"rotation", {0, 0, 0, 1}}},
                     {{"mesh", 0}, {"scale", {1, 2, 3}}}};
  b.json["scenes"] = {{{"nodes", {0}}}};
  b.json["scene"] = 0;
  const std::vector<unsigned> indices{0, 1, 2, 0, 2, 3};
  Bytes packed(meshopt_encodeIndexBufferBound(6, 4));
  packed.resize(meshopt_encodeIndexBuffer(packed.data(), packed.size(), indices.data(), 6));
  const int view = b.view_of(packed);
  b.json["bufferViews"][2]["extensions"]["EXT_meshopt_compression"] = {
      {"buffer", 0},
      {"byteOffset", b.json["bufferViews"][static_cast<std::size_t>(view)]["byteOffset"]},
      {"byteLength", packed.size()},
      {"byteStride", 2},
      {"count", 6},
      {"mode", "TRIANGLES"}};
  return b;
}

/// A random value somewhere below `value` is replaced, removed or copied over another.
void mutate(json& value, Random& random) {
  json* at = &value;
  while (at->is_structured() && !at->empty() && random.next() % 8 != 0) {
    auto it = at->begin();
    std::advance(it, random.next() % at->size());
    at = &*it;
  }
  static const std::vector<json> kOdd{0,
                                      1,
                                      2,
                                      3,
                                      -1,
                                      4,
                                      255,
                                      65536,
                                      4294967295u,
                                      9007199254740991,
                                      nullptr,
                                      true,
                                      "a",
                                      json::array(),
                                      1e300,
                                      0.5,
                                      5126,
                                      5121,
                                      json::object(),
                                      "data:,"};
  *at = kOdd[random.next() % kOdd.size()];
}

TEST(GltfFuzz, AnyChangeOfTheJsonGivesAModelOrAnInputError) {
  const GltfBuilder good = rich();
  Random random{1};
  for (int i = 0; i < 4000; ++i) {
    GltfBuilder b = good;
    b.json["buffers"] = {{{"byteLength", b.bin.size()}}};
    for (std::uint32_t n = 0; n <= random.next() % 4; ++n) mutate(b.json, random);
    const Bytes bytes = testing::make_glb(b.json.dump(), b.bin);
    EXPECT_EQ(LLVMFuzzerTestOneInput(bytes.data(), bytes.size()), 0);
  }
}

TEST(GltfFuzz, AnyChangeOfTheBytesGivesAModelOrAnInputError) {
  const Bytes good = rich().glb();
  Random random{2};
  for (int i = 0; i < 4000; ++i) {
    Bytes bytes = good;
    for (std::uint32_t n = 0; n <= random.next() % 8; ++n) {
      const std::size_t at = random.next() % bytes.size(), from = random.next() % bytes.size();
      switch (random.next() % 4) {
        case 0:
          bytes[at] = static_cast<std::uint8_t>(random.next());
          break;
        case 1:
          bytes[at] = bytes[from];
          break;
        case 2:
          bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(at));
          break;
        default:
          bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(at), bytes[from]);
      }
    }
    if (bytes.size() >= 12) {  // the length follows, or nothing would get past the header
      const auto size = static_cast<std::uint32_t>(bytes.size());
      std::memcpy(bytes.data() + 8, &size, 4);
    }
    EXPECT_EQ(LLVMFuzzerTestOneInput(bytes.data(), bytes.size()), 0);
  }
}

TEST(GltfFuzz, TheUnchangedInputIsAModel) {
  testing::MemoryResolver resolver;
  EXPECT_EQ(import_gltf("m", rich().glb(), resolver, {}, {}).model.mesh.triangles.size(), 4u);
}

}  // namespace
}  // namespace texmesh
