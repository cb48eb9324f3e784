// What tests of the files of scales share: a case to write, and a reader of every codec and attribute.
#pragma once
#include <draco/compression/decode.h>
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "format/base/archive.h"
#include "pipeline/import/import_images.h"
#include "stages/base/run_context.h"
#include "stages/condition/condition.h"
#include "stages/jpeg/jpeg.h"
#include "stages/scales/scales.h"
#include "stages/simplification/simplification.h"
#include "tests/support/meshes.h"

namespace texmesh::testing {

using Json = nlohmann::json;
inline const RunContext kOneThread{};
inline constexpr MeshCodec kCodecs[] = {MeshCodec::kDraco, MeshCodec::kMeshopt, MeshCodec::kQuantized,
                                        MeshCodec::kNone};

inline Pixels picture(std::uint32_t width, std::uint32_t height, std::uint32_t channels) {
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
  Previews previews;

  explicit Case(const Mesh& mesh, std::size_t material_count = 1, int scale_count = 8)
      : materials(material_count) {
    const ConditionedMesh conditioned = condition_mesh(mesh, false, {}, kOneThread);
    ScaleMap map;
    map.scales = scale_count;
    Random random{3};
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
    images.push_back({"image", ImageFormat::kPng, 512, 512, 3, 8, false, false, {}});
    add_plane(image, role, 3);
    if (alpha) add_plane(image, TextureRole::kAlpha, 1);
  }
  void add_plane(std::uint32_t image, TextureRole role, std::uint32_t channels) {
    TexturePlane plane;
    plane.image = image, plane.role = role, plane.channels = channels;
    plane.width_px = plane.height_px = 512;
    fragments.planes.push_back(plane);
    const std::uint32_t side = channels == 1 ? 64 : 32;  // previews of colour and alpha may differ in size
    previews.planes.push_back(
        {encode_jpeg(picture(side, side, channels), 60, Subsampling::k420), side, side});
  }
  ScaleFiles write(MeshCodec codec, ScalesOptions options = {}, int threads = 1) const {
    options.mesh_codec = codec;
    options.stream = false;  // every scale has a file
    RunContext context;
    context.threads = threads;
    return write_scales(scales, perceptual, materials, images, fragments, previews, options, context);
  }
  ScaleFiles write_streamed() const {
    return write_scales(scales, perceptual, materials, images, fragments, previews, {}, kOneThread);
  }
};

struct Glb {
  Json json;
  std::vector<std::uint8_t> bin;
};

inline std::uint32_t u32(const std::vector<std::uint8_t>& b, std::size_t at) {
  return b.at(at) | b.at(at + 1) << 8 | b.at(at + 2) << 16 | static_cast<std::uint32_t>(b.at(at + 3)) << 24;
}

inline Glb open(const std::vector<std::uint8_t>& bytes) {
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

inline std::vector<std::uint8_t> view_bytes(const Glb& glb, std::size_t index) {
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
inline std::vector<std::array<float, N>> read_accessor(const Glb& glb, std::size_t index) {
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
inline std::vector<std::array<float, N>> read_draco(const draco::Mesh& mesh, int id, float scale) {
  const draco::PointAttribute* a = mesh.GetAttributeByUniqueId(static_cast<std::uint32_t>(id));
  std::vector<std::array<float, N>> out(mesh.num_points());
  for (std::uint32_t i = 0; i < mesh.num_points(); ++i) {
    EXPECT_TRUE((a->ConvertValue<float, N>(a->mapped_index(draco::PointIndex(i)), out[i].data())));
    for (float& x : out[i]) x *= scale;
  }
  return out;
}

inline Primitive read_draco_primitive(const Glb& glb, const Json& json) {
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
inline std::vector<Primitive> read(const Glb& glb, Vec3d& translation, double& step) {
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

inline Sums expected(const Mesh& m, const NestedScale& s) {
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

inline Sums found(const std::vector<Primitive>& primitives, double step) {
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

inline void expect_round_trip(const Case& c, MeshCodec codec, ScalesOptions options = {}) {
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

}  // namespace texmesh::testing
