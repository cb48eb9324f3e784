// Images, textures and materials are checked first, then the primitives of every mesh, then the nodes that
// place them. A fault is a finding and ends the element that it is found in.
#include "stages/gltf/check_glb.h"

#include <draco/compression/decode.h>
#include <nlohmann/json.hpp>

#include <tuple>

#include "format/container/layout.h"
#include "stages/gltf/glb_document.h"
#include "stages/image/avif.h"
#include "stages/jpeg/jpeg.h"

namespace texmesh {
namespace {

using Json = GlbDocument::Json;

/// What one primitive's data looks like after decoding.
struct GlbPrimitive {
  std::uint64_t triangles = 0, vertices = 0;
  Box3d box;
  std::vector<Vec3d> positions;
  void add(Vec3d p) {
    box.extend(p);
    positions.push_back(p);
  }
};

class PrimitiveChecker {
 public:
  explicit PrimitiveChecker(GlbDocument& document) : d_(document) {}

  /// Decodes the primitive `json` at `place` and checks its accessors, indices and positions.
  GlbPrimitive check(const Json& json, const std::string& place) {
    if (d_.number(json, "mode", 4, place) != 4)
      d_.fail("glb-reference", place + "/mode", "4, triangles", json["mode"].dump());
    if (json.contains("material"))
      d_.index(json, "material", d_.array(d_.root(), "materials", "").size(), place);
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
    GlbPrimitive p{indices.count / 3, position.count, {}, {}};
    const auto extensions = json.find("extensions");
    const bool draco = extensions != json.end() && extensions->is_object() &&
                       extensions->contains("KHR_draco_mesh_compression");
    if (draco) {
      check_draco((*extensions)["KHR_draco_mesh_compression"], *attributes, p, place);
    } else {
      check_indices(indices, position.count, place);
      for (std::size_t v = 0; v < different(position); ++v)
        p.add({finite(position, v, 0, place), finite(position, v, 1, place), finite(position, v, 2, place)});
    }
    check_stated_box(d_.root()["accessors"][(*attributes)["POSITION"].get<std::size_t>()], p.box,
                     place + "/attributes/POSITION");
    return p;
  }

 private:
  const GlbDocument::Accessor& accessor(const Json& object, const char* key, const std::string& place) {
    const auto& a = d_.accessors()[d_.index(object, key, d_.accessors().size(), place)];
    if (!a.ok) throw GlbDocument::Broken{};  // it has its finding
    return a;
  }

  /// Of elements that no byte stands for, which may be four billion, one says what all are.
  static std::size_t different(const GlbDocument::Accessor& a) {
    return a.view < 0 ? std::min<std::size_t>(a.count, 1) : a.count;
  }

  double finite(const GlbDocument::Accessor& a, std::size_t i, std::size_t c, const std::string& place) {
    const double v = d_.value(a, i, c);
    if (!std::isfinite(v))
      d_.fail("glb-position", place + "/attributes/POSITION", "finite positions",
              "element " + std::to_string(i));
    return v;
  }

  void check_indices(const GlbDocument::Accessor& indices, std::size_t vertices, const std::string& place) {
    for (std::size_t i = 0; i < different(indices); ++i) {
      const double v = d_.value(indices, i, 0);
      if (v >= static_cast<double>(vertices))
        d_.fail("glb-index", place + "/indices", "indices below " + std::to_string(vertices),
                std::to_string(static_cast<std::uint64_t>(v)) + " at " + std::to_string(i));
    }
  }

