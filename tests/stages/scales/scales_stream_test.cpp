#include <draco/compression/decode.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <tuple>

#include "format/base/bytes.h"
#include "format/split/split_reader.h"
#include "format/split/split_stream.h"
#include "stages/base/run_context.h"
#include "stages/condition/condition.h"
#include "stages/scales/scales.h"
#include "stages/simplification/simplification.h"
#include "tests/support/meshes.h"

namespace texmesh::scales_stream_test {

using Json = nlohmann::json;
/// One corner as a file's reader and a stream's reader get it: to the bit but for normals.
struct Corner {
  std::vector<float> exact;  // position, texture coordinates, colour
  std::array<float, 3> normal{};
  friend bool operator<(const Corner& a, const Corner& b) { return a.exact < b.exact; }
  friend bool operator==(const Corner& a, const Corner& b) { return a.exact == b.exact; }
};
struct Face {
  std::string part;
  int material = 0;
  std::array<Corner, 3> corners;
  auto key() const { return std::tie(part, material, corners[0], corners[1], corners[2]); }
};
using Faces = std::vector<Face>;

void sort_faces(Faces& faces) {
  for (Face& f : faces)
    std::rotate(f.corners.begin(), std::min_element(f.corners.begin(), f.corners.end()), f.corners.end());
  std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) { return a.key() < b.key(); });
}

using Normals = std::multimap<std::vector<float>, std::array<float, 3>>;  // S_0's, of corners

/// Two scales' faces, in equal order: equal to the bit but for normals. Those of the stream are S_0's, but
/// for what their rounding may differ by.
void expect_same(const Faces& file, const Faces& stream, const Normals& finest, double normal_cosine) {
  ASSERT_EQ(file.size(), stream.size());
  for (std::size_t i = 0; i < file.size(); ++i) {
    ASSERT_TRUE(file[i].key() == stream[i].key()) << "face " << i;
    for (const Corner& corner : stream[i].corners) {
      const auto [from, to] = finest.equal_range(corner.exact);
      const auto& b = corner.normal;
      // A relaxed junction's wedge is not among S_0's.
      const bool met = from == to || std::any_of(from, to, [&](const auto& entry) {
                         const auto& a = entry.second;
                         return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] >= normal_cosine;
                       });
      EXPECT_TRUE(met) << "face " << i;
    }
  }
}

std::uint32_t u32(const Bytes& b, std::size_t at) {
  return b.at(at) | b.at(at + 1) << 8 | b.at(at + 2) << 16 | static_cast<std::uint32_t>(b.at(at + 3)) << 24;
}

/// Values of one attribute at one point of a decoded Draco mesh.
template <std::size_t N>
std::array<float, N> draco_value(const draco::Mesh& mesh, const Json& id, draco::PointIndex point) {
  const draco::PointAttribute* a = mesh.GetAttributeByUniqueId(id.get<std::uint32_t>());
  std::array<float, N> out;
  EXPECT_TRUE((a->ConvertValue<float, N>(a->mapped_index(point), out.data())));
  return out;
}

Corner draco_corner(const draco::Mesh& mesh, const Json& ids, draco::PointIndex point) {
  Corner c;
  const auto put = [&](const auto& values) { c.exact.insert(c.exact.end(), values.begin(), values.end()); };
  put(draco_value<3>(mesh, ids["POSITION"], point));
  for (const char* uv : {"TEXCOORD_0", "TEXCOORD_1"})
    if (ids.contains(uv)) put(draco_value<2>(mesh, ids[uv], point));
  if (ids.contains("COLOR_0")) put(draco_value<4>(mesh, ids["COLOR_0"], point));
  if (ids.contains("NORMAL")) c.normal = draco_value<3>(mesh, ids["NORMAL"], point);
  return c;
}

/// All faces of a scale's file (Draco).
Faces file_faces(const Bytes& glb) {
  const std::size_t length = u32(glb, 12);
  const Json json = Json::parse(glb.begin() + 20, glb.begin() + 20 + static_cast<std::ptrdiff_t>(length));
  Faces faces;
  for (const Json& node : json["nodes"])
    for (const Json& primitive : json["meshes"][node["mesh"].get<std::size_t>()]["primitives"]) {
      const Json& e = primitive["extensions"]["KHR_draco_mesh_compression"];
      const Json& view = json["bufferViews"][e["bufferView"].get<std::size_t>()];
      draco::DecoderBuffer buffer;
      buffer.Init(
          reinterpret_cast<const char*>(glb.data()) + 28 + length + view.value("byteOffset", std::size_t{0}),
          view["byteLength"].get<std::size_t>());
      draco::Decoder decoder;
      const auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
      EXPECT_TRUE(decoded.ok());
      const draco::Mesh& mesh = *decoded.value();
      for (std::uint32_t f = 0; f < mesh.num_faces(); ++f) {
        Face face{node["name"], primitive["material"], {}};
        for (std::size_t k = 0; k < 3; ++k)
          face.corners[k] = draco_corner(mesh, e["attributes"], mesh.face(draco::FaceIndex(f))[k]);
        faces.push_back(std::move(face));
      }
    }
  sort_faces(faces);
  return faces;
}

