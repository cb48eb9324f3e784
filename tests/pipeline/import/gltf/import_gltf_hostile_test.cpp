// Every file here must end in an InputError, and soon.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "tests/pipeline/import/gltf/hostile_gltf.h"

namespace texmesh::import_gltf_hostile_test {

using nlohmann::json;

using testing::expect_refused;
using testing::GltfBuilder;
using testing::MemoryResolver;
using testing::primitive;
using testing::quad;
using testing::refusal;

Bytes bytes_of(const std::string& text) { return {text.begin(), text.end()}; }

TEST(HostileGltf, TheUnchangedQuadIsRead) {
  EXPECT_EQ(refusal([](json&) {}), "");
}

TEST(HostileGltf, RefusesWhatIsNoGltf) {
  for (const char* text :
       {"", " ", "{", "{}", "[]", "null", "3", "\"\"", "{\"asset\":{}}", "{\"asset\":7}",
        "{\"asset\":{\"version\":2}}", "glTX", "{\"asset\":{\"version\":\"2.0\"}}x",
        "{\"asset\":{\"version\":\"2.0\"},\"a\":\"\xff\"}", "{\"a\":\"\\", "\xef\xbb\xbf{"}) {
    EXPECT_NE(refusal(bytes_of(text)), "") << text;
  }
}

TEST(HostileGltf, RefusesOtherVersionsAndUnknownRequiredExtensions) {
  expect_refused("/asset/version", [](json& j) { j["asset"]["version"] = "1.0"; });
  expect_refused("/asset/version", [](json& j) { j["asset"]["version"] = "3.0"; });
  expect_refused("/asset/minVersion", [](json& j) { j["asset"]["minVersion"] = "2.1"; });
  expect_refused("/extensionsRequired/0", [](json& j) { j["extensionsRequired"] = {"EXT_odd"}; });
  expect_refused("/extensionsRequired/0", [](json& j) { j["extensionsRequired"] = {3}; });
}

TEST(HostileGltf, RefusesDeepAndEndlessJson) {
  for (const int depth : {65, 20'000, 100'000}) {
    const auto n = static_cast<std::size_t>(depth);
    EXPECT_NE(refusal(bytes_of("{\"asset\":{\"version\":\"2.0\"},\"extras\":" + std::string(n, '[') +
                               std::string(n, ']') + "}"))
                  .find("64 levels"),
              std::string::npos);
    std::string objects;
    for (int i = 0; i < depth; ++i) objects += "{\"a\":";
    EXPECT_NE(refusal(bytes_of(objects)).find("64 levels"), std::string::npos);
    EXPECT_NE(refusal(testing::make_glb(objects, std::nullopt)).find("64 levels"), std::string::npos);
  }
  EXPECT_NE(refusal(bytes_of("{\"extras\":[0" +
                             [] {
                               std::string s;
                               for (int i = 0; i < 9'000'000; ++i) s += ",0";
                               return s;
                             }() +
                             "]}"))
                .find("values"),
            std::string::npos);
  GltfBuilder b = quad();  // brackets in strings do not count
  b.json["asset"]["generator"] = "\\\"" + std::string(1000, '[');
  EXPECT_EQ(refusal(b.glb()), "");
}

TEST(HostileGltf, RefusesWrongIndices) {
  for (const json& wrong : {json(1), json(-1), json(1.5), json("0"), json(4294967296), json(true),
                            json::array(), json(18446744073709551615u), json(1e300)}) {
    expect_refused("/nodes/0/mesh", [&](json& j) { j["nodes"][0]["mesh"] = wrong; });
    expect_refused("/nodes/0/children/0", [&](json& j) { j["nodes"][0]["children"] = {wrong}; });
    expect_refused("/bufferViews/0/buffer", [&](json& j) { j["bufferViews"][0]["buffer"] = wrong; });
    expect_refused("/meshes/0/primitives/0/material", [&](json& j) {
      j["materials"] = {json::object()};
      primitive(j)["material"] = wrong;
    });
    expect_refused("/scene", [&](json& j) {
      j["scenes"] = {{{"nodes", {0}}}};
      j["scene"] = wrong;
    });
    expect_refused("/scenes/0/nodes/0", [&](json& j) { j["scenes"] = {{{"nodes", {wrong}}}}; });
    expect_refused("/materials/0/normalTexture/index", [&](json& j) {
      j["textures"] = {json::object()};
      j["materials"] = {{{"normalTexture", {{"index", wrong}}}}};
    });
    expect_refused("/textures/0/source", [&](json& j) {
      j["images"] = {{{"uri", "a"}}};
      j["textures"] = {{{"source", wrong}}};
    });
  }
  expect_refused("/accessors/0/bufferView", [](json& j) { j["accessors"][0]["bufferView"] = 3; });
  expect_refused("/attributes/POSITION", [](json& j) { primitive(j)["attributes"]["POSITION"] = 3; });
  expect_refused("/indices", [](json& j) { primitive(j)["indices"] = 3; });
  expect_refused("/images/0/bufferView", [](json& j) { j["images"] = {{{"bufferView", 3}}}; });
  expect_refused("/images/0", [](json& j) { j["images"] = {json::object()}; });
  expect_refused("/meshes/0/primitives/0/mode", [](json& j) { primitive(j)["mode"] = 7; });
  expect_refused("attributes", [](json& j) { primitive(j).erase("attributes"); });
  expect_refused("/meshes", [](json& j) { j["meshes"] = json::object(); });
  expect_refused("/meshes/0", [](json& j) { j["meshes"][0] = 3; });
  expect_refused("primitives", [](json& j) { j["meshes"][0].erase("primitives"); });
}

TEST(HostileGltf, RefusesAccessorsBeyondTheirBytes) {
  for (const std::uint64_t count : {std::uint64_t{7}, std::uint64_t{1} << 31, std::uint64_t{1} << 32,
                                    std::uint64_t{1} << 53, std::uint64_t{1} << 62, ~std::uint64_t{0}}) {
    for (const int a : {0, 1, 2}) {
      expect_refused("/accessors/",
                     [&](json& j) { j["accessors"][static_cast<std::size_t>(a)]["count"] = count; });
    }
    expect_refused("/accessors/", [&](json& j) {  // no bytes at all: zeros, but how many
      j["accessors"][0].erase("bufferView");
      j["accessors"][0]["count"] = count;
    });
  }
  for (const std::uint64_t offset : {std::uint64_t{1}, std::uint64_t{48}, std::uint64_t{1} << 52}) {
    expect_refused("/accessors/0", [&](json& j) { j["accessors"][0]["byteOffset"] = offset; });
  }
  expect_refused("/accessors/0/byteOffset", [](json& j) { j["accessors"][0]["byteOffset"] = -4; });
  for (const std::uint64_t n : {std::uint64_t{1} << 20, std::uint64_t{9007199254740991}}) {
    expect_refused("/bufferViews/0", [&](json& j) { j["bufferViews"][0]["byteLength"] = n; });
    expect_refused("/bufferViews/0", [&](json& j) { j["bufferViews"][0]["byteOffset"] = n; });
  }
  expect_refused("/accessors/0", [](json& j) { j["bufferViews"][0]["byteLength"] = 47; });
  for (const json& stride : {json(2), json(6), json(256), json(-4), json("12")}) {
    const auto change = [&](json& j) { j["bufferViews"][0]["byteStride"] = stride; };
    expect_refused("/bufferViews/0", change);
    expect_refused("byteStride", change);
  }
  expect_refused("/bufferViews/0/byteStride", [](json& j) { j["bufferViews"][0]["byteStride"] = 8; });
  expect_refused("/accessors/0", [](json& j) { j["bufferViews"][0]["byteStride"] = 16; });
}

TEST(HostileGltf, RefusesAccessorsOfWrongTypes) {
  for (const char* type : {"VEC2", "SCALAR", "VEC4", "MAT4", "MAT2", "VEC5", ""}) {
    expect_refused("/accessors/0", [&](json& j) { j["accessors"][0]["type"] = type; });
  }
  for (const json& type : {json(5124), json(5125), json(5130), json(0), json(-1), json("FLOAT")}) {
    expect_refused("/accessors/0", [&](json& j) { j["accessors"][0]["componentType"] = type; });
  }
  for (const int type : {5120, 5122, 5126}) {
    expect_refused("/accessors/2", [&](json& j) {
      j["accessors"][2]["componentType"] = type;
      j["accessors"][2]["count"] = 3;
    });
  }
  expect_refused("/accessors/2", [](json& j) {
    j["accessors"][2]["type"] = "VEC2";
    j["accessors"][2]["count"] = 3;
  });
  expect_refused("/accessors/2", [](json& j) { j["accessors"][2].erase("bufferView"); });
  expect_refused("/accessors/1/count", [](json& j) { j["accessors"][1]["count"] = 3; });
  expect_refused("/accessors/0/normalized", [](json& j) { j["accessors"][0]["normalized"] = 1; });
}

TEST(HostileGltf, RefusesIndicesBeyondTheVertices) {
  for (const std::uint16_t index : {4, 255, 65535}) {
    GltfBuilder b = quad();
    std::memcpy(b.bin.data() + 80 + 4, &index, 2);
    EXPECT_NE(refusal(b.glb()).find("/meshes/0/primitives/0/indices: expected indices below 4"),
              std::string::npos);
  }
}

TEST(HostileGltf, RefusesWrongSparseAccessors) {
  const auto sparse = [](std::vector<std::uint8_t> indices, const std::function<void(json&)>& change) {
    GltfBuilder b = quad();
    b.json["accessors"][0]["sparse"] = {
        {"count", indices.size()},
        {"indices", {{"bufferView", b.view_of(indices)}, {"componentType", 5121}}},
        {"values", {{"bufferView", b.view_of(std::vector<float>(3 * indices.size()))}}}};
    change(b.json["accessors"][0]["sparse"]);
    return refusal(b.glb());
  };
  const auto nothing = [](json&) {};
  ASSERT_EQ(sparse({1, 2}, nothing), "");
  EXPECT_NE(sparse({1, 4}, nothing), "");
  EXPECT_NE(sparse({2, 1}, nothing), "");
  EXPECT_NE(sparse({1, 1}, nothing), "");
  EXPECT_NE(sparse({0, 1, 2, 3, 4}, nothing), "");
  EXPECT_NE(sparse({1}, [](json& s) { s["count"] = 2; }), "");
  EXPECT_NE(sparse({1}, [](json& s) { s["count"] = std::uint64_t{1} << 32; }), "");
  EXPECT_NE(sparse({1}, [](json& s) { s["count"] = -1; }), "");
  EXPECT_NE(sparse({1}, [](json& s) { s["indices"]["bufferView"] = 9; }), "");
  EXPECT_NE(sparse({1}, [](json& s) { s["indices"]["byteOffset"] = 1; }), "");
  EXPECT_NE(sparse({1}, [](json& s) { s["indices"]["componentType"] = 5126; }), "");
  EXPECT_NE(sparse({1}, [](json& s) { s["values"]["bufferView"] = 9; }), "");
  EXPECT_NE(sparse({1}, [](json& s) { s["values"]["byteOffset"] = 4; }), "");
  EXPECT_NE(sparse({1}, [](json& s) { s.erase("values"); }), "");
  EXPECT_NE(sparse({1}, [](json& s) { s = 3; }), "");
}

TEST(HostileGltf, RefusesNodesThatAreNoTree) {
  expect_refused("a tree of nodes", [](json& j) {  // a cycle that the scene reaches
    j["nodes"] = {{{"children", {1}}}, {{"children", {0}}, {"mesh", 0}}};
    j["scenes"] = {{{"nodes", {0}}}};
  });
  expect_refused("a tree of nodes", [](json& j) {
    j["nodes"] = {{{"children", {0}}, {"mesh", 0}}};
    j["scenes"] = {{{"nodes", {0}}}};
  });
  expect_refused("a tree of nodes", [](json& j) { j["scenes"] = {{{"nodes", {0, 0}}}}; });
  expect_refused("a tree of nodes", [](json& j) {  // 2^30 ways to the last node
    j["nodes"] = json::array();
    for (int i = 0; i < 30; ++i) j["nodes"].push_back({{"children", {i + 1, i + 1}}});
    j["nodes"].push_back({{"mesh", 0}});
  });
  expect_refused("triangles", [](json& j) {
    j["nodes"] = {{{"children", {0}}, {"mesh", 0}}};
  });  // no root at all
}

TEST(HostileGltf, ReadsAChainOfAHundredThousandNodes) {
  GltfBuilder b = quad();
  b.json["nodes"] = json::array();
  for (int i = 0; i < 100'000; ++i) b.json["nodes"].push_back({{"children", {i + 1}}});
  b.json["nodes"].push_back({{"mesh", 0}});
  EXPECT_EQ(refusal(b.glb()), "");
}

TEST(HostileGltf, RefusesWrongTransforms) {
  expect_refused("/nodes/0/matrix", [](json& j) { j["nodes"][0]["matrix"] = std::vector<int>(15, 1); });
  expect_refused("/nodes/0/matrix", [](json& j) { j["nodes"][0]["matrix"] = {"a"}; });
  expect_refused("/nodes/0/scale", [](json& j) { j["nodes"][0]["scale"] = {1, 1}; });
  expect_refused("/nodes/0/rotation", [](json& j) { j["nodes"][0]["rotation"] = 7; });
  expect_refused("/nodes/0/translation", [](json& j) { j["nodes"][0]["translation"] = {1, 1, "1"}; });
  expect_refused("finite", [](json& j) { j["nodes"][0]["scale"] = {1e300, 1e300, 1e300}; });
  const std::string text = "{\"asset\":{\"version\":\"2.0\"},\"nodes\":[{\"scale\":[1e999,1,1]}]}";
  EXPECT_NE(refusal(bytes_of(text)).find("fit a double"), std::string::npos);
}

TEST(HostileGltf, RefusesModelsWithoutFiniteTriangles) {
  expect_refused("triangles", [](json& j) { j.erase("nodes"); });
  expect_refused("triangles", [](json& j) { j["meshes"][0]["primitives"] = json::array(); });
  expect_refused("triangles", [](json& j) { j["accessors"][2]["count"] = 2; });
  expect_refused("triangles", [](json& j) { primitive(j)["mode"] = 0; });
  expect_refused("triangles", [](json& j) { primitive(j)["attributes"].erase("POSITION"); });
  for (const float bad : {std::nanf(""), HUGE_VALF, -HUGE_VALF}) {
    GltfBuilder b = quad();
    for (std::size_t i = 0; i < 12; ++i) std::memcpy(b.bin.data() + 4 * i, &bad, 4);
    EXPECT_NE(refusal(b.glb()).find("finite"), std::string::npos);
  }
}

TEST(HostileGltf, RefusesBuffersItMustNotOrCannotRead) {
  for (const char* uri : {"../secret.bin",
                          "%2e%2e/secret.bin",
                          "a/%2E%2E/b.bin",
                          "/etc/passwd",
                          "%2Fetc/passwd",
                          ".",
                          "",
                          "a/",
                          "http://host/a.bin",
                          "https://host/a.bin",
                          "file:///a.bin",
                          "c:/a.bin",
                          "c%3A/a",
                          "a\\b.bin",
                          "%5c%5chost",
                          "a%00b",
                          "a%",
                          "missing.bin",
                          "data:;base64,!!!!",
                          "data:;base64,AAAA",
                          "data:application/octet-stream,AAAA",
                          "data:"}) {
    const std::string what = refusal(quad().gltf(uri));
    EXPECT_NE(what.find("/buffers/0"), std::string::npos) << uri << ": " << what;
  }
  expect_refused("/buffers/1", [](json& j) {  // only the first buffer may be the BIN chunk
    j["buffers"].push_back(j["buffers"][0]);
    j["bufferViews"][0]["buffer"] = 1;
  });
}

TEST(HostileGltf, KeepsToTheLimitsOfItsOptions) {
  ImportOptions few;
  few.max_vertices = 3;
  EXPECT_NE(refusal(quad().glb(), few).find("at most 3"), std::string::npos);
  few = {};
  few.max_triangles = 1;
  EXPECT_NE(refusal(quad().glb(), few).find("at most"), std::string::npos);
  few = {};
  few.max_vertices = 1000;
  GltfBuilder b = quad();  // a mesh in many nodes
  for (int i = 0; i < 1000; ++i) b.node({{"mesh", 0}});
  EXPECT_NE(refusal(b.glb(), few).find("at most 1000"), std::string::npos);
  few = {};
  few.max_file_bytes = 100;
  EXPECT_NE(refusal(quad().gltf("data:;base64," + std::string(136, 'A')), few).find("100"),
            std::string::npos);
}

TEST(HostileGltf, ManyPrimitivesOnOneLargeBufferCostNoMoreThanTheirTriangles) {
  GltfBuilder b;
  const std::vector<float> many(3 * 1'000'000, 1.0f);
  const int positions = b.attribute(many, "VEC3");
  const int indices = b.attribute<std::uint32_t>({0, 500'000, 999'999}, "SCALAR");
  b.mesh({{"POSITION", positions}}, {{"indices", indices}});
  json& primitives = b.json["meshes"][0]["primitives"];
  for (int i = 1; i < 5000; ++i) primitives.push_back(primitives[0]);
  b.node({{"mesh", 0}});
  EXPECT_EQ(refusal(b.glb()), "");  // within refusal's two seconds
}

TEST(HostileGltf, MessagesStayShort) {
  const std::string what = refusal([](json& j) { j["nodes"][0]["mesh"] = std::string(1'000'000, 'x'); });
  EXPECT_LT(what.size(), 400u);
  EXPECT_LT(refusal(quad().gltf("http:" + std::string(1'000'000, 'x'))).size(), 400u);
}

}  // namespace texmesh::import_gltf_hostile_test
