#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "examples/scan_model.h"
#include "format/base/bytes.h"
#include "format/base/text_bytes.h"
#include "format/base/vec.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;
template <class T>
void append(Bytes& out, const std::vector<T>& values) {
  const std::size_t at = out.size();
  out.resize(at + values.size() * sizeof(T));
  if (!values.empty()) std::memcpy(out.data() + at, values.data(), values.size() * sizeof(T));
}
void append(Bytes& out, const std::string& text) { out.insert(out.end(), text.begin(), text.end()); }

void write_file(const std::string& path, std::span<const std::uint8_t> bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file) throw InputError(path, "", "a file that can be written", "an error of the file system");
}

std::string stem_of(const std::string& path) { return std::filesystem::path(path).stem().string(); }
std::string beside(const std::string& path, const std::string& name) {
  return (std::filesystem::path(path).parent_path() / name).string();
}
// scan.jpg for the base colour, scan_normal.jpg for others.
std::string image_name(const std::string& path, const Image& image) {
  return stem_of(path) + (image.name == "base_colour" ? "" : "_" + image.name) + ".jpg";
}

struct GlbBuilder {
  Json json;
  Bytes bin;

  int view(const Bytes& bytes, int target) {
    bin.resize((bin.size() + 3) / 4 * 4);
    Json v{{"buffer", 0}, {"byteOffset", bin.size()}, {"byteLength", bytes.size()}};
    if (target) v["target"] = target;
    bin.insert(bin.end(), bytes.begin(), bytes.end());
    json["bufferViews"].push_back(v);
    return static_cast<int>(json["bufferViews"].size()) - 1;
  }
  template <class T>
  int accessor(const std::vector<T>& values, int component_type, const char* type, int target) {
    Bytes bytes;
    append(bytes, values);
    json["accessors"].push_back(Json{{"bufferView", view(bytes, target)},
                                     {"componentType", component_type},
                                     {"count", values.size()},
                                     {"type", type}});
    return static_cast<int>(json["accessors"].size()) - 1;
  }
  Bytes finish() {
    bin.resize((bin.size() + 3) / 4 * 4);
    json["buffers"] = Json::array({Json{{"byteLength", bin.size()}}});
    std::string text = json.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    Bytes out;
    auto word = [&out](std::size_t value) {
      append(out, std::vector<std::uint32_t>{static_cast<std::uint32_t>(value)});
    };
    word(0x46546c67), word(2), word(12 + 8 + text.size() + 8 + bin.size());
    word(text.size()), word(0x4e4f534a), append(out, text);
    word(bin.size()), word(0x004e4942), append(out, bin);
    return out;
  }
};

constexpr int kFloat = 5126, kUnsigned = 5125, kVertices = 34962, kIndices = 34963;

Json primitive_of(GlbBuilder& glb, const Mesh& mesh) {
  std::vector<Vec3f> positions;
  for (std::uint32_t p : mesh.wedge_position) positions.push_back(mesh.positions[p]);
  Json attributes;
  const int at = glb.accessor(positions, kFloat, "VEC3", kVertices);
  const auto [lo, hi] = bounding_box(positions);
  glb.json["accessors"][static_cast<std::size_t>(at)]["min"] = {lo.x, lo.y, lo.z};
  glb.json["accessors"][static_cast<std::size_t>(at)]["max"] = {hi.x, hi.y, hi.z};
  attributes["POSITION"] = at;
  attributes["NORMAL"] = glb.accessor(mesh.normals, kFloat, "VEC3", kVertices);
  if (!mesh.uv0.empty()) attributes["TEXCOORD_0"] = glb.accessor(mesh.uv0, kFloat, "VEC2", kVertices);
  if (!mesh.colours.empty()) attributes["COLOR_0"] = glb.accessor(mesh.colours, kFloat, "VEC4", kVertices);
  std::vector<std::uint32_t> indices;
  for (const Triangle& t : mesh.triangles) indices.insert(indices.end(), t.begin(), t.end());
  return Json{{"attributes", attributes},
              {"indices", glb.accessor(indices, kUnsigned, "SCALAR", kIndices)},
              {"material", 0}};
}

Json material_of(const Material& m) {
  Json pbr{{"metallicFactor", m.metallic}, {"roughnessFactor", m.roughness}};
  auto texture = [](const TextureRef& ref) { return Json{{"index", ref.image}}; };
  if (m.base_colour_texture.used()) pbr["baseColorTexture"] = texture(m.base_colour_texture);
  if (m.metallic_roughness_texture.used())
    pbr["metallicRoughnessTexture"] = texture(m.metallic_roughness_texture);
  Json out{{"name", m.name}, {"pbrMetallicRoughness", pbr}};
  if (m.normal_texture.used()) out["normalTexture"] = texture(m.normal_texture);
  if (m.occlusion_texture.used()) out["occlusionTexture"] = texture(m.occlusion_texture);
  return out;
}

}  // namespace

void write_scan_glb(const Model& model, const std::string& path) {
  GlbBuilder glb;
  glb.json["asset"] = {{"version", "2.0"}, {"generator", "texmesh make_scan"}};
  glb.json["scene"] = 0;
  glb.json["scenes"] = Json::array({Json{{"nodes", {0}}}});
  glb.json["nodes"] = Json::array({Json{{"mesh", 0}, {"name", "scan"}}});
  glb.json["meshes"] = Json::array({Json{{"primitives", Json::array({primitive_of(glb, model.mesh)})}}});
  glb.json["materials"] = Json::array({material_of(model.materials[0])});
  for (std::size_t i = 0; i < model.images.size(); ++i) {
    const Image& image = model.images[i];
    glb.json["images"].push_back(
        Json{{"bufferView", glb.view(image.bytes, 0)}, {"mimeType", "image/jpeg"}, {"name", image.name}});
    glb.json["textures"].push_back(Json{{"source", i}});
  }
  write_file(path, glb.finish());
}

