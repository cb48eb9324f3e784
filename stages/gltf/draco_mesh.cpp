#include "stages/gltf/draco_mesh.h"

#include <draco/compression/decode.h>
#include <draco/compression/expert_encode.h>
#include <draco/mesh/mesh.h>

#include <charconv>

#include "stages/base/first_use_table.h"

namespace texmesh {
namespace {

constexpr int kTangentBits = 8, kMostBits = 24;

/// Which records are equal. Equal ones have one number; numbers are given in the order of first use.
struct FirstUses {
  std::vector<std::uint32_t> number;  // per record
  std::vector<std::uint32_t> first;   // per number: the first record that has it
};

std::uint64_t hash_of(std::span<const std::uint32_t> record) {
  std::uint64_t hash = 0;
  for (const std::uint32_t word : record) hash = hash_with(hash, word);
  return hash;
}

FirstUses find_first_uses(std::span<const std::uint32_t> words, std::size_t words_each) {
  const std::size_t count = words.size() / words_each;
  const auto record = [&](std::size_t i) { return words.subspan(i * words_each, words_each); };
  FirstUses out;
  out.number.reserve(count);
  FirstUseTable table(count);
  const auto record_of = [&](std::uint32_t number) { return record(out.first[number]); };
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t number = table.number_of(
        hash_of(record(i)), [&](std::uint32_t n) { return std::ranges::equal(record_of(n), record(i)); },
        [&](std::uint32_t n) { return hash_of(record_of(n)); });
    if (number == out.first.size()) out.first.push_back(static_cast<std::uint32_t>(i));
    out.number.push_back(number);
  }
  return out;
}

void merge_values(draco::PointAttribute& attribute, std::uint32_t points) {
  const std::size_t bytes = static_cast<std::size_t>(attribute.byte_stride()), words_each = (bytes + 3) / 4;
  std::vector<std::uint32_t> words(attribute.size() * words_each, 0);
  const auto value = [&](std::size_t i) {
    return attribute.GetAddress(draco::AttributeValueIndex(static_cast<std::uint32_t>(i)));
  };
  for (std::size_t i = 0; i < attribute.size(); ++i)
    std::memcpy(words.data() + i * words_each, value(i), bytes);
  const FirstUses uses = find_first_uses(words, words_each);
  if (uses.first.size() == attribute.size()) return;
  for (std::uint32_t u = 0; u < uses.first.size(); ++u)
    attribute.SetAttributeValue(draco::AttributeValueIndex(u), words.data() + uses.first[u] * words_each);
  const bool by_point = attribute.is_mapping_identity();
  if (by_point) attribute.SetExplicitMapping(points);
  for (draco::PointIndex p(0); p < points; ++p) {
    const std::uint32_t at = by_point ? p.value() : attribute.mapped_index(p).value();
    attribute.SetPointMapEntry(p, draco::AttributeValueIndex(uses.number[at]));
  }
  attribute.Resize(uses.first.size());
}

void merge_points(draco::Mesh& mesh) {
  const auto attributes = static_cast<std::size_t>(mesh.num_attributes());
  if (attributes == 0) return;
  std::vector<std::uint32_t> words;
  words.reserve(mesh.num_points() * attributes);
  for (draco::PointIndex p(0); p < mesh.num_points(); ++p)
    for (int a = 0; a < mesh.num_attributes(); ++a)
      words.push_back(mesh.attribute(a)->mapped_index(p).value());
  const FirstUses uses = find_first_uses(words, attributes);
  if (uses.first.size() == mesh.num_points()) return;
  // No attribute is its points' list any more: such a one would tell all points apart.
  for (int a = 0; a < mesh.num_attributes(); ++a) {
    draco::PointAttribute& attribute = *mesh.attribute(a);
    for (std::uint32_t u = 0; u < uses.first.size(); ++u)
      attribute.SetPointMapEntry(draco::PointIndex(u),
                                 attribute.mapped_index(draco::PointIndex(uses.first[u])));
    attribute.SetExplicitMapping(uses.first.size());
  }
  mesh.set_num_points(static_cast<std::uint32_t>(uses.first.size()));
  for (draco::FaceIndex f(0); f < mesh.num_faces(); ++f) {
    draco::Mesh::Face face = mesh.face(f);
    for (draco::PointIndex& p : face) p = draco::PointIndex(uses.number[p.value()]);
    mesh.SetFace(f, face);
  }
}

/// Draco keeps options as text and prints floats with six decimals, which would shift every grid and shatter
/// those of small objects; so the text is written here, with all digits.
std::string exact(float x) {
  char text[64];
  const auto end =
      std::to_chars(text, text + sizeof text, static_cast<double>(x), std::chars_format::scientific).ptr;
  return {text, end};
}

std::unique_ptr<draco::Mesh> decoded(const char* data, std::size_t size, std::string& why_not) {
  draco::DecoderBuffer buffer;
  buffer.Init(data, size);
  auto mesh = draco::Decoder().DecodeMeshFromBuffer(&buffer);
  if (mesh.ok()) return std::move(mesh).value();
  why_not = mesh.status().error_msg_string();
  return nullptr;
}

/// An attribute of a mesh under way, and how it is coded.
struct CodedAttribute {
  int id = 0;  // index in the mesh
  DracoGrid grid;
};
using CodedAttributes = std::map<std::string, CodedAttribute>;  // by glTF's name

void use_grid(draco::ExpertEncoder& encoder, const CodedAttribute& attribute, int components) {
  std::string origin;
  for (int k = 0; k < components; ++k) origin += exact(attribute.grid.origin[std::min(k, 2)]) + " ";
  draco::Options options;
  options.SetInt("quantization_bits", attribute.grid.bits);
  options.SetString("quantization_origin", origin);
  options.SetString("quantization_range", exact(attribute.grid.range));
  encoder.options().SetAttributeOptions(attribute.id, options);
}

/// The stream, and the mesh that a decoder makes of it; null with kDracoFastest.
std::unique_ptr<draco::Mesh> encode_mesh(draco::Mesh& mesh, const CodedAttributes& attributes, int speed,
                                         DracoStream& out) {
  // Equal values get one index, so that connectivity is that of positions and every other attribute's seams
  // are its own. Points that agree in everything (relaxed junctions make some) are one to a decoder; the
  // encoder would count each.
  merge_equal_points(mesh);
  draco::ExpertEncoder encoder(mesh);
  encoder.SetSpeedOptions(speed, speed);
  for (const auto& [name, a] : attributes) {
    if (a.grid.bits == 0) continue;
    if (name == "NORMAL")
      encoder.SetAttributeQuantization(a.id, a.grid.bits);
    else
      use_grid(encoder, a, mesh.attribute(a.id)->num_components());
  }
  draco::EncoderBuffer buffer;
  const draco::Status status = encoder.EncodeToBuffer(&buffer);
  if (!status.ok()) throw StageError("draco", "", "a Draco stream", status.error_msg_string());
  out.bytes.assign(buffer.data(), buffer.data() + buffer.size());
  for (const auto& [name, a] : attributes)
    out.attributes[name] = static_cast<int>(mesh.attribute(a.id)->unique_id());
  if (speed == kDracoFastest) {  // a list of points: a decoder finds the same
    out.vertices = mesh.num_points();
    out.triangles = static_cast<std::uint32_t>(mesh.num_faces());
    return nullptr;
  }
  // What a decoder will find. The encoder's own count of points is too high where seams meet at non-manifold
  // vertices.
  std::string why_not;
  std::unique_ptr<draco::Mesh> check = decoded(buffer.data(), buffer.size(), why_not);
  if (!check) throw StageError("draco", "", "a Draco stream that decodes", why_not);
  out.vertices = check->num_points();
  out.triangles = check->num_faces();
  return check;
}

draco::GeometryAttribute::Type type_of(const std::string& name) {
  if (name == "POSITION") return draco::GeometryAttribute::POSITION;
  if (name == "NORMAL") return draco::GeometryAttribute::NORMAL;
  if (name.starts_with("TEXCOORD_")) return draco::GeometryAttribute::TEX_COORD;
  return name.starts_with("COLOR_") ? draco::GeometryAttribute::COLOR : draco::GeometryAttribute::GENERIC;
}

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

double places(int bits) { return static_cast<double>((1u << bits) - 1); }

DracoGrid grid_over(const Extent& extent, int dimensions, double step, bool exact_step) {
  const double range = static_cast<double>(extent.range(dimensions));
  DracoGrid out{1, {}, 0};
  while (out.bits < kMostBits && range / places(out.bits) > step) ++out.bits;
  out.range = static_cast<float>(exact_step ? std::max(range, step * places(out.bits)) : range);
  for (int k = 0; k < dimensions; ++k) out.origin[k] = std::isfinite(extent.low[k]) ? extent.low[k] : 0;
  return out;
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

std::unique_ptr<draco::Mesh> decoded_stream(std::span<const std::uint8_t> bytes, const std::string& entry) {
  std::string why_not;
  auto mesh = decoded(reinterpret_cast<const char*>(bytes.data()), bytes.size(), why_not);
  if (!mesh) throw FormatError(entry, "draco", "a stream that decodes", why_not);
  return mesh;
}

}  // namespace

/// One primitive while it is coded anew.
struct DracoWork {
  std::unique_ptr<draco::Mesh> mesh;
  std::map<std::string, int> ids;  // glTF attribute -> index in the mesh
};

namespace {

Extent extent_of(const std::vector<DracoWork>& all, const std::string& prefix) {
  Extent out;
  for (const DracoWork& w : all)
    for (const auto& [name, id] : w.ids)
      if (name.starts_with(prefix)) out.add(*w.mesh->attribute(id));
  return out;
}

DracoGrid grid_of(const std::string& name, const Extent& positions, const Extent& uvs,
                  const DracoSteps& steps) {
  if (name == "POSITION") return grid_over(positions, 3, steps.position, steps.exact);
  if (name.starts_with("TEXCOORD_")) return grid_over(uvs, 2, steps.uv, steps.exact);
  if (name == "NORMAL") return {steps.normal_bits, {}, 1};
  return {name == "TANGENT" ? kTangentBits : 0, {-1, -1, -1}, 2};  // so that w stays 1 or -1
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
void light_as(std::vector<DracoWork>& all, const NormalSamples& samples, const std::string& entry,
              const RunContext& context) {
  std::vector<Vec3d> points;
  std::vector<Triangle> triangles;
  std::vector<Vec3f> normals;
  for (const DracoWork& w : all) {
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
  for (DracoWork& w : all) {
    const auto normal = w.ids.find("NORMAL");
    draco::PointAttribute* attribute = normal == w.ids.end() ? nullptr : w.mesh->attribute(normal->second);
    if (attribute && attribute->data_type() == draco::DT_FLOAT32 && attribute->num_components() == 3)
      set_values(*attribute, std::span<const Vec3f>(normals).subspan(first, w.mesh->num_points()));
    first += w.mesh->num_points();
  }
}

DracoStream recoded(DracoWork& work, const Extent& positions, const Extent& uvs, const DracoSteps& steps) {
  CodedAttributes attributes;
  for (const auto& [name, id] : work.ids) {
    draco::PointAttribute& values = *work.mesh->attribute(id);
    if (name.starts_with("COLOR_")) coarsen_colours(values, steps.colour_bits);
    const bool floats = values.data_type() == draco::DT_FLOAT32;
    attributes[name] = {id, floats ? grid_of(name, positions, uvs, steps) : DracoGrid{}};
  }
  DracoStream out;
  const auto check = encode_mesh(*work.mesh, attributes, 0, out);
  Extent box;
  if (const auto position = out.attributes.find("POSITION"); position != out.attributes.end())
    box.add(*check->GetAttributeByUniqueId(static_cast<std::uint32_t>(position->second)));
  out.low = {box.low[0], box.low[1], box.low[2]};
  out.high = {box.high[0], box.high[1], box.high[2]};
  return out;
}

}  // namespace

void merge_equal_points(draco::Mesh& mesh) {
  for (int a = 0; a < mesh.num_attributes(); ++a) merge_values(*mesh.attribute(a), mesh.num_points());
  merge_points(mesh);
}

struct DracoMesh::State {
  draco::Mesh mesh;
  CodedAttributes attributes;
};

DracoMesh::DracoMesh(std::span<const std::uint32_t> indices, std::size_t vertices)
    : vertices_(static_cast<std::uint32_t>(vertices)), state_(std::make_unique<State>()) {
  state_->mesh.set_num_points(vertices_);
  state_->mesh.SetNumFaces(indices.size() / 3);
  for (std::uint32_t f = 0; f < indices.size() / 3; ++f) {
    draco::Mesh::Face face;
    for (std::size_t k = 0; k < 3; ++k) face[k] = draco::PointIndex(indices[3 * f + k]);
    state_->mesh.SetFace(draco::FaceIndex(f), face);
  }
}

DracoMesh::~DracoMesh() = default;

std::uint8_t* DracoMesh::values_of(const std::string& name, std::size_t component_bytes, std::size_t bytes,
                                   const DracoGrid& grid) {
  const draco::DataType type = component_bytes == 4   ? draco::DT_FLOAT32
                               : component_bytes == 2 ? draco::DT_UINT16
                                                      : draco::DT_UINT8;
  draco::GeometryAttribute attribute;
  attribute.Init(type_of(name), nullptr, static_cast<std::int8_t>(bytes / component_bytes), type,
                 name.starts_with("COLOR_"), static_cast<std::int64_t>(bytes), 0);
  const int id = state_->mesh.AddAttribute(attribute, true, vertices_);
  state_->attributes[name] = {id, grid};
  return state_->mesh.attribute(id)->GetAddress(draco::AttributeValueIndex(0));
}

DracoStream DracoMesh::encode(int speed) {
  DracoStream out;
  encode_mesh(state_->mesh, state_->attributes, speed, out);
  return out;
}

DracoRecoder::DracoRecoder(std::vector<DracoStream> primitives, const NormalSamples* lit_as,
                           std::string entry)
    : primitives_(std::move(primitives)), lit_as_(lit_as), entry_(std::move(entry)) {}

DracoRecoder::~DracoRecoder() = default;
DracoRecoder::DracoRecoder(DracoRecoder&&) noexcept = default;

void DracoRecoder::decode(const RunContext& context) {
  for (const DracoStream& p : primitives_) {
    DracoWork& w = work_.emplace_back();
    w.mesh = decoded_stream(p.bytes, entry_);
    for (const auto& [name, unique] : p.attributes) {
      const int id = w.mesh->GetAttributeIdByUniqueId(static_cast<std::uint32_t>(unique));
      if (id < 0) throw FormatError(entry_, name, "an attribute of the Draco stream", "none of that id");
      w.ids[name] = id;
    }
  }
  if (lit_as_) light_as(work_, *lit_as_, entry_, context);
}

std::vector<DracoStream> DracoRecoder::coded(const DracoSteps& steps, const RunContext& context) {
  if (work_.empty()) decode(context);
  const Extent positions = extent_of(work_, "POSITION"), uvs = extent_of(work_, "TEXCOORD_");
  std::vector<DracoStream> out;
  std::size_t before = 0, after = 0;
  bool has_colours = false;
  for (std::size_t k = 0; k < work_.size(); ++k) {
    out.push_back(recoded(work_[k], positions, uvs, steps));
    before += primitives_[k].bytes.size();
    after += out.back().bytes.size();
    has_colours |= work_[k].ids.lower_bound("COLOR_") != work_[k].ids.lower_bound("COLOR`");
  }
  if (has_colours) work_.clear();  // they are coarser now
  return lit_as_ || after < before ? out : primitives_;
}

}  // namespace texmesh
