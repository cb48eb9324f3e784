#include "stages/gltf/check_glb.h"

#include <draco/compression/decode.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>

#include "stages/gltf/glb_document.h"
#include "stages/image/decode_image.h"
#include "stages/jpeg/jpeg.h"

namespace texmesh {
namespace {

using Json = GlbDocument::Json;
using Matrix = std::array<double, 16>;  // column-major, as glTF

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr std::uint64_t kMaxPreviewPixels = 1ull << 26;

struct Box {
  Vec3d min{kInfinity, kInfinity, kInfinity}, max{-kInfinity, -kInfinity, -kInfinity};
  void add(Vec3d p) {
    for (int k = 0; k < 3; ++k) {
      min[k] = std::min(min[k], p[k]);
      max[k] = std::max(max[k], p[k]);
    }
  }
  bool empty() const { return !(min.x <= max.x); }
};

std::string indexed(const char* array, std::size_t i) {
  return std::string("/") + array + "/" + std::to_string(i);
}

/// Checks that every "index" of a texture info of `object` (recursively: materials hold them at several
/// depths) is in range.
void check_texture_infos(GlbDocument& d, const Json& object, std::size_t textures, const std::string& place) {
  if (!object.is_object()) return;
  for (const auto& [key, value] : object.items()) {
    if (!value.is_object()) continue;
    if (key.size() > 7 && key.ends_with("Texture")) d.index(value, "index", textures, place + "/" + key);
    check_texture_infos(d, value, textures, place + "/" + key);
  }
}

/// What one primitive's data looks like after decoding.
struct Primitive {
  std::uint64_t triangles = 0, vertices = 0;
  Box box;
  std::vector<Vec3d> positions;
  void add(Vec3d p) {
    box.add(p);
    positions.push_back(p);
  }
};

class GlbChecker {
 public:
  GlbChecker(GlbDocument& document, GlbFacts& facts) : d_(document), facts_(facts) {}

  void run() {
    each("images", "glb-image", [&](std::size_t i, const Json& j) { check_image(i, j); });
    each("textures", "glb-reference", [&](std::size_t i, const Json& j) { check_texture(i, j); });
    each("materials", "glb-reference", [&](std::size_t i, const Json& j) {
      check_texture_infos(d_, j, count_of("textures"), indexed("materials", i));
    });
    mesh_positions_.resize(count_of("meshes"));
    each("meshes", "glb-decode", [&](std::size_t i, const Json& j) { check_mesh(i, j); });
    d_.guarded("glb-node", "/nodes", [&] { check_nodes(); });
    if (d_.uses_extension("KHR_draco_mesh_compression"))
      facts_.codec = "draco";
    else if (d_.uses_extension("EXT_meshopt_compression"))
      facts_.codec = "meshopt";
    else if (d_.uses_extension("KHR_mesh_quantization"))
      facts_.codec = "quantized";
  }

 private:
  std::size_t count_of(const char* key) { return d_.array(d_.root(), key, "").size(); }

  template <class F>
  void each(const char* key, const char* check, F&& body) {
    d_.guarded(check, std::string("/") + key, [&] {
      const Json& list = d_.array(d_.root(), key, "");
      for (std::size_t i = 0; i < list.size(); ++i)
        d_.guarded(check, indexed(key, i), [&] { body(i, list[i]); });
    });
  }

  void check_image(std::size_t i, const Json& json) {
    const std::string place = indexed("images", i);
    facts_.image_names.push_back(json.value("name", std::string()));
    const auto& view = d_.views()[d_.index(json, "bufferView", d_.views().size(), place)];
    if (!view.ok) return;
    const std::vector<std::uint8_t> bytes(view.data.begin(), view.data.end());
    const std::string type = json.value("mimeType", std::string());
    const auto shown = sniff_image_format(bytes);
    const bool jpeg = shown == ImageFormat::kJpeg, png = shown == ImageFormat::kPng;
    const bool webp = d_.standalone() && shown == ImageFormat::kWebp;
    if (!(jpeg && type == "image/jpeg") && !(png && type == "image/png") && !(webp && type == "image/webp"))
      d_.fail("glb-image", place + "/mimeType",
              jpeg  ? "image/jpeg"
              : png ? "image/png"
                    : "a JPEG or PNG",
              type);
    if (jpeg)
      decode_jpeg(bytes, kMaxPreviewPixels);
    else
      decode_image(probe_image(place, bytes, {16384, kMaxPreviewPixels}));
  }

  void check_texture(std::size_t i, const Json& json) {
    const std::string place = indexed("textures", i);
    if (d_.standalone() && json.contains("extensions") && json["extensions"].contains("EXT_texture_webp"))
      d_.index(json["extensions"]["EXT_texture_webp"], "source", count_of("images"),
               place + "/extensions/EXT_texture_webp");
    else
      d_.index(json, "source", count_of("images"), place);
    if (json.contains("sampler")) d_.index(json, "sampler", count_of("samplers"), place);
  }

