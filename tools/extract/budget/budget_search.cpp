// The search behind extract --bytes. Its story:
// 1. A Reference is made once: the package's best, S_0 with the best texels, in pictures lit as texmesh
// render lights them. Everything is judged by FLIP against these pictures: of large ones
// by a quarter of the rows, with --best by all.
// 2. Candidates are coded meshes and coded images. Each is made when it is first asked for.
// 3. Small windows of the pictures tell what bytes are worth. S_0 is rendered with one image coded in many
// ways, which gives each image a curve of loss against bytes (LossCurves). Of a large texture only the parts
// are coded that the windows read (TextureTiles). Every coded mesh is rendered with the best textures. Losses
// of mesh and textures are added up.
// 4. The mesh: compile has measured what scales lose, and of S_0 as it is stored everything is known. So one
// to three meshes that are made and looked at tell which is likely. From it, with --best from another likely
// one, the search walks to neighbours, finer and coarser, while the sum of losses falls. What a mesh leaves
// of the bytes is dealt out along the curves, where it takes away most loss.
// 5. The file is written and filled up to at least 98 % of the bytes (Filling).
// 6. Sums of losses are guesses, so in a small file whole pictures decide between few: other sizes of the
// texture that loses most, in few bytes other codings of it, a leaner mesh, other shares. One that is plainly
// worse in a view is not looked at further. With --best many more files are looked at, in a small file those
// of other likely meshes and codings, too. In a large file textures may be full: then the mesh is finer.
// 7. Proxies of the package are tried in its place (or_of_proxy()): in a small file before the other few,
// which are not looked at where a proxy is plainly nearer.
// Where the bytes hold S_0 and all of the source's own images, nothing is looked for (whole_source()).
#include "tools/extract/budget/budget_search.h"

#include <numeric>

#include "delivery/cpp/decide/texture_loss.h"
#include "format/base/portable_math.h"
#include "stages/base/parallel.h"

