#include "stages/scales/scale_materials.h"

#include <algorithm>
#include <array>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "format/container/layout.h"
#include "stages/gltf/glb_writer.h"
#include "stages/image/png_writer.h"
#include "stages/jpeg/jpeg.h"

namespace texmesh {
namespace {

using Json = GlbWriter::Json;
constexpr std::uint64_t kMaxPreviewPixels = 1u << 24;

std::vector<std::uint8_t> combine(const Pixels& colour, const Pixels& alpha) {
  Pixels out{colour.width_px, colour.height_px, 4, {}};
  out.data.reserve(std::size_t{4} * colour.width_px * colour.height_px);
  for (std::uint32_t y = 0; y < colour.height_px; ++y)
    for (std::uint32_t x = 0; x < colour.width_px; ++x) {
      const std::uint8_t* c = colour.at(x, y);
      // The two previews may have different sizes: each is as fine as its bytes allow.
      const auto ax = static_cast<std::uint32_t>(std::uint64_t{x} * alpha.width_px / colour.width_px);
      const auto ay = static_cast<std::uint32_t>(std::uint64_t{y} * alpha.height_px / colour.height_px);
      for (std::uint32_t k = 0; k < 3; ++k) out.data.push_back(c[colour.channels == 1 ? 0 : k]);
      out.data.push_back(*alpha.at(ax, ay));
    }
  return write_png(out);
}

Json vector_json(std::initializer_list<float> values) {
  Json out = Json::array();
  for (float x : values) out.push_back(GlbWriter::shortest(x));
  return out;
}

float unit(float x) { return std::clamp(x, 0.0f, 1.0f); }

/// Hands out texture and sampler indices, equal ones once.
class TextureTable {
 public:
  TextureTable(GlbWriter& writer, const std::vector<PreviewImage>& previews, PreviewForm form,
               std::array<bool, 2> has_uv)
      : writer_(writer), has_uv_(has_uv) {
    for (const PreviewImage& p : previews) {
      image_of_[p.image] = writer_.array("images").size();
      Json image{{"name", "texture/" + std::to_string(p.image)}, {"mimeType", p.mime_type}};
      if (form == PreviewForm::kRelative && p.mime_type == std::string_view("image/jpeg"))
        image["uri"] = "../" + preview_path(p.plane);
      else
        image["bufferView"] = writer_.add_view(p.bytes);
      writer_.array("images").push_back(std::move(image));
    }
  }

  /// A textureInfo, or null when the texture cannot be shown.
  Json info(const TextureRef& ref) {
    if (!ref.used() || ref.texcoord > 1 || !has_uv_[ref.texcoord]) return nullptr;
    const auto image = image_of_.find(static_cast<std::uint32_t>(ref.image));
    if (image == image_of_.end()) return nullptr;
    Json out{{"index", texture(image->second, sampler(ref))}};
    if (ref.texcoord != 0) out["texCoord"] = ref.texcoord;
    if (!ref.transform.is_identity()) {
      Json transform;
      if (ref.transform.offset != Vec2f{0, 0})
        transform["offset"] = vector_json({ref.transform.offset.x, ref.transform.offset.y});
      if (ref.transform.rotation != 0) transform["rotation"] = GlbWriter::shortest(ref.transform.rotation);
      if (ref.transform.scale != Vec2f{1, 1})
        transform["scale"] = vector_json({ref.transform.scale.x, ref.transform.scale.y});
      out["extensions"]["KHR_texture_transform"] = transform;
      writer_.use_extension("KHR_texture_transform", false);
    }
    return out;
  }