Corner stream_corner(const SplitStreamHead& head, const SplitMesh& mesh, std::uint32_t wedge) {
  Corner c;
  const auto& place = mesh.points()[mesh.wedge_point()[wedge]];
  for (int axis = 0; axis < 3; ++axis)
    c.exact.push_back(head.position.value(place[static_cast<std::size_t>(axis)], axis));
  for (std::size_t k = 0; k < head.attributes.size(); ++k) {
    const SplitAttribute& a = head.attributes[k];
    const auto n = static_cast<std::size_t>(split_components(a.kind));
    const std::int32_t* v = &mesh.values(k)[wedge * n];
    if (a.kind == SplitKind::kNormal) {
      c.normal = octahedral_normal(v[0], v[1], a.grid.bits);
    } else if (a.kind == SplitKind::kColour) {
      for (std::size_t i = 0; i < n; ++i)
        c.exact.push_back(static_cast<float>(v[i]) / static_cast<float>((1 << a.grid.bits) - 1));
    } else {
      for (int i = 0; i < 2; ++i) c.exact.push_back(a.grid.value(v[i], i));
    }
  }
  return c;
}

/// All faces that the reader's mesh shows.
Faces stream_faces(const SplitStreamReader& reader, const std::vector<std::string>& parts) {
  const SplitMesh& mesh = reader.mesh();
  Faces faces;
  for (std::uint32_t f = 0; f < mesh.face_count(); ++f) {
    const SplitGroup group = reader.head().groups[mesh.face_group()[f]];
    Face face{parts.at(group.part), group.material, {}};
    std::array<SplitMesh::Point, 3> places;
    for (std::uint32_t k = 0; k < 3; ++k) {
      face.corners[k] = stream_corner(reader.head(), mesh, mesh.wedge_at(f, k));
      places[k] = mesh.points()[mesh.point_at(f, k)];
    }
    if (places[0] != places[1] && places[1] != places[2] && places[2] != places[0])
      faces.push_back(std::move(face));
  }
  sort_faces(faces);
  return faces;
}

struct Case {
  NestedScales scales;
  PerceptualValues perceptual;
  std::vector<Material> materials;

  explicit Case(const Mesh& mesh, std::size_t material_count = 1, SimplificationOptions options = {}) {
    const ConditionedMesh conditioned = condition_mesh(mesh, false, {}, {});
    ScaleMap map;
    map.scales = 8;
    testing::Random random{3};
    for (std::size_t p = 0; p < conditioned.mesh.positions.size(); ++p) {
      int i = 0;
      while (i < map.scales && random.uniform() < 0.6) ++i;
      map.persistence.push_back(static_cast<std::uint8_t>(i));
    }
    options.min_triangles = std::min(options.min_triangles, 10);
    scales = simplify(conditioned, map, options, {});
    perceptual.kept.assign(scales.scales.size(), 1);
    materials.resize(material_count);
    materials[0].base_colour_texture.texcoord = 0;
  }
  ScaleFiles write(ScalesOptions options = {}, int threads = 1) const {
    RunContext context;
    context.threads = threads;
    return write_scales(scales, perceptual, materials, {}, {}, {}, options, context);
  }
};

/// Each file's faces, as files are written without a stream, are those of the stream up to its scale. Beside
/// a stream only the finest and the coarsest have files.
void expect_files_in_stream(const Case& c, ScalesOptions options = {}) {
  const ScaleFiles with_stream = c.write(options);
  const Bytes& stream = with_stream.stream;
  ASSERT_FALSE(stream.empty());
  options.stream = false;
  const ScaleFiles files = c.write(options);
  ASSERT_GE(files.files.size(), 3u);
  ASSERT_EQ(with_stream.files.size(), files.files.size());
  SplitStreamReader reader(read_split_head(stream));
  ASSERT_EQ(reader.head().scales.size(), files.files.size());
  Normals finest;
  for (const Face& face : file_faces(files.files[0].glb))
    for (const Corner& corner : face.corners) finest.emplace(corner.exact, corner.normal);
  for (std::size_t i = 0; i < files.files.size(); ++i) {
    const ScaleFile& file = files.files[files.files.size() - 1 - i];
    SCOPED_TRACE("scale " + std::to_string(file.scale));
    reader.read_to_scale(i, stream);
    EXPECT_EQ(reader.head().scales[i].scale, file.scale);
    EXPECT_EQ(reader.head().scales[i].triangles, file.triangles);
    const ScaleFile& beside = with_stream.files[files.files.size() - 1 - i];
    EXPECT_EQ(beside.triangles, file.triangles);
    if (i == 0 || i + 1 == files.files.size()) {
      EXPECT_EQ(beside.vertices, file.vertices);
      EXPECT_FALSE(beside.glb.empty());
    } else {
      EXPECT_EQ(beside.vertices, reader.head().scales[i].wedges);
      EXPECT_TRUE(beside.glb.empty());
    }
    expect_same(file_faces(file.glb), stream_faces(reader, c.scales.mesh.part_names), finest,
                c.scales.mesh.normals.empty() ? 0 : std::cos(4.0 / (1 << (options.normal_bits - 1))));
  }
}

