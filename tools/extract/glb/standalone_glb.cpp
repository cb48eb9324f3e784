#include "tools/extract/glb/standalone_glb.h"

#include <charconv>

#include "format/model/material_extensions.h"
#include "format/model/tangents.h"
#include "format/split/split_element_codec.h"
#include "format/split/split_reader.h"
#include "pipeline/about/gltf_about.h"
#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "stages/gltf/glb_writer.h"
#include "stages/image/decode_image.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;
constexpr const char* kDraco = "KHR_draco_mesh_compression";
constexpr const char* kMeshopt = "EXT_meshopt_compression";
constexpr const char* kTextureExtensions[] = {"EXT_texture_webp", "EXT_texture_avif"};
constexpr const char* kLod = "MSFT_lod";

std::size_t number(const Json& object, const char* key) {
  return object.contains(key) ? object[key].get<std::size_t>() : 0;
}

/// Calls f(reference) for every number under `key` anywhere in the document.
template <class F>
void for_each_key(Json& json, const char* key, const F& f) {
  if (json.is_object() || json.is_array())
    for (auto it = json.begin(); it != json.end(); ++it) {
      if (json.is_object() && it.key() == key && it->is_number_unsigned())
        f(*it);
      else
        for_each_key(*it, key, f);
    }
}

/// What a texture with an image of this type needs; null for those of glTF 2.0 itself.
const char* texture_extension(std::string_view mime_type) {
  if (mime_type == "image/webp") return kTextureExtensions[0];
  return mime_type == "image/avif" ? kTextureExtensions[1] : nullptr;
}

/// As tangent_texcoord() has it for a Material.
int tangent_texcoord_of(const Json& material) {
  const auto set = [](const Json& reference) { return static_cast<int>(number(reference, "texCoord")); };
  if (material.contains("normalTexture")) return set(material["normalTexture"]);
  if (!material.contains("extensions")) return -1;
  for (const auto& [name, extension] : material["extensions"].items()) {
    const MaterialExtensionKind* kind = find_material_extension(name);
    if (!kind || !extension.is_object()) continue;
    for (const auto& [key, reference] : extension.items())
      if (const ExtensionTextureKind* k = kind->texture(key); k && k->tangent_space) return set(reference);
  }
  return -1;
}

/// "texture/<number>", nothing else.
bool source_image_of(const Json& image, std::uint32_t& number) {
  constexpr std::string_view kPrefix = "texture/";
  if (!image.contains("name") || !image["name"].is_string()) return false;
  const std::string& name = image["name"].get_ref<const std::string&>();
  if (!name.starts_with(kPrefix)) return false;
  const auto end = std::from_chars(name.data() + kPrefix.size(), name.data() + name.size(), number);
  return end.ec == std::errc() && end.ptr == name.data() + name.size();
}

void for_each_primitive(auto& root, const auto& f) {
  if (!root.contains("meshes")) return;
  for (auto& mesh : root.at("meshes"))
    for (auto& primitive : mesh.at("primitives")) f(primitive);
}

/// Json* or const Json*, as the primitive is.
auto* draco_of(auto& primitive) {
  const auto extensions = primitive.find("extensions");
  const bool has = extensions != primitive.end() && extensions->contains(kDraco);
  return has ? &extensions->at(kDraco) : nullptr;
}

void require_valid(std::span<const std::uint8_t> glb, const std::string& entry, GlbRules rules) {
  Findings findings;
  check_glb(glb, entry, findings, rules);
  if (findings.empty()) return;
  const Finding& f = findings.list().front();
  throw FormatError(f.entry, f.field, f.expected, f.found);
}

}  // namespace

