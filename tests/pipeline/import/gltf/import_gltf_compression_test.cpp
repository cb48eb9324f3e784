#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>

#include "pipeline/import/gltf/import_gltf_parts.h"
#include "stages/gltf/decode_meshopt.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/meshes.h"

namespace texmesh::import_gltf_compression_test {

using nlohmann::json;
using testing::GltfBuilder;
using testing::MemoryResolver;
using testing::quad;

Model import(const GltfBuilder& b) {
  MemoryResolver resolver;
  return import_gltf("m.glb", b.glb(), resolver, {}, {}).model;
}
std::string refusal(const GltfBuilder& b) {
  try {
    import(b);
    return "";
  } catch (const InputError& e) {
    return e.what();
  }
}

// --- Draco ---

struct DracoIds {
  int position, uv, normal, colour;
};

Bytes draco_of(const Mesh& mesh, draco::MeshEncoderMethod method, bool metadata, DracoIds& ids) {
  draco::TriangleSoupMeshBuilder soup;
  soup.Start(static_cast<int>(mesh.triangles.size()));
  ids.position = soup.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  ids.uv = soup.AddAttribute(draco::GeometryAttribute::TEX_COORD, 2, draco::DT_FLOAT32);
  ids.normal = soup.AddAttribute(draco::GeometryAttribute::NORMAL, 3, draco::DT_FLOAT32);
  ids.colour = soup.AddAttribute(draco::GeometryAttribute::COLOR, 3, draco::DT_UINT8);
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const draco::FaceIndex f(t);
    const Triangle& w = mesh.triangles[t];
    const auto set = [&](int id, auto value) {
      const auto a = value(0), b = value(1), c = value(2);
      soup.SetAttributeValuesForFace(id, f, &a, &b, &c);
    };
    set(ids.position, [&](int i) { return mesh.positions[mesh.position_of(t, i)]; });
    set(ids.uv, [&](int i) { return mesh.uv0[w[static_cast<std::size_t>(i)]]; });
    set(ids.normal, [&](int i) { return mesh.normals[w[static_cast<std::size_t>(i)]]; });
    set(ids.colour, [&](int) { return std::array<std::uint8_t, 3>{0, 51, 255}; });
  }
  if (metadata) {
    auto m = std::make_unique<draco::AttributeMetadata>();
    m->AddEntryString("name", "values");
    m->AddSubMetadata("sub", std::make_unique<draco::Metadata>());
    soup.AddAttributeMetadata(ids.position, std::move(m));
  }
  const std::unique_ptr<draco::Mesh> built = soup.Finalize();
  draco::Encoder encoder;
  encoder.SetEncodingMethod(method);
  encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 14);
  draco::EncoderBuffer out;
  EXPECT_TRUE(encoder.EncodeMeshToBuffer(*built, &out).ok());
  return {out.data(), out.data() + out.size()};
}

GltfBuilder draco_model(const Bytes& stream, const DracoIds& ids, std::size_t triangles) {
  GltfBuilder b;
  const json bounds = {{"min", {0, 0, 0}}, {"max", {1, 1, 1}}};
  const int position = b.accessor(-1, "VEC3", 5126, 3, bounds), uv = b.accessor(-1, "VEC2", 5126, 3),
            normal = b.accessor(-1, "VEC3", 5126, 3),
            colour = b.accessor(-1, "VEC3", 5121, 3, {{"normalized", true}}),
            indices = b.accessor(-1, "SCALAR", 5125, triangles * 3);
  const json extension = {{"bufferView", b.view_of(stream)},
                          {"attributes",
                           {{"POSITION", ids.position},
                            {"TEXCOORD_0", ids.uv},
                            {"NORMAL", ids.normal},
                            {"COLOR_0", ids.colour}}}};
  b.mesh({{"POSITION", position}, {"TEXCOORD_0", uv}, {"NORMAL", normal}, {"COLOR_0", colour}},
         {{"indices", indices}, {"extensions", {{"KHR_draco_mesh_compression", extension}}}});
  b.node({{"mesh", 0}});
  b.json["extensionsUsed"] = b.json["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  return b;
}

TEST(ImportGltfDraco, ReadsBothMethodsWithAndWithoutMetadata) {
  const Mesh source = testing::sphere(8, 12);
  for (const auto method : {draco::MESH_EDGEBREAKER_ENCODING, draco::MESH_SEQUENTIAL_ENCODING}) {
    for (const bool metadata : {false, true}) {
      DracoIds ids{};
      const Model m =
          import(draco_model(draco_of(source, method, metadata, ids), ids, source.triangles.size()));
      const Mesh& mesh = m.mesh;
      ASSERT_EQ(mesh.triangles.size(), source.triangles.size());
      ASSERT_EQ(mesh.wedge_count(), mesh.uv0.size());
      for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
        for (int i = 0; i < 3; ++i) {
          const std::uint32_t w = mesh.triangles[t][static_cast<std::size_t>(i)];
          // The sphere: position and normal are the same unit vector.
          EXPECT_NEAR(length(mesh.positions[mesh.wedge_position[w]]), 1, 1e-3);
          EXPECT_NEAR(dot(mesh.positions[mesh.wedge_position[w]], mesh.normals[w]), 1, 2e-2);
          EXPECT_EQ(mesh.colours[w], (Vec4f{0, 0.2f, 1, 1}));
          EXPECT_GE(mesh.uv0[w].x, -1e-3f);
          EXPECT_LE(mesh.uv0[w].x, 1.001f);
        }
      }
    }
  }
}

