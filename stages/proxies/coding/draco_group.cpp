#include "stages/proxies/coding/draco_group.h"

#include <draco/compression/decode.h>
#include <draco/compression/expert_encode.h>
#include <draco/mesh/mesh.h>

#include <charconv>
#include <string>

#include "stages/gltf/draco_points.h"

namespace texmesh::proxies {
namespace {

constexpr int kSpeed = 3;  // slower ones gain less than 1 % on small meshes
constexpr int kNormalBits = 8;

template <class Element>
int add_vertices(draco::Mesh& mesh, draco::GeometryAttribute::Type type, const std::vector<Element>& values) {
  constexpr auto kComponents = static_cast<std::int8_t>(sizeof(Element) / sizeof(float));
  draco::GeometryAttribute attribute;
  attribute.Init(type, nullptr, kComponents, draco::DT_FLOAT32, false, sizeof(Element), 0);
  const int id = mesh.AddAttribute(attribute, true, static_cast<std::uint32_t>(values.size()));
  for (std::uint32_t i = 0; i < values.size(); ++i)
    mesh.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(i), &values[i]);
  return id;
}

/// With all digits: Draco itself prints six decimals.
std::string all_digits(float x) {
  char text[64];
  const auto end =
      std::to_chars(text, text + sizeof text, static_cast<double>(x), std::chars_format::scientific).ptr;
  return {text, end};
}

void round_to(draco::ExpertEncoder& encoder, int id, int bits, const std::string& origin, float range) {
  draco::Options options;
  options.SetInt("quantization_bits", bits);
  options.SetString("quantization_origin", origin);
  options.SetString("quantization_range", all_digits(range));
  encoder.options().SetAttributeOptions(id, options);
}

}  // namespace

DracoGroup code_draco_group(const DracoInput& input) {
  draco::Mesh mesh;
  mesh.set_num_points(static_cast<std::uint32_t>(input.positions.size()));
  mesh.SetNumFaces(input.indices.size() / 3);
  for (std::uint32_t f = 0; f < input.indices.size() / 3; ++f) {
    draco::Mesh::Face face;
    for (std::size_t k = 0; k < 3; ++k) face[k] = draco::PointIndex(input.indices[3 * f + k]);
    mesh.SetFace(draco::FaceIndex(f), face);
  }
  const int position = add_vertices(mesh, draco::GeometryAttribute::POSITION, input.positions);
  const int normal =
      input.normals.empty() ? -1 : add_vertices(mesh, draco::GeometryAttribute::NORMAL, input.normals);
  const int uv = add_vertices(mesh, draco::GeometryAttribute::TEX_COORD, input.uvs);
  merge_equal_points(mesh);
  draco::ExpertEncoder encoder(mesh);
  encoder.SetSpeedOptions(kSpeed, kSpeed);
  const Vec3f o = input.origin;
  round_to(encoder, position, input.position_bits,
           all_digits(o.x) + " " + all_digits(o.y) + " " + all_digits(o.z) + " ", input.range);
  round_to(encoder, uv, input.uv_bits, "0 0 ", 1);
  if (normal >= 0) encoder.SetAttributeQuantization(normal, kNormalBits);
  draco::EncoderBuffer buffer;
  if (!encoder.EncodeToBuffer(&buffer).ok()) return {};
  DracoGroup out;
  out.stream.assign(buffer.data(), buffer.data() + buffer.size());
  out.ids = {mesh.attribute(position)->unique_id(), normal >= 0 ? mesh.attribute(normal)->unique_id() : 0,
             mesh.attribute(uv)->unique_id()};
  // The encoder's own count of points is too high where seams meet at non-manifold vertices.
  draco::DecoderBuffer bytes;
  bytes.Init(buffer.data(), buffer.size());
  const auto decoded = draco::Decoder().DecodeMeshFromBuffer(&bytes);
  if (!decoded.ok()) return {};
  out.triangles = decoded.value()->num_faces();
  out.vertices = decoded.value()->num_points();
  return out;
}

}  // namespace texmesh::proxies
