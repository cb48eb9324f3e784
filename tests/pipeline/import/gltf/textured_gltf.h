#pragma once
// What tests of glTF's materials and of their images share.
#include <algorithm>
#include <string>
#include <utility>

#include "tests/support/gltf_builder.h"

namespace texmesh::testing {

using nlohmann::json;

inline bool has_note(const Model& m, const std::string& code, Severity severity) {
  return std::any_of(m.notes.begin(), m.notes.end(),
                     [&](const Note& n) { return n.code == code && n.severity == severity; });
}

/// A quad with one material, "a.png" as texture 0 and both sets of UVs.
inline GltfBuilder textured(json material) {
  GltfBuilder b = quad();
  json& primitive = b.json["meshes"][0]["primitives"][0];
  primitive["attributes"]["TEXCOORD_1"] = primitive["attributes"]["TEXCOORD_0"];
  primitive["material"] = 0;
  b.json["materials"] = {std::move(material)};
  b.json["textures"] = {{{"source", 0}}};
  b.json["images"] = {{{"uri", "a.png"}}};
  return b;
}
inline json base_colour(json info = {{"index", 0}}) {
  return {{"pbrMetallicRoughness", {{"baseColorTexture", std::move(info)}}}};
}

inline Model import_built(const GltfBuilder& b, MemoryResolver& resolver) {
  return import_gltf("m.glb", b.glb(), resolver, {}, {}).model;
}
inline Model import_built(const GltfBuilder& b) {
  MemoryResolver resolver;
  resolver.files["a.png"] = png();
  return import_built(b, resolver);
}

}  // namespace texmesh::testing
