// A glTF scene becomes one mesh: the nodes that show meshes, with their maps to the scene's space; every
// primitive read once; all of them put together in the order of the nodes.
#include <tiny_gltf.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <set>

#include "format/model/material_extensions.h"
#include "pipeline/about/gltf_about.h"
#include "pipeline/import/gltf/import_gltf_parts.h"
#include "pipeline/import/text_scan.h"
#include "stages/geometry/mesh_topology.h"

namespace texmesh {
namespace {

constexpr std::size_t kMaxParts = 65535;          // Mesh::triangle_part is 16 bits wide
constexpr std::size_t kMaxGltfMaterials = 65535;  // and so is triangle_material
constexpr const char* kVariants = "KHR_materials_variants";

/// Affine map, row-major 3 x 4, in double precision: georeferenced scenes place small meshes
/// with large translations.
struct Affine {
  std::array<double, 12> m{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  double at(int row, int column) const { return m[static_cast<std::size_t>(row * 4 + column)]; }
  double& at(int row, int column) { return m[static_cast<std::size_t>(row * 4 + column)]; }
};

Affine operator*(const Affine& a, const Affine& b) {
  Affine c;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 4; ++j) {
      c.at(i, j) = a.at(i, 0) * b.at(0, j) + a.at(i, 1) * b.at(1, j) + a.at(i, 2) * b.at(2, j) +
                   (j == 3 ? a.at(i, 3) : 0);
    }
  }
  return c;
}

Vec3d operator*(const Affine& a, Vec3d p) {
  Vec3d r;
  for (int i = 0; i < 3; ++i) r[i] = a.at(i, 0) * p.x + a.at(i, 1) * p.y + a.at(i, 2) * p.z + a.at(i, 3);
  return r;
}

/// The largest sum of a row: how far a map without its translation takes a coordinate of 1 at most.
double growth(const Affine& a) {
  double most = 0;
  for (int i = 0; i < 3; ++i)
    most = std::max(most, std::fabs(a.at(i, 0)) + std::fabs(a.at(i, 1)) + std::fabs(a.at(i, 2)));
  return most;
}

/// A node that shows a mesh, with its map to the scene's space.
struct Instance {
  std::size_t node = 0, mesh = 0;
  Affine to_scene;
  double rounding = 0;  // that of the translations on the way, as Mesh::rounding
};

Affine from_matrix(const Source& source, const std::vector<double>& v, const std::string& place) {
  Affine a;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 4; ++j) a.at(i, j) = v[static_cast<std::size_t>(j * 4 + i)];
  }
  if (v[3] != 0 || v[7] != 0 || v[11] != 0 || v[15] != 1) {
    source.note_once(Severity::kWarning, "projective-matrix", place,
                     "the last row of a matrix is taken as 0 0 0 1");
  }
  return a;
}

Affine from_rotation(const Source& source, const std::vector<double>& q, const std::string& place) {
  const double l = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(l > 0) || !std::isfinite(l)) {
    source.note_once(Severity::kWarning, "bad-rotation", place,
                     "a quaternion of no length is taken as no rotation");
    return {};
  }
  const double x = q[0] / l, y = q[1] / l, z = q[2] / l, w = q[3] / l;
  Affine a;
  a.m = {1 - 2 * (y * y + z * z), 2 * (x * y - z * w),     2 * (x * z + y * w),     0,
         2 * (x * y + z * w),     1 - 2 * (x * x + z * z), 2 * (y * z - x * w),     0,
         2 * (x * z - y * w),     2 * (y * z + x * w),     1 - 2 * (x * x + y * y), 0};
  return a;
}

Affine local_map(const Source& source, const tinygltf::Node& node, std::size_t index) {
  const std::string place = "/nodes/" + std::to_string(index);
  if (!node.matrix.empty()) return from_matrix(source, node.matrix, place + "/matrix");
  Affine a;
  if (!node.rotation.empty()) a = from_rotation(source, node.rotation, place + "/rotation");
  for (int i = 0; i < 3 && !node.scale.empty(); ++i) {
    for (int j = 0; j < 3; ++j) a.at(j, i) *= node.scale[static_cast<std::size_t>(i)];
  }
  for (int i = 0; i < 3 && !node.translation.empty(); ++i) {
    a.at(i, 3) = node.translation[static_cast<std::size_t>(i)];
  }
  return a;
}

