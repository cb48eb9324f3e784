#include "tools/extract/proxy/proxy_parts.h"

#include "format/base/portable_math.h"
#include "format/base/vec.h"
#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "stages/condition/condition.h"
#include "stages/gltf/glb_container.h"
#include "stages/image/decode_image.h"
#include "stages/simplification/simplification.h"
#include "tools/extract/glb/scale_file.h"
#include "tools/extract/glb/texture_source.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;
using Use = ProxyMap::Use;
constexpr float kOcclusionInColour = 0.5f;  // as stages/proxies has it
constexpr int kUncodedBits = 20;            // of positions, before they are coded as a file asks for
constexpr std::uint32_t kLeastMapSide = 4;

struct Slot {
  const char* parent;  // "" = the material itself
  const char* key;
  Use use;
};
constexpr std::array<Slot, 5> kSlots{{{"pbrMetallicRoughness", "baseColorTexture", Use::kBaseColour},
                                      {"pbrMetallicRoughness", "metallicRoughnessTexture", Use::kData},
                                      {"", "occlusionTexture", Use::kData},
                                      {"", "normalTexture", Use::kNormal},
                                      {"", "emissiveTexture", Use::kEmission}}};

Json* slot_of(Json& material, const Slot& slot) {
  Json* place = &material;
  if (*slot.parent) {
    if (!material.contains(slot.parent)) return nullptr;
    place = &material[slot.parent];
  }
  return place->contains(slot.key) ? &(*place)[slot.key] : nullptr;
}

std::size_t image_of(const Json& root, const Json& reference) {
  const Json& texture = root["textures"].at(reference["index"].get<std::size_t>());
  if (texture.contains("extensions") && texture["extensions"].contains("EXT_texture_webp"))
    return texture["extensions"]["EXT_texture_webp"]["source"].get<std::size_t>();
  return texture.value("source", std::size_t{0});
}

/// Textures and images that no material reads any more go, and "texture/k" is the name of the k-th that
/// stays. Gives the images that stay, as `root` counted them.
std::vector<std::size_t> keep_used(Json& root) {
  std::vector<std::size_t> kept_textures, kept_images;
  const auto place_in = [](std::vector<std::size_t>& kept, std::size_t k) {
    const auto found = std::ranges::find(kept, k);
    if (found != kept.end()) return static_cast<std::size_t>(found - kept.begin());
    kept.push_back(k);
    return kept.size() - 1;
  };
  Json textures = Json::array(), images = Json::array();
  for (Json& material : root["materials"])
    for (const Slot& slot : kSlots) {
      Json* reference = slot_of(material, slot);
      if (!reference) continue;
      const std::size_t from = (*reference)["index"].get<std::size_t>();
      const std::size_t image = place_in(kept_images, image_of(root, *reference));
      const std::size_t texture = place_in(kept_textures, from);
      (*reference)["index"] = texture;
      if (texture == textures.size()) {
        textures.push_back(root["textures"][from]);
        textures.back().erase("extensions");
        textures.back()["source"] = image;
      }
      if (image == images.size())
        images.push_back({{"name", "texture/" + std::to_string(image)}, {"mimeType", "image/png"}});
    }
  root["textures"] = std::move(textures);
  root["images"] = std::move(images);
  return kept_images;
}

std::array<double, 3> means_of(const Pixels& pixels) {
  std::array<double, 3> sums{};
  const std::size_t texels = std::size_t{pixels.width_px} * pixels.height_px;
  for (std::size_t i = 0; i < texels; ++i)
    for (std::size_t k = 0; k < 3; ++k) sums[k] += pixels.data[i * pixels.channels + k];
  for (double& s : sums) s /= 255 * static_cast<double>(std::max<std::size_t>(texels, 1));
  return sums;
}

void drop_slot(Json& material, const Slot& slot) {
  if (!slot_of(material, slot)) return;
  (*slot.parent ? material[slot.parent] : material).erase(slot.key);
}

void use_means(Json& material, const Pixels& data) {
  Json& pbr = material["pbrMetallicRoughness"];
  const std::array<double, 3> means = means_of(data);
  pbr["roughnessFactor"] = static_cast<float>(pbr.value("roughnessFactor", 1.0) * means[1]);
  pbr["metallicFactor"] = static_cast<float>(pbr.value("metallicFactor", 1.0) * means[2]);
}

/// Colours under half of the occlusion that the first channel of `data` is.
Pixels occluded(Pixels colours, const Pixels& data) {
  for (std::size_t i = 0; i < std::size_t{colours.width_px} * colours.height_px; ++i) {
    const float occlusion = static_cast<float>(data.data[i * data.channels]) / 255;
    for (std::size_t k = 0; k < 3; ++k) {
      std::uint8_t& code = colours.data[i * colours.channels + k];
      const float light = light_of_bytes()[code] * (1 - kOcclusionInColour * (1 - occlusion));
      code = static_cast<std::uint8_t>(srgb_of_light(static_cast<double>(light)) * 255 + 0.5);
    }
  }
  return colours;
}

