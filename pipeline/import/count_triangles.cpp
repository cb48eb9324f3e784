#include "pipeline/import/count_triangles.h"

#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string_view>

#include "pipeline/import/text_scan.h"

namespace texmesh {
namespace {

using Json = nlohmann::json;

/// Draco gets below a byte a triangle.
constexpr std::uint64_t kMostPerByte = 8;

std::uint32_t word(std::span<const std::uint8_t> bytes, std::size_t at) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, 4);
  return value;
}

std::uint64_t number(const Json& object, const char* key, std::uint64_t otherwise) {
  const auto found = object.find(key);
  return found != object.end() && found->is_number_unsigned() ? found->get<std::uint64_t>() : otherwise;
}

std::uint64_t triangles_of_primitive(const Json& primitive, const Json& accessors) {
  constexpr std::uint64_t kTriangles = 4, kNone = ~std::uint64_t{0};
  if (!primitive.is_object() || number(primitive, "mode", kTriangles) != kTriangles) return 0;
  std::uint64_t accessor = number(primitive, "indices", kNone);
  if (const auto attributes = primitive.find("attributes");
      accessor == kNone && attributes != primitive.end() && attributes->is_object())
    accessor = number(*attributes, "POSITION", kNone);
  if (accessor >= accessors.size() || !accessors[accessor].is_object()) return 0;
  return std::min<std::uint64_t>(number(accessors[accessor], "count", 0), 1ull << 40) / 3;
}

std::uint64_t triangles_of_glb(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < 20 || word(bytes, 12) > bytes.size() - 20) return 0;
  const auto* text = reinterpret_cast<const char*>(bytes.data()) + 20;
  const Json root = Json::parse(text, text + word(bytes, 12), nullptr, false);
  if (!root.is_object() || !root.contains("meshes") || !root.contains("accessors") ||
      !root["meshes"].is_array() || !root["accessors"].is_array())
    return 0;
  std::uint64_t sum = 0;
  for (const Json& mesh : root["meshes"])
    if (mesh.is_object() && mesh.contains("primitives") && mesh["primitives"].is_array())
      for (const Json& primitive : mesh["primitives"])
        sum += triangles_of_primitive(primitive, root["accessors"]);
  return sum;
}

std::uint64_t faces_of_ply(std::string_view text) {
  constexpr std::string_view kFaces = "\nelement face ";
  const std::string_view head = text.substr(0, std::min(text.find("end_header"), text.size()));
  const std::size_t at = head.find(kFaces);
  std::uint64_t count = 0;
  for (std::size_t i = at + kFaces.size(); at != head.npos && i < head.size() && count < (1ull << 40); ++i) {
    if (head[i] < '0' || head[i] > '9') break;
    count = 10 * count + static_cast<std::uint64_t>(head[i] - '0');
  }
  return count;
}

std::uint64_t faces_of_obj(std::string_view text) {
  std::uint64_t count = 0;
  for (std::size_t at = 0; at < text.size();) {
    count += text[at] == 'f' && at + 1 < text.size() && text[at + 1] == ' ';
    const void* end = std::memchr(text.data() + at, '\n', text.size() - at);
    if (!end) break;
    at = static_cast<std::size_t>(static_cast<const char*>(end) - text.data()) + 1;
  }
  return count;
}

std::uint64_t said(const std::string& file_name, std::span<const std::uint8_t> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::string extension = lower_extension(file_name);
  if (text.starts_with("glTF")) return triangles_of_glb(bytes);
  if (text.starts_with("ply")) return faces_of_ply(text);
  if (extension == "obj") return faces_of_obj(text);
  constexpr std::uint64_t kStlHead = 84, kStlTriangle = 50;
  if (bytes.size() >= kStlHead && bytes.size() == kStlHead + kStlTriangle * word(bytes, 80))
    return word(bytes, 80);
  return 0;
}

}  // namespace

std::uint64_t count_triangles(const std::string& file_name, std::span<const std::uint8_t> bytes) {
  const std::uint64_t count = said(file_name, bytes);
  return count <= kMostPerByte * bytes.size() ? count : 0;
}

}  // namespace texmesh