StandaloneGlb::StandaloneGlb(std::span<const std::uint8_t> glb, std::string entry,
                             std::optional<GlbRules> rules)
    : entry_(std::move(entry)) {
  if (rules) require_valid(glb, entry_, *rules);
  GlbParts parts = read_glb(glb, entry_);
  const Bytes& binary = parts.binary;
  root_ = std::move(parts.root);
  if (root_.contains("buffers") && root_["buffers"].size() > 1)
    fallback_bytes_ = root_["buffers"][1].value("byteLength", std::uint64_t{0});
  if (!root_.contains("bufferViews")) return;
  for (const Json& json : root_["bufferViews"]) {
    View view{json, {}, json.contains("extensions") && json["extensions"].contains(kMeshopt)};
    const Json& place = view.meshopt ? json["extensions"][kMeshopt] : json;
    const std::size_t offset = number(place, "byteOffset"), bytes = number(place, "byteLength");
    if (offset > binary.size() || bytes > binary.size() - offset)
      throw FormatError(entry_, "/bufferViews", "views within the binary chunk", "one beyond it");
    view.bytes.assign(binary.begin() + static_cast<std::ptrdiff_t>(offset),
                      binary.begin() + static_cast<std::ptrdiff_t>(offset + bytes));
    views_.push_back(std::move(view));
  }
}

std::size_t StandaloneGlb::add_view(Bytes bytes) {
  views_.push_back({Json::object(), std::move(bytes), false});
  return views_.size() - 1;
}

void StandaloneGlb::use_extension(const std::string& name, bool required) {
  for (const char* list : {"extensionsUsed", "extensionsRequired"}) {
    if (list == std::string("extensionsRequired") && !required) continue;
    Json names = root_.value(list, Json::array());
    if (std::find(names.begin(), names.end(), Json(name)) == names.end()) names.push_back(name);
    root_[list] = names;
  }
}

std::vector<std::uint32_t> StandaloneGlb::source_images() const {
  std::vector<std::uint32_t> out;
  if (!root_.contains("images")) return out;
  for (const Json& image : root_["images"]) {
    std::uint32_t number = 0;
    if (source_image_of(image, number)) out.push_back(number);
  }
  return out;
}

std::map<std::uint32_t, FileImageData> StandaloneGlb::images() const {
  std::map<std::uint32_t, FileImageData> out;
  for (const Json& image : root_.value("images", Json::array())) {
    std::uint32_t source = 0;
    if (!source_image_of(image, source) || !image.contains("bufferView")) continue;
    const FileImage format = image.value("mimeType", "") == "image/png" ? FileImage::kPng : FileImage::kJpeg;
    out[source] = {format, views_.at(number(image, "bufferView")).bytes};
  }
  return out;
}

std::vector<int> StandaloneGlb::tangent_texcoords() const {
  std::vector<int> out;
  bool tangents = false;
  for (const Json& mesh : root_.value("meshes", Json::array()))
    for (const Json& primitive : mesh.value("primitives", Json::array()))
      tangents =
          tangents || (primitive.contains("attributes") && primitive["attributes"].contains("TANGENT"));
  for (const Json& material : root_.value("materials", Json::array()))
    out.push_back(tangents ? tangent_texcoord_of(material) : -1);
  return out;
}

MeshCodec StandaloneGlb::codec() const {
  const auto uses = [&](const char* name) {
    const Json used = root_.value("extensionsUsed", Json::array());
    return std::find(used.begin(), used.end(), Json(name)) != used.end();
  };
  if (uses(kDraco)) return MeshCodec::kDraco;
  if (uses(kMeshopt)) return MeshCodec::kMeshopt;
  return uses("KHR_mesh_quantization") ? MeshCodec::kQuantized : MeshCodec::kNone;
}