/// What the first slot that reads an image is for.
std::optional<Use> use_of(Json& root, std::size_t image) {
  for (const Slot& slot : kSlots)
    for (Json& material : root["materials"])
      if (const Json* reference = slot_of(material, slot); reference && image_of(root, *reference) == image)
        return slot.use;
  return std::nullopt;
}

/// The images that materials read.
std::vector<ProxyMap> maps_in(Json& root, const Bytes& binary) {
  std::vector<ProxyMap> out;
  for (std::size_t k = 0; k < (root.contains("images") ? root["images"].size() : 0); ++k) {
    const Json& view = root["bufferViews"].at(root["images"][k].at("bufferView").get<std::size_t>());
    const auto first = binary.begin() + static_cast<std::ptrdiff_t>(view.value("byteOffset", std::size_t{0}));
    const auto last = first + view["byteLength"].get<std::ptrdiff_t>();
    out.push_back({use_of(root, k), decode_image(probe_image("proxy", {first, last}, {}))});
  }
  return out;
}

/// Each use once, textures of the five slots alone, and channels that every coder takes.
bool is_simple(const Json& root, const std::vector<ProxyMap>& maps) {
  const auto count = [&](const char* list) { return root.contains(list) ? root[list].size() : 0; };
  if (count("nodes") != 1 || count("meshes") != 1) return false;
  for (const Json& m : root.value("materials", Json::array())) {
    const Json extensions = m.value("extensions", Json::object());
    if (extensions.size() > extensions.count("KHR_materials_unlit")) return false;
  }
  return std::ranges::all_of(maps, [&](const ProxyMap& map) {
    const auto same = [&](const ProxyMap& other) { return other.use == map.use; };
    const std::uint32_t channels = map.pixels.channels;
    return map.use && std::ranges::count_if(maps, same) == 1 &&
           (channels == 3 || (channels == 4 && map.use == Use::kBaseColour));
  });
}

double side_of_box(const Mesh& mesh) {
  const double side = to_double(bounding_box(mesh.positions)).longest_side();
  return side > 0 ? side : 1;
}

/// The mesh as floats under Draco, before it is coded as a file asks for.
StandaloneGlb uncoded(const Mesh& mesh, const std::string& entry) {
  SplitStreamHead head;
  const Box3f box = bounding_box(mesh.positions);
  head.position = {kUncodedBits, {box.min.x, box.min.y, box.min.z}, static_cast<float>(side_of_box(mesh))};
  return {write_streamed_scale(mesh, head, {}), entry};
}

constexpr double kVertexShare = 0.8;
constexpr int kThinnerMeshes = 7;

/// Asks for falling numbers of vertices, whichever they are.
ScaleMap falling_counts(std::size_t positions) {
  ScaleMap out;
  out.scales = kThinnerMeshes;
  for (std::size_t p = 0; p < positions; ++p) {
    std::uint8_t last = 0;
    for (double count = kVertexShare * static_cast<double>(positions);
         last < kThinnerMeshes && static_cast<double>(p) < count; count *= kVertexShare)
      ++last;
    out.persistence.push_back(last);
  }
  return out;
}

SimplificationOptions by_shape_alone() {
  SimplificationOptions out;
  out.persistence_weight = 0;
  out.coarsest = 1;
  out.coarsest_vertices = 0;
  return out;
}

}  // namespace

std::vector<Mesh> thinner_meshes(const Mesh& mesh, const RunContext& context) {
  RunContext inner = context;
  inner.progress = nullptr;
  std::vector<Mesh> out{mesh};
  try {
    ConditionOptions as_it_is;
    as_it_is.normals = NormalsPolicy::kKeep;
    const ConditionedMesh sound = condition_mesh(mesh, true, as_it_is, inner);
    const NestedScales scales =
        simplify(sound, falling_counts(sound.mesh.positions.size()), by_shape_alone(), inner);
    for (std::size_t k = 1; k < scales.scales.size(); ++k)
      out.push_back(extract_scale(scales, scales.scales[k]));
  } catch (const StageError&) {  // a mesh without area
  }
  return out;
}

Averaging ProxyMap::averaging() const {
  if (use == Use::kNormal) return Averaging::kNormals;
  return use == Use::kData ? Averaging::kNumbers : Averaging::kLight;
}

const char* ProxyMap::role() const {
  constexpr std::array<const char*, 4> kNames{"base-colour", "metallic-roughness", "normal", "emissive"};
  return kNames[static_cast<std::size_t>(use.value_or(Use::kBaseColour))];
}

