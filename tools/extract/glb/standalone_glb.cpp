#include "tools/extract/glb/standalone_glb.h"

#include <charconv>

#include "pipeline/about/gltf_about.h"
#include "stages/gltf/glb_container.h"
#include "stages/gltf/glb_writer.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;
constexpr const char* kDraco = "KHR_draco_mesh_compression";
constexpr const char* kMeshopt = "EXT_meshopt_compression";
constexpr const char* kWebp = "EXT_texture_webp";
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

/// "texture/<number>", nothing else.
bool source_image_of(const Json& image, std::uint32_t& number) {
  constexpr std::string_view kPrefix = "texture/";
  if (!image.contains("name") || !image["name"].is_string()) return false;
  const std::string& name = image["name"].get_ref<const std::string&>();
  if (!name.starts_with(kPrefix)) return false;
  const auto end = std::from_chars(name.data() + kPrefix.size(), name.data() + name.size(), number);
  return end.ec == std::errc() && end.ptr == name.data() + name.size();
}

template <class F>
void for_each_primitive(Json& root, const F& f) {
  if (!root.contains("meshes")) return;
  for (Json& mesh : root["meshes"])
    for (Json& primitive : mesh["primitives"]) f(primitive);
}

Json* draco_of(Json& primitive) {
  if (!primitive.contains("extensions") || !primitive["extensions"].contains(kDraco)) return nullptr;
  return &primitive["extensions"][kDraco];
}

void require_valid(std::span<const std::uint8_t> glb, const std::string& entry, GlbRules rules) {
  Findings findings;
  check_glb(glb, entry, findings, rules);
  if (findings.empty()) return;
  const Finding& f = findings.list().front();
  throw FormatError(f.entry, f.field, f.expected, f.found);
}

}  // namespace

struct StandaloneGlb::Document {
  struct View {
    Json json;  // without buffer, byteOffset, byteLength, except those of a fallback buffer
    Bytes bytes;
    bool meshopt = false;
  };
  Json root;
  std::vector<View> views;
};

StandaloneGlb::StandaloneGlb(const StandaloneGlb& other)
    : entry_(other.entry_),
      about_(other.about_),
      document_(std::make_unique<Document>(*other.document_)),
      fallback_bytes_(other.fallback_bytes_),
      level_node_(other.level_node_) {}
StandaloneGlb::StandaloneGlb(StandaloneGlb&& other) noexcept = default;
StandaloneGlb& StandaloneGlb::operator=(StandaloneGlb&& other) noexcept = default;
StandaloneGlb::~StandaloneGlb() = default;

StandaloneGlb::StandaloneGlb(std::span<const std::uint8_t> glb, std::string entry, GlbRules rules)
    : entry_(std::move(entry)), document_(std::make_unique<Document>()) {
  require_valid(glb, entry_, rules);
  GlbParts parts = read_glb(glb, entry_);
  const Bytes& binary = parts.binary;
  document_->root = std::move(parts.root);
  if (document_->root.contains("buffers") && document_->root["buffers"].size() > 1)
    fallback_bytes_ = document_->root["buffers"][1].value("byteLength", std::uint64_t{0});
  if (!document_->root.contains("bufferViews")) return;
  for (const Json& json : document_->root["bufferViews"]) {
    Document::View view{json, {}, json.contains("extensions") && json["extensions"].contains(kMeshopt)};
    const Json& place = view.meshopt ? json["extensions"][kMeshopt] : json;
    const std::size_t offset = number(place, "byteOffset"), bytes = number(place, "byteLength");
    if (offset > binary.size() || bytes > binary.size() - offset)
      throw FormatError(entry_, "/bufferViews", "views within the binary chunk", "one beyond it");
    view.bytes.assign(binary.begin() + static_cast<std::ptrdiff_t>(offset),
                      binary.begin() + static_cast<std::ptrdiff_t>(offset + bytes));
    document_->views.push_back(std::move(view));
  }
}

std::size_t StandaloneGlb::add_view(Bytes bytes) {
  document_->views.push_back({Json::object(), std::move(bytes), false});
  return document_->views.size() - 1;
}

void StandaloneGlb::use_extension(const std::string& name, bool required) {
  for (const char* list : {"extensionsUsed", "extensionsRequired"}) {
    if (list == std::string("extensionsRequired") && !required) continue;
    Json names = document_->root.value(list, Json::array());
    if (std::find(names.begin(), names.end(), Json(name)) == names.end()) names.push_back(name);
    document_->root[list] = names;
  }
}

