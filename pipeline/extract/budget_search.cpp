#include "pipeline/extract/budget_search.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <set>

#include "format/portable_math.h"
#include "pipeline/extract/picture_meter.h"
#include "pipeline/extract/standalone_glb.h"
#include "pipeline/extract/texture_source.h"
#include "pipeline/import/import.h"
#include "stages/parallel.h"

namespace texmesh {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr int kViews = 5;
constexpr double kDefaultDisplayPx = 512;
constexpr double kLeastShare = 0.98;      // of the bytes asked for
constexpr double kReferenceTexels = 8e6;  // of all colours together: finer ones cost memory and show nothing
constexpr double kTexelsPerByte = 40;     // more texels than that are never worth a byte
constexpr double kTypicalTexelsPerByte = 6;  // where the search begins
constexpr std::uint32_t kLeastSide = 4;
constexpr int kSteps = 30;  // of texture sizes, each 1 / sqrt 2 of the one before
constexpr double kLowestQuality = 1, kHighestQuality = 100;
constexpr double kFullChromaFrom = 75;  // below, 4:2:0 is always better
constexpr double kNormalQuality = 75, kDataQuality = 60;

class NoFiles : public Resolver {
  std::optional<Bytes> read(const std::string&, std::uint64_t) override { return std::nullopt; }
};

/// The mesh and materials of a file. Its images become single texels, all different (import makes equal ones
/// one), named by the number of the source image.
Model read_model(StandaloneGlb file, const std::string& entry, const RunContext& context) {
  std::map<std::uint32_t, FileImageData> images;
  for (const std::uint32_t i : file.source_images()) {
    const auto byte = [i](int shift) { return static_cast<std::uint8_t>(i >> shift); };
    images[i] = {FileImage::kPng, encode_image({1, 1, 3, {byte(0), byte(8), byte(16)}}, {FileImage::kPng})};
  }
  file.set_images(images);
  NoFiles none;
  return import_gltf(entry, file.finish(), none, {}, context).model;
}

ShownModel shown(const Model& model) {
  ShownModel out{&model.mesh, &model.materials, {}};
  for (const Image& i : model.images) out.image_names.push_back(i.name);
  return out;
}

double mean_edge(const Mesh& mesh) {
  double sum = 0;
  std::size_t count = 0;
  for (const Triangle& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k, ++count)
      sum += length(to_double(mesh.positions[mesh.wedge_position[t[k]]]) -
                    to_double(mesh.positions[mesh.wedge_position[t[(k + 1) % 3]]]));
  return count ? sum / static_cast<double>(count) : 0;
}

/// As import names images: without the folder.
std::string image_name(std::uint32_t image) { return std::to_string(image); }

std::uint32_t side_of(std::uint32_t full, double share) {
  const double side = std::floor(static_cast<double>(full) * share + 0.5);
  return static_cast<std::uint32_t>(
      std::clamp(side, std::min<double>(kLeastSide, full), static_cast<double>(full)));
}

double size_step(int k) {
  double share = 1;
  for (; k >= 2; k -= 2) share /= 2;
  return k == 1 ? share / std::sqrt(2.0) : share;
}

MipTexture decoded_texture(const Bytes& file) {
  return mip_texture(decode_image(probe_image("texture", file, {})));
}

/// Quality for which bytes(quality) comes to at most `wanted`, by the secant of their logarithm, within
/// `near` of it where the range allows. Calls bytes() at most `tries` times.
template <class F>
double quality_for(double wanted, double start, double near, int tries, const F& bytes) {
  double low = kLowestQuality, high = kHighestQuality, at = std::clamp(start, low, high);
  double low_bytes = 0, high_bytes = 0, best = kLowestQuality;
  for (int i = 0; i < tries && high - low > 0.01; ++i) {
    const double found = static_cast<double>(bytes(at));
    if (found <= wanted) {
      best = std::max(best, at);
      low = at, low_bytes = found;
      if (found >= near * wanted || at >= kHighestQuality) break;
    } else {
      high = at, high_bytes = found;
      if (at <= kLowestQuality) break;
    }
    // Bytes grow about as exp(quality / 30) in the middle of the scale.
    double next = at + 30 * portable::log(std::max(wanted, 1.0) * (1 + near) / 2 / std::max(found, 1.0));
    if (low_bytes > 0 && high_bytes > low_bytes)
      next = low + (high - low) * portable::log(wanted * (1 + near) / 2 / low_bytes) /
                       portable::log(high_bytes / low_bytes);
    // Never nearer to an end than a tenth of what is left, so that a bent curve does not stall the search.
    const double margin = (high - low) * 0.1;
    at = std::clamp(next, low_bytes > 0 ? low + margin : kLowestQuality,
                    high_bytes > 0 ? high - margin : kHighestQuality);
  }
  return best;
}

/// Which mesh: an index into the manifest's scales, and how finely it is coded.
struct Key {
  std::size_t scale = 0;
  bool fine = false;
  friend auto operator<=>(const Key&, const Key&) = default;
};

/// A scale (with its coarser levels, where they are asked for) that could be the mesh of the file.
struct Candidate {
  int scale = 0;
  std::vector<int> levels;
  std::unique_ptr<StandaloneGlb> file;
  Model model;
  std::unique_ptr<ModelViews> views;
  std::uint64_t fixed_bytes = 0;  // the file without its images' bytes
  double geometry = 0;            // difference with the best textures
  std::uint64_t triangles = 0;
};

/// A way to code colours. At some 0.1 bytes per texel and more JPEG looks better than WebP, whose 8-bit YCbCr
/// of limited range never comes nearer than FLIP 0.02 on a photograph; below, WebP does.
struct ColourCoding {
  FileImage format = FileImage::kWebp;
  bool full_chroma = false;
};

/// A size of textures, at the quality that fills the bytes.
struct TexturePoint {
  int step = 0;
  ColourCoding coding;
  double quality = 0;
  double difference = 1e9;
};

class BudgetSearch {
 public:
  BudgetSearch(PackageReader& package, const ExtractRequest& request, const RunContext& context)
      : package_(package),
        request_(request),
        context_(context),
        display_px_(request.display_px > 0 ? request.display_px : kDefaultDisplayPx),
        textures_(package, std::max(kTexelsPerByte * static_cast<double>(request.bytes), 65536.0), context) {
    context_.progress = nullptr;
    for (std::size_t i = 0; i < textures_.images().size(); ++i)
      (textures_.images()[i].colours ? colours_ : data_).push_back(i);
    format_ = request.images == ExtractImages::kJpeg  ? FileImage::kJpeg
              : request.images == ExtractImages::kPng ? FileImage::kPng
                                                      : FileImage::kWebp;
    codings_ = {{format_, false}};
    if (request.images == ExtractImages::kAuto) codings_.push_back({FileImage::kJpeg, false});
    if (codings_.back().format == FileImage::kJpeg) codings_.push_back({FileImage::kJpeg, true});
  }