namespace texmesh {
namespace {

constexpr double kNothing = 1e9;
constexpr double kFewestExtraBits = -3, kMostExtraBits = 9;
constexpr int kMeshTries = 12;
constexpr double kSurely = 0.9;  // of a loss that others tell
constexpr std::uint64_t kLookAtFilesBelow = 200000;
constexpr int kFewLooks = 8;  // beside the first
constexpr std::uint64_t kTryCodingsBelow = 50000;
constexpr double kPlainlyWorse = 1.1;  // in one view
constexpr double kPlainlyNearer = 0.9;
constexpr double kLikely = 1.2;  // times the least joined loss
constexpr std::size_t kMostLikely = 4;
constexpr double kWorthALook = 1.15;  // times the least joined loss that was seen, by tables
constexpr double kUsualBytes = 3.5, kLeastBytes = 1.5;          // of a coded triangle
constexpr double kTableBytes = 3;                               // the same, before one is coded
constexpr double kTexelsPerByte = 20, kFastTexelsPerByte = 10;  // more texels are never worth a byte

double most_texels(const ExtractBudget& wishes, std::uint64_t bytes) {
  const double a_byte = wishes.fast() ? kFastTexelsPerByte : kTexelsPerByte;
  return std::max(a_byte * static_cast<double>(bytes), 65536.0);
}

/// The finest that is likely to leave half of the bytes to textures.
std::size_t likely_scale(const Reference& reference, std::uint64_t bytes) {
  const std::vector<ManifestScale>& scales = reference.package.manifest().scales;
  const double part = reference.images.empty() ? 1.0 : 0.5;
  for (std::size_t k = 0; k < scales.size(); ++k)
    if (kUsualBytes * static_cast<double>(scales[k].triangles) <= part * static_cast<double>(bytes)) return k;
  return scales.size() - 1;
}

MeshKey first_mesh(const Reference& reference, std::uint64_t bytes) {
  const std::optional<int>& scale = reference.wishes.scale;
  return {scale ? reference.package.scale_index(*scale) : likely_scale(reference, bytes), kUsualFineness};
}

/// What the first mesh leaves.
double likely_texture_bytes(const Reference& reference, std::uint64_t bytes) {
  const MeshKey first = first_mesh(reference, bytes);
  return static_cast<double>(bytes) -
         kUsualBytes * static_cast<double>(reference.package.manifest().scales[first.scale].triangles);
}

std::size_t largest_loss(const DealtBytes& images) {
  const auto most = std::ranges::max_element(images.images, {}, &CodedImage::loss);
  return static_cast<std::size_t>(most - images.images.begin());
}

/// Images that take many bytes, but for one.
std::vector<std::size_t> largest_but(const DealtBytes& images, std::size_t but) {
  constexpr std::size_t kMost = 3;
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < images.images.size(); ++i)
    if (i != but) out.push_back(i);
  std::ranges::stable_sort(out, std::greater{}, [&](std::size_t i) { return images.images[i].bytes; });
  if (out.size() > kMost) out.resize(kMost);
  return out;
}

/// About as many bytes; `steps` below 0 are a larger texture, two of them twice the sides. Nothing where it
/// has no other size.
std::optional<DealtBytes> with_largest_loss_resized(DealtBytes images, int steps,
                                                    const Candidates& candidates) {
  constexpr double kQualitiesOfStep = 22;
  images.last = largest_loss(images);
  ImagePlan& plan = images.images[images.last].plan;
  const double share = plan.share * std::sqrt(steps < 0 ? 1 << -steps : 1.0 / (1 << steps));
  if (plan.coding.format == FileImage::kPng || share > 1.01) return std::nullopt;
  if (plan.coding.stored) plan.coding = candidates.codings(images.last).front();
  plan.share = std::min(share, 1.0);
  plan.quality = std::clamp(plan.quality + kQualitiesOfStep * steps, kLowestQuality, kHighestQuality);
  return images;
}

/// Whether the bytes hold S_0 and all of the source's own images as the package has them.
bool holds_source(PackageReader& package, const ExtractBudget& wishes, std::uint64_t bytes) {
  if (wishes.scale.value_or(0) != 0 || wishes.levels || wishes.effort != ExtractEffort::kUsual ||
      (wishes.images != ExtractImages::kAuto && wishes.images != ExtractImages::kJpeg))
    return false;
  std::uint64_t all = package.manifest().scales.front().glb.bytes;
  for (const PackageImage& image : package_images(package)) {
    const TextureInfo& info = package.textures().at(image.plane);
    if (image.alpha_plane || !info.source_rung) return false;
    all += info.rungs.back().bytes;
  }
  return all <= bytes;
}

/// All images together: fewer cannot fill the bytes.
double least_texels(std::uint64_t bytes) {
  constexpr double kLeastTexelsPerByte = 3;
  return kLeastTexelsPerByte * static_cast<double>(bytes);
}

/// What searches for several numbers of bytes share.
struct SharedSearch {
  SharedSearch(PackageReader& package, const ExtractBudget& wishes, const OutputTransform& place,
               std::uint64_t bytes, const RunContext& context)
      : textures(package, most_texels(wishes, bytes), context, wishes.effort, least_texels(bytes)),
        reference(package, wishes, place, textures, context),
        candidates(reference, textures, wishes.bytes.size() > 1) {}
  TextureSource textures;
  const Reference reference;
  Candidates candidates;
  ProxyDifferences proxies;
};

}  // namespace

double CpuClock::since_last_s() {
  const std::clock_t before = std::exchange(last_, std::clock());
  return static_cast<double>(last_ - before) / CLOCKS_PER_SEC;
}

Search::Search(const Reference& reference, Candidates& candidates, ProxyDifferences& proxies,
               std::uint64_t bytes)
    : reference_(reference),
      candidates_(candidates),
      proxies_(proxies),
      bytes_(bytes),
      filling_(reference, candidates, bytes) {}

const LossCurves& Search::curves() {
  if (!curves_) curves_.emplace(reference_, candidates_, likely_texture_bytes(reference_, bytes_));
  return *curves_;
}

std::optional<Extracted> Search::source_file() {
  DealtBytes images;
  for (std::size_t i = 0; i < reference_.images.size(); ++i)
    images.images.push_back({{{FileImage::kJpeg, false, true}, 1, kHighestQuality}, 0, 0});
  FoundFile found = file_of({0, kMeshCodings - 1}, images);
  if (!filling_.fits(found.file)) return std::nullopt;
  Extracted out = finish(std::move(found));
  out.spent.file_cpu_s = clock_.since_last_s();
  return out;
}

