#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <iterator>
#include <nlohmann/json.hpp>

#include "format/model/material_extensions.h"
#include "pipeline/import/gltf/import_gltf_parts.h"

namespace texmesh::gltf {
namespace {

constexpr double kMaxSize = 9007199254740991.0;  // 2^53 - 1
constexpr double kMaxInt = 2147483647.0;         // tinygltf keeps some sizes as int
constexpr std::size_t kMaxArray = 1'000'000;

constexpr std::array<std::string_view, 8> kSupported{"KHR_draco_mesh_compression", "KHR_mesh_quantization",
                                                     "EXT_meshopt_compression",    "KHR_meshopt_compression",
                                                     "KHR_texture_transform",      "EXT_texture_webp",
                                                     "KHR_texture_basisu",         "KHR_materials_unlit"};

bool supported(const std::string& name) {
  return find_material_extension(name) ||
         std::find(kSupported.begin(), kSupported.end(), name) != kSupported.end();
}

std::string shown(const Json& value) {
  if (value.is_structured()) return value.type_name();
  const std::string text = value.dump();
  return text.size() > 80 ? text.substr(0, 80) + "..." : text;
}

/// A JSON object and where it stands. Each member function checks one property, which may be absent (or null,
/// as some exporters write it) unless it is `required`.
class Item {
 public:
  Item(const Source& source, Json& document, Json& value, std::string place)
      : source_(source), document_(document), value_(value), place_(std::move(place)) {
    if (!value_.is_object()) source_.fail(place_, "an object", shown(value_));
  }

  bool has(const char* key) const {
    const auto it = value_.find(key);
    return it != value_.end() && !it->is_null();
  }
  const Item& required(const char* key) const {
    if (!has(key)) source_.fail(place_, std::string("\"") + key + "\"", "an object without it");
    return *this;
  }
  Item object(const char* key) const { return {source_, document_, value_[key], place_of(key)}; }

  const Item& size(const char* key, double lo = 0, double hi = kMaxSize) const {
    if (has(key)) check_integer(value_[key], place_of(key), lo, hi);
    return *this;
  }
  /// An index into the document's array `array`.
  const Item& index(const char* key, const char* array) const {
    if (has(key)) check_index(value_[key], place_of(key), array);
    return *this;
  }
  const Item& indices(const char* key, const char* array) const {
    each_value(key, [&](Json& v, const std::string& place) { check_index(v, place, array); });
    return *this;
  }
  /// An object whose members are indices into `array`.
  const Item& index_map(const char* key, const char* array) const {
    if (!has(key)) return *this;
    const Item map = object(key);
    for (auto& [name, v] : map.value_.items()) check_index(v, map.place_of(name.c_str()), array);
    return *this;
  }
  const Item& number(const char* key) const {
    if (has(key) && !value_[key].is_number()) source_.fail(place_of(key), "a number", shown(value_[key]));
    return *this;
  }
  const Item& numbers(const char* key, std::size_t count) const {
    if (!has(key)) return *this;
    const Json& v = value_[key];
    if (!v.is_array() || v.size() != count ||
        !std::all_of(v.begin(), v.end(), [](const Json& n) { return n.is_number(); })) {
      source_.fail(place_of(key), std::to_string(count) + " numbers", shown(v));
    }
    return *this;
  }
  const Item& string(const char* key) const {
    if (has(key) && !value_[key].is_string()) source_.fail(place_of(key), "a string", shown(value_[key]));
    return *this;
  }
  const Item& boolean(const char* key) const {
    if (has(key) && !value_[key].is_boolean())
      source_.fail(place_of(key), "true or false", shown(value_[key]));
    return *this;
  }
  const Item& one_of(const char* key, std::initializer_list<Json> allowed) const {
    if (!has(key)) return *this;
    const Json& v = value_[key];
    if (std::find(allowed.begin(), allowed.end(), v) == allowed.end()) {
      std::string list;
      for (const Json& a : allowed) list += (list.empty() ? "" : ", ") + a.dump();
      source_.fail(place_of(key), "one of " + list, shown(v));
    }
    return *this;
  }
  /// check(item) for every element of an array of objects.
  template <class F>
  const Item& each(const char* key, F&& check) const {
    each_value(key, [&](Json& v, const std::string& place) { check(Item(source_, document_, v, place)); });
    return *this;
  }
  /// check(item) for an object.
  template <class F>
  const Item& with(const char* key, F&& check) const {
    if (has(key)) check(object(key));
    return *this;
  }
  template <class F>
  const Item& extension(const char* name, F&& check) const {
    return with("extensions", [&](const Item& e) { e.with(name, check); });
  }
  template <class F>
  void each_value(const char* key, F&& check) const {
    if (!has(key)) return;
    Json& array = value_[key];
    if (!array.is_array()) source_.fail(place_of(key), "an array", shown(array));
    if (array.size() > kMaxArray) {
      source_.fail(place_of(key), "at most " + std::to_string(kMaxArray) + " elements",
                   std::to_string(array.size()));
    }
    for (std::size_t i = 0; i < array.size(); ++i) check(array[i], place_of(key) + "/" + std::to_string(i));
  }