  Extracted run() {
    make_reference();
    const Key best = choose_mesh();
    return finish(candidate(best), best_point(best));
  }

 private:
  std::uint32_t side_px() const { return static_cast<std::uint32_t>(std::clamp(display_px_, 64.0, 768.0)); }

  // ---- The reference

  void make_reference() {
    source_ = read_model({package_.scale_glb(0), mesh_path(0)}, mesh_path(0), context_);
    cameras_ = cameras_around(source_.mesh, kViews);
    double texels = 0;
    for (const std::size_t i : colours_)
      texels += static_cast<double>(textures_.images()[i].width_px) * textures_.images()[i].height_px;
    const double share = std::min(1.0, std::sqrt(kReferenceTexels / std::max(texels, 1.0)));
    for (const std::size_t i : colours_) {
      const PackageImage& image = textures_.images()[i];
      reference_textures_[image_name(image.image)] = mip_texture(
          textures_.texels(i, side_of(image.width_px, share), side_of(image.height_px, share), {}));
    }
    const ModelViews views(shown(source_), cameras_, side_px(), context_);
    meter_ = std::make_unique<PictureMeter>(views.draw(reference_textures_, context_), context_);
  }

  // ---- Scales

  /// How fine the mesh is coded: places to 1/8 of the mean edge as the package does for S_0, texture
  /// coordinates to half a texel of the textures that so many bytes allow.
  DracoSteps steps_for(const Mesh& mesh, bool fine) const {
    const double texels = static_cast<double>(request_.bytes) * 4 /
                          static_cast<double>(std::max<std::size_t>(colours_.size(), 1));
    DracoSteps steps;
    steps.position = std::max(mean_edge(mesh) / (fine ? 24 : 8), 1e-30);
    steps.uv = (fine ? 0.25 : 0.5) / std::clamp(std::sqrt(texels), 128.0, 8192.0);
    steps.normal_bits = fine ? 10 : 8;
    steps.colour_bits = fine ? 8 : 6;
    return steps;
  }