 private:
  std::size_t sampler(const TextureRef& ref) {
    const auto [it, fresh] =
        samplers_.try_emplace({static_cast<int>(ref.wrap_s), static_cast<int>(ref.wrap_t), ref.nearest,
                               static_cast<int>(ref.minification)},
                              samplers_.size());
    if (fresh) {
      constexpr int kWrap[] = {10497, 33071, 33648};
      constexpr int kMinFilter[] = {9987, 9728, 9729, 9984, 9985, 9986};  // by Minification
      writer_.array("samplers")
          .push_back({{"magFilter", ref.nearest ? 9728 : 9729},
                      {"minFilter", kMinFilter[static_cast<int>(ref.minification)]},
                      {"wrapS", kWrap[static_cast<int>(ref.wrap_s)]},
                      {"wrapT", kWrap[static_cast<int>(ref.wrap_t)]}});
    }
    return it->second;
  }
  std::size_t texture(std::size_t image, std::size_t sampler) {
    const auto [it, fresh] = textures_.try_emplace({image, sampler}, textures_.size());
    if (fresh) writer_.array("textures").push_back({{"sampler", sampler}, {"source", image}});
    return it->second;
  }
  GlbWriter& writer_;
  std::array<bool, 2> has_uv_;
  std::map<std::uint32_t, std::size_t> image_of_;
  std::map<std::array<int, 4>, std::size_t> samplers_;
  std::map<std::array<std::size_t, 2>, std::size_t> textures_;
};

/// As the source had it, less the textures that cannot be shown.
Json extension_json(const MaterialExtension& extension, TextureTable& textures) {
  Json out = Json::object();
  for (const ExtensionFactor& factor : extension.factors) {
    Json values = Json::array();
    for (float x : factor.values) values.push_back(GlbWriter::shortest(x));
    out[factor.key] = values.size() == 1 ? values[0] : values;
  }
  for (const ExtensionTexture& t : extension.textures) {
    Json info = textures.info(t.texture);
    if (info.is_null()) continue;
    if (t.scale != 1) info["scale"] = GlbWriter::shortest(t.scale);
    out[t.key] = std::move(info);
  }
  return out;
}

Json material_json(const Material& m, TextureTable& textures, GlbWriter& writer) {
  Json out;
  if (!m.name.empty()) out["name"] = m.name;
  Json pbr;
  pbr["baseColorFactor"] = vector_json(
      {unit(m.base_colour.x), unit(m.base_colour.y), unit(m.base_colour.z), unit(m.base_colour.w)});
  if (Json t = textures.info(m.base_colour_texture); !t.is_null()) pbr["baseColorTexture"] = t;
  pbr["metallicFactor"] = GlbWriter::shortest(unit(m.metallic));
  pbr["roughnessFactor"] = GlbWriter::shortest(unit(m.roughness));
  if (Json t = textures.info(m.metallic_roughness_texture); !t.is_null()) pbr["metallicRoughnessTexture"] = t;
  out["pbrMetallicRoughness"] = pbr;
  if (Json t = textures.info(m.normal_texture); !t.is_null()) {
    if (m.normal_scale != 1) t["scale"] = GlbWriter::shortest(m.normal_scale);
    out["normalTexture"] = t;
  }
  if (Json t = textures.info(m.occlusion_texture); !t.is_null()) {
    if (m.occlusion_strength != 1) t["strength"] = GlbWriter::shortest(unit(m.occlusion_strength));
    out["occlusionTexture"] = t;
  }
  if (Json t = textures.info(m.emissive_texture); !t.is_null()) out["emissiveTexture"] = t;
  if (m.emissive != Vec3f{})
    out["emissiveFactor"] = vector_json({unit(m.emissive.x), unit(m.emissive.y), unit(m.emissive.z)});
  if (m.alpha_mode == AlphaMode::kMask) {
    out["alphaMode"] = "MASK";
    out["alphaCutoff"] = GlbWriter::shortest(std::max(m.alpha_cutoff, 0.0f));
  } else if (m.alpha_mode == AlphaMode::kBlend) {
    out["alphaMode"] = "BLEND";
  }
  if (m.double_sided) out["doubleSided"] = true;
  if (m.unlit) {
    out["extensions"]["KHR_materials_unlit"] = Json::object();
    writer.use_extension("KHR_materials_unlit", false);
  }
  for (const MaterialExtension& extension : m.extensions) {
    out["extensions"][extension.name] = extension_json(extension, textures);
    writer.use_extension(extension.name, false);
  }
  return out;
}

}  // namespace

std::vector<PreviewImage> preview_images(const Fragments& fragments, const Previews& previews) {
  std::vector<PreviewImage> out;
  for (std::size_t i = 0; i < fragments.planes.size(); ++i) {
    const TexturePlane& plane = fragments.planes[i];
    if (plane.role == TextureRole::kAlpha || plane.mip > 0) continue;
    PreviewImage image{plane.image, static_cast<std::uint32_t>(i), "image/jpeg", previews.planes.at(i).file};
    for (std::size_t j = 0; j < fragments.planes.size(); ++j) {
      if (fragments.planes[j].image != plane.image || fragments.planes[j].role != TextureRole::kAlpha ||
          fragments.planes[j].mip > 0)
        continue;
      image.mime_type = "image/png";
      image.bytes = combine(decode_jpeg(previews.planes.at(i).file, kMaxPreviewPixels),
                            decode_jpeg(previews.planes.at(j).file, kMaxPreviewPixels));
    }
    out.push_back(std::move(image));
  }
  return out;
}

void write_materials(GlbWriter& writer, const std::vector<Material>& materials,
                     const std::vector<PreviewImage>& previews, PreviewForm form, bool has_uv0,
                     bool has_uv1) {
  TextureTable textures(writer, previews, form, {has_uv0, has_uv1});
  for (const Material& m : materials) writer.array("materials").push_back(material_json(m, textures, writer));
}

}  // namespace texmesh
