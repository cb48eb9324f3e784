#include "tools/extract/glb/plain_file.h"

#include <map>
#include <set>

#include "format/split/split_stream.h"
#include "stages/gltf/glb_container.h"
#include "stages/image/decode_image.h"
#include "tools/extract/glb/glb_chunks.h"
#include "tools/extract/glb/scale_model.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

/// The materials that triangles have, as import counts them.
std::vector<std::size_t> used_materials(const Json& root) {
  std::set<std::size_t> used;
  for (const Json& mesh : root["meshes"])
    for (const Json& p : mesh["primitives"])
      if (p.contains("material")) used.insert(p["material"].get<std::size_t>());
  return {used.begin(), used.end()};
}

void forget(Json& root, const char* extension) {
  for (const char* list : {"extensionsUsed", "extensionsRequired"}) {
    if (!root.contains(list)) continue;
    Json kept = Json::array();
    for (const Json& name : root[list])
      if (name != extension) kept.push_back(name);
    if (kept.empty())
      root.erase(list);
    else
      root[list] = kept;
  }
}

std::size_t add_view(GlbChunks& to, const Bytes& bytes) {
  pad_to_four(to.binary, 0);
  to.root["bufferViews"].push_back(
      {{"buffer", 0}, {"byteOffset", to.binary.size()}, {"byteLength", bytes.size()}});
  to.binary.insert(to.binary.end(), bytes.begin(), bytes.end());
  return to.root["bufferViews"].size() - 1;
}

/// The image of `from` as a view of `to`; WebP becomes PNG.
Json moved_image(Json image, const GlbChunks& from, GlbChunks& to) {
  const Json& view = from.root["bufferViews"].at(image["bufferView"].get<std::size_t>());
  const auto first =
      from.binary.begin() + static_cast<std::ptrdiff_t>(view.value("byteOffset", std::size_t{0}));
  Bytes bytes(first, first + view["byteLength"].get<std::ptrdiff_t>());
  if (image.value("mimeType", "") == "image/webp") {
    bytes = encode_image(decode_image(probe_image("image", std::move(bytes), {})), {FileImage::kPng});
    image["mimeType"] = "image/png";
  }
  image["bufferView"] = add_view(to, bytes);
  return image;
}

}  // namespace

StandaloneGlb plain_file(const StandaloneGlb& file, const std::string& entry, const RunContext& context) {
  GlbChunks from = glb_chunks(file.finish(), entry);
  Mesh flat = read_model(file, entry, context).mesh;
  const bool baked = bake_texture_scale(from.root, flat);
  ScalesOptions options;
  options.mesh_codec = MeshCodec::kNone;
  GlbChunks to = glb_chunks(write_streamed_scale(flat, SplitStreamHead{}, options), entry);
  const std::vector<std::size_t> materials = used_materials(from.root);
  for (Json& mesh : to.root["meshes"])
    for (Json& p : mesh["primitives"])
      if (!materials.empty()) p["material"] = materials.at(p.value("material", std::size_t{0}));
  Json root = from.root;
  for (const char* list : {"meshes", "accessors", "bufferViews"}) root[list] = to.root[list];
  std::size_t part = 0;  // nodes with meshes, in the order in which import makes parts of them
  for (Json& node : root["nodes"]) {
    for (const char* key : {"scale", "rotation", "matrix", "translation"}) node.erase(key);
    if (node.contains("mesh")) node["mesh"] = to.root["nodes"].at(part++).at("mesh");
  }
  for (const char* list : {"images", "textures"})
    if (!root.contains(list)) root[list] = Json::array();
  for (Json& image : root["images"]) image = moved_image(image, from, to);
  root["bufferViews"] = to.root["bufferViews"];
  for (Json& texture : root["textures"]) {
    if (!texture.contains("extensions")) continue;
    texture["source"] = texture["extensions"]["EXT_texture_webp"]["source"];
    texture.erase("extensions");
  }
  for (const char* extension : {"KHR_draco_mesh_compression", "EXT_meshopt_compression",
                                "KHR_mesh_quantization", "EXT_texture_webp", "EXT_mesh_features"})
    forget(root, extension);
  if (baked) forget(root, "KHR_texture_transform");
  for (const char* list : {"images", "textures"})
    if (root[list].empty()) root.erase(list);
  pad_to_four(to.binary, 0);
  root["buffers"] = Json::array({{{"byteLength", to.binary.size()}}});
  return {glb_container(root.dump(), to.binary), entry};
}

}  // namespace texmesh