  std::unique_ptr<StandaloneGlb> coarser_coded(int scale, bool fine) {
    auto file = std::make_unique<StandaloneGlb>(package_.scale_glb(scale), mesh_path(scale));
    if (file->has_draco()) file->recode(steps_for(read_model(*file, mesh_path(scale), context_).mesh, fine));
    return file;
  }

  const Candidate& candidate(const Key& key) {
    const auto [it, fresh] = candidates_.try_emplace(key);
    Candidate& c = it->second;
    if (!fresh) return c;
    const Manifest& m = package_.manifest();
    c.scale = m.scales[key.scale].scale;
    c.triangles = m.scales[key.scale].triangles;
    c.levels = request_.lods ? levels_of(m, c.scale) : std::vector<int>{c.scale};
    c.file = coarser_coded(c.scale, key.fine);
    c.model = read_model(*c.file, mesh_path(c.scale), context_);
    if (request_.lods) c.file->begin_levels(screen_coverage_of(m, c.scale));
    for (std::size_t l = 1; l < c.levels.size(); ++l)
      c.file->add_level(*coarser_coded(c.levels[l], key.fine), screen_coverage_of(m, c.levels[l]));
    c.fixed_bytes = assembled(c, {}).size();
    c.views = std::make_unique<ModelViews>(shown(c.model), cameras_, side_px(), context_);
    c.geometry = meter_->difference(c.views->draw(reference_textures_, context_), context_);
    return c;
  }

  /// The file with these images; those that are missing have no bytes.
  static Bytes assembled(const Candidate& c, const std::map<std::uint32_t, FileImageData>& images) {
    StandaloneGlb file = *c.file;
    std::map<std::uint32_t, FileImageData> all;
    for (const std::uint32_t i : file.source_images()) all[i] = {FileImage::kWebp, {}};
    for (const auto& [i, data] : images) all[i] = data;
    file.set_images(all);
    return file.finish();
  }

  /// The scale by lean coding of the mesh, then whether finer coding is worth its bytes.
  Key choose_mesh() {
    Key best = choose_scale();
    const Key fine{best.scale, true};
    return difference_of(fine) < difference_of(best) ? fine : best;
  }

  /// From the finest scale that leaves half of the bytes to textures towards both sides, as long as the
  /// picture gets better; one that does not is passed over once. Scales whose mesh alone is as different as
  /// the best file so far are not tried.
  Key choose_scale() {
    const std::vector<ManifestScale>& scales = package_.manifest().scales;
    if (request_.scale) return {index_of(*request_.scale), false};
    const double part = textures_.images().empty() ? 1.0 : 0.5;
    std::size_t start = scales.size() - 1;
    for (std::size_t k = 0; k < scales.size() && start + 1 == scales.size(); ++k)
      if (static_cast<double>(scales[k].glb.bytes) <= part * static_cast<double>(request_.bytes)) start = k;
    Key best{start, false};
    double least = difference_of(best);
    const auto better = [&](const Key& key) {
      if (candidate(key).geometry >= least) return false;
      const double found = difference_of(key);
      if (found >= least) return false;
      least = found;
      best = key;
      return true;
    };
    int worse = 0;
    for (std::size_t k = start; k > 0 && worse < 2; --k) {
      if (candidate({k - 1, false}).fixed_bytes >= request_.bytes) break;
      worse = better({k - 1, false}) ? 0 : worse + 1;
    }
    if (best.scale != start) return best;
    worse = 0;
    for (std::size_t k = start + 1; k < scales.size() && worse < 2; ++k)
      worse = better({k, false}) ? 0 : worse + 1;
    return best;
  }

  std::size_t index_of(int scale) const {
    const std::vector<ManifestScale>& scales = package_.manifest().scales;
    for (std::size_t k = 0; k < scales.size(); ++k)
      if (scales[k].scale == scale) return k;
    throw InputError(package_.store().name(), "scale " + std::to_string(scale), "a scale of the package",
                     "none");
  }

  double difference_of(const Key& key) {
    const Candidate& c = candidate(key);
    if (c.fixed_bytes > request_.bytes) return 1e9;
    return colours_.empty() ? c.geometry : best_point(key).difference;
  }

  // ---- Textures

