#include <tiny_gltf.h>

#include <nlohmann/json.hpp>

#include "format/model/material_extensions.h"
#include "pipeline/import/gltf/import_gltf_parts.h"
#include "pipeline/import/import_images.h"
#include "pipeline/import/material_images.h"
#include "pipeline/import/text_scan.h"

namespace texmesh {
namespace {

constexpr std::int32_t kNotRead = -2;

const GltfJson* member(const GltfJson& object, const char* key) {
  const auto it = object.find(key);
  return it == object.end() || it->is_null() ? nullptr : &*it;
}

const GltfJson* extension(const GltfJson& object, const char* name) {
  const GltfJson* e = member(object, "extensions");
  return e && e->is_object() ? member(*e, name) : nullptr;
}

bool same_place(const TextureRef& a, const TextureRef& b) {
  return a.texcoord == b.texcoord && a.transform == b.transform;
}

float to_unit(double v) { return static_cast<float>(std::clamp(v, 0.0, 1.0)); }

/// Numbers beyond a float would become infinities, which no JSON can hold later.
float to_float(double v) { return static_cast<float>(std::clamp(v, -1e30, 1e30)); }

Wrap wrap_of(int mode) {
  if (mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE) return Wrap::kClamp;
  return mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ? Wrap::kMirror : Wrap::kRepeat;
}

/// Absent is the viewer's choice: glTF's viewers take mip levels and blend them.
Minification minification_of(int filter) {
  switch (filter) {
    case TINYGLTF_TEXTURE_FILTER_NEAREST:
      return Minification::kNearest;
    case TINYGLTF_TEXTURE_FILTER_LINEAR:
      return Minification::kLinear;
    case TINYGLTF_TEXTURE_FILTER_NEAREST_MIPMAP_NEAREST:
      return Minification::kNearestMipmapNearest;
    case TINYGLTF_TEXTURE_FILTER_LINEAR_MIPMAP_NEAREST:
      return Minification::kLinearMipmapNearest;
    case TINYGLTF_TEXTURE_FILTER_NEAREST_MIPMAP_LINEAR:
      return Minification::kNearestMipmapLinear;
    default:
      return Minification::kLinearMipmapLinear;
  }
}

class MaterialReader {
 public:
  MaterialReader(const Source& source, const GltfJson& document, const tinygltf::Model& structure,
                 Buffers& buffers, Model& model, TiledImages& tiled)
      : source_(source),
        document_(document),
        structure_(structure),
        buffers_(buffers),
        model_(model),
        tiled_(tiled) {
    if (const GltfJson* images = member(document_, "images")) image_of_.assign(images->size(), kNotRead);
  }
  /// The next material of the model, which the mesh knows already.
  Material read(std::size_t index);

 private:
  std::int32_t image(std::size_t index);
  std::int32_t read_image(std::size_t index);
  std::int32_t ktx2_image(std::size_t index, bool has_other, const std::string& place);
  std::int32_t image_of_texture(std::size_t index);
  TextureRef texture(const GltfJson* info, const std::string& place);
  void read_specular_glossiness(const GltfJson& e, const std::string& place, Material& out);
  MaterialExtension read_extension(const GltfJson& e, const MaterialExtensionKind& kind,
                                   const std::string& place);
  void read_extensions(const GltfJson& material, const std::string& place, Material& out);