  Json& value() const { return value_; }
  const std::string& place() const { return place_; }
  std::string place_of(const char* key) const { return place_ + "/" + key; }
  const Source& source() const { return source_; }
  Json& document() const { return document_; }

 private:
  /// "3.0" is an integer to JSON Schema, but not to tinygltf: rewritten here.
  void check_integer(Json& v, const std::string& place, double lo, double hi) const {
    if (v.is_number_float()) {
      const double d = v.get<double>();
      if (d >= 0 && d <= kMaxSize && std::floor(d) == d) v = static_cast<std::uint64_t>(d);
    }
    const bool fits = v.is_number_unsigned() && static_cast<double>(v.get<std::uint64_t>()) >= lo &&
                      static_cast<double>(v.get<std::uint64_t>()) <= hi;
    if (!fits) {
      source_.fail(place,
                   "an integer from " + std::to_string(static_cast<std::uint64_t>(lo)) + " to " +
                       std::to_string(static_cast<std::uint64_t>(hi)),
                   shown(v));
    }
  }
  void check_index(Json& v, const std::string& place, const char* array) const {
    const auto it = document_.find(array);
    const std::size_t size = it != document_.end() && it->is_array() ? it->size() : 0;
    if (size == 0) source_.fail(place, std::string("an element of /") + array + ", which is empty", shown(v));
    check_integer(v, place, 0, static_cast<double>(size - 1));
  }

