#include "stages/proxies/source_textures.h"

#include "format/base/portable_math.h"
#include "format/documents/manifest.h"
#include "stages/base/loss_curve.h"
#include "stages/image/resize.h"
#include "stages/image/webp.h"
#include "stages/jpeg/jpeg.h"
#include "stages/jpeg/jpeg_coder.h"

namespace texmesh {
namespace {

constexpr std::size_t kMostGroupsOfOne = 6;
constexpr std::uint32_t kLeastSide = 8;
constexpr std::uint64_t kMostPixels = std::uint64_t{1} << 28;

const TextureRef& reference_of(const Material& m, TextureUse use) {
  switch (use) {
    case TextureUse::kBaseColour:
      return m.base_colour_texture;
    case TextureUse::kMetallicRoughness:
      return m.metallic_roughness_texture;
    case TextureUse::kNormal:
      return m.normal_texture;
    case TextureUse::kOcclusion:
      return m.occlusion_texture;
    case TextureUse::kEmissive:
      break;
  }
  return m.emissive_texture;
}

double squared(double flip) { return flip * flip; }

}  // namespace

SourceTextures::SourceTextures(const Mesh& finest, const std::vector<Material>& materials,
                               const ShownMaterials& shown)
    : shown_(shown) {
  std::vector<bool> used(materials.size());
  for (const std::uint16_t m : finest.triangle_material) used.at(m) = true;
  std::map<std::uint32_t, Group> by_image;
  for (std::size_t u = 0; u < kTextureUses; ++u)
    for (std::size_t m = 0; m < materials.size(); ++m) {
      const auto use = static_cast<TextureUse>(u);
      const std::int32_t texture = shown.materials[m].slot(use).texture;
      if (!used[m] || texture < 0) continue;
      const auto image = static_cast<std::uint32_t>(reference_of(materials[m], use).image);
      Group& group = by_image.try_emplace(image, Group{use, {{image, {}}}}).first->second;
      std::vector<std::size_t>& textures = group.members.front().textures;
      const auto t = static_cast<std::size_t>(texture);
      if (std::ranges::find(textures, t) == textures.end()) textures.push_back(t);
    }
  for (auto& [image, group] : by_image) {
    const auto like = std::ranges::find(groups_, group.use, &Group::use);
    if (by_image.size() <= kMostGroupsOfOne || like == groups_.end())
      groups_.push_back(std::move(group));
    else
      like->members.push_back(std::move(group.members.front()));
  }
}

bool SourceTextures::has(std::int32_t image) const {
  return std::ranges::any_of(groups_, [&](const Group& group) {
    return std::ranges::any_of(group.members,
                               [&](const Member& m) { return static_cast<std::int64_t>(m.image) == image; });
  });
}

bool SourceTextures::keep_to_gpu_estimate(const std::vector<int>& steps, double squares) const {
  double all = 0, side = 0;
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    all += texels(groups_[g], steps[g]);
    side = std::max(side, static_cast<double>(side_px(groups_[g], steps[g])));
  }
  return all <= squares * side * side;
}

Vec2<std::uint32_t> SourceTextures::sides(const Member& member, int steps) const {
  const RenderTexture& texture = shown_.textures[member.textures.front()];
  const double share = portable::exp(-0.5 * steps * portable::log(2));
  const auto side = [&](std::uint32_t full, std::uint32_t finest) {
    const auto px = static_cast<std::uint32_t>(full * share + 0.5);
    return std::clamp(px, std::min(kLeastSide, finest), finest);
  };
  const Pixels& finest = texture.levels.front();
  return {side(texture.width_px, finest.width_px), side(texture.height_px, finest.height_px)};
}

double SourceTextures::texels(const Group& group, int steps) const {
  double out = 0;
  for (const Member& m : group.members) {
    const Vec2<std::uint32_t> side = sides(m, steps);
    out += static_cast<double>(side.x) * side.y;
  }
  return out;
}

