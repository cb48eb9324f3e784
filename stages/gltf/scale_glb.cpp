#include "stages/gltf/scale_glb.h"

#include "format/split/split_stream.h"

namespace texmesh {
namespace {

float unit(float x) { return std::clamp(x, 0.0f, 1.0f); }

/// Hands out texture and sampler indices, equal ones once.
class TextureTable {
 public:
  TextureTable(GlbWriter& writer, const GlbImages& images, std::array<bool, 2> has_uv)
      : writer_(writer), has_uv_(has_uv) {
    for (const GlbImage& p : images) {
      image_of_[p.image] = writer_.array("images").size();
      GltfJson image{{"name", "texture/" + std::to_string(p.image)}, {"mimeType", p.mime_type}};
      if (!p.uri.empty())
        image["uri"] = p.uri;
      else
        image["bufferView"] = writer_.add_view(p.bytes);
      writer_.array("images").push_back(std::move(image));
    }
  }

  /// A textureInfo, or null when the texture cannot be shown.
  GltfJson info(const TextureRef& ref) {
    if (!ref.used() || ref.texcoord > 1 || !has_uv_[ref.texcoord]) return nullptr;
    const auto image = image_of_.find(static_cast<std::uint32_t>(ref.image));
    if (image == image_of_.end()) return nullptr;
    GltfJson out{{"index", texture(image->second, sampler(ref))}};
    if (ref.texcoord != 0) out["texCoord"] = ref.texcoord;
    if (!ref.transform.is_identity()) {
      GltfJson transform;
      if (ref.transform.offset != Vec2f{0, 0})
        transform["offset"] = GlbWriter::shortest({ref.transform.offset.x, ref.transform.offset.y});
      if (ref.transform.rotation != 0) transform["rotation"] = GlbWriter::shortest(ref.transform.rotation);
      if (ref.transform.scale != Vec2f{1, 1})
        transform["scale"] = GlbWriter::shortest({ref.transform.scale.x, ref.transform.scale.y});
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
    if (!fresh) return it->second;
    GltfJson texture{{"sampler", sampler}};
    if (writer_.array("images")[image]["mimeType"] == "image/webp") {
      texture["extensions"]["EXT_texture_webp"]["source"] = image;
      writer_.use_extension("EXT_texture_webp", true);
    } else {
      texture["source"] = image;
    }
    writer_.array("textures").push_back(std::move(texture));
    return it->second;
  }
  GlbWriter& writer_;
  std::array<bool, 2> has_uv_;
  std::map<std::uint32_t, std::size_t> image_of_;
  std::map<std::array<int, 4>, std::size_t> samplers_;
  std::map<std::array<std::size_t, 2>, std::size_t> textures_;
};

/// As the source had it, less the textures that cannot be shown.
GltfJson extension_json(const MaterialExtension& extension, TextureTable& textures) {
  GltfJson out = GltfJson::object();
  for (const ExtensionFactor& factor : extension.factors) {
    GltfJson values = GltfJson::array();
    for (float x : factor.values) values.push_back(GlbWriter::shortest(x));
    out[factor.key] = values.size() == 1 ? values[0] : values;
  }
  for (const ExtensionTexture& t : extension.textures) {
    GltfJson info = textures.info(t.texture);
    if (info.is_null()) continue;
    if (t.scale != 1) info["scale"] = GlbWriter::shortest(t.scale);
    out[t.key] = std::move(info);
  }
  return out;
}

GltfJson material_json(const Material& m, TextureTable& textures, GlbWriter& writer) {
  GltfJson out;
  if (!m.name.empty()) out["name"] = m.name;
  GltfJson pbr;
  pbr["baseColorFactor"] = GlbWriter::shortest(
      {unit(m.base_colour.x), unit(m.base_colour.y), unit(m.base_colour.z), unit(m.base_colour.w)});
  if (GltfJson t = textures.info(m.base_colour_texture); !t.is_null()) pbr["baseColorTexture"] = t;
  pbr["metallicFactor"] = GlbWriter::shortest(unit(m.metallic));
  pbr["roughnessFactor"] = GlbWriter::shortest(unit(m.roughness));
  if (GltfJson t = textures.info(m.metallic_roughness_texture); !t.is_null())
    pbr["metallicRoughnessTexture"] = t;
  out["pbrMetallicRoughness"] = pbr;
  if (GltfJson t = textures.info(m.normal_texture); !t.is_null()) {
    if (m.normal_scale != 1) t["scale"] = GlbWriter::shortest(m.normal_scale);
    out["normalTexture"] = t;
  }
  if (GltfJson t = textures.info(m.occlusion_texture); !t.is_null()) {
    if (m.occlusion_strength != 1) t["strength"] = GlbWriter::shortest(unit(m.occlusion_strength));
    out["occlusionTexture"] = t;
  }
  if (GltfJson t = textures.info(m.emissive_texture); !t.is_null()) out["emissiveTexture"] = t;
  if (m.emissive != Vec3f{})
    out["emissiveFactor"] = GlbWriter::shortest({unit(m.emissive.x), unit(m.emissive.y), unit(m.emissive.z)});
  if (m.alpha_mode == AlphaMode::kMask) {
    out["alphaMode"] = "MASK";
    out["alphaCutoff"] = GlbWriter::shortest(std::max(m.alpha_cutoff, 0.0f));
  } else if (m.alpha_mode == AlphaMode::kBlend) {
    out["alphaMode"] = "BLEND";
  }
  if (m.double_sided) out["doubleSided"] = true;
  if (m.unlit) {
    out["extensions"]["KHR_materials_unlit"] = GltfJson::object();
    writer.use_extension("KHR_materials_unlit", false);
  }
  for (const MaterialExtension& extension : m.extensions) {
    out["extensions"][extension.name] = extension_json(extension, textures);
    writer.use_extension(extension.name, false);
  }
  return out;
}

/// Materials, textures, samplers and images of the document. Textures whose texture coordinates or previews
/// do not exist are left out. Factors are clipped to the ranges of glTF.
void write_materials(GlbWriter& writer, const std::vector<Material>& materials, const GlbImages& images,
                     bool has_uv0, bool has_uv1) {
  TextureTable textures(writer, images, {has_uv0, has_uv1});
  for (const Material& m : materials) writer.array("materials").push_back(material_json(m, textures, writer));
}

bool uses_texcoord(const std::vector<Material>& materials, int set) {
  bool used = false;
  for (const Material& m : materials)
    for_each_texture(m, [&](const TextureRef& t) { used = used || (t.used() && t.texcoord == set); });
  return used;
}

/// Numbers wedges in the order of their use. Where parts are merged a wedge of two of them becomes two.
void number_wedges(ScalePrimitive& p, const std::vector<std::uint16_t>& part,
                   std::vector<std::uint32_t>& index) {
  std::map<std::pair<std::uint32_t, std::uint16_t>, std::uint32_t> shared;
  for (std::size_t i = 0; i < p.indices.size(); ++i) {
    const std::uint32_t wedge = p.indices[i];
    const std::uint16_t of = part.empty() ? std::uint16_t{0} : part[i / 3];
    std::uint32_t* at = &index[wedge];
    if (*at != kNoIndex && !part.empty() && p.wedge_part[*at] != of)
      at = &shared.try_emplace({wedge, of}, kNoIndex).first->second;
    if (*at == kNoIndex) {
      *at = static_cast<std::uint32_t>(p.wedges.size());
      p.wedges.push_back(wedge);
      if (!part.empty()) p.wedge_part.push_back(of);
    }
    p.indices[i] = *at;
  }
  for (std::uint32_t w : p.wedges) index[w] = kNoIndex;
}

/// One primitive per part and material, without triangles that have two corners in one place of the grid.
std::vector<ScalePrimitive> split_primitives(const Mesh& mesh, const NestedScale& scale,
                                             const QuantisationGrid& grid) {
  std::map<std::array<std::uint16_t, 2>, std::pair<ScalePrimitive, std::vector<std::uint16_t>>> primitives;
  const bool merged = parts_merged(mesh);
  for (std::size_t i = 0; i < scale.triangles.size(); ++i) {
    const Triangle& t = scale.triangles[i];
    if (grid.bits > 0) {
      Vec3f at[3];
      for (std::size_t k = 0; k < 3; ++k) at[k] = grid.place(mesh.positions[mesh.wedge_position[t[k]]]);
      if (is_flat(at[0], at[1], at[2])) continue;
    }
    const std::uint32_t source = scale.triangle_source[i];
    const std::uint16_t part = mesh.triangle_part[source];
    const std::array<std::uint16_t, 2> key{merged ? std::uint16_t{0} : part, mesh.triangle_material[source]};
    auto& [p, parts] = primitives[key];
    p.part = key[0], p.material = key[1];
    for (std::uint32_t w : t) p.indices.push_back(w);
    if (merged) parts.push_back(part);
  }
  std::vector<ScalePrimitive> out;
  std::vector<std::uint32_t> index(mesh.wedge_count(), kNoIndex);
  for (auto& [key, value] : primitives) {
    number_wedges(value.first, value.second, index);
    out.push_back(std::move(value.first));
  }
  return out;
}

/// Names of the parts that a scale still has, and their numbers in wedge_part: most of a many-part model's
/// are gone from its coarse scales, whose names would cost a hundred times their meshes.
std::vector<std::string> name_merged_parts(const Mesh& mesh, std::vector<ScalePrimitive>& primitives) {
  std::vector<std::uint16_t> number(mesh.part_names.size(), 0);
  for (const ScalePrimitive& p : primitives)
    for (std::uint16_t part : p.wedge_part) number.at(part) = 1;
  std::vector<std::string> names;
  for (std::size_t part = 0; part < number.size(); ++part) {
    if (number[part] == 0) continue;
    number[part] = static_cast<std::uint16_t>(names.size());
    names.push_back(mesh.part_names[part]);
  }
  for (ScalePrimitive& p : primitives)
    for (std::uint16_t& part : p.wedge_part) part = number[part];
  return names;
}

std::string node_name(const Mesh& mesh, std::uint16_t part) {
  return parts_merged(mesh) ? "parts" : mesh.part_names.at(part);
}

GltfJson node_json(const ScaleCoding& coding, std::uint16_t part) {
  GltfJson node{{"name", node_name(coding.mesh, part)}};
  if (coding.positions_are_indices()) {
    const Vec3f origin = coding.position.origin;
    const float step = coding.position.step();
    node["translation"] = {origin.x, origin.y, origin.z};
    node["scale"] = {step, step, step};
  }
  return node;
}

}  // namespace

double largest_texture_px(const std::vector<Material>& materials, const std::vector<Image>& images, int set) {
  constexpr double kUntextured =
      4096;  // coordinates without a texture are kept as if there were one of this size
  double largest = 0;
  for (const Material& m : materials)
    for_each_texture(m, [&](const TextureRef& t) {
      if (!t.used() || t.texcoord != set) return;
      const Image& image = images.at(static_cast<std::size_t>(t.image));
      const double stretch = std::max(std::fabs(t.transform.scale.x), std::fabs(t.transform.scale.y));
      largest = std::max(largest, stretch * std::max(image.width_px, image.height_px));
    });
  return largest > 0 ? largest : kUntextured;
}

bool needs_fine_colours(const std::vector<Vec4f>& colours) {
  auto coarse = [](float x) {
    const float scaled = std::clamp(x, 0.0f, 1.0f) * 255;
    return std::fabs(scaled - std::floor(scaled + 0.5f)) < 1e-3f;
  };
  return !std::all_of(colours.begin(), colours.end(),
                      [&](Vec4f c) { return coarse(c.x) && coarse(c.y) && coarse(c.z) && coarse(c.w); });
}

ScaleCoding make_coding(const Mesh& mesh, const std::vector<Material>& materials,
                        const std::vector<Image>& images, const ScalesOptions& options) {
  constexpr int kDracoBits = 24, kShortBits = 16;  // floats hold no more than 24; an unsigned short 16
  ScaleCoding coding{mesh, options, {}, {}, {false, false}, needs_fine_colours(mesh.colours), {}, {}};
  for (const Material& m : materials) coding.tangents.push_back(needs_tangents(m));
  const bool draco = options.mesh_codec == MeshCodec::kDraco;
  coding.write_uv[1] = !mesh.uv1.empty() && uses_texcoord(materials, 1);
  coding.write_uv[0] = !mesh.uv0.empty();
  if (options.mesh_codec == MeshCodec::kNone) return coding;
  coding.position = position_grid(mesh, options, draco ? kDracoBits : kShortBits);
  for (int set = 0; set < 2; ++set) {
    if (!coding.write_uv[set]) continue;
    QuantisationGrid& grid = coding.uv[set];
    grid = uv_grid(coding.uv_values(set), largest_texture_px(materials, images, set), options,
                   draco ? kDracoBits : kShortBits);
    if (draco) continue;
    const bool unit = grid.bits > 0 && grid.origin.x >= 0 && grid.origin.y >= 0 &&
                      grid.origin.x + grid.range <= 1 && grid.origin.y + grid.range <= 1;
    grid = QuantisationGrid{};
    if (unit) grid.bits = kShortBits;
  }
  return coding;
}

bool parts_merged(const Mesh& mesh) { return mesh.part_names.size() > kMostNodes; }

bool is_flat(Vec3f a, Vec3f b, Vec3f c) { return a == b || b == c || c == a; }

ScaleFile write_scale(const ScaleCoding& coding, const NestedScale& scale,
                      const std::vector<Material>& materials, const GlbImages& images) {
  ScaleFile file;
  file.scale = scale.scale;
  GlbWriter writer;
  int open_part = -1;
  std::vector<ScalePrimitive> primitives = split_primitives(coding.mesh, scale, coding.position);
  const std::vector<std::string> merged_names = name_merged_parts(coding.mesh, primitives);
  const std::size_t nodes = parts_merged(coding.mesh) ? 1 : coding.mesh.part_names.size();
  for (std::size_t part = 0; part < nodes; ++part)
    writer.array("nodes").push_back(node_json(coding, static_cast<std::uint16_t>(part)));
  for (ScalePrimitive& primitive : primitives) {
    const std::uint16_t part = primitive.part, material = primitive.material;
    CodedPrimitive coded = coding.options.mesh_codec == MeshCodec::kDraco
                               ? code_draco(writer, coding, primitive)
                               : code_plain(writer, coding, std::move(primitive));
    coded.json["material"] = material;
    file.triangles += coded.triangles;
    file.vertices += coded.vertices;
    if (open_part != part) {
      open_part = part;
      writer.array("nodes").at(part)["mesh"] = writer.array("meshes").size();
      writer.array("meshes").push_back(
          {{"name", node_name(coding.mesh, part)}, {"primitives", GltfJson::array()}});
      if (parts_merged(coding.mesh)) writer.array("meshes").back()["extras"]["partNames"] = merged_names;
    }
    if (parts_merged(coding.mesh)) {
      coded.json["extensions"]["EXT_mesh_features"]["featureIds"] =
          GltfJson::array({{{"featureCount", merged_names.size()}, {"attribute", 0}, {"label", "part"}}});
      writer.use_extension("EXT_mesh_features", false);
    }
    writer.array("meshes").back()["primitives"].push_back(std::move(coded.json));
  }
  if (file.triangles == 0)
    throw StageError("scales", "scale " + std::to_string(scale.scale), "a triangle with area on the grid",
                     std::to_string(coding.position.bits) + " bits per coordinate collapse all");
  write_materials(writer, materials, images, coding.write_uv[0], coding.write_uv[1]);
  file.glb = writer.finish();
  return file;
}

Mesh rounded_scale(Mesh mesh, const ScaleCoding& coding) {
  if (coding.position.bits > 0)
    for (Vec3f& p : mesh.positions) p = coding.position.rounded(p);
  for (int set = 0; set < 2; ++set) {
    const QuantisationGrid& grid = coding.uv[set];
    if (!coding.write_uv[set] || grid.bits == 0) continue;
    for (Vec2f& uv : set == 0 ? mesh.uv0 : mesh.uv1)
      uv = {grid.value(grid.index(uv.x, 0), 0), grid.value(grid.index(uv.y, 1), 1)};
  }
  for (Vec3f& n : mesh.normals) {
    const int bits = coding.options.normal_bits;
    const auto [u, v] = octahedral_code({n.x, n.y, n.z}, bits);
    const auto back = octahedral_normal(u, v, bits);
    n = {back[0], back[1], back[2]};
  }
  return mesh;
}

}  // namespace texmesh