  const Source& source_;
  Json& document_;
  Json& value_;
  std::string place_;
};

void check_asset(const Item& root) {
  const Item asset = root.required("asset").object("asset");
  asset.required("version").string("version").string("minVersion");
  const std::string version = asset.value()["version"].get<std::string>();
  if (version.rfind("2.", 0) != 0)
    root.source().fail("/asset/version", "2.0", shown(asset.value()["version"]));
  if (asset.has("minVersion") && asset.value()["minVersion"] != "2.0") {
    root.source().fail("/asset/minVersion", "2.0", shown(asset.value()["minVersion"]));
  }
}

void check_extensions(const Item& root) {
  root.each_value("extensionsRequired", [&](Json& name, const std::string& place) {
    if (!name.is_string() || !supported(name.get<std::string>())) {
      root.source().fail(place, "an extension that texmesh reads", shown(name));
    }
  });
  root.each_value("extensionsUsed", [&](Json& name, const std::string& place) {
    if (!name.is_string()) root.source().fail(place, "a string", shown(name));
    if (!supported(name.get<std::string>())) {
      add_info(root.source().notes, "unknown-extension", place, name.get<std::string>() + " is left out");
    }
  });
}

void check_buffer_view(const Item& view) {
  view.required("buffer")
      .index("buffer", "buffers")
      .size("byteOffset")
      .required("byteLength")
      .size("byteLength");
  view.size("byteStride", 0, 252);
  if (view.has("byteStride") && view.value()["byteStride"].get<std::uint64_t>() % 4 != 0) {
    view.source().fail(view.place_of("byteStride"), "a multiple of 4", shown(view.value()["byteStride"]));
  }
  const auto check_meshopt = [](const Item& e, bool khronos) {
    e.required("buffer")
        .index("buffer", "buffers")
        .size("byteOffset")
        .required("byteLength")
        .size("byteLength");
    e.required("byteStride").size("byteStride", 1, 256).required("count").size("count");
    e.required("mode").one_of("mode", {"ATTRIBUTES", "TRIANGLES", "INDICES"});
    if (khronos)
      e.one_of("filter", {"NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR"});
    else
      e.one_of("filter", {"NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL"});
  };
  view.extension("EXT_meshopt_compression", [&](const Item& e) { check_meshopt(e, false); });
  view.extension("KHR_meshopt_compression", [&](const Item& e) {
    if (view.value()["extensions"].contains("EXT_meshopt_compression"))
      view.source().fail(view.place_of("extensions"), "one of EXT_ and KHR_meshopt_compression", "both");
    check_meshopt(e, true);
  });
}

void check_accessor(const Item& accessor) {
  accessor.index("bufferView", "bufferViews").size("byteOffset").required("count").size("count");
  accessor.required("componentType").one_of("componentType", {5120, 5121, 5122, 5123, 5125, 5126});
  accessor.required("type").one_of("type", {"SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"});
  accessor.boolean("normalized");
  accessor.with("sparse", [](const Item& sparse) {
    sparse.required("count").size("count", 0, kMaxInt).required("indices").required("values");
    sparse.object("indices")
        .required("bufferView")
        .index("bufferView", "bufferViews")
        .size("byteOffset", 0, kMaxInt)
        .required("componentType")
        .one_of("componentType", {5121, 5123, 5125});
    sparse.object("values")
        .required("bufferView")
        .index("bufferView", "bufferViews")
        .size("byteOffset", 0, kMaxInt);
  });
}

void check_image(const Item& image) {
  image.string("uri").index("bufferView", "bufferViews");
  if (image.has("uri") == image.has("bufferView")) {
    image.source().fail(image.place(), "either \"uri\" or \"bufferView\"",
                        image.has("uri") ? "both" : "neither");
  }
}

void check_texture(const Item& texture) {
  texture.index("sampler", "samplers").index("source", "images");
  for (const char* name : {"EXT_texture_webp", "KHR_texture_basisu"})
    texture.extension(name, [](const Item& e) { e.index("source", "images"); });
}

void check_sampler(const Item& sampler) {
  sampler.one_of("magFilter", {9728, 9729});
  sampler.one_of("minFilter", {9728, 9729, 9984, 9985, 9986, 9987});
  for (const char* wrap : {"wrapS", "wrapT"}) sampler.one_of(wrap, {33071, 33648, 10497});
}

void check_texture_info(const Item& info) {
  info.required("index")
      .index("index", "textures")
      .size("texCoord", 0, 255)
      .number("scale")
      .number("strength");
  info.extension("KHR_texture_transform", [](const Item& t) {
    t.numbers("offset", 2).numbers("scale", 2).number("rotation").size("texCoord", 0, 255);
  });
}

void check_extension(const Item& e, const MaterialExtensionKind& kind) {
  for (const ExtensionFactorKind& f : kind.factors) {
    const std::string key(f.key);
    if (f.components == 1) {
      e.number(key.c_str());
    } else {
      e.numbers(key.c_str(), static_cast<std::size_t>(f.components));
    }
  }
  for (const ExtensionTextureKind& t : kind.textures) e.with(std::string(t.key).c_str(), check_texture_info);
}

void check_material(const Item& material) {
  material.numbers("emissiveFactor", 3).number("alphaCutoff").boolean("doubleSided");
  material.one_of("alphaMode", {"OPAQUE", "MASK", "BLEND"});
  material.with("pbrMetallicRoughness", [](const Item& pbr) {
    pbr.numbers("baseColorFactor", 4).number("metallicFactor").number("roughnessFactor");
    pbr.with("baseColorTexture", check_texture_info).with("metallicRoughnessTexture", check_texture_info);
  });
  for (const char* key : {"normalTexture", "occlusionTexture", "emissiveTexture"}) {
    material.with(key, check_texture_info);
  }
  for (const MaterialExtensionKind& kind : material_extensions()) {
    material.extension(std::string(kind.name).c_str(), [&](const Item& e) { check_extension(e, kind); });
  }
  material.with("extensions", [&](const Item& extensions) {
    for (const auto& [name, value] : extensions.value().items()) {
      if (!value.is_object())
        material.source().fail(extensions.place_of(name.c_str()), "an object", shown(value));
    }
  });
}

void check_primitive(const Item& primitive) {
  primitive.required("attributes").index_map("attributes", "accessors").index("indices", "accessors");
  primitive.index("material", "materials").size("mode", 0, 6);
  bool draco = false;
  primitive.extension("KHR_draco_mesh_compression", [&](const Item& e) {
    draco = true;
    e.required("bufferView").index("bufferView", "bufferViews").required("attributes");
    for (const auto& [name, value] : e.object("attributes").value().items()) {
      e.object("attributes").size(name.c_str(), 0, kMaxInt);
    }
  });
  if (primitive.has("indices") && !draco) {
    const std::size_t i = primitive.value()["indices"].get<std::size_t>();
    const Json& accessor = primitive.document()["accessors"][i];
    if (!accessor.is_object() || !accessor.contains("bufferView")) {
      primitive.source().fail("/accessors/" + std::to_string(i), "\"bufferView\", as for all indices",
                              "an accessor without it");
    }
  }
}

void check_node(const Item& node) {
  node.index("mesh", "meshes").indices("children", "nodes");
  node.numbers("matrix", 16).numbers("rotation", 4).numbers("scale", 3).numbers("translation", 3);
}

/// extras may hold anything: nothing reads them, and copies of them would only cost memory. null counts as
/// absent here, but not to tinygltf.
void drop_extras_and_nulls(Json& value) {
  if (value.is_object()) {
    value.erase("extras");
    for (auto it = value.begin(); it != value.end();) it = it->is_null() ? value.erase(it) : std::next(it);
  }
  if (value.is_structured()) {
    for (Json& child : value) drop_extras_and_nulls(child);
  }
}

void note_what_is_left_out(const Item& root) {
  Notes& notes = root.source().notes;
  const auto any = [&](const char* key) { return root.has(key) && !root.value()[key].empty(); };
  if (any("animations")) add_info(notes, "animation", "/animations", "animations are left out");
  if (any("skins")) add_info(notes, "skin", "/skins", "skins are left out: the mesh keeps its default pose");
  if (any("cameras")) add_info(notes, "camera", "/cameras", "cameras are left out");
  bool has_targets = false;
  root.each("meshes", [&](const Item& mesh) {
    mesh.each("primitives", [&](const Item& primitive) { has_targets |= primitive.has("targets"); });
  });
  if (has_targets) {
    add_info(notes, "morph-targets", "/meshes",
             "morph targets are left out: the mesh keeps its default pose");
  }
}

}  // namespace

void check_document(const Source& source, Json& document) {
  drop_extras_and_nulls(document);
  const Item root(source, document, document, "");
  check_asset(root);
  check_extensions(root);
  root.each("buffers", [](const Item& b) { b.required("byteLength").size("byteLength").string("uri"); });
  root.each("bufferViews", check_buffer_view);
  root.each("accessors", check_accessor);
  root.each("images", check_image);
  root.each("samplers", check_sampler);
  root.each("textures", check_texture);
  root.each("materials", check_material);
  root.each("meshes",
            [](const Item& mesh) { mesh.required("primitives").each("primitives", check_primitive); });
  root.each("nodes", check_node);
  root.each("scenes", [](const Item& scene) { scene.indices("nodes", "nodes"); });
  root.index("scene", "scenes");
  note_what_is_left_out(root);
}

}  // namespace texmesh::gltf