  /// Bytes that are left for textures of colours, once those of data have their share.
  double colour_bytes(const Candidate& c) const {
    const double left = static_cast<double>(request_.bytes) - static_cast<double>(c.fixed_bytes);
    return colours_.empty() ? 0 : left * (1 - data_share());
  }
  double data_share() const {
    if (colours_.empty()) return 1;
    double share = 0;
    for (const std::size_t i : data_) share += textures_.images()[i].role == "normal" ? 0.12 : 0.05;
    return std::min(share, 0.25);
  }

  const TexturePoint& best_point(const Key& key) {
    const Candidate& c = candidate(key);
    const auto known = points_.find(key);
    if (known != points_.end()) return known->second;
    double texels = 0;
    for (const std::size_t i : colours_)
      texels += static_cast<double>(textures_.images()[i].width_px) * textures_.images()[i].height_px;
    const double wanted = std::max(colour_bytes(c), 1.0) * kTypicalTexelsPerByte;
    int step = 0;
    while (step + 1 < kSteps && texels * size_step(step) * size_step(step) > wanted) ++step;
    std::map<int, TexturePoint> tried;
    const auto at = [&](int s) -> const TexturePoint& {
      const auto [it, fresh] = tried.try_emplace(s);
      if (fresh) it->second = measure(c, s);
      return it->second;
    };
    if (!colours_.empty()) {
      while (step > 0 && at(step - 1).difference < at(step).difference) --step;
      while (step + 1 < kSteps && at(step + 1).difference < at(step).difference) ++step;
    }
    return points_[key] =
               colours_.empty() ? TexturePoint{0, {format_, false}, kHighestQuality, c.geometry} : at(step);
  }

  std::vector<Pixels> texels_of(const Candidate& c, const std::vector<std::size_t>& which, double share) {
    std::vector<Pixels> out;
    for (const std::size_t i : which) {
      const PackageImage& image = textures_.images()[i];
      const double most = std::min(share, textures_.largest(i));
      const std::uint32_t width = side_of(image.width_px, most), height = side_of(image.height_px, most);
      std::vector<std::uint8_t> coverage;
      if (format_ != FileImage::kPng) {
        coverage = coverage_by(source_, image.image, width, height);
        const std::vector<std::uint8_t> own = coverage_by(c.model, image.image, width, height);
        for (std::size_t b = 0; b < coverage.size(); ++b)
          coverage[b] = static_cast<std::uint8_t>(coverage[b] | own[b]);
      }
      out.push_back(textures_.texels(i, width, height, coverage));
    }
    return out;
  }

  static std::vector<std::uint8_t> coverage_by(const Model& model, std::uint32_t image, std::uint32_t width,
                                               std::uint32_t height) {
    for (std::size_t k = 0; k < model.images.size(); ++k)
      if (model.images[k].name == image_name(image))
        return coverage_of(model.mesh, model.materials, static_cast<std::int32_t>(k), width, height);
    return std::vector<std::uint8_t>((std::size_t{width} + 7) / 8 * height);
  }

  /// Images with alpha are no JPEGs.
  FileImage format_for(const Pixels& pixels, FileImage wanted) const {
    if (wanted != FileImage::kJpeg || pixels.channels != 4) return wanted;
    return format_ == FileImage::kJpeg ? FileImage::kPng : format_;
  }

  std::vector<FileImageData> encoded(const std::vector<Pixels>& pixels, const ColourCoding& coding,
                                     double quality, bool quick) const {
    std::vector<FileImageData> out(pixels.size());
    parallel_for(context_, pixels.size(), 1, [&](std::size_t begin, std::size_t end) {
      for (std::size_t k = begin; k < end; ++k) {
        const FileImage format = format_for(pixels[k], coding.format);
        out[k] = {format, encode_image(pixels[k], {format, quality, false, quick, coding.full_chroma})};
      }
    });
    return out;
  }
  static std::uint64_t total(const std::vector<FileImageData>& images) {
    std::uint64_t sum = 0;
    for (const FileImageData& i : images) sum += (i.bytes.size() + 3) / 4 * 4;
    return sum;
  }

  /// The best way to code colours at this size within their bytes, and how different the file then is.
  TexturePoint measure(const Candidate& c, int step) {
    const std::vector<Pixels> pixels = texels_of(c, colours_, size_step(step));
    TexturePoint best{step, {format_, false}, 0, 1e9};
    for (const ColourCoding& coding : codings_) {
      if (coding.full_chroma && best.quality < kFullChromaFrom) continue;
      const TexturePoint found = measure(c, step, coding, pixels);
      if (found.difference < best.difference) best = found;
    }
    return best;
  }

