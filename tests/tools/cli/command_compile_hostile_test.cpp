// What nobody should feed to a compiler, and what everybody does: refused with exit 1, an error and no file,
// or compiled with a warning that --strict turns into an error.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <functional>
#include <nlohmann/json.hpp>

#include "tests/support/command.h"
#include "tests/support/sanitizers.h"

namespace texmesh::testing::command_compile_hostile_test {
namespace fs = std::filesystem;
using Json = nlohmann::json;

std::string base64(const std::string& bytes) {
  static const char* kAlphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t v = 0;
    for (std::size_t k = 0; k < 3; ++k)
      v = v << 8 | (i + k < bytes.size() ? static_cast<std::uint8_t>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k)
      out += i + k <= bytes.size() ? kAlphabet[v >> (18 - 6 * k) & 63] : '=';
  }
  return out;
}

/// A tetrahedron with UVs as glTF JSON; tests bend one thing of it.
Json tetrahedron() {
  const float p[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  const float t[] = {0, 0, 1, 0, 0, 1, 1, 1};
  const std::uint16_t f[] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
  std::string bytes(reinterpret_cast<const char*>(p), sizeof p);
  bytes.append(reinterpret_cast<const char*>(t), sizeof t).append(reinterpret_cast<const char*>(f), sizeof f);
  return {
      {"asset", {{"version", "2.0"}}},
      {"scene", 0},
      {"scenes", {{{"nodes", {0}}}}},
      {"nodes", {{{"mesh", 0}}}},
      {"meshes",
       {{{"primitives",
          {{{"attributes", {{"POSITION", 0}, {"TEXCOORD_0", 1}}}, {"indices", 2}, {"material", 0}}}}}}},
      {"materials", {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}}},
      {"textures", {{{"source", 0}}}},
      {"images", {{{"uri", "t.png"}}}},
      {"accessors",
       {{{"bufferView", 0},
         {"componentType", 5126},
         {"count", 4},
         {"type", "VEC3"},
         {"min", {0, 0, 0}},
         {"max", {1, 1, 1}}},
        {{"bufferView", 1}, {"componentType", 5126}, {"count", 4}, {"type", "VEC2"}},
        {{"bufferView", 2}, {"componentType", 5123}, {"count", 12}, {"type", "SCALAR"}}}},
      {"bufferViews",
       {{{"buffer", 0}, {"byteOffset", 0}, {"byteLength", 48}},
        {{"buffer", 0}, {"byteOffset", 48}, {"byteLength", 32}},
        {{"buffer", 0}, {"byteOffset", 80}, {"byteLength", 24}}}},
      {"buffers",
       {{{"byteLength", bytes.size()}, {"uri", "data:application/octet-stream;base64," + base64(bytes)}}}}};
}

/// A valid PNG of 1 x 1 px, grey.
const std::string kPng = [] {
  static const unsigned char bytes[] = {
      0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0,    0,    0,    13,  'I',  'H',  'D',  'R',  0,
      0,    0,    1,    0,    0,    0,    1,    8,    0,    0,    0,    0,   0x3a, 0x7e, 0x9b, 0x55, 0,
      0,    0,    10,   'I',  'D',  'A',  'T',  0x78, 0xda, 0x63, 0x68, 0,   0,    0,    0x82, 0,    0x81,
      0xda, 0x45, 0x08, 0x3b, 0,    0,    0,    0,    'I',  'E',  'N',  'D', 0xae, 0x42, 0x60, 0x82};
  return std::string(reinterpret_cast<const char*>(bytes), sizeof bytes);
}();

/// The same PNG that declares 65000 x 65000 px (its header checksum corrected).
std::string lying_png() {
  std::string s = kPng;
  s.replace(16, 8, std::string("\x00\x00\xfd\xe8\x00\x00\xfd\xe8", 8));
  std::uint32_t crc = 0xffffffffu;
  for (std::size_t i = 12; i < 29; ++i) {
    crc ^= static_cast<std::uint8_t>(s[i]);
    for (int k = 0; k < 8; ++k) crc = crc & 1 ? crc >> 1 ^ 0xedb88320u : crc >> 1;
  }
  crc = ~crc;
  for (int k = 0; k < 4; ++k) s[static_cast<std::size_t>(29 + k)] = static_cast<char>(crc >> (24 - 8 * k));
  return s;
}

const std::string kObj =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nvt 1 1\n"
    "f 1/1 3/3 2/2\nf 1/1 2/2 4/4\nf 1/1 4/4 3/3\nf 2/2 3/3 4/4\n";