std::optional<ProxyParts> ProxyParts::read(std::span<const std::uint8_t> glb, const std::string& entry,
                                           const RunContext& context) {
  StandaloneGlb(glb, entry, GlbRules::kStandalone);  // checks it
  ProxyParts out;
  out.entry_ = entry;
  GlbParts chunks = read_glb(glb, entry);
  if (!chunks.root.contains("materials")) return std::nullopt;
  out.maps_ = maps_in(chunks.root, chunks.binary);
  NoFiles none;
  Model model = import_package_glb(entry, glb, none, context).model;
  if (!is_simple(chunks.root, out.maps_) || model.materials.size() != chunks.root["materials"].size() ||
      !bake_texture_scale(chunks.root, model.mesh))
    return std::nullopt;
  out.meshes_ = thinner_meshes(model.mesh, context);
  for (const char* list : {"bufferViews", "accessors", "meshes", "buffers"}) chunks.root.erase(list);
  out.json_ = chunks.root.dump();
  return out;
}

const ProxyMap* ProxyParts::map_of(ProxyMap::Use use) const {
  const auto found = std::ranges::find(maps_, std::optional(use), &ProxyMap::use);
  return found == maps_.end() ? nullptr : &*found;
}

double ProxyParts::extent() const { return side_of_box(meshes_.front()); }

Json ProxyParts::materials_of(const ProxyMapChoice& choice) const {
  Json root = Json::parse(json_);
  const ProxyMap* data = map_of(Use::kData);
  for (Json& material : root["materials"]) {
    if (!choice.data && slot_of(material, kSlots[1])) use_means(material, data->pixels);
    for (const Slot& slot : kSlots)
      if ((slot.use == Use::kData && !choice.data) || (slot.use == Use::kNormal && !choice.normal))
        drop_slot(material, slot);
  }
  return root;
}

StandaloneGlb ProxyParts::file(const ProxyMapChoice& choice, std::size_t mesh, const DracoSteps& steps,
                               const RunContext& context) const {
  StandaloneGlb coded = uncoded(meshes_.at(mesh), entry_);
  coded.recode(steps, nullptr, context);
  GlbParts chunks = read_glb(coded.finish(), entry_);
  Json root = materials_of(choice);
  keep_used(root);
  for (Json& image : root["images"]) image["bufferView"] = chunks.root["bufferViews"].size();
  pad_to_four(chunks.binary, 0);
  const Bytes texel = encode_image({1, 1, 3, {0, 0, 0}}, {FileImage::kPng});
  chunks.root["bufferViews"].push_back(
      {{"buffer", 0}, {"byteOffset", chunks.binary.size()}, {"byteLength", texel.size()}});
  chunks.binary.insert(chunks.binary.end(), texel.begin(), texel.end());
  pad_to_four(chunks.binary, 0);
  chunks.root["buffers"][0]["byteLength"] = chunks.binary.size();
  for (const char* list : {"materials", "textures", "images", "samplers"})
    if (root.contains(list) && !root[list].empty()) chunks.root[list] = root[list];
  for (const Json& m : root["materials"])
    if (m.contains("extensions") && chunks.root["extensionsUsed"].size() == 1)
      chunks.root["extensionsUsed"].push_back("KHR_materials_unlit");
  const Vec3d origin = meshes_.front().origin;
  if (!(origin == Vec3d{})) chunks.root["nodes"][0]["translation"] = {origin.x, origin.y, origin.z};
  return {glb_container(chunks.root.dump(), chunks.binary), entry_};
}

std::vector<ProxyMap> ProxyParts::maps(const ProxyMapChoice& choice) const {
  Json root = materials_of(choice);
  std::vector<ProxyMap> out;
  for (const std::size_t k : keep_used(root)) out.push_back(maps_.at(k));
  const ProxyMap* data = map_of(Use::kData);
  if (choice.data || !data) return out;
  for (ProxyMap& map : out)
    if (map.use == Use::kBaseColour && map.pixels.width_px == data->pixels.width_px &&
        map.pixels.height_px == data->pixels.height_px)
      map.pixels = occluded(std::move(map.pixels), data->pixels);
  return out;
}

Pixels smaller_map(const ProxyMap& map, double share) {
  const Pixels& from = map.pixels;
  const auto side = [&](std::uint32_t full) {
    return std::clamp(static_cast<std::uint32_t>(full * share + 0.5), std::min(kLeastMapSide, full), full);
  };
  const std::uint32_t width = side(from.width_px), height = side(from.height_px);
  if (width == from.width_px && height == from.height_px) return from;
  const auto resized = [&](const Pixels& pixels, Averaging kind) {
    return reduced(pixels, from.width_px, from.height_px, width, height, kind);
  };
  if (from.channels != 4) return resized(from, map.averaging());
  Pixels colours{from.width_px, from.height_px, 3, {}}, alpha{from.width_px, from.height_px, 1, {}};
  for (std::size_t i = 0; i < from.data.size(); i += 4) {
    colours.data.insert(colours.data.end(), {from.data[i], from.data[i + 1], from.data[i + 2]});
    alpha.data.push_back(from.data[i + 3]);
  }
  return with_alpha(resized(colours, map.averaging()), resized(alpha, Averaging::kNumbers));
}

}  // namespace texmesh
