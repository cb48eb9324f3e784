#include "tools/extract/proxy/proxy_search.h"

#include "format/base/portable_math.h"
#include "format/rules/proxy_choice.h"
#include "pipeline/io/file_resolver.h"
#include "stages/base/float_math.h"
#include "stages/condition/condition.h"
#include "stages/image/decode_image.h"
#include "stages/simplification/simplification.h"
#include "tools/extract/budget/filling.h"

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
  static const SrgbEncoder<float, false> encode;
  for (std::size_t i = 0; i < std::size_t{colours.width_px} * colours.height_px; ++i) {
    const float occlusion = static_cast<float>(data.data[i * data.channels]) / 255;
    for (std::size_t k = 0; k < 3; ++k) {
      std::uint8_t& code = colours.data[i * colours.channels + k];
      code = encode(light_of_bytes()[code] * (1 - kOcclusionInColour * (1 - occlusion)));
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
std::vector<ProxyMap> maps_in(GlbParts& parts) {
  std::vector<ProxyMap> out;
  for (const Json& image : parts.root.value("images", Json::array()))
    out.push_back(
        {use_of(parts.root, out.size()), decode_image(probe_image("proxy", image_bytes(parts, image), {}))});
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

/// The mesh as floats under Draco, before it is coded as a file asks for.
StandaloneGlb uncoded(const Mesh& mesh, const std::string& entry) {
  SplitStreamHead head;
  const Box3f box = bounding_box(mesh.positions);
  head.position = {kUncodedBits, {box.min.x, box.min.y, box.min.z}, static_cast<float>(longest_side(mesh))};
  return {write_streamed_scale(mesh, head, {}), entry, std::nullopt};
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
  out.maps_ = maps_in(chunks);
  NoFiles none;
  Model model = import_package_glb(entry, glb, none, context).model;
  if (!is_simple(chunks.root, out.maps_) || model.materials.size() != chunks.root["materials"].size() ||
      !bake_texture_scale(chunks.root, model.mesh))
    return std::nullopt;
  out.meshes_ = thinner_meshes(model.mesh, context);
  for (const char* list : {"bufferViews", "accessors", "meshes", "buffers"}) chunks.root.erase(list);
  out.root_ = std::move(chunks.root);
  return out;
}

const ProxyMap* ProxyParts::map_of(ProxyMap::Use use) const {
  const auto found = std::ranges::find(maps_, std::optional(use), &ProxyMap::use);
  return found == maps_.end() ? nullptr : &*found;
}

double ProxyParts::extent() const { return longest_side(meshes_.front()); }

Json ProxyParts::materials_of(const ProxyMapChoice& choice) const {
  Json root = root_;
  const ProxyMap* data = map_of(Use::kData);
  for (Json& material : root["materials"]) {
    if (!choice.data && slot_of(material, kSlots[1])) use_means(material, data->pixels);
    for (const Slot& slot : kSlots)
      if ((slot.use == Use::kData && !choice.data) || (slot.use == Use::kNormal && !choice.normal))
        drop_slot(material, slot);
  }
  return root;
}

StandaloneGlb ProxyParts::coded(std::size_t mesh, const DracoSteps& steps, const RunContext& context) const {
  StandaloneGlb out = uncoded(meshes_.at(mesh), entry_);
  out.set_draco_streams(DracoRecoder(out.draco_streams(), nullptr, entry_).coded(steps, context));
  return out;
}

StandaloneGlb ProxyParts::file(const ProxyMapChoice& choice, const StandaloneGlb& coded) const {
  GlbParts chunks = read_glb(coded.finish(), entry_);
  Json root = materials_of(choice);
  keep_used(root);
  const std::size_t texel = add_view(chunks, encode_image({1, 1, 3, {0, 0, 0}}, {FileImage::kPng}));
  for (Json& image : root["images"]) image["bufferView"] = texel;
  pad_to_four(chunks.binary, 0);
  chunks.root["buffers"][0]["byteLength"] = chunks.binary.size();
  for (const char* list : {"materials", "textures", "images", "samplers"})
    if (root.contains(list) && !root[list].empty()) chunks.root[list] = root[list];
  for (const Json& m : root["materials"])
    if (m.contains("extensions") && chunks.root["extensionsUsed"].size() == 1)
      chunks.root["extensionsUsed"].push_back("KHR_materials_unlit");
  const Vec3d origin = meshes_.front().origin;
  if (!(origin == Vec3d{})) chunks.root["nodes"][0]["translation"] = {origin.x, origin.y, origin.z};
  return {glb_container(chunks.root.dump(), chunks.binary), entry_, std::nullopt};
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
  return reduced_with_alpha(from, width, height, map.averaging());
}

namespace {

/// Bits per coordinate along the longest side, of texture coordinates along the image, of normals.
struct MeshBits {
  int position, uv, normal;
};
constexpr MeshBits kMeshBits[] = {{8, 8, 5}, {9, 9, 5}, {9, 9, 6}, {10, 10, 7}, {11, 11, 7}, {12, 12, 8}};
constexpr int kUsualBits = 3, kFinestBits = 5;
constexpr double kMostMesh = 0.7;  // of the bytes, of the mesh that is tried first
constexpr double kShareStep = 0.75, kLeastProxyShare = 0.15;
constexpr double kPoorQuality = 15;  // pictures get smaller before they get worse
constexpr double kNormalQualityAbove = 10, kDataQualityBelow = 5;  // as the stage codes them
constexpr int kQualityTries = 10, kQuickTries = 4;
constexpr double kNearlyAll = 0.99;
constexpr double kRoughlyMost = 1.05,
                 kRoughly = 0.95;       // of the pictures' bytes; of these, of files to choose by
constexpr double kCarefulGains = 2;     // quality, of coding that takes its time
constexpr double kTableErrs = 1.15;     // times what the package tells of a proxy's difference, at most
constexpr double kSmallerLoses = 0.35;  // a file of half the bytes differs 2 to this power times as much
constexpr double kWorthATry = 1.3;      // times the difference of the best, by tables
constexpr double kGoesOn = 1.15;        // the same of the first file, in windows
constexpr double kAlike = 1.1;          // times as many triangles
constexpr std::uint64_t kFewBytesOfProxy = 50000;  // two proxies are made smaller, else one
constexpr std::uint64_t kFarBelow = 4;             // times as many bytes look better without a proxy

/// A way to make a file of a proxy.
struct ProxyTrial {
  ProxyMapChoice maps;
  std::size_t mesh = 0;
  int bits = kUsualBits;
  double share = 1;
  FileImage format = FileImage::kWebp;
  friend bool operator==(const ProxyTrial&, const ProxyTrial&) = default;
};

class ProxySearch {
 public:
  ProxySearch(const Reference& reference, std::uint64_t bytes, ProxyDifferences& whole, Extracted found)
      : reference_(reference), bytes_(bytes), whole_(whole), best_(std::move(found)) {}

  /// Those that fit from the largest on, then the others from the smallest on. But with --best tables pass
  /// over those that are likely to look worse, and few are made smaller.
  Extracted nearest() && {
    const std::vector<ManifestProxy>& proxies = reference_.package.manifest().proxies;
    const auto fitting = static_cast<std::uint32_t>(
        std::ranges::count_if(proxies, [&](const ManifestProxy& p) { return p.glb.bytes <= bytes_; }));
    int made_smaller = 0;
    for (std::uint32_t i = 0; i < proxies.size(); ++i) {
      const std::uint32_t k = i < fitting ? fitting - 1 - i : i;
      const bool best = reference_.wishes.best();
      if (!best && (made_smaller == (bytes_ < kFewBytesOfProxy ? 2 : 1) || !is_worth_a_try(k))) continue;
      Extracted whole = extract_proxy(reference_.package, {k}, reference_.place, reference_.context, bytes_);
      const bool is_file = fits(whole) && is_wanted_kind(k);
      if (best || is_file)
        measure_whole(k, whole);
      else
        set_difference(table_flip(k), whole);
      if (is_file || (best && is_wanted_kind(k) && !(whole.difference < best_.difference || !fits(best_)))) {
        offer(std::move(whole));  // what is made of it looks no better
      } else if (!reference_.wishes.fast() || !fits(best_)) {
        offer_smaller(k, whole);
        ++made_smaller;
      }
    }
    return std::move(best_);
  }

 private:
  bool fits(const Extracted& file) const { return file.glb.size() <= bytes_; }

  /// What pictures become first; PNG is not among the formats of a search.
  static FileImage format_of(ExtractImages wanted) {
    if (wanted == ExtractImages::kJpeg) return FileImage::kJpeg;
    return wanted == ExtractImages::kAvif ? FileImage::kAvif : FileImage::kWebp;
  }

  /// Whether the proxy's own images are of the format that is asked for.
  bool is_wanted_kind(std::uint32_t proxy) const {
    const ExtractImages wanted = reference_.wishes.images;
    if (wanted == ExtractImages::kAuto) return true;
    const GlbParts chunks = read_glb(reference_.package.proxy_glb(proxy), proxy_path(proxy));
    const char* mime = mime_type_of(format_of(wanted));
    const auto images = chunks.root.value("images", nlohmann::ordered_json::array());
    return std::ranges::all_of(images,
                               [&](const auto& image) { return image.value("mimeType", "") == mime; });
  }

  double table_flip(std::uint32_t proxy) const {
    return proxy_loss(reference_.package.manifest(), proxy, reference_.side_px).flip;
  }
  /// By the package's tables.
  bool may_look_better(std::uint32_t proxy) const {
    const double times = static_cast<double>(reference_.package.manifest().proxies[proxy].glb.bytes) /
                         static_cast<double>(bytes_);
    if (reference_.wishes.fast() && fits(best_)) return times <= 1 && table_flip(proxy) < best_.difference;
    const double likely =
        table_flip(proxy) * (times > 1 ? portable::pow(times, kSmallerLoses) : 1 / kTableErrs);
    return !fits(best_) || likely < (times > 1 ? kWorthATry : 1) * best_.difference;
  }

  /// Of proxies that do not fit and have meshes as good, the largest, which has the finest pictures: where
  /// any of them may look better.
  bool is_worth_a_try(std::uint32_t proxy) const {
    const std::vector<ManifestProxy>& proxies = reference_.package.manifest().proxies;
    const auto gives_way = [&](std::uint32_t p) {
      return proxies[p].glb.bytes > bytes_ && p + 1 < proxies.size() &&
             static_cast<double>(proxies[p + 1].triangles) <=
                 kAlike * static_cast<double>(proxies[p].triangles);
    };
    if (kFarBelow * proxies[proxy].glb.bytes < bytes_ || gives_way(proxy)) return false;
    while (!may_look_better(proxy))
      if (proxy == 0 || !gives_way(--proxy)) return false;
    return true;
  }

  void measure_whole(std::uint32_t proxy, Extracted& file) {
    if (reference_.wishes.fast()) return set_difference(table_flip(proxy), file);
    if (const auto known = whole_.find(proxy); known != whole_.end())
      return set_difference(known->second, file);
    measure(reference_.package.proxy_glb(proxy), file);
    whole_[proxy] = file.difference;
  }

  void set_difference(double difference, Extracted& file) const {
    file.difference = file.mesh_difference = difference;
    file.views = static_cast<int>(reference_.cameras.size());
    file.side_px = reference_.side_px;
  }

  /// In windows, or in whole pictures.
  void measure(const Bytes& glb, Extracted& file, bool whole = true) {
    NoFiles none;
    RenderedModel model =
        rendered_model(import_package_glb("proxy.glb", glb, none, reference_.context), reference_.context);
    const LitMesh mesh{std::move(model.mesh), std::move(model.materials), model.textures.size()};
    const LitViews views(mesh, whole ? reference_.cameras : reference_.windows, reference_.context);
    const LitMeter& meter = whole ? *reference_.whole_meter : *reference_.window_meter;
    set_difference(meter.difference(views, model.textures, reference_.context), file);
  }

  bool better(const Extracted& a, const Extracted& b) const {
    if (fits(a) != fits(b)) return fits(a);
    return fits(a) ? a.difference < b.difference : a.glb.size() < b.glb.size();
  }

  void offer(Extracted file) {
    if (!better(file, best_)) return;
    file.within = fits(file);
    file.notes = {"made of a proxy, which looks better in these bytes than any scale"};
    best_ = std::move(file);
  }

  ProxyTrial first_trial(const ProxyParts& parts, const Extracted& whole) {
    ProxyTrial trial;
    trial.format = format_of(reference_.wishes.images);
    const auto bytes = static_cast<double>(bytes_);
    while (trial.mesh + 1 < parts.mesh_count() &&
           static_cast<double>(coded(parts, trial).finish().size()) > kMostMesh * bytes)
      ++trial.mesh;
    if (!reference_.wishes.best())  // about as many texels for a byte as the proxy has
      while (trial.share * trial.share * kShareStep * static_cast<double>(whole.glb.size()) > bytes)
        trial.share *= kShareStep;
    return trial;
  }

  /// From the usual way to the best one, one choice after the other, as long as the picture gets better.
  void offer_smaller(std::uint32_t proxy, const Extracted& whole) {
    const auto parts =
        ProxyParts::read(reference_.package.proxy_glb(proxy), proxy_path(proxy), reference_.context);
    if (!parts) return;
    meshes_.clear();
    files_.clear();
    maps_.clear();
    ProxyTrial trial = first_trial(*parts, whole);
    const bool best = reference_.wishes.best();
    Extracted file = whole;
    while (!make(*parts, trial, file, best) && trial.share * kShareStep > kLeastProxyShare)
      trial.share *= kShareStep;
    if (reference_.wishes.fast()) return offer(std::move(file));
    if (!best && fits(best_) && file.difference > kGoesOn * best_.difference) return;
    std::vector<ProxyTrial> seen{trial};
    Rate rate = rate_;
    const auto try_next = [&](const ProxyTrial& next) {
      if (std::ranges::find(seen, next) != seen.end()) return false;
      seen.push_back(next);
      Extracted other = whole;
      const bool poor = !make(*parts, next, other, best);
      if ((poor && !best) || !better(other, file)) return false;
      file = std::move(other);
      trial = next;
      rate = rate_;
      return true;
    };
    const auto try_jpeg = [&] {
      ProxyTrial jpeg = trial;
      jpeg.format = FileImage::kJpeg;
      if (reference_.wishes.images == ExtractImages::kAuto && (best || !has_alpha(*parts, trial)))
        try_next(jpeg);
    };
    if (!best) try_jpeg();
    for (bool again = true; again;) {
      again = false;
      for (const ProxyTrial& next : other_maps(*parts, trial)) again |= try_next(next);
      const auto try_with = [&](auto ProxyTrial::*choice, auto value) {
        ProxyTrial next = trial;
        next.*choice = value;
        return try_next(next);
      };
      for (const double step : {kShareStep, 1 / kShareStep})
        while (try_with(&ProxyTrial::share, std::clamp(trial.share * step, kLeastProxyShare, 1.0)))
          again = true;
      while (trial.mesh + 1 < parts->mesh_count() && try_with(&ProxyTrial::mesh, trial.mesh + 1))
        again = true;
      while (trial.mesh > 0 && try_with(&ProxyTrial::mesh, trial.mesh - 1)) again = true;
      if (!best) break;
      for (const int bits : {trial.bits - 1, trial.bits + 1})
        if (bits >= 0 && bits <= kFinestBits) again |= try_with(&ProxyTrial::bits, bits);
    }
    if (best) try_jpeg();
    if (!best && fits(file)) {
      rate_ = {rate.quality + kCarefulGains, rate.texels, rate.bytes};
      make(*parts, trial, file, true);
    }
    offer(std::move(file));
  }

  static std::vector<ProxyTrial> other_maps(const ProxyParts& parts, const ProxyTrial& from) {
    std::vector<ProxyTrial> out;
    const bool has_data = parts.has(ProxyMap::Use::kData), has_normal = parts.has(ProxyMap::Use::kNormal);
    for (const ProxyMapChoice choice : {ProxyMapChoice{true, false}, {false, true}, {false, false}})
      if ((choice.data || has_data) && (choice.normal || has_normal))
        out.push_back({choice, from.mesh, from.bits, from.share, from.format});
    return out;
  }

  DracoSteps steps_of(const ProxyParts& parts, int bits) const {
    const auto places = [](int b) { return portable::exp(portable::log(2) * b); };
    const MeshBits& b = kMeshBits[bits];
    return {parts.extent() / places(b.position), 1 / places(b.uv), b.normal};
  }

  const StandaloneGlb& coded(const ProxyParts& parts, const ProxyTrial& trial) {
    const auto key = std::tuple(trial.maps.data, trial.maps.normal, trial.mesh, trial.bits);
    const auto found = files_.find(key);
    if (found != files_.end()) return found->second;
    std::optional<StandaloneGlb>& mesh = meshes_[{trial.mesh, trial.bits}];
    if (!mesh) mesh = parts.coded(trial.mesh, steps_of(parts, trial.bits), reference_.context);
    return files_.emplace(key, parts.file(trial.maps, *mesh)).first->second;
  }

  /// No JPEG has alpha.
  FileImage with_alpha(FileImage format) const {
    if (format != FileImage::kJpeg) return format;
    return reference_.wishes.images == ExtractImages::kJpeg ? FileImage::kPng : FileImage::kWebp;
  }

  const std::vector<ProxyMap>& maps_of(const ProxyParts& parts, const ProxyTrial& trial) {
    const auto [known, fresh] = maps_.try_emplace({trial.maps.data, trial.maps.normal, trial.share});
    if (fresh)
      for (ProxyMap& map : known->second = parts.maps(trial.maps)) map.pixels = smaller_map(map, trial.share);
    return known->second;
  }

  bool has_alpha(const ProxyParts& parts, const ProxyTrial& trial) {
    return std::ranges::any_of(maps_of(parts, trial),
                               [](const ProxyMap& map) { return map.pixels.channels == 4; });
  }

  static double quality_of(const ProxyMap& map, double quality) {
    if (map.use == ProxyMap::Use::kNormal) quality += kNormalQualityAbove;
    if (map.use == ProxyMap::Use::kData) quality -= kDataQualityBelow;
    return std::clamp(quality, kLowestQuality, kHighestQuality);
  }

  struct Pictures {
    std::map<std::uint32_t, FileImageData> files;
    std::vector<ExtractedImage> rows;  // of the report
  };

  Pictures pictures(const std::vector<ProxyMap>& maps, const ProxyTrial& trial, double quality,
                    bool quick) const {
    Pictures out;
    for (const ProxyMap& map : maps) {
      const auto k = static_cast<std::uint32_t>(out.rows.size());
      const FileImage format = map.pixels.channels < 4 ? trial.format : with_alpha(trial.format);
      const double q = quality_of(map, quality);
      const bool numbers = map.averaging() != Averaging::kLight;
      out.files[k] = {format, encode_image(map.pixels, {format, q, numbers, quick, true})};
      out.rows.push_back(
          {k, map.role(), format, map.pixels.width_px, map.pixels.height_px, q, out.files[k].bytes.size()});
    }
    return out;
  }

  /// The file that fills the bytes by its quality, and what it looks like. False where the quality is poor or
  /// the file too large; then it is not looked at.
  bool make(const ProxyParts& parts, const ProxyTrial& trial, Extracted& out, bool in_whole) {
    StandaloneGlb draft = coded(parts, trial), whole = draft;
    whole.place(reference_.place);
    whole.set_about(reserved_about(reference_.package.about(), reference_.place, bytes_));
    const std::vector<ProxyMap>& maps = maps_of(parts, trial);
    double texels = 1;
    for (const ProxyMap& map : maps)
      texels += static_cast<double>(map.pixels.width_px) * map.pixels.height_px;
    const bool quick = !in_whole && !reference_.wishes.fast();
    std::map<double, Pictures> made;
    const auto file_at = [&](double quality) {
      Pictures& p = made[quality];
      if (p.files.empty()) p = pictures(maps, trial, quality, quick);
      whole.set_images(p.files);
      return whole.finish();
    };
    const bool learns = !reference_.wishes.best();
    const double fixed = learns ? static_cast<double>(whole.finish().size()) : 0;  // bytes without pictures
    const double room = static_cast<double>(bytes_) - fixed, most = quick ? kRoughlyMost * room : room;
    const auto take = [&](double quality) {
      out.glb = file_at(quality);
      draft.set_images(made[quality].files);
      out.images = made[quality].rows;
      out.mesh_bytes = out.glb.size();
      out.triangles = parts.triangles(trial.mesh);
      for (const ExtractedImage& i : out.images) out.mesh_bytes -= i.bytes;
    };
    if (learns && !maps.empty() && room <= 0) {  // the least that there is, where nothing fits
      take(kLowestQuality);
      if (!reference_.wishes.fast()) measure(draft.finish(), out);
      return false;
    }
    double start = 50;  // bytes of a texel grow about as exp(quality / 30)
    if (rate_.texels > 0)
      start = rate_.quality + 30 * portable::log(rate_.texels / texels * room / rate_.bytes);
    const auto bytes_of_pictures = [&](double q) {
      return static_cast<std::uint64_t>(std::max(static_cast<double>(file_at(q).size()) - fixed, 1.0));
    };
    const double best = maps.empty()
                            ? kHighestQuality
                            : quality_for(most, start, quick ? kRoughly : kNearlyAll,
                                          quick ? kQuickTries : kQualityTries, bytes_of_pictures, learns);
    take(best);
    const double filled = maps.empty() ? room : std::max(static_cast<double>(out.glb.size()) - fixed, 1.0);
    if (!(quick ? filled <= most : fits(out))) return false;
    if (!reference_.wishes.fast()) measure(draft.finish(), out, in_whole);
    if (!quick) return best >= kPoorQuality;
    rate_ = {best, texels, filled};
    // As if it filled the bytes.
    out.difference *= portable::pow(filled / room, kSmallerLoses);
    out.glb.resize(std::min<std::size_t>(out.glb.size(), bytes_));
    return best + 30 * portable::log(room / filled) >= kPoorQuality;
  }

  const Reference& reference_;
  const std::uint64_t bytes_;
  ProxyDifferences& whole_;
  Extracted best_;
  /// What pictures of so many texels take.
  struct Rate {
    double quality = 50, texels = 0, bytes = 1;
  };
  Rate rate_;  // of the last file that was coded quickly
  // Of one proxy:
  std::map<std::pair<std::size_t, int>, std::optional<StandaloneGlb>> meshes_;  // by mesh, bits
  std::map<std::tuple<bool, bool, std::size_t, int>, StandaloneGlb> files_;     // by maps, mesh, bits
  std::map<std::tuple<bool, bool, double>, std::vector<ProxyMap>> maps_;        // by maps, share
};

}  // namespace

Extracted extract_proxy(PackageReader& package, const ExtractProxy& wishes, const OutputTransform& place,
                        const RunContext& context, std::uint64_t asked_bytes) {
  const Manifest& m = package.manifest();
  const Bytes glb = package.proxy_glb(wishes.proxy);  // refuses a proxy that is not there
  StandaloneGlb file(glb, proxy_path(wishes.proxy), GlbRules::kStandalone);
  if (wishes.plain) file = plain_file(file, proxy_path(wishes.proxy), context);
  file.place(place);
  file.set_about(asked_bytes > 0 ? reserved_about(package.about(), place, asked_bytes)
                                 : transformed_about(package.about(), place));
  Extracted out;
  out.scale = m.scales.back().scale;
  out.levels = {out.scale};
  out.proxy = wishes.proxy;
  out.triangles = m.proxies[wishes.proxy].triangles;
  out.glb = file.finish();
  out.mesh_bytes = out.glb.size();
  out.asked_bytes = asked_bytes;
  return out;
}

Extracted or_of_proxy(const Reference& reference, std::uint64_t bytes, ProxyDifferences& differences,
                      Extracted found) {
  const ExtractBudget& wishes = reference.wishes;
  if (wishes.scale || wishes.levels || wishes.images == ExtractImages::kPng) return found;
  return ProxySearch(reference, bytes, differences, std::move(found)).nearest();
}

}  // namespace texmesh