class Hostile : public ::testing::Test {
 protected:
  CommandResult compile(const std::string& model, std::vector<std::string> extra = {}) {
    std::vector<std::string> arguments{TEXMESH_BINARY, "compile", in(model), "-o", folder_ / "out/x.texmesh",
                                       "--no-cache"};
    arguments.insert(arguments.end(), extra.begin(), extra.end());
    fs::create_directories(folder_ / "out");
    const auto start = std::chrono::steady_clock::now();
    CommandResult r = run_command(arguments, {}, "", 60);
    seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return r;
  }
  std::string in(const std::string& name) {
    fs::create_directories(folder_ / "in");
    return folder_ / ("in/" + name);
  }

  /// Exit 1, one error that names the model, expected and found, and nothing written.
  void expect_refused(const std::string& model) {
    const CommandResult r = compile(model);
    EXPECT_EQ(r.exit_code, 1) << r.output << r.errors;
    EXPECT_NE(r.output.find("error: "), std::string::npos) << r.output << r.errors;
    if (fs::exists(model)) EXPECT_NE(r.output.find("found "), std::string::npos) << r.output;
    EXPECT_EQ(r.output.find("internal"), std::string::npos) << r.output;
    EXPECT_TRUE(files_beneath(folder_ / "out").empty());
    EXPECT_LT(r.peak_memory_bytes, 1ull << 30);
  }
  void expect_refused_gltf(const std::function<void(Json&)>& bend) {
    Json j = tetrahedron();
    bend(j);
    write_text(in("m.gltf"), j.dump());
    if (!fs::exists(in("t.png"))) write_text(in("t.png"), kPng);
    expect_refused("m.gltf");
  }
  /// A package that verifies, a warning with this code, and an error under --strict.
  void expect_warned(const std::string& model, const std::string& code) {
    const CommandResult r = compile(model);
    EXPECT_EQ(r.exit_code, 0) << r.output << r.errors;
    EXPECT_NE(r.output.find("warning: " + code), std::string::npos) << r.output;
    EXPECT_EQ(run_command({TEXMESH_BINARY, "verify", folder_ / "out/x.texmesh"}).exit_code, 0);
    fs::remove(folder_ / "out/x.texmesh");
    const CommandResult strict = compile(model, {"--strict"});
    EXPECT_EQ(strict.exit_code, 1) << strict.output;
    EXPECT_TRUE(files_beneath(folder_ / "out").empty());
  }

  void expect_warned_gltf(const std::function<void(Json&)>& bend, const std::string& code) {
    Json j = tetrahedron();
    bend(j);
    write_text(in("m.gltf"), j.dump());
    expect_warned("m.gltf", code);
  }

  TemporaryFolder folder_;
  double seconds_ = 0;
};

TEST_F(Hostile, TheFixturesThemselvesAreFine) {
  write_text(in("m.gltf"), tetrahedron().dump());
  write_text(in("t.png"), kPng);
  const CommandResult r = compile("m.gltf", {"--strict"});
  EXPECT_EQ(r.exit_code, 0) << r.output << r.errors;
}

/// Workers of several models are copies of one process (WorkerOrigin).
TEST_F(Hostile, AModelThatFailsChangesNothingOfTheNext) {
  write_text(in("t.png"), kPng);
  Json broken = tetrahedron();
  broken["accessors"][2]["count"] = 4000;
  for (const char* name : {"a", "c", "d"}) write_text(in(name) + std::string(".gltf"), tetrahedron().dump());
  write_text(in("b.gltf"), broken.dump());
  const CommandResult r = run_command(
      {TEXMESH_BINARY, "compile", folder_ / "in", "-o", folder_ / "all", "--no-cache", "--jobs", "1"}, {}, "",
      60);
  EXPECT_EQ(r.exit_code, 1) << r.output << r.errors;
  EXPECT_FALSE(fs::exists(folder_ / "all/b.texmesh"));
  for (const std::string name : {"a", "c", "d"}) {
    ASSERT_EQ(compile(name + ".gltf").exit_code, 0);
    EXPECT_EQ(read_text(folder_ / ("all/" + name + ".texmesh")), read_text(folder_ / "out/x.texmesh"))
        << name;
  }
}

