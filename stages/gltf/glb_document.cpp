#include "stages/gltf/glb_document.h"

#include <algorithm>
#include <array>

#include "format/base/bounded_json.h"
#include "stages/gltf/decode_meshopt.h"
#include "stages/gltf/glb_container.h"

namespace texmesh {
namespace {

using Json = GlbDocument::Json;

constexpr std::uint64_t kMaxDecodedBytes = 4ull << 30;

constexpr std::array<std::string_view, 5> kReadExtensions{"KHR_draco_mesh_compression",
                                                          "KHR_mesh_quantization", "EXT_meshopt_compression",
                                                          "KHR_texture_transform", "KHR_materials_unlit"};

std::size_t bytes_of_component(std::uint64_t type) {
  constexpr std::array<std::uint8_t, 7> kBytes{1, 1, 2, 2, 0, 4, 4};
  return type >= 5120 && type - 5120 < kBytes.size() ? kBytes[type - 5120] : 0;
}

std::size_t components_of_type(const std::string& type) {
  if (type == "SCALAR") return 1;
  if (type == "VEC2") return 2;
  if (type == "VEC3") return 3;
  if (type == "VEC4") return 4;
  return 0;  // matrices have no place in a static mesh
}

std::string text_at(const Json& object, const char* key) {
  const auto it = object.find(key);
  return it != object.end() && it->is_string() ? it->get<std::string>() : std::string();
}

}  // namespace

GlbDocument::GlbDocument(std::span<const std::uint8_t> bytes, std::string entry, Findings& findings,
                         bool standalone)
    : bytes_(bytes),
      entry_(std::move(entry)),
      findings_(findings),
      standalone_(standalone),
      root_(std::make_unique<Json>()) {}

GlbDocument::~GlbDocument() = default;

void GlbDocument::fail(const Check& check, const std::string& field, const std::string& expected,
                       const std::string& found) {
  findings_.add(check, entry_, field, expected, found);
  throw Broken{};
}

const Json& GlbDocument::array(const Json& object, const char* key, const std::string& place) {
  static const Json kEmpty = Json::array();
  const auto it = object.find(key);
  if (it == object.end()) return kEmpty;
  if (!it->is_array()) fail("glb-json", place + "/" + key, "an array", it->type_name());
  for (std::size_t i = 0; i < it->size(); ++i)
    if (!(*it)[i].is_object() && !(*it)[i].is_number() && !(*it)[i].is_string())
      fail("glb-json", place + "/" + key + "/" + std::to_string(i), "an object, a number or a text",
           (*it)[i].type_name());
  return *it;
}

std::uint64_t GlbDocument::number(const Json& object, const char* key, std::uint64_t fallback,
                                  const std::string& place) {
  const auto it = object.find(key);
  if (it == object.end()) return fallback;
  if (!it->is_number_unsigned())
    fail("glb-json", place + "/" + key, "an integer >= 0", it->dump().substr(0, 60));
  return it->get<std::uint64_t>();
}

std::size_t GlbDocument::index(const Json& object, const char* key, std::size_t size,
                               const std::string& place) {
  if (object.find(key) == object.end())
    fail("glb-reference", place + "/" + key, "an index below " + std::to_string(size), "nothing");
  const std::uint64_t i = number(object, key, 0, place);
  if (i >= size)
    fail("glb-reference", place + "/" + key, "an index below " + std::to_string(size), std::to_string(i));
  return static_cast<std::size_t>(i);
}

bool GlbDocument::uses_extension(const std::string& name) const {
  const auto it = root_->find("extensionsUsed");
  return it != root_->end() && it->is_array() && std::find(it->begin(), it->end(), Json(name)) != it->end();
}

bool GlbDocument::load() {
  return guarded("glb-container", "", [&] {
    if (!load_chunks() || !load_json()) throw Broken{};
    load_buffers();
    const std::size_t views = array(*root_, "bufferViews", "").size();
    views_.resize(views);
    for (std::size_t i = 0; i < views; ++i)
      guarded("glb-decode", "/bufferViews/" + std::to_string(i), [&] { load_view(i); });
    const std::size_t accessors = array(*root_, "accessors", "").size();
    accessors_.resize(accessors);
    for (std::size_t i = 0; i < accessors; ++i)
      guarded("glb-accessor", "/accessors/" + std::to_string(i), [&] { load_accessor(i); });
  });
}

bool GlbDocument::load_chunks() {
  const auto require = [&](bool holds, const std::string& field, const std::string& expected,
                           const std::string& found) {
    return findings_.require(holds, "glb-container", entry_, field, expected, found);
  };
  if (!require(bytes_.size() >= 20, "", "at least 20 bytes", std::to_string(bytes_.size()))) return false;
  if (!require(value_at<std::uint32_t>(bytes_.data()) == kGlbMagic, "byte 0", "\"glTF\"", "other bytes"))
    return false;
  if (!require(value_at<std::uint32_t>(bytes_.data() + 4) == 2, "byte 4", "version 2",
               std::to_string(value_at<std::uint32_t>(bytes_.data() + 4))))
    return false;
  if (!require(value_at<std::uint32_t>(bytes_.data() + 8) == bytes_.size(), "byte 8",
               std::to_string(bytes_.size()) + " bytes",
               std::to_string(value_at<std::uint32_t>(bytes_.data() + 8))))
    return false;
  std::size_t at = 12;
  for (int chunk = 0; at < bytes_.size(); ++chunk) {
    const std::string field = "byte " + std::to_string(at);
    if (!require(bytes_.size() - at >= 8, field, "a chunk header",
                 std::to_string(bytes_.size() - at) + " bytes"))
      return false;
    const std::uint32_t length = value_at<std::uint32_t>(bytes_.data() + at),
                        type = value_at<std::uint32_t>(bytes_.data() + at + 4);
    if (!require(length % 4 == 0 && length <= bytes_.size() - at - 8, field,
                 "a chunk of a multiple of 4 bytes that fits the file", std::to_string(length) + " bytes"))
      return false;
    const bool expected_type = chunk == 0 ? type == kGlbJsonChunk : chunk == 1 && type == kGlbBinaryChunk;
    if (!require(expected_type, field, chunk == 0 ? "the JSON chunk" : "the BIN chunk, then the end",
                 "another chunk"))
      return false;
    (chunk == 0 ? json_ : binary_) = bytes_.subspan(at + 8, length);
    at += 8 + length;
  }
  return true;
}

bool GlbDocument::load_json() {
  try {
    *root_ = parse_bounded_json(json_, entry_);
  } catch (const FormatError& e) {
    findings_.add("glb-json", entry_, e);
    return false;
  }
  if (!root_->is_object()) fail("glb-json", "", "an object", root_->type_name());
  const auto asset = root_->find("asset");
  if (asset == root_->end() || !asset->is_object() || text_at(*asset, "version") != "2.0")
    fail("glb-json", "/asset/version", "\"2.0\"", "something else");
  for (const Json& name : array(*root_, "extensionsRequired", "")) {
    const std::string text = name.is_string() ? name.get<std::string>() : name.dump();
    const bool known =
        std::find(kReadExtensions.begin(), kReadExtensions.end(), text) != kReadExtensions.end();
    if (!known && !(standalone_ && (text == "EXT_texture_webp" || text == "EXT_texture_avif")))
      fail("glb-json", "/extensionsRequired", "extensions of the package format", text);
    if (!uses_extension(text))
      findings_.add("glb-json", entry_, "/extensionsUsed", "to name " + text, "nothing");
  }
  return true;
}

void GlbDocument::load_buffers() {
  const Json& buffers = array(*root_, "buffers", "");
  for (std::size_t i = 0; i < buffers.size(); ++i) {
    const std::string place = "/buffers/" + std::to_string(i);
    const std::uint64_t bytes = number(buffers[i], "byteLength", 0, place);
    buffer_bytes_.push_back(bytes);
    if (buffers[i].find("uri") != buffers[i].end())
      fail({"glb-reference", standalone_ ? "G13" : "G06"}, place + "/uri", "no file beside the GLB", "a uri");
    if (i == 0 && (bytes > binary_.size() || binary_.size() - bytes > 3))
      fail("glb-container", place + "/byteLength",
           "the BIN chunk's " + std::to_string(binary_.size()) + " bytes, or up to 3 less",
           std::to_string(bytes));
    if (i > 0 && !uses_extension("EXT_meshopt_compression"))
      fail("glb-reference", place, "one buffer, the BIN chunk", "another buffer");
  }
}

void GlbDocument::load_view(std::size_t i) {
  const Json& json = (*root_)["bufferViews"][i];
  const std::string place = "/bufferViews/" + std::to_string(i);
  View& view = views_[i];
  const std::size_t buffer = index(json, "buffer", buffer_bytes_.size(), place);
  const std::uint64_t offset = number(json, "byteOffset", 0, place),
                      bytes = number(json, "byteLength", 0, place);
  if (offset > buffer_bytes_[buffer] || bytes > buffer_bytes_[buffer] - offset)
    fail("glb-reference", place + "/byteLength",
         "a range within the buffer's " + std::to_string(buffer_bytes_[buffer]) + " bytes",
         std::to_string(offset) + " + " + std::to_string(bytes));
  view.stride = static_cast<std::size_t>(number(json, "byteStride", 0, place));
  const auto extensions = json.find("extensions");
  if (extensions != json.end() && extensions->is_object() &&
      extensions->contains("EXT_meshopt_compression")) {
    decode_meshopt(view, (*extensions)["EXT_meshopt_compression"],
                   place + "/extensions/EXT_meshopt_compression");
    if (view.data.size() != bytes)
      fail("glb-decode", place + "/byteLength", std::to_string(view.data.size()) + " decoded bytes",
           std::to_string(bytes));
  } else {
    if (buffer != 0) fail("glb-reference", place + "/buffer", "0, the BIN chunk", std::to_string(buffer));
    view.data = binary_.subspan(static_cast<std::size_t>(offset), static_cast<std::size_t>(bytes));
  }
  view.ok = true;
}

void GlbDocument::decode_meshopt(View& view, const Json& json, const std::string& place) {
  if (!json.is_object()) fail("glb-json", place, "an object", json.type_name());
  const std::uint64_t offset = number(json, "byteOffset", 0, place),
                      bytes = number(json, "byteLength", 0, place);
  const std::uint64_t stride = number(json, "byteStride", 0, place), count = number(json, "count", 0, place);
  const std::string mode = text_at(json, "mode"), filter = text_at(json, "filter");
  if (index(json, "buffer", buffer_bytes_.size(), place) != 0 || offset > binary_.size() ||
      bytes > binary_.size() - offset)
    fail("glb-reference", place, "a range within the BIN chunk",
         std::to_string(offset) + " + " + std::to_string(bytes));
  if (stride > 0 && count > (kMaxDecodedBytes - decoded_bytes_) / stride)
    fail("glb-decode", place, "at most 4 GiB in all views",
         std::to_string(count) + " elements of " + std::to_string(stride) + " bytes");
  decoded_bytes_ += count * stride;
  const auto known_mode = meshopt_mode(mode);
  const auto known_filter = meshopt_filter(filter.empty() ? "NONE" : filter);
  if (!known_mode) fail("glb-decode", place + "/mode", "ATTRIBUTES, TRIANGLES or INDICES", mode);
  if (!known_filter || known_filter == MeshoptFilter::kColour)
    fail("glb-decode", place + "/filter", "a filter of the extension", filter);
  const MeshoptStream stream{
      binary_.subspan(static_cast<std::size_t>(offset), static_cast<std::size_t>(bytes)), count, stride,
      *known_mode, *known_filter};
  if (is_meshopt_version1(stream)) fail("glb-decode", place, "attributes of version 0", "version 1");
  view.data = decoded_.emplace_back(
      texmesh::decode_meshopt(stream, [&](const std::string& expected, const std::string& found) {
        fail("glb-decode", place, expected, found);
      }));
}

void GlbDocument::load_accessor(std::size_t i) {
  const Json& json = (*root_)["accessors"][i];
  const std::string place = "/accessors/" + std::to_string(i);
  Accessor& a = accessors_[i];
  const std::uint64_t type = number(json, "componentType", 0, place), count = number(json, "count", 0, place);
  a.component_bytes = bytes_of_component(type);
  a.component_type = static_cast<int>(type);
  a.components = components_of_type(text_at(json, "type"));
  a.normalized = json.value("normalized", false);
  if (a.component_bytes == 0)
    fail("glb-accessor", place + "/componentType", "5120..5126", std::to_string(type));
  if (a.components == 0)
    fail("glb-accessor", place + "/type", "SCALAR, VEC2, VEC3 or VEC4", text_at(json, "type"));
  if (count == 0 || count > 0xffffffffu)
    fail("glb-accessor", place + "/count", "1 .. 2^32 - 1", std::to_string(count));
  if (json.contains("sparse"))
    fail("glb-accessor", place + "/sparse", "no sparse data in a package", "sparse");
  a.count = static_cast<std::size_t>(count);
  const std::size_t element = a.components * a.component_bytes;
  if (json.contains("bufferView")) {
    a.view = static_cast<std::int64_t>(index(json, "bufferView", views_.size(), place));
    const View& view = views_[static_cast<std::size_t>(a.view)];
    if (!view.ok) throw Broken{};  // the view has its finding
    a.stride = view.stride ? view.stride : element;
    const std::uint64_t offset = number(json, "byteOffset", 0, place);
    if (a.stride < element || offset > view.data.size() || view.data.size() - offset < element ||
        (view.data.size() - offset - element) / a.stride < a.count - 1)
      fail(
          "glb-accessor", place,
          "elements within the buffer view's " + std::to_string(view.data.size()) + " bytes",
          std::to_string(count) + " of " + std::to_string(element) + " bytes from " + std::to_string(offset));
    if (offset % a.component_bytes != 0 || a.stride % a.component_bytes != 0)
      fail("glb-accessor", place + "/byteOffset", "a multiple of " + std::to_string(a.component_bytes),
           std::to_string(offset));
    a.offset = static_cast<std::size_t>(offset);
  }
  a.ok = true;
}

double GlbDocument::value(const Accessor& a, std::size_t i, std::size_t c) const {
  if (a.view < 0) return 0;
  const std::uint8_t* p =
      views_[static_cast<std::size_t>(a.view)].data.data() + a.offset + i * a.stride + c * a.component_bytes;
  const auto scaled = [&](double v, double largest) {
    return a.normalized ? std::max(v / largest, -1.0) : v;
  };
  switch (a.component_type) {
    case 5120:
      return scaled(value_at<std::int8_t>(p), 127);
    case 5121:
      return scaled(value_at<std::uint8_t>(p), 255);
    case 5122:
      return scaled(value_at<std::int16_t>(p), 32767);
    case 5123:
      return scaled(value_at<std::uint16_t>(p), 65535);
    case 5125:
      return value_at<std::uint32_t>(p);
    default:
      return value_at<float>(p);
  }
}

}  // namespace texmesh