std::vector<std::uint32_t> StandaloneGlb::source_images() const {
  std::vector<std::uint32_t> out;
  if (!document_->root.contains("images")) return out;
  for (const Json& image : document_->root["images"]) {
    std::uint32_t number = 0;
    if (source_image_of(image, number)) out.push_back(number);
  }
  return out;
}

std::map<std::uint32_t, FileImageData> StandaloneGlb::images() const {
  std::map<std::uint32_t, FileImageData> out;
  for (const Json& image : document_->root.value("images", Json::array())) {
    std::uint32_t source = 0;
    if (!source_image_of(image, source) || !image.contains("bufferView")) continue;
    const FileImage format = image.value("mimeType", "") == "image/png" ? FileImage::kPng : FileImage::kJpeg;
    out[source] = {format, document_->views.at(number(image, "bufferView")).bytes};
  }
  return out;
}

MeshCodec StandaloneGlb::codec() const {
  const auto uses = [&](const char* name) {
    const Json used = document_->root.value("extensionsUsed", Json::array());
    return std::find(used.begin(), used.end(), Json(name)) != used.end();
  };
  if (uses(kDraco)) return MeshCodec::kDraco;
  if (uses(kMeshopt)) return MeshCodec::kMeshopt;
  return uses("KHR_mesh_quantization") ? MeshCodec::kQuantized : MeshCodec::kNone;
}

void StandaloneGlb::set_images(const std::map<std::uint32_t, FileImageData>& images) {
  if (!document_->root.contains("images")) return;
  std::vector<bool> webp(document_->root["images"].size());
  for (std::size_t k = 0; k < webp.size(); ++k) {
    Json& image = document_->root["images"][k];
    std::uint32_t source = 0;
    const auto found = source_image_of(image, source) ? images.find(source) : images.end();
    if (found != images.end()) {
      image["mimeType"] = mime_type_of(found->second.format);
      image["bufferView"] = add_view(found->second.bytes);
      image.erase("uri");
    }
    webp[k] = image.value("mimeType", "") == "image/webp";
  }
  if (document_->root.contains("textures"))
    for (Json& texture : document_->root["textures"]) {
      std::size_t image = number(texture, "source");
      if (texture.contains("extensions") && texture["extensions"].contains(kWebp))
        image = number(texture["extensions"][kWebp], "source");
      if (image >= webp.size()) continue;
      texture.erase("source");
      if (texture.contains("extensions")) texture["extensions"].erase(kWebp);
      if (webp[image])
        texture["extensions"][kWebp]["source"] = image;
      else
        texture["source"] = image;
      if (texture.contains("extensions") && texture["extensions"].empty()) texture.erase("extensions");
    }
  forget_extension(document_->root, kWebp);
  if (std::find(webp.begin(), webp.end(), true) != webp.end()) use_extension(kWebp, true);
}

bool StandaloneGlb::has_draco() const { return codec() == MeshCodec::kDraco; }

void StandaloneGlb::recode(const DracoSteps& steps, const NormalSamples* lit_as, const RunContext& context) {
  std::vector<DracoStream> streams;
  for_each_primitive(document_->root, [&](Json& primitive) {
    const Json* draco = draco_of(primitive);
    if (!draco) return;
    DracoStream s;
    s.bytes = document_->views.at(number(*draco, "bufferView")).bytes;
    for (const auto& [name, id] : (*draco)["attributes"].items()) s.attributes[name] = id.get<int>();
    streams.push_back(std::move(s));
  });
  if (streams.empty()) return;
  recode_draco(streams, steps, lit_as, entry_, context);
  std::size_t next = 0;
  for_each_primitive(document_->root, [&](Json& primitive) {
    Json* draco = draco_of(primitive);
    if (!draco) return;
    DracoStream& s = streams[next++];
    if (s.vertices == 0) return;  // kept as it was
    (*draco)["bufferView"] = add_view(std::move(s.bytes));
    for (const auto& [name, id] : s.attributes) (*draco)["attributes"][name] = id;
    for (const auto& [name, accessor] : primitive["attributes"].items()) {
      Json& a = document_->root["accessors"].at(accessor.get<std::size_t>());
      a["count"] = s.vertices;
      if (name == "POSITION") a["min"] = GlbWriter::shortest(s.low), a["max"] = GlbWriter::shortest(s.high);
    }
    Json& indices = document_->root["accessors"].at(number(primitive, "indices"));
    indices["count"] = std::size_t{s.triangles} * 3;
    indices["componentType"] = s.vertices > 65535 ? 5125 : 5123;
  });
}

