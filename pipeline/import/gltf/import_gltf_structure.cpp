// The only implementation of tinygltf in texmesh: without its image codecs and without its file system, so
// that it can neither open nor decode anything.
// nlohmann's header comes first: tinygltf would include it with hidden visibility.
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

#define TINYGLTF_IMPLEMENTATION
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE
#define TINYGLTF_NO_FS
#include <tiny_gltf.h>

#include "pipeline/import/gltf/import_gltf_parts.h"

namespace texmesh::gltf {
namespace {

/// Extensions are read from the document itself: tinygltf would wrap their integers to 32 bits.
void drop_extensions(Json& value) {
  if (value.is_object()) value.erase("extensions");
  if (value.is_structured()) {
    for (Json& child : value) drop_extensions(child);
  }
}

/// tinygltf refuses index accessors without a bufferView, which is what Draco primitives have.
void drop_draco_indices(Json& core) {
  if (!core.contains("meshes")) return;
  for (Json& mesh : core["meshes"]) {
    for (Json& primitive : mesh["primitives"]) {
      const auto e = primitive.find("extensions");
      if (e != primitive.end() && e->contains("KHR_draco_mesh_compression")) primitive.erase("indices");
    }
  }
}

}  // namespace

tinygltf::Model parse_structure(const Source& source, const Json& document) {
  Json core;
  for (const char* key : {"asset", "accessors", "bufferViews", "materials", "meshes", "nodes", "samplers",
                          "scene", "scenes", "textures"}) {
    if (const auto it = document.find(key); it != document.end()) core[key] = *it;
  }
  drop_draco_indices(core);
  drop_extensions(core);
  const std::string text = core.dump();
  if (text.size() > std::numeric_limits<unsigned>::max()) {
    source.fail("", "JSON under 4 GiB", std::to_string(text.size()));
  }
  core = nullptr;
  tinygltf::Model model;
  tinygltf::TinyGLTF parser;
  std::string error, warning;
  bool ok = false;
  try {
    ok = parser.LoadASCIIFromString(&model, &error, &warning, text.data(), static_cast<unsigned>(text.size()),
                                    "");
  } catch (const Json::exception& e) {
    error = e.what();
  }
  if (!ok) source.fail("", "glTF 2.0", error.empty() ? "something else" : error.substr(0, 200));
  // tinygltf leaves out primitives that it cannot read; indices of ours would then mean other ones.
  for (std::size_t m = 0; m < model.meshes.size(); ++m) {
    if (model.meshes[m].primitives.size() != document["meshes"][m]["primitives"].size()) {
      source.fail("/meshes/" + std::to_string(m), "readable primitives", error.substr(0, 200));
    }
  }
  return model;
}

}  // namespace texmesh::gltf
