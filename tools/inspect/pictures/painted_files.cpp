// A painted model as files: a GLB to turn in any viewer, and a PNG of two views.

#include <fmt/format.h>

#include "format/base/portable_math.h"
#include "format/rules/allocation.h"
#include "stages/geometry/mesh_topology.h"
#include "stages/gltf/glb_writer.h"
#include "stages/image/png_writer.h"
#include "stages/render/shade.h"
#include "tools/inspect/pictures/painted_model.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;
constexpr int kFloat = 5126, kUint = 5125, kLines = 1, kArrayBuffer = 34962, kElementBuffer = 34963;

template <class T>
std::span<const std::uint8_t> bytes_of(const std::vector<T>& v) {
  return {reinterpret_cast<const std::uint8_t*>(v.data()), v.size() * sizeof(T)};
}

template <class T>
std::size_t add_values(GlbWriter& glb, const std::vector<T>& values, const char* type, int component = kFloat,
                       bool bounded = false) {
  const std::size_t view =
      glb.add_view(bytes_of(values), 0, component == kFloat ? kArrayBuffer : kElementBuffer);
  Json accessor{{"bufferView", view}, {"componentType", component}, {"count", values.size()}, {"type", type}};
  if constexpr (std::is_same_v<T, Vec3f>) {
    const Box3f box = bounding_box(values);
    if (bounded)
      accessor["min"] = GlbWriter::shortest(box.min), accessor["max"] = GlbWriter::shortest(box.max);
  }
  return glb.add_accessor(std::move(accessor));
}

/// A picture needs shading, not creases.
std::vector<Vec3f> smooth_normals(const Mesh& mesh) {
  const std::vector<Vec3f> of_positions = position_normals(mesh);
  std::vector<Vec3f> out;
  for (const std::uint32_t p : mesh.wedge_position) out.push_back(of_positions[p]);
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

void add_surface(GlbWriter& glb, const PaintedModel& model) {
  std::vector<Vec3f> positions;
  for (std::uint32_t p : model.mesh.wedge_position) positions.push_back(model.mesh.positions[p]);
  Json attributes{{"POSITION", add_values(glb, positions, "VEC3", kFloat, true)},
                  {"NORMAL", add_values(glb, smooth_normals(model.mesh), "VEC3")}};
  if (!model.mesh.colours.empty()) attributes["COLOR_0"] = add_values(glb, model.mesh.colours, "VEC4");
  if (!model.mesh.uv0.empty()) attributes["TEXCOORD_0"] = add_values(glb, model.mesh.uv0, "VEC2");
  if (!model.mesh.uv1.empty() && !model.mesh.uv0.empty())
    attributes["TEXCOORD_1"] = add_values(glb, model.mesh.uv1, "VEC2");
  Json primitives = Json::array();
  for (std::size_t m = 0; m < model.materials.size(); ++m) {
    std::vector<std::uint32_t> indices;
    for (std::size_t t = 0; t < model.mesh.triangles.size(); ++t)
      if (model.mesh.triangle_material[t] == m)
        indices.insert(indices.end(), model.mesh.triangles[t].begin(), model.mesh.triangles[t].end());
    if (indices.empty()) continue;
    add_material(glb, model.materials[m], model.translucent);
    primitives.push_back({{"attributes", attributes},
                          {"indices", add_values(glb, indices, "SCALAR", kUint)},
                          {"material", glb.array("materials").size() - 1}});
  }
  glb.array("meshes").push_back({{"primitives", primitives}});
  glb.array("nodes").push_back({{"mesh", 0}, {"name", "surface"}});
}

void add_lines(GlbWriter& glb, const PaintedModel& model) {
  if (model.lines.empty()) return;
  std::vector<std::uint32_t> indices;
  for (const auto& line : model.lines) indices.insert(indices.end(), line.begin(), line.end());
  glb.use_extension("KHR_materials_unlit", false);
  glb.array("materials")
      .push_back({{"pbrMetallicRoughness", {{"baseColorFactor", {1, 0, 0, 1}}}},
                  {"extensions", {{"KHR_materials_unlit", Json::object()}}}});
  glb.array("meshes").push_back(
      {{"primitives",
        Json::array({{{"attributes", {{"POSITION", add_values(glb, model.nodes, "VEC3", kFloat, true)}}},
                      {"indices", add_values(glb, indices, "SCALAR", kUint)},
                      {"mode", kLines},
                      {"material", glb.array("materials").size() - 1}}})}});
  glb.array("nodes").push_back({{"mesh", glb.array("meshes").size() - 1}, {"name", "lines"}});
}

constexpr double kTube = 0.004, kPoint = 0.01;  // half width of lines and points, of the object's diagonal
constexpr std::uint32_t kBar = 16;              // width of the bar of colours, px
constexpr double kAmbient = 0.3;
constexpr double kElevation = 0.35;  // sine of the angle the views look down at

ViewCamera camera_at(double angle, const BoundingSphere& bounds) {
  const double ring = std::sqrt(1 - kElevation * kElevation);
  return view_towards({ring * portable::sin(angle), kElevation, ring * portable::cos(angle)}, bounds);
}

/// A bar with four sides along a line; a cube for a point.
void add_bar(Vec3d a, Vec3d b, double diagonal, Mesh& mesh) {
  const bool point = a == b;
  const double half = (point ? kPoint : kTube) * diagonal;
  const Vec3d along = point ? Vec3d{1, 0, 0} : normalized(b - a);
  const Vec3d side = normalized(cross(along, std::fabs(along.y) < 0.9 ? Vec3d{0, 1, 0} : Vec3d{1, 0, 0}));
  const Vec3d up = cross(along, side);
  if (point) a = a - along * half, b = b + along * half;
  const auto first = static_cast<std::uint32_t>(mesh.positions.size());
  for (const Vec3d& end : {a, b})
    for (int k = 0; k < 4; ++k) {
      const double u = k == 0 || k == 3 ? 1 : -1, v = k < 2 ? 1 : -1;
      mesh.positions.push_back(to_float(end + side * (u * half) + up * (v * half)));
      mesh.wedge_position.push_back(static_cast<std::uint32_t>(mesh.positions.size() - 1));
    }
  for (std::uint32_t k = 0; k < 4; ++k) {
    const std::uint32_t next = (k + 1) % 4;
    mesh.triangles.push_back({first + k, first + next, first + 4 + next});
    mesh.triangles.push_back({first + k, first + 4 + next, first + 4 + k});
  }
  for (std::uint32_t end : {first, first + 4}) {
    mesh.triangles.push_back({end, end + 1, end + 2});
    mesh.triangles.push_back({end, end + 2, end + 3});
  }
}

Mesh bars_of(const PaintedModel& model, double diagonal) {
  Mesh mesh;
  for (const auto& [a, b] : model.lines)
    add_bar(to_double(model.nodes[a]), to_double(model.nodes[b]), diagonal, mesh);
  mesh.triangle_material.assign(mesh.triangles.size(), 0);
  return mesh;
}

/// Triangles of one brightness each, as a light at the camera makes them: edge-on they keep kAmbient of it.
Mesh lit_from(Vec3d towards_viewer, const Mesh& mesh) {
  Mesh out;
  out.positions = mesh.positions;
  out.triangle_material = mesh.triangle_material;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto [a, b, c] = corner_points(mesh, mesh.triangles[t]);
    const Vec3d face = normalized(cross(b - a, c - a));
    const auto light = static_cast<float>(kAmbient + (1 - kAmbient) * std::fabs(dot(face, towards_viewer)));
    const auto first = static_cast<std::uint32_t>(out.wedge_position.size());
    out.triangles.push_back({first, first + 1, first + 2});
    for (const std::uint32_t w : mesh.triangles[t]) {
      out.wedge_position.push_back(mesh.wedge_position[w]);
      const Vec4f colour = mesh.colours.empty() ? Vec4f{1, 1, 1, 1} : mesh.colours[w];
      out.colours.push_back({colour.x * light, colour.y * light, colour.z * light, 1});
      if (!mesh.uv0.empty()) out.uv0.push_back(mesh.uv0[w]);
      if (!mesh.uv1.empty()) out.uv1.push_back(mesh.uv1[w]);
    }
  }
  return out;
}

