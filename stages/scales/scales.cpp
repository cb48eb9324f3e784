#include "format/rules/viewing.h"
#include "format/rules/whole_textures.h"
#include "stages/base/parallel.h"
#include "stages/geometry/mesh_topology.h"
#include "stages/image/png_writer.h"
#include "stages/jpeg/jpeg.h"
#include "stages/jpeg/jpeg_coder.h"
#include "stages/scales/vertex_split.h"

namespace texmesh {
namespace {

/// One image of a GLB, made once for all scales.
struct GlbImage {
  std::uint32_t image = 0;  // source image: named "texture/<image>"
  std::uint32_t plane = 0;  // whose preview it is, preview/PPP.jpg; a PNG is no entry
  const char* mime_type = "";
  std::vector<std::uint8_t> bytes;
  std::string uri;  // "" = embedded
};
using GlbImages = std::vector<GlbImage>;

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

float unit(float x) { return std::clamp(x, 0.0f, 1.0f); }

/// Hands out texture and sampler indices, equal ones once.
class TextureTable {
 public:
  TextureTable(GlbWriter& writer, const GlbImages& images, std::array<bool, 2> has_uv)
      : writer_(writer), has_uv_(has_uv) {
    for (const GlbImage& p : images) {
      image_of_[p.image] = writer_.array("images").size();
      Json image{{"name", "texture/" + std::to_string(p.image)}, {"mimeType", p.mime_type}};
      if (!p.uri.empty())
        image["uri"] = p.uri;
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
  pbr["baseColorFactor"] = GlbWriter::shortest(
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
    out["emissiveFactor"] = GlbWriter::shortest({unit(m.emissive.x), unit(m.emissive.y), unit(m.emissive.z)});
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

/// Per source image that has planes: the colour plane's preview, or a PNG with alpha where an alpha plane
/// stands beside it.
GlbImages preview_images(const Fragments& fragments, const Previews& previews) {
  GlbImages out;
  for (std::size_t i = 0; i < fragments.planes.size(); ++i) {
    const TexturePlane& plane = fragments.planes[i];
    if (plane.role == TextureRole::kAlpha || plane.mip > 0) continue;
    GlbImage image{plane.image, static_cast<std::uint32_t>(i), "image/jpeg", previews.planes.at(i).file, {}};
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

/// Previews by their place in the package's tree; what is no entry of the package stays within the file.
GlbImages named_previews(GlbImages images) {
  for (GlbImage& i : images)
    if (i.mime_type == std::string_view("image/jpeg")) i.uri = "../" + preview_path(i.plane);
  return images;
}

/// Materials, textures, samplers and images of the document. Textures whose texture coordinates or previews
/// do not exist are left out. Factors are clipped to the ranges of glTF.
void write_materials(GlbWriter& writer, const std::vector<Material>& materials, const GlbImages& images,
                     bool has_uv0, bool has_uv1) {
  TextureTable textures(writer, images, {has_uv0, has_uv1});
  for (const Material& m : materials) writer.array("materials").push_back(material_json(m, textures, writer));
}

/// Largest factor by which a material stretches texture coordinates, times the largest image's side.
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

bool uses_texcoord(const std::vector<Material>& materials, int set) {
  bool used = false;
  for (const Material& m : materials)
    for_each_texture(m, [&](const TextureRef& t) { used = used || (t.used() && t.texcoord == set); });
  return used;
}

/// 8 bits lose something of these colours.
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

/// Above this many parts they are merged: each costs 0.8 KB of JSON and a code stream of its own in every
/// scale (a SketchUp model of 5,391 groups took 5.9 MB per scale, 4.2 MB of it JSON). The names then stand in
/// the mesh's extras, and a feature id per vertex (EXT_mesh_features) says which is whose.
constexpr std::size_t kMostNodes = 256;

bool parts_merged(const Mesh& mesh) { return mesh.part_names.size() > kMostNodes; }

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

/// Two corners in one place.
bool is_flat(Vec3f a, Vec3f b, Vec3f c) { return a == b || b == c || c == a; }

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

Json node_json(const ScaleCoding& coding, std::uint16_t part) {
  Json node{{"name", node_name(coding.mesh, part)}};
  if (coding.positions_are_indices()) {
    const Vec3f origin = coding.position.origin;
    const float step = coding.position.step();
    node["translation"] = {origin.x, origin.y, origin.z};
    node["scale"] = {step, step, step};
  }
  return node;
}

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
          {{"name", node_name(coding.mesh, part)}, {"primitives", Json::array()}});
      if (parts_merged(coding.mesh)) writer.array("meshes").back()["extras"]["partNames"] = merged_names;
    }
    if (parts_merged(coding.mesh)) {
      coded.json["extensions"]["EXT_mesh_features"]["featureIds"] =
          Json::array({{{"featureCount", merged_names.size()}, {"attribute", 0}, {"label", "part"}}});
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

/// What the stream rounds to: as Draco, whatever the files are; at most 24 bits.
VertexSplitCoding stream_coding(const ScaleCoding& coding, const std::vector<Material>& materials,
                                const std::vector<Image>& images) {
  constexpr int kMostBits = 24;
  VertexSplitCoding out;
  ScalesOptions most = coding.options;
  out.position = coding.position;
  if (out.position.bits == 0) out.position = position_grid(coding.mesh, most, kMostBits);
  for (int set = 0; set < 2; ++set)
    if (coding.write_uv[set])
      out.uv[set] =
          uv_grid(coding.uv_values(set), largest_texture_px(materials, images, set), most, kMostBits);
  most.position_bits = most.uv_bits = kMostBits;
  if (out.position.bits == 0) out.position = position_grid(coding.mesh, most, kMostBits);
  for (int set = 0; set < 2; ++set)
    if (coding.write_uv[set] && out.uv[set].bits == 0)
      out.uv[set] = uv_grid(coding.uv_values(set), 1, most, kMostBits);
  out.normal_bits = coding.options.normal_bits;
  out.colour_bits = coding.mesh.colours.empty() ? 0 : coding.fine_colours ? 16 : 8;
  out.merge_parts = coding.mesh.part_names.size() > kMostNodes;
  return out;
}

/// What the stream says of a scale that has no file.
ScaleFile count_streamed(const SplitStreamHead& head, int scale) {
  const auto found = std::ranges::find(head.scales, scale, &SplitScale::scale);
  return {scale, {}, found->triangles, found->wedges};
}

/// Whether the stream's scales show the triangles that files would. Files keep positions as they are where no
/// grid is fine enough (slivers of 1e-12 of the size); the stream has none but its grid.
bool shows_the_same(const std::vector<std::uint8_t>& stream, const NestedScales& scales,
                    const std::vector<std::size_t>& kept, const QuantisationGrid& grid) {
  const SplitStreamHead head = read_split_head(stream);
  std::vector<Vec3f> place;  // per position
  place.reserve(scales.mesh.positions.size());
  for (const Vec3f p : scales.mesh.positions) place.push_back(grid.bits > 0 ? grid.place(p) : p);
  const auto at = [&](std::uint32_t wedge) { return place[scales.mesh.wedge_position[wedge]]; };
  return std::ranges::all_of(kept, [&](std::size_t k) {
    const auto triangles = std::ranges::count_if(scales.scales[k].triangles, [&](const Triangle& t) {
      return grid.bits == 0 || !is_flat(at(t[0]), at(t[1]), at(t[2]));
    });
    return count_streamed(head, scales.scales[k].scale).triangles == static_cast<std::size_t>(triangles);
  });
}

void write_stream(const ScaleCoding& coding, const NestedScales& scales, const std::vector<std::size_t>& kept,
                  const std::vector<Material>& materials, const std::vector<Image>& images,
                  const RunContext& context, ScaleFiles& result) {
  if (!coding.options.stream || kept.size() < 2) return;
  try {
    result.stream = write_split_stream(
        make_vertex_splits(scales, kept, stream_coding(coding, materials, images), context));
    if (shows_the_same(result.stream, scales, kept, coding.position)) return;
    result.stream.clear();
    add_info(result.notes, "no-stream", "",
             "the scales have no vertex-split stream: triangles are too small for any grid");
  } catch (const FormatError& e) {
    add_info(result.notes, "no-stream", "",
             std::string("the scales have no vertex-split stream: ") + e.what());
  }
}

void note_parts(const Mesh& mesh, Notes& notes) {
  if (!parts_merged(mesh)) return;
  add_info(notes, "parts-merged", "",
           std::to_string(mesh.part_names.size()) + " parts became one node, because more than " +
               std::to_string(kMostNodes) +
               " would cost more bytes than the mesh; feature ids of the vertices count their names, which "
               "its mesh lists in extras.partNames");
}

void note_grid(const ScaleCoding& coding, std::size_t triangles, std::size_t written, Notes& notes) {
  const int bits = coding.position.bits, asked = coding.options.position_bits;
  if (bits > 0 && bits < asked)
    add_info(notes, "fewer-bits", "",
             "position_bits is " + std::to_string(asked) + ", of which mesh_codec " +
                 std::string(enum_name(coding.options.mesh_codec)) + " holds " + std::to_string(bits));
  if (written >= triangles) return;
  constexpr std::size_t kManyPart = 100;  // more than a hundredth of all: that may show
  const Severity severity =
      (triangles - written) * kManyPart > triangles ? Severity::kWarning : Severity::kInfo;
  notes.push_back({severity, "flattened-triangles", "scale 0",
                   std::to_string(triangles - written) + " of " + std::to_string(triangles) +
                       " triangles have two corners in one place of the grid of " + std::to_string(bits) +
                       " bits per coordinate, show nothing and were left out"});
}

/// As the manifest's will be.
std::vector<ManifestStep> steps_of(const MeasuredQuality& quality) {
  std::vector<ManifestScale> scales(quality.table.scales.size());
  for (std::size_t k = 0; k < scales.size(); ++k) {
    scales[k].scale = quality.table.scales[k];
    scales[k].display_px_flip = static_cast<double>(quality.display_px_flip.at(k));
  }
  return step_function(scales, StepRule::kFlip);
}

/// A scale of the stream that has a GLB beside it.
struct GlbBeside {
  const NestedScale* scale = nullptr;
  double up_to_px = 0;  // 0: it has no step
  GlbImages images;
  std::vector<WholeTexture> pictures;  // those of the images that are no previews
  std::uint32_t texture_px = 0;        // longest side of what it shows
  Bytes file;
};

std::vector<GlbBeside> scales_beside(const NestedScales& scales, const ScaleFiles& files,
                                     const std::vector<ManifestStep>& steps, ScaleGlbs which) {
  if (which == ScaleGlbs::kEnds || files.stream.empty()) return {};
  std::vector<GlbBeside> wanted;
  for (const ScaleFile& file : files.files) {
    const auto step = std::ranges::find(steps, file.scale, &ManifestStep::scale);
    if (!file.glb.empty() || (which == ScaleGlbs::kSteps && step == steps.end())) continue;
    GlbBeside& glb = wanted.emplace_back();
    glb.scale = &*std::ranges::find(scales.scales, file.scale, &NestedScale::scale);
    if (step != steps.end()) glb.up_to_px = step->up_to_px;
  }
  return wanted;
}

void choose_textures(const TexturedObject& object, const Fragments& fragments, GlbBeside& glb) {
  for (const WholeTexture& t : least_textures(object, glb.scale->scale, glb.up_to_px, kGltfFlip)) {
    if (t.rung == WholeTexture::kPreview) continue;
    const std::string path = gltf_image_path(t.plane, t.rung);
    std::ranges::find(glb.images, t.base, &GlbImage::plane)->uri = path.substr(path.rfind('/') + 1);
    glb.pictures.push_back(t);
    const TexturePlane& plane = fragments.planes[t.plane];
    glb.texture_px = std::max({glb.texture_px, plane.width_px, plane.height_px});
  }
}

/// Octahedral. As many steps as pixels are enough; beside other losses more than 9 bits are not seen.
int normal_bits_at(double displayed_px) {
  return std::clamp(static_cast<int>(std::ceil(std::log2(displayed_px))), 7, 9);
}

/// With a step: on grids of half a pixel at its switch size and of half a texel.
Bytes code_beside(const ScaleCoding& coding, const GlbBeside& glb, const std::vector<Material>& materials,
                  ScaleFrames frames) {
  ScaleCoding own = coding;
  own.frames = std::move(frames);
  if (glb.up_to_px > 0) {
    own.options.normal_bits = std::min(own.options.normal_bits, normal_bits_at(glb.up_to_px));
    coarsen_positions(own.position, 2 * glb.up_to_px, own.mesh, glb.scale->triangles);
    if (own.options.mesh_codec == MeshCodec::kDraco)
      for (QuantisationGrid& uv : own.uv) coarsen(uv, 2.0 * glb.texture_px * static_cast<double>(uv.range));
  }
  return write_scale(own, *glb.scale, materials, glb.images).glb;
}

/// The finest go until all GLBs together take no more than kMostOverFinest of S_0's and kAnywayBytes.
void leave_out_finest(const ScaleFiles& files, std::vector<GlbBeside>& made, Notes& notes) {
  double room = (kMostOverFinest - 1) * static_cast<double>(files.files.front().glb.size()) + kAnywayBytes -
                static_cast<double>(files.files.back().glb.size());
  for (const GlbBeside& glb : made) room -= static_cast<double>(glb.file.size());
  for (; room < 0 && !made.empty(); made.erase(made.begin())) {
    room += static_cast<double>(made.front().file.size());
    add_info(notes, "no-glb", "scale " + std::to_string(made.front().scale->scale),
             "has no GLB: all would take over 2.2 times S_0's bytes and 32 kB (scales.glb all writes it)");
  }
}

/// What rules of format/rules read of the planes.
std::vector<TextureInfo> describe_planes(const Fragments& fragments) {
  std::vector<TextureInfo> out;
  for (const TexturePlane& plane : fragments.planes) {
    TextureInfo& t = out.emplace_back();
    t.image = plane.image, t.mip = plane.mip, t.base = plane.base, t.role = enum_name(plane.role);
  }
  return out;
}

/// `pixels` may be larger than the plane: whole fragments.
Bytes whole_plane(const TexturePlane& plane, const Pixels& pixels, int quality) {
  JpegKind kind;
  kind.channels = pixels.channels;
  kind.rgb = !is_colour(plane.role) && pixels.channels == 3;
  kind.file = FileSteps{static_cast<double>(quality), false, false};
  return JpegCoder(kind).complete(
      {pixels.data.data(), std::size_t{pixels.width_px} * pixels.channels, plane.width_px, plane.height_px});
}

}  // namespace

bool ScaleCoding::writes_tangents(const ScalePrimitive& primitive) const {
  if (mesh.tangents.empty() || mesh.normals.empty() || !tangents.at(primitive.material)) return false;
  return std::all_of(primitive.wedges.begin(), primitive.wedges.end(),
                     [&](std::uint32_t w) { return mesh.tangents[w].w != 0; });
}

ScaleFiles write_scales(const NestedScales& scales, const PerceptualValues& perceptual,
                        const std::vector<Material>& materials, const std::vector<Image>& images,
                        const Fragments& fragments, const Previews& previews, const ScalesOptions& options,
                        const RunContext& context) {
  const ScaleCoding coding = make_coding(scales.mesh, materials, images, options);
  const GlbImages embedded = preview_images(fragments, previews), named = named_previews(embedded);
  std::vector<std::size_t> kept;
  for (std::size_t k = 0; k < scales.scales.size(); ++k)
    if (k == 0 || (k < perceptual.kept.size() && perceptual.kept[k])) kept.push_back(k);
  ScaleFiles result;
  note_parts(scales.mesh, result.notes);
  result.position_bits = coding.position.bits;
  result.uv_bits = coding.write_uv[0] ? coding.uv[0].bits : 0;
  result.position_error = largest_rounding(scales.mesh, coding.position);
  result.files.resize(kept.size());
  const auto write_file = [&](std::size_t i) {
    ScaleCoding lit = coding;
    lit.frames = scale_frames(scales, kept[i], context);
    result.files[i] =
        write_scale(lit, scales.scales[kept[i]], materials, i + 1 == kept.size() ? embedded : named);
  };
  const std::size_t tasks = 1 + (options.stream ? std::min<std::size_t>(kept.size(), 2) : kept.size());
  std::atomic<std::size_t> made = 0;
  const auto made_one = [&] { context.report(static_cast<double>(++made) / static_cast<double>(tasks + 1)); };
  // The stream and S_0's file take about as long. These two scales have files beside any stream.
  const std::size_t always = std::min<std::size_t>(kept.size(), 2);
  parallel_each(context, 1 + always, 1, [&](std::size_t task) {
    if (task == 0)
      write_stream(coding, scales, kept, materials, images, context, result);
    else
      write_file(task == 1 ? 0 : kept.size() - 1);
    made_one();
  });
  const std::size_t between = kept.size() - always;
  if (!result.stream.empty()) {
    const SplitStreamHead head = read_split_head(result.stream);
    for (std::size_t i = 1; i <= between; ++i)
      result.files[i] = count_streamed(head, scales.scales[kept[i]].scale);
  } else {
    parallel_for(context, between, 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin + 1; i <= end; ++i) {
        write_file(i);
        if (made < tasks) made_one();  // a stream that was given up leaves more files than were counted
      }
    });
  }
  note_grid(coding, scales.scales[0].triangles.size(), result.files[0].triangles, result.notes);
  return result;
}

GltfScales write_gltf_scales(const NestedScales& scales, const PerceptualValues& perceptual,
                             const std::vector<Material>& materials, const std::vector<Image>& images,
                             const Fragments& fragments, const std::vector<Pixels>& filled,
                             const Previews& previews, const PackageTables& tables, const ScaleFiles& files,
                             const MeasuredQuality& quality, const ScalesOptions& options,
                             const RunContext& context) {
  std::vector<GlbBeside> wanted = scales_beside(scales, files, steps_of(quality), options.glb);
  if (wanted.empty()) return {};
  const ScaleCoding coding = make_coding(scales.mesh, materials, images, options);
  const std::vector<TextureInfo> textures = describe_planes(fragments);
  const TexturedObject object{quality.table, textures, tables.planes,
                              surface_area(scales.mesh, scales.scales.front().triangles),
                              static_cast<double>(perceptual.object_height)};
  const GlbImages shown = named_previews(preview_images(fragments, previews));
  for (GlbBeside& glb : wanted) {
    glb.images = shown;
    for (const PlanePreview& p : previews.planes)
      glb.texture_px = std::max({glb.texture_px, p.width_px, p.height_px});
    if (glb.up_to_px > 0 && !textures.empty()) choose_textures(object, fragments, glb);
  }
  parallel_each(context, wanted.size(), 1, [&](std::size_t k) {
    const auto row = static_cast<std::size_t>(wanted[k].scale - scales.scales.data());
    wanted[k].file = code_beside(coding, wanted[k], materials, scale_frames(scales, row, context));
  });
  GltfScales out;
  if (options.glb == ScaleGlbs::kSteps) leave_out_finest(files, wanted, out.notes);
  std::map<std::string, WholeTexture> pictures;
  for (const GlbBeside& glb : wanted)
    for (const WholeTexture& t : glb.pictures) pictures[gltf_image_path(t.plane, t.rung)] = t;
  for (const auto& [path, unused] : pictures) out.files.push_back({path, {}});
  parallel_each(context, out.files.size(), 1, [&](std::size_t k) {
    const WholeTexture& t = pictures.at(out.files[k].path);
    out.files[k].bytes = whole_plane(fragments.planes[t.plane], filled.at(t.plane),
                                     tables.planes[t.plane].rung_quality[t.rung]);
  });
  for (GlbBeside& glb : wanted) out.files.push_back({gltf_scale_path(glb.scale->scale), std::move(glb.file)});
  return out;
}

std::vector<std::uint8_t> write_streamed_scale(const Mesh& mesh, const SplitStreamHead& head,
                                               const ScalesOptions& options, bool hasty) {
  const auto grid = [](const SplitGrid& g) {
    return QuantisationGrid{g.bits, {g.origin[0], g.origin[1], g.origin[2]}, g.range};
  };
  std::uint16_t materials = 0;
  for (const std::uint16_t m : mesh.triangle_material) materials = std::max(materials, m);
  ScaleCoding coding{mesh,
                     options,
                     {},
                     {},
                     {!mesh.uv0.empty(), !mesh.uv1.empty()},
                     needs_fine_colours(mesh.colours),
                     std::vector<bool>(materials + std::size_t{1}, true),
                     {mesh.normals, mesh.tangents}};
  if (hasty) coding.draco_speed = kDracoFastest;
  constexpr int kShortBits = 16;
  const bool draco = options.mesh_codec == MeshCodec::kDraco;
  if (draco || (options.mesh_codec != MeshCodec::kNone && head.position.bits <= kShortBits))
    coding.position = grid(head.position);
  if (draco)
    for (const SplitAttribute& a : head.attributes)
      if (a.kind == SplitKind::kUv0 || a.kind == SplitKind::kUv1)
        coding.uv[a.kind == SplitKind::kUv1 ? 1 : 0] = grid(a.grid);
  NestedScale scale;
  scale.triangles = mesh.triangles;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) scale.triangle_source.push_back(t);
  return write_scale(coding, scale, std::vector<Material>(materials + std::size_t{1}), {}).glb;
}

}  // namespace texmesh