void StandaloneGlb::begin_levels(double screen_coverage) {
  const std::size_t scene = number(document_->root, "scene");
  Json& nodes = document_->root["scenes"].at(scene)["nodes"];
  Json parent{{"name", "level 0"}, {"children", nodes}};
  parent["extensions"][kLod]["ids"] = Json::array();
  parent["extras"]["MSFT_screencoverage"] = Json::array({screen_coverage});
  level_node_ = document_->root["nodes"].size();
  document_->root["nodes"].push_back(parent);
  nodes = Json::array({level_node_});
  use_extension(kLod, false);
}

std::size_t StandaloneGlb::append_meshes(StandaloneGlb& other) {
  Json& from = other.document_->root;
  Json& to = document_->root;
  const std::size_t view = document_->views.size(), accessor = to["accessors"].size(),
                    mesh = to["meshes"].size();
  for (Document::View& v : other.document_->views) {
    if (v.meshopt) v.json["byteOffset"] = number(v.json, "byteOffset") + fallback_bytes_;
    document_->views.push_back(std::move(v));
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
  Json& root = document_->root;
  root["accessors"] = root["meshes"] = Json::array();
  fallback_bytes_ = 0;
  append_meshes(other);
  const Json& theirs = other.document_->root["nodes"];
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
    if (document_->root.value(shared, Json::array()) != coarser.document_->root.value(shared, Json::array()))
      throw FormatError(coarser.entry_, std::string("/") + shared, "those of " + entry_, "others");
  const std::size_t node = document_->root["nodes"].size(), mesh = append_meshes(coarser);
  for (Json& n : coarser.document_->root["nodes"]) {
    if (n.contains("mesh")) n["mesh"] = number(n, "mesh") + mesh;
    if (n.contains("children"))
      for (Json& child : n["children"]) child = child.get<std::size_t>() + node;
    document_->root["nodes"].push_back(std::move(n));
  }
  Json children = Json::array();
  for (const Json& child :
       coarser.document_->root["scenes"].at(number(coarser.document_->root, "scene"))["nodes"])
    children.push_back(child.get<std::size_t>() + node);
  Json& ids = document_->root["nodes"][level_node_]["extensions"][kLod]["ids"];
  Json level{{"name", "level " + std::to_string(ids.size() + 1)}, {"children", children}};
  ids.push_back(document_->root["nodes"].size());
  document_->root["nodes"][level_node_]["extras"]["MSFT_screencoverage"].push_back(screen_coverage);
  document_->root["nodes"].push_back(level);
}

void StandaloneGlb::move_to(Vec3d translation, double scale) {
  if (translation == Vec3d{} && scale == 1) return;
  const std::size_t scene = number(document_->root, "scene");
  Json& nodes = document_->root["scenes"].at(scene)["nodes"];
  const Vec3d to = translation * scale;
  Json parent{{"name", "origin"}, {"translation", {to.x, to.y, to.z}}};
  if (scale != 1) parent["scale"] = {scale, scale, scale};
  parent["children"] = nodes;
  nodes = Json::array({document_->root["nodes"].size()});
  document_->root["nodes"].push_back(parent);
}

void StandaloneGlb::set_about(const About& about) { about_ = std::make_shared<const About>(about); }

Bytes StandaloneGlb::finish() const {
  Json root = document_->root;
  root.erase("bufferViews");
  root.erase("buffers");
  std::vector<std::int64_t> place(document_->views.size(), -1);
  for_each_key(root, "bufferView", [&](Json& view) { place.at(view.get<std::size_t>()) = 0; });
  Bytes binary;
  Json views = Json::array();
  for (std::size_t k = 0; k < document_->views.size(); ++k) {
    if (place[k] < 0) continue;
    place[k] = static_cast<std::int64_t>(views.size());
    pad_to_four(binary, 0);
    Json json = document_->views[k].json;
    Json& at = document_->views[k].meshopt ? json["extensions"][kMeshopt] : json;
    at["buffer"] = 0;
    at["byteOffset"] = binary.size();
    at["byteLength"] = document_->views[k].bytes.size();
    binary.insert(binary.end(), document_->views[k].bytes.begin(), document_->views[k].bytes.end());
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

}  // namespace texmesh