Picture render(const Mesh& mesh, const std::vector<Material>& materials,
               const std::vector<RenderTexture>& textures, const ViewCamera& camera, std::uint32_t side_px) {
  const Mesh lit = lit_from(camera.z, mesh);
  std::vector<RenderMaterial> unlit;
  for (const Material& m : materials) {
    unlit.push_back(render_material(m, [](const TextureRef& ref, TextureUse use) {
      return use == TextureUse::kBaseColour ? ref.image : -1;
    }));
    unlit.back().unlit = unlit.back().double_sided = true;
    unlit.back().alpha_mode = AlphaMode::kOpaque;
  }
  const RenderScene scene = render_scene(lit, unlit, textures.size());
  return shade(scene, look(scene, perspective_camera(camera), side_px, {}), textures, studio_environment(),
               {});
}

void paste_square(const Picture& picture, std::uint32_t left, Pixels& out) {
  const Pixels from = encode_srgb(picture);
  for (std::uint32_t y = 0; y < from.height_px; ++y)
    std::copy_n(from.at(0, y), std::size_t{3} * from.width_px,
                out.data.data() + (std::size_t{y} * out.width_px + left) * 3);
}

/// The colours as the tone mapping of pictures shows them.
void paste_bar(Pixels& out) {
  for (std::uint32_t y = 0; y < out.height_px; ++y) {
    const Srgb code = colour_of(1 - (y + 0.5) / out.height_px);
    const std::array<float, 256>& light = light_of_bytes();
    const Vec3f mapped = tone_mapped({light[code[0]], light[code[1]], light[code[2]]});
    const Pixels c = encode_srgb({1, {mapped}, {1}});
    for (std::uint32_t x = out.width_px - kBar; x < out.width_px; ++x)
      std::copy_n(c.data.data(), 3, out.data.data() + (std::size_t{y} * out.width_px + x) * 3);
  }
}

constexpr std::size_t kMostLayouts = 4;