  const Source& source_;
  const GltfJson& document_;
  const tinygltf::Model& structure_;
  Buffers& buffers_;
  Model& model_;
  TiledImages& tiled_;
  std::vector<std::int32_t> image_of_;  // per glTF image: index in model_.images, -1 missing, kNotRead
};

std::int32_t MaterialReader::read_image(std::size_t index) {
  const GltfJson& declared = document_["images"][index];
  const std::string place = "/images/" + std::to_string(index);
  if (model_.images.size() >= static_cast<std::size_t>(source_.options.max_images)) {
    source_.fail(place, "at most " + std::to_string(source_.options.max_images) + " images", "more");
  }
  const GltfJson* name_value = member(declared, "name");
  std::string name = name_value && name_value->is_string() ? name_value->get<std::string>() : "";
  if (name.empty()) name = "image " + std::to_string(index);
  if (const GltfJson* view = member(declared, "bufferView")) {
    const ByteSpan bytes = buffers_.view(view->get<std::size_t>(), place);
    return add_image_bytes(model_, name, {bytes.begin(), bytes.end()}, source_.file, place, source_.options);
  }
  const std::string uri = declared["uri"].get<std::string>();
  if (is_data_uri(uri)) {
    return add_image_bytes(model_, name,
                           decode_data_uri(uri, static_cast<std::uint64_t>(source_.options.max_file_bytes),
                                           source_.file, place + "/uri"),
                           source_.file, place, source_.options);
  }
  try {
    return tiled_.add_image(model_, {uri, "", true}, source_.resolver, source_.file, place + "/uri",
                            source_.options);
  } catch (const ResourceError&) {
    throw;
  } catch (const InputError& e) {
    if (e.file() == source_.file) throw;
    source_.fail(place + "/uri", e.expected(),
                 e.found() + " (" + e.file() + ")");  // the resolver knows the name alone
  }
}

std::int32_t MaterialReader::image(std::size_t index) {
  if (image_of_[index] == kNotRead) image_of_[index] = read_image(index);
  return image_of_[index];
}

/// -1 with a note where the file cannot be read and the texture has another image.
std::int32_t MaterialReader::ktx2_image(std::size_t index, bool has_other, const std::string& place) {
  if (!has_other) return image(index);
  try {
    return image(index);
  } catch (const InputError& e) {
    source_.note_once(Severity::kWarning, "ktx2-left-out", place,
                      "another image is taken for that of KHR_texture_basisu: " + std::string(e.what()));
    return -1;
  }
}

/// The KTX2 image where there is one, else (or when its file is missing or cannot be read) the AVIF one, the
/// WebP one, the plain one.
std::int32_t MaterialReader::image_of_texture(std::size_t index) {
  const GltfJson& texture = document_["textures"][index];
  const std::string place = "/textures/" + std::to_string(index);
  const auto source_of = [&](const char* name) {
    const GltfJson* e = extension(texture, name);
    return e ? member(*e, "source") : nullptr;
  };
  const GltfJson *ktx2 = source_of("KHR_texture_basisu"), *avif = source_of("EXT_texture_avif"),
                 *webp = source_of("EXT_texture_webp");
  const int source = structure_.textures[index].source;
  std::int32_t found = -1;
  if (ktx2) found = ktx2_image(ktx2->get<std::size_t>(), avif || webp || source >= 0, place);
  if (found < 0 && avif) found = image(avif->get<std::size_t>());
  if (found < 0 && webp) found = image(webp->get<std::size_t>());
  if (found < 0 && source >= 0) found = image(static_cast<std::size_t>(source));
  if (found < 0 && source < 0 && !webp && !avif && !ktx2) {
    source_.note_once(Severity::kWarning, "missing-texture", place,
                      "a texture without an image of a kind that texmesh reads is left out");
  }
  return found;
}

TextureRef MaterialReader::texture(const GltfJson* info, const std::string& place) {
  TextureRef ref;
  if (!info) return ref;
  const auto index = (*info)["index"].get<std::size_t>();
  std::uint64_t texcoord = info->value("texCoord", std::uint64_t{0});
  if (const GltfJson* t = extension(*info, "KHR_texture_transform")) {
    const auto pair = [&](const char* key, Vec2f otherwise) {
      const GltfJson* v = member(*t, key);
      return v ? Vec2f{to_float((*v)[0].get<double>()), to_float((*v)[1].get<double>())} : otherwise;
    };
    ref.transform.offset = pair("offset", {0, 0});
    ref.transform.scale = pair("scale", {1, 1});
    ref.transform.rotation = to_float(t->value("rotation", 0.0));
    texcoord = t->value("texCoord", texcoord);
  }
  if (texcoord > 1) {
    source_.note_once(
        Severity::kWarning, "unsupported-texcoord", place,
        "a texture on TEXCOORD_" + std::to_string(texcoord) + " is left out; only 0 and 1 are read");
    return {};
  }
  ref.texcoord = static_cast<std::uint8_t>(texcoord);
  if (const int s = structure_.textures[index].sampler; s >= 0) {
    const tinygltf::Sampler& sampler = structure_.samplers[static_cast<std::size_t>(s)];
    ref.wrap_s = wrap_of(sampler.wrapS);
    ref.wrap_t = wrap_of(sampler.wrapT);
    ref.nearest = sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST;
    ref.minification = minification_of(sampler.minFilter);
  }
  ref.image = image_of_texture(index);
  if (ref.image < 0) return {};
  return ref;
}

/// The older PBR model, which most viewers have dropped, becomes the newer one.
void MaterialReader::read_specular_glossiness(const GltfJson& e, const std::string& place, Material& out) {
  source_.note_once(Severity::kInfo, "specular-glossiness", place,
                    "KHR_materials_pbrSpecularGlossiness is converted to metallic-roughness");
  const auto factor = [&](const char* key, std::size_t i) {
    const GltfJson* f = member(e, key);
    return f ? to_unit((*f)[i].get<double>()) : 1.0f;
  };
  SpecularGlossiness factors;
  for (int k = 0; k < 3; ++k) {
    factors.diffuse[k] = factor("diffuseFactor", static_cast<std::size_t>(k));
    factors.specular[k] = factor("specularFactor", static_cast<std::size_t>(k));
  }
  factors.glossiness = to_unit(e.value("glossinessFactor", 1.0));
  const TextureRef diffuse = texture(member(e, "diffuseTexture"), place + "/diffuseTexture");
  TextureRef specular = texture(member(e, "specularGlossinessTexture"), place + "/specularGlossinessTexture");
  if (diffuse.used() && specular.used() && !same_place(diffuse, specular)) {
    source_.note_once(Severity::kWarning, "specular-glossiness-mean", place,
                      "specularGlossinessTexture lies elsewhere than diffuseTexture; its mean is taken");
    factors = mean_of_specular(model_, specular, model_.materials.size(), factors, source_.context);
    specular = {};
  }
  out.base_colour_texture = out.metallic_roughness_texture = {};
  if (!diffuse.used() && !specular.used()) {
    const MetallicRoughness m = metallic_roughness_of(factors);
    out.base_colour = {m.base_colour.x, m.base_colour.y, m.base_colour.z, factor("diffuseFactor", 3)};
    out.metallic = m.metallic;
    out.roughness = m.roughness;
    return;
  }
  const MetallicRoughnessImages images =
      convert_specular_glossiness(model_, {diffuse.image, specular.image}, factors);
  out.base_colour_texture = out.metallic_roughness_texture = diffuse.used() ? diffuse : specular;
  out.base_colour_texture.image = images.base_colour;
  out.metallic_roughness_texture.image = images.metallic_roughness;
  out.base_colour = {1, 1, 1, factor("diffuseFactor", 3)};
  out.metallic = out.roughness = 1;
}

MaterialExtension MaterialReader::read_extension(const GltfJson& e, const MaterialExtensionKind& kind,
                                                 const std::string& place) {
  MaterialExtension out;
  out.name = kind.name;
  for (const ExtensionFactorKind& f : kind.factors) {
    const GltfJson* value = member(e, std::string(f.key).c_str());
    if (!value) continue;
    ExtensionFactor factor{std::string(f.key), {}};
    for (int i = 0; i < f.components; ++i) {
      const GltfJson& number = f.components == 1 ? *value : (*value)[static_cast<std::size_t>(i)];
      factor.values.push_back(to_float(std::clamp(number.get<double>(), f.lowest, f.highest)));
    }
    out.factors.push_back(std::move(factor));
  }
  for (const ExtensionTextureKind& t : kind.textures) {
    const std::string key(t.key);
    const GltfJson* info = member(e, key.c_str());
    const TextureRef ref = texture(info, place + "/" + key);
    if (ref.used()) out.textures.push_back({key, ref, to_float(info->value("scale", 1.0))});
  }
  return out;
}

/// Keys of the textures that `value` names: "brightnessTexture, maskTexture".
std::string texture_names(const GltfJson& value) {
  std::string names;
  for (const auto& [key, v] : value.items())
    if (v.is_object() && v.contains("index")) names += (names.empty() ? "" : ", ") + key;
  return names;
}

/// Extensions that texmesh knows become part of the material; of others a note says what is lost.
void MaterialReader::read_extensions(const GltfJson& material, const std::string& place, Material& out) {
  const GltfJson* extensions = member(material, "extensions");
  if (!extensions) return;
  for (const auto& [name, value] : extensions->items()) {
    if (name == "KHR_materials_unlit") continue;
    if (const MaterialExtensionKind* kind = find_material_extension(name)) {
      if (kind->converted) continue;
      out.extensions.push_back(read_extension(value, *kind, place + "/extensions/" + name));
      continue;
    }
    const std::string textures = texture_names(value);
    const std::string text =
        name + " is left out" + (textures.empty() ? "" : ", and with it the textures " + textures);
    add_once(source_.notes, textures.empty() ? Severity::kInfo : Severity::kWarning, "unknown-extension",
             place, text);
  }
}

Material MaterialReader::read(std::size_t index) {
  const GltfJson& declared = document_["materials"][index];
  const tinygltf::Material& m = structure_.materials[index];
  const std::string place = "/materials/" + std::to_string(index);
  const auto texture_of = [&](const GltfJson* holder, const char* key) {
    return texture(holder ? member(*holder, key) : nullptr, place + "/" + key);
  };
  Material out;
  out.name = m.name;
  const auto& base = m.pbrMetallicRoughness.baseColorFactor;
  out.base_colour = {to_unit(base[0]), to_unit(base[1]), to_unit(base[2]), to_unit(base[3])};
  out.metallic = to_unit(m.pbrMetallicRoughness.metallicFactor);
  out.roughness = to_unit(m.pbrMetallicRoughness.roughnessFactor);
  out.emissive = {to_unit(m.emissiveFactor[0]), to_unit(m.emissiveFactor[1]), to_unit(m.emissiveFactor[2])};
  out.normal_scale = to_float(m.normalTexture.scale);
  out.occlusion_strength = to_unit(m.occlusionTexture.strength);
  if (m.alphaMode == "MASK") out.alpha_mode = AlphaMode::kMask;
  if (m.alphaMode == "BLEND") out.alpha_mode = AlphaMode::kBlend;
  out.alpha_cutoff = to_float(m.alphaCutoff);
  out.double_sided = m.doubleSided;
  out.unlit = extension(declared, "KHR_materials_unlit") != nullptr;
  const GltfJson* specular = extension(declared, "KHR_materials_pbrSpecularGlossiness");
  if (const GltfJson* pbr = member(declared, "pbrMetallicRoughness"); pbr && !specular) {
    out.base_colour_texture = texture_of(pbr, "baseColorTexture");
    out.metallic_roughness_texture = texture_of(pbr, "metallicRoughnessTexture");
  }
  if (specular) read_specular_glossiness(*specular, place, out);
  out.normal_texture = texture_of(&declared, "normalTexture");
  out.occlusion_texture = texture_of(&declared, "occlusionTexture");
  out.emissive_texture = texture_of(&declared, "emissiveTexture");
  read_extensions(declared, place, out);
  return out;
}

}  // namespace

void read_materials(const Source& source, const GltfJson& document, const tinygltf::Model& structure,
                    Buffers& buffers, const std::vector<int>& used, Model& model) {
  TiledImages tiled;
  MaterialReader reader(source, document, structure, buffers, model, tiled);
  for (const int m : used) {
    source.context.check_cancelled();
    model.materials.push_back(m < 0 ? Material{} : reader.read(static_cast<std::size_t>(m)));
  }
  tiled.split(model, source.resolver, source.file, source.options);
}

}  // namespace texmesh