std::uint32_t SourceTextures::side_px(const Group& group, int steps) const {
  std::uint32_t out = 0;
  for (const Member& m : group.members) out = std::max({out, sides(m, steps).x, sides(m, steps).y});
  return out;
}

const Pixels& SourceTextures::pixels(const Member& member, TextureUse use, int steps) {
  const auto [at, is_new] = pixels_.try_emplace({member.image, steps});
  if (!is_new) return at->second;
  const std::vector<Pixels>& levels = shown_.textures[member.textures.front()].levels;
  const Vec2<std::uint32_t> side = sides(member, steps);
  std::size_t level = 0;
  while (level + 1 < levels.size() && levels[level + 1].width_px >= side.x &&
         levels[level + 1].height_px >= side.y)
    ++level;
  const Averaging kind = is_srgb(use)                 ? Averaging::kLight
                         : use == TextureUse::kNormal ? Averaging::kNormals
                                                      : Averaging::kNumbers;
  return at->second = reduced_with_alpha(levels[level], side.x, side.y, kind);
}

CodedTexture SourceTextures::coded(const Member& member, TextureUse use, int steps, int quality, bool quick) {
  constexpr std::size_t kSmallTexels = 65536;  // one scan has less beside its coefficients
  const Pixels& from = pixels(member, use, steps);
  CodedTexture out{"image/jpeg", {}, from.width_px, from.height_px};
  if (from.channels == 4) {
    WebpOptions options;
    options.quality = static_cast<float>(quality);
    out.mime_type = "image/webp";
    out.file = encode_webp(from, options);
    return out;
  }
  JpegKind kind;
  kind.channels = from.channels;
  kind.rgb = !is_srgb(use) && from.channels == 3;
  kind.subsampling = Subsampling::k444;
  const bool one_scan = quick || std::size_t{from.width_px} * from.height_px <= kSmallTexels;
  kind.file = FileSteps{static_cast<double>(quality), true, one_scan};
  out.file = JpegCoder(kind).complete(
      {from.data.data(), std::size_t{from.width_px} * from.channels, from.width_px, from.height_px});
  return out;
}

RenderTexture SourceTextures::shown(const CodedTexture& coded, std::size_t texture,
                                    const RunContext& context) const {
  const bool is_jpeg = coded.mime_type == std::string_view("image/jpeg");
  return render_texture(is_jpeg ? decode_jpeg(coded.file, kMostPixels) : decode_webp_rgba(coded.file),
                        shown_.textures[texture].srgb, 0, context);
}

namespace {

/// Files of one group, each in pictures of S_0.
class GroupPictures {
 public:
  GroupPictures(const Mesh& mesh, SourceTextures& textures, const ReferenceViews& views,
                const RunContext& context)
      : mesh_(mesh), textures_(textures), views_(views), context_(context), all_(textures.full().textures) {
    const RenderScene scene = render_scene(mesh, textures.full().materials, 0);
    for (const ReferenceViews::View& v : views.views) seen_.push_back(v.seen(scene, context));
  }

  /// Sets the losses.
  void look_at(const SourceTextures::Group& group, std::vector<TexturePlan>& plans) {
    all_.resize(textures_.full().textures.size());
    std::vector<std::vector<RenderMaterial>> materials(plans.size(), textures_.full().materials);
    for (std::size_t p = 0; p < plans.size(); ++p) {
      plans[p].bytes = 0;
      for (const SourceTextures::Member& m : group.members) {
        const CodedTexture coded = textures_.coded(m, group.use, plans[p].steps, plans[p].quality, true);
        plans[p].bytes += static_cast<double>(coded.file.size()) + kFrameOfImage;
        for (const std::size_t t : m.textures) {
          replace(materials[p], t, all_.size());
          all_.push_back(textures_.shown(coded, t, context_));
        }
      }
    }
    std::vector<const std::vector<RenderMaterial>*> variants;
    for (const auto& m : materials) variants.push_back(&m);
    std::vector<FlipSum> sums(plans.size());
    RenderScene scene = render_scene(mesh_, materials.front(), all_.size());
    for (std::size_t v = 0; v < seen_.size(); ++v) {
      const PictureVariants pictures =
          shade_variants(scene, seen_[v], variants, all_, views_.environment, context_);
      const PixelSpans spans = pictures.spans();
      Picture picture;
      for (std::size_t p = 0; p < plans.size(); ++p)
        sums[p].add(views_.views[v].loss_of(pictures, p, spans, picture));
    }
    for (std::size_t p = 0; p < plans.size(); ++p) plans[p].loss = squared(sums[p].mean());
  }

