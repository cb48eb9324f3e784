#include "tools/extract/glb/draco_recode.h"

#include <draco/compression/decode.h>
#include <draco/compression/expert_encode.h>
#include <draco/mesh/mesh.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <memory>

#include "format/base/errors.h"
#include "stages/gltf/draco_points.h"

namespace texmesh {
namespace {

constexpr int kTangentBits = 8, kMostBits = 24;

/// Smallest and largest component values over all primitives.
struct Extent {
  float low[3] = {std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity(),
                  std::numeric_limits<float>::infinity()};
  float high[3] = {-low[0], -low[0], -low[0]};
  void add(const draco::PointAttribute& attribute) {
    float value[4] = {};
    for (std::uint32_t i = 0; i < attribute.size(); ++i) {
      attribute.ConvertValue(draco::AttributeValueIndex(i), attribute.num_components(), value);
      for (int k = 0; k < std::min<int>(3, attribute.num_components()); ++k)
        low[k] = std::min(low[k], value[k]), high[k] = std::max(high[k], value[k]);
    }
  }
  float range(int dimensions) const {
    float widest = 0;
    for (int k = 0; k < dimensions; ++k) widest = std::max(widest, high[k] - low[k]);
    return widest > 0 && std::isfinite(widest) ? widest : 1;
  }
};

/// Draco keeps options as text and would print floats with six decimals.
std::string exact(float x) {
  char text[64];
  const auto end =
      std::to_chars(text, text + sizeof text, static_cast<double>(x), std::chars_format::scientific).ptr;
  return {text, end};
}

double places(int bits) { return static_cast<double>((1u << bits) - 1); }

int bits_for(double range, double step) {
  int bits = 1;
  while (bits < kMostBits && range / places(bits) > step) ++bits;
  return bits;
}

void use_grid(draco::ExpertEncoder& encoder, int id, const Extent& extent, int dimensions, double step,
              bool exact_step) {
  const double range = static_cast<double>(extent.range(dimensions));
  const int bits = bits_for(range, step);
  const double whole = exact_step ? std::max(range, step * places(bits)) : range;
  std::string origin;
  for (int k = 0; k < dimensions; ++k)
    origin += exact(std::isfinite(extent.low[k]) ? extent.low[k] : 0) + " ";
  draco::Options options;
  options.SetInt("quantization_bits", bits);
  options.SetString("quantization_origin", origin);
  options.SetString("quantization_range", exact(static_cast<float>(whole)));
  encoder.options().SetAttributeOptions(id, options);
}

/// Colours of fewer bits in 8: the lowest ones go, spread so that 0 and 255 stay.
void coarsen_colours(draco::PointAttribute& attribute, int bits) {
  if (attribute.data_type() != draco::DT_UINT8 || bits >= 8) return;
  const int most = (1 << bits) - 1;
  for (std::uint32_t i = 0; i < attribute.size(); ++i) {
    std::uint8_t value[4] = {};
    attribute.GetValue(draco::AttributeValueIndex(i), value);
    for (std::uint8_t& v : value) v = static_cast<std::uint8_t>((v * most + 127) / 255 * 255 / most);
    attribute.SetAttributeValue(draco::AttributeValueIndex(i), value);
  }
}

std::unique_ptr<draco::Mesh> decoded(std::span<const std::uint8_t> bytes, const std::string& entry) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  draco::Decoder decoder;
  auto mesh = decoder.DecodeMeshFromBuffer(&buffer);
  if (!mesh.ok())
    throw FormatError(entry, "draco", "a stream that decodes", mesh.status().error_msg_string());
  return std::move(mesh).value();
}

/// One primitive while it is coded anew.
struct Work {
  std::unique_ptr<draco::Mesh> mesh;
  std::map<std::string, int> ids;  // glTF attribute -> index in the mesh
};

Extent extent_of(const std::vector<Work>& all, const std::string& prefix) {
  Extent out;
  for (const Work& w : all)
    for (const auto& [name, id] : w.ids)
      if (name.starts_with(prefix)) out.add(*w.mesh->attribute(id));
  return out;
}

void set_up_draco(draco::ExpertEncoder& encoder, const Work& work, const Extent& positions, const Extent& uvs,
                  const DracoSteps& steps) {
  encoder.SetSpeedOptions(0, 0);
  for (const auto& [name, id] : work.ids) {
    if (work.mesh->attribute(id)->data_type() != draco::DT_FLOAT32) continue;
    if (name == "POSITION") use_grid(encoder, id, positions, 3, steps.position, steps.exact);
    if (name.starts_with("TEXCOORD_")) use_grid(encoder, id, uvs, 2, steps.uv, steps.exact);
    if (name == "NORMAL") encoder.SetAttributeQuantization(id, steps.normal_bits);
    if (name == "TANGENT") {
      draco::Options options;
      options.SetInt("quantization_bits", kTangentBits);
      options.SetString("quantization_origin", "-1 -1 -1 -1");
      options.SetString("quantization_range", "2");
      encoder.options().SetAttributeOptions(id, options);
    }
  }
}

Vec3f value_of(const draco::PointAttribute& attribute, std::uint32_t point) {
  float v[3] = {};
  attribute.ConvertValue(attribute.mapped_index(draco::PointIndex(point)), std::int8_t{3}, v);
  return {v[0], v[1], v[2]};
}

/// One value per point.
void set_values(draco::PointAttribute& attribute, std::span<const Vec3f> values) {
  attribute.Reset(values.size());
  attribute.SetIdentityMapping();
  for (std::uint32_t i = 0; i < values.size(); ++i)
    attribute.SetAttributeValue(draco::AttributeValueIndex(i), &values[i]);
}

/// Fits the normals of all primitives together. Those without normals are only shapes.
void light_as(std::vector<Work>& all, const NormalSamples& samples, const std::string& entry,
              const RunContext& context) {
  std::vector<Vec3d> points;
  std::vector<Triangle> triangles;
  std::vector<Vec3f> normals;
  for (const Work& w : all) {
    const auto first = static_cast<std::uint32_t>(points.size());
    const auto normal = w.ids.find("NORMAL"), position = w.ids.find("POSITION");
    if (position == w.ids.end()) throw FormatError(entry, "POSITION", "an attribute", "none");
    for (std::uint32_t i = 0; i < w.mesh->num_points(); ++i) {
      points.push_back(to_double(value_of(*w.mesh->attribute(position->second), i)));
      normals.push_back(normal == w.ids.end() ? Vec3f{0, 0, 1}
                                              : value_of(*w.mesh->attribute(normal->second), i));
    }
    for (std::uint32_t f = 0; f < w.mesh->num_faces(); ++f) {
      const auto& face = w.mesh->face(draco::FaceIndex(f));
      for (const draco::PointIndex& corner : face)
        if (corner.value() >= w.mesh->num_points())
          throw FormatError(entry, "draco", "indices of points", "one beyond them");
      triangles.push_back({first + face[0].value(), first + face[1].value(), first + face[2].value()});
    }
  }
  for (const Vec3d p : points)
    if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z))
      throw FormatError(entry, "POSITION", "finite numbers", "others");
  normals = fit_normals(points, triangles, std::move(normals), samples, context);
  std::size_t first = 0;
  for (Work& w : all) {
    const auto normal = w.ids.find("NORMAL");
    draco::PointAttribute* attribute = normal == w.ids.end() ? nullptr : w.mesh->attribute(normal->second);
    if (attribute && attribute->data_type() == draco::DT_FLOAT32 && attribute->num_components() == 3)
      set_values(*attribute, std::span<const Vec3f>(normals).subspan(first, w.mesh->num_points()));
    first += w.mesh->num_points();
  }
}