  void check_mesh(std::size_t i, const Json& json) {
    const std::string place = indexed("meshes", i);
    const Json& primitives = d_.array(json, "primitives", place);
    if (primitives.empty()) d_.fail("glb-reference", place + "/primitives", "at least one", "none");
    for (std::size_t k = 0; k < primitives.size(); ++k) {
      const std::string at = place + "/primitives/" + std::to_string(k);
      d_.guarded("glb-decode", at, [&] {
        const Primitive p = check_primitive(primitives[k], at);
        ++facts_.primitives;
        facts_.triangles += p.triangles;
        facts_.vertices += p.vertices;
        mesh_positions_[i].insert(mesh_positions_[i].end(), p.positions.begin(), p.positions.end());
      });
    }
  }

  Primitive check_primitive(const Json& json, const std::string& place) {
    if (d_.number(json, "mode", 4, place) != 4)
      d_.fail("glb-reference", place + "/mode", "4, triangles", json["mode"].dump());
    if (json.contains("material")) d_.index(json, "material", count_of("materials"), place);
    const auto attributes = json.find("attributes");
    if (attributes == json.end() || !attributes->is_object() || !attributes->contains("POSITION"))
      d_.fail("glb-reference", place + "/attributes/POSITION", "an accessor", "nothing");
    const auto& position = accessor(*attributes, "POSITION", place + "/attributes");
    if (position.components != 3)
      d_.fail("glb-accessor", place + "/attributes/POSITION", "VEC3", "another type");
    for (const auto& [name, value] : attributes->items()) {
      const auto& a = accessor(*attributes, name.c_str(), place + "/attributes");
      if (a.count != position.count)
        d_.fail("glb-accessor", place + "/attributes/" + name,
                std::to_string(position.count) + " elements, as POSITION", std::to_string(a.count));
    }
    const auto& indices = accessor(json, "indices", place);
    if (indices.components != 1 || indices.count % 3 != 0 || indices.component_type == 5126)
      d_.fail("glb-accessor", place + "/indices", "a multiple of 3 integers", std::to_string(indices.count));
    Primitive p{indices.count / 3, position.count, {}, {}};
    const auto extensions = json.find("extensions");
    const bool draco = extensions != json.end() && extensions->is_object() &&
                       extensions->contains("KHR_draco_mesh_compression");
    if (draco) {
      check_draco((*extensions)["KHR_draco_mesh_compression"], *attributes, p, place);
    } else {
      check_indices(indices, position.count, place);
      for (std::size_t v = 0; v < position.count; ++v)
        p.add({finite(position, v, 0, place), finite(position, v, 1, place), finite(position, v, 2, place)});
    }
    check_stated_box(d_.root()["accessors"][(*attributes)["POSITION"].get<std::size_t>()], p.box,
                     place + "/attributes/POSITION");
    return p;
  }

  const GlbDocument::Accessor& accessor(const Json& object, const char* key, const std::string& place) {
    const auto& a = d_.accessors()[d_.index(object, key, d_.accessors().size(), place)];
    if (!a.ok) throw GlbDocument::Broken{};  // it has its finding
    return a;
  }

  double finite(const GlbDocument::Accessor& a, std::size_t i, std::size_t c, const std::string& place) {
    const double v = d_.value(a, i, c);
    if (!std::isfinite(v))
      d_.fail("glb-position", place + "/attributes/POSITION", "finite positions",
              "element " + std::to_string(i));
    return v;
  }

  void check_indices(const GlbDocument::Accessor& indices, std::size_t vertices, const std::string& place) {
    for (std::size_t i = 0; i < indices.count; ++i) {
      const double v = d_.value(indices, i, 0);
      if (v >= static_cast<double>(vertices))
        d_.fail("glb-index", place + "/indices", "indices below " + std::to_string(vertices),
                std::to_string(static_cast<std::uint64_t>(v)) + " at " + std::to_string(i));
    }
  }