 private:
  static void replace(std::vector<RenderMaterial>& materials, std::size_t from, std::size_t to) {
    for (RenderMaterial& m : materials)
      for (TextureSlot& slot : m.textures)
        if (slot.texture == static_cast<std::int32_t>(from)) slot.texture = static_cast<std::int32_t>(to);
  }
  const Mesh& mesh_;
  SourceTextures& textures_;
  const ReferenceViews& views_;
  const RunContext& context_;
  std::vector<RenderTexture> all_;  // as they are, and behind them those of the group's files
  std::vector<Visibility> seen_;
};

/// Sizes whose files may fit, from the largest on by halves. Qualities between them follow from those that
/// are looked at, so the two sizes that most files take have most of them.
std::vector<TexturePlan> plans_of(const SourceTextures& textures, const SourceTextures::Group& group,
                                  double most_bytes) {
  constexpr double kMostTexelsPerByte = 4;
  const std::array<std::vector<int>, 4> qualities{{{30, 60, 85}, {30, 60, 85}, {60}, {60}}};  // by size
  constexpr int kQualityOfTheSmallest = 85;
  std::vector<TexturePlan> out;
  int steps = 0;
  while (textures.side_px(group, steps) > kLeastSide &&
         (textures.side_px(group, steps) > kMaxProxyTexturePx ||
          textures.texels(group, steps) > kMostTexelsPerByte * most_bytes))
    ++steps;
  const auto last_side = [&](int s) { return textures.side_px(group, s) <= kLeastSide; };
  for (std::size_t i = 0; i < qualities.size() && !last_side(steps); ++i, steps += 2)
    for (const int quality : qualities[i]) out.push_back({steps, quality});
  while (!last_side(steps)) ++steps;
  out.push_back({steps, kQualityOfTheSmallest});
  return out;
}

}  // namespace

TextureCurves::TextureCurves(const Mesh& mesh, SourceTextures& textures, const ReferenceViews& views,
                             double most_bytes, const RunContext& context) {
  GroupPictures pictures(mesh, textures, views, context);
  for (const SourceTextures::Group& group : textures.groups()) {
    context.check_cancelled();
    std::vector<TexturePlan> plans = plans_of(textures, group, most_bytes);
    pictures.look_at(group, plans);
    curves_.push_back(convex_curve(std::move(plans)));
  }
}

std::optional<TextureCurves::Dealt> TextureCurves::deal(double bytes) const {
  std::vector<std::size_t> at(curves_.size());
  double all = 0;
  for (const auto& curve : curves_) all += curve.front().bytes;
  if (all > bytes) return std::nullopt;
  while (true) {
    const std::size_t best = best_step(curves_, at, [&](std::size_t g) {
      return all + curves_[g][at[g] + 1].bytes - curves_[g][at[g]].bytes <= bytes ? 1.0 : 0.0;
    });
    if (best == curves_.size()) break;
    all += curves_[best][at[best] + 1].bytes - curves_[best][at[best]].bytes;
    ++at[best];
  }
  Dealt out;
  out.bytes = all;
  for (std::size_t g = 0; g < curves_.size(); ++g) {
    out.plans.push_back(curves_[g][at[g]]);
    out.loss += out.plans.back().loss;
  }
  return out;
}

}  // namespace texmesh
