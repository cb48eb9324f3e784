// glTF and GLB: what models bring (pipeline/import), and what packages hold (stages/gltf).
#include "format/base/finding.h"
#include "stages/gltf/check_glb.h"
#include "tests/fuzz/gltf_files.h"

namespace texmesh::fuzz {
namespace {

using nlohmann::json;
using texmesh::testing::GltfBuilder;

bool check_as_glb(ByteSpan input) {
  Findings findings;
  check_glb(input, "fuzz", findings, GlbRules::kStandalone);
  if (findings.empty()) return true;
  const Finding& f = findings.list().front();
  return refused(FormatError(f.entry, f.field, f.expected, f.found));
}

/// The lengths of the file and of its chunks fit its bytes.
Bytes with_lengths(ByteSpan input) {
  Bytes bytes(input.begin(), input.end());
  const auto put = [&](std::size_t at, std::size_t value) {
    for (std::size_t k = 0; k < 4; ++k) bytes[at + k] = static_cast<std::uint8_t>(value >> (8 * k));
  };
  if (bytes.size() < 20) return bytes;
  put(8, bytes.size());
  const std::size_t most = bytes.size() - 20;
  const std::size_t json_bytes = Choices(ByteSpan(bytes).subspan(12)).number(4);
  if (json_bytes > most) {
    put(12, most);
  } else if (most - json_bytes >= 8) {
    put(20 + json_bytes, most - json_bytes - 8);
  }
  return bytes;
}

// ---- whole files

GltfBuilder rich() {
  GltfBuilder b = texmesh::testing::quad();
  b.json["accessors"][0]["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", b.view_of<std::uint8_t>({1})}, {"componentType", 5121}}},
      {"values", {{"bufferView", b.view_of<float>({1, 0, 0})}}}};
  json& p = b.json["meshes"][0]["primitives"][0];
  p["attributes"]["COLOR_0"] = b.attribute<std::uint16_t>(std::vector<std::uint16_t>(12, 9), "VEC3");
  p["attributes"]["NORMAL"] = b.attribute<std::int8_t>(std::vector<std::int8_t>(12, 9), "VEC3");
  p["material"] = 0;
  b.json["materials"] = {
      {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}},
       {"extensions",
        {{"KHR_materials_specular", {{"specularTexture", {{"index", 0}}}}},
         {"KHR_materials_clearcoat", {{"clearcoatFactor", 0.5}}}}}},
      {{"extensions",
        {{"KHR_materials_pbrSpecularGlossiness",
          {{"diffuseTexture", {{"index", 0}}}, {"specularGlossinessTexture", {{"index", 0}}}}}}}}};
  b.json["textures"] = {{{"source", 0}, {"sampler", 0}}};
  b.json["samplers"] = {{{"wrapS", 33071}}};
  b.json["images"] = {{{"bufferView", b.view_of(texmesh::testing::png())}}};
  b.json["nodes"] = {{{"mesh", 0}, {"children", {1}}, {"rotation", {0, 0, 0, 1}}},
                     {{"mesh", 0}, {"scale", {1, 2, 3}}}};
  b.json["scenes"] = {{{"nodes", {0}}}};
  b.json["scene"] = 0;
  b.json["extensionsUsed"] = {"KHR_xmp_json_ld", "KHR_materials_specular", "KHR_materials_clearcoat",
                              "KHR_materials_pbrSpecularGlossiness"};
  b.json["extensions"]["KHR_xmp_json_ld"]["packets"] = {
      {{"@context", {{"dc", "http://purl.org/dc/elements/1.1/"}}},
       {"dc:title", {{"@type", "rdf:Alt"}, {"rdf:_1", {{"@value", "A"}}}}}}};
  b.json["asset"]["extensions"]["KHR_xmp_json_ld"] = {{"packet", 0}};
  return b;
}

std::vector<Bytes> glb_seeds() { return {rich().glb(), texmesh::testing::quad().glb()}; }

/// What a checker of packages finds nothing wrong with.
std::vector<Bytes> checked_seeds() {
  GltfBuilder b = texmesh::testing::quad();
  b.json["accessors"][0]["max"] = {1, 1, 0};
  b.json["scenes"] = {{{"nodes", {0}}}};
  b.json["scene"] = 0;
  return {b.glb()};
}

std::vector<Bytes> gltf_seeds() {
  GltfBuilder plain = texmesh::testing::quad();
  plain.bin.resize(256);
  json data = json::parse(plain.gltf("a.bin"));
  data["buffers"][0] = {{"byteLength", 3}, {"uri", "data:application/octet-stream;base64,AAAA"}};
  data["images"] = {{{"uri", "a.png"}}};
  data["bufferViews"] = {{{"buffer", 0}, {"byteLength", 3}}};
  data["accessors"] = {
      {{"type", "VEC3"}, {"componentType", 5126}, {"count", 3}, {"min", {0, 0, 0}}, {"max", {0, 0, 0}}}};
  data["meshes"] = {{{"primitives", {{{"attributes", {{"POSITION", 0}}}}}}}};
  return {plain.gltf("a.bin"), to_bytes(data.dump())};
}

}  // namespace

void add_gltf_targets(std::vector<Target>& list) {
  list.insert(list.end(), {{"gltf", false, import_as_gltf, gltf_seeds, Shape::kJson},
                           {"glb", false, import_as_gltf, glb_seeds, Shape::kGlb, with_lengths},
                           {"glb_check", false, check_as_glb, checked_seeds, Shape::kGlb, with_lengths}});
}

}  // namespace texmesh::fuzz
