// The triangles of a primitive and the vertices that they use: from accessors, or from a stream of Draco.
#include <draco/attributes/attribute_quantization_transform.h>
#include <draco/compression/decode.h>
#include <tiny_gltf.h>

#include <memory>
#include <new>
#include <nlohmann/json.hpp>

#include "pipeline/import/gltf/import_gltf_parts.h"

namespace texmesh {
namespace {

constexpr std::uint64_t kMinFaceBudget = 1 << 16;
// The smoothest scans need some tenths of a bit per face; Draco itself would allocate for any number.
constexpr std::uint64_t kMaxFacesPerByte = 1000;
constexpr int kMaxMetadataDepth = 16;

/// Reads the header of a Draco stream; past its end everything is 0 and ok() is false.
class DracoHeaderReader {
 public:
  explicit DracoHeaderReader(ByteSpan bytes) : bytes_(bytes) {}
  bool ok() const { return ok_; }
  std::uint8_t u8() {
    if (at_ >= bytes_.size()) ok_ = false;
    return ok_ ? bytes_[at_++] : 0;
  }
  std::uint16_t u16() {
    const unsigned lo = u8();
    return static_cast<std::uint16_t>(lo | static_cast<unsigned>(u8()) << 8);
  }
  std::uint64_t varint() {
    std::uint64_t value = 0;
    for (int shift = 0; shift < 63; shift += 7) {
      const std::uint8_t b = u8();
      value |= static_cast<std::uint64_t>(b & 0x7f) << shift;
      if (!(b & 0x80)) return value;
    }
    ok_ = false;
    return 0;
  }
  void skip(std::uint64_t bytes) {
    if (bytes > bytes_.size() - at_) ok_ = false;
    if (ok_) at_ += bytes;
  }