TEST(ScalesStream, HasTheFacesOfEveryFile) { expect_files_in_stream(Case(testing::bumpy_sphere(24, 36))); }

TEST(ScalesStream, HasPartsMaterialsAndColours) {
  Mesh m = testing::bumpy_sphere(20, 28);
  m.part_names = {"body", "cap"};
  for (std::size_t t = 0; t < m.triangles.size(); ++t) {
    const Vec3f p = m.positions[m.position_of(static_cast<std::uint32_t>(t), 0)];
    m.triangle_material[t] = p.x > 0 ? 1 : 0;
    m.triangle_part[t] = p.y > 0.5f ? 1 : 0;
  }
  for (std::size_t w = 0; w < m.wedge_count(); ++w)
    m.colours.push_back({static_cast<float>(w % 256) / 255, 0.2f, static_cast<float>(w % 7) / 255, 1});
  expect_files_in_stream(Case(m, 2));
}

/// Names and feature ids are in the files alone; the stream's scales are of one part.
TEST(ScalesStream, HasTheFacesOfMergedParts) {
  Mesh m = testing::bumpy_sphere(20, 28);
  m.part_names = {"parts"};  // the name of the files' one node
  for (int i = 1; i < 257; ++i) m.part_names.push_back("part " + std::to_string(i));
  for (std::size_t t = 0; t < m.triangles.size(); ++t)
    m.triangle_part[t] = static_cast<std::uint16_t>(t / 4 % 257);
  expect_files_in_stream(Case(m));
}

/// Small bodies beside a large one: simplification lets them vanish whole, the stream brings them back.
TEST(ScalesStream, BringsBackWholeComponents) {
  std::vector<Mesh> bodies{testing::bumpy_sphere(30, 44)};
  for (int i = 0; i < 6; ++i) {
    Mesh small = i % 2 ? testing::bumpy_sphere(5, 7) : testing::cube();
    if (small.normals.empty()) small.normals.assign(small.wedge_count(), {0, 0, 1});
    for (Vec3f& p : small.positions) p = p * (0.004f + 0.004f * static_cast<float>(i));
    bodies.push_back(std::move(small));
  }
  const Case c(testing::side_by_side(bodies));
  const auto& collapses = c.scales.collapses;
  ASSERT_TRUE(std::any_of(collapses.begin(), collapses.end(), [](const Collapse& x) {
    return x.vanishes_with_component();
  })) << "nothing vanished";
  expect_files_in_stream(c);
}

TEST(ScalesStream, HoldsOnACoarseGrid) {
  ScalesOptions options;
  options.position_bits = 5;
  expect_files_in_stream(Case(testing::bumpy_sphere(24, 36)), options);
}

TEST(ScalesStream, IsThereForEveryCodecAndCanBeTurnedOff) {
  const Case c(testing::bumpy_sphere(14, 20));
  for (const MeshCodec codec :
       {MeshCodec::kDraco, MeshCodec::kMeshopt, MeshCodec::kQuantized, MeshCodec::kNone}) {
    ScalesOptions options;
    options.mesh_codec = codec;
    const ScaleFiles files = c.write(options);
    SplitStreamReader reader(read_split_head(files.stream));
    reader.read_to_scale(files.files.size() - 1, files.stream);
    EXPECT_EQ(reader.head().scales.back().triangles, files.files[0].triangles);
    EXPECT_EQ(c.write(options, 8).stream, files.stream);
    options.stream = false;
    EXPECT_TRUE(c.write(options).stream.empty());
  }
}

TEST(ScalesStream, OneScaleNeedsNone) {
  Case c(testing::bumpy_sphere(14, 20));
  c.perceptual.kept.assign(c.perceptual.kept.size(), 0);
  const ScaleFiles files = c.write();
  EXPECT_EQ(files.files.size(), 1u);
  EXPECT_TRUE(files.stream.empty());
}

}  // namespace texmesh::scales_stream_test
