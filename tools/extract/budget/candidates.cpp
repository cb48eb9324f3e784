#include "tools/extract/budget/candidates.h"

#include "delivery/cpp/decide/texture_loss.h"
#include "format/base/portable_math.h"
#include "stages/base/loss_curve.h"
#include "stages/base/parallel.h"

namespace texmesh {
namespace {

constexpr std::size_t kTrialsAtOnce = 24;     // a megabyte or two each
constexpr std::uint32_t kMostWebpPx = 16383;  // of a side, of the format
constexpr std::size_t kSmallTexels = 262144;  // of such an image the texels are kept
constexpr std::size_t kMostScales = 3;        // decoded at a time: tens of megabytes each

}  // namespace

std::vector<int> levels_of(const Manifest& manifest, int finest) {
  std::vector<int> out{finest};
  for (const ManifestStep& s : manifest.steps | std::views::reverse)
    if (s.scale > finest) out.push_back(s.scale);
  if (const int coarsest = manifest.scales.back().scale; out.size() == 1 && coarsest > finest)
    out.push_back(coarsest);
  return out;
}

double screen_coverage_of(const Manifest& manifest, const std::vector<int>& levels, std::size_t level) {
  constexpr double kScreenPx = 1080;
  if (level + 1 >= levels.size()) return 0;
  double below = 0;  // displayed height up to which the next level is enough
  for (const ManifestStep& s : manifest.steps)
    if (s.scale >= levels[level + 1]) below = std::max(below, s.up_to_px);
  const double share = std::min(1.0, below / kScreenPx);
  return share * share;
}

DracoSteps Candidates::steps_of(const MeshKey& key) const {
  const ScaleFineness& c = kScaleFineness[key.coding];
  int finer = 0;  // a picture twice as high shows one bit more
  for (double px = 512 * 1.5; px < reference_.wishes.display_px && finer < 4; px *= 2) ++finer;
  const auto places = [&](int bits) {
    return portable::exp(portable::log(2) * (bits + finer + key.extra_bits));
  };
  return {reference_.extent / places(c.position_bits), 1 / places(c.uv_bits), c.normal_bits, c.colour_bits,
          key.extra_bits != 0};
}

Candidates::ScaleToCode& Candidates::scale_to_code(int scale) {
  const auto known = std::ranges::find(scales_, scale, &ScaleToCode::scale);
  if (known != scales_.end()) {
    scales_.splice(scales_.begin(), scales_, known);
    return scales_.front();
  }
  if (scales_.size() >= kMostScales) scales_.pop_back();
  const auto normals = reference_.wishes.best() ? StreamedNormals::kStreamed : StreamedNormals::kHasty;
  StandaloneGlb file = scale_file(reference_.package, scale, reference_.context, normals);
  const bool lit_anew = scale > 0 && !reference_.light.places.empty();
  DracoRecoder recoder(file.draco_streams(), lit_anew ? &reference_.light : nullptr, mesh_path(scale));
  return scales_.emplace_front(scale, std::move(file), std::move(recoder));
}

std::unique_ptr<StandaloneGlb> Candidates::recoded_scale(int scale, const MeshKey& key) {
  ScaleToCode& from = scale_to_code(scale);
  auto file = std::make_unique<StandaloneGlb>(from.file);
  const bool lit_anew = scale > 0 && !reference_.light.places.empty();
  const PackageReader& package = reference_.package;
  const bool hasty =
      !reference_.wishes.best() && !package.manifest().scales[package.scale_index(scale)].has_glb();
  if (file->has_draco() && (lit_anew || hasty || key.coding + 1 < kMeshCodings || key.extra_bits < 0))
    file->set_draco_streams(from.recoder.coded(steps_of(key), reference_.context));
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
  const bool looked_at = !reference_.wishes.fast() && !key.is_finest();
  if (looked_at) c.lit = made_lit_mesh(*file, c.scale);
  if (reference_.wishes.levels) file->begin_levels(screen_coverage_of(m, c.levels, 0));
  for (std::size_t l = 1; l < c.levels.size(); ++l)
    file->add_level(*recoded_scale(c.levels[l], key), screen_coverage_of(m, c.levels, l));
  file->place(reference_.place);
  c.file = std::move(file);
  if (!looked_at) return c;
  const LitViews windows(*c.lit, reference_.windows, reference_.context);
  c.geometry = reference_.window_meter->difference(windows, reference_.best_textures, reference_.context);
  return c;
}

const LitMesh& Candidates::lit_mesh(const MeshKey& key) {
  mesh(key);
  MeshCandidate& c = meshes_.at(key);
  if (key.is_finest()) return reference_.finest;
  if (!c.lit) c.lit = made_lit_mesh(*recoded_scale(c.scale, key), c.scale);
  return *c.lit;
}

void Candidates::prepare_views(const MeshKey& key) {
  lit_mesh(key);
  meshes_.at(key).views.resize(reference_.cameras.size());
}

std::pair<const LitViews&, std::size_t> Candidates::view(const MeshKey& key, std::size_t camera,
                                                         const RunContext& context) {
  if (key.is_finest()) return {*reference_.finest_views, camera};
  MeshCandidate& c = meshes_.at(key);
  std::unique_ptr<const LitViews>& view = c.views[camera];
  if (!view) view = std::make_unique<LitViews>(*c.lit, std::vector{reference_.cameras[camera]}, context);
  return {*view, 0};
}

void Candidates::forget(const MeshKey& key) {
  const auto it = meshes_.find(key);
  if (it == meshes_.end()) return;
  if (for_several_) {
    it->second.views.clear();
    it->second.lit.reset();
  } else {
    meshes_.erase(it);
  }
}

void Candidates::forget_lit_meshes() {
  for (auto& [key, mesh] : meshes_) {
    mesh.views.clear();
    mesh.lit.reset();
  }
}

double size_step(int step) {
  double share = 1;
  for (; step >= 2; step -= 2) share /= 2;
  return step == 1 ? share / std::sqrt(2.0) : share;
}

int Candidates::first_step(std::size_t image) const {
  int step = 0;
  while (!reference_.wishes.best() && size_step(step) > textures_.largest_share(image)) ++step;
  return step;
}

std::vector<TextureCoding> Candidates::codings(std::size_t image) const {
  const ExtractImages wanted = reference_.wishes.images;
  const bool alpha = reference_.images[image].alpha_plane.has_value();  // which no JPEG holds
  if (wanted == ExtractImages::kPng || (alpha && wanted == ExtractImages::kJpeg)) return {{FileImage::kPng}};
  if (wanted == ExtractImages::kAvif) return {{FileImage::kAvif}};
  if (wanted == ExtractImages::kWebp || alpha) return {{FileImage::kWebp}};
  std::vector<TextureCoding> out{{FileImage::kJpeg, true}};
  if (reference_.images[image].colours) out.push_back({FileImage::kJpeg, false});
  const PackageImage& from = reference_.images[image];
  if (wanted == ExtractImages::kAuto && std::max(from.width_px, from.height_px) <= kMostWebpPx)
    out.push_back({FileImage::kWebp});
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
  if (const auto small = small_.find({image, share}); small != small_.end()) return small->second;
  const Vec2<std::uint32_t> side = sides(image, share);
  std::vector<std::uint8_t> coverage;
  if (reference_.wishes.images != ExtractImages::kPng)
    coverage = reference_.shown_texels(image, side.x, side.y);
  const auto known = std::ranges::find_if(tiles_, [&](const auto& tiles) {
    return tiles.first.first == image && size_step(tiles.first.second) == share;
  });
  Pixels out;
  if (known != tiles_.end()) {  // without alpha
    out = known->second.image;
    if (!coverage.empty()) fill_uncovered(out, coverage, reference_.context);
  } else {
    out = textures_.texels(image, side.x, side.y, coverage, sharpening(image, share));
  }
  if (std::size_t{side.x} * side.y <= kSmallTexels) small_[{image, share}] = out;
  return out;
}

Vec2<std::uint32_t> Candidates::sides(std::size_t image, double share) const {
  const PackageImage& from = reference_.images[image];
  const double most = std::min(share, textures_.largest_share(image));
  return {side_of(from.width_px, most), side_of(from.height_px, most)};
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
      out[t] = render_texture(decode_file_image(file), reference_.shown[t].srgb, 0, context);
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

const Pixels& Candidates::texels_of_step(std::size_t image, int step) {
  const auto [it, fresh] = by_step_.try_emplace({image, step});
  if (fresh) it->second = texels(image, size_step(step));
  return it->second;
}

/// Null where a whole file is made: of stored coefficients, of codings that do not code blocks apart, of
/// small images, and with --best.
const TextureTiles* Candidates::tiles_for(const ImageTrial& trial) {
  if (trial.coding.stored) load_stored(trial.image);
  const double share = size_step(trial.step);
  const Vec2<std::uint32_t> side = sides(trial.image, share);
  if (reference_.wishes.best() || trial.coding.stored || trial.coding.format != FileImage::kJpeg ||
      !TextureTiles::suits(side.x, side.y)) {
    if (!trial.coding.stored) texels_of_step(trial.image, trial.step);
    return nullptr;
  }
  const auto [known, fresh] = tiles_.try_emplace({trial.image, trial.step});
  StepTiles& made = known->second;
  if (!fresh) return &*made.tiles;
  if (!places_read_.contains(trial.image))
    places_read_[trial.image] = places_read(*reference_.finest_windows, reference_.shown, trial.image);
  made.image = textures_.texels(trial.image, side.x, side.y, {}, sharpening(trial.image, share));
  const double reach_px = std::max(2.0, 2 * std::sqrt(reference_.texels_per_pixel[trial.image]) * share);
  made.tiles.emplace(made.image, reference_.shown_texels(trial.image, side.x, side.y),
                     places_read_.at(trial.image), reach_px, reference_.context);
  for (const PictureTexture& t : reference_.shown)
    if (t.image == trial.image)
      made.tiles->prepare(t.srgb, reference_.unread_levels(t.image, share), reference_.context);
  return &*made.tiles;
}

/// What pictures show of a trial's file, and the bytes that it takes in a GLB.
OtherTextures Candidates::trial_textures(const ImageTrial& t, const TextureTiles* tiles,
                                         const RunContext& context, double& bytes) {
  static const Pixels none;
  if (!tiles) {
    const Pixels& pixels = t.coding.stored ? none : by_step_.at({t.image, t.step});
    const FileImageData file = encoded(t.image, pixels, t.coding, t.quality, true);
    bytes = static_cast<double>((file.bytes.size() + 3) / 4 * 4);
    return shown_by(t.image, file, context);
  }
  bytes = tiles->file_bytes(encoded(t.image, tiles->sample(), t.coding, t.quality, true).bytes.size());
  const Pixels coded = decode_file_image(encoded(t.image, tiles->read_tiles(), t.coding, t.quality, true));
  OtherTextures out;
  for (std::size_t k = 0; k < reference_.shown.size(); ++k)
    if (reference_.shown[k].image == t.image)
      out[k] = tiles->texture_with(coded, reference_.shown[k].srgb, context);
  return out;
}

void Candidates::measure_together(std::span<const ImageTrial> trials) {
  std::vector<CodedImage> found(trials.size());
  std::vector<OtherTextures> textures(trials.size());
  std::vector<const TextureTiles*> tiles;
  for (const ImageTrial& t : trials) tiles.push_back(tiles_for(t));
  RunContext serial = reference_.context;
  serial.threads = 1;
  parallel_each(reference_.context, trials.size(), 1, [&](std::size_t k) {
    const ImageTrial& t = trials[k];
    found[k].plan = {t.coding, size_step(t.step), t.quality};
    textures[k] = trial_textures(t, tiles[k], serial, found[k].bytes);
  });
  const std::vector<double> losses = reference_.window_meter->differences(
      *reference_.finest_windows, reference_.best_textures, std::move(textures), reference_.context);
  for (std::size_t k = 0; k < trials.size(); ++k) {
    found[k].loss = joined(losses[k]);
    measured_[trials[k]] = found[k];
  }
}

namespace {

constexpr double kUsualQuality = 65;
constexpr double kTypicalTexelsPerByte = 6;  // at the usual quality
constexpr std::uint32_t kTiny = 8;
constexpr double kFewBytes = 16000;                    // of an image: other codings are worth a look
constexpr double kWebpQuality = 65, kWebpShare = 0.4;  // of a JPEG's bytes at the same quality
constexpr double kMuch = 0.15, kLittle = 0.05;         // of all images' losses
constexpr int kWeightings = 3;
constexpr double kShownTexels = 5;   // per pixel: of more the picture shows means
constexpr double kSourceFile = 0.9;  // of the bytes that the package has of a source's coefficients
constexpr double kFarAbove = 4;  // of an image's bytes: stored coefficients would have to lose most of theirs

/// Part of the bytes for textures that images of a role are likely to get, before anything is measured.
double weight_of(const PackageImage& image) {
  return image.colours ? 1.0 : image.role == "normal" ? 0.7 : 0.25;
}

double texels_of(const PackageImage& image) {
  return static_cast<double>(image.width_px) * static_cast<double>(image.height_px);
}

/// The step at which a side is tiny.
int last_step(const PackageImage& image) {
  int step = 0;
  while (step + 1 < kSizeSteps && side_of(std::max(image.width_px, image.height_px), size_step(step)) > kTiny)
    ++step;
  return step;
}

}  // namespace

/// The files of an image that are of use to look at, and new.
class LossCurves::Trials {
 public:
  Trials(const LossCurves& curves, std::size_t image, double bytes)
      : curves_(curves),
        image_(image),
        bytes_(bytes),
        last_(last_step(curves.reference_.images[image])),
        first_(std::min(curves.candidates_.first_step(image), last_)) {}
  int first() const { return first_; }
  int last() const { return last_; }

  /// Bytes that a file is likely to have, from what was seen of the image.
  double likely(int step, double quality) const {
    const CodedImage& seen = curves_.seen_[image_].front();
    return seen.bytes * portable::exp(portable::log(2) * (step_of(seen.plan.share) - step) +
                                      (quality - seen.plan.quality) / 32);
  }
  static int step_of(double share) {
    int step = 0;
    while (step + 1 < kSizeSteps && size_step(step) > share) ++step;
    return step;
  }
  /// A size beyond the ends becomes one at the end with another quality.
  void add(int step, const TextureCoding& coding, double quality) {
    const int bounded = std::clamp(step, first_, last_);
    quality = std::clamp(quality + 16 * (bounded - step), 5.0, 98.0);
    if (coding.format == FileImage::kPng) quality = 100;
    const auto same = [&](const TextureCoding& c, double share, double q) {
      return c == coding && share == size_step(bounded) && q == quality;
    };
    for (const ImageTrial& t : list_)
      if (same(t.coding, size_step(t.step), t.quality)) return;
    for (const CodedImage& c : curves_.seen_[image_])
      if (same(c.plan.coding, c.plan.share, c.plan.quality)) return;
    if (likely(bounded, quality) < 1.1 * bytes_) list_.push_back({image_, bounded, coding, quality});
  }
  /// The source's own coefficients, and some less of them, where they are not far from `chosen` bytes.
  void add_stored(double stored_bytes, double chosen_bytes) {
    const TextureCoding stored{FileImage::kJpeg, false, true};
    if (stored_bytes < 1.1 * bytes_) list_.push_back({image_, 0, stored, kHighestQuality});
    if (stored_bytes < kFarAbove * chosen_bytes)
      for (const double quality : {80.0, 92.0}) list_.push_back({image_, 0, stored, quality});
  }
  void append_to(std::vector<ImageTrial>& all) const { all.insert(all.end(), list_.begin(), list_.end()); }

 private:
  const LossCurves& curves_;
  std::size_t image_;
  double bytes_;
  int last_, first_;
  std::vector<ImageTrial> list_;
};

LossCurves::LossCurves(const Reference& reference, Candidates& candidates, double wanted)
    : reference_(reference), candidates_(candidates), seen_(reference.images.size()) {
  const double bytes = std::max(wanted, 1.0);
  if (reference.wishes.fast()) {
    read_tables();
    find_curves();
    return;
  }
  look_at(first_trials(bytes));
  look_at(trials_around_first(bytes));
  find_curves();
  look_at(trials_around(allocate(bytes), bytes));
  if (!reference.wishes.best()) add_sources(bytes);
  find_curves();
}

/// The source's own coefficients lose nothing, which needs no look.
void LossCurves::add_sources(double most_bytes) {
  for (std::size_t i = 0; i < seen_.size(); ++i)
    if (const auto stored = candidates_.stored_bytes(i); stored && kSourceFile * *stored < 1.1 * most_bytes)
      seen_[i].push_back({{{FileImage::kJpeg, false, true}, 1, kHighestQuality}, kSourceFile * *stored, 0});
}

/// A rung of one size of an image as if its fragments were a whole image.
struct RungFile {
  CodedImage file;
  double mip_loss = 0;       // joined, what the size itself loses
  double lower_quality = 0;  // of the rung below it
  double coded() const { return std::max(file.loss - mip_loss, 4e-6); }
};

/// Joined loss by coding grows about as (100 - quality) to this power (turtle, yurt, an owl: 1.1 to 2.2).
constexpr double kLossPower = 1.42;
constexpr double kLeastLossy = 93;  // what rungs of more quality lose tells little of lower ones

double lossiness(double quality) {
  return portable::exp(kLossPower * portable::log(std::max(100 - quality, 1.0)));
}

/// Bytes of a JPEG by quality, those at 50 about 1.
double relative_bytes(double quality) {
  constexpr std::pair<double, double> kBytes[] = {{1, 0.1},  {20, 0.55}, {40, 0.86}, {65, 1.3},
                                                  {80, 1.9}, {90, 2.9},  {100, 8}};
  std::size_t k = 1;
  while (kBytes[k].first < quality) ++k;
  const auto [low, few] = kBytes[k - 1];
  const auto [high, many] = kBytes[k];
  return few + (many - few) * (quality - low) / (high - low);
}

/// Qualities between the rungs of an image and below them, of the smallest size half of the sides, too: a
/// package has few rungs, as its clients take smaller sizes with more quality.
std::vector<CodedImage> with_qualities_between(const std::vector<RungFile>& rungs) {
  double known = 0, smallest = 1;  // what coding loses of this image, by its lossiness
  for (const RungFile& r : rungs) {
    smallest = std::min(smallest, r.file.plan.share);
    if (r.file.plan.quality <= kLeastLossy)
      known = std::max(known, r.coded() / lossiness(r.file.plan.quality));
  }
  std::vector<CodedImage> out;
  for (const RungFile& r : rungs) {
    const ImagePlan& plan = r.file.plan;
    out.push_back(r.file);
    if (plan.coding.stored || plan.coding.format == FileImage::kPng) continue;
    for (const double quality : {85.0, 75.0, 65.0, 50.0, 35.0, 20.0}) {
      if (quality >= plan.quality || quality <= r.lower_quality) continue;
      const double rate = known > 0 ? known : r.coded() / lossiness(plan.quality);
      const double bytes = r.file.bytes * relative_bytes(quality) / relative_bytes(plan.quality);
      const double loss = r.mip_loss + rate * lossiness(quality);
      out.push_back({{plan.coding, plan.share, quality}, bytes, loss});
      if (r.lower_quality == 0 && plan.share == smallest)
        out.push_back({{plan.coding, plan.share / 2, quality}, bytes / 3.5, loss + 8 * r.mip_loss});
    }
  }
  return out;
}

void LossCurves::read_tables() {
  PackageReader& package = reference_.package;
  const std::vector<TextureInfo>& textures = package.textures();
  TextureLoss losses(package, reference_.side_px);
  const PerGroup weights = losses.weights(full_size(package));
  for (std::size_t i = 0; i < seen_.size(); ++i) {
    const std::uint32_t base = reference_.images[i].plane;
    const auto stored = candidates_.stored_bytes(i);
    std::vector<RungFile> rungs;
    for (std::uint32_t p = 0; p < textures.size(); ++p) {
      if (p != base && !(textures[p].mip > 0 && textures[p].base == base)) continue;
      const TextureLoss::Plane& plane = losses.plane(p);
      const std::size_t fragments = plane.weights.size();
      const double group = std::max(weights[static_cast<std::size_t>(losses.group_of(p))], 1e-30);
      double bytes = 0, lower_quality = 0;
      for (std::size_t r = 0; r < textures[p].rungs.size(); ++r) {
        const auto of_rung = static_cast<double>(textures[p].rungs[r].bytes);
        bytes = package.tables().planes[p].incremental ? bytes + of_rung : of_rung;
        double lost = 0;
        for (std::size_t f = 0; f < fragments; ++f)
          lost += static_cast<double>(plane.weights[f]) * plane.shown[(r + 1) * fragments + f];
        const bool last = r + 1 == textures[p].rungs.size(), is_stored = stored && p == base && last;
        const TextureCoding coding =
            is_stored ? TextureCoding{FileImage::kJpeg, false, true} : candidates_.codings(i).front();
        if (coding.format == FileImage::kPng && !last) continue;
        const double quality = is_stored ? kHighestQuality : package.tables().planes[p].rung_quality[r];
        rungs.push_back({{{coding, 1.0 / (1u << textures[p].mip), quality}, bytes, joined(lost / group)},
                         joined(losses.mip(p) * plane.weight / group),
                         lower_quality});
        lower_quality = quality;
      }
    }
    seen_[i] = with_qualities_between(rungs);
  }
}

void LossCurves::look_at(const std::vector<ImageTrial>& trials) {
  const std::vector<CodedImage> found = candidates_.measured(trials);
  for (std::size_t k = 0; k < trials.size(); ++k) seen_[trials[k].image].push_back(found[k]);
}

double LossCurves::likely_bytes(std::size_t image, double bytes) const {
  double weights = 0;
  for (std::size_t i = 0; i < reference_.images.size(); ++i) weights += weight_of(reference_.images[i]);
  return bytes * weight_of(reference_.images[image]) / weights;
}

/// A likely size, and one of next to no bytes.
std::vector<ImageTrial> LossCurves::first_trials(double bytes) const {
  std::vector<ImageTrial> out;
  for (std::size_t i = 0; i < reference_.images.size(); ++i) {
    const PackageImage& image = reference_.images[i];
    const TextureCoding coding = candidates_.codings(i).front();
    const double wanted = likely_bytes(i, bytes) * kTypicalTexelsPerByte;
    int step = std::min(candidates_.first_step(i), last_step(image));
    while (step + 2 < last_step(image) && texels_of(image) * size_step(step) * size_step(step) > wanted)
      step += 2;
    out.push_back({i, step, coding, kUsualQuality});
    if (step != last_step(image)) out.push_back({i, last_step(image), coding, kUsualQuality});
  }
  return out;
}

/// Sizes and qualities around the likely one. Halves: smaller copies of other sizes lie beside their place.
std::vector<ImageTrial> LossCurves::trials_around_first(double bytes) const {
  double sum = 0;
  for (const std::vector<CodedImage>& files : seen_) sum += files.front().loss;
  std::vector<ImageTrial> out;
  for (std::size_t i = 0; i < reference_.images.size(); ++i) {
    Trials trials(*this, i, bytes);
    const double wanted = likely_bytes(i, bytes);
    int middle = trials.first();
    while (middle < trials.last() && trials.likely(middle, kUsualQuality) > wanted * 1.4) middle += 2;
    const TextureCoding coding = candidates_.codings(i).front();
    trials.add(middle, coding, 20);
    if (seen_[i].front().loss > kLittle * sum) {
      const double share = size_step(std::max(middle - 2, 0));
      const bool finer_is_shown = reference_.texels_per_pixel[i] * share * share < kShownTexels;
      for (const double quality : {20.0, 45.0, kUsualQuality})
        if (finer_is_shown || quality == 45) trials.add(middle - 2, coding, quality);
      for (const double quality : {40.0, kUsualQuality, 85.0}) trials.add(middle, coding, quality);
    }
    for (const double quality : {40.0, 75.0}) trials.add(middle + 2, coding, quality);
    trials.add(middle + 4, coding, kUsualQuality);
    trials.append_to(out);
  }
  return out;
}

/// About as many bytes in another way: sizes between halves where an image loses much, other codings where it
/// has few bytes.
std::vector<ImageTrial> LossCurves::trials_around(const DealtBytes& chosen, double bytes) const {
  double sum = 0;
  for (const CodedImage& image : chosen.images) sum += image.loss;
  std::vector<ImageTrial> out;
  for (std::size_t i = 0; i < reference_.images.size(); ++i) {
    Trials trials(*this, i, bytes);
    const ImagePlan& plan = chosen.images[i].plan;
    const int step = Trials::step_of(plan.share);
    if (chosen.images[i].loss > kMuch * sum) {
      trials.add(step + 1, plan.coding, plan.quality + 20);
      trials.add(step - 1, plan.coding, plan.quality - 18);
    }
    const std::vector<TextureCoding> codings = candidates_.codings(i);
    const bool few = chosen.images[i].bytes < kFewBytes;
    for (std::size_t k = 1; few && k < codings.size(); ++k) {
      int middle = trials.first();
      while (middle < trials.last() && kWebpShare * trials.likely(middle, kWebpQuality) >
                                           std::max(chosen.images[i].bytes, 0.02 * bytes))
        middle += 2;
      trials.add(middle, codings[k], kWebpQuality);
      trials.add(middle + 2, codings[k], kWebpQuality);
    }
    if (const auto stored = candidates_.stored_bytes(i); stored && reference_.wishes.best())
      trials.add_stored(*stored, chosen.images[i].bytes);
    trials.append_to(out);
  }
  return out;
}

void LossCurves::find_curves() {
  curves_.clear();
  for (const std::vector<CodedImage>& files : seen_) curves_.push_back(convex_curve(files));
}

std::vector<double> LossCurves::group_losses(const DealtBytes& allocation) const {
  std::vector<double> sums(reference_.images.size());
  for (std::size_t i = 0; i < allocation.images.size(); ++i)
    sums[reference_.groups[i]] += allocation.images[i].loss;
  for (double& s : sums) s = std::sqrt(s);
  return sums;
}

/// The sum of groups' losses is least where each image gains alike by its group's loss; which is known only
/// when the bytes are dealt out.
DealtBytes LossCurves::allocate(double bytes) const {
  DealtBytes best;
  std::vector<double> weights(reference_.images.size(), 1);
  for (int i = 0; i < kWeightings; ++i) {
    DealtBytes found = allocate(bytes, weights);
    weights = group_losses(found);
    double sum = 0;
    for (double& w : weights) {
      sum += w;
      w = 1 / std::max(w, 1e-4);
    }
    found.loss = joined(sum);
    if (i == 0 || found.loss < best.loss) best = std::move(found);
  }
  return best;
}

const CodedImage* LossCurves::neighbour(std::size_t image, const CodedImage& from, int step) const {
  const CodedImage* fewer = nullptr;
  for (const CodedImage& file : curves_[image]) {
    if (file.plan == from.plan) continue;
    if (step > 0 && file.bytes > from.bytes) return &file;
    if (step < 0 && file.bytes < from.bytes) fewer = &file;
  }
  return fewer;
}

DealtBytes LossCurves::allocate(double bytes, const std::vector<double>& group_weights) const {
  DealtBytes out;
  std::vector<std::size_t> at(curves_.size(), 0);
  for (const std::vector<CodedImage>& curve : curves_) {
    out.images.push_back(curve.front());
    out.bytes += curve.front().bytes;
  }
  for (;;) {
    const std::size_t next =
        best_step(curves_, at, [&](std::size_t i) { return group_weights[reference_.groups[i]]; });
    if (next == curves_.size()) return out;
    const CodedImage &a = curves_[next][at[next]], &b = curves_[next][at[next] + 1];
    out.last = next;
    const double part = std::clamp((bytes - out.bytes) / (b.bytes - a.bytes), 0.0, 1.0);
    CodedImage& image = out.images[next];
    image = {part > 0.5 ? b.plan : a.plan, a.bytes + part * (b.bytes - a.bytes),
             a.loss + part * (b.loss - a.loss)};
    out.bytes += image.bytes - a.bytes;
    if (part < 1) return out;
    ++at[next];
  }
}

}  // namespace texmesh