void StandaloneGlb::set_images(const std::map<std::uint32_t, FileImageData>& images) {
  if (!root_.contains("images")) return;
  std::vector<const char*> extension(root_["images"].size());
  for (std::size_t k = 0; k < extension.size(); ++k) {
    Json& image = root_["images"][k];
    std::uint32_t source = 0;
    const auto found = source_image_of(image, source) ? images.find(source) : images.end();
    if (found != images.end()) {
      image["mimeType"] = mime_type_of(found->second.format);
      image["bufferView"] = add_view(found->second.bytes);
      image.erase("uri");
    }
    extension[k] = texture_extension(image.value("mimeType", ""));
  }
  if (root_.contains("textures"))
    for (Json& texture : root_["textures"]) {
      std::size_t image = number(texture, "source");
      for (const char* name : kTextureExtensions)
        if (texture.contains("extensions") && texture["extensions"].contains(name)) {
          image = number(texture["extensions"][name], "source");
          texture["extensions"].erase(name);
        }
      if (image >= extension.size()) continue;
      texture.erase("source");
      if (extension[image])
        texture["extensions"][extension[image]]["source"] = image;
      else
        texture["source"] = image;
      if (texture.contains("extensions") && texture["extensions"].empty()) texture.erase("extensions");
    }
  for (const char* name : kTextureExtensions) {
    forget_extension(root_, name);
    if (std::find(extension.begin(), extension.end(), name) != extension.end()) use_extension(name, true);
  }
}

std::vector<DracoStream> StandaloneGlb::draco_streams() const {
  std::vector<DracoStream> streams;
  for_each_primitive(root_, [&](const Json& primitive) {
    const Json* draco = draco_of(primitive);
    if (!draco) return;
    DracoStream& s = streams.emplace_back();
    s.bytes = views_.at(number(*draco, "bufferView")).bytes;
    for (const auto& [name, id] : draco->at("attributes").items()) s.attributes[name] = id.get<int>();
  });
  return streams;
}

void StandaloneGlb::set_draco_streams(std::vector<DracoStream> streams) {
  std::size_t next = 0;
  for_each_primitive(root_, [&](Json& primitive) {
    Json* draco = draco_of(primitive);
    if (!draco) return;
    DracoStream& s = streams.at(next++);
    if (s.vertices == 0) return;  // kept as it was
    (*draco)["bufferView"] = add_view(std::move(s.bytes));
    for (const auto& [name, id] : s.attributes) (*draco)["attributes"][name] = id;
    for (const auto& [name, accessor] : primitive["attributes"].items()) {
      Json& a = root_["accessors"].at(accessor.get<std::size_t>());
      a["count"] = s.vertices;
      if (name == "POSITION") a["min"] = GlbWriter::shortest(s.low), a["max"] = GlbWriter::shortest(s.high);
    }
    Json& indices = root_["accessors"].at(number(primitive, "indices"));
    indices["count"] = std::size_t{s.triangles} * 3;
    indices["componentType"] = s.vertices > 65535 ? 5125 : 5123;
  });
}

void StandaloneGlb::begin_levels(double screen_coverage) {
  const std::size_t scene = number(root_, "scene");
  Json& nodes = root_["scenes"].at(scene)["nodes"];
  Json parent{{"name", "level 0"}, {"children", nodes}};
  parent["extensions"][kLod]["ids"] = Json::array();
  parent["extras"]["MSFT_screencoverage"] = Json::array({screen_coverage});
  level_node_ = root_["nodes"].size();
  root_["nodes"].push_back(parent);
  nodes = Json::array({level_node_});
  use_extension(kLod, false);
}

