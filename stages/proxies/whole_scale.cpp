// A scale as a proxy. Its story:
// 1. Pictures of S_0 at kLargePx, a quarter of the rows, tell what each image loses in several sizes and
// qualities, with everything else at its best (TextureCurves), and what some scales lose with whole images.
// 2. What a mesh loses by its coding, and the bytes that this takes, are known from other scans
// (kScaleFineness).
// 3. Losses in the same pixels join about as the sum of their squares. So for every number of bytes the mesh
// and the images are chosen by sums: what the mesh leaves is dealt out along the curves.
// 4. The mesh is coded. Where it takes other bytes than was thought, the choice is made again.
// 5. The images are coded, at qualities that fill the file.
#include "stages/proxies/whole_scale.h"

#include "format/base/portable_math.h"
#include "stages/geometry/scale_frames.h"
#include "stages/gltf/scale_fineness.h"
#include "stages/gltf/scale_glb.h"

namespace texmesh {
namespace {

constexpr std::size_t kCodings = 4;   // of kScaleFineness: no proxy has bytes for finer ones
constexpr double kOtherScale = 1.12;  // times the bytes: nearer ones are not looked at
constexpr int kMeshAttempts = 3;
constexpr int kMostQualityOfImage = 97;
constexpr double kAimedFull = 0.98, kNearlyFull = 0.96;  // of the bytes for images
constexpr double kMissed = 0.06;                         // of a mesh' bytes
constexpr double kOfEstimate = 0.62;  // what a mesh of the usual coding takes, until one is coded

const char* use_name(TextureUse use) {
  switch (use) {
    case TextureUse::kBaseColour:
      return "base-colour";
    case TextureUse::kNormal:
      return "normal";
    case TextureUse::kEmissive:
      return "emissive";
    default:
      return "metallic-roughness";
  }
}

/// Whether the file has no place for so many images, or clients do not count them.
bool has_too_many(const SourceTextures& textures, double most_bytes) {
  constexpr double kFarTooMany = 8;
  std::size_t images = 0;
  for (const SourceTextures::Group& group : textures.groups()) images += group.members.size();
  return static_cast<double>(images) * kFrameOfImage > most_bytes ||
         !textures.keep_to_gpu_estimate(std::vector<int>(textures.groups().size()), kFarTooMany);
}

std::vector<int> steps_of(const TextureCurves::Dealt& dealt) {
  std::vector<int> out;
  for (const TexturePlan& plan : dealt.plans) out.push_back(plan.steps);
  return out;
}

/// Bytes of the JSON of a GLB.
double json_bytes(const Bytes& glb) {
  std::uint32_t out = 0;
  for (std::size_t k = 0; k < 4; ++k) out |= std::uint32_t{glb.at(12 + k)} << 8 * k;
  return out;
}

double cells_of(int bits) { return static_cast<double>((std::uint32_t{1} << bits) - 1); }

}  // namespace

WholeScales::WholeScales(const WholeScaleSource& source, double most_bytes)
    : source_(source),
      materials_(source.materials),
      most_bytes_(most_bytes),
      textures_(source.scales.mesh, source.materials, source.shown),
      hopeless_(has_too_many(textures_, most_bytes)),
      estimates_(estimated_mesh_bytes(source.scales)) {
  // Without its texture a factor would hold everywhere: all of an object would be glass.
  for (Material& m : materials_)
    std::erase_if(m.extensions, [&](const MaterialExtension& extension) {
      return std::ranges::any_of(extension.textures, [&](const ExtensionTexture& t) {
        return t.texture.used() && !textures_.has(t.texture.image);
      });
    });
}

void WholeScales::measure(const RunContext& context) {
  if (curves_) return;
  views_ = reference_views(source_.mesh, source_.shown, kLargePx, context, 4);
  curves_.emplace(source_.mesh, textures_, *views_, most_bytes_, context);
}

double WholeScales::flip_of(std::size_t scale, const RunContext& context) {
  const auto [at, is_new] = scale_flips_.try_emplace(scale, 0.0);
  if (!is_new || scale <= source_.stand_in) return at->second;
  const Mesh mesh = lit_scale(source_.scales, scale, frames_of(scale, context));
  const RenderScene scene = render_scene(mesh, source_.shown.materials, source_.shown.textures.size());
  return at->second = picture_loss(*views_, scene, source_.shown.textures, context).mean();
}

/// A square of FLIP. Between scales that pictures are made of it grows evenly as the bytes fall: of a
/// saxophone 3 % off. The finest of them is S_0's neighbour, which is not as near as S_0 tells.
double WholeScales::loss_of(std::size_t scale, const RunContext& context) {
  constexpr double kApart = 1.5;  // times the bytes
  if (scale <= source_.stand_in) return 0;
  std::size_t finer = source_.stand_in + 1, coarser = finer;
  for (std::size_t k = finer; coarser < scale && k < estimates_.size(); ++k)
    if (k + 1 == estimates_.size() || estimates_[k] * kApart <= estimates_[coarser])
      finer = std::exchange(coarser, k);
  if (coarser == scale) finer = coarser;
  double flip = flip_of(finer, context);
  if (const double whole = portable::log(estimates_[finer] / estimates_[coarser]); whole > 0)
    flip += (flip_of(coarser, context) - flip) * portable::log(estimates_[finer] / estimates_[scale]) / whole;
  return flip * flip;
}

double WholeScales::mesh_bytes(const MeshChoice& mesh) const {
  if (const auto known = file_bytes_.find(mesh); known != file_bytes_.end()) return known->second;
  return document_bytes_ + of_estimate_ * kScaleFineness[mesh.coding].bytes * estimates_[mesh.scale];
}

/// At least that of a finer one that has been looked at.
double WholeScales::least_loss_of(std::size_t scale) const {
  const auto behind = scale_flips_.upper_bound(scale);
  const double flip = behind == scale_flips_.begin() ? 0 : std::prev(behind)->second;
  return flip * flip;
}

/// A scale that cannot keep to the loss is not looked at, and has more.
std::optional<WholeScales::Choice> WholeScales::best_with(std::size_t scale, double bytes, double most_loss,
                                                          const RunContext& context) {
  std::optional<Choice> best;
  for (std::size_t c = 0; c < kCodings; ++c) {
    const MeshChoice mesh{scale, c};
    auto textures = curves_->deal(bytes - mesh_bytes(mesh));
    if (!textures || !textures_.keep_to_gpu_estimate(steps_of(*textures))) continue;
    const double loss = kScaleFineness[c].loss + textures->loss;
    if (!best || loss < best->loss) best = Choice{mesh, std::move(*textures), loss};
  }
  if (!best) return best;
  const double least = least_loss_of(scale);
  best->loss += best->loss + least > most_loss ? least : loss_of(scale, context);
  return best;
}

/// From a scale whose mesh takes half of the bytes to finer and coarser ones, as long as they look better.
std::optional<WholeScales::Choice> WholeScales::choose(double bytes, const RunContext& context) {
  const std::size_t count = source_.scales.scales.size();
  std::size_t start = 0;
  while (start + 1 < count && mesh_bytes({start, 1}) > bytes / 2) ++start;
  constexpr double kAny = std::numeric_limits<double>::infinity();
  std::optional<Choice> best = best_with(start, bytes, kAny, context);
  for (const bool finer : {true, false}) {
    constexpr int kMostWorse = 2;  // S_0 is nearer than its neighbours tell
    int worse = 0;
    std::size_t last = start;
    for (std::size_t k = start; worse < kMostWorse && (finer ? k > 0 : k + 1 < count);) {
      k = finer ? k - 1 : k + 1;
      const double ratio = finer ? estimates_[k] / estimates_[last] : estimates_[last] / estimates_[k];
      if (ratio < kOtherScale && k != 0) continue;
      last = k;
      std::optional<Choice> found = best_with(k, bytes, best ? best->loss : kAny, context);
      if (!found && finer) break;
      if (found && (!best || found->loss < best->loss))
        best = std::move(found), worse = 0;
      else if (found)
        ++worse;
    }
  }
  return best;
}

const ScaleFrames& WholeScales::frames_of(std::size_t scale, const RunContext& context) {
  if (!frames_ || frames_->first != scale)
    frames_.emplace(scale, scale_frames(source_.scales, scale, context));
  return frames_->second;
}

ScaleCoding WholeScales::coding_of(const MeshChoice& mesh, const RunContext& context) {
  const ScaleFineness& how = kScaleFineness[mesh.coding];
  if (!coding_)
    coding_.emplace(make_coding(source_.scales.mesh, materials_, source_.images, ScalesOptions{}));
  ScaleCoding out = *coding_;
  out.frames = frames_of(mesh.scale, context);
  out.options.normal_bits = how.normal_bits;
  coarsen_positions(out.position, cells_of(how.position_bits), out.mesh,
                    source_.scales.scales[mesh.scale].triangles);
  for (QuantisationGrid& uv : out.uv) coarsen(uv, cells_of(how.uv_bits) * static_cast<double>(uv.range));
  return out;
}

void WholeScales::code_mesh_of(const MeshChoice& mesh, const RunContext& context) {
  const auto [at, is_new] = file_bytes_.try_emplace(mesh, 0.0);
  if (!is_new) return;
  const Bytes glb =
      write_scale(coding_of(mesh, context), source_.scales.scales[mesh.scale], materials_, {}).glb;
  at->second = static_cast<double>(glb.size());
  document_bytes_ = json_bytes(glb);
  of_estimate_ =
      (at->second - document_bytes_) / (kScaleFineness[mesh.coding].bytes * estimates_[mesh.scale]);
}

/// All images with qualities that are so much higher.
WholeScales::CodedImages WholeScales::coded_images(const TextureCurves::Dealt& dealt, int higher,
                                                   bool quick) {
  const auto& groups = textures_.groups();
  CodedImages out;
  for (std::size_t g = 0; g < groups.size(); ++g)
    for (const SourceTextures::Member& m : groups[g].members) {
      const TexturePlan& plan = dealt.plans[g];
      const int quality = std::clamp(plan.quality + higher, 1, kMostQualityOfImage);
      CodedTexture coded = textures_.coded(m, groups[g].use, plan.steps, quality, quick);
      out.rows.push_back({use_name(groups[g].use), coded.width_px, coded.height_px, coded.file.size()});
      out.bytes += static_cast<double>(coded.file.size()) + kFrameOfImage;
      out.files.push_back({m.image, 0, coded.mime_type, std::move(coded.file), {}});
    }
  return out;
}

/// How much higher qualities may be than was dealt where images of one scan, which take one_scan(higher),
/// fill so many bytes.
int WholeScales::higher_for(const std::function<double(int)>& one_scan, double bytes) {
  constexpr double kQualitiesOfE = 30;  // so many above it take e times the bytes
  constexpr int kQualityTries = 5;
  const double full = portable::log(kAimedFull), aim = portable::log((1 + kAimedFull) / 2);
  const auto fill_of = [&](int higher) { return portable::log(one_scan(higher) / std::max(bytes, 1.0)); };
  const auto nearer = [&](int higher, double fill) { return higher + kQualitiesOfE * (aim - fill); };
  return fullest(-kMostQualityOfImage, kMostQualityOfImage, 0, kQualityTries, full, fill_of, nearer)
      .value_or(-kMostQualityOfImage);
}

/// The images at qualities that fill so many bytes. Several scans take a share of the bytes of one, which the
/// file before tells: coding takes three times as long.
WholeScales::CodedImages WholeScales::filled(const TextureCurves::Dealt& dealt, double bytes) {
  constexpr int kFiles = 3;
  if (dealt.plans.empty()) return {};
  std::map<int, double> known;
  const auto one_scan = [&](int higher) {
    const auto [at, is_new] = known.try_emplace(higher, 0.0);
    if (is_new) at->second = coded_images(dealt, higher, true).bytes;
    return at->second;
  };
  std::optional<CodedImages> best;
  for (int i = 0; i < kFiles; ++i) {
    const int higher = higher_for(one_scan, bytes / scans_share_);
    CodedImages coded = coded_images(dealt, higher, false);
    const double fill = coded.bytes / std::max(bytes, 1.0);
    scans_share_ = std::clamp(coded.bytes / one_scan(higher), 0.5, 1.2);
    if (fill <= 1 && (!best || coded.bytes > best->bytes)) best = std::move(coded);
    if (best && (fill >= kNearlyFull || i > 0)) break;
  }
  return best ? std::move(*best) : coded_images(dealt, -kMostQualityOfImage, false);
}

std::optional<MadeProxy> WholeScales::finished(const Choice& choice, std::uint64_t bytes,
                                               const RunContext& context) {
  const double left = static_cast<double>(bytes) - mesh_bytes(choice.mesh);
  CodedImages images = filled(choice.textures, left);
  const ScaleCoding coding = coding_of(choice.mesh, context);
  MadeProxy out;
  ScaleFile made = write_scale(coding, source_.scales.scales[choice.mesh.scale], materials_, images.files);
  if (static_cast<double>(made.glb.size()) > kOverAsked * static_cast<double>(bytes)) return std::nullopt;
  out.proxy.glb = std::move(made.glb);
  out.proxy.target_bytes = bytes;
  out.proxy.triangles = made.triangles, out.proxy.vertices = made.vertices;
  out.proxy.textures = std::move(images.rows);
  out.shown.mesh = rounded_scale(lit_scale(source_.scales, choice.mesh.scale, coding.frames), coding);
  out.shown.shown.materials = source_.shown.materials;
  out.shown.shown.textures.resize(source_.shown.textures.size());
  std::size_t i = 0;
  for (const SourceTextures::Group& group : textures_.groups())
    for (const SourceTextures::Member& m : group.members) {
      const CodedTexture coded{images.files[i].mime_type, std::move(images.files[i].bytes), 0, 0};
      for (const std::size_t t : m.textures) out.shown.shown.textures[t] = textures_.shown(coded, t, context);
      ++i;
    }
  return out;
}

std::optional<MadeProxy> WholeScales::of(std::uint64_t bytes, const RunContext& context) {
  if (hopeless_) return std::nullopt;
  measure(context);
  of_estimate_ = kOfEstimate;  // a mesh of another size tells nothing of it
  const auto target = static_cast<double>(bytes);
  std::optional<Choice> choice;
  for (int attempt = 0; attempt < kMeshAttempts; ++attempt) {
    choice = choose(target, context);
    if (!choice) return std::nullopt;
    const double thought = mesh_bytes(choice->mesh);
    code_mesh_of(choice->mesh, context);
    const double found = mesh_bytes(choice->mesh);
    if (std::fabs(found - thought) <= kMissed * found) break;
  }
  auto textures = curves_->deal(target - mesh_bytes(choice->mesh));
  if (!textures || !textures_.keep_to_gpu_estimate(steps_of(*textures))) return std::nullopt;
  choice->textures = std::move(*textures);
  return finished(*choice, bytes, context);
}

}  // namespace texmesh