  TexturePoint measure(const Candidate& c, int step, const ColourCoding& coding,
                       const std::vector<Pixels>& pixels) {
    const double wanted = colour_bytes(c);
    std::map<double, std::vector<FileImageData>> files;
    double& start = last_quality_[coding.format];
    TexturePoint point{step, coding, 0, 1e9};
    point.quality = quality_for(wanted, start > 0 ? start : 50, 0.96, 6, [&](double q) {
      files[q] = encoded(pixels, coding, q, true);
      return total(files[q]);
    });
    if (!files.count(point.quality)) files[point.quality] = encoded(pixels, coding, point.quality, true);
    const std::vector<FileImageData>& chosen = files[point.quality];
    if (static_cast<double>(total(chosen)) > wanted) return point;
    start = point.quality;
    std::map<std::string, MipTexture> textures;
    for (std::size_t k = 0; k < colours_.size(); ++k)
      textures[image_name(textures_.images()[colours_[k]].image)] = decoded_texture(chosen[k].bytes);
    point.difference = meter_->difference(c.views->draw(textures, context_), context_);
    return point;
  }

  // ---- The file

  struct Result {
    std::map<std::uint32_t, FileImageData> images;
    std::vector<ExtractedImage> rows;
    Bytes glb;
  };

  void add(Result& r, std::size_t index, const Pixels& pixels, FileImageData file, double quality) const {
    const PackageImage& image = textures_.images()[index];
    const double q = file.format == FileImage::kPng    ? 100
                     : file.format == FileImage::kJpeg ? std::floor(quality + 0.5)
                                                       : quality;
    r.rows.push_back(
        {image.image, image.role, file.format, pixels.width_px, pixels.height_px, q, file.bytes.size()});
    r.images[image.image] = std::move(file);
  }

  /// Textures of data at the largest size that their share allows.
  void add_data(const Candidate& c, double bytes, Result& r) {
    double weights = 0;
    const auto weight = [&](std::size_t i) { return textures_.images()[i].role == "normal" ? 0.12 : 0.05; };
    for (const std::size_t i : data_) weights += weight(i);
    for (const std::size_t i : data_) {
      const double quality = textures_.images()[i].role == "normal" ? kNormalQuality : kDataQuality;
      const double most = bytes * weight(i) / weights;
      for (int k = 0; k < 2 * kSteps; ++k) {
        const double share = size_step(k / 2) * (k % 2 ? std::sqrt(std::sqrt(0.5)) : 1.0);
        const PackageImage& image = textures_.images()[i];
        const bool last = side_of(std::max(image.width_px, image.height_px), share) <= kLeastSide;
        // Nothing is coded in a 40th of a byte per texel.
        const double texels = static_cast<double>(image.width_px) * image.height_px * share * share;
        if (texels > kTexelsPerByte * most && !last) continue;
        const std::vector<Pixels> pixels = texels_of(c, {i}, share);
        FileImageData file{format_for(pixels[0], format_), {}};
        file.bytes = encode_image(pixels[0], {file.format, quality, true, false, false});
        if (static_cast<double>(file.bytes.size()) > most && !last) continue;
        add(r, i, pixels[0], std::move(file), quality);
        break;
      }
    }
  }

  Result with_colours(const Candidate& c, const Result& data, const std::vector<Pixels>& pixels,
                      const ColourCoding& coding, double quality) const {
    Result r = data;
    std::vector<FileImageData> files = encoded(pixels, coding, quality, false);
    for (std::size_t k = 0; k < files.size(); ++k)
      add(r, colours_[k], pixels[k], std::move(files[k]), quality);
    std::sort(r.rows.begin(), r.rows.end(), [](const auto& a, const auto& b) { return a.image < b.image; });
    r.glb = assembled(c, r.images);
    return r;
  }

  bool fits(const Result& r) const { return r.glb.size() <= request_.bytes; }
  bool fills(const Result& r) const {
    return fits(r) && static_cast<double>(r.glb.size()) >= kLeastShare * static_cast<double>(request_.bytes);
  }