std::size_t StandaloneGlb::append_meshes(StandaloneGlb& other) {
  Json& from = other.root_;
  Json& to = root_;
  const std::size_t view = views_.size(), accessor = to["accessors"].size(), mesh = to["meshes"].size();
  for (View& v : other.views_) {
    if (v.meshopt) v.json["byteOffset"] = number(v.json, "byteOffset") + fallback_bytes_;
    views_.push_back(std::move(v));
  }
  fallback_bytes_ += (other.fallback_bytes_ + 3) / 4 * 4;
  for (const char* list : {"accessors", "meshes"})
    for_each_key(from[list], "bufferView", [&](Json& index) { index = index.get<std::size_t>() + view; });
  for (Json& a : from["accessors"]) to["accessors"].push_back(std::move(a));
  for_each_primitive(from, [&](Json& primitive) {
    for (Json& a : primitive["attributes"]) a = a.get<std::size_t>() + accessor;
    if (primitive.contains("indices")) primitive["indices"] = number(primitive, "indices") + accessor;
  });
  for (Json& m : from["meshes"]) to["meshes"].push_back(std::move(m));
  for (const char* list : {"extensionsUsed", "extensionsRequired"})
    for (const Json& name : from.value(list, Json::array()))
      use_extension(name.get<std::string>(), list == std::string("extensionsRequired"));
  return mesh;
}

void StandaloneGlb::take_meshes(StandaloneGlb other) {
  Json& root = root_;
  root["accessors"] = root["meshes"] = Json::array();
  fallback_bytes_ = 0;
  append_meshes(other);
  const Json& theirs = other.root_["nodes"];
  if (theirs.size() > root["nodes"].size())
    throw FormatError(entry_, "/nodes", std::to_string(theirs.size()) + " parts of " + other.entry_,
                      std::to_string(root["nodes"].size()));
  for (std::size_t k = 0; k < root["nodes"].size(); ++k) {
    Json& node = root["nodes"][k];
    node.erase("mesh");
    if (k >= theirs.size() || !theirs[k].contains("mesh")) continue;
    node["mesh"] = theirs[k]["mesh"];
    root["meshes"].at(number(node, "mesh"))["name"] = node.value("name", "");
  }
}

void StandaloneGlb::add_level(StandaloneGlb coarser, double screen_coverage) {
  for (const char* shared : {"materials", "textures", "samplers"})
    if (root_.value(shared, Json::array()) != coarser.root_.value(shared, Json::array()))
      throw FormatError(coarser.entry_, std::string("/") + shared, "those of " + entry_, "others");
  const std::size_t node = root_["nodes"].size(), mesh = append_meshes(coarser);
  for (Json& n : coarser.root_["nodes"]) {
    if (n.contains("mesh")) n["mesh"] = number(n, "mesh") + mesh;
    if (n.contains("children"))
      for (Json& child : n["children"]) child = child.get<std::size_t>() + node;
    root_["nodes"].push_back(std::move(n));
  }
  Json children = Json::array();
  for (const Json& child : coarser.root_["scenes"].at(number(coarser.root_, "scene"))["nodes"])
    children.push_back(child.get<std::size_t>() + node);
  Json& ids = root_["nodes"][level_node_]["extensions"][kLod]["ids"];
  Json level{{"name", "level " + std::to_string(ids.size() + 1)}, {"children", children}};
  ids.push_back(root_["nodes"].size());
  root_["nodes"][level_node_]["extras"]["MSFT_screencoverage"].push_back(screen_coverage);
  root_["nodes"].push_back(level);
}

void StandaloneGlb::place(const OutputTransform& transform) {
  if (transform.changes_nothing()) return;
  const std::size_t scene = number(root_, "scene");
  Json& nodes = root_["scenes"].at(scene)["nodes"];
  Json parent{{"name", "origin"}};
  if (transform.turns()) {
    parent["matrix"] = transform.matrix();  // exact, which a quaternion of a quarter is not
  } else {
    const Vec3d to = transform(Vec3d{});
    parent["translation"] = {to.x, to.y, to.z};
    if (transform.scale != 1) parent["scale"] = {transform.scale, transform.scale, transform.scale};
  }
  parent["children"] = nodes;
  nodes = Json::array({root_["nodes"].size()});
  root_["nodes"].push_back(parent);
}

void StandaloneGlb::set_about(const About& about) { about_ = std::make_shared<const About>(about); }