constexpr std::size_t kMostInstances = 1'000'000;  // as many as nodes may be

/// The copies of a node's mesh that EXT_mesh_gpu_instancing asks for, as maps to the node's space; without it
/// the mesh itself. InputError where their attributes do not fit together.
std::vector<Affine> copies_of(const Source& source, const GltfJson& document, const tinygltf::Model& model,
                              Buffers& buffers, std::size_t n) {
  static const GltfJson::json_pointer at("/extensions/EXT_mesh_gpu_instancing/attributes");
  const GltfJson& node = document["nodes"][n];
  if (!node.contains(at)) return {Affine()};
  const std::string place = "/nodes/" + std::to_string(n) + at.to_string();
  struct Part {
    std::vector<double> tinygltf::Node::*member;
    AccessorReader values;
  };
  std::vector<Part> parts;
  for (const auto& [name, components, member] : {std::tuple{"TRANSLATION", 3, &tinygltf::Node::translation},
                                                 {"ROTATION", 4, &tinygltf::Node::rotation},
                                                 {"SCALE", 3, &tinygltf::Node::scale}}) {
    if (!node.contains(at / name)) continue;
    const AccessorReader values(source, model, buffers, node.at(at / name).get<std::size_t>());
    if (values.components() != components)
      source.fail(place + "/" + name, std::to_string(components) + " numbers for each copy",
                  std::to_string(values.components()));
    const std::size_t expected =
        parts.empty() ? std::min(values.count(), kMostInstances) : parts[0].values.count();
    if (values.count() != expected)
      source.fail(place + "/" + name,
                  (parts.empty() ? "at most " : "") + std::to_string(expected) + " copies",
                  std::to_string(values.count()));
    parts.push_back({member, values});
  }
  if (parts.empty()) return {Affine()};
  std::vector<Affine> out(parts[0].values.count());
  for (std::size_t i = 0; i < out.size(); ++i) {
    tinygltf::Node copy;
    for (const Part& part : parts) {
      std::array<float, 4> v{};
      part.values.read(i, v.data());
      if (!std::ranges::all_of(v, [](float x) { return std::isfinite(x); }))
        source.fail(place, "finite numbers", "others in copy " + std::to_string(i));
      (copy.*part.member).assign(v.begin(), v.begin() + part.values.components());
    }
    out[i] = local_map(source, copy, n);
  }
  return out;
}

std::vector<int> scene_roots(const Source& source, const tinygltf::Model& model) {
  if (!model.scenes.empty()) {
    const auto scene = static_cast<std::size_t>(std::max(model.defaultScene, 0));
    if (model.scenes.size() > 1) {
      source.lost["further scenes"] = model.scenes.size() - 1;
      add_info(
          source.notes, "other-scenes", "/scenes",
          "only scene " + std::to_string(scene) + " of " + std::to_string(model.scenes.size()) + " is read");
    }
    return model.scenes[scene].nodes;
  }
  std::vector<bool> is_child(model.nodes.size());
  for (const tinygltf::Node& node : model.nodes) {
    for (const int c : node.children) is_child[static_cast<std::size_t>(c)] = true;
  }
  std::vector<int> roots;
  for (std::size_t n = 0; n < is_child.size(); ++n) {
    if (!is_child[n]) roots.push_back(static_cast<int>(n));
  }
  return roots;
}

/// KHR_node_visibility, of a node and all beneath it.
bool is_hidden(const GltfJson& document, std::size_t n) {
  static const GltfJson::json_pointer at("/extensions/KHR_node_visibility/visible");
  const GltfJson& node = document["nodes"][n];
  return node.contains(at) && node.at(at) == false;
}