  void check_draco(const Json& extension, const Json& attributes, Primitive& p, const std::string& place) {
    const std::string at = place + "/extensions/KHR_draco_mesh_compression";
    const auto& view = d_.views()[d_.index(extension, "bufferView", d_.views().size(), at)];
    if (!view.ok) throw GlbDocument::Broken{};
    draco::DecoderBuffer buffer;
    buffer.Init(reinterpret_cast<const char*>(view.data.data()), view.data.size());
    auto decoded = draco::Decoder().DecodeMeshFromBuffer(&buffer);
    if (!decoded.ok()) d_.fail("glb-decode", at, "a Draco mesh", decoded.status().error_msg_string());
    const draco::Mesh& mesh = *decoded.value();
    if (mesh.num_faces() != p.triangles)
      d_.fail("glb-decode", place + "/indices", std::to_string(mesh.num_faces()) + " triangles, as decoded",
              std::to_string(p.triangles));
    if (mesh.num_points() != p.vertices)
      d_.fail("glb-decode", place + "/attributes/POSITION",
              std::to_string(mesh.num_points()) + " vertices, as decoded", std::to_string(p.vertices));
    for (draco::FaceIndex f(0); f < mesh.num_faces(); ++f)
      for (const draco::PointIndex& corner : mesh.face(f))
        if (corner.value() >= mesh.num_points())
          d_.fail("glb-index", at, "indices below " + std::to_string(mesh.num_points()),
                  std::to_string(corner.value()));
    const auto ids = extension.find("attributes");
    for (const auto& [name, value] : attributes.items()) {
      if (ids == extension.end() || !ids->is_object() || !ids->contains(name))
        continue;  // stored without Draco
      const auto id = static_cast<std::uint32_t>(d_.number(*ids, name.c_str(), 0, at + "/attributes"));
      const draco::PointAttribute* a = mesh.GetAttributeByUniqueId(id);
      const auto& stated = accessor(attributes, name.c_str(), place + "/attributes");
      if (!a || static_cast<std::size_t>(a->num_components()) != stated.components)
        d_.fail("glb-decode", at + "/attributes/" + name,
                std::to_string(stated.components) + " components in attribute " + std::to_string(id),
                a ? std::to_string(a->num_components()) : "no such attribute");
      if (name == "POSITION") add_draco_positions(mesh, *a, p, at);
    }
    if (p.box.empty())
      d_.fail("glb-decode", at + "/attributes/POSITION", "positions in the Draco data", "none");
  }

  void add_draco_positions(const draco::Mesh& mesh, const draco::PointAttribute& a, Primitive& out,
                           const std::string& at) {
    for (draco::PointIndex i(0); i < mesh.num_points(); ++i) {
      std::array<float, 3> v{};
      const bool read = a.ConvertValue<float>(a.mapped_index(i), 3, v.data());
      if (!read || !std::isfinite(v[0]) || !std::isfinite(v[1]) || !std::isfinite(v[2]))
        d_.fail("glb-position", at + "/attributes/POSITION", "finite positions",
                "point " + std::to_string(i.value()));
      out.add({v[0], v[1], v[2]});
    }
  }

  /// glTF requires min and max of POSITION; viewers place their camera by them.
  void check_stated_box(const Json& accessor_json, const Box& box, const std::string& place) {
    const double slack = 1e-5 * length(box.max - box.min) + 1e-30;
    for (const char* key : {"min", "max"}) {
      const auto it = accessor_json.find(key);
      if (it == accessor_json.end() || !it->is_array() || it->size() != 3 ||
          !std::all_of(it->begin(), it->end(), [](const Json& x) { return x.is_number(); }))
        d_.fail("glb-accessor", place + "/" + key, "three numbers",
                it == accessor_json.end() ? "nothing" : it->dump().substr(0, 80));
      const Vec3d& real = key[1] == 'i' ? box.min : box.max;
      for (int k = 0; k < 3; ++k)
        if (!(std::fabs((*it)[static_cast<std::size_t>(k)].get<double>() - real[k]) <= slack))
          d_.fail("glb-position", place + "/" + key, Json{real.x, real.y, real.z}.dump(),
                  it->dump().substr(0, 120));
    }
  }

  void check_nodes() {
    const Json& nodes = d_.array(d_.root(), "nodes", "");
    std::vector<std::int64_t> parent(nodes.size(), -1);
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const std::string place = indexed("nodes", i);
      if (nodes[i].contains("mesh")) d_.index(nodes[i], "mesh", mesh_positions_.size(), place);
      const Json& children = d_.array(nodes[i], "children", place);
      for (std::size_t k = 0; k < children.size(); ++k) {
        const std::uint64_t c =
            children[k].is_number_unsigned() ? children[k].get<std::uint64_t>() : nodes.size();
        if (c >= nodes.size())
          d_.fail("glb-reference", place + "/children/" + std::to_string(k), "a node", children[k].dump());
        if (parent[c] >= 0 || c == i) d_.fail("glb-node", indexed("nodes", c), "one parent", "two");
        parent[c] = static_cast<std::int64_t>(i);
      }
    }
    check_scenes(nodes.size(), parent);
    std::vector<Vec3d>& all = facts_.positions;
    Box box;
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const Matrix m = world_matrix(nodes, parent, i);
      if (!nodes[i].contains("mesh")) continue;
      for (const Vec3d& p : mesh_positions_[nodes[i]["mesh"].get<std::size_t>()]) {
        all.push_back(transformed(m, p));
        box.add(all.back());
      }
    }
    const auto tuple_of = [](const Vec3d& p) { return std::tie(p.x, p.y, p.z); };
    std::sort(all.begin(), all.end(),
              [&](const Vec3d& p, const Vec3d& q) { return tuple_of(p) < tuple_of(q); });
    all.erase(std::unique(all.begin(), all.end()), all.end());
    facts_.has_bounds = !box.empty();
    if (!box.empty()) facts_.bounds_min = box.min, facts_.bounds_max = box.max;
  }

