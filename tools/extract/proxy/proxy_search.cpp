#include "tools/extract/proxy/proxy_search.h"

#include "format/base/portable_math.h"
#include "pipeline/about/gltf_about.h"
#include "pipeline/io/file_resolver.h"
#include "stages/gltf/glb_container.h"
#include "tools/extract/budget/filling.h"
#include "tools/extract/glb/scale_file.h"
#include "tools/extract/proxy/proxy_parts.h"
#include "tools/render/rendered_model.h"

namespace texmesh {
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
constexpr int kQualityTries = 10;
constexpr double kNearlyAll = 0.99;

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
  /// `whole`: differences of proxies as they are, for those that are known.
  ProxySearch(const Reference& reference, std::uint64_t bytes, std::map<std::uint32_t, double>& whole,
              Extracted& found)
      : reference_(reference), bytes_(bytes), whole_(whole), best_(found) {}

  void run() {
    const auto count = static_cast<std::uint32_t>(reference_.package.manifest().proxies.size());
    for (std::uint32_t k = 0; k < count; ++k) {
      Extracted whole =
          extract_proxy(reference_.package, {k}, reference_.recentre, reference_.context, bytes_);
      measure_whole(k, whole);
      if (!is_wanted_kind(k))
        offer_smaller(k, whole);
      else if (fits(whole) || !(whole.difference < best_.difference || !fits(best_)))
        offer(std::move(whole));  // what is made of it looks no better
      else
        offer_smaller(k, whole);
    }
  }

 private:
  bool fits(const Extracted& file) const { return file.glb.size() <= bytes_; }

  /// Whether the proxy's own images are of the format that is asked for.
  bool is_wanted_kind(std::uint32_t proxy) const {
    const ExtractImages wanted = reference_.wishes.images;
    if (wanted == ExtractImages::kAuto) return true;
    const GlbParts chunks = read_glb(reference_.package.proxy_glb(proxy), proxy_path(proxy));
    const char* mime = mime_type_of(wanted == ExtractImages::kWebp ? FileImage::kWebp : FileImage::kJpeg);
    const auto images = chunks.root.value("images", nlohmann::ordered_json::array());
    return std::ranges::all_of(images,
                               [&](const auto& image) { return image.value("mimeType", "") == mime; });
  }