/// The mean of the texels of a rectangle, of at least one.
std::array<std::uint8_t, 3> mean_of(const Pixels& p, std::uint32_t x0, std::uint32_t y0, std::uint32_t x1,
                                    std::uint32_t y1) {
  std::array<std::uint64_t, 3> sum{};
  for (std::uint32_t y = y0; y < y1; ++y)
    for (std::uint32_t x = x0; x < x1; ++x)
      for (std::size_t c = 0; c < 3; ++c) sum[c] += p.at(x, y)[c];
  const std::uint64_t count = std::uint64_t{x1 - x0} * (y1 - y0);
  return {static_cast<std::uint8_t>(sum[0] / count), static_cast<std::uint8_t>(sum[1] / count),
          static_cast<std::uint8_t>(sum[2] / count)};
}

/// A texture within the square whose left side is `left`, in its own shape.
void paste_layout(const Pixels& texture, std::uint32_t left, Pixels& out) {
  const std::uint32_t side = out.height_px, longer = std::max(texture.width_px, texture.height_px);
  const auto scaled = [](std::uint32_t at, std::uint32_t from, std::uint32_t to) {
    return static_cast<std::uint32_t>(std::uint64_t{at} * to / from);
  };
  const std::uint32_t width = std::max(1u, scaled(texture.width_px, longer, side)),
                      height = std::max(1u, scaled(texture.height_px, longer, side));
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; ++x) {
      const std::uint32_t x0 = scaled(x, width, texture.width_px), y0 = scaled(y, height, texture.height_px);
      const auto c = mean_of(texture, x0, y0, std::max(x0 + 1, scaled(x + 1, width, texture.width_px)),
                             std::max(y0 + 1, scaled(y + 1, height, texture.height_px)));
      std::copy(c.begin(), c.end(), out.data.data() + (std::size_t{y} * out.width_px + left + x) * 3);
    }
}

void require_points(const PaintedModel& model, const std::string& what) {
  if (model.points.empty())
    throw InputError("", what, "a quantity of vertices, for .csv and .ply", "one of textures");
}

}  // namespace

std::vector<std::uint8_t> write_painted_glb(const PaintedModel& model) {
  GlbWriter glb;
  for (const Pixels& pixels : model.textures) {
    const std::size_t png = glb.add_view(write_png(pixels));
    glb.array("images").push_back({{"mimeType", "image/png"}, {"bufferView", png}});
  }
  add_surface(glb, model);
  add_lines(glb, model);
  return glb.finish();
}

std::string write_painted_csv(const PaintedModel& model, const std::string& what) {
  require_points(model, what);
  std::string out = what + ",tx,ty,gx,gy,gz\n";
  for (const PaintedPoint& p : model.points)
    fmt::format_to(std::back_inserter(out), "{},{},{},{},{},{}\n", p.value, p.texture.x, p.texture.y, p.at.x,
                   p.at.y, p.at.z);
  return out;
}

std::string write_painted_ply(const PaintedModel& model, const std::string& what) {
  require_points(model, what);
  std::string out = fmt::format(
      "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n"
      "property float s\nproperty float t\nproperty double {}\nend_header\n",
      model.points.size(), what);
  for (const PaintedPoint& p : model.points)
    fmt::format_to(std::back_inserter(out), "{} {} {} {} {} {}\n", p.at.x, p.at.y, p.at.z, p.texture.x,
                   p.texture.y, p.value);
  return out;
}

std::vector<std::uint8_t> write_painted_png(const PaintedModel& model, std::uint32_t side_px) {
  BoundingSphere bounds = bounding_sphere(model.mesh.positions);
  if (!(bounds.radius > 0)) bounds.radius = 1;
  const Mesh bars = bars_of(model, 2 * bounds.radius);
  Material red;
  red.base_colour = {1, 0.02f, 0.02f, 1};
  std::vector<RenderTexture> textures;
  for (const Pixels& p : model.textures) textures.push_back(render_texture(p, true, 0, {}));
  Pixels out;
  const auto layouts =
      static_cast<std::uint32_t>(model.shows_layout ? std::min(kMostLayouts, model.textures.size()) : 0);
  out.width_px = (2 + layouts) * side_px + (model.legend.coloured ? kBar : 0);
  out.height_px = side_px, out.channels = 3;
  out.data.resize(std::size_t{out.width_px} * out.height_px * 3);
  for (std::uint32_t k = 0; k < 2; ++k) {
    const ViewCamera camera = camera_at(0.5 + portable::kPi * k, bounds);
    Picture picture = render(model.mesh, model.materials, textures, camera, side_px);
    if (!bars.triangles.empty()) {
      const Picture over = render(bars, {red}, {}, camera, side_px);
      for (std::size_t i = 0; i < over.covered.size(); ++i)
        if (over.covered[i]) picture.linear[i] = over.linear[i];
    }
    paste_square(picture, k * side_px, out);
  }
  for (std::uint32_t k = 0; k < layouts; ++k) paste_layout(model.textures[k], (2 + k) * side_px, out);
  if (model.legend.coloured) paste_bar(out);
  return write_png(out);
}

}  // namespace texmesh