Extracted Search::run(const std::function<void(double)>& report) {
  curves();
  report(0.4);
  spent_.images_cpu_s = clock_.since_last_s();
  choose_mesh();
  spent_.mesh_cpu_s = clock_.since_last_s();
  report(0.6);
  FoundFile found = filled_file();
  if (reference_.wishes.effort == ExtractEffort::kUsual && filling_.fits(found.file) &&
      !filling_.fills(found.file) && !found.key.is_finest()) {  // other meshes may come nearer to the bytes
    only_likely_ = false;
    seen_.clear();
    walk_to_mesh();
    if (FoundFile other = filled_file(); filling_.fills(other.file)) found = std::move(other);
  }
  Extracted out = finish(std::move(found));
  spent_.file_cpu_s += clock_.since_last_s();
  if (!offered_)
    out = or_of_proxy(reference_, bytes_, proxies_, std::move(out));
  else if (offered_->proxy && (!out.within || offered_->difference < out.difference))
    out = *std::move(offered_);
  spent_.proxies_cpu_s += clock_.since_last_s();
  out.spent = spent_;
  return out;
}

FoundFile Search::filled_file() {
  FoundFile found = file_of(best_, allocation_of(best_));
  if (!filling_.fits(found.file) || reference_.wishes.fast()) return found;
  if (bytes_ <= kLookAtFilesBelow)
    reference_.wishes.best() ? look_at_files(found) : look_at_few_files(found);
  else if (reference_.wishes.best())
    try_smaller_than_stored(found);
  if (!filling_.fills(found.file)) fill_by_mesh(found);
  return found;
}

const MeshFile& Search::mesh(const MeshKey& key) {
  const auto [it, fresh] = meshes_.try_emplace(key);
  if (fresh) it->second = filling_.mesh_file(candidates_.mesh(key));
  return it->second;
}

void Search::forget(const MeshKey& key) {
  meshes_.erase(key);
  candidates_.forget(key);
}

double Search::bytes_left(const MeshFile& mesh) const {
  return static_cast<double>(bytes_) - static_cast<double>(mesh.fixed_bytes);
}

void Search::choose_mesh() {
  only_likely_ = !reference_.wishes.best();
  best_ = known_ = first_mesh(reference_, bytes_);
  if (reference_.wishes.fast()) {
    geometry_[known_] = table_geometry(known_);
    known_bytes_ = kTableBytes * static_cast<double>(scales()[known_.scale].triangles);
  } else if (reference_.wishes.best()) {
    least_ = loss_of(best_);
  } else {  // of S_0 as it is stored everything is known
    known_ = {0, kMeshCodings - 1};
    geometry_[known_] = 0;
    known_bytes_ = static_cast<double>(scales().front().glb.bytes);
  }
  if (!reference_.wishes.best()) choose_mesh_by_tables();
  if (!reference_.wishes.fast()) walk_to_mesh();
  if (least_ >= kNothing) best_ = {reference_.wishes.scale ? best_.scale : scales().size() - 1, 0};
}

/// By the package's quality table, joined.
double Search::scale_loss(std::size_t scale) const {
  return joined(picture_flip(reference_.package.quality(), reference_.side_px, scales()[scale].scale, {}));
}

/// Compile has measured what scales lose, and a coding loses and saves about alike on all of them: so one
/// mesh that was made and looked at tells what a file of another is likely to lose.
double Search::likely_loss(const MeshKey& key) {
  constexpr double kFinerScalesTakeLess = 0.35;  // bytes of a triangle ~ triangles to the power of minus this
  const auto triangles = [&](std::size_t scale) { return static_cast<double>(scales()[scale].triangles); };
  const ScaleFineness &of_known = kScaleFineness[known_.coding], &of_key = kScaleFineness[key.coding];
  const double lost = joined(geometry_.at(known_)) - of_known.loss, of_scale = scale_loss(known_.scale);
  const double scale_losses = of_scale > 0 && !known_.is_finest() ? std::max(lost / of_scale, 0.1) : 1;
  const double bytes = known_bytes_ / of_known.bytes * of_key.bytes *
                       portable::exp((1 - kFinerScalesTakeLess) *
                                     portable::log(triangles(key.scale) / triangles(known_.scale)));
  const double left = static_cast<double>(bytes_) - bytes;
  const DealtBytes images = curves().allocate(left);
  return images.bytes > left ? kNothing : scale_losses * scale_loss(key.scale) + of_key.loss + images.loss;
}