TEST(ImportGltfDraco, AttributesOutsideTheStreamComeFromAccessors) {
  const Mesh source = testing::sphere(4, 6);
  DracoIds ids{};
  GltfBuilder b = draco_model(draco_of(source, draco::MESH_EDGEBREAKER_ENCODING, false, ids), ids,
                              source.triangles.size());
  json& primitive = b.json["meshes"][0]["primitives"][0];
  primitive["extensions"]["KHR_draco_mesh_compression"]["attributes"].erase("TEXCOORD_0");
  EXPECT_NE(refusal(b).find("/count: expected"), std::string::npos)
      << refusal(b);  // 3 values for more points
  b.json["accessors"][1]["count"] = import([&] {
                                      GltfBuilder c = b;
                                      c.json["meshes"][0]["primitives"][0]["attributes"].erase("TEXCOORD_0");
                                      return c;
                                    }())
                                        .mesh.positions.size();
  EXPECT_EQ(import(b).mesh.uv0[0], (Vec2f{0, 0}));
}

TEST(ImportGltfDraco, RefusesWhatItsHeaderPromisesTooMuch) {
  const Mesh source = testing::sphere(4, 6);
  DracoIds ids{};
  const Bytes good = draco_of(source, draco::MESH_EDGEBREAKER_ENCODING, false, ids);
  const auto with = [&](const Bytes& stream) {
    return refusal(draco_model(stream, ids, source.triangles.size()));
  };
  EXPECT_EQ(with(good), "");
  // The file of draco issue 1169: 61 bytes for 19 GiB.
  EXPECT_NE(with(testing::from_base64(
                     "RFJBQ08BAAEBXQEBAAB9AAAzMzMzMzMzMzMzMzMzMzMzMzMzMzMzMzMzMzMzMzMzMzMzMzMzMzMzMzMAAA=="))
                .find("Draco bitstream 2.2"),
            std::string::npos);
  Bytes many(good.begin(), good.begin() + 12);  // up to the kind of traversal
  for (const int n : {0x40, 0xff, 0xff, 0xff, 0xff, 0x0f, 0, 0, 0, 0})
    many.push_back(static_cast<std::uint8_t>(n));
  EXPECT_NE(with(many).find("triangles, found 4294967295"), std::string::npos) << with(many);
  many = {good.begin(), good.begin() + 12};
  for (const int n : {0xff, 0xff, 0xff, 0xff, 0x0f, 0x40, 0, 0, 0, 0})
    many.push_back(static_cast<std::uint8_t>(n));
  EXPECT_NE(with(many).find("vertices, found 4294967295"), std::string::npos) << with(many);
  Bytes cloud = good;
  cloud[7] = 0;
  EXPECT_NE(with(cloud).find("a Draco mesh"), std::string::npos);
  Bytes metadata = good;
  metadata[10] |= 0x80;
  EXPECT_NE(with(metadata), "");
}