 private:
  ByteSpan bytes_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

void skip_metadata_element(DracoHeaderReader& in, int depth) {
  if (depth > kMaxMetadataDepth) in.skip(std::numeric_limits<std::uint64_t>::max());
  const std::uint64_t entries = in.varint();
  for (std::uint64_t i = 0; i < entries && in.ok(); ++i) {
    in.skip(in.u8());
    in.skip(in.varint());
  }
  const std::uint64_t children = in.varint();
  for (std::uint64_t i = 0; i < children && in.ok(); ++i) {
    in.skip(in.u8());
    skip_metadata_element(in, depth + 1);
  }
}

void skip_metadata(DracoHeaderReader& in) {
  const std::uint64_t attributes = in.varint();
  for (std::uint64_t i = 0; i < attributes && in.ok(); ++i) {
    in.varint();
    skip_metadata_element(in, 0);
  }
  skip_metadata_element(in, 0);
}

void check_header(const Source& source, const std::string& place, ByteSpan data) {
  DracoHeaderReader in(data);
  for (const char c : std::string_view("DRACO")) {
    if (in.u8() != static_cast<std::uint8_t>(c)) source.fail(place, "a Draco stream", "other bytes");
  }
  const int major = in.u8(), minor = in.u8(), type = in.u8(), method = in.u8();
  const unsigned flags = in.u16();
  if (major != 2 || minor != 2) {
    source.fail(place, "Draco bitstream 2.2", std::to_string(major) + "." + std::to_string(minor));
  }
  if (type != 1 || method > 1) source.fail(place, "a Draco mesh", "something else");
  if (flags & 0x8000) skip_metadata(in);
  if (method == 1) in.u8();  // Edgebreaker's kind of traversal
  const std::uint64_t first = in.varint(), second = in.varint();
  if (!in.ok()) source.fail(place, "a Draco header", "the end of the stream");
  const std::uint64_t faces = method == 1 ? second : first, vertices = method == 1 ? first : second;
  const auto max_faces = std::min<std::uint64_t>(static_cast<std::uint64_t>(source.options.max_triangles),
                                                 std::max(kMinFaceBudget, data.size() * kMaxFacesPerByte));
  if (faces > max_faces) {
    source.fail(place, "at most " + std::to_string(max_faces) + " triangles", std::to_string(faces));
  }
  const auto max_vertices =
      std::min<std::uint64_t>(static_cast<std::uint64_t>(source.options.max_vertices), 3 * faces);
  if (vertices > max_vertices) {
    source.fail(place, "at most " + std::to_string(max_vertices) + " vertices", std::to_string(vertices));
  }
}

std::shared_ptr<draco::Mesh> decode_mesh(const Source& source, const std::string& place, ByteSpan data) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(data.data()), data.size());
  draco::Decoder decoder;
  // Their grid is asked for: undo_quantization() does what the decoder leaves out.
  decoder.SetSkipAttributeTransform(draco::GeometryAttribute::POSITION);
  try {
    auto mesh = decoder.DecodeMeshFromBuffer(&buffer);
    if (!mesh.ok() || !mesh.value()) source.fail(place, "a Draco mesh", "damaged data");
    return std::move(mesh).value();
  } catch (const std::bad_alloc&) {
    source.fail(place, "a Draco mesh that fits the memory", "a larger one");
  } catch (const std::length_error&) {
    source.fail(place, "a Draco mesh that fits the memory", "a larger one");
  }
}

/// Makes the positions floats again. The result is the step of the grid that they were rounded to, 0 where
/// there was none.
float undo_quantization(draco::Mesh& mesh) {
  const int id = mesh.GetNamedAttributeId(draco::GeometryAttribute::POSITION);
  draco::AttributeQuantizationTransform transform;
  if (id < 0 || !transform.InitFromAttribute(*mesh.attribute(id))) return 0;
  const draco::PointAttribute& grid = *mesh.attribute(id);
  auto floats = std::make_unique<draco::PointAttribute>();
  floats->Init(grid.attribute_type(), grid.num_components(), draco::DT_FLOAT32, false, grid.size());
  if (!transform.InverseTransformAttribute(grid, floats.get())) return 0;
  if (grid.is_mapping_identity()) {
    floats->SetIdentityMapping();
  } else {
    floats->SetExplicitMapping(grid.indices_map_size());
    for (draco::PointIndex p(0); p < static_cast<std::uint32_t>(grid.indices_map_size()); ++p)
      floats->SetPointMapEntry(p, grid.mapped_index(p));
  }
  const std::uint32_t unique_id = grid.unique_id();
  mesh.SetAttribute(id, std::move(floats));
  mesh.attribute(id)->set_unique_id(unique_id);  // SetAttribute gives it `id`
  return transform.range() / static_cast<float>((1U << transform.quantization_bits()) - 1);
}

/// 0 for types that are never normalised.
float normal_limit(draco::DataType type) {
  switch (type) {
    case draco::DT_INT8:
      return 127;
    case draco::DT_UINT8:
      return 255;
    case draco::DT_INT16:
      return 32767;
    case draco::DT_UINT16:
      return 65535;
    default:
      return 0;
  }
}

void check_attribute(const Source& source, const std::string& place, const draco::Mesh& mesh,
                     const draco::PointAttribute& attribute) {
  // Draco takes the bytes of truth values as bool whatever they are, which is undefined.
  if (attribute.data_type() == draco::DT_BOOL) source.fail(place, "an attribute of numbers", "truth values");
  if (!attribute.is_mapping_identity() && attribute.indices_map_size() < mesh.num_points()) {
    source.fail(place, "a value for every point", "fewer");
  }
  for (draco::PointIndex p(0); p < mesh.num_points(); ++p) {
    if (attribute.mapped_index(p).value() >= attribute.size()) {
      source.fail(place, "values below " + std::to_string(attribute.size()),
                  std::to_string(attribute.mapped_index(p).value()));
    }
  }
}

ReadFloats reader(std::shared_ptr<const draco::Mesh> mesh, const draco::PointAttribute* attribute,
                  bool normalized) {
  const int n = attribute->num_components();
  const float limit = normalized ? normal_limit(attribute->data_type()) : 0;
  const bool is_float =
      attribute->data_type() == draco::DT_FLOAT32 || attribute->data_type() == draco::DT_FLOAT64;
  return [mesh, attribute, n, limit, is_float](std::size_t vertex, float* out) {
    const auto value = attribute->mapped_index(draco::PointIndex(static_cast<std::uint32_t>(vertex)));
    if (is_float) {
      attribute->ConvertValue<float>(value, static_cast<std::int8_t>(n), out);
      return;
    }
    // As plain integers, since what the accessor says about normalisation counts, not what Draco says.
    std::int32_t raw[4] = {};
    attribute->ConvertValue<std::int32_t>(value, static_cast<std::int8_t>(n), raw);
    for (int i = 0; i < n; ++i) {
      const auto f = static_cast<float>(raw[i]);
      out[i] = limit > 0 ? std::max(f / limit, -1.0f) : f;
    }
  };
}

}  // namespace