/// The likeliest mesh is made and looked at until it is known.
void Search::choose_mesh_by_tables() {
  for (int tries = 0; tries < 3; ++tries) {
    if (reference_.wishes.fast() && least_ < kNothing) return;
    MeshKey likely = best_;
    double least = kNothing;
    for (std::size_t scale = 0; scale < scales().size(); ++scale)
      for (int coding = 0; coding < kMeshCodings; ++coding) {
        if (reference_.wishes.scale && scale != best_.scale) continue;
        if (reference_.wishes.fast() && scale == 0 && coding + 1 < kMeshCodings) continue;  // takes long
        const double loss = likely_loss({scale, coding});
        if (loss < least) least = loss, likely = {scale, coding};
      }
    if (seen_.contains(likely)) return;
    const double found = loss_of(likely);
    forget(found < least_ ? best_ : likely);
    if (!(found < least_)) continue;
    least_ = found;
    best_ = likely;
  }
}

/// From a likely mesh to its neighbours: finer, coarser, coded finer and leaner, and a finer one
/// coded leaner or the other way round, as long as the picture gets better; one that does not is
/// passed over once.
void Search::walk_to_mesh() {
  for (bool again = true; again;) {
    const MeshKey before = best_;
    if (!reference_.wishes.scale) {
      follow_direction(-1, 0);
      follow_direction(1, 0);
    }
    follow_direction(0, 1);
    follow_direction(0, -1);
    if (!reference_.wishes.scale) {
      follow_direction(-1, -1);
      follow_direction(1, 1);
    }
    again = before != best_;
  }
}

void Search::follow_direction(int scale_step, int coding_step) {
  const MeshKey from = best_;
  const int most = reference_.wishes.best() ? 2 : 1;
  int worse = 0;
  for (int k = 1; worse < most; ++k) {
    const int scale = static_cast<int>(from.scale) + k * scale_step, coding = from.coding + k * coding_step;
    if (scale < 0 || scale >= static_cast<int>(scales().size()) || coding < 0 || coding >= kMeshCodings)
      return;
    worse = better({static_cast<std::size_t>(scale), coding}) ? 0 : worse + 1;
  }
}

bool Search::better(const MeshKey& key) {
  if (!seen_.insert(key).second) return key == best_;
  const bool hopeless =
      too_large(key) || least_loss(key) > least_ || (only_likely_ && likely_loss(key) > kWorthALook * least_);
  const double found = hopeless ? kNothing : loss_of(key);
  forget(found < least_ ? best_ : key);
  if (!(found < least_)) return false;
  least_ = found;
  best_ = key;
  return true;
}

bool Search::too_large(const MeshKey& key) const {
  return kLeastBytes * static_cast<double>(scales()[key.scale].triangles) > static_cast<double>(bytes_);
}

/// What the mesh is expected to lose at least: scale and coding of a mesh lose apart, and finer ones of
/// both kinds lose less.
double Search::least_loss(const MeshKey& key) const {
  double least = 0;
  for (const auto& [known, geometry] : geometry_) {
    if (known.scale > key.scale) continue;
    double loss = joined(geometry);
    if (known.coding < key.coding) {
      const auto coded = geometry_.find({0, known.coding});
      if (known.scale == 0 || coded == geometry_.end()) continue;
      loss -= joined(coded->second);
    }
    least = std::max(least, kSurely * loss);
  }
  return least;
}

/// What pictures would tell, FLIP.
double Search::table_geometry(const MeshKey& key) const {
  return std::sqrt(scale_loss(key.scale) + kScaleFineness[key.coding].loss);
}

/// What a file of this mesh is expected to lose.
double Search::loss_of(const MeshKey& key) {
  seen_.insert(key);
  const double geometry = geometry_[key] =
      reference_.wishes.fast() ? table_geometry(key) : candidates_.mesh(key).geometry;
  known_ = key;
  known_bytes_ = static_cast<double>(mesh(key).fixed_bytes);
  const double left = bytes_left(mesh(key));
  const DealtBytes images = curves().allocate(left);
  if (images.bytes > left) return kNothing;
  return predicted_[key] = joined(geometry) + images.loss;
}

