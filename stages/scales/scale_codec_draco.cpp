#include <draco/compression/decode.h>
#include <draco/compression/expert_encode.h>
#include <draco/mesh/mesh.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include "format/base/box.h"
#include "format/base/errors.h"
#include "stages/gltf/draco_points.h"
#include "stages/scales/scale_codecs.h"

namespace texmesh {
namespace {

using Json = GlbWriter::Json;

template <class Value>
int add_attribute(draco::Mesh& mesh, draco::GeometryAttribute::Type type, int components,
                  draco::DataType data_type, bool normalized, std::size_t count, const Value& value) {
  using Element = decltype(value(0));
  draco::GeometryAttribute attribute;
  attribute.Init(type, nullptr, static_cast<std::int8_t>(components), data_type, normalized, sizeof(Element),
                 0);
  const int id = mesh.AddAttribute(attribute, true, static_cast<std::uint32_t>(count));
  for (std::uint32_t i = 0; i < count; ++i) {
    const Element element = value(i);
    mesh.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(i), &element);
  }
  return id;
}

/// Draco keeps options as text and prints floats with six decimals, which would shift every grid and shatter
/// those of small objects; so the text is written here, with all digits.
std::string exact(float x) {
  char text[64];
  const auto end =
      std::to_chars(text, text + sizeof text, static_cast<double>(x), std::chars_format::scientific).ptr;
  return {text, end};
}

void quantise(draco::ExpertEncoder& encoder, int id, const QuantisationGrid& grid, int dimensions) {
  if (grid.bits == 0) return;
  std::string origin;
  for (int k = 0; k < dimensions; ++k) origin += exact(grid.origin[std::min(k, 2)]) + " ";
  draco::Options options;
  options.SetInt("quantization_bits", grid.bits);
  options.SetString("quantization_origin", origin);
  options.SetString("quantization_range", exact(grid.range));
  encoder.options().SetAttributeOptions(id, options);
}

/// The attributes of a primitive under way: what Draco needs to know about each, and what glTF says about it.
class DracoPrimitive {
 public:
  DracoPrimitive(const ScaleCoding& coding, const ScalePrimitive& primitive)
      : coding_(coding), primitive_(primitive) {
    mesh_.set_num_points(static_cast<std::uint32_t>(primitive.wedges.size()));
    mesh_.SetNumFaces(primitive.indices.size() / 3);
    for (std::size_t f = 0; f < primitive.indices.size() / 3; ++f) {
      draco::Mesh::Face face;
      for (std::size_t k = 0; k < 3; ++k) face[k] = draco::PointIndex(primitive.indices[3 * f + k]);
      mesh_.SetFace(draco::FaceIndex(static_cast<std::uint32_t>(f)), face);
    }
    add_positions();
    if (!coding.mesh.normals.empty()) add_normals();
    for (int set = 0; set < 2; ++set)
      if (coding.write_uv[set]) add_uv(set);
    if (!coding.mesh.colours.empty()) add_colours();
    if (coding.writes_tangents(primitive)) add_tangents();
    if (!primitive.wedge_part.empty()) add_parts();
  }

  CodedPrimitive code(GlbWriter& writer) {
    // Equal values get one index, so that connectivity is that of positions and every other attribute's seams
    // are its own.
    // Points that agree in everything (relaxed junctions make some) are one to a decoder; the encoder would
    // count each.
    merge_equal_points(mesh_);
    draco::ExpertEncoder encoder(mesh_);
    const int speed = 10 - coding_.options.draco_level;
    encoder.SetSpeedOptions(speed, speed);
    for (const Quantised& q : quantised_) quantise(encoder, q.id, q.grid, q.dimensions);
    if (normal_id_ >= 0) encoder.SetAttributeQuantization(normal_id_, coding_.options.normal_bits);
    draco::EncoderBuffer buffer;
    const draco::Status status = encoder.EncodeToBuffer(&buffer);
    if (!status.ok()) fail("a Draco stream", status.error_msg_string());

    CodedPrimitive coded;
    count_decoded(buffer, coded);
    Json attributes, ids;
    for (Attribute& a : attributes_) {
      a.accessor["count"] = coded.vertices;
      attributes[a.name] = writer.add_accessor(a.accessor);
      ids[a.name] = mesh_.attribute(a.id)->unique_id();
    }
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(buffer.data());
    const std::size_t view = writer.add_view({bytes, buffer.size()});
    coded.json["attributes"] = attributes;
    coded.json["indices"] = writer.add_accessor({{"componentType", coded.vertices > 65535 ? 5125 : 5123},
                                                 {"count", std::size_t{coded.triangles} * 3},
                                                 {"type", "SCALAR"}});
    coded.json["extensions"]["KHR_draco_mesh_compression"] = {{"bufferView", view}, {"attributes", ids}};
    writer.use_extension("KHR_draco_mesh_compression", true);
    return coded;
  }

 private:
  /// What a decoder will find. The encoder's own count of points is too high where seams meet at non-manifold
  /// vertices.
  static void count_decoded(const draco::EncoderBuffer& encoded, CodedPrimitive& coded) {
    draco::DecoderBuffer bytes;
    bytes.Init(encoded.data(), encoded.size());
    draco::Decoder decoder;
    const auto mesh = decoder.DecodeMeshFromBuffer(&bytes);
    if (!mesh.ok()) fail("a Draco stream that decodes", mesh.status().error_msg_string());
    coded.triangles = mesh.value()->num_faces();
    coded.vertices = mesh.value()->num_points();
  }

