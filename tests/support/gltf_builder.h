#pragma once
#include <cstdint>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "format/base/bytes.h"
#include "pipeline/import/import.h"
#include "pipeline/io/uri.h"
#include "tests/support/memory_resolver.h"

namespace texmesh::testing {

template <class T>
void append(Bytes& out, const T& value) {
  const auto* p = reinterpret_cast<const std::uint8_t*>(&value);
  out.insert(out.end(), p, p + sizeof value);
}

inline Bytes from_base64(const std::string& text) {
  return decode_data_uri("data:;base64," + text, 1 << 20, "test", "");
}
/// One pixel each.
inline Bytes png() {
  return from_base64(
      "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==");
}
inline Bytes webp() { return from_base64("UklGRhoAAABXRUJQVlA4TA0AAAAvAAAAEAcQERGIiP4HAA=="); }

/// A container around any text and bytes, right or wrong.
inline Bytes make_glb(const std::string& json, const std::optional<Bytes>& bin) {
  Bytes out;
  const auto chunk = [&out](std::uint32_t type, const auto& data, std::uint8_t padding) {
    append(out, static_cast<std::uint32_t>((data.size() + 3) / 4 * 4));
    append(out, type);
    out.insert(out.end(), data.begin(), data.end());
    while (out.size() % 4) out.push_back(padding);
  };
  append(out, 0x46546C67u);
  append(out, 2u);
  append(out, 0u);
  chunk(0x4E4F534A, json, ' ');
  if (bin) chunk(0x004E4942, *bin, 0);
  const auto size = static_cast<std::uint32_t>(out.size());
  std::memcpy(out.data() + 8, &size, 4);
  return out;
}

/// A small glTF put together piece by piece; the JSON may be changed at will before it is written.
struct GltfBuilder {
  nlohmann::json json = {{"asset", {{"version", "2.0"}}}};
  Bytes bin;

  template <class T>
  int view_of(const std::vector<T>& values, int byte_stride = 0) {
    while (bin.size() % 4) bin.push_back(0);
    nlohmann::json view = {
        {"buffer", 0}, {"byteOffset", bin.size()}, {"byteLength", values.size() * sizeof(T)}};
    if (byte_stride) view["byteStride"] = byte_stride;
    for (const T& v : values) append(bin, v);
    return push("bufferViews", view);
  }
  int accessor(int view, const char* type, int component_type, std::size_t count, nlohmann::json more = {}) {
    nlohmann::json a = {{"type", type}, {"componentType", component_type}, {"count", count}};
    if (view >= 0) a["bufferView"] = view;
    if (more.is_object()) a.update(more);
    return push("accessors", a);
  }
  /// `values` are the components of all elements.
  template <class T>
  int attribute(const std::vector<T>& values, const char* type, nlohmann::json more = {}) {
    const std::size_t n = components(type);
    if (std::string(type) == "VEC3" && !more.is_object()) more = {{"min", {0, 0, 0}}, {"max", {9, 9, 9}}};
    return accessor(view_of(values), type, component_type<T>(), values.size() / n, more);
  }
  int mesh(const nlohmann::json& attributes, nlohmann::json more = {}) {
    nlohmann::json primitive = {{"attributes", attributes}};
    if (more.is_object()) primitive.update(more);
    return push("meshes", {{"primitives", {primitive}}});
  }
  int node(nlohmann::json properties) { return push("nodes", std::move(properties)); }
  int push(const char* array, nlohmann::json value) {
    json[array].push_back(std::move(value));
    return static_cast<int>(json[array].size()) - 1;
  }
  Bytes glb() const {
    nlohmann::json j = json;
    if (!bin.empty() && !j.contains("buffers")) j["buffers"] = {{{"byteLength", bin.size()}}};
    return make_glb(j.dump(), bin.empty() ? std::nullopt : std::optional<Bytes>(bin));
  }
  /// A .gltf whose buffer stands in `uri`.
  Bytes gltf(const std::string& uri) const {
    nlohmann::json j = json;
    j["buffers"] = {{{"byteLength", bin.size()}, {"uri", uri}}};
    const std::string text = j.dump();
    return {text.begin(), text.end()};
  }

  static std::size_t components(const std::string& type) {
    return type == "SCALAR" ? 1 : type == "VEC2" ? 2 : type == "VEC3" ? 3 : 4;
  }
  template <class T>
  static constexpr int component_type() {
    if constexpr (std::is_same_v<T, std::int8_t>) return 5120;
    if constexpr (std::is_same_v<T, std::uint8_t>) return 5121;
    if constexpr (std::is_same_v<T, std::int16_t>) return 5122;
    if constexpr (std::is_same_v<T, std::uint16_t>) return 5123;
    if constexpr (std::is_same_v<T, std::uint32_t>) return 5125;
    return 5126;
  }
};

/// A quad of two triangles in the plane z = 0, with UVs, as mesh 0 of node 0.
inline GltfBuilder quad() {
  GltfBuilder b;
  const int positions = b.attribute<float>({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, "VEC3");
  const int uvs = b.attribute<float>({0, 1, 1, 1, 1, 0, 0, 0}, "VEC2");
  const int indices = b.attribute<std::uint16_t>({0, 1, 2, 0, 2, 3}, "SCALAR");
  b.mesh({{"POSITION", positions}, {"TEXCOORD_0", uvs}}, {{"indices", indices}});
  b.node({{"mesh", 0}});
  return b;
}

}  // namespace texmesh::testing