/// What meshes and textures lose is told from parts of pictures, one change at a time. Where files are
/// small, which is nearest to the truth is seen in whole pictures: files of the likeliest meshes, and the
/// texture that loses most in other sizes.
void Search::look_at_files(FoundFile& best) {
  look_at(best);
  for (const MeshKey& key : likeliest()) replace_if_nearer(file_of(key, allocation_of(key)), best);
  try_other_files(best);
}

/// What --best changes most often, in turn: in few bytes the coding of the texture that loses most, its size,
/// the mesh's coding, what other textures get.
void Search::look_at_few_files(FoundFile& best) {
  if (best.images.images.empty() || reference_.cameras.empty()) return;
  look_at(best);
  if (proxy_is_plainly_nearer(best)) return;
  looks_left_ = kFewLooks;
  if (bytes_ <= kTryCodingsBelow) try_other_codings(best);
  try_other_sizes(best, {1, -1});
  try_other_codings_of_mesh(best);
  try_other_shares(best);
}

/// Than any file of a scale that a few more looks may find.
bool Search::proxy_is_plainly_nearer(const FoundFile& found) {
  if (!offered_) {
    Extracted file = finish(found);
    spent_.file_cpu_s += clock_.since_last_s();
    offered_ = or_of_proxy(reference_, bytes_, proxies_, std::move(file));
    spent_.proxies_cpu_s += clock_.since_last_s();
  }
  return offered_->proxy && offered_->difference < kPlainlyNearer * found.difference;
}

/// But for the best.
std::vector<MeshKey> Search::likeliest() const {
  std::vector<std::pair<double, MeshKey>> order;
  for (const auto& [key, loss] : predicted_)
    if (key != best_ && loss <= kLikely * least_) order.emplace_back(loss, key);
  std::ranges::sort(order);
  if (order.size() > kMostLikely) order.resize(kMostLikely);
  std::vector<MeshKey> out;
  for (const auto& [loss, key] : order) out.push_back(key);
  return out;
}

FoundFile Search::file_of(const MeshKey& key, const DealtBytes& images) {
  return {key, images, filling_.fill(mesh(key), images), 1e9, {}};
}

bool Search::replace_if_nearer(FoundFile found, FoundFile& best) {
  if (!filling_.fills(found.file)) return false;
  look_at(found, reference_.wishes.best() ? nullptr : &best);
  if (!(found.difference < best.difference)) return false;
  best = std::move(found);
  return true;
}

/// Each is tried once: what the last texture gets depends on the others alone.
bool Search::try_file(const MeshKey& key, const DealtBytes& images, FoundFile& best) {
  TriedFile tried{key, images.last, {}};
  for (const CodedImage& image : images.images) tried.plans.push_back(image.plan);
  tried.plans[images.last].quality = 0;
  if (looks_left_ == 0 || std::ranges::find(tried_, tried) != tried_.end()) return false;
  if (looks_left_) --*looks_left_;
  tried_.push_back(std::move(tried));
  return replace_if_nearer(file_of(key, images), best);
}

bool Search::try_other_sizes(FoundFile& best, std::initializer_list<int> all_steps) {
  bool nearer = false;
  for (const int steps : all_steps)
    while (const auto other = with_largest_loss_resized(best.images, steps, candidates_)) {
      if (!try_file(best.key, *other, best)) break;
      nearer = true;
    }
  return nearer;
}

bool Search::try_other_codings(FoundFile& best) {
  bool nearer = false;
  DealtBytes images = best.images;
  images.last = largest_loss(images);
  ImagePlan& plan = images.images[images.last].plan;
  if (plan.coding.stored) return false;
  for (const TextureCoding& coding : candidates_.codings(images.last)) {
    if (coding == plan.coding) continue;
    DealtBytes other = images;
    other.images[images.last].plan.coding = coding;
    nearer |= try_file(best.key, other, best);
  }
  return nearer;
}