/// The instances of the scene that is read, depth first in the order of the file, without those that are
/// hidden. InputError when the nodes are no tree.
std::vector<Instance> find_instances(const Source& source, const GltfJson& document,
                                     const tinygltf::Model& model, Buffers& buffers) {
  // No recursion: a chain may be as long as the file allows.
  struct Pending {
    int node;
    Affine to_scene;
    double rounding = 0;
  };
  std::vector<Pending> stack;
  const std::vector<int> roots = scene_roots(source, model);
  for (auto r = roots.rbegin(); r != roots.rend(); ++r) stack.push_back({*r, {}});
  std::vector<bool> seen(model.nodes.size());
  std::vector<Instance> found;
  std::size_t hidden = 0;
  while (!stack.empty()) {
    const Pending p = stack.back();
    stack.pop_back();
    const auto n = static_cast<std::size_t>(p.node);
    if (seen[n]) {
      source.fail("/nodes/" + std::to_string(n), "a tree of nodes", "a node with two parents, or a cycle");
    }
    seen[n] = true;
    if (is_hidden(document, n)) {
      ++hidden;
      continue;
    }
    const tinygltf::Node& node = model.nodes[n];
    const Affine local = local_map(source, node, n), to_scene = p.to_scene * local;
    const auto rounding_of = [](const Affine& outer, const Affine& a) {
      return growth(outer) *
             float_unit(std::max({std::fabs(a.at(0, 3)), std::fabs(a.at(1, 3)), std::fabs(a.at(2, 3))}));
    };
    const double rounding = std::max(p.rounding, rounding_of(p.to_scene, local));
    if (found.size() > kMostInstances)
      source.fail("/nodes", "at most " + std::to_string(kMostInstances) + " shown meshes", "more");
    if (node.mesh >= 0)
      for (const Affine& copy : copies_of(source, document, model, buffers, n))
        found.push_back({n, static_cast<std::size_t>(node.mesh), to_scene * copy,
                         std::max(rounding, rounding_of(to_scene, copy))});
    for (auto c = node.children.rbegin(); c != node.children.rend(); ++c)
      stack.push_back({*c, to_scene, rounding});
  }
  if (hidden > 0) {
    source.lost["hidden nodes"] += hidden;
    add_warning(source.notes, "hidden-nodes", "/nodes",
                (hidden == 1 ? "1 node is" : std::to_string(hidden) + " nodes are") +
                    " left out with all beneath: KHR_node_visibility hides what is not to be seen");
  }
  return found;
}

/// Puts primitives together to one mesh in the scene's space.
class Assembler {
 public:
  Assembler(const Source& source, Mesh& mesh, bool with_normals)
      : source_(source), mesh_(mesh), with_normals_(with_normals) {}
  void add(const Primitive& primitive, const Instance& instance, std::uint16_t material, std::uint16_t part);
  void finish();

 private:
  void check_room(const Primitive& primitive, std::size_t new_wedges) const;
  void add_wedge(const Primitive& primitive, std::uint32_t vertex, std::uint32_t first_position,
                 Vec3f normal);
  void add_tangents(const Primitive& primitive, const Affine& to_scene, bool mirrored);

  const Source& source_;
  Mesh& mesh_;
  const bool with_normals_;
  std::vector<Vec3d> positions_;
};

/// Columns of the cofactor matrix: maps normals up to a positive factor when the determinant is positive.
struct NormalMap {
  std::array<Vec3d, 3> column;
  double determinant = 1;
};

NormalMap normal_map(const Affine& a) {
  const auto column = [&](int j) { return Vec3d{a.at(0, j), a.at(1, j), a.at(2, j)}; };
  const Vec3d x = column(0), y = column(1), z = column(2);
  NormalMap n{{cross(y, z), cross(z, x), cross(x, y)}, 0};
  n.determinant = dot(x, n.column[0]);
  return n;
}

void Assembler::check_room(const Primitive& primitive, std::size_t new_wedges) const {
  const auto check = [&](const char* what, std::size_t count, int limit) {
    if (count > static_cast<std::size_t>(limit)) {
      source_.fail(what, "at most " + std::to_string(limit), std::to_string(count) + " or more");
    }
  };
  check("vertices of all meshes", positions_.size() + primitive.positions.size(),
        source_.options.max_vertices);
  check("wedges of all meshes", mesh_.wedge_count() + new_wedges, source_.options.max_vertices);
  check("triangles of all meshes", mesh_.triangles.size() + primitive.triangles.size(),
        source_.options.max_triangles);
}