TEST_F(Hostile, MissingFile) { expect_refused("nothing.glb"); }
TEST_F(Hostile, EmptyFiles) {
  for (const char* name : {"e.glb", "e.gltf", "e.obj", "e.ply", "e.stl", "e.xyz"}) {
    write_text(in(name), "");
    expect_refused(name);
  }
}
TEST_F(Hostile, WrongMagic) {
  for (const char* name : {"w.glb", "w.gltf", "w.ply", "w.stl", "w.fbx"}) {
    write_text(in(name), "this is no model at all, whatever its name says\n");
    expect_refused(name);
  }
}
TEST_F(Hostile, AJsonThatIsNoRangeScanIsReadAsCollection) {
  for (const char* text : {"", "this is no collection", "{", "[]", "{\"models\":7}"}) {
    write_text(in("c.json"), text);
    const CommandResult r = compile("c.json");
    EXPECT_EQ(r.exit_code, 2) << text << r.output << r.errors;
    EXPECT_NE(r.errors.find("c.json"), std::string::npos) << r.errors;
    EXPECT_NE(r.errors.find("found "), std::string::npos) << r.errors;
    EXPECT_TRUE(files_beneath(folder_ / "out").empty());
  }
}
TEST_F(Hostile, AFolderAsModelFile) {
  fs::create_directories(in("folder.glb/x"));
  write_text(in("folder.glb/x/readme"), "");
  const CommandResult r = compile("folder.glb");
  EXPECT_EQ(r.exit_code, 2) << r.output << r.errors;  // a folder without models
}
TEST_F(Hostile, TruncatedModels) {
  const std::string gltf = tetrahedron().dump();
  for (std::size_t n : {std::size_t{1}, gltf.size() / 4, gltf.size() / 2, gltf.size() - 1}) {
    write_text(in("m.gltf"), gltf.substr(0, n));
    expect_refused("m.gltf");
  }
}
TEST_F(Hostile, IndexOutOfRange) {
  expect_refused_gltf([](Json& j) {
    j["accessors"][0]["count"] = 3;
    j["accessors"][1]["count"] = 3;
  });
  write_text(in("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n");
  expect_refused("m.obj");
  write_text(in("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 -4\n");
  expect_refused("m.obj");
}
TEST_F(Hostile, OnlyNonFinitePositions) {
  write_text(in("m.obj"), "v nan 0 0\nv inf 0 0\nv 0 nan 0\nf 1 2 3\n");
  expect_refused("m.obj");
}
TEST_F(Hostile, NoTriangles) {
  write_text(in("m.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\n");
  expect_refused("m.obj");
}
TEST_F(Hostile, OnlyDegenerateTriangles) {
  write_text(in("m.obj"), "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\nf 1 1 2\n");
  expect_refused("m.obj");
}
TEST_F(Hostile, TwoToThe31DeclaredVertices) {
  expect_refused_gltf([](Json& j) { j["accessors"][0]["count"] = 2147483648u; });
  expect_refused_gltf([](Json& j) { j["accessors"][0]["count"] = 4611686018427387904ull; });
  write_text(in("m.ply"),
             "ply\nformat ascii 1.0\nelement vertex 2147483648\nproperty float x\nproperty float y\nproperty "
             "float z\n"
             "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n");
  expect_refused("m.ply");
}
TEST_F(Hostile, AnImageThatLiesAboutItsSize) {
  write_text(in("t.png"), lying_png());
  expect_refused_gltf([](Json&) {});
}
TEST_F(Hostile, ATruncatedImage) {
  write_text(in("t.png"), kPng.substr(0, kPng.size() - 30));
  expect_refused_gltf([](Json&) {});
}
TEST_F(Hostile, AnImageOfNoAllowedFormat) {
  write_text(in("t.png"), "P6\n1 1\n255\nabc");
  expect_refused_gltf([](Json&) {});
  write_text(in("t.png"), "GIF89a\x01\x01");
  expect_refused_gltf([](Json&) {});
}
TEST_F(Hostile, UrisThatLeaveTheFolder) {
  write_text(folder_ / "secret.png", kPng);
  for (const std::string uri :
       {"../secret.png", "%2e%2e/secret.png", "a/../../secret.png", "/etc/hostname", "file:///etc/hostname",
        "http://127.0.0.1/t.png", "https://127.0.0.1/t.png", "c:/t.png", "\\\\host\\t.png"})
    expect_warned_gltf([&](Json& j) { j["images"][0]["uri"] = uri; }, "missing-texture");
  write_text(in("m.mtl"), "newmtl a\nmap_Kd ../secret.png\n");
  write_text(in("m.obj"), "mtllib m.mtl\nusemtl a\n" + kObj);
  expect_warned("m.obj", "missing-texture");
  write_text(in("m.obj"), "mtllib ../../etc/hostname\n" + kObj);
  expect_warned("m.obj", "renamed-mtl");
  fs::remove(in("m.mtl"));
  expect_warned("m.obj", "missing-mtl");
}
TEST_F(Hostile, SymbolicLinksAndPipesAsTextures) {
  write_text(folder_ / "secret.png", kPng);
  fs::create_symlink(folder_ / "secret.png", in("t.png"));
  expect_warned_gltf([](Json&) {}, "missing-texture");
  fs::remove(in("t.png"));
  ASSERT_EQ(::mkfifo(in("t.png").c_str(), 0600), 0);
  expect_warned_gltf([](Json&) {}, "missing-texture");
  EXPECT_LT(seconds_, testing::sanitizers_take(10));
}
TEST_F(Hostile, APipeAsModel) {
  ASSERT_EQ(::mkfifo(in("m.glb").c_str(), 0600), 0);
  expect_refused("m.glb");
}
TEST_F(Hostile, DeepJson) {
  write_text(in("m.gltf"), std::string(100000, '[') + std::string(100000, ']'));
  expect_refused("m.gltf");
  Json j = tetrahedron();
  const std::string text = j.dump();
  write_text(in("m.gltf"), text.substr(0, text.size() - 1) + ",\"extras\":" + std::string(100000, '[') +
                               std::string(100000, ']') + "}");
  expect_refused("m.gltf");
}
TEST_F(Hostile, UnreadableModel) {
  if (::geteuid() == 0) GTEST_SKIP() << "root reads everything";
  write_text(in("m.obj"), kObj);
  ::chmod(in("m.obj").c_str(), 0);
  expect_refused("m.obj");
}

TEST_F(Hostile, AMissingTextureIsAWarning) {
  write_text(in("m.gltf"), tetrahedron().dump());
  expect_warned("m.gltf", "missing-texture");
}
TEST_F(Hostile, AMissingMaterialLibraryIsAWarning) {
  write_text(in("m.obj"), "mtllib none.mtl\nusemtl a\n" + kObj);
  expect_warned("m.obj", "missing-mtl");
}
TEST_F(Hostile, SomeNonFinitePositionsAreAWarning) {
  write_text(in("m.obj"), kObj + "v nan 0 0\nf 1/1 2/2 5/3\n");
  expect_warned("m.obj", "non-finite-position");
}
TEST_F(Hostile, SomeNonFiniteUvsAreAWarning) {
  write_text(in("m.obj"), kObj + "vt nan 0\nf 4/5 2/2 1/1\n");
  expect_warned("m.obj", "non-finite-uv");
}
TEST_F(Hostile, DegenerateAndDuplicateFacesAreWarnings) {
  write_text(in("m.obj"), kObj + "f 1/1 1/1 2/2\n");
  expect_warned("m.obj", "degenerate-triangle");
  write_text(in("m.obj"), kObj + "f 1/1 3/3 2/2\n");
  expect_warned("m.obj", "duplicate-triangle");
}
TEST_F(Hostile, AnAccessorWithoutBoundsIsAWarning) {
  Json j = tetrahedron();
  j["accessors"][0].erase("min");
  j["accessors"][0].erase("max");
  write_text(in("m.gltf"), j.dump());
  write_text(in("t.png"), kPng);
  expect_warned("m.gltf", "accessor-without-bounds");
}
TEST_F(Hostile, AFarAwayOriginKeepsMillimetres) {
  std::string obj;
  for (const char* p : {"0 0 0", "0.001 0 0", "0 0.001 0", "0 0 0.001"}) {
    double x, y, z;
    std::sscanf(p, "%lf %lf %lf", &x, &y, &z);
    char line[100];
    std::snprintf(line, sizeof line, "v %.4f %.4f %.4f\n", 5000000 + x, 4000000 + y, 300 + z);
    obj += line;
  }
  write_text(in("m.obj"), obj + "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
  const CommandResult r = compile("m.obj");
  ASSERT_EQ(r.exit_code, 0) << r.output;
  const CommandResult d =
      run_command({TEXMESH_BINARY, "dump", folder_ / "out/x.texmesh", "summary", "--json"});
  const Json j = Json::parse(d.output);
  const Json& o = j.at("object");
  EXPECT_NEAR(o.at("origin")[0].get<double>() + o.at("bounds_min")[0].get<double>(), 5000000, 1e-5)
      << d.output;
  EXPECT_NEAR(o.at("bounds_max")[0].get<double>() - o.at("bounds_min")[0].get<double>(), 0.001, 1e-5)
      << d.output;
}

}  // namespace texmesh::testing::command_compile_hostile_test