bool Search::try_other_shares(FoundFile& best) {
  const std::size_t most = largest_loss(best.images);
  DealtBytes same = best.images;
  same.last = most;
  bool nearer = try_file(best.key, same, best);
  for (const std::size_t image : largest_but(best.images, most))
    for (const int step : {-1, 1})
      while (const CodedImage* other = curves().neighbour(image, best.images.images[image], step)) {
        DealtBytes images = best.images;
        images.images[image] = *other;
        images.last = most;
        if (!try_file(best.key, images, best)) break;
        nearer = true;
      }
  return nearer;
}

bool Search::try_other_codings_of_mesh(FoundFile& best) {
  bool nearer = false;
  const int usual = reference_.wishes.best() ? 1 : -1;  // leaner first
  for (const int step : {usual, -usual})
    for (;;) {
      MeshKey key = best.key;
      key.coding += step;
      if (key.coding < 0 || key.coding >= kMeshCodings) break;
      if (!try_file(key, best.images, best)) break;
      nearer = true;
    }
  return nearer;
}

void Search::try_other_files(FoundFile& best) {
  constexpr int kMostRounds = 3;
  if (best.images.images.empty()) return;
  bool nearer = true;
  for (int i = 0; i < kMostRounds && nearer; ++i) {
    nearer = try_other_sizes(best, {-1, 1, -2, 2, 3});
    nearer |= try_other_codings(best);
    nearer |= try_other_shares(best);
    nearer |= try_other_codings_of_mesh(best);
  }
}

void Search::try_smaller_than_stored(FoundFile& best) {
  if (best.images.images.empty()) return;
  const ImagePlan& plan = best.images.images[largest_loss(best.images)].plan;
  if (!plan.coding.stored || plan.is_source()) return;
  look_at(best);
  for (const int steps : {1, 2})
    if (const auto other = with_largest_loss_resized(best.images, steps, candidates_))
      try_file(best.key, *other, best);
}

void Search::look_at(FoundFile& found, const FoundFile* rival) {
  std::vector<RenderTexture> textures(reference_.shown.size());
  for (std::size_t i = 0; i < reference_.images.size(); ++i)
    for (auto& [t, texture] :
         candidates_.shown_by(i, found.file.images.at(reference_.images[i].image), reference_.context))
      textures[t] = std::move(texture);
  const LitMeter& meter = *reference_.whole_meter;
  found.parts.assign(meter.count(), 0);
  RunContext one = reference_.context;
  one.threads = 1;
  candidates_.prepare_views(found.key);
  const auto look = [&](const std::vector<std::size_t>& views) {
    const RunContext& context = views.size() == 1 ? reference_.context : one;
    parallel_each(reference_.context, views.size(), 1, [&](std::size_t k) {
      const auto [seen, at] = candidates_.view(found.key, views[k], context);
      found.parts[views[k]] = meter.part(views[k], seen, at, textures, context);
    });
  };
  const std::size_t first = meter.fullest();
  look({first});
  if (rival && rival->difference < kNothing && found.parts[first] > kPlainlyWorse * rival->parts[first])
    return;
  std::vector<std::size_t> others;
  for (std::size_t v = 0; v < meter.count(); ++v)
    if (v != first) others.push_back(v);
  look(others);
  found.difference = std::accumulate(found.parts.begin(), found.parts.end(), 0.0);
}

/// `from` with its mesh coded finer by parts of a bit: the largest file that was found. Nothing
/// where all that fit are smaller.
std::optional<FoundFile> Search::larger_by_bits(const FoundFile& from, std::size_t scale, int coding) {
  const bool same = scale == from.key.scale && coding == from.key.coding;
  double low = same ? 0 : kFewestExtraBits, high = kMostExtraBits;
  std::optional<FoundFile> best;
  for (int i = 0; i < kMeshTries && !(best && filling_.fills(best->file)); ++i) {
    FoundFile other = from;
    other.key = {scale, coding, (low + high) / 2};
    other.file.glb = mesh(other.key).with(from.file.images);
    forget(other.key);
    (filling_.fits(other.file) ? low : high) = other.key.extra_bits;
    if (filling_.fits(other.file) && other.file.glb.size() >= (best ? *best : from).file.glb.size())
      best = std::move(other);
  }
  return best;
}