VertexData decode_draco(const Source& source, const std::string& place, ByteSpan data,
                        const GltfJson& attributes,
                        const std::function<bool(const std::string& name)>& normalized) {
  check_header(source, place, data);
  const std::shared_ptr<draco::Mesh> mesh = decode_mesh(source, place, data);
  VertexData out;
  out.position_step = undo_quantization(*mesh);
  out.count = mesh->num_points();
  out.indexed = true;
  if (out.count > static_cast<std::size_t>(source.options.max_vertices)) {
    source.fail(place, "at most " + std::to_string(source.options.max_vertices) + " vertices",
                std::to_string(out.count));
  }
  out.indices.reserve(std::size_t{3} * mesh->num_faces());
  for (draco::FaceIndex f(0); f < mesh->num_faces(); ++f) {
    for (const draco::PointIndex& p : mesh->face(f)) out.indices.push_back(p.value());
  }
  const auto attribute = [&](const std::string& name, int min_components, int max_components) -> ReadFloats {
    const auto it = attributes.find(name);
    if (it == attributes.end()) return {};
    const std::string where = place + "/attributes/" + name;
    const draco::PointAttribute* a = mesh->GetAttributeByUniqueId(it->get<std::uint32_t>());
    if (!a || a->num_components() < min_components || a->num_components() > max_components) {
      source.fail(where, "the id of an attribute of " + std::to_string(min_components) + " components",
                  a ? std::to_string(a->num_components()) + " components" : "no such attribute");
    }
    check_attribute(source, where, *mesh, *a);
    return reader(mesh, a, normalized(name));
  };
  out.position = attribute("POSITION", 3, 3);
  out.normal = attribute("NORMAL", 3, 3);
  out.uv0 = attribute("TEXCOORD_0", 2, 2);
  out.uv1 = attribute("TEXCOORD_1", 2, 2);
  out.colour = attribute("COLOR_0", 3, 4);
  out.tangent = attribute("TANGENT", 4, 4);
  if (out.colour)
    out.colour_components =
        mesh->GetAttributeByUniqueId(attributes["COLOR_0"].get<std::uint32_t>())->num_components();
  return out;
}

namespace {

constexpr const char* kDraco = "KHR_draco_mesh_compression";

struct PrimitivePath {
  std::size_t mesh, primitive;
  std::string text() const {
    return "/meshes/" + std::to_string(mesh) + "/primitives/" + std::to_string(primitive);
  }
};

const GltfJson* draco_extension(const GltfJson& document, const PrimitivePath& place) {
  const GltfJson& primitive = document["meshes"][place.mesh]["primitives"][place.primitive];
  const auto e = primitive.find("extensions");
  if (e == primitive.end() || !e->is_object()) return nullptr;
  const auto d = e->find(kDraco);
  return d == e->end() || d->is_null() ? nullptr : &*d;
}

class PrimitiveReader {
 public:
  PrimitiveReader(const Source& source, const GltfJson& document, const tinygltf::Model& model,
                  Buffers& buffers, const PrimitivePath& place)
      : source_(source),
        document_(document),
        model_(model),
        buffers_(buffers),
        place_(place),
        primitive_(model.meshes[place.mesh].primitives[place.primitive]) {}