Bytes StandaloneGlb::finish() const {
  Json root = root_;
  root.erase("bufferViews");
  root.erase("buffers");
  std::vector<std::int64_t> place(views_.size(), -1);
  for_each_key(root, "bufferView", [&](Json& view) { place.at(view.get<std::size_t>()) = 0; });
  Bytes binary;
  Json views = Json::array();
  for (std::size_t k = 0; k < views_.size(); ++k) {
    if (place[k] < 0) continue;
    place[k] = static_cast<std::int64_t>(views.size());
    pad_to_four(binary, 0);
    Json json = views_[k].json;
    Json& at = views_[k].meshopt ? json["extensions"][kMeshopt] : json;
    at["buffer"] = 0;
    at["byteOffset"] = binary.size();
    at["byteLength"] = views_[k].bytes.size();
    binary.insert(binary.end(), views_[k].bytes.begin(), views_[k].bytes.end());
    views.push_back(std::move(json));
  }
  for_each_key(root, "bufferView",
               [&](Json& view) { view = static_cast<std::size_t>(place[view.get<std::size_t>()]); });
  pad_to_four(binary, 0);
  if (!views.empty()) root["bufferViews"] = views;
  root["buffers"] = Json::array({{{"byteLength", binary.size()}}});
  if (fallback_bytes_ > 0)
    root["buffers"].push_back(
        {{"byteLength", fallback_bytes_}, {"extensions", {{kMeshopt, {{"fallback", true}}}}}});

  if (about_) write_gltf_about(*about_, root);  // last: values of strangers must not be taken for indices
  return glb_container(root.dump(-1, ' ', false, Json::error_handler_t::replace), binary);
}

About reserved_about(const About& about, const OutputTransform& transform, std::uint64_t bytes) {
  constexpr std::uint64_t kShare = 20;
  return about_within(transformed_about(about, transform), bytes / kShare);
}

bool add_words(Bytes& glb, const About& about, std::uint64_t bytes) {
  for (const About& choice : about_choices(about)) {
    GlbParts parts = read_glb(glb, "file");
    write_gltf_about(choice, parts.root);
    Bytes file = glb_container(parts.root.dump(-1, ' ', false, Json::error_handler_t::replace), parts.binary);
    if (file.size() < glb.size()) return false;  // it has these words already, and more
    if (file.size() > bytes) continue;
    glb = std::move(file);
    return choice == about;
  }
  return false;
}

Json placed_notes(const Annotations& annotations, const OutputTransform& place) {
  Annotations placed = annotations;
  const OutputTransform turn{.origin = {}, .up = place.up};
  transform_annotations(placed, place, turn);
  return annotations_json(placed)["annotations"];
}

void add_notes(Bytes& glb, Json notes) {
  GlbParts parts = read_glb(glb, "file");
  parts.root["extras"]["texmesh"]["annotations"] = std::move(notes);
  glb = glb_container(parts.root.dump(-1, ' ', false, Json::error_handler_t::replace), parts.binary);
}

namespace {

StandaloneGlb stored_file(PackageReader& package, int scale) {
  return {package.scale_glb(scale), mesh_path(scale)};
}

/// The mesh that the stream has at a scale.
Mesh mesh_at(SplitStreamReader& reader, int scale, std::span<const std::uint8_t> stream) {
  const auto& scales = reader.head().scales;
  const auto found = std::ranges::find(scales, scale, &SplitScale::scale);
  if (found == scales.end())
    throw FormatError(kSplitStreamPath, "scales", "scale " + std::to_string(scale), "none");
  reader.read_to_scale(static_cast<std::size_t>(found - scales.begin()), stream);
  return split_model(reader.head(), reader.mesh());
}

void fit_to_finest(const Mesh& finest, Mesh& mesh, const RunContext& context) {
  if (mesh.normals.empty()) return;
  std::vector<Vec3d> points;
  for (const std::uint32_t p : mesh.wedge_position) points.push_back(to_double(mesh.positions[p]));
  mesh.normals =
      fit_normals(points, mesh.triangles, std::move(mesh.normals), normal_samples(finest), context);
}

}  // namespace

