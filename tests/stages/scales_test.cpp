#include "stages/scales.h"

#include <draco/compression/decode.h>
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "format/archive.h"
#include "stages/condition.h"
#include "stages/jpeg.h"
#include "stages/png_writer.h"
#include "tests/support/meshes.h"

namespace texmesh {
namespace {

using Json = nlohmann::json;
const RunContext kOneThread{};
constexpr MeshCodec kCodecs[] = {MeshCodec::kDraco, MeshCodec::kMeshopt, MeshCodec::kQuantized,
                                 MeshCodec::kNone};

Pixels picture(std::uint32_t width, std::uint32_t height, std::uint32_t channels) {
  Pixels p{width, height, channels, {}};
  for (std::uint32_t i = 0; i < width * height * channels; ++i)
    p.data.push_back(static_cast<std::uint8_t>(i * 7 / 3));
  return p;
}

/// Everything write_scales needs; every scale is kept.
struct Case {
  NestedScales scales;
  PerceptualValues perceptual;
  std::vector<Material> materials;
  std::vector<Image> images;
  Fragments fragments;
  Ladder ladder;

  explicit Case(const Mesh& mesh, std::size_t material_count = 1, int scale_count = 8)
      : materials(material_count) {
    const ConditionedMesh conditioned = condition_mesh(mesh, false, {}, kOneThread);
    ScaleMap map;
    map.scales = scale_count;
    testing::Random random{3};
    for (std::size_t p = 0; p < conditioned.mesh.positions.size(); ++p) {
      int i = 0;
      while (i < scale_count && random.uniform() < 0.6) ++i;
      map.persistence.push_back(static_cast<std::uint8_t>(i));
    }
    scales = simplify(conditioned, map, {.min_triangles = 10}, kOneThread);
    perceptual.kept.assign(scales.scales.size(), 1);
  }
  void add_image(TextureRole role, bool alpha = false) {
    const auto image = static_cast<std::uint32_t>(images.size());
    images.push_back({"image", ImageFormat::kPng, 512, 512, 3, 8, false, {}});
    add_plane(image, role, 3);
    if (alpha) add_plane(image, TextureRole::kAlpha, 1);
  }
  void add_plane(std::uint32_t image, TextureRole role, std::uint32_t channels) {
    TexturePlane plane;
    plane.image = image, plane.role = role, plane.channels = channels;
    plane.width_px = plane.height_px = 512;
    fragments.planes.push_back(plane);
    PlaneLadder rungs;
    const std::uint32_t side = channels == 1 ? 64 : 32;  // previews of colour and alpha may differ in size
    rungs.preview = encode_jpeg(picture(side, side, channels), 60, Subsampling::k420);
    rungs.preview_width_px = rungs.preview_height_px = side;
    ladder.planes.push_back(rungs);
  }
  ScaleFiles write(MeshCodec codec, ScalesOptions options = {}, int threads = 1) const {
    options.mesh_codec = codec;
    RunContext context;
    context.threads = threads;
    return write_scales(scales, perceptual, materials, images, fragments, ladder, options, context);
  }
};

struct Glb {
  Json json;
  std::vector<std::uint8_t> bin;
};

std::uint32_t u32(const std::vector<std::uint8_t>& b, std::size_t at) {
  return b.at(at) | b.at(at + 1) << 8 | b.at(at + 2) << 16 | static_cast<std::uint32_t>(b.at(at + 3)) << 24;
}

Glb open(const std::vector<std::uint8_t>& bytes) {
  EXPECT_EQ(u32(bytes, 0), 0x46546c67u);
  EXPECT_EQ(u32(bytes, 4), 2u);
  EXPECT_EQ(u32(bytes, 8), bytes.size());
  const std::size_t length = u32(bytes, 12);
  EXPECT_EQ(length % 4, 0u);
  Glb glb;
  glb.json = Json::parse(bytes.begin() + 20, bytes.begin() + 20 + static_cast<std::ptrdiff_t>(length));
  EXPECT_EQ(u32(bytes, 20 + length), bytes.size() - 28 - length);
  glb.bin.assign(bytes.begin() + 28 + static_cast<std::ptrdiff_t>(length), bytes.end());
  EXPECT_EQ(glb.json["buffers"][0]["byteLength"], glb.bin.size());
  return glb;
}

struct Primitive {
  std::string part;
  int material = 0;
  std::vector<std::array<float, 3>> positions, normals;
  std::vector<std::array<float, 2>> uv0, uv1;
  std::vector<std::array<float, 4>> colours, tangents;
  std::vector<std::array<float, 1>> features;
  std::vector<std::uint32_t> indices;
};

std::vector<std::uint8_t> view_bytes(const Glb& glb, std::size_t index) {
  const Json& view = glb.json["bufferViews"][index];
  if (!view.contains("extensions")) {
    const auto begin = glb.bin.begin() + view["byteOffset"].get<std::ptrdiff_t>();
    return {begin, begin + view["byteLength"].get<std::ptrdiff_t>()};
  }
  const Json& e = view["extensions"]["EXT_meshopt_compression"];
  EXPECT_LE(view["byteOffset"].get<std::size_t>() + view["byteLength"].get<std::size_t>(),
            glb.json["buffers"][1]["byteLength"].get<std::size_t>());
  const std::size_t count = e["count"], stride = e["byteStride"];
  std::vector<std::uint8_t> out(count * stride);
  EXPECT_EQ(out.size(), view["byteLength"].get<std::size_t>());
  const std::uint8_t* in = glb.bin.data() + e["byteOffset"].get<std::size_t>();
  if (e["mode"] == "TRIANGLES") {
    EXPECT_EQ(meshopt_decodeIndexBuffer(out.data(), count, stride, in, e["byteLength"]), 0);
  } else {
    EXPECT_EQ(meshopt_decodeVertexBuffer(out.data(), count, stride, in, e["byteLength"]), 0);
  }
  return out;
}

/// Values of an accessor that has a buffer view, normalised ones scaled.
template <std::size_t N>
std::vector<std::array<float, N>> read_accessor(const Glb& glb, std::size_t index) {
  const Json& a = glb.json["accessors"][index];
  const Json& view = glb.json["bufferViews"][a["bufferView"].get<std::size_t>()];
  const std::vector<std::uint8_t> bytes = view_bytes(glb, a["bufferView"]);
  const int type = a["componentType"];
  const std::size_t size = type == 5126 || type == 5125 ? 4 : type == 5122 || type == 5123 ? 2 : 1;
  const std::size_t stride = view.value("byteStride", size * N);
  EXPECT_EQ(stride % (N == 1 ? 1 : 4), 0u);
  const bool normalized = a.value("normalized", false);
  std::vector<std::array<float, N>> out(a["count"].get<std::size_t>());
  for (std::size_t i = 0; i < out.size(); ++i)
    for (std::size_t k = 0; k < N; ++k) {
      const std::uint8_t* p = bytes.data() + i * stride + k * size;
      float x = 0;
      std::uint16_t u16 = 0;
      std::uint32_t u = 0;
      if (type == 5126) std::memcpy(&x, p, 4);
      if (type == 5125) std::memcpy(&u, p, 4), x = static_cast<float>(u);
      if (type == 5123 || type == 5122) std::memcpy(&u16, p, 2);
      if (type == 5123) x = normalized ? static_cast<float>(u16) / 65535 : u16;
      if (type == 5122) x = static_cast<float>(static_cast<std::int16_t>(u16)) / 32767;
      if (type == 5121) x = normalized ? static_cast<float>(*p) / 255 : *p;
      if (type == 5120) x = static_cast<float>(static_cast<std::int8_t>(*p)) / 127;
      out[i][k] = x;
    }
  return out;
}

template <std::size_t N>
std::vector<std::array<float, N>> read_draco(const draco::Mesh& mesh, int id, float scale) {
  const draco::PointAttribute* a = mesh.GetAttributeByUniqueId(static_cast<std::uint32_t>(id));
  std::vector<std::array<float, N>> out(mesh.num_points());
  for (std::uint32_t i = 0; i < mesh.num_points(); ++i) {
    EXPECT_TRUE((a->ConvertValue<float, N>(a->mapped_index(draco::PointIndex(i)), out[i].data())));
    for (float& x : out[i]) x *= scale;
  }
  return out;
}

Primitive read_draco_primitive(const Glb& glb, const Json& json) {
  const Json& e = json["extensions"]["KHR_draco_mesh_compression"];
  const std::vector<std::uint8_t> bytes = view_bytes(glb, e["bufferView"]);
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  draco::Decoder decoder;
  auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
  EXPECT_TRUE(decoded.ok());
  const draco::Mesh& mesh = *decoded.value();
  Primitive p;
  const Json& ids = e["attributes"];
  EXPECT_EQ(glb.json["accessors"][json["attributes"]["POSITION"].get<std::size_t>()]["count"],
            mesh.num_points());
  EXPECT_EQ(glb.json["accessors"][json["indices"].get<std::size_t>()]["count"], mesh.num_faces() * 3);
  p.positions = read_draco<3>(mesh, ids["POSITION"], 1);
  if (ids.contains("NORMAL")) p.normals = read_draco<3>(mesh, ids["NORMAL"], 1);
  if (ids.contains("TEXCOORD_0")) p.uv0 = read_draco<2>(mesh, ids["TEXCOORD_0"], 1);
  if (ids.contains("TEXCOORD_1")) p.uv1 = read_draco<2>(mesh, ids["TEXCOORD_1"], 1);
  if (ids.contains("COLOR_0")) p.colours = read_draco<4>(mesh, ids["COLOR_0"], 1);
  if (ids.contains("_FEATURE_ID_0")) p.features = read_draco<1>(mesh, ids["_FEATURE_ID_0"], 1);
  if (ids.contains("TANGENT")) p.tangents = read_draco<4>(mesh, ids["TANGENT"], 1);
  for (std::uint32_t f = 0; f < mesh.num_faces(); ++f)
    for (std::size_t k = 0; k < 3; ++k) p.indices.push_back(mesh.face(draco::FaceIndex(f))[k].value());
  return p;
}

/// Positions stay as stored; `transform` gives what the node does to them.
std::vector<Primitive> read(const Glb& glb, Vec3d& translation, double& step) {
  std::vector<Primitive> out;
  step = 1, translation = {};
  for (const Json& node : glb.json["nodes"]) {
    if (node.contains("scale")) {
      step = node["scale"][0];
      translation = {node["translation"][0], node["translation"][1], node["translation"][2]};
    }
    for (const Json& json : glb.json["meshes"][node["mesh"].get<std::size_t>()]["primitives"]) {
      Primitive p;
      const Json& a = json["attributes"];
      if (json.contains("extensions") && json["extensions"].contains("KHR_draco_mesh_compression")) {
        p = read_draco_primitive(glb, json);
      } else {
        p.positions = read_accessor<3>(glb, a["POSITION"]);
        if (a.contains("NORMAL")) p.normals = read_accessor<3>(glb, a["NORMAL"]);
        if (a.contains("TEXCOORD_0")) p.uv0 = read_accessor<2>(glb, a["TEXCOORD_0"]);
        if (a.contains("TEXCOORD_1")) p.uv1 = read_accessor<2>(glb, a["TEXCOORD_1"]);
        if (a.contains("COLOR_0")) p.colours = read_accessor<4>(glb, a["COLOR_0"]);
        if (a.contains("_FEATURE_ID_0")) p.features = read_accessor<1>(glb, a["_FEATURE_ID_0"]);
        if (a.contains("TANGENT")) p.tangents = read_accessor<4>(glb, a["TANGENT"]);
        for (const auto& i : read_accessor<1>(glb, json["indices"]))
          p.indices.push_back(static_cast<std::uint32_t>(i[0]));
      }
      const Json& bounds = glb.json["accessors"][a["POSITION"].get<std::size_t>()];
      for (std::size_t k = 0; k < 3; ++k) {
        float lo = p.positions[0][k], hi = lo;
        for (const auto& x : p.positions) lo = std::min(lo, x[k]), hi = std::max(hi, x[k]);
        EXPECT_EQ(bounds["min"][k].get<float>(), lo);
        EXPECT_EQ(bounds["max"][k].get<float>(), hi);
      }
      for (std::uint32_t i : p.indices) EXPECT_LT(i, p.positions.size());
      p.part = node["name"], p.material = json["material"];
      out.push_back(std::move(p));
    }
  }
  return out;
}

/// Corner by corner sums over all triangles: enough to tell that every triangle came through with its
/// attributes.
struct Sums {
  double triangles = 0, area = 0, uv_area = 0, uv1 = 0, normal = 0, colour = 0;
};

Sums expected(const Mesh& m, const NestedScale& s) {
  Sums sums;
  for (const Triangle& t : s.triangles) {
    auto p = [&](std::size_t k) { return to_double(m.positions[m.wedge_position[t[k]]]); };
    const Vec3d n = cross(p(1) - p(0), p(2) - p(0));
    sums.triangles += 1, sums.area += length(n);
    if (!m.uv0.empty())
      sums.uv_area += cross(to_double(m.uv0[t[1]]) - to_double(m.uv0[t[0]]),
                            to_double(m.uv0[t[2]]) - to_double(m.uv0[t[0]]));
    for (std::uint32_t w : t) {
      if (!m.uv1.empty()) sums.uv1 += m.uv1[w].x;
      if (!m.normals.empty()) sums.normal += dot(to_double(m.normals[w]), n);
      if (!m.colours.empty()) sums.colour += m.colours[w].x + 2 * m.colours[w].z;
    }
  }
  return sums;
}

Sums found(const std::vector<Primitive>& primitives, double step) {
  Sums sums;
  for (const Primitive& p : primitives)
    for (std::size_t i = 0; i < p.indices.size(); i += 3) {
      const std::uint32_t* t = &p.indices[i];
      auto at = [&](std::size_t k) {
        return Vec3d{p.positions[t[k]][0], p.positions[t[k]][1], p.positions[t[k]][2]} * step;
      };
      auto uv = [&](std::size_t k) { return Vec2d{p.uv0[t[k]][0], p.uv0[t[k]][1]}; };
      const Vec3d n = cross(at(1) - at(0), at(2) - at(0));
      sums.triangles += 1, sums.area += length(n);
      if (!p.uv0.empty()) sums.uv_area += cross(uv(1) - uv(0), uv(2) - uv(0));
      for (std::size_t k = 0; k < 3; ++k) {
        if (!p.uv1.empty()) sums.uv1 += p.uv1[t[k]][0];
        if (!p.normals.empty())
          sums.normal += dot(Vec3d{p.normals[t[k]][0], p.normals[t[k]][1], p.normals[t[k]][2]}, n);
        if (!p.colours.empty()) sums.colour += p.colours[t[k]][0] + 2 * p.colours[t[k]][2];
      }
    }
  return sums;
}

void expect_round_trip(const Case& c, MeshCodec codec, ScalesOptions options = {}) {
  SCOPED_TRACE(std::string(enum_name(codec)));
  const ScaleFiles files = c.write(codec, options);
  ASSERT_EQ(files.files.size(), c.scales.scales.size());
  std::set<std::array<float, 3>> finer;
  for (std::size_t i = 0; i < files.files.size(); ++i) {
    const NestedScale& scale = c.scales.scales[i];
    EXPECT_EQ(files.files[i].scale, scale.scale);
    Vec3d translation;
    double step = 1;
    const std::vector<Primitive> primitives = read(open(files.files[i].glb), translation, step);
    const Sums want = expected(c.scales.mesh, scale), got = found(primitives, step);
    EXPECT_EQ(got.triangles, want.triangles);
    EXPECT_EQ(files.files[i].triangles, got.triangles);
    EXPECT_NEAR(got.area, want.area, 0.01 * want.area);
    EXPECT_NEAR(got.uv_area, want.uv_area, 0.01 * std::fabs(want.uv_area) + 1e-4);
    EXPECT_NEAR(got.uv1, want.uv1, 1e-3 * std::fabs(want.uv1));
    EXPECT_NEAR(got.normal, want.normal, 0.02 * std::fabs(want.normal));
    EXPECT_NEAR(got.colour, want.colour, 0.003 * std::fabs(want.colour));
    std::size_t vertices = 0;
    std::set<std::array<float, 3>> places;
    for (const Primitive& p : primitives) {
      vertices += p.positions.size();
      places.insert(p.positions.begin(), p.positions.end());
    }
    EXPECT_EQ(files.files[i].vertices, vertices);
    // Bit for bit the same places in every scale, and nowhere far from the source.
    EXPECT_TRUE(i == 0 || std::includes(finer.begin(), finer.end(), places.begin(), places.end()));
    finer = places;
    if (i == 0) {
      for (const auto& x : places) {
        const Vec3d p = Vec3d{x[0], x[1], x[2]} * step + translation;
        double nearest = 1e9;
        for (Vec3f q : c.scales.mesh.positions) nearest = std::min(nearest, length(to_double(q) - p));
        EXPECT_LE(nearest, files.position_error * 1.7321 + 1e-6);
      }
    }
  }
}

TEST(Scales, EveryCodecKeepsASphereWithNormals) {
  const Case c(testing::bumpy_sphere(16, 24));
  ASSERT_GE(c.scales.scales.size(), 4u);
  for (MeshCodec codec : kCodecs) expect_round_trip(c, codec);
}

TEST(Scales, SeveralPartsMaterialsTextureSetsAndColours) {
  Mesh m = testing::bumpy_sphere(14, 20);
  for (std::size_t t = 0; t < m.triangles.size(); ++t) {
    m.triangle_material[t] = static_cast<std::uint16_t>(t < 200 ? 0 : 1);
    m.triangle_part[t] = static_cast<std::uint16_t>(t < 100 ? 0 : t < 300 ? 1 : 2);
  }
  m.part_names = {"top \"quoted\"", "middle", "bottom \xc3\xa4"};
  for (std::size_t w = 0; w < m.wedge_count(); ++w) {
    m.uv1.push_back({m.uv0[w].y, m.uv0[w].x});
    const auto grey = static_cast<float>(w % 256) / 255;
    m.colours.push_back({grey, 0.5f, 1 - grey, 1});
  }
  Case c(m, 2);
  c.add_image(TextureRole::kBaseColour);
  c.add_image(TextureRole::kOcclusionRoughnessMetallic);
  c.materials[0].base_colour_texture.image = 0;
  c.materials[1].occlusion_texture = {1, 1, Wrap::kClamp, Wrap::kMirror, true, {{0.25f, 0}, {2, 2}, 0.5f}};
  for (MeshCodec codec : kCodecs) {
    expect_round_trip(c, codec);
    const Glb glb = open(c.write(codec).files[0].glb);
    ASSERT_EQ(glb.json["nodes"].size(), 3u);
    EXPECT_EQ(glb.json["nodes"][0]["name"], m.part_names[0]);
    EXPECT_EQ(glb.json["nodes"][2]["name"], m.part_names[2]);
    EXPECT_EQ(glb.json["meshes"][1]["primitives"].size(), 2u);
    EXPECT_EQ(glb.json["asset"]["generator"], "texmesh");
  }
}

TEST(Scales, VeryManyPartsBecomeOneNode) {
  Mesh m = testing::bumpy_sphere(16, 24);
  m.part_names.clear();
  for (std::size_t t = 0; t < m.triangles.size(); ++t)
    m.triangle_part[t] = static_cast<std::uint16_t>(t % 257);
  for (int i = 0; i < 257; ++i) m.part_names.push_back("part " + std::to_string(i));
  const Case c(m, 1, 1);
  std::vector<std::size_t> want(257), got;
  for (std::uint16_t part : c.scales.mesh.triangle_part) ++want[part];
  for (MeshCodec codec : kCodecs) {
    expect_round_trip(c, codec);
    const ScaleFiles files = c.write(codec);
    const Glb glb = open(files.files[0].glb);
    EXPECT_EQ(glb.json["nodes"].size(), 1u);
    ASSERT_EQ(files.notes.size(), 1u);
    EXPECT_EQ(files.notes[0].code, "parts-merged");
    // The names are still there, and every triangle's vertices say whose it is.
    EXPECT_EQ(glb.json["meshes"][0]["extras"]["partNames"].get<std::vector<std::string>>(), m.part_names);
    const Json& ids = glb.json["meshes"][0]["primitives"][0]["extensions"]["EXT_mesh_features"]["featureIds"];
    EXPECT_EQ(ids[0]["featureCount"], 257);
    Vec3d translation;
    double step = 1;
    got.assign(257, 0);
    for (const Primitive& p : read(glb, translation, step))
      for (std::size_t i = 0; i < p.indices.size(); i += 3) {
        const float part = p.features[p.indices[i]][0];
        EXPECT_TRUE(part == p.features[p.indices[i + 1]][0] && part == p.features[p.indices[i + 2]][0]);
        ++got.at(static_cast<std::size_t>(part));
      }
    EXPECT_EQ(got, want);
    // A coarser scale names the parts that it still has.
    const NestedScale& coarsest = c.scales.scales.back();
    std::set<std::string> left, named;
    for (std::uint32_t t : coarsest.triangle_source)
      left.insert(m.part_names[c.scales.mesh.triangle_part[t]]);
    const Glb last = open(files.files.back().glb);
    for (const Json& name : last.json["meshes"][0]["extras"]["partNames"])
      named.insert(name.get<std::string>());
    EXPECT_LT(left.size(), 257u);
    EXPECT_EQ(named, left);
  }
}

TEST(Scales, MeshWithoutTextureCoordinates) {
  Mesh m = testing::bumpy_sphere(10, 14);
  m.uv0.clear(), m.normals.clear();
  Case c(m);
  c.add_image(TextureRole::kBaseColour);
  c.materials[0].base_colour_texture.image = 0;
  for (MeshCodec codec : kCodecs) {
    expect_round_trip(c, codec);
    const Glb glb = open(c.write(codec).files[0].glb);
    EXPECT_FALSE(glb.json["materials"][0]["pbrMetallicRoughness"].contains("baseColorTexture"));
  }
}

TEST(Scales, SingleTriangle) {
  Mesh m = testing::sheet(1, 0.1f);
  m.triangles.resize(1), m.triangle_material.resize(1), m.triangle_part.resize(1);
  const Case c(m);
  for (MeshCodec codec : kCodecs) expect_round_trip(c, codec);
}

TEST(Scales, MoreThan65535VerticesTakeWideIndices) {
  const Case c(testing::sheet(260, 0.05f), 1, 1);
  for (MeshCodec codec : kCodecs) {
    SCOPED_TRACE(std::string(enum_name(codec)));
    const ScaleFiles files = c.write(codec);
    const Glb glb = open(files.files[0].glb);
    EXPECT_EQ(glb.json["accessors"][glb.json["meshes"][0]["primitives"][0]["indices"].get<std::size_t>()]
                      ["componentType"],
              5125);
    Vec3d translation;
    double step = 1;
    const std::vector<Primitive> primitives = read(glb, translation, step);
    const Sums want = expected(c.scales.mesh, c.scales.scales[0]), got = found(primitives, step);
    EXPECT_EQ(got.triangles, want.triangles);
    EXPECT_NEAR(got.area, want.area, 0.01 * want.area);
    EXPECT_NEAR(got.uv_area, want.uv_area, 0.01 * std::fabs(want.uv_area));
  }
}

TEST(Scales, HugeRangesOfTextureCoordinatesStayFine) {
  Mesh m = testing::bumpy_sphere(14, 20);
  for (std::size_t w = 0; w < m.wedge_count(); ++w)
    m.uv0[w] = {m.uv0[w].x + (w % 2 ? 1500.f : -700.f), m.uv0[w].y * 3};
  Case c(m);
  c.add_image(TextureRole::kBaseColour);
  c.materials[0].base_colour_texture.image = 0;
  for (MeshCodec codec : kCodecs) {
    SCOPED_TRACE(std::string(enum_name(codec)));
    Vec3d translation;
    double step = 1;
    std::multiset<float> want, got;
    for (std::uint32_t w = 0; w < c.scales.mesh.wedge_count(); ++w) want.insert(c.scales.mesh.uv0[w].y);
    const std::vector<Primitive> primitives = read(open(c.write(codec).files[0].glb), translation, step);
    float worst = 0;
    for (const Primitive& p : primitives)
      for (const auto& uv : p.uv0) {
        auto near = want.lower_bound(uv[1]);
        float distance = near != want.end() ? *near - uv[1] : 9.f;
        if (near != want.begin()) distance = std::min(distance, uv[1] - *std::prev(near));
        worst = std::max(worst, distance);
      }
    EXPECT_LE(worst * 512, 0.5f);  // texels
  }
}

TEST(Scales, BitsFollowTheOptionsAndTheEdges) {
  const Case c(testing::bumpy_sphere(16, 24));
  const ScaleFiles automatic = c.write(MeshCodec::kDraco);
  EXPECT_EQ(automatic.position_bits, 14);
  EXPECT_EQ(automatic.uv_bits, 15);  // 1/8 texel of 4096
  const ScaleFiles by_edges = c.write(MeshCodec::kDraco, {.least_position_bits = 1, .least_uv_bits = 1});
  EXPECT_GE(by_edges.position_bits, 6);
  EXPECT_LE(by_edges.position_bits, 12);
  EXPECT_GT(by_edges.position_error, automatic.position_error);
  EXPECT_EQ(by_edges.uv_bits, 15);
  double mean = 0, count = 0;
  const Mesh& m = c.scales.mesh;
  for (const Triangle& t : m.triangles)
    for (std::size_t k = 0; k < 3; ++k)
      mean += length(m.positions[m.wedge_position[t[k]]] - m.positions[m.wedge_position[t[(k + 1) % 3]]]),
          ++count;
  EXPECT_LE(by_edges.position_error * 1.7321, mean / count / 4);
  EXPECT_GT(automatic.position_error, 0);
  ScalesOptions options;
  options.position_bits = 18, options.uv_bits = 15;
  const ScaleFiles asked = c.write(MeshCodec::kDraco, options);
  EXPECT_EQ(asked.position_bits, 18);
  EXPECT_EQ(asked.uv_bits, 15);
  EXPECT_LT(asked.position_error, automatic.position_error / 4);
  EXPECT_EQ(c.write(MeshCodec::kQuantized, options).position_bits, 16);
  options.position_bits = 24, options.uv_bits = 24;
  expect_round_trip(c, MeshCodec::kDraco, options);
  EXPECT_EQ(c.write(MeshCodec::kNone).position_error, 0);
  EXPECT_EQ(c.write(MeshCodec::kNone).position_bits, 0);
}

TEST(Scales, ASmallPartBesideALargeOneKeepsItsShape) {
  // As under nodes of different scales: few triangles, a hundredth of the size.
  Mesh small = testing::bumpy_sphere(8, 12);
  for (Vec3f& p : small.positions) p = p * 0.01f;
  Mesh m = testing::side_by_side({testing::bumpy_sphere(40, 60), small});
  const std::size_t first = m.triangles.size() - small.triangles.size();
  m.part_names = {"large", "small"};
  for (std::size_t t = 0; t < m.triangles.size(); ++t) m.triangle_part[t] = t >= first;
  const Case c(m, 1, 1);
  double edges = 0;
  for (const Triangle& t : small.triangles)
    edges +=
        length(small.positions[small.wedge_position[t[0]]] - small.positions[small.wedge_position[t[1]]]);
  for (MeshCodec codec : kCodecs) {
    SCOPED_TRACE(std::string(enum_name(codec)));
    const ScaleFiles files = c.write(codec);
    EXPECT_EQ(files.files[0].triangles, c.scales.scales[0].triangles.size());
    EXPECT_LE(files.position_error, edges / static_cast<double>(small.triangles.size()) / 8);
  }
}

TEST(Scales, TrianglesThatTheGridCollapsesAreDropped) {
  const Case c(testing::bumpy_sphere(40, 60), 1, 1);
  ScalesOptions options;
  options.position_bits = 4;
  for (MeshCodec codec : {MeshCodec::kDraco, MeshCodec::kMeshopt, MeshCodec::kQuantized}) {
    SCOPED_TRACE(std::string(enum_name(codec)));
    const ScaleFiles files = c.write(codec, options);
    EXPECT_LT(files.files[0].triangles, c.scales.scales[0].triangles.size());
    EXPECT_GT(files.files[0].triangles, 100u);
    Vec3d translation;
    double step = 1;
    for (const Primitive& p : read(open(files.files[0].glb), translation, step))
      for (std::size_t i = 0; i < p.indices.size(); i += 3) {
        EXPECT_NE(p.positions[p.indices[i]], p.positions[p.indices[i + 1]]);
        EXPECT_NE(p.positions[p.indices[i + 1]], p.positions[p.indices[i + 2]]);
        EXPECT_NE(p.positions[p.indices[i + 2]], p.positions[p.indices[i]]);
      }
  }
}

TEST(Scales, MaterialsCarryWhatTheSourceSays) {
  Case c(testing::cube(), 2);
  c.add_image(TextureRole::kBaseColour, true);
  c.add_image(TextureRole::kNormal);
  Material& m = c.materials[0];
  m.name = "glass";
  m.base_colour = {0.1f, 0.2f, 0.3f, 0.4f};
  m.metallic = 0.25f, m.roughness = 1.5f;
  m.emissive = {1, 0.5f, 0};
  m.alpha_mode = AlphaMode::kMask, m.alpha_cutoff = 0.3f;
  m.double_sided = m.unlit = true;
  m.base_colour_texture = {0, 0, Wrap::kClamp, Wrap::kMirror, true, {{0.5f, 0}, {2, 3}, 0.25f}};
  m.normal_texture.image = 1, m.normal_scale = 0.5f;
  c.materials[1].alpha_mode = AlphaMode::kBlend;
  c.materials[1].base_colour_texture.image = 0;
  const Glb glb = open(c.write(MeshCodec::kDraco).files[0].glb);
  const Json& j = glb.json["materials"][0];
  EXPECT_EQ(j["name"], "glass");
  EXPECT_EQ(j["pbrMetallicRoughness"]["baseColorFactor"], Json::parse("[0.1,0.2,0.3,0.4]"));
  EXPECT_EQ(j["pbrMetallicRoughness"]["metallicFactor"], 0.25);
  EXPECT_EQ(j["pbrMetallicRoughness"]["roughnessFactor"], 1.0);
  EXPECT_EQ(j["emissiveFactor"], Json::parse("[1.0,0.5,0.0]"));
  EXPECT_EQ(j["alphaMode"], "MASK");
  EXPECT_EQ(j["alphaCutoff"], 0.3);
  EXPECT_EQ(j["doubleSided"], true);
  EXPECT_TRUE(j["extensions"].contains("KHR_materials_unlit"));
  const Json& t = j["pbrMetallicRoughness"]["baseColorTexture"];
  EXPECT_EQ(t["extensions"]["KHR_texture_transform"],
            Json::parse(R"({"offset":[0.5,0.0],"rotation":0.25,"scale":[2.0,3.0]})"));
  const Json& texture = glb.json["textures"][t["index"].get<std::size_t>()];
  EXPECT_EQ(glb.json["samplers"][texture["sampler"].get<std::size_t>()],
            Json::parse(R"({"magFilter":9728,"minFilter":9984,"wrapS":33071,"wrapT":33648})"));
  EXPECT_EQ(j["normalTexture"]["scale"], 0.5);
  EXPECT_EQ(glb.json["materials"][1]["alphaMode"], "BLEND");
  ASSERT_EQ(glb.json["images"].size(), 2u);
  EXPECT_EQ(glb.json["images"][0]["name"], "texture/0");
  EXPECT_EQ(glb.json["images"][0]["mimeType"], "image/png");
  EXPECT_EQ(glb.json["images"][1]["name"], "texture/1");
  EXPECT_EQ(view_bytes(glb, glb.json["images"][1]["bufferView"]), c.ladder.planes[2].preview);

  // The PNG holds the colours of one preview and the alpha of the other.
  Image png = probe_image("preview", view_bytes(glb, glb.json["images"][0]["bufferView"]), {});
  EXPECT_EQ(png.channels, 4);
  const Pixels both = decode_image(png), colour = decode_jpeg(c.ladder.planes[0].preview, 1 << 20);
  const Pixels alpha = decode_jpeg(c.ladder.planes[1].preview, 1 << 20);
  ASSERT_EQ(both.width_px, 32u);
  for (std::uint32_t y = 0; y < 32; ++y)
    for (std::uint32_t x = 0; x < 32; ++x) {
      EXPECT_EQ(both.at(x, y)[1], colour.at(x, y)[1]);
      EXPECT_EQ(both.at(x, y)[3], *alpha.at(2 * x, 2 * y));
    }
}

TEST(Scales, MaterialExtensionsComeBackAsTheyWere) {
  Case c(testing::cube());
  c.add_image(TextureRole::kData);
  c.add_image(TextureRole::kNormal);
  TextureRef data, normal, unseen;
  data.image = 0, normal.image = 1;
  data.transform.scale = {2, 2};
  unseen.image = 0, unseen.texcoord = 1;  // the mesh has no such coordinates
  c.materials[0].extensions = {
      {"KHR_materials_clearcoat",
       {{"clearcoatFactor", {0.1f}}},
       {{"clearcoatTexture", data}, {"clearcoatNormalTexture", normal, 0.5f}}},
      {"KHR_materials_ior", {{"ior", {1.4f}}}, {}},
      {"KHR_materials_sheen", {{"sheenColorFactor", {0, 0.5f, 1}}}, {{"sheenColorTexture", unseen}}}};
  const Glb glb = open(c.write(MeshCodec::kDraco).files[0].glb);
  const Json& e = glb.json["materials"][0]["extensions"];
  EXPECT_EQ(e["KHR_materials_clearcoat"], Json::parse(R"({"clearcoatFactor":0.1,
      "clearcoatTexture":{"index":0,"extensions":{"KHR_texture_transform":{"scale":[2.0,2.0]}}},
      "clearcoatNormalTexture":{"index":1,"scale":0.5}})"));
  EXPECT_EQ(e["KHR_materials_ior"], Json::parse(R"({"ior":1.4})"));
  EXPECT_EQ(e["KHR_materials_sheen"], Json::parse(R"({"sheenColorFactor":[0.0,0.5,1.0]})"));
  const std::vector<std::string> used = glb.json["extensionsUsed"];
  for (const char* name : {"KHR_materials_clearcoat", "KHR_materials_ior", "KHR_materials_sheen"})
    EXPECT_EQ(std::count(used.begin(), used.end(), name), 1) << name;
  for (const auto& name : glb.json["extensionsRequired"]) EXPECT_EQ(name, "KHR_draco_mesh_compression");
}

TEST(Scales, TangentsOfTheSourceComeWhereANormalMapNeedsThem) {
  Mesh m = testing::bumpy_sphere(14, 20);
  for (std::size_t w = 0; w < m.wedge_count(); ++w) {
    const Vec3f p = m.positions[m.wedge_position[w]];
    const float l = std::sqrt(p.x * p.x + p.z * p.z), sign = w % 2 ? 1.0f : -1.0f;
    m.tangents.push_back(l > 1e-3f ? Vec4f{p.z / l, 0, -p.x / l, sign} : Vec4f{1, 0, 0, sign});
  }
  for (std::size_t t = 0; t < m.triangles.size(); ++t) m.triangle_material[t] = t % 3 == 0;
  Case c(m, 2);
  c.add_image(TextureRole::kNormal);
  c.materials[1].normal_texture.image = 0;
  for (MeshCodec codec : kCodecs)
    for (int bits : {8, 9, 10}) {
      const ScaleFiles files = c.write(codec, {.tangent_bits = bits});
      Vec3d translation;
      double step = 1;
      for (const ScaleFile& file : files.files)
        for (const Primitive& p : read(open(file.glb), translation, step)) {
          ASSERT_EQ(p.tangents.size(), p.material == 1 ? p.positions.size() : 0u);
          for (std::size_t i = 0; i < p.tangents.size(); ++i) {
            const auto& t = p.tangents[i];
            EXPECT_TRUE(t[3] == 1.0f || t[3] == -1.0f) << t[3];
            EXPECT_NEAR(std::sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]), 1, 0.01);
            const double x = p.positions[i][0] * step + translation.x,
                         z = p.positions[i][2] * step + translation.z;
            // Along the circle of latitude; coarser scales have wedges that came from a neighbour's place.
            EXPECT_NEAR(t[0] * x + t[2] * z, 0, file.scale == 0 ? 0.02 : 0.5);
          }
        }
    }
  c.scales.mesh
      .tangents[c.scales.scales[0].triangles[0][0]] = {};  // a wedge without: nothing for its primitive
  Vec3d translation;
  double step = 1;
  for (const Primitive& p : read(open(c.write(MeshCodec::kDraco).files[0].glb), translation, step))
    if (c.scales.mesh.triangle_material[c.scales.scales[0].triangle_source[0]] == p.material) {
      EXPECT_TRUE(p.tangents.empty());
    }
}