  struct Attribute {
    std::string name;
    int id;
    Json accessor;
  };
  struct Quantised {
    int id;
    QuantisationGrid grid;
    int dimensions;
  };

  [[noreturn]] static void fail(std::string expected, std::string found) {
    throw StageError("scales", "draco", std::move(expected), std::move(found));
  }

  void add_positions() {
    const Mesh& m = coding_.mesh;
    auto position = [&](std::uint32_t i) { return m.positions[m.wedge_position[primitive_.wedges[i]]]; };
    const int id = add_attribute(mesh_, draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32, false,
                                 primitive_.wedges.size(), position);
    quantised_.push_back({id, coding_.position, 3});
    Box3f box;
    for (std::uint32_t i = 0; i < primitive_.wedges.size(); ++i) {
      const Vec3f p = coding_.position.bits > 0 ? coding_.position.rounded(position(i)) : position(i);
      box.extend(p);
    }
    attributes_.push_back({"POSITION",
                           id,
                           {{"componentType", 5126},
                            {"count", 0},
                            {"type", "VEC3"},
                            {"min", {box.min.x, box.min.y, box.min.z}},
                            {"max", {box.max.x, box.max.y, box.max.z}}}});
  }

  void add_normals() {
    normal_id_ = add_attribute(mesh_, draco::GeometryAttribute::NORMAL, 3, draco::DT_FLOAT32, false,
                               primitive_.wedges.size(),
                               [&](std::uint32_t i) { return coding_.frames.normals[primitive_.wedges[i]]; });
    attributes_.push_back({"NORMAL", normal_id_, {{"componentType", 5126}, {"count", 0}, {"type", "VEC3"}}});
  }

  void add_uv(int set) {
    const int id = add_attribute(
        mesh_, draco::GeometryAttribute::TEX_COORD, 2, draco::DT_FLOAT32, false, primitive_.wedges.size(),
        [&](std::uint32_t i) { return coding_.uv_values(set)[primitive_.wedges[i]]; });
    quantised_.push_back({id, coding_.uv[set], 2});
    attributes_.push_back(
        {"TEXCOORD_" + std::to_string(set), id, {{"componentType", 5126}, {"count", 0}, {"type", "VEC2"}}});
  }

  void add_parts() {
    const int id = add_attribute(
        mesh_, draco::GeometryAttribute::GENERIC, 1, draco::DT_UINT16, false, primitive_.wedges.size(),
        [&](std::uint32_t i) { return std::array<std::uint16_t, 1>{primitive_.wedge_part[i]}; });
    attributes_.push_back({"_FEATURE_ID_0", id, {{"componentType", 5123}, {"count", 0}, {"type", "SCALAR"}}});
  }

  void add_tangents() {
    const int id = add_attribute(
        mesh_, draco::GeometryAttribute::GENERIC, 4, draco::DT_FLOAT32, false, primitive_.wedges.size(),
        [&](std::uint32_t i) { return coding_.frames.tangents[primitive_.wedges[i]]; });
    // From -1 to 1, so that w stays 1 or -1.
    quantised_.push_back({id, {coding_.options.tangent_bits, {-1, -1, -1}, 2}, 4});
    attributes_.push_back({"TANGENT", id, {{"componentType", 5126}, {"count", 0}, {"type", "VEC4"}}});
  }

  template <class Element>
  int add_colour_values(draco::DataType type) {
    constexpr float kOne = std::numeric_limits<Element>::max();
    return add_attribute(mesh_, draco::GeometryAttribute::COLOR, 4, type, true, primitive_.wedges.size(),
                         [&](std::uint32_t i) {
                           const Vec4f c = coding_.mesh.colours[primitive_.wedges[i]];
                           auto code = [](float x) {
                             return static_cast<Element>(std::floor(std::clamp(x, 0.0f, 1.0f) * kOne + 0.5f));
                           };
                           return std::array<Element, 4>{code(c.x), code(c.y), code(c.z), code(c.w)};
                         });
  }

  void add_colours() {
    const int id = coding_.fine_colours ? add_colour_values<std::uint16_t>(draco::DT_UINT16)
                                        : add_colour_values<std::uint8_t>(draco::DT_UINT8);
    attributes_.push_back({"COLOR_0",
                           id,
                           {{"componentType", coding_.fine_colours ? 5123 : 5121},
                            {"normalized", true},
                            {"count", 0},
                            {"type", "VEC4"}}});
  }

  const ScaleCoding& coding_;
  const ScalePrimitive& primitive_;
  draco::Mesh mesh_;
  std::vector<Attribute> attributes_;
  std::vector<Quantised> quantised_;
  int normal_id_ = -1;
};

}  // namespace

CodedPrimitive code_draco(GlbWriter& writer, const ScaleCoding& coding, const ScalePrimitive& primitive) {
  return DracoPrimitive(coding, primitive).code(writer);
}

}  // namespace texmesh
