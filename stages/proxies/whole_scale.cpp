// A scale as a proxy. Its story:
// 1. Pictures of S_0 at kLargePx, a quarter of the rows, tell what each image loses in several sizes and
// qualities, with everything else at its best (TextureCurves), and what each scale loses with whole images.
// 2. What a mesh loses by its coding, and the bytes that this takes, are known from other scans (kCodings).
// 3. Losses in the same pixels join about as the sum of their squares. So for every number of bytes the mesh
// and the images are chosen by sums: what the mesh leaves is dealt out along the curves.
// 4. The mesh is coded. Where it takes other bytes than was thought, the choice is made again.
// 5. The images are coded, at qualities that fill the file.
#include "stages/proxies/whole_scale.h"

#include "format/base/portable_math.h"
#include "stages/geometry/scale_frames.h"
#include "stages/gltf/scale_glb.h"

namespace texmesh {
namespace {

/// Means of turtle, saxophone, helmet and bust at several scales; for pictures 512 px high.
struct MeshCoding512 {
  int position_bits, uv_bits, normal_bits;
  double loss;   // square of FLIP, beside the finest
  double bytes;  // of those of the usual coding
};
constexpr std::array<MeshCoding512, 4> kCodings{
    {{10, 10, 7, 270e-6, 0.81}, {11, 11, 7, 150e-6, 0.88}, {12, 12, 8, 60e-6, 1}, {13, 13, 8, 35e-6, 1.1}}};
constexpr double kOtherScale = 1.12;  // times the bytes: nearer ones are not looked at
constexpr int kMeshAttempts = 3;
constexpr double kFrameOfImage = 330;  // bytes of an image in the document
constexpr int kMostQualityOfImage = 97;
constexpr double kMissed = 0.06;  // of a mesh' bytes

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

/// Clients count a proxy's textures as four squares of its longest side.
bool keeps_to_gpu_estimate(const std::vector<ProxyTexture>& textures) {
  double texels = 0, side = 0;
  for (const ProxyTexture& t : textures) {
    texels += static_cast<double>(t.width_px) * t.height_px;
    side = std::max({side, static_cast<double>(t.width_px), static_cast<double>(t.height_px)});
  }
  return texels <= 4 * side * side;
}

double cells_of(int bits) { return static_cast<double>((std::uint32_t{1} << bits) - 1); }

}  // namespace

WholeScales::WholeScales(const WholeScaleSource& source, double most_bytes)
    : source_(source),
      most_bytes_(most_bytes),
      textures_(source.mesh, source.materials, source.shown),
      estimates_(estimated_mesh_bytes(source.scales)) {}

void WholeScales::measure(const RunContext& context) {
  if (curves_) return;
  views_ = reference_views(source_.mesh, source_.shown, kLargePx, context, true);
  curves_.emplace(source_.mesh, textures_, *views_, most_bytes_, context);
}

double WholeScales::loss_of(std::size_t scale, const RunContext& context) {
  const auto [at, is_new] = scale_losses_.try_emplace(scale, 0.0);
  if (!is_new || scale == 0) return at->second;
  const Mesh mesh = lit_scale(source_.scales, scale, context);
  const RenderScene scene = render_scene(mesh, source_.shown.materials, source_.shown.textures.size());
  const double flip = picture_loss(*views_, scene, source_.shown.textures, context).mean();
  return at->second = flip * flip;
}

double WholeScales::mesh_bytes(const MeshChoice& mesh) const {
  if (const auto known = files_.find(mesh); known != files_.end())
    return static_cast<double>(known->second.bytes);
  return of_estimate_ * kCodings[mesh.coding].bytes * estimates_[mesh.scale];
}

std::optional<WholeScales::Choice> WholeScales::best_with(std::size_t scale, double bytes,
                                                          const RunContext& context) {
  std::optional<Choice> best;
  for (std::size_t c = 0; c < kCodings.size(); ++c) {
    const MeshChoice mesh{scale, c};
    auto textures = curves_->deal(bytes - mesh_bytes(mesh));
    if (!textures) continue;
    const double loss = kCodings[c].loss + textures->loss;
    if (!best || loss < best->loss) best = Choice{mesh, std::move(*textures), loss};
  }
  if (best) best->loss += loss_of(scale, context);
  return best;
}

/// From a scale whose mesh takes half of the bytes to finer and coarser ones, as long as they look better.
std::optional<WholeScales::Choice> WholeScales::choose(double bytes, const RunContext& context) {
  const std::size_t count = source_.scales.scales.size();
  std::size_t start = 0;
  while (start + 1 < count && mesh_bytes({start, 1}) > bytes / 2) ++start;
  std::optional<Choice> best = best_with(start, bytes, context);
  for (const bool finer : {true, false}) {
    constexpr int kMostWorse = 2;  // S_0 is nearer than its neighbours tell
    int worse = 0;
    std::size_t last = start;
    for (std::size_t k = start; worse < kMostWorse && (finer ? k > 0 : k + 1 < count);) {
      k = finer ? k - 1 : k + 1;
      const double ratio = finer ? estimates_[k] / estimates_[last] : estimates_[last] / estimates_[k];
      if (ratio < kOtherScale && k != 0) continue;
      last = k;
      std::optional<Choice> found = best_with(k, bytes, context);
      if (!found && finer) break;
      if (found && (!best || found->loss < best->loss))
        best = std::move(found), worse = 0;
      else
        ++worse;
    }
  }
  return best;
}

ScaleCoding WholeScales::coding_of(const MeshChoice& mesh, const RunContext& context) const {
  const MeshCoding512& how = kCodings[mesh.coding];
  ScaleCoding out = make_coding(source_.scales.mesh, source_.materials, source_.images, ScalesOptions{});
  out.frames = scale_frames(source_.scales, mesh.scale, context);
  out.options.normal_bits = how.normal_bits;
  coarsen_positions(out.position, cells_of(how.position_bits), out.mesh,
                    source_.scales.scales[mesh.scale].triangles);
  for (QuantisationGrid& uv : out.uv) coarsen(uv, cells_of(how.uv_bits) * static_cast<double>(uv.range));
  return out;
}

const WholeScales::MeshFile& WholeScales::mesh_file(const MeshChoice& mesh, const RunContext& context) {
  const auto [at, is_new] = files_.try_emplace(mesh);
  if (!is_new) return at->second;
  const ScaleCoding coding = coding_of(mesh, context);
  const NestedScale& scale = source_.scales.scales[mesh.scale];
  at->second.bytes = write_scale(coding, scale, source_.materials, {}).glb.size();
  at->second.shown = rounded_scale(lit_scale(source_.scales, mesh.scale, context), coding);
  of_estimate_ =
      static_cast<double>(at->second.bytes) / (kCodings[mesh.coding].bytes * estimates_[mesh.scale]);
  return at->second;
}

/// All images with qualities that are so much higher.
WholeScales::CodedImages WholeScales::coded_images(const TextureCurves::Dealt& dealt, int higher) {
  const auto& groups = textures_.groups();
  CodedImages out;
  for (std::size_t g = 0; g < groups.size(); ++g)
    for (const SourceTextures::Member& m : groups[g].members) {
      const TexturePlan& plan = dealt.plans[g];
      const int quality = std::clamp(plan.quality + higher, 1, kMostQualityOfImage);
      CodedTexture coded = textures_.coded(m, groups[g].use, plan.steps, quality, false);
      out.rows.push_back({use_name(groups[g].use), coded.width_px, coded.height_px, coded.file.size()});
      out.bytes += static_cast<double>(coded.file.size()) + kFrameOfImage;
      out.files.push_back({m.image, 0, coded.mime_type, std::move(coded.file), {}});
    }
  return out;
}

/// The images at qualities that fill so many bytes, all of them higher or lower than was dealt.
WholeScales::CodedImages WholeScales::filled(const TextureCurves::Dealt& dealt, double bytes) {
  constexpr double kFull = 0.98, kQualitiesOfE = 30;  // so many above it take e times the bytes
  constexpr int kQualityTries = 5;
  std::optional<CodedImages> best;
  int low = -kMostQualityOfImage, high = kMostQualityOfImage, higher = 0;
  for (int i = 0; i < kQualityTries && low <= high; ++i) {
    CodedImages coded = coded_images(dealt, higher);
    const double fill = coded.bytes / std::max(bytes, 1.0);
    (fill <= 1 ? low : high) = fill <= 1 ? higher + 1 : higher - 1;
    if (fill <= 1) best = std::move(coded);
    if (fill <= 1 && fill >= kFull) break;
    const double step = -kQualitiesOfE * portable::log(fill / ((1 + kFull) / 2));
    higher = std::clamp(higher + static_cast<int>(std::floor(step + 0.5)), low, std::max(low, high));
  }
  return best ? std::move(*best) : coded_images(dealt, -kMostQualityOfImage);
}

std::optional<MadeProxy> WholeScales::finished(const Choice& choice, std::uint64_t bytes,
                                               const RunContext& context) {
  const MeshFile& mesh = mesh_file(choice.mesh, context);
  CodedImages images = filled(choice.textures, static_cast<double>(bytes) - static_cast<double>(mesh.bytes));
  MadeProxy out;
  ScaleFile made = write_scale(coding_of(choice.mesh, context), source_.scales.scales[choice.mesh.scale],
                               source_.materials, images.files);
  if (static_cast<double>(made.glb.size()) > kOverAsked * static_cast<double>(bytes)) return std::nullopt;
  out.proxy.glb = std::move(made.glb);
  out.proxy.target_bytes = bytes;
  out.proxy.triangles = made.triangles, out.proxy.vertices = made.vertices;
  out.proxy.textures = std::move(images.rows);
  if (!keeps_to_gpu_estimate(out.proxy.textures)) return std::nullopt;
  out.shown.mesh = mesh.shown;
  out.shown.shown = source_.shown;
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
  measure(context);
  const auto target = static_cast<double>(bytes);
  std::optional<Choice> choice;
  for (int attempt = 0; attempt < kMeshAttempts; ++attempt) {
    choice = choose(target, context);
    if (!choice) return std::nullopt;
    const double thought = mesh_bytes(choice->mesh);
    const auto found = static_cast<double>(mesh_file(choice->mesh, context).bytes);
    if (std::fabs(found - thought) <= kMissed * found) break;
  }
  auto textures = curves_->deal(target - static_cast<double>(mesh_file(choice->mesh, context).bytes));
  if (!textures) return std::nullopt;
  choice->textures = std::move(*textures);
  return finished(*choice, bytes, context);
}

}  // namespace texmesh