/// Where textures cannot take the bytes that are left: the same mesh coded finer, or a finer scale. Of
/// several codings the one that looks nearest.
void Search::fill_by_mesh(FoundFile& best) {
  if (best.key.is_finest() || !mesh(best.key).file->has_draco()) return;
  const FoundFile from = best;
  look_at(best);
  for (std::size_t scale = from.key.scale;; --scale) {
    for (int coding = from.key.coding; coding < kMeshCodings; ++coding) {
      std::optional<FoundFile> other = larger_by_bits(from, scale, coding);
      if (!other || filling_.fills(other->file) < filling_.fills(best.file)) continue;
      look_at(*other);
      if (filling_.fills(other->file) > filling_.fills(best.file) || other->difference <= best.difference)
        best = *std::move(other);
    }
    if (scale == 0 || filling_.fills(best.file) || reference_.wishes.scale) return;
  }
}

Extracted Search::finish(FoundFile found) {
  const MeshKey& key = found.key;
  FilledFile& file = found.file;
  const MeshCandidate& mesh = candidates_.mesh(key);
  const bool fast = reference_.wishes.fast();
  Extracted out;
  out.scale = mesh.scale;
  out.levels = mesh.levels;
  out.triangles = mesh.triangles;
  out.within = filling_.fits(file);
  if (out.within && !filling_.fills(file) && (!fast || file.has_sources))
    out.notes.emplace_back(
        "the package has no more to put into the file: it is smaller than the bytes asked for");
  out.views = static_cast<int>(reference_.cameras.size());
  out.side_px = reference_.side_px;
  out.asked_bytes = bytes_;
  out.images = file.rows;
  out.mesh_bytes = file.glb.size();
  for (const ExtractedImage& i : file.rows) out.mesh_bytes -= i.bytes;
  if (fast) {
    out.mesh_difference = table_geometry(key);
    out.difference = std::min(1.0, std::sqrt(joined(out.mesh_difference) + found.images.loss));
  } else {
    out.mesh_difference = mesh.geometry;
    if (!(found.difference < kNothing)) look_at(found);
    out.difference = found.difference;
  }
  out.glb = std::move(file.glb);
  return out;
}

namespace {

/// S_0 and all of the source's own images, where the bytes hold them: nothing looks nearer, so nothing is
/// looked at.
std::optional<Extracted> whole_source(PackageReader& package, const ExtractBudget& wishes,
                                      const OutputTransform& place, std::uint64_t bytes,
                                      const RunContext& context) {
  if (!holds_source(package, wishes, bytes)) return std::nullopt;
  ExtractBudget tables = wishes;
  tables.effort = ExtractEffort::kFast;
  TextureSource textures(package, 0, context, tables.effort);
  const Reference reference(package, tables, place, textures, context, 0);
  Candidates candidates(reference, textures);
  ProxyDifferences none;
  return Search(reference, candidates, none, bytes).source_file();
}

}  // namespace

std::vector<Extracted> extract_within_bytes(PackageReader& package, const ExtractBudget& wishes,
                                            const OutputTransform& place, const RunContext& context) {
  const std::vector<std::uint64_t>& bytes = wishes.bytes;
  std::vector<std::size_t> order(bytes.size());  // rising: neighbours share most
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t k) { return bytes[k]; });
  std::vector<Extracted> out(bytes.size());
  std::unique_ptr<SharedSearch> shared;
  CpuClock clock;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const std::uint64_t wanted = bytes[order[i]];
    const auto report = [&](double part) {
      context.report((static_cast<double>(i) + part) / static_cast<double>(order.size()));
    };
    if (std::optional<Extracted> source = whole_source(package, wishes, place, wanted, context)) {
      out[order[i]] = *std::move(source);
      report(1);
      continue;
    }
    if (!shared || !shared->textures.serves(most_texels(wishes, wanted), least_texels(wanted))) {
      shared.reset();  // before the next one needs the memory
      shared = std::make_unique<SharedSearch>(package, wishes, place, wanted, context);
    }
    const double reference_cpu_s = clock.since_last_s();
    report(0.2);
    Extracted& found = out[order[i]];
    found = Search(shared->reference, shared->candidates, shared->proxies, wanted).run(report);
    found.spent.reference_cpu_s = reference_cpu_s;
    shared->candidates.forget_lit_meshes();
    clock.since_last_s();
    report(1);
  }
  return out;
}

}  // namespace texmesh
