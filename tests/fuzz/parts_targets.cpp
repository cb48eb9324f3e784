// The parts of the glTF reader that read what is no JSON: accessors, Draco and meshopt streams. Most runs go
// straight to them.
#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <meshoptimizer.h>
#include <tiny_gltf.h>

#include <algorithm>
#include <array>

#include "pipeline/import/gltf/import_gltf_parts.h"
#include "stages/gltf/decode_meshopt.h"
#include "tests/fuzz/gltf_files.h"

namespace texmesh::fuzz {
namespace {

using nlohmann::json;
using texmesh::testing::GltfBuilder;

bool import_built(const GltfBuilder& b) { return import_as_gltf(b.glb()); }

/// What the parts of the reader are given.
struct Given {
  std::string file = "fuzz";
  FewFiles files;
  ImportOptions options = reader_limits();
  RunContext context;
  Notes notes;
  Lost lost;
  Source source{file, files, options, context, notes, lost};
};

/// For what takes several times as long as the rest.
bool is_one_of_sixteen(ByteSpan input) {
  unsigned sum = 0;
  for (const std::uint8_t x : input) sum += x;
  return sum % 16 == 0;
}

// ---- accessors: a head chooses views and accessors, the rest is the binary chunk

constexpr const char* kTypes[] = {"SCALAR", "VEC2", "VEC3", "VEC4", "MAT3"};
constexpr int kComponents[] = {5120, 5121, 5122, 5123, 5125, 5126, 5124};

json sparse_from(Choices& c) {
  json sparse = {{"count", c.number(2)}};
  sparse["indices"] = {
      {"bufferView", c.below(4)}, {"byteOffset", c.number(2)}, {"componentType", kComponents[c.below(7)]}};
  sparse["values"] = {{"bufferView", c.below(4)}, {"byteOffset", c.number(2)}};
  return sparse;
}

json accessor_from(Choices& c) {
  json a = {{"type", kTypes[c.below(5)]}, {"componentType", kComponents[c.below(7)]}};
  const std::uint32_t flags = c.number(1);
  if (flags & 1) a["normalized"] = true;
  const std::uint32_t view = c.below(4);
  if (!(flags & 2)) a["bufferView"] = view;
  if (const std::uint32_t offset = c.number(2)) a["byteOffset"] = offset;
  a["count"] = c.number(flags & 8 ? 4 : 1);
  if (flags & 4) a["sparse"] = sparse_from(c);
  return a;
}

/// Through the file around them.
bool import_accessors(ByteSpan input) {
  Choices c(input);
  GltfBuilder b;
  for (int v = 0; v < 4; ++v) {
    json view = {{"buffer", 0}, {"byteOffset", c.number(2)}, {"byteLength", c.number(2)}};
    if (const std::uint32_t stride = c.number(1)) view["byteStride"] = stride;
    b.push("bufferViews", view);
  }
  json attributes;
  for (const char* name : {"POSITION", "NORMAL", "TEXCOORD_0", "COLOR_0"}) {
    const int accessor = b.push("accessors", accessor_from(c));
    if (c.number(1) & 1) attributes[name] = accessor;
  }
  attributes["POSITION"] = 0;
  const int indices = b.push("accessors", accessor_from(c));
  const std::uint32_t flags = c.number(1);
  json more = {{"mode", flags & 1 ? 4 + flags % 3 : 4}};
  if (flags & 8) more["indices"] = indices;
  b.mesh(attributes, more);
  b.node({{"mesh", 0}});
  b.bin.assign(c.rest().begin(), c.rest().end());
  return import_built(b);
}

constexpr int kModelTypes[] = {TINYGLTF_TYPE_SCALAR, TINYGLTF_TYPE_VEC2, TINYGLTF_TYPE_VEC3,
                               TINYGLTF_TYPE_VEC4, TINYGLTF_TYPE_MAT3};

/// As check_document lets it through; the last of the components' types is none.
tinygltf::Accessor checked_accessor(Choices& c) {
  tinygltf::Accessor a;
  a.type = kModelTypes[c.below(5)];
  a.componentType = kComponents[c.below(6)];
  const std::uint32_t flags = c.number(1);
  a.normalized = flags & 1;
  const std::uint32_t view = c.below(4);
  a.bufferView = flags & 2 ? -1 : static_cast<int>(view);
  a.byteOffset = c.number(2);
  a.count = c.number(flags & 8 ? 4 : 1);
  if (!(flags & 4)) return a;
  constexpr int kIndices[] = {5121, 5123, 5125};
  a.sparse.isSparse = true;
  a.sparse.count = static_cast<int>(c.number(2));
  a.sparse.indices.bufferView = static_cast<int>(c.below(4));
  a.sparse.indices.byteOffset = static_cast<int>(c.number(2));
  a.sparse.indices.componentType = kIndices[c.number(1) / 2 % 3];
  a.sparse.values.bufferView = static_cast<int>(c.below(4));
  a.sparse.values.byteOffset = static_cast<int>(c.number(2));
  return a;
}

/// The elements of an accessor, which may claim any number of zeros: the first ones and the last.
void read_elements(const AccessorReader& reader) {
  constexpr std::size_t kFew = 300;
  const int type = reader.component_type();
  const bool is_index = reader.components() == 1 && (type == 5121 || type == 5123 || type == 5125);
  std::array<float, 4> value{};
  for (std::size_t k = 0; k < std::min(reader.count(), kFew); ++k) {
    reader.read(k, value.data());
    reader.read(reader.count() - 1 - k, value.data());
    if (is_index) reader.read_index(k);
  }
}

bool read_accessors(ByteSpan input) {
  if (is_one_of_sixteen(input)) return import_accessors(input);
  Choices c(input);
  tinygltf::Model model;
  json document;
  for (int v = 0; v < 4; ++v) {
    document["bufferViews"].push_back(json::object());
    tinygltf::BufferView& view = model.bufferViews.emplace_back();
    view.buffer = 0;
    view.byteOffset = c.number(2), view.byteLength = c.number(2);
    view.byteStride = c.number(1) & 0xfc;
  }
  for (int a = 0; a < 5; ++a) {
    model.accessors.push_back(checked_accessor(c));
    c.number(1);  // of the primitive
  }
  document["buffers"] = {{{"byteLength", c.rest().size()}}};
  Given given;
  Buffers buffers(given.source, document, model, c.rest());
  bool any = false;
  for (std::size_t a = 0; a < model.accessors.size(); ++a) try {
      read_elements(AccessorReader(given.source, model, buffers, a));
      any = true;
    } catch (const InputError& e) {
      refused(e);
    }
  return any;
}

std::vector<Bytes> accessor_seeds() {
  std::vector<Bytes> list;
  for (const bool sparse : {false, true}) {
    BytesOut out;
    const auto view = [&](int offset, int length) {
      out.u16(static_cast<unsigned>(offset)), out.u16(static_cast<unsigned>(length)), out.u8(0);
    };
    view(0, 48), view(48, 32), view(80, 6), view(88, 24);
    const auto accessor = [&](int type, int component, int flags, int v, int count) {
      for (const int x : {type, component, flags, v, 0, 0, count}) out.u8(static_cast<unsigned>(x));
    };
    accessor(2, 5, sparse ? 4 : 0, 0, 4);
    if (sparse)  // one of the positions
      for (const int x : {1, 0, 2, 0, 0, 1, 3, 0, 0}) out.u8(static_cast<unsigned>(x));
    out.u8(1);
    accessor(2, 5, 2, 0, 4), out.u8(0);
    accessor(1, 5, 0, 1, 4), out.u8(1);
    accessor(3, 1, 1, 0, 4), out.u8(1);
    accessor(0, 1, 0, 2, 6), out.u8(8);
    for (const float x : {0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 1.f, 1.f, 0.f, 0.f, 1.f, 0.f}) out.f32(x);
    for (const float x : {0.f, 1.f, 1.f, 1.f, 1.f, 0.f, 0.f, 0.f}) out.f32(x);
    for (const int x : {0, 1, 2, 0, 2, 3, 0, 0}) out.u8(static_cast<unsigned>(x));
    for (const float x : {0.f, 0.f, 0.5f, 1.f, 0.f, 0.5f}) out.f32(x);
    list.push_back(out.finish());
  }
  return list;
}

// ---- Draco: ids, counts, then the stream

/// Through the file around the stream.
bool import_draco(ByteSpan input) {
  Choices c(input);
  GltfBuilder b;
  json extension, attributes;
  const std::uint32_t flags = c.number(1);
  struct Kind {
    const char *name, *type;
    int component;
  };
  const std::uint32_t points = c.number(2), corners = 3 * c.number(2);
  for (const Kind& kind :
       {Kind{"POSITION", "VEC3", 5126}, Kind{"TEXCOORD_0", "VEC2", 5126}, Kind{"NORMAL", "VEC3", 5126}}) {
    json more = {{"min", {0, 0, 0}}, {"max", {1, 1, 1}}};
    attributes[kind.name] = b.accessor(-1, kind.type, kind.component, points,
                                       std::string(kind.name) == "POSITION" ? more : json());
    extension["attributes"][kind.name] = c.number(1);
  }
  const int indices = b.accessor(-1, "SCALAR", flags & 1 ? 5123 : 5125, corners);
  extension["bufferView"] = b.view_of(Bytes(c.rest().begin(), c.rest().end()));
  b.mesh(attributes, {{"indices", indices}, {"extensions", {{"KHR_draco_mesh_compression", extension}}}});
  b.node({{"mesh", 0}});
  b.json["extensionsUsed"] = b.json["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  return import_built(b);
}

bool read_draco(ByteSpan input) {
  if (is_one_of_sixteen(input)) return import_draco(input);
  Choices c(input);
  const std::uint32_t flags = c.number(1);
  c.number(4);  // of the accessors
  json attributes;
  for (const char* name : {"POSITION", "TEXCOORD_0", "NORMAL"}) attributes[name] = c.number(1);
  Given given;
  try {
    const VertexData data = decode_draco(given.source, "stream", c.rest(), attributes,
                                         [&](const std::string&) { return (flags & 2) != 0; });
    std::array<float, 4> value{};
    for (const ReadFloats* read : {&data.position, &data.uv0, &data.normal})
      for (std::size_t v = 0; *read && v < data.count; ++v) (*read)(v, value.data());
    return true;
  } catch (const InputError& e) {
    return refused(e);
  }
}

Bytes draco_seed(draco::MeshEncoderMethod method, bool quantised) {
  constexpr int kSide = 4;
  draco::TriangleSoupMeshBuilder soup;
  soup.Start(2 * kSide * kSide);
  const int position = soup.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  const int uv = soup.AddAttribute(draco::GeometryAttribute::TEX_COORD, 2, draco::DT_FLOAT32);
  const int normal = soup.AddAttribute(draco::GeometryAttribute::NORMAL, 3, draco::DT_FLOAT32);
  for (int t = 0; t < 2 * kSide * kSide; ++t) {
    const int x = t / 2 % kSide, y = t / 2 / kSide;
    const int corner[2][3][2] = {{{x, y}, {x + 1, y}, {x + 1, y + 1}}, {{x, y}, {x + 1, y + 1}, {x, y + 1}}};
    std::array<std::array<float, 3>, 3> p{}, n{};
    std::array<std::array<float, 2>, 3> u{};
    for (std::size_t k = 0; k < 3; ++k) {
      const float fx = static_cast<float>(corner[t % 2][k][0]) / kSide,
                  fy = static_cast<float>(corner[t % 2][k][1]) / kSide;
      p[k] = {fx, fy, fx * fy}, n[k] = {0, 0, 1}, u[k] = {fx, fy};
    }
    const draco::FaceIndex f(static_cast<std::uint32_t>(t));
    soup.SetAttributeValuesForFace(position, f, &p[0], &p[1], &p[2]);
    soup.SetAttributeValuesForFace(uv, f, &u[0], &u[1], &u[2]);
    soup.SetAttributeValuesForFace(normal, f, &n[0], &n[1], &n[2]);
  }
  const std::unique_ptr<draco::Mesh> mesh = soup.Finalize();
  draco::Encoder encoder;
  encoder.SetEncodingMethod(method);
  if (quantised) encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 11);
  if (quantised) encoder.SetAttributeQuantization(draco::GeometryAttribute::NORMAL, 8);
  draco::EncoderBuffer coded;
  encoder.EncodeMeshToBuffer(*mesh, &coded);
  BytesOut out;
  out.u8(0), out.u16(mesh->num_points()), out.u16(mesh->num_faces());
  for (const int id : {position, uv, normal}) out.u8(static_cast<unsigned>(id));
  out.text({coded.data(), coded.size()});
  return out.finish();
}

std::vector<Bytes> draco_seeds() {
  std::vector<Bytes> list;
  for (const auto method : {draco::MESH_EDGEBREAKER_ENCODING, draco::MESH_SEQUENTIAL_ENCODING})
    for (const bool quantised : {false, true}) list.push_back(draco_seed(method, quantised));
  return list;
}

// ---- meshopt: mode, filter, stride, count, then the stream

/// Through the file around the stream.
bool import_meshopt(ByteSpan input) {
  constexpr const char* kModes[] = {"ATTRIBUTES", "TRIANGLES", "INDICES"};
  constexpr const char* kFilters[] = {"NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"};
  Choices c(input);
  const std::uint32_t mode = c.below(3), filter = c.below(5), stride = c.number(1), count = c.number(2),
                      flags = c.number(1);
  const int component = kComponents[c.below(7)];
  const char* type = kTypes[c.below(5)];
  GltfBuilder b;
  const int stream = b.view_of(Bytes(c.rest().begin(), c.rest().end()));
  json extension = {{"buffer", 0},
                    {"byteOffset", b.json["bufferViews"][0]["byteOffset"]},
                    {"byteLength", c.rest().size()},
                    {"byteStride", stride},
                    {"count", count},
                    {"mode", kModes[mode]}};
  if (filter != 0) extension["filter"] = kFilters[filter];
  json view = {{"buffer", 1}, {"byteOffset", 0}, {"byteLength", std::uint64_t{stride} * count}};
  if (mode == 0) view["byteStride"] = stride;
  const char* name = flags & 1 ? "KHR_meshopt_compression" : "EXT_meshopt_compression";
  view["extensions"][name] = extension;
  b.json["bufferViews"][static_cast<std::size_t>(stream)] = view;
  const int compressed =
      b.accessor(0, mode == 0 ? type : "SCALAR", component, count, {{"normalized", (flags & 2) != 0}});
  const int floats = b.attribute<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, "VEC3");
  json attributes = {{"POSITION", mode == 0 && flags & 4 ? compressed : floats}};
  if (mode == 0 && !(flags & 4)) attributes[flags & 8 ? "NORMAL" : "TEXCOORD_0"] = compressed;
  b.mesh(attributes, mode == 0 ? json() : json{{"indices", compressed}});
  b.node({{"mesh", 0}});
  b.json["buffers"] = {
      {{"byteLength", b.bin.size()}},
      {{"byteLength", std::uint64_t{stride} * count}, {"extensions", {{name, {{"fallback", true}}}}}}};
  b.json["extensionsUsed"] = b.json["extensionsRequired"] = {name};
  return import_built(b);
}

bool read_meshopt(ByteSpan input) {
  if (is_one_of_sixteen(input)) return import_meshopt(input);
  Choices c(input);
  const auto mode = static_cast<MeshoptMode>(c.below(3));
  const auto filter = static_cast<MeshoptFilter>(c.below(5));
  const std::uint32_t stride = c.number(1), count = c.number(2);
  c.number(3);  // of the accessor
  try {
    const Bytes bytes = decode_meshopt({c.rest(), count, stride, mode, filter},
                                       [](const std::string& expected, const std::string& found) {
                                         throw InputError("fuzz", "stream", expected, found);
                                       });
    require(bytes.size() == std::size_t{count} * stride, "fewer elements than asked for");
    return true;
  } catch (const InputError& e) {
    return refused(e);
  }
}

Bytes meshopt_seed(int mode, int stride, std::size_t count, int component, int type, int flags,
                   const Bytes& stream) {
  BytesOut out;
  out.u8(static_cast<unsigned>(mode)), out.u8(0), out.u8(static_cast<unsigned>(stride)), out.u16(count),
      out.u8(static_cast<unsigned>(flags));
  out.u8(static_cast<unsigned>(component)), out.u8(static_cast<unsigned>(type));
  out.raw(stream);
  return out.finish();
}

std::vector<Bytes> meshopt_seeds() {
  const std::vector<unsigned> indices{0, 1, 2, 0, 2, 3};
  Bytes triangles(meshopt_encodeIndexBufferBound(6, 4)), sequence(meshopt_encodeIndexSequenceBound(6, 4));
  triangles.resize(meshopt_encodeIndexBuffer(triangles.data(), triangles.size(), indices.data(), 6));
  sequence.resize(meshopt_encodeIndexSequence(sequence.data(), sequence.size(), indices.data(), 6));
  const std::vector<float> points{0, 0, 0, 1, 0, 0, 1, 1, 0};
  Bytes vertices(meshopt_encodeVertexBufferBound(3, 12));
  vertices.resize(meshopt_encodeVertexBuffer(vertices.data(), vertices.size(), points.data(), 3, 12));
  return {meshopt_seed(1, 2, 6, 3, 0, 0, triangles), meshopt_seed(2, 4, 6, 4, 0, 1, sequence),
          meshopt_seed(0, 12, 3, 5, 2, 4, vertices)};
}

}  // namespace

void add_parts_targets(std::vector<Target>& list) {
  list.insert(list.end(), {{"accessors", false, read_accessors, accessor_seeds},
                           {"draco", false, read_draco, draco_seeds},
                           {"meshopt", false, read_meshopt, meshopt_seeds}});
}

}  // namespace texmesh::fuzz