StandaloneGlb scale_file(PackageReader& package, int scale, const RunContext& context,
                         StreamedNormals normals) {
  const Manifest& m = package.manifest();
  const ManifestScale& wanted = m.scales[package.scale_index(scale)];
  const int coarsest = m.scales.back().scale;
  StandaloneGlb first = stored_file(package, coarsest);
  if (scale == coarsest) return first;
  if (wanted.has_glb()) {
    StandaloneGlb file = stored_file(package, scale);
    file.set_images(first.images());
    return file;
  }
  const bool fitted = normals == StreamedNormals::kFitted;
  const Bytes stream = fitted ? package.entry(kSplitStreamPath) : package.split_prefix(scale);
  SplitStreamReader reader(read_split_head(stream));
  Mesh mesh = mesh_at(reader, scale, stream);
  if (fitted) fit_to_finest(mesh_at(reader, 0, stream), mesh, context);
  make_tangents(mesh, first.tangent_texcoords());
  ScalesOptions options;
  options.mesh_codec = first.codec();
  // Streamed normals are for searches, which decode what they look at.
  const auto rules = fitted ? std::optional(GlbRules::kPackage) : std::nullopt;
  const bool hasty = normals == StreamedNormals::kHasty;
  first.take_meshes({write_streamed_scale(mesh, reader.head(), options, hasty), mesh_path(scale), rules});
  return first;
}

Model read_model(StandaloneGlb file, const std::string& entry, const RunContext& context) {
  std::map<std::uint32_t, FileImageData> images;
  for (const std::uint32_t i : file.source_images()) {
    const auto byte = [i](int shift) { return static_cast<std::uint8_t>(i >> shift); };
    images[i] = {FileImage::kPng, encode_image({1, 1, 3, {byte(0), byte(8), byte(16)}}, {FileImage::kPng})};
  }
  file.set_images(images);
  NoFiles none;
  return import_package_glb(entry, file.finish(), none, context).model;
}

std::string image_name(std::uint32_t image) { return std::to_string(image); }

namespace {

constexpr const char* kTransform = "KHR_texture_transform";

/// Calls f with every reference to a texture of a material, extensions' among them.
template <class F>
void for_each_reference(Json& value, const F& f) {
  if (!value.is_object()) return;
  for (auto& [key, member] : value.items()) {
    if (key.ends_with("Texture") && member.is_object() && member.contains("index")) f(member);
    for_each_reference(member, f);
  }
}

Json transform_of(const Json& reference) {
  if (!reference.contains("extensions") || !reference["extensions"].contains(kTransform)) return nullptr;
  return reference["extensions"][kTransform];
}

}  // namespace

bool bake_texture_scale(Json& root, Mesh& mesh) {
  if (!root.contains("materials")) return true;
  std::vector<Json> found;
  for (Json& material : root["materials"])
    for_each_reference(material, [&](Json& reference) { found.push_back(transform_of(reference)); });
  if (found.empty() || found.front().is_null()) return std::ranges::all_of(found, &Json::is_null);
  const Json first = found.front();
  if (std::ranges::any_of(found, [&](const Json& t) { return t != first; }) || first.size() != 1 ||
      !first.contains("scale") || !mesh.uv1.empty())
    return false;
  const Vec2f scale{first["scale"].at(0).get<float>(), first["scale"].at(1).get<float>()};
  for (Vec2f& uv : mesh.uv0) uv = {uv.x * scale.x, uv.y * scale.y};
  for (Json& material : root["materials"])
    for_each_reference(material, [&](Json& reference) {
      reference["extensions"].erase(kTransform);
      if (reference["extensions"].empty()) reference.erase("extensions");
    });
  return true;
}

