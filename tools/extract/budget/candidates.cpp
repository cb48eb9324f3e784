#include "tools/extract/budget/candidates.h"

#include "format/base/portable_math.h"
#include "stages/base/parallel.h"
#include "stages/image/decode_image.h"
#include "tools/extract/glb/scale_file.h"

namespace texmesh {
namespace {

constexpr std::size_t kTrialsAtOnce = 24;  // a megabyte or two each

/// Bits per coordinate along the longest side of the object, of texture coordinates along the image, of
/// normals and vertex colours; for pictures 512 px high.
struct Coding {
  int position, uv, normal, colour;
};
constexpr Coding kCodings[kMeshCodings] = {{10, 10, 7, 5}, {11, 11, 7, 6}, {12, 12, 8, 7},
                                           {13, 13, 8, 8}, {14, 14, 9, 8}, {15, 14, 11, 8}};

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

DracoSteps Candidates::steps_of(const MeshKey& key) const {
  const Coding& c = kCodings[key.coding];
  int finer = 0;  // a picture twice as high shows one bit more
  for (double px = 512 * 1.5; px < reference_.wishes.display_px && finer < 4; px *= 2) ++finer;
  const auto places = [&](int bits) {
    return portable::exp(portable::log(2) * (bits + finer + key.extra_bits));
  };
  return {reference_.extent / places(c.position), 1 / places(c.uv), c.normal, c.colour, key.extra_bits != 0};
}

std::unique_ptr<StandaloneGlb> Candidates::recoded_scale(int scale, const MeshKey& key) const {
  auto file = std::make_unique<StandaloneGlb>(
      scale_file(reference_.package, scale, reference_.context, StreamedNormals::kStreamed));
  const bool lit_anew = scale > 0 && !reference_.light.places.empty();
  if (file->has_draco() && (lit_anew || key.coding + 1 < kMeshCodings || key.extra_bits < 0))
    file->recode(steps_of(key), lit_anew ? &reference_.light : nullptr, reference_.context);
  return file;
}

std::unique_ptr<const LitMesh> Candidates::made_lit_mesh(const StandaloneGlb& file, int scale) const {
  Model model = read_model(file, mesh_path(scale), reference_.context);
  return std::make_unique<LitMesh>(reference_.lit_mesh(model));
}

const MeshCandidate& Candidates::mesh(const MeshKey& key) {
  const auto [it, fresh] = meshes_.try_emplace(key);
  MeshCandidate& c = it->second;
  if (!fresh) return c;
  const Manifest& m = reference_.package.manifest();
  c.scale = m.scales[key.scale].scale;
  c.levels = reference_.wishes.levels ? levels_of(m, c.scale) : std::vector<int>{c.scale};
  c.triangles = m.scales[key.scale].triangles;
  std::unique_ptr<StandaloneGlb> file = recoded_scale(c.scale, key);
  c.lit = made_lit_mesh(*file, c.scale);
  if (reference_.wishes.levels) file->begin_levels(screen_coverage_of(m, c.scale));
  for (std::size_t l = 1; l < c.levels.size(); ++l)
    file->add_level(*recoded_scale(c.levels[l], key), screen_coverage_of(m, c.levels[l]));
  if (!reference_.recentre) file->move_to(m.origin);
  c.file = std::move(file);
  const LitViews windows(*c.lit, reference_.windows, reference_.context);
  c.geometry = reference_.window_meter->difference(windows, reference_.best_textures, reference_.context);
  return c;
}

const LitMesh& Candidates::lit_mesh(const MeshKey& key) {
  mesh(key);
  MeshCandidate& c = meshes_.at(key);
  if (!c.lit) c.lit = made_lit_mesh(*recoded_scale(c.scale, key), c.scale);
  return *c.lit;
}

void Candidates::forget(const MeshKey& key) {
  const auto it = meshes_.find(key);
  if (it == meshes_.end()) return;
  if (for_several_)
    it->second.lit.reset();
  else
    meshes_.erase(it);
}

void Candidates::forget_lit_meshes() {
  for (auto& [key, mesh] : meshes_) mesh.lit.reset();
}

double size_step(int step) {
  double share = 1;
  for (; step >= 2; step -= 2) share /= 2;
  return step == 1 ? share / std::sqrt(2.0) : share;
}

std::vector<TextureCoding> Candidates::codings(std::size_t image) const {
  const ExtractImages wanted = reference_.wishes.images;
  const bool alpha = reference_.images[image].alpha_plane.has_value();  // which no JPEG holds
  if (wanted == ExtractImages::kPng || (alpha && wanted == ExtractImages::kJpeg)) return {{FileImage::kPng}};
  if (wanted == ExtractImages::kWebp || alpha) return {{FileImage::kWebp}};
  std::vector<TextureCoding> out{{FileImage::kJpeg, true}};
  if (reference_.images[image].colours) out.push_back({FileImage::kJpeg, false});
  if (wanted == ExtractImages::kAuto) out.push_back({FileImage::kWebp});
  return out;
}

std::optional<double> Candidates::stored_bytes(std::size_t image) const {
  const PackageImage& from = reference_.images[image];
  const ExtractImages wanted = reference_.wishes.images;
  const TextureInfo& info = reference_.package.textures().at(from.plane);
  if (from.alpha_plane || !info.source_rung ||
      (wanted != ExtractImages::kAuto && wanted != ExtractImages::kJpeg))
    return std::nullopt;
  return static_cast<double>(info.rungs.back().bytes);
}

void Candidates::load_stored(std::size_t image) {
  if (stored_.contains(image)) return;
  const PackageImage& from = reference_.images[image];
  const std::size_t last = reference_.package.textures().at(from.plane).rungs.size() - 1;
  JoinedJpeg& joined =
      stored_.emplace(image, joined_plane(reference_.package, from.plane, last, reference_.context))
          .first->second;
  joined.fill_unseen(reference_.shown_texels(image, joined.width_px(), joined.height_px()));
}

/// What makes up for averaging and for the interpolation of texels larger than pixels, as far as its bytes
/// allow: measured on lossless textures the best is .12 at half a texel per pixel, more with fewer.
float Candidates::sharpening(std::size_t image, double share) const {
  const double texels = std::max(reference_.texels_per_pixel[image] * share * share, 1e-6);
  return static_cast<float>(std::clamp(0.06 - 0.05 * portable::log(texels) / portable::log(2), 0.0, 0.16));
}

Pixels Candidates::texels(std::size_t image, double share) {
  const PackageImage& from = reference_.images[image];
  const double most = std::min(share, textures_.largest_share(image));
  const std::uint32_t width = side_of(from.width_px, most), height = side_of(from.height_px, most);
  std::vector<std::uint8_t> coverage;
  if (reference_.wishes.images != ExtractImages::kPng)
    coverage = reference_.shown_texels(image, width, height);
  return textures_.texels(image, width, height, coverage, sharpening(image, share));
}

const Pixels& Candidates::texels_of_step(std::size_t image, int step) {
  const auto [it, fresh] = by_step_.try_emplace({image, step});
  if (fresh) it->second = texels(image, size_step(step));
  return it->second;
}

FileImageData Candidates::encoded(std::size_t image, const Pixels& pixels, const TextureCoding& coding,
                                  double quality, bool quick) const {
  if (coding.stored) return {FileImage::kJpeg, stored_.at(image).file(quality)};
  return {coding.format, encode_image(pixels, {coding.format, quality, !reference_.images[image].colours,
                                               quick, coding.full_chroma})};
}

OtherTextures Candidates::shown_by(std::size_t image, const FileImageData& file,
                                   const RunContext& context) const {
  OtherTextures out;
  for (std::size_t t = 0; t < reference_.shown.size(); ++t)
    if (reference_.shown[t].image == image)
      out[t] = render_texture(decode_image(probe_image("texture", file.bytes, {})), reference_.shown[t].srgb,
                              0, context);
  return out;
}

std::vector<CodedImage> Candidates::measured(const std::vector<ImageTrial>& trials) {
  std::vector<ImageTrial> fresh;
  for (const ImageTrial& t : trials)
    if (!measured_.contains(t)) fresh.push_back(t);
  for (std::size_t first = 0; first < fresh.size(); first += kTrialsAtOnce)
    measure_together({fresh.data() + first, std::min(kTrialsAtOnce, fresh.size() - first)});
  std::vector<CodedImage> out;
  for (const ImageTrial& t : trials) out.push_back(measured_.at(t));
  return out;
}

void Candidates::measure_together(std::span<const ImageTrial> trials) {
  std::vector<CodedImage> found(trials.size());
  std::vector<OtherTextures> textures(trials.size());
  std::vector<const Pixels*> pixels;
  static const Pixels none;
  for (const ImageTrial& t : trials) {
    if (t.coding.stored) load_stored(t.image);
    pixels.push_back(t.coding.stored ? &none : &texels_of_step(t.image, t.step));
  }
  RunContext serial = reference_.context;
  serial.threads = 1;
  parallel_for(reference_.context, trials.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      const ImageTrial& t = trials[k];
      const FileImageData file = encoded(t.image, *pixels[k], t.coding, t.quality, true);
      textures[k] = shown_by(t.image, file, serial);
      found[k] = {{t.coding, size_step(t.step), t.quality},
                  static_cast<double>((file.bytes.size() + 3) / 4 * 4)};
    }
  });
  const std::vector<double> losses = reference_.window_meter->differences(
      *reference_.finest_windows, reference_.best_textures, std::move(textures), reference_.context);
  for (std::size_t k = 0; k < trials.size(); ++k) {
    found[k].loss = joined(losses[k]);
    measured_[trials[k]] = found[k];
  }
}

}  // namespace texmesh
