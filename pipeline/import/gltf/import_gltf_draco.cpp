#include <draco/compression/decode.h>

#include <limits>
#include <memory>
#include <new>
#include <nlohmann/json.hpp>

#include "pipeline/import/gltf/import_gltf_parts.h"

namespace texmesh::gltf {
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

std::shared_ptr<const draco::Mesh> decode_mesh(const Source& source, const std::string& place,
                                               ByteSpan data) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(data.data()), data.size());
  try {
    auto mesh = draco::Decoder().DecodeMeshFromBuffer(&buffer);
    if (!mesh.ok() || !mesh.value()) source.fail(place, "a Draco mesh", "damaged data");
    return std::move(mesh).value();
  } catch (const std::bad_alloc&) {
    source.fail(place, "a Draco mesh that fits the memory", "a larger one");
  } catch (const std::length_error&) {
    source.fail(place, "a Draco mesh that fits the memory", "a larger one");
  }
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

VertexData decode_draco(const Source& source, const std::string& place, ByteSpan data, const Json& attributes,
                        const std::function<bool(const std::string& name)>& normalized) {
  check_header(source, place, data);
  const std::shared_ptr<const draco::Mesh> mesh = decode_mesh(source, place, data);
  VertexData out;
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

}  // namespace texmesh::gltf