  /// The largest file within the limit by quality, then by size of the textures.
  Result fill(const Candidate& c, const TexturePoint& point) {
    Result data;
    const double left = static_cast<double>(request_.bytes) - static_cast<double>(c.fixed_bytes);
    add_data(c, std::max(left, 0.0) * data_share(), data);
    double share = size_step(point.step);
    std::vector<Pixels> pixels = texels_of(c, colours_, share);
    Result best = with_colours(c, data, pixels, point.coding, kLowestQuality);
    const auto better = [&](Result&& r) {
      if (fits(r) && (!fits(best) || r.glb.size() > best.glb.size())) best = std::move(r);
    };
    double quality = point.quality;
    if (!colours_.empty() && format_ != FileImage::kPng)
      quality = quality_for(static_cast<double>(request_.bytes), point.quality, 0.99, 14, [&](double q) {
        Result r = with_colours(c, data, pixels, point.coding, q);
        const std::size_t bytes = r.glb.size();
        better(std::move(r));
        return bytes;
      });
    if (fills(best) || colours_.empty()) return best;
    // The quality alone does not do it: its ends, or a lossless format, or a tiny image. Sizes do the rest.
    double low = fits(best) ? share : 0, high = fits(best) ? 1 : share;
    for (int i = 0; i < 16 && !fills(best); ++i) {
      share = i == 0 && low > 0 ? 1 : (low + high) / 2;
      Result r = with_colours(c, data, texels_of(c, colours_, share), point.coding, quality);
      (fits(r) ? low : high) = share;
      const bool whole = share >= 1 && fits(r);
      better(std::move(r));
      if (whole) break;
    }
    for (const ColourCoding& coding : codings_)  // near the largest file of all, another coding may reach on
      if (fits(best) && !fills(best) && format_ != FileImage::kPng)
        quality_for(static_cast<double>(request_.bytes), kHighestQuality, 0.99, 8, [&](double q) {
          Result r = with_colours(c, data, texels_of(c, colours_, share), coding, q);
          const std::size_t bytes = r.glb.size();
          better(std::move(r));
          return bytes;
        });
    if (fits(best)) return best;
    return with_colours(c, smallest_data(c), texels_of(c, colours_, 0), {format_, false}, kLowestQuality);
  }
  Result smallest_data(const Candidate& c) {
    Result data;
    add_data(c, 0, data);
    return data;
  }

  Extracted finish(const Candidate& c, const TexturePoint& point) {
    Result r = fill(c, point);
    Extracted out;
    out.scale = c.scale;
    out.levels = c.levels;
    out.triangles = c.triangles;
    out.within = fills(r);
    out.views = kViews;
    out.side_px = side_px();
    out.mesh_difference = c.geometry;
    out.images = r.rows;
    out.mesh_bytes = r.glb.size();
    for (const ExtractedImage& i : r.rows) out.mesh_bytes -= i.bytes;
    std::map<std::string, MipTexture> textures;
    for (const std::size_t i : colours_) {
      const std::uint32_t image = textures_.images()[i].image;
      textures[image_name(image)] = decoded_texture(r.images.at(image).bytes);
    }
    out.difference = meter_->difference(c.views->draw(textures, context_), context_);
    out.glb = std::move(r.glb);
    return out;
  }

  PackageReader& package_;
  ExtractRequest request_;
  RunContext context_;
  double display_px_;
  TextureSource textures_;
  std::vector<std::size_t> colours_, data_;  // indices into textures_.images()
  FileImage format_ = FileImage::kWebp;
  Model source_;
  std::vector<ViewCamera> cameras_;
  std::map<std::string, MipTexture> reference_textures_;
  std::unique_ptr<PictureMeter> meter_;
  std::map<Key, Candidate> candidates_;
  std::map<Key, TexturePoint> points_;
  std::vector<ColourCoding> codings_;  // those that compete
  std::map<FileImage, double> last_quality_;
};

}  // namespace

std::vector<int> levels_of(const Manifest& manifest, int finest) {
  std::vector<int> out{finest};
  for (const ManifestScale& s : manifest.scales)
    if (s.major && s.scale > finest) out.push_back(s.scale);
  return out;
}

double screen_coverage_of(const Manifest& manifest, int scale) {
  constexpr double kScreenPx = 1080;
  double below = 0;  // displayed height up to which a coarser scale is enough
  for (const ManifestStep& s : manifest.steps)
    if (s.scale > scale) below = std::max(below, s.up_to_px);
  const double share = std::min(1.0, below / kScreenPx);
  return share * share;
}

Extracted extract_bytes(PackageReader& package, const ExtractRequest& request, const RunContext& context) {
  return BudgetSearch(package, request, context).run();
}

}  // namespace texmesh