/// Attributes that only some primitives have are 0 (colours: white) on the others.
void Assembler::add_wedge(const Primitive& primitive, std::uint32_t vertex, std::uint32_t first_position,
                          Vec3f normal) {
  const std::size_t before = mesh_.wedge_position.size();
  mesh_.wedge_position.push_back(first_position + vertex);
  const auto add_to = [&](auto& all, const auto& given, auto otherwise) {
    if (given.empty() && all.empty()) return;
    all.resize(before, otherwise);
    all.push_back(given.empty() ? otherwise : given[vertex]);
  };
  add_to(mesh_.uv0, primitive.uv0, Vec2f{});
  add_to(mesh_.uv1, primitive.uv1, Vec2f{});
  add_to(mesh_.colours, primitive.colours, Vec4f{1, 1, 1, 1});
  if (with_normals_) mesh_.normals.push_back(normal);
}

/// Directions on the surface go the way of positions. A mirrored surface has its bitangents the
/// other way round.
void Assembler::add_tangents(const Primitive& primitive, const Affine& to_scene, bool mirrored) {
  if (primitive.tangents.empty()) return;
  mesh_.tangents.resize(mesh_.wedge_count() - primitive.tangents.size());
  for (const Vec4f& t : primitive.tangents) {
    Vec3d d;
    for (int i = 0; i < 3; ++i)
      d[i] = to_scene.at(i, 0) * t.x + to_scene.at(i, 1) * t.y + to_scene.at(i, 2) * t.z;
    const Vec3f unit = to_float(normalized(d));
    mesh_.tangents.push_back({unit.x, unit.y, unit.z, mirrored ? -t.w : t.w});
  }
}

void Assembler::add(const Primitive& primitive, const Instance& instance, std::uint16_t material,
                    std::uint16_t part) {
  const Affine& to_scene = instance.to_scene;
  // glTF: without normals a primitive is flat. Where others have normals that means a wedge per corner.
  const bool flat = with_normals_ && primitive.normals.empty();
  check_room(primitive, flat ? primitive.triangles.size() * 3 : primitive.positions.size());
  const NormalMap normals = normal_map(to_scene);
  const double sign = normals.determinant < 0 ? -1 : 1;
  const auto first_position = static_cast<std::uint32_t>(positions_.size());
  const auto first_wedge = static_cast<std::uint32_t>(mesh_.wedge_count());
  double magnitude = 0;
  for (const Vec3f& p : primitive.positions) {
    positions_.push_back(to_scene * to_double(p));
    for (const float x : {p.x, p.y, p.z})
      if (std::fabs(x) <= source_.largest_coordinate) magnitude = std::max(magnitude, std::fabs(double{x}));
  }
  const double unit =
      growth(to_scene) * std::max(double{primitive.position_step}, double{float_unit(magnitude)});
  mesh_.rounding.resize(positions_.size(), static_cast<float>(std::max(instance.rounding, unit)));
  for (std::uint32_t v = 0; v < primitive.positions.size() && !flat; ++v) {
    Vec3d n;
    if (with_normals_) {
      const Vec3f& given = primitive.normals[v];
      n = (normals.column[0] * given.x + normals.column[1] * given.y + normals.column[2] * given.z) * sign;
    }
    add_wedge(primitive, v, first_position, to_float(normalized(n)));
  }
  if (!flat) add_tangents(primitive, to_scene, sign < 0);
  for (std::size_t t = 0; t < primitive.triangles.size(); ++t) {
    Triangle corners = primitive.triangles[t];
    if (sign < 0) std::swap(corners[1], corners[2]);  // a mirrored front face would be seen from behind
    Triangle wedges;
    if (flat) {
      const Vec3d a = positions_[first_position + corners[0]];
      const Vec3d n = normalized(
          cross(positions_[first_position + corners[1]] - a, positions_[first_position + corners[2]] - a));
      for (std::size_t i = 0; i < 3; ++i) {
        wedges[i] = static_cast<std::uint32_t>(mesh_.wedge_count());
        add_wedge(primitive, corners[i], first_position, to_float(n));
      }
    } else {
      for (std::size_t i = 0; i < 3; ++i) wedges[i] = first_wedge + corners[i];
    }
    mesh_.triangles.push_back(wedges);
    mesh_.triangle_material.push_back(material);
    mesh_.triangle_part.push_back(part);
  }
}