  Primitive read();

 private:
  std::string at(const std::string& what) const { return place_.text() + "/" + what; }
  bool is_drawn() const;
  ReadFloats attribute(const std::string& name, VertexData& data, int min_components, int max_components,
                       int* components = nullptr) const;
  VertexData vertices() const;
  void check_zeros(const AccessorReader& reader, const std::string& place) const;
  void read_indices(VertexData& data) const;
  std::vector<Triangle> triangles(const VertexData& data, int mode) const;

  const Source& source_;
  const GltfJson& document_;
  const tinygltf::Model& model_;
  Buffers& buffers_;
  const PrimitivePath place_;
  const tinygltf::Primitive& primitive_;
};

/// Without a bufferView positions and indices are zeros, of which a few bytes can ask for millions.
void PrimitiveReader::check_zeros(const AccessorReader& reader, const std::string& place) const {
  constexpr std::size_t kMostZeros = 1 << 18;
  if (reader.zeros() > kMostZeros)
    source_.fail(place + "/count",
                 "at most " + std::to_string(kMostZeros) + " elements that no bufferView holds",
                 std::to_string(reader.zeros()));
}

bool PrimitiveReader::is_drawn() const {
  if (primitive_.mode < TINYGLTF_MODE_TRIANGLES) {
    source_.note_once(Severity::kInfo, "skipped-primitive", place_.text(), "points and lines are left out");
    ++source_.lost["primitives of points and lines"];
    return false;
  }
  if (primitive_.attributes.count("POSITION") == 0) {
    source_.note_once(Severity::kWarning, "no-positions", place_.text(),
                      "a primitive without POSITION is left out");
    return false;
  }
  return true;
}

/// Through an accessor. The first attribute that is read (POSITION) sets data.count.
ReadFloats PrimitiveReader::attribute(const std::string& name, VertexData& data, int min_components,
                                      int max_components, int* components) const {
  const auto it = primitive_.attributes.find(name);
  if (it == primitive_.attributes.end()) return {};
  const auto index = static_cast<std::size_t>(it->second);
  const std::string place = "/accessors/" + std::to_string(index);
  const std::size_t count = model_.accessors[index].count;
  const auto max_vertices = static_cast<std::size_t>(source_.options.max_vertices);
  if (count > max_vertices) {
    source_.fail(place + "/count", "at most " + std::to_string(max_vertices), std::to_string(count));
  }
  const auto reader = std::make_shared<AccessorReader>(source_, model_, buffers_, index);
  const int n = reader->components();
  if (n < min_components || n > max_components) {
    source_.fail(place + "/type", std::to_string(min_components) + " components for " + name,
                 std::to_string(n));
  }
  if (reader->component_type() == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT) {
    source_.fail(place + "/componentType", "8 or 16 bits or floats for " + name, "32-bit integers");
  }
  if (name == "POSITION") {
    check_zeros(*reader, place);
    data.count = count;
    data.position_step = reader->step();
    if (model_.accessors[index].minValues.size() != 3 || model_.accessors[index].maxValues.size() != 3) {
      source_.note_once(Severity::kWarning, "accessor-without-bounds", place, "POSITION has no min and max");
    }
  } else if (count != data.count) {
    source_.fail(place + "/count", std::to_string(data.count) + ", as POSITION has", std::to_string(count));
  }
  // glTF asks for normalised colours; exporters forget the flag, and 255 would be far from white otherwise.
  if (name == "COLOR_0") reader->normalize();
  if (components) *components = n;
  return [reader](std::size_t vertex, float* out) { reader->read(vertex, out); };
}

VertexData PrimitiveReader::vertices() const {
  VertexData data;
  const GltfJson* draco = draco_extension(document_, place_);
  if (draco) {
    const std::string place = at("extensions/" + std::string(kDraco));
    const auto normalized = [&](const std::string& name) {
      const auto it = primitive_.attributes.find(name);
      return name == "COLOR_0" || (it != primitive_.attributes.end() &&
                                   model_.accessors[static_cast<std::size_t>(it->second)].normalized);
    };
    data = decode_draco(source_, place, buffers_.view((*draco)["bufferView"].get<std::size_t>(), place),
                        (*draco)["attributes"], normalized);
    if (!data.position) source_.fail(place + "/attributes", "\"POSITION\"", "an object without it");
  } else {
    data.position = attribute("POSITION", data, 3, 3);
    read_indices(data);
  }
  // What a Draco stream does not hold may stand in plain accessors.
  if (!data.normal) data.normal = attribute("NORMAL", data, 3, 3);
  if (!data.uv0) data.uv0 = attribute("TEXCOORD_0", data, 2, 2);
  if (!data.uv1) data.uv1 = attribute("TEXCOORD_1", data, 2, 2);
  if (!data.colour) data.colour = attribute("COLOR_0", data, 3, 4, &data.colour_components);
  if (!data.tangent) data.tangent = attribute("TANGENT", data, 4, 4);
  return data;
}

void PrimitiveReader::read_indices(VertexData& data) const {
  const auto max_indices = static_cast<std::size_t>(source_.options.max_triangles) * 3;
  if (primitive_.indices < 0) {
    if (data.count > max_indices) {
      source_.fail(at("attributes/POSITION"), "at most " + std::to_string(max_indices) + " corners",
                   std::to_string(data.count));
    }
    return;
  }
  const auto index = static_cast<std::size_t>(primitive_.indices);
  const std::string place = "/accessors/" + std::to_string(index);
  if (model_.accessors[index].bufferView < 0 && !model_.accessors[index].sparse.isSparse)
    source_.fail(place, "\"bufferView\" or \"sparse\" for indices", "an accessor without them");
  if (model_.accessors[index].count > max_indices) {
    source_.fail(place + "/count", "at most " + std::to_string(max_indices),
                 std::to_string(model_.accessors[index].count));
  }
  const AccessorReader reader(source_, model_, buffers_, index);
  const int type = reader.component_type();
  if (reader.components() != 1 ||
      (type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE && type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT &&
       type != TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT)) {
    source_.fail(place, "unsigned integer scalars for indices", "another type");
  }
  data.indexed = true;
  check_zeros(reader, place);
  data.indices.resize(reader.count());
  for (std::size_t i = 0; i < data.indices.size(); ++i) data.indices[i] = reader.read_index(i);
}

std::vector<Triangle> PrimitiveReader::triangles(const VertexData& data, int mode) const {
  const std::size_t n = data.indexed ? data.indices.size() : data.count;
  const auto vertex = [&](std::size_t i) {
    return data.indexed ? data.indices[i] : static_cast<std::uint32_t>(i);
  };
  for (std::size_t i = 0; i < data.indices.size(); ++i) {
    if (data.indices[i] >= data.count) {
      source_.fail(at("indices"), "indices below " + std::to_string(data.count),
                   std::to_string(data.indices[i]) + " at " + std::to_string(i));
    }
  }
  std::vector<Triangle> out;
  if (mode == TINYGLTF_MODE_TRIANGLES) {
    if (n % 3 != 0) {
      source_.note_once(Severity::kWarning, "incomplete-triangle", place_.text(),
                        "the last one or two indices make no triangle");
    }
    out.reserve(n / 3);
    for (std::size_t i = 0; i + 2 < n; i += 3) out.push_back({vertex(i), vertex(i + 1), vertex(i + 2)});
  } else {
    // Strips turn round at every other triangle; the specification keeps the first corner
    // (glTF 2.0, 3.7.2.1).
    for (std::size_t i = 0; i + 2 < n; ++i) {
      if (mode == TINYGLTF_MODE_TRIANGLE_FAN) {
        out.push_back({vertex(i + 1), vertex(i + 2), vertex(0)});
      } else {
        out.push_back({vertex(i), vertex(i + 1 + i % 2), vertex(i + 2 - i % 2)});
      }
    }
  }
  return out;
}

/// Renumbers triangles to the vertices that they use, which are returned in rising order. Several primitives
/// may share one large vertex buffer: the work must follow the triangles, not the buffer.
std::vector<std::uint32_t> keep_used(std::vector<Triangle>& triangles, std::size_t count) {
  std::vector<std::uint32_t> used;
  if (count <= 12 * triangles.size() + 1024) {
    std::vector<std::uint32_t> to(count, kNoIndex);
    for (const Triangle& t : triangles) {
      for (const std::uint32_t v : t) to[v] = 0;
    }
    for (std::uint32_t v = 0; v < count; ++v) {
      if (to[v] == kNoIndex) continue;
      to[v] = static_cast<std::uint32_t>(used.size());
      used.push_back(v);
    }
    for (Triangle& t : triangles) {
      for (std::uint32_t& v : t) v = to[v];
    }
    return used;
  }
  used.reserve(triangles.size() * 3);
  for (const Triangle& t : triangles) used.insert(used.end(), t.begin(), t.end());
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  for (Triangle& t : triangles) {
    for (std::uint32_t& v : t) {
      v = static_cast<std::uint32_t>(std::lower_bound(used.begin(), used.end(), v) - used.begin());
    }
  }
  return used;
}

/// make(values) for every used vertex.
template <class T, class F>
std::vector<T> gather(const std::vector<std::uint32_t>& used, const ReadFloats& read, F&& make) {
  std::vector<T> out;
  if (!read) return out;
  out.reserve(used.size());
  for (const std::uint32_t v : used) {
    float values[4] = {};
    read(v, values);
    out.push_back(make(values));
  }
  return out;
}

Primitive PrimitiveReader::read() {
  Primitive out;
  if (!is_drawn()) return out;
  const VertexData data = vertices();
  const int mode = draco_extension(document_, place_) ? TINYGLTF_MODE_TRIANGLES : primitive_.mode;
  out.triangles = triangles(data, mode);
  const std::vector<std::uint32_t> used = keep_used(out.triangles, data.count);
  const auto vec2 = [](const float* v) { return Vec2f{v[0], v[1]}; };
  const auto vec3 = [](const float* v) { return Vec3f{v[0], v[1], v[2]}; };
  const bool alpha = data.colour_components == 4;
  const auto colour = [alpha](const float* v) { return Vec4f{v[0], v[1], v[2], alpha ? v[3] : 1.0f}; };
  out.positions = gather<Vec3f>(used, data.position, vec3);
  out.position_step = data.position_step;
  out.normals = gather<Vec3f>(used, data.normal, vec3);
  out.uv0 = gather<Vec2f>(used, data.uv0, vec2);
  out.uv1 = gather<Vec2f>(used, data.uv1, vec2);
  out.colours = gather<Vec4f>(used, data.colour, colour);
  // glTF: tangents without normals are to be ignored.
  if (data.normal)
    out.tangents = gather<Vec4f>(used, data.tangent, [](const float* v) {
      return Vec4f{v[0], v[1], v[2], v[3]};
    });
  return out;
}

}  // namespace

Primitive read_primitive(const Source& source, const GltfJson& document, const tinygltf::Model& model,
                         Buffers& buffers, std::size_t mesh, std::size_t primitive) {
  return PrimitiveReader(source, document, model, buffers, {mesh, primitive}).read();
}

}  // namespace texmesh