DracoStream coded(Work& work, const Extent& positions, const Extent& uvs, const DracoSteps& steps,
                  const std::string& entry) {
  for (const auto& [name, id] : work.ids)
    if (name.starts_with("COLOR_")) coarsen_colours(*work.mesh->attribute(id), steps.colour_bits);
  merge_equal_points(*work.mesh);
  draco::ExpertEncoder encoder(*work.mesh);
  set_up_draco(encoder, work, positions, uvs, steps);
  draco::EncoderBuffer buffer;
  const draco::Status status = encoder.EncodeToBuffer(&buffer);
  if (!status.ok()) throw StageError("extract", entry, "a Draco stream", status.error_msg_string());
  DracoStream out;
  out.bytes.assign(buffer.data(), buffer.data() + buffer.size());
  // What a decoder will find: the encoder's own count of points is too high at non-manifold seams.
  const auto check = decoded(out.bytes, entry);
  out.vertices = check->num_points();
  out.triangles = check->num_faces();
  Extent box;
  for (const auto& [name, id] : work.ids) {
    const auto unique = static_cast<int>(work.mesh->attribute(id)->unique_id());
    out.attributes[name] = unique;
    if (name == "POSITION") box.add(*check->GetAttributeByUniqueId(static_cast<std::uint32_t>(unique)));
  }
  out.low = {box.low[0], box.low[1], box.low[2]};
  out.high = {box.high[0], box.high[1], box.high[2]};
  return out;
}

}  // namespace

void recode_draco(std::vector<DracoStream>& primitives, const DracoSteps& steps, const NormalSamples* lit_as,
                  const std::string& entry, const RunContext& context) {
  std::vector<Work> work;
  std::size_t before = 0;
  for (const DracoStream& p : primitives) {
    Work& w = work.emplace_back();
    w.mesh = decoded(p.bytes, entry);
    before += p.bytes.size();
    for (const auto& [name, unique] : p.attributes) {
      const int id = w.mesh->GetAttributeIdByUniqueId(static_cast<std::uint32_t>(unique));
      if (id < 0) throw FormatError(entry, name, "an attribute of the Draco stream", "none of that id");
      w.ids[name] = id;
    }
  }
  if (lit_as) light_as(work, *lit_as, entry, context);
  const Extent positions = extent_of(work, "POSITION"), uvs = extent_of(work, "TEXCOORD_");
  std::vector<DracoStream> out;
  std::size_t after = 0;
  for (Work& w : work) {
    out.push_back(coded(w, positions, uvs, steps, entry));
    after += out.back().bytes.size();
  }
  if (lit_as || after < before) primitives = std::move(out);
}

}  // namespace texmesh