void Assembler::finish() {
  const std::size_t n = mesh_.wedge_count();
  if (!mesh_.uv0.empty()) mesh_.uv0.resize(n);
  if (!mesh_.uv1.empty()) mesh_.uv1.resize(n);
  if (!mesh_.colours.empty()) mesh_.colours.resize(n, {1, 1, 1, 1});
  if (!mesh_.tangents.empty()) mesh_.tangents.resize(n);
  set_positions(mesh_, positions_, source_.largest_coordinate);
}

/// Reads each primitive once; keeps it only while further nodes show the same mesh.
class PrimitiveCache {
 public:
  explicit PrimitiveCache(const std::vector<Instance>& instances) {
    for (const Instance& i : instances) ++left_[i.mesh];
  }
  template <class F>
  std::shared_ptr<const std::vector<Primitive>> get(std::size_t mesh, F&& read) {
    auto& kept = kept_[mesh];
    if (!kept) kept = std::make_shared<const std::vector<Primitive>>(read());
    auto result = kept;
    if (--left_[mesh] == 0) kept_.erase(mesh);
    return result;
  }

 private:
  std::map<std::size_t, std::size_t> left_;
  std::map<std::size_t, std::shared_ptr<const std::vector<Primitive>>> kept_;
};

class GltfReader {
 public:
  GltfReader(const Source& source, ByteSpan bytes, Model& model)
      : source_(source),
        container_(split_container(source, bytes)),
        document_(look(container_, about_)),
        structure_(read_structure(source, document_)),
        buffers_(source, document_, structure_, container_.bin),
        model_(model) {}
  void read();
  bool is_glb() const { return container_.is_glb; }
  const About& about() const { return about_; }

 private:
  GltfJson look(const Container& container, About& about) const {
    const SourceText text(container.json, source_.file, source_.notes);
    GltfJson document = parse_gltf_json(source_, text.text());
    about = about_from_gltf(document, container.is_glb ? "glb" : "gltf", source_.notes);
    look_through(source_, document);
    return document;
  }
  void check_document() const;
  void note_what_is_left_out() const;
  void count_attributes(const tinygltf::Primitive& primitive) const;
  std::vector<int> used_materials(const std::vector<Instance>& instances) const;
  std::uint16_t add_part(const Instance& instance);
  void drop_textures_without_uv();

  const Source& source_;
  const Container container_;
  About about_;
  const GltfJson document_;
  const tinygltf::Model structure_;
  Buffers buffers_;
  Model& model_;
};

bool is_supported(const std::string& extension) {
  static constexpr std::array<std::string_view, 11> kSupported{
      "KHR_draco_mesh_compression", "KHR_mesh_quantization", "EXT_meshopt_compression",
      "KHR_meshopt_compression",    "KHR_texture_transform", "EXT_texture_webp",
      "EXT_texture_avif",           "KHR_texture_basisu",    "KHR_materials_unlit",
      "EXT_mesh_gpu_instancing",    "KHR_node_visibility"};
  return find_material_extension(extension) ||
         std::find(kSupported.begin(), kSupported.end(), extension) != kSupported.end();
}

/// What leaves the mesh and its textures as they are: lights, variants, words about parts. Viewers show such
/// a file though it requires them.
bool is_beside_the_surface(const std::string& extension) {
  static constexpr std::string_view kSuch[] = {"KHR_lights_punctual",
                                               "KHR_animation_pointer",
                                               "KHR_xmp",
                                               "KHR_xmp_json_ld",
                                               "KHR_interactivity",
                                               "EXT_mesh_features",
                                               "EXT_structural_metadata",
                                               "EXT_instance_features",
                                               "EXT_feature_metadata",
                                               "EXT_lights_image_based",
                                               "CESIUM_RTC",
                                               "CESIUM_primitive_outline",
                                               "AGI_articulations",
                                               "MSFT_lod"};
  return extension.find("_materials_") != extension.npos ||
         std::ranges::find(kSuch, extension) != std::end(kSuch);
}

