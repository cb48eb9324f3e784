#include <cstring>
#include <nlohmann/json.hpp>

#include "format/base/box.h"
#include "format/rules/allocation.h"
#include "stages/gltf/glb_writer.h"
#include "stages/image/png_writer.h"
#include "tools/inspect/debug/debug_view.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;
constexpr int kFloat = 5126, kUint = 5125, kLines = 1, kArrayBuffer = 34962, kElementBuffer = 34963;

template <class T>
std::span<const std::uint8_t> bytes_of(const std::vector<T>& v) {
  return {reinterpret_cast<const std::uint8_t*>(v.data()), v.size() * sizeof(T)};
}

template <class T>
std::size_t add_attribute(GlbWriter& glb, const std::vector<T>& values, const char* type) {
  const std::size_t view = glb.add_view(bytes_of(values), 0, kArrayBuffer);
  return glb.add_accessor(
      {{"bufferView", view}, {"componentType", kFloat}, {"count", values.size()}, {"type", type}});
}

std::size_t add_positions(GlbWriter& glb, const std::vector<Vec3f>& points) {
  const Box3f box = bounding_box(points);
  const std::size_t view = glb.add_view(bytes_of(points), 0, kArrayBuffer);
  return glb.add_accessor({{"bufferView", view},
                           {"componentType", kFloat},
                           {"count", points.size()},
                           {"type", "VEC3"},
                           {"min", GlbWriter::shortest(box.min)},
                           {"max", GlbWriter::shortest(box.max)}});
}

std::size_t add_indices(GlbWriter& glb, const std::vector<std::uint32_t>& indices) {
  const std::size_t view = glb.add_view(bytes_of(indices), 0, kElementBuffer);
  return glb.add_accessor(
      {{"bufferView", view}, {"componentType", kUint}, {"count", indices.size()}, {"type", "SCALAR"}});
}

/// Area-weighted over all triangles of a position: a debug view needs shading, not creases.
std::vector<Vec3f> smooth_normals(const Mesh& mesh) {
  std::vector<Vec3d> sum(mesh.positions.size());
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto at = [&](int k) { return to_double(mesh.positions[mesh.position_of(t, k)]); };
    const Vec3d n = cross(at(1) - at(0), at(2) - at(0));
    for (int k = 0; k < 3; ++k) sum[mesh.position_of(t, k)] = sum[mesh.position_of(t, k)] + n;
  }
  std::vector<Vec3f> out;
  for (std::uint32_t p : mesh.wedge_position) {
    const Vec3d n = normalized(sum[p]);
    out.push_back(n == Vec3d{} ? Vec3f{0, 1, 0} : to_float(n));
  }
  return out;
}

int wrap_code(Wrap wrap) { return wrap == Wrap::kClamp ? 33071 : wrap == Wrap::kMirror ? 33648 : 10497; }

Json texture_info(GlbWriter& glb, const TextureRef& ref) {
  glb.array("samplers").push_back({{"wrapS", wrap_code(ref.wrap_s)}, {"wrapT", wrap_code(ref.wrap_t)}});
  glb.array("textures").push_back({{"sampler", glb.array("samplers").size() - 1}, {"source", ref.image}});
  Json info{{"index", glb.array("textures").size() - 1}, {"texCoord", ref.texcoord}};
  if (ref.transform.is_identity()) return info;
  glb.use_extension("KHR_texture_transform", true);
  const UvTransform& t = ref.transform;
  info["extensions"] = {{"KHR_texture_transform",
                         {{"offset", GlbWriter::shortest({t.offset.x, t.offset.y})},
                          {"scale", GlbWriter::shortest({t.scale.x, t.scale.y})},
                          {"rotation", GlbWriter::shortest(t.rotation)}}}};
  return info;
}

void add_material(GlbWriter& glb, const Material& m, bool translucent) {
  Json pbr{{"baseColorFactor",
            GlbWriter::shortest({m.base_colour.x, m.base_colour.y, m.base_colour.z, m.base_colour.w})},
           {"metallicFactor", 0},
           {"roughnessFactor", 1}};
  if (m.base_colour_texture.used()) pbr["baseColorTexture"] = texture_info(glb, m.base_colour_texture);
  Json material{{"pbrMetallicRoughness", pbr}, {"doubleSided", true}};
  if (translucent) material["alphaMode"] = "BLEND";
  glb.array("materials").push_back(material);
}

void add_surface(GlbWriter& glb, const DebugView& view) {
  std::vector<Vec3f> positions;
  for (std::uint32_t p : view.mesh.wedge_position) positions.push_back(view.mesh.positions[p]);
  Json attributes{{"POSITION", add_positions(glb, positions)},
                  {"NORMAL", add_attribute(glb, smooth_normals(view.mesh), "VEC3")}};
  if (!view.mesh.colours.empty()) attributes["COLOR_0"] = add_attribute(glb, view.mesh.colours, "VEC4");
  if (!view.mesh.uv0.empty()) attributes["TEXCOORD_0"] = add_attribute(glb, view.mesh.uv0, "VEC2");
  if (!view.mesh.uv1.empty() && !view.mesh.uv0.empty())
    attributes["TEXCOORD_1"] = add_attribute(glb, view.mesh.uv1, "VEC2");
  Json primitives = Json::array();
  for (std::size_t m = 0; m < view.materials.size(); ++m) {
    std::vector<std::uint32_t> indices;
    for (std::size_t t = 0; t < view.mesh.triangles.size(); ++t)
      if (view.mesh.triangle_material[t] == m)
        indices.insert(indices.end(), view.mesh.triangles[t].begin(), view.mesh.triangles[t].end());
    if (indices.empty()) continue;
    add_material(glb, view.materials[m], view.translucent);
    primitives.push_back({{"attributes", attributes},
                          {"indices", add_indices(glb, indices)},
                          {"material", glb.array("materials").size() - 1}});
  }
  glb.array("meshes").push_back({{"primitives", primitives}});
  glb.array("nodes").push_back({{"mesh", 0}, {"name", "surface"}});
}

void add_lines(GlbWriter& glb, const DebugView& view) {
  if (view.lines.empty()) return;
  std::vector<std::uint32_t> indices;
  for (const auto& line : view.lines) indices.insert(indices.end(), line.begin(), line.end());
  glb.use_extension("KHR_materials_unlit", false);
  glb.array("materials")
      .push_back({{"pbrMetallicRoughness", {{"baseColorFactor", {1, 0, 0, 1}}}},
                  {"extensions", {{"KHR_materials_unlit", Json::object()}}}});
  glb.array("meshes").push_back(
      {{"primitives", Json::array({{{"attributes", {{"POSITION", add_positions(glb, view.nodes)}}},
                                    {"indices", add_indices(glb, indices)},
                                    {"mode", kLines},
                                    {"material", glb.array("materials").size() - 1}}})}});
  glb.array("nodes").push_back({{"mesh", glb.array("meshes").size() - 1}, {"name", "lines"}});
}

}  // namespace

std::vector<std::uint8_t> write_debug_glb(const DebugView& view) {
  GlbWriter glb;
  for (const Pixels& pixels : view.textures) {
    const std::size_t png = glb.add_view(write_png(pixels));
    glb.array("images").push_back({{"mimeType", "image/png"}, {"bufferView", png}});
  }
  add_surface(glb, view);
  add_lines(glb, view);
  return glb.finish();
}

}  // namespace texmesh