Bytes image_bytes(const GlbParts& parts, const Json& image) {
  const Json& view = parts.root["bufferViews"].at(image.at("bufferView").get<std::size_t>());
  const auto first =
      parts.binary.begin() + static_cast<std::ptrdiff_t>(view.value("byteOffset", std::size_t{0}));
  return {first, first + view["byteLength"].get<std::ptrdiff_t>()};
}

std::size_t add_view(GlbParts& to, const Bytes& bytes) {
  pad_to_four(to.binary, 0);
  to.root["bufferViews"].push_back(
      {{"buffer", 0}, {"byteOffset", to.binary.size()}, {"byteLength", bytes.size()}});
  to.binary.insert(to.binary.end(), bytes.begin(), bytes.end());
  return to.root["bufferViews"].size() - 1;
}

namespace {

constexpr std::int64_t kDefaultMaterial = -1;

/// The materials that triangles have, as import counts them.
std::vector<std::int64_t> used_materials(const Json& root) {
  std::set<std::int64_t> used;
  for (const Json& mesh : root["meshes"])
    for (const Json& p : mesh["primitives"]) used.insert(p.value("material", kDefaultMaterial));
  return {used.begin(), used.end()};
}

/// The image of `from` as a view of `to`; WebP becomes PNG.
Json moved_image(Json image, const GlbParts& from, GlbParts& to) {
  Bytes bytes = image_bytes(from, image);
  if (image.value("mimeType", "") == "image/webp") {
    bytes = encode_image(decode_image(probe_image("image", std::move(bytes), {})), {FileImage::kPng});
    image["mimeType"] = "image/png";
  }
  image["bufferView"] = add_view(to, bytes);
  return image;
}

}  // namespace

StandaloneGlb plain_file(const StandaloneGlb& file, const std::string& entry, const RunContext& context) {
  GlbParts from = read_glb(file.finish(), entry);
  Mesh flat = read_model(file, entry, context).mesh;
  const bool baked = bake_texture_scale(from.root, flat);
  ScalesOptions options;
  options.mesh_codec = MeshCodec::kNone;
  GlbParts to = read_glb(write_streamed_scale(flat, SplitStreamHead{}, options), entry);
  const std::vector<std::int64_t> materials = used_materials(from.root);
  for (Json& mesh : to.root["meshes"])
    for (Json& p : mesh["primitives"]) {
      const std::int64_t material = materials.at(p.value("material", std::size_t{0}));
      p.erase("material");
      if (material != kDefaultMaterial) p["material"] = material;
    }
  Json root = from.root;
  for (const char* list : {"meshes", "accessors", "bufferViews"}) root[list] = to.root[list];
  std::size_t part = 0;  // nodes with meshes, in the order in which import makes parts of them
  for (Json& node : root["nodes"]) {
    for (const char* key : {"scale", "rotation", "matrix", "translation"}) node.erase(key);
    if (node.contains("mesh")) node["mesh"] = to.root["nodes"].at(part++).at("mesh");
  }
  for (const char* list : {"images", "textures"})
    if (!root.contains(list)) root[list] = Json::array();
  for (Json& image : root["images"]) image = moved_image(image, from, to);
  root["bufferViews"] = to.root["bufferViews"];
  for (Json& texture : root["textures"]) {
    if (!texture.contains("extensions")) continue;
    texture["source"] = texture["extensions"]["EXT_texture_webp"]["source"];
    texture.erase("extensions");
  }
  for (const char* extension : {"KHR_draco_mesh_compression", "EXT_meshopt_compression",
                                "KHR_mesh_quantization", "EXT_texture_webp", "EXT_mesh_features"})
    forget_extension(root, extension);
  if (baked) forget_extension(root, "KHR_texture_transform");
  for (const char* list : {"images", "textures"})
    if (root[list].empty()) root.erase(list);
  pad_to_four(to.binary, 0);
  root["buffers"] = Json::array({{{"byteLength", to.binary.size()}}});
  return {glb_container(root.dump(), to.binary), entry};
}

}  // namespace texmesh
