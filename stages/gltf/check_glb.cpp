#include "stages/gltf/check_glb.h"

#include <nlohmann/json.hpp>

#include "stages/gltf/check_glb_nodes.h"
#include "stages/gltf/check_glb_primitive.h"
#include "stages/gltf/check_glb_textures.h"
#include "stages/gltf/glb_document.h"

namespace texmesh {
namespace {

using Json = GlbDocument::Json;

/// Runs body(i) for every element of the array `key`; a fault is a finding and ends that element only.
template <class Body>
void for_each_element(GlbDocument& d, const char* key, const char* check, Body&& body) {
  d.guarded(check, std::string("/") + key, [&] {
    const std::size_t count = d.array(d.root(), key, "").size();
    for (std::size_t i = 0; i < count; ++i) d.guarded(check, GlbDocument::element(key, i), [&] { body(i); });
  });
}

/// The positions of all primitives of mesh `i`.
std::vector<Vec3d> check_mesh(GlbDocument& d, std::size_t i, GlbFacts& facts) {
  const std::string place = GlbDocument::element("meshes", i);
  const Json& primitives = d.array(d.root()["meshes"][i], "primitives", place);
  if (primitives.empty()) d.fail("glb-reference", place + "/primitives", "at least one", "none");
  std::vector<Vec3d> positions;
  for (std::size_t k = 0; k < primitives.size(); ++k) {
    const std::string at = place + "/primitives/" + std::to_string(k);
    d.guarded("glb-decode", at, [&] {
      const GlbPrimitive p = check_glb_primitive(d, primitives[k], at);
      ++facts.primitives;
      facts.triangles += p.triangles;
      facts.vertices += p.vertices;
      positions.insert(positions.end(), p.positions.begin(), p.positions.end());
    });
  }
  return positions;
}

std::string codec_of(const GlbDocument& d) {
  if (d.uses_extension("KHR_draco_mesh_compression")) return "draco";
  if (d.uses_extension("EXT_meshopt_compression")) return "meshopt";
  return d.uses_extension("KHR_mesh_quantization") ? "quantized" : "none";
}

void check_document(GlbDocument& d, GlbFacts& facts) {
  for_each_element(d, "images", "glb-image", [&](std::size_t i) { check_glb_image(d, i, facts); });
  for_each_element(d, "textures", "glb-reference", [&](std::size_t i) { check_glb_texture(d, i); });
  for_each_element(d, "materials", "glb-reference", [&](std::size_t i) { check_glb_material(d, i); });
  std::vector<std::vector<Vec3d>> positions(d.array(d.root(), "meshes", "").size());
  for_each_element(d, "meshes", "glb-decode", [&](std::size_t i) { positions[i] = check_mesh(d, i, facts); });
  d.guarded("glb-node", "/nodes", [&] { check_glb_nodes(d, positions, facts); });
  facts.codec = codec_of(d);
}

}  // namespace

GlbFacts check_glb(std::span<const std::uint8_t> bytes, const std::string& entry, Findings& findings,
                   GlbRules rules) {
  GlbFacts facts;
  GlbDocument document(bytes, entry, findings, rules == GlbRules::kStandalone);
  if (!document.load()) return facts;
  document.guarded("glb-json", "", [&] { check_document(document, facts); });
  return facts;
}

}  // namespace texmesh