TEST(ImportGltfDraco, RefusesEveryTruncationAndWrongIds) {
  const Mesh source = testing::sphere(4, 6);
  DracoIds ids{};
  const Bytes good = draco_of(source, draco::MESH_EDGEBREAKER_ENCODING, false, ids);
  for (std::size_t n = 0; n < good.size(); ++n) {
    EXPECT_NE(refusal(draco_model({good.begin(), good.begin() + static_cast<std::ptrdiff_t>(n)}, ids, 1)), "")
        << n;
  }
  DracoIds wrong = ids;
  wrong.uv = 99;
  EXPECT_NE(refusal(draco_model(good, wrong, 1)).find("no such attribute"), std::string::npos);
  std::swap(wrong.uv, wrong.position);
  EXPECT_NE(refusal(draco_model(good, wrong, 1)), "");
  wrong = ids;
  std::swap(wrong.uv, wrong.position);
  EXPECT_NE(refusal(draco_model(good, wrong, 1)).find("of 3 components, found 2"), std::string::npos);
}

/// A damaged stream is read or refused. (The command does this in a child with limits besides.)
TEST(ImportGltfDraco, SurvivesEveryFlippedByte) {
  const Mesh source = testing::sphere(4, 6);
  for (const auto method : {draco::MESH_EDGEBREAKER_ENCODING, draco::MESH_SEQUENTIAL_ENCODING}) {
    DracoIds ids{};
    const Bytes good = draco_of(source, method, false, ids);
    std::size_t refused = 0;
    for (std::size_t i = 0; i < good.size(); ++i) {
      for (const int flip : {0x01, 0x80, 0xff}) {
        Bytes damaged = good;
        damaged[i] = static_cast<std::uint8_t>(damaged[i] ^ flip);
        refused += !refusal(draco_model(damaged, ids, source.triangles.size())).empty();
      }
    }
    EXPECT_GT(refused, 30u);  // the magic, versions and counts at least
  }
}

// --- meshopt ---

Bytes encode_vertices(const void* data, std::size_t count, std::size_t stride) {
  Bytes out(meshopt_encodeVertexBufferBound(count, stride));
  out.resize(meshopt_encodeVertexBuffer(out.data(), out.size(), data, count, stride));
  return out;
}
Bytes encode_triangles(const std::vector<unsigned>& indices, std::size_t vertices) {
  Bytes out(meshopt_encodeIndexBufferBound(indices.size(), vertices));
  out.resize(meshopt_encodeIndexBuffer(out.data(), out.size(), indices.data(), indices.size()));
  return out;
}
Bytes encode_sequence(const std::vector<unsigned>& indices, std::size_t vertices) {
  Bytes out(meshopt_encodeIndexSequenceBound(indices.size(), vertices));
  out.resize(meshopt_encodeIndexSequence(out.data(), out.size(), indices.data(), indices.size()));
  return out;
}

/// Replaces a bufferView by its compressed form; the plain one refers to a fallback buffer without bytes.
void compress(GltfBuilder& b, int view, const Bytes& data, std::size_t count, std::size_t stride,
              const char* mode, const char* filter = nullptr) {
  const json encoded = b.json["bufferViews"][static_cast<std::size_t>(b.view_of(data))];
  json& v = b.json["bufferViews"][static_cast<std::size_t>(view)];
  json e = {{"buffer", 0},
            {"byteOffset", encoded["byteOffset"]},
            {"byteLength", data.size()},
            {"byteStride", stride},
            {"count", count},
            {"mode", mode}};
  if (filter) e["filter"] = filter;
  v = {{"buffer", 1}, {"byteLength", count * stride}, {"extensions", {{"EXT_meshopt_compression", e}}}};
  b.json["extensionsUsed"] = b.json["extensionsRequired"] = {"EXT_meshopt_compression"};
}
void close(GltfBuilder& b) {
  b.json["buffers"] = {
      {{"byteLength", b.bin.size()}},
      {{"byteLength", 1000}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}};
}