TEST(Scales, PngOfEveryKindReadsBack) {
  for (std::uint32_t channels : {1u, 3u, 4u}) {
    const Pixels p = picture(37, 21, channels);
    EXPECT_EQ(decode_image(probe_image("made", write_png(p), {})).data, p.data);
  }
  EXPECT_THROW(write_png(picture(3, 3, 2)), StageError);
  EXPECT_THROW(write_png(Pixels{}), StageError);
}

TEST(Scales, OnlyKeptScalesAreWritten) {
  Case c(testing::bumpy_sphere(16, 24));
  c.perceptual.kept.assign(c.scales.scales.size(), 0);
  c.perceptual.kept.back() = 1;
  const ScaleFiles files = c.write(MeshCodec::kDraco);
  ASSERT_EQ(files.files.size(), 2u);
  EXPECT_EQ(files.files[0].scale, 0);
  EXPECT_EQ(files.files[1].scale, c.scales.scales.back().scale);
  EXPECT_LT(files.files[1].glb.size(), files.files[0].glb.size() / 2);
}

TEST(Scales, SameBytesForAnyNumberOfThreads) {
  Case c(testing::bumpy_sphere(16, 24));
  c.add_image(TextureRole::kBaseColour, true);
  c.materials[0].base_colour_texture.image = 0;
  for (MeshCodec codec : kCodecs)
    EXPECT_EQ(encode_artefact(c.write(codec, {}, 1)), encode_artefact(c.write(codec, {}, 8)));
}

}  // namespace
}  // namespace texmesh