void GltfReader::check_document() const {
  const tinygltf::Asset& asset = structure_.asset;
  if (!asset.version.starts_with("2.")) source_.fail("/asset/version", "2.0", quote(asset.version));
  if (!asset.minVersion.empty() && asset.minVersion != "2.0")
    source_.fail("/asset/minVersion", "2.0", quote(asset.minVersion));
  const auto each_unknown = [&](const std::string& list, auto&& tell) {
    const GltfJson names = document_.value(list, GltfJson::array());
    for (std::size_t i = 0; i < names.size(); ++i)
      if (const std::string name = names[i]; !is_supported(name))
        tell("/" + list + "/" + std::to_string(i), name);
  };
  each_unknown("extensionsRequired", [&](const std::string& place, const std::string& name) {
    if (!is_beside_the_surface(name)) source_.fail(place, "an extension that texmesh reads", quote(name));
    add_warning(source_.notes, "required-extension", place,
                name + ", which the file requires, is left out: the surface is shown without it");
  });
  const GltfJson images = document_.value("images", GltfJson::array());
  for (std::size_t i = 0; i < images.size(); ++i)
    if (images[i].contains("uri") == images[i].contains("bufferView"))
      source_.fail("/images/" + std::to_string(i), "either \"uri\" or \"bufferView\"",
                   images[i].contains("uri") ? "both" : "neither");
  each_unknown("extensionsUsed", [&](const std::string& place, const std::string& name) {
    add_info(source_.notes, "unknown-extension", place, name + " is left out");
    if (name != kVariants) count_lost(source_.lost, "extension " + quote(name));
  });
}

/// JOINTS and WEIGHTS say nothing without the skins.
void GltfReader::count_attributes(const tinygltf::Primitive& primitive) const {
  static constexpr std::string_view kRead[] = {"POSITION",   "NORMAL",     "TANGENT",
                                               "TEXCOORD_0", "TEXCOORD_1", "COLOR_0"};
  for (const auto& [name, accessor] : primitive.attributes)
    if (std::find(std::begin(kRead), std::end(kRead), name) == std::end(kRead) &&
        !name.starts_with("JOINTS") && !name.starts_with("WEIGHTS"))
      count_lost(source_.lost, "attributes " + quote(name));
}

void GltfReader::note_what_is_left_out() const {
  Notes& notes = source_.notes;
  const auto any = [&](const char* key) {
    const bool is_there = document_.contains(key) && !document_[key].empty();
    if (is_there) source_.lost[key] += document_[key].size();
    return is_there;
  };
  if (any("animations")) add_info(notes, "animation", "/animations", "animations are left out");
  if (any("skins")) add_info(notes, "skin", "/skins", "skins are left out: the mesh keeps its default pose");
  if (any("cameras")) add_info(notes, "camera", "/cameras", "cameras are left out");
  const GltfJson extensions = document_.value("extensions", GltfJson());
  if (extensions.is_object() && extensions.contains(kVariants) && extensions[kVariants].is_object())
    if (const GltfJson variants = extensions[kVariants].value("variants", GltfJson());
        variants.is_array() && !variants.empty())
      source_.lost["material variants"] += variants.size();
  for (const tinygltf::Mesh& mesh : structure_.meshes)
    for (const tinygltf::Primitive& primitive : mesh.primitives) {
      count_attributes(primitive);
      if (primitive.targets.empty()) continue;
      source_.lost["morph targets"] += primitive.targets.size();
      source_.note_once(Severity::kInfo, "morph-targets", "/meshes",
                        "morph targets are left out: the mesh keeps its default pose");
    }
}

/// In the order of the file, -1 (glTF's default material) first.
std::vector<int> GltfReader::used_materials(const std::vector<Instance>& instances) const {
  std::set<int> used;
  for (const Instance& i : instances) {
    for (const tinygltf::Primitive& p : structure_.meshes[i.mesh].primitives) used.insert(p.material);
  }
  if (used.size() > kMaxGltfMaterials) {
    source_.fail("/materials", "at most " + std::to_string(kMaxGltfMaterials), std::to_string(used.size()));
  }
  return {used.begin(), used.end()};
}