GltfBuilder meshopt_quad() {
  GltfBuilder b = quad();
  const std::vector<float> positions{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  compress(b, 0, encode_vertices(positions.data(), 4, 12), 4, 12, "ATTRIBUTES");
  compress(b, 2, encode_triangles({0, 1, 2, 0, 2, 3}, 4), 6, 2, "TRIANGLES");
  close(b);
  return b;
}

std::vector<Vec3f> corners(const Mesh& mesh) {
  std::vector<Vec3f> out;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    for (int i = 0; i < 3; ++i) out.push_back(mesh.positions[mesh.position_of(t, i)]);
  }
  return out;
}

TEST(ImportGltfMeshopt, ReadsAttributesAndTriangles) {
  // The codec may rotate the corners of a triangle.
  const std::vector<Vec3f> c = corners(import(meshopt_quad()).mesh);
  ASSERT_EQ(c.size(), 6u);
  for (std::size_t t = 0; t < 2; ++t) {
    EXPECT_EQ(cross(c[3 * t + 1] - c[3 * t], c[3 * t + 2] - c[3 * t]), (Vec3f{0, 0, 1}));
  }
  for (const Vec3f& p : corners(import(quad()).mesh)) EXPECT_NE(std::find(c.begin(), c.end(), p), c.end());
}

TEST(ImportGltfMeshopt, ReadsIndexSequences) {
  for (const std::size_t bytes : {2, 4}) {
    GltfBuilder b = quad();
    compress(b, 2, encode_sequence({0, 1, 3, 2}, 4), 4, bytes, "INDICES");
    b.json["accessors"][2]["count"] = 4;
    b.json["accessors"][2]["componentType"] = bytes == 2 ? 5123 : 5125;
    b.json["meshes"][0]["primitives"][0]["mode"] = 5;
    close(b);
    EXPECT_EQ(import(b).mesh.triangles, (std::vector<Triangle>{{0, 1, 3}, {1, 2, 3}}));
  }
}

TEST(ImportGltfMeshopt, UndoesTheOctahedralFilter) {
  const Vec3f n[4] = {{0, 0, 1}, {0.6f, 0, -0.8f}, {-0.48f, 0.64f, 0.6f}, {0, -1, 0}};
  float data[16] = {};
  for (std::size_t i = 0; i < 4; ++i) std::memcpy(data + 4 * i, &n[i], 12);
  for (const std::size_t stride : {4, 8}) {
    GltfBuilder b = quad();
    Bytes filtered(4 * stride);
    meshopt_encodeFilterOct(filtered.data(), 4, stride, stride == 4 ? 8 : 14, data);
    const int view = b.view_of(Bytes{0});
    compress(b, view, encode_vertices(filtered.data(), 4, stride), 4, stride, "ATTRIBUTES", "OCTAHEDRAL");
    b.json["bufferViews"][static_cast<std::size_t>(view)]["byteStride"] = stride;
    b.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] =
        b.accessor(view, "VEC3", stride == 4 ? 5120 : 5122, 4, {{"normalized", true}});
    close(b);
    const Mesh mesh = import(b).mesh;
    for (std::size_t i = 0; i < 4; ++i)
      EXPECT_GT(dot(mesh.normals[i], n[i]), stride == 4 ? 0.9995f : 0.9999999f) << i;
  }
}

TEST(ImportGltfMeshopt, UndoesTheExponentialFilter) {
  const std::vector<float> positions{0, 0, 0, 1, 0, 0, 1, 1, 1e-3f, -1000, 1, 0};
  GltfBuilder b = quad();
  Bytes filtered(48);
  meshopt_encodeFilterExp(filtered.data(), 4, 12, 24, positions.data());
  compress(b, 0, encode_vertices(filtered.data(), 4, 12), 4, 12, "ATTRIBUTES", "EXPONENTIAL");
  close(b);
  const Mesh mesh = import(b).mesh;
  for (std::size_t v = 0; v < 4; ++v) {
    for (int i = 0; i < 3; ++i) {
      const float p = positions[3 * v + static_cast<std::size_t>(i)];
      EXPECT_NEAR(mesh.positions[v][i] + mesh.origin[i], p, 2e-4f * std::fabs(p) + 2e-4f);
    }
  }
}

