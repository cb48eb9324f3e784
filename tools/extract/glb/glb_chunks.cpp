#include "tools/extract/glb/glb_chunks.h"

#include <algorithm>

#include "format/base/bounded_json.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;
constexpr const char* kTransform = "KHR_texture_transform";

/// Calls f with every reference to a texture of a material, extensions' among them.
template <class F>
void for_each_reference(Json& value, const F& f) {
  if (!value.is_object()) return;
  for (auto& [key, member] : value.items()) {
    if (key.ends_with("Texture") && member.is_object() && member.contains("index")) f(member);
    for_each_reference(member, f);
  }
}

Json transform_of(const Json& reference) {
  if (!reference.contains("extensions") || !reference["extensions"].contains(kTransform)) return nullptr;
  return reference["extensions"][kTransform];
}

}  // namespace

GlbChunks glb_chunks(std::span<const std::uint8_t> glb, const std::string& entry) {
  BytesIn in({glb.data(), glb.size()}, entry);
  in.raw(12);
  const std::uint32_t json_bytes = in.u32();
  in.u32();
  GlbChunks out{parse_bounded_json(in.raw(json_bytes), entry), {}};
  if (in.left() == 0) return out;
  const std::uint32_t binary_bytes = in.u32();
  in.u32();
  const auto binary = in.raw(binary_bytes);
  out.binary.assign(binary.begin(), binary.end());
  return out;
}

bool bake_texture_scale(Json& root, Mesh& mesh) {
  if (!root.contains("materials")) return true;
  std::vector<Json> found;
  for (Json& material : root["materials"])
    for_each_reference(material, [&](Json& reference) { found.push_back(transform_of(reference)); });
  if (found.empty() || found.front().is_null()) return std::ranges::all_of(found, &Json::is_null);
  const Json first = found.front();
  if (std::ranges::any_of(found, [&](const Json& t) { return t != first; }) || first.size() != 1 ||
      !first.contains("scale") || !mesh.uv1.empty())
    return false;
  const Vec2f scale{first["scale"].at(0).get<float>(), first["scale"].at(1).get<float>()};
  for (Vec2f& uv : mesh.uv0) uv = {uv.x * scale.x, uv.y * scale.y};
  for (Json& material : root["materials"])
    for_each_reference(material, [&](Json& reference) {
      reference["extensions"].erase(kTransform);
      if (reference["extensions"].empty()) reference.erase("extensions");
    });
  return true;
}

}  // namespace texmesh