std::uint16_t GltfReader::add_part(const Instance& instance) {
  std::vector<std::string>& names = model_.mesh.part_names;
  if (names.size() == kMaxParts) {
    source_.note_once(Severity::kInfo, "many-parts", "/nodes", "the nodes after the 65534th are one part");
    return static_cast<std::uint16_t>(kMaxParts - 1);
  }
  std::string name = structure_.nodes[instance.node].name;
  if (name.empty()) name = structure_.meshes[instance.mesh].name;
  if (name.empty()) name = "node " + std::to_string(instance.node);
  names.push_back(std::move(name));
  return static_cast<std::uint16_t>(names.size() - 1);
}

void GltfReader::drop_textures_without_uv() {
  const bool has_uv[2] = {!model_.mesh.uv0.empty(), !model_.mesh.uv1.empty()};
  for (Material& m : model_.materials) {
    for_each_texture(m, [&](TextureRef& ref) {
      if (!ref.used() || has_uv[ref.texcoord]) return;
      source_.note_once(
          Severity::kWarning, "texture-without-uv", m.name,
          "no mesh has TEXCOORD_" + std::to_string(ref.texcoord) + "; its textures are left out");
      ref = {};
    });
  }
}

void GltfReader::read() {
  check_document();
  note_what_is_left_out();
  const std::vector<Instance> instances = find_instances(source_, document_, structure_, buffers_);
  bool with_normals = false;
  for (const Instance& i : instances) {
    for (const tinygltf::Primitive& p : structure_.meshes[i.mesh].primitives)
      with_normals |= p.attributes.count("NORMAL") != 0;
  }
  const std::vector<int> materials = used_materials(instances);
  const auto number_of = [&](int material) {
    return static_cast<std::uint16_t>(std::lower_bound(materials.begin(), materials.end(), material) -
                                      materials.begin());
  };
  PrimitiveCache cache(instances);
  Assembler assembler(source_, model_.mesh, with_normals);
  for (std::size_t i = 0; i < instances.size(); ++i) {
    source_.context.check_cancelled();
    source_.context.report(static_cast<double>(i) / static_cast<double>(instances.size()));
    const Instance& instance = instances[i];
    const std::vector<tinygltf::Primitive>& declared = structure_.meshes[instance.mesh].primitives;
    const auto primitives = cache.get(instance.mesh, [&] {
      std::vector<Primitive> read;
      for (std::size_t p = 0; p < declared.size(); ++p) {
        read.push_back(read_primitive(source_, document_, structure_, buffers_, instance.mesh, p));
      }
      return read;
    });
    const std::uint16_t part = add_part(instance);
    for (std::size_t p = 0; p < declared.size(); ++p) {
      assembler.add((*primitives)[p], instance, number_of(declared[p].material), part);
    }
  }
  assembler.finish();
  if (model_.mesh.triangles.empty() && source_.lost.count("primitives of points and lines"))
    source_.fail("/meshes", "triangles", "points and lines alone");
  read_materials(source_, document_, structure_, buffers_, materials, model_);
  drop_textures_without_uv();
}

ImportedModel read_gltf(const std::string& file_name, ByteSpan bytes, Resolver& resolver,
                        const ImportOptions& options, const RunContext& context, double largest_coordinate) {
  ImportedModel out;
  // glTF 2.0, 3.8.3: colour space information of PNG and JPEG must be ignored.
  ImportOptions by_specification = options;
  if (by_specification.colour_profiles == ProfilePolicy::kAuto)
    by_specification.colour_profiles = ProfilePolicy::kIgnore;
  const Source source{file_name,       resolver, by_specification,  context,
                      out.model.notes, out.lost, largest_coordinate};
  GltfReader reader(source, bytes, out.model);
  reader.read();
  out.format = reader.is_glb() ? "glb" : "gltf";
  out.about = reader.about();
  out.normals_by_specification = true;
  finish_model(out.model, file_name, options);
  return out;
}

}  // namespace

ImportedModel import_gltf(const std::string& file_name, std::span<const std::uint8_t> bytes,
                          Resolver& resolver, const ImportOptions& options, const RunContext& context) {
  return read_gltf(file_name, bytes, resolver, options, context, kLargestCoordinate);
}

ImportedModel import_package_glb(const std::string& file_name, std::span<const std::uint8_t> bytes,
                                 Resolver& resolver, const RunContext& context) {
  return read_gltf(file_name, bytes, resolver, {}, context, kLargestPackedCoordinate);
}

}  // namespace texmesh