/// All three filters against the library's own, on random bits; those may differ by one in the last place.
TEST(ImportGltfMeshopt, FiltersAgreeWithMeshoptimizer) {
  testing::Random random{7};
  float unit[4 * 64];
  for (std::size_t i = 0; i < 64; ++i) {
    double l = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      unit[4 * i + k] = static_cast<float>(random.uniform() * 2 - 1);
      l += unit[4 * i + k] * unit[4 * i + k];
    }
    for (std::size_t k = 0; k < 4; ++k) unit[4 * i + k] /= static_cast<float>(std::sqrt(l));
  }
  Bytes bytes(64 * 8);
  const auto decoded = [&](MeshoptFilter filter) {
    return decode_meshopt({encode_vertices(bytes.data(), 64, 8), 64, 8, MeshoptMode::kAttributes, filter},
                          [](const std::string&, const std::string&) { FAIL(); });
  };
  meshopt_encodeFilterQuat(bytes.data(), 64, 8, 12, unit);
  Bytes ours = decoded(MeshoptFilter::kQuaternion), theirs = bytes;
  meshopt_decodeFilterQuat(theirs.data(), 64, 8);
  for (std::size_t i = 0; i < 64 * 4; ++i) {
    std::int16_t a = 0, b = 0;
    std::memcpy(&a, &ours[2 * i], 2);
    std::memcpy(&b, &theirs[2 * i], 2);
    EXPECT_NEAR(a, b, 1) << i;
  }
  meshopt_encodeFilterExp(bytes.data(), 64, 8, 20, unit);
  ours = decoded(MeshoptFilter::kExponential);
  theirs = bytes;
  meshopt_decodeFilterExp(theirs.data(), 64, 8);
  EXPECT_EQ(ours, theirs);
  for (std::uint8_t& b : bytes)
    b = static_cast<std::uint8_t>(random.next());  // anything goes without a crash
  for (const auto f : {MeshoptFilter::kOctahedral, MeshoptFilter::kQuaternion, MeshoptFilter::kExponential}) {
    EXPECT_EQ(decoded(f).size(), bytes.size());
  }
}

TEST(ImportGltfMeshopt, RefusesDamagedAndLyingViews) {
  const GltfBuilder good = meshopt_quad();
  EXPECT_EQ(refusal(good), "");
  const auto changed = [&](std::size_t view, const char* key, const json& value) {
    GltfBuilder b = good;
    b.json["bufferViews"][view]["extensions"]["EXT_meshopt_compression"][key] = value;
    return refusal(b);
  };
  EXPECT_NE(changed(0, "count", 1u << 31), "");
  EXPECT_NE(changed(0, "count", std::uint64_t{1} << 52), "");
  EXPECT_NE(changed(0, "count", 3), "");  // then the accessor has too little
  EXPECT_NE(changed(0, "byteStride", 6), "");
  EXPECT_NE(changed(0, "byteStride", 0), "");
  EXPECT_NE(changed(0, "mode", "ODD"), "");
  EXPECT_NE(changed(0, "filter", "OCTAHEDRAL"), "");  // 12 bytes are no normal
  EXPECT_NE(changed(0, "buffer", 1), "");
  EXPECT_NE(changed(0, "byteLength", 1 << 20), "");
  EXPECT_NE(changed(2, "count", 5), "");
  EXPECT_NE(changed(2, "byteStride", 1), "");
  EXPECT_NE(changed(2, "filter", "EXPONENTIAL"), "");
  EXPECT_NE(changed(2, "mode", "INDICES"), "");
  const std::uint64_t length =
      good.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["byteLength"];
  for (std::uint64_t n = 0; n < length; ++n) EXPECT_NE(changed(0, "byteLength", n), "") << n;
}

TEST(ImportGltfMeshopt, SurvivesEveryFlippedByte) {
  const GltfBuilder good = meshopt_quad();
  std::size_t refused = 0;
  for (std::size_t i = 80; i < good.bin.size(); ++i) {  // what stands before is the uncompressed quad
    for (const int flip : {0x01, 0x02, 0x10, 0x80, 0xff}) {
      GltfBuilder b = good;
      b.bin[i] = static_cast<std::uint8_t>(b.bin[i] ^ flip);
      refused += !refusal(b).empty();
    }
  }
  EXPECT_GT(refused, 20u);
}

}  // namespace texmesh::import_gltf_compression_test