  void measure_whole(std::uint32_t proxy, Extracted& file) {
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

  void measure(const Bytes& glb, Extracted& file) {
    NoFiles none;
    RenderedModel model =
        rendered_model(import_package_glb("proxy.glb", glb, none, reference_.context), reference_.context);
    const LitMesh mesh{std::move(model.mesh), std::move(model.materials), model.textures.size()};
    const LitViews views(mesh, reference_.cameras, reference_.context);
    set_difference(reference_.whole_meter->difference(views, model.textures, reference_.context), file);
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

  /// From the usual way to the best one, one choice after the other, as long as the picture gets better.
  void offer_smaller(std::uint32_t proxy, const Extracted& whole) {
    const auto parts =
        ProxyParts::read(reference_.package.proxy_glb(proxy), proxy_path(proxy), reference_.context);
    if (!parts) return;
    files_.clear();
    ProxyTrial trial;
    if (reference_.wishes.images == ExtractImages::kJpeg) trial.format = FileImage::kJpeg;
    const double most = kMostMesh * static_cast<double>(bytes_);
    while (trial.mesh + 1 < parts->mesh_count() &&
           static_cast<double>(coded(*parts, trial).finish().size()) > most)
      ++trial.mesh;
    Extracted file = whole;
    while (!make(*parts, trial, file) && trial.share * kShareStep > kLeastProxyShare)
      trial.share *= kShareStep;
    std::vector<ProxyTrial> seen{trial};
    const auto try_next = [&](const ProxyTrial& next) {
      if (std::ranges::find(seen, next) != seen.end()) return false;
      seen.push_back(next);
      Extracted other = whole;
      make(*parts, next, other);
      if (!better(other, file)) return false;
      file = std::move(other);
      trial = next;
      return true;
    };
    for (bool again = true; again;) {
      again = false;
      for (const ProxyTrial& next : other_maps(*parts, trial)) again |= try_next(next);
      for (const double step : {kShareStep, 1 / kShareStep})
        while (try_next(resized(trial, step))) again = true;
      while (trial.mesh + 1 < parts->mesh_count() && try_next(with_mesh(trial, trial.mesh + 1))) again = true;
      while (trial.mesh > 0 && try_next(with_mesh(trial, trial.mesh - 1))) again = true;
      for (const int bits : {trial.bits - 1, trial.bits + 1})
        if (bits >= 0 && bits <= kFinestBits) again |= try_next(with_bits(trial, bits));
    }
    if (reference_.wishes.images == ExtractImages::kAuto) {
      ProxyTrial jpeg = trial;
      jpeg.format = FileImage::kJpeg;
      try_next(jpeg);
    }
    offer(std::move(file));
  }

  static ProxyTrial resized(ProxyTrial trial, double times) {
    trial.share = std::clamp(trial.share * times, kLeastProxyShare, 1.0);
    return trial;
  }

  static ProxyTrial with_mesh(ProxyTrial trial, std::size_t mesh) {
    trial.mesh = mesh;
    return trial;
  }
  static ProxyTrial with_bits(ProxyTrial trial, int bits) {
    trial.bits = bits;
    return trial;
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
    return files_
        .emplace(key, parts.file(trial.maps, trial.mesh, steps_of(parts, trial.bits), reference_.context))
        .first->second;
  }

  static double quality_of(const ProxyMap& map, double quality) {
    if (map.use == ProxyMap::Use::kNormal) quality += kNormalQualityAbove;
    if (map.use == ProxyMap::Use::kData) quality -= kDataQualityBelow;
    return std::clamp(quality, kLowestQuality, kHighestQuality);
  }

  /// The pictures at a quality, and the report's rows of them.
  std::map<std::uint32_t, FileImageData> pictures(const std::vector<ProxyMap>& maps, const ProxyTrial& trial,
                                                  double quality, std::vector<ExtractedImage>& rows) const {
    std::map<std::uint32_t, FileImageData> out;
    rows.clear();
    for (const ProxyMap& map : maps) {
      const auto k = static_cast<std::uint32_t>(rows.size());
      const FileImage format = map.pixels.channels < 4                            ? trial.format
                               : reference_.wishes.images == ExtractImages::kJpeg ? FileImage::kPng
                                                                                  : FileImage::kWebp;
      const double q = quality_of(map, quality);
      const bool numbers = map.averaging() != Averaging::kLight;
      out[k] = {format, encode_image(map.pixels, {format, q, numbers, false, true})};
      rows.push_back(
          {k, map.role(), format, map.pixels.width_px, map.pixels.height_px, q, out[k].bytes.size()});
    }
    return out;
  }

  /// The file that fills the bytes by its quality, and what it looks like. False where the quality is poor or
  /// the file too large; then it is not looked at.
  bool make(const ProxyParts& parts, const ProxyTrial& trial, Extracted& out) {
    StandaloneGlb draft = coded(parts, trial), whole = draft;
    if (!reference_.recentre) whole.move_to(reference_.package.manifest().origin);
    whole.set_about(about_within(reference_.package.about(), bytes_ / kAboutShare));
    std::vector<ProxyMap> maps = parts.maps(trial.maps);
    for (ProxyMap& map : maps) map.pixels = smaller_map(map, trial.share);
    std::map<double, Bytes> files;
    const auto file_at = [&](double quality) {
      whole.set_images(pictures(maps, trial, quality, out.images));
      return files[quality] = whole.finish();
    };
    const double best = maps.empty() ? kHighestQuality
                                     : quality_for(static_cast<double>(bytes_), 50, kNearlyAll, kQualityTries,
                                                   [&](double q) { return file_at(q).size(); });
    draft.set_images(pictures(maps, trial, best, out.images));
    out.glb = files.contains(best) ? files[best] : file_at(best);
    out.mesh_bytes = out.glb.size();
    out.triangles = parts.triangles(trial.mesh);
    for (const ExtractedImage& i : out.images) out.mesh_bytes -= i.bytes;
    if (!fits(out)) return false;
    measure(draft.finish(), out);
    return best >= kPoorQuality;
  }

  const Reference& reference_;
  const std::uint64_t bytes_;
  std::map<std::uint32_t, double>& whole_;
  Extracted& best_;
  std::map<std::tuple<bool, bool, std::size_t, int>, StandaloneGlb> files_;  // of one proxy: maps, mesh, bits
};

}  // namespace

Extracted extract_proxy(PackageReader& package, const ExtractProxy& wishes, bool recentre,
                        const RunContext& context, std::uint64_t asked_bytes) {
  const Manifest& m = package.manifest();
  const Bytes glb = package.proxy_glb(wishes.proxy);  // refuses a proxy that is not there
  StandaloneGlb file(glb, proxy_path(wishes.proxy), GlbRules::kStandalone);
  if (wishes.plain) file = plain_file(file, proxy_path(wishes.proxy), context);
  if (!recentre) file.move_to(m.origin);
  file.set_about(asked_bytes > 0 ? about_within(package.about(), asked_bytes / kAboutShare)
                                 : package.about());
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

void offer_proxies(const Reference& reference, std::uint64_t bytes,
                   std::map<std::uint32_t, double>& differences, Extracted& found) {
  const ExtractBudget& wishes = reference.wishes;
  if (!wishes.scale && !wishes.levels && wishes.images != ExtractImages::kPng)
    ProxySearch(reference, bytes, differences, found).run();
}

}  // namespace texmesh