  void check_draco(const Json& extension, const Json& attributes, GlbPrimitive& p, const std::string& place) {
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

  void add_draco_positions(const draco::Mesh& mesh, const draco::PointAttribute& a, GlbPrimitive& out,
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
  void check_stated_box(const Json& accessor_json, const Box3d& box, const std::string& place) {
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

  GlbDocument& d_;
};

using Matrix = std::array<double, 16>;  // column-major, as glTF

Matrix product_of(const Matrix& a, const Matrix& b) {
  Matrix product{};
  for (std::size_t c = 0; c < 4; ++c)
    for (std::size_t r = 0; r < 4; ++r)
      for (std::size_t k = 0; k < 4; ++k) product[c * 4 + r] += a[k * 4 + r] * b[c * 4 + k];
  return product;
}

Vec3d transformed(const Matrix& m, const Vec3d& p) {
  return {m[0] * p.x + m[4] * p.y + m[8] * p.z + m[12], m[1] * p.x + m[5] * p.y + m[9] * p.z + m[13],
          m[2] * p.x + m[6] * p.y + m[10] * p.z + m[14]};
}

/// The numbers under `key`, `fallback` when absent.
std::vector<double> numbers(GlbDocument& d, const Json& node, const char* key, std::vector<double> fallback,
                            const std::string& place) {
  const auto it = node.find(key);
  if (it == node.end()) return fallback;
  std::vector<double> v;
  if (it->is_array())
    for (const Json& x : *it)
      v.push_back(x.is_number() ? x.get<double>() : std::numeric_limits<double>::infinity());
  if (v.size() != fallback.size() ||
      !std::all_of(v.begin(), v.end(), [](double x) { return std::isfinite(x); }))
    d.fail("glb-node", place + "/" + key, std::to_string(fallback.size()) + " numbers",
           it->dump().substr(0, 80));
  return v;
}

Matrix local_matrix(GlbDocument& d, const Json& node, const std::string& place) {
  Matrix m{};
  if (node.contains("matrix")) {
    const auto v = numbers(d, node, "matrix", std::vector<double>(16), place);
    std::copy(v.begin(), v.end(), m.begin());
    return m;
  }
  const auto t = numbers(d, node, "translation", {0, 0, 0}, place),
             s = numbers(d, node, "scale", {1, 1, 1}, place),
             q = numbers(d, node, "rotation", {0, 0, 0, 1}, place);
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

/// Checks the tree of nodes and the scenes, and sets the positions and bounds of the facts.
/// `mesh_positions`: per mesh those of all its primitives.
class NodeChecker {
 public:
  NodeChecker(GlbDocument& document, const std::vector<std::vector<Vec3d>>& mesh_positions)
      : d_(document), mesh_positions_(mesh_positions), nodes_(document.array(document.root(), "nodes", "")) {}

  void run(GlbFacts& facts) {
    find_parents();
    check_scenes();
    collect_positions(facts);
  }

 private:
  void find_parents() {
    parent_.assign(nodes_.size(), -1);
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      const std::string place = GlbDocument::element("nodes", i);
      if (nodes_[i].contains("mesh")) d_.index(nodes_[i], "mesh", mesh_positions_.size(), place);
      const Json& children = d_.array(nodes_[i], "children", place);
      for (std::size_t k = 0; k < children.size(); ++k) {
        const std::uint64_t c =
            children[k].is_number_unsigned() ? children[k].get<std::uint64_t>() : nodes_.size();
        if (c >= nodes_.size())
          d_.fail("glb-reference", place + "/children/" + std::to_string(k), "a node", children[k].dump());
        if (parent_[c] >= 0 || c == i)
          d_.fail("glb-node", GlbDocument::element("nodes", c), "one parent", "two");
        parent_[c] = static_cast<std::int64_t>(i);
      }
    }
  }

  void check_scenes() {
    const Json& scenes = d_.array(d_.root(), "scenes", "");
    d_.index(d_.root(), "scene", scenes.size(), "");
    for (std::size_t i = 0; i < scenes.size(); ++i)
      for (const Json& root : d_.array(scenes[i], "nodes", GlbDocument::element("scenes", i))) {
        const std::uint64_t n = root.is_number_unsigned() ? root.get<std::uint64_t>() : nodes_.size();
        if (n >= nodes_.size() || parent_[n] >= 0)
          d_.fail("glb-node", GlbDocument::element("scenes", i) + "/nodes", "root nodes", root.dump());
      }
  }

  void collect_positions(GlbFacts& facts) {
    std::vector<Vec3d>& all = facts.positions;
    Box3d box;
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      const Matrix m = world_matrix(i);
      if (!nodes_[i].contains("mesh")) continue;
      for (const Vec3d& p : mesh_positions_[nodes_[i]["mesh"].get<std::size_t>()]) {
        all.push_back(transformed(m, p));
        box.extend(all.back());
      }
    }
    const auto tuple_of = [](const Vec3d& p) { return std::tie(p.x, p.y, p.z); };
    std::sort(all.begin(), all.end(),
              [&](const Vec3d& p, const Vec3d& q) { return tuple_of(p) < tuple_of(q); });
    all.erase(std::unique(all.begin(), all.end()), all.end());
    facts.has_bounds = !box.empty();
    if (!box.empty()) facts.bounds_min = box.min, facts.bounds_max = box.max;
  }

  Matrix world_matrix(std::size_t i) {
    const auto local = [&](std::size_t node) {
      return local_matrix(d_, nodes_[node], GlbDocument::element("nodes", node));
    };
    Matrix m = local(i);
    std::size_t steps = 0;
    for (std::int64_t p = parent_[i]; p >= 0; p = parent_[static_cast<std::size_t>(p)]) {
      if (++steps > nodes_.size()) d_.fail("glb-node", GlbDocument::element("nodes", i), "a tree", "a cycle");
      m = product_of(local(static_cast<std::size_t>(p)), m);
    }
    return m;
  }

  GlbDocument& d_;
  const std::vector<std::vector<Vec3d>>& mesh_positions_;
  const Json& nodes_;
  std::vector<std::int64_t> parent_;  // per node, -1 for a root
};

constexpr std::uint64_t kMaxPreviewPixels = 1ull << 26;

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

/// The path of a preview from the folder of the meshes, or that of an image beside a GLB for viewers.
bool is_package_uri(const Json& uri, const std::string& entry) {
  constexpr std::string_view kUp = "../";
  if (!uri.is_string()) return false;
  const std::string& text = uri.get_ref<const std::string&>();
  if (text.starts_with(kUp)) return parse_entry_path(text.substr(kUp.size())).kind == EntryKind::kPreview;
  return parse_entry_path(entry).kind == EntryKind::kGltfScale &&
         parse_entry_path("gltf/" + text).kind == EntryKind::kGltfImage;
}

/// Decodes image `i` and adds its name to `facts`.
void check_glb_image(GlbDocument& d, std::size_t i, GlbFacts& facts) {
  const Json& json = d.root()["images"][i];
  const std::string place = GlbDocument::element("images", i);
  facts.image_names.push_back(json.value("name", std::string()));
  facts.image_uris.emplace_back();
  facts.image_digests.emplace_back();
  if (!d.standalone() && json.contains("uri")) {
    const bool named = is_package_uri(json["uri"], d.entry()) && !json.contains("bufferView");
    if (!named || json.value("mimeType", std::string()) != "image/jpeg")
      d.fail({"glb-image", "G06"}, place + "/uri", "a preview as image/jpeg, ../preview/PPP.jpg",
             json["uri"].dump().substr(0, 80));
    facts.image_uris.back() = json["uri"].get<std::string>();
    return;
  }
  const auto& view = d.views()[d.index(json, "bufferView", d.views().size(), place)];
  if (!view.ok) return;
  const std::vector<std::uint8_t> bytes(view.data.begin(), view.data.end());
  facts.image_digests.back() = sha256(bytes);
  const std::string type = json.value("mimeType", std::string());
  const auto shown = sniff_image_format(bytes);
  const bool jpeg = shown == ImageFormat::kJpeg, png = shown == ImageFormat::kPng;
  const bool webp = d.standalone() && shown == ImageFormat::kWebp, avif = d.standalone() && is_avif(bytes);
  if (!(jpeg && type == "image/jpeg") && !(png && type == "image/png") && !(webp && type == "image/webp") &&
      !(avif && type == "image/avif"))
    d.fail("glb-image", place + "/mimeType", jpeg ? "image/jpeg" : png ? "image/png" : "a JPEG or PNG", type);
  const ImageLimits limits{16384, kMaxPreviewPixels};
  if (avif) {
    const AvifPicture picture = decode_avif(place, bytes, limits);
    facts.largest_image_px = std::max({facts.largest_image_px, picture.width_px, picture.height_px});
    return;
  }
  const Pixels pixels =
      jpeg ? decode_jpeg(bytes, kMaxPreviewPixels) : decode_image(probe_image(place, bytes, limits));
  facts.largest_image_px = std::max({facts.largest_image_px, pixels.width_px, pixels.height_px});
}

void check_glb_texture(GlbDocument& d, std::size_t i) {
  const Json& json = d.root()["textures"][i];
  const std::string place = GlbDocument::element("textures", i);
  const std::size_t images = d.array(d.root(), "images", "").size();
  const auto has = [&](const char* name) {
    return d.standalone() && json.contains("extensions") && json["extensions"].contains(name);
  };
  const char* extension = has("EXT_texture_webp")   ? "EXT_texture_webp"
                          : has("EXT_texture_avif") ? "EXT_texture_avif"
                                                    : nullptr;
  if (extension)
    d.index(json["extensions"][extension], "source", images, place + "/extensions/" + extension);
  else
    d.index(json, "source", images, place);
  if (json.contains("sampler")) d.index(json, "sampler", d.array(d.root(), "samplers", "").size(), place);
}

void check_glb_material(GlbDocument& d, std::size_t i) {
  check_texture_infos(d, d.root()["materials"][i], d.array(d.root(), "textures", "").size(),
                      GlbDocument::element("materials", i));
}

/// Runs body(i) for every element of the array `key`; a fault is a finding and ends that element only.
void for_each_element(GlbDocument& d, const char* key, const char* check, auto&& body) {
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
      const GlbPrimitive p = PrimitiveChecker(d).check(primitives[k], at);
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
  d.guarded("glb-node", "/nodes", [&] { NodeChecker(d, positions).run(facts); });
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