void write_scan_obj(const Model& model, const std::string& path) {
  const Mesh& mesh = model.mesh;
  const std::string stem = stem_of(path);
  std::string text = "mtllib " + stem + ".mtl\n";
  char line[128];
  for (Vec3f p : mesh.positions) {
    std::snprintf(line, sizeof line, "v %.7g %.7g %.7g\n", static_cast<double>(p.x), static_cast<double>(p.y),
                  static_cast<double>(p.z));
    text += line;
  }
  for (Vec2f t : mesh.uv0) {
    std::snprintf(line, sizeof line, "vt %.7g %.7g\n", static_cast<double>(t.x),
                  1 - static_cast<double>(t.y));
    text += line;
  }
  text += "usemtl surface\n";
  for (const Triangle& t : mesh.triangles) {
    text += 'f';
    for (std::uint32_t w : t) {
      text += ' ' + std::to_string(mesh.wedge_position[w] + 1);
      if (!mesh.uv0.empty()) text += '/' + std::to_string(w + 1);
    }
    text += '\n';
  }
  write_file(path, text_bytes(text));
  std::string mtl = "newmtl surface\nKd 1 1 1\nillum 1\n";
  for (const Image& image : model.images) {
    const char* key = image.name == "base_colour" ? "map_Kd" : image.name == "normal" ? "map_Bump" : "";
    if (*key) mtl += std::string(key) + " " + image_name(path, image) + "\n";
    write_file(beside(path, image_name(path, image)), image.bytes);
  }
  write_file(beside(path, stem + ".mtl"), text_bytes(mtl));
}

void write_scan_ply(const Model& model, const std::string& path) {
  const Mesh& mesh = model.mesh;
  const bool textured = !model.images.empty();
  std::string header = "ply\nformat binary_little_endian 1.0\n";
  if (textured) header += "comment TextureFile " + image_name(path, model.images[0]) + "\n";
  header += "element vertex " + std::to_string(mesh.positions.size()) +
            "\nproperty float x\nproperty float y\nproperty float z\n";
  if (!textured) header += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  header +=
      "element face " + std::to_string(mesh.triangles.size()) + "\nproperty list uchar uint vertex_indices\n";
  if (textured) header += "property list uchar float texcoord\n";
  Bytes out;
  append(out, header + "end_header\n");
  std::vector<std::uint32_t> any_wedge(mesh.positions.size(), 0);
  for (std::uint32_t w = 0; w < mesh.wedge_count(); ++w) any_wedge[mesh.wedge_position[w]] = w;
  for (std::size_t p = 0; p < mesh.positions.size(); ++p) {
    append(out, std::vector<float>{mesh.positions[p].x, mesh.positions[p].y, mesh.positions[p].z});
    if (textured) continue;
    const Vec4f c = mesh.colours[any_wedge[p]];
    // PLY colours are sRGB; a square root is the curve closely enough for a made object.
    for (float v : {c.x, c.y, c.z}) out.push_back(static_cast<std::uint8_t>(std::lround(255 * std::sqrt(v))));
  }
  for (const Triangle& t : mesh.triangles) {
    out.push_back(3);
    append(out, std::vector<std::uint32_t>{mesh.wedge_position[t[0]], mesh.wedge_position[t[1]],
                                           mesh.wedge_position[t[2]]});
    if (!textured) continue;
    out.push_back(6);
    for (std::uint32_t w : t) append(out, std::vector<float>{mesh.uv0[w].x, 1 - mesh.uv0[w].y});
  }
  write_file(path, out);
  if (textured) write_file(beside(path, image_name(path, model.images[0])), model.images[0].bytes);
}

void write_range_scan(const MadeRangeScan& scan, int jpeg_quality, const std::string& path) {
  const std::string stem = stem_of(path);
  const float largest = *std::max_element(scan.radius.begin(), scan.radius.end());
  const double scale = static_cast<double>(largest) / 65535;
  Bytes grid;
  append(grid, "P5\n" + std::to_string(scan.columns) + " " + std::to_string(scan.rows) + "\n65535\n");
  for (float r : scan.radius) {
    const auto value = static_cast<std::uint32_t>(std::lround(static_cast<double>(r) / scale));
    grid.push_back(static_cast<std::uint8_t>(value >> 8));
    grid.push_back(static_cast<std::uint8_t>(value & 255));
  }
  write_file(beside(path, stem + "_grid.pgm"), grid);
  write_file(beside(path, stem + ".jpg"), encode_scan_jpeg(scan.colour, jpeg_quality));
  const Json json{{"version", 1},
                  {"type", "cylindrical-range-scan"},
                  {"grid", stem + "_grid.pgm"},
                  {"radius_scale", scale},
                  {"y_top", scan.height / 2},
                  {"y_step", scan.height / (scan.rows - 1)},
                  {"texture", stem + ".jpg"}};
  write_file(path, text_bytes(json.dump(2) + "\n"));
}

}  // namespace texmesh