  void check_scenes(std::size_t nodes, const std::vector<std::int64_t>& parent) {
    const Json& scenes = d_.array(d_.root(), "scenes", "");
    d_.index(d_.root(), "scene", scenes.size(), "");
    for (std::size_t i = 0; i < scenes.size(); ++i)
      for (const Json& root : d_.array(scenes[i], "nodes", indexed("scenes", i))) {
        const std::uint64_t n = root.is_number_unsigned() ? root.get<std::uint64_t>() : nodes;
        if (n >= nodes || parent[n] >= 0)
          d_.fail("glb-node", indexed("scenes", i) + "/nodes", "root nodes", root.dump());
      }
  }

  Matrix local_matrix(const Json& node, const std::string& place) {
    const auto numbers = [&](const char* key, std::vector<double> fallback) {
      const auto it = node.find(key);
      if (it == node.end()) return fallback;
      std::vector<double> v;
      if (it->is_array())
        for (const Json& x : *it) v.push_back(x.is_number() ? x.get<double>() : kInfinity);
      if (v.size() != fallback.size() ||
          !std::all_of(v.begin(), v.end(), [](double x) { return std::isfinite(x); }))
        d_.fail("glb-node", place + "/" + key, std::to_string(fallback.size()) + " numbers",
                it->dump().substr(0, 80));
      return v;
    };
    Matrix m{};
    if (node.contains("matrix")) {
      const auto v = numbers("matrix", std::vector<double>(16));
      std::copy(v.begin(), v.end(), m.begin());
      return m;
    }
    const auto t = numbers("translation", {0, 0, 0}), s = numbers("scale", {1, 1, 1}),
               q = numbers("rotation", {0, 0, 0, 1});
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    const std::array<double, 9> r{1 - 2 * (y * y + z * z), 2 * (x * y + z * w),     2 * (x * z - y * w),
                                  2 * (x * y - z * w),     1 - 2 * (x * x + z * z), 2 * (y * z + x * w),
                                  2 * (x * z + y * w),     2 * (y * z - x * w),     1 - 2 * (x * x + y * y)};
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t k = 0; k < 3; ++k) m[c * 4 + k] = r[c * 3 + k] * s[c];
      m[12 + c] = t[c];
    }
    m[15] = 1;
    return m;
  }

  Matrix world_matrix(const Json& nodes, const std::vector<std::int64_t>& parent, std::size_t i) {
    Matrix m = local_matrix(nodes[i], indexed("nodes", i));
    std::size_t steps = 0;
    for (std::int64_t p = parent[i]; p >= 0; p = parent[static_cast<std::size_t>(p)]) {
      if (++steps > nodes.size()) d_.fail("glb-node", indexed("nodes", i), "a tree", "a cycle");
      const Matrix up =
          local_matrix(nodes[static_cast<std::size_t>(p)], indexed("nodes", static_cast<std::size_t>(p)));
      Matrix product{};
      for (std::size_t c = 0; c < 4; ++c)
        for (std::size_t r = 0; r < 4; ++r)
          for (std::size_t k = 0; k < 4; ++k) product[c * 4 + r] += up[k * 4 + r] * m[c * 4 + k];
      m = product;
    }
    return m;
  }

  static Vec3d transformed(const Matrix& m, const Vec3d& p) {
    return {m[0] * p.x + m[4] * p.y + m[8] * p.z + m[12], m[1] * p.x + m[5] * p.y + m[9] * p.z + m[13],
            m[2] * p.x + m[6] * p.y + m[10] * p.z + m[14]};
  }

  GlbDocument& d_;
  GlbFacts& facts_;
  std::vector<std::vector<Vec3d>> mesh_positions_;  // per mesh, all primitives
};

}  // namespace

GlbFacts check_glb(std::span<const std::uint8_t> bytes, const std::string& entry, Findings& findings,
                   GlbRules rules) {
  GlbFacts facts;
  GlbDocument document(bytes, entry, findings, rules == GlbRules::kStandalone);
  if (!document.load()) return facts;
  document.guarded("glb-json", "", [&] { GlbChecker(document, facts).run(); });
  return facts;
}

}  // namespace texmesh
