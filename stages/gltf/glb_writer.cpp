#include "stages/gltf/glb_writer.h"

#include <meshoptimizer.h>

#include "format/base/json_fields.h"
#include "stages/gltf/glb_container.h"

namespace texmesh {
namespace {

constexpr int kUnsignedShort = 5123, kUnsignedInt = 5125;

std::vector<std::uint8_t> of_size(std::vector<std::uint8_t> packed, std::size_t size, const char* stage) {
  if (size == 0) throw StageError(stage, "meshopt", "a compressed stream", "nothing");
  packed.resize(size);
  return packed;
}

}  // namespace

struct GlbWriter::Elements {
  Json views = Json::array(), accessors = Json::array();
  std::map<std::string, Json> arrays{{"nodes", Json::array()},     {"meshes", Json::array()},
                                     {"materials", Json::array()}, {"textures", Json::array()},
                                     {"images", Json::array()},    {"samplers", Json::array()}};
};

GlbWriter::GlbWriter() : elements_(std::make_unique<Elements>()) {}
GlbWriter::~GlbWriter() = default;

GlbWriter::Json& GlbWriter::array(const std::string& name) { return elements_->arrays.at(name); }

std::size_t GlbWriter::add_bytes(std::span<const std::uint8_t> bytes) {
  pad_to_four(bin_, 0);
  const std::size_t offset = bin_.size();
  bin_.insert(bin_.end(), bytes.begin(), bytes.end());
  return offset;
}

std::size_t GlbWriter::add_view(std::span<const std::uint8_t> bytes, std::size_t stride, int target) {
  Json view{{"buffer", 0}, {"byteOffset", add_bytes(bytes)}, {"byteLength", bytes.size()}};
  if (stride) view["byteStride"] = stride;
  if (target) view["target"] = target;
  return add_json_view(std::move(view));
}

std::size_t GlbWriter::add_json_view(Json view) {
  elements_->views.push_back(std::move(view));
  return elements_->views.size() - 1;
}

std::size_t GlbWriter::add_meshopt_view(std::span<const std::uint8_t> packed, std::size_t count,
                                        std::size_t stride, bool is_index, int target) {
  Json view{{"buffer", 1}, {"byteOffset", fallback_bytes_}, {"byteLength", count * stride}};
  if (!is_index) view["byteStride"] = stride;
  if (target) view["target"] = target;
  view["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0},
                                                   {"byteOffset", add_bytes(packed)},
                                                   {"byteLength", packed.size()},
                                                   {"byteStride", stride},
                                                   {"count", count},
                                                   {"mode", is_index ? "TRIANGLES" : "ATTRIBUTES"}};
  fallback_bytes_ += (count * stride + 3) / 4 * 4;
  use_extension("EXT_meshopt_compression", true);
  return add_json_view(std::move(view));
}

GlbWriter::Json GlbWriter::add_draco(const DracoStream& stream, std::vector<DracoAccessor> attributes) {
  Json out, ids;
  for (DracoAccessor& a : attributes) {
    a.accessor["count"] = stream.vertices;
    out["attributes"][a.name] = add_accessor(std::move(a.accessor));
    ids[a.name] = stream.attributes.at(a.name);
  }
  out["indices"] = add_accessor({{"componentType", stream.vertices > 65535 ? kUnsignedInt : kUnsignedShort},
                                 {"count", std::size_t{stream.triangles} * 3},
                                 {"type", "SCALAR"}});
  out["extensions"]["KHR_draco_mesh_compression"] = {{"bufferView", add_view(stream.bytes)},
                                                     {"attributes", std::move(ids)}};
  use_extension("KHR_draco_mesh_compression", true);
  return out;
}

std::size_t GlbWriter::add_accessor(Json accessor) {
  elements_->accessors.push_back(std::move(accessor));
  return elements_->accessors.size() - 1;
}

void GlbWriter::use_extension(const std::string& name, bool required) {
  auto add = [&](std::vector<std::string>& list) {
    if (std::find(list.begin(), list.end(), name) == list.end())
      list.insert(std::upper_bound(list.begin(), list.end(), name), name);
  };
  add(used_);
  if (required) add(required_);
}

double GlbWriter::shortest(float x) { return shortest_double(x); }

GlbWriter::Json GlbWriter::shortest(std::initializer_list<float> numbers) {
  Json out = Json::array();
  for (const float x : numbers) out.push_back(shortest(x));
  return out;
}

std::vector<std::uint8_t> GlbWriter::finish() const {
  std::vector<std::uint8_t> bin = bin_;
  pad_to_four(bin, 0);
  Json root;
  root["asset"] = {{"version", "2.0"}, {"generator", "texmesh"}};
  if (!used_.empty()) root["extensionsUsed"] = used_;
  if (!required_.empty()) root["extensionsRequired"] = required_;
  root["scene"] = 0;
  Json nodes = Json::array();
  for (std::size_t i = 0; i < elements_->arrays.at("nodes").size(); ++i) nodes.push_back(i);
  root["scenes"] = Json::array({{{"nodes", nodes}}});
  for (const char* name : {"nodes", "meshes", "materials", "textures", "images", "samplers"})
    if (!elements_->arrays.at(name).empty()) root[name] = elements_->arrays.at(name);
  if (!elements_->accessors.empty()) root["accessors"] = elements_->accessors;
  if (!elements_->views.empty()) root["bufferViews"] = elements_->views;
  root["buffers"] = Json::array({{{"byteLength", bin.size()}}});
  if (fallback_bytes_)
    root["buffers"].push_back({{"byteLength", fallback_bytes_},
                               {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}});

  return glb_container(root.dump(-1, ' ', false, Json::error_handler_t::replace), bin);
}

std::vector<std::uint8_t> meshopt_attributes(std::span<const std::uint8_t> bytes, std::size_t count,
                                             std::size_t stride, const char* stage) {
  std::vector<std::uint8_t> packed(meshopt_encodeVertexBufferBound(count, stride));
  const std::size_t size =
      meshopt_encodeVertexBuffer(packed.data(), packed.size(), bytes.data(), count, stride);
  return of_size(std::move(packed), size, stage);
}

std::vector<std::uint8_t> meshopt_triangles(std::span<const std::uint32_t> indices, std::size_t vertices,
                                            const char* stage) {
  // The extension asks for version 1, but the library writes 0 until told otherwise, once for the process.
  static const bool version_1 = [] {
    meshopt_encodeIndexVersion(1);
    return true;
  }();
  static_cast<void>(version_1);
  std::vector<std::uint8_t> packed(meshopt_encodeIndexBufferBound(indices.size(), vertices));
  const std::size_t size =
      meshopt_encodeIndexBuffer(packed.data(), packed.size(), indices.data(), indices.size());
  return of_size(std::move(packed), size, stage);
}

}  // namespace texmesh
