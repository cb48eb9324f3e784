#include "stages/atlas_choice/atlas_choice.h"

#include "format/base/bytes.h"
#include "format/base/portable_math.h"
#include "stages/geometry/mesh_topology.h"
#include "stages/geometry/scale_frames.h"
#include "stages/jpeg/jpeg.h"
#include "stages/render/scale_pictures.h"

namespace texmesh {
namespace {

/// What bytes buy: rising bytes, FLIP of each.
using Curve = std::vector<std::pair<double, double>>;

std::string reason_without_pictures(const ConditionedMesh& source, const std::vector<Material>& materials) {
  bool textured = false;
  for (const Material& m : materials)
    for_each_texture(m, [&](const TextureRef& t) { textured = textured || t.used(); });
  if (!textured || source.mesh.uv0.empty()) return "the model has no texture";
  if (!(bounding_box(source.mesh.positions).diagonal() > 0)) return "the model has no extent";
  const std::size_t charts = count_charts(source.mesh);
  return charts < kFewCharts ? std::to_string(charts) + " charts are few" : "";
}

std::size_t texels_of(const std::vector<RenderTexture>& textures) {
  std::size_t sum = 0;
  for (const RenderTexture& t : textures) sum += std::size_t{t.levels[0].width_px} * t.levels[0].height_px;
  return sum;
}

/// Codes the colours of the finest level; alpha stays. Returns the bytes.
double code_level(RenderTexture& texture, int quality, const RunContext& context) {
  Pixels& level = texture.levels[0];
  const std::uint32_t channels = level.channels, colours = channels >= 3 ? 3 : 1;
  Pixels picture{level.width_px, level.height_px, colours, {}};
  for (std::size_t i = 0; i < level.data.size(); ++i)
    if (i % channels < colours) picture.data.push_back(level.data[i]);
  const Bytes file = encode_jpeg(picture, quality, Subsampling::k420);
  picture = decode_jpeg(file, std::uint64_t{level.width_px} * level.height_px);
  for (std::size_t i = 0; i < picture.data.size(); ++i)
    level.data[i / colours * channels + i % colours] = picture.data[i];
  texture.levels.resize(1);
  complete_mips(texture, context);
  return static_cast<double>(file.size());
}

/// Of S_0 with coded mips, by mip: each looks best for some bytes.
std::vector<Curve> texture_curves(const Mesh& finest, const ShownMaterials& shown,
                                  const ReferenceViews& views, const RunContext& context) {
  constexpr std::array<int, 3> kQualities{20, 50, 85};
  constexpr std::size_t kMips = 3, kMostTexels = 6'500'000;
  std::size_t first = 0;
  while (first < 16 && texels_of(without_finest(shown.textures, first)) > kMostTexels) ++first;
  std::vector<Curve> out;
  for (std::size_t dropped = first; dropped < first + kMips; ++dropped) {
    Curve& curve = out.emplace_back();
    for (const int quality : kQualities) {
      std::vector<RenderTexture> coded = without_finest(shown.textures, dropped);
      double bytes = 0;
      for (RenderTexture& t : coded) bytes += code_level(t, quality, context);
      const RenderScene scene = render_scene(finest, shown.materials, coded.size());
      curve.emplace_back(bytes, picture_loss(views, scene, coded, context).mean());
    }
  }
  return out;
}

/// FLIP for so many bytes of textures; 1 where they are too few.
double texture_loss(const std::vector<Curve>& curves, double bytes) {
  double least = 1;
  for (const Curve& curve : curves) {
    if (bytes < curve.front().first) continue;
    std::size_t k = 1;
    while (k + 1 < curve.size() && curve[k].first < bytes) ++k;
    const auto [b0, f0] = curve[k - 1];
    const auto [b1, f1] = curve[k];
    const double part = b1 > b0 ? std::min(portable::log(bytes / b0) / portable::log(b1 / b0), 1.0) : 1;
    least = std::min(least, f0 + (f1 - f0) * part);
  }
  return least;
}

/// Of scales with the source's texels: some, down to the first that nobody would look at.
Curve mesh_curve(const NestedScales& scales, const std::vector<double>& mesh_bytes,
                 const ShownMaterials& shown, const ReferenceViews& views, double untouched,
                 const RunContext& context) {
  constexpr double kStep = 0.75, kFarOff = 0.15;
  Curve out{{mesh_bytes[0], 0}};
  for (std::size_t k = 1; k < mesh_bytes.size() && out.back().second < kFarOff; ++k) {
    if (mesh_bytes[k] > kStep * out.back().first || mesh_bytes[k] > double(kSampledBytes.back())) continue;
    const Mesh mesh = lit_scale(scales, k, context);
    const RenderScene scene = render_scene(mesh, shown.materials, shown.textures.size());
    // What new texels lose counts once, with the textures.
    const double loss = picture_loss(views, scene, shown.textures, context).mean();
    out.emplace_back(mesh_bytes[k], std::max(loss - untouched, 0.0));
  }
  return out;
}

/// Losses of shape and of texels together, as the quality table adds those of groups up.
double joined(double a, double b) {
  constexpr double kPower = 2.15;
  const auto power = [](double x, double p) { return x > 0 ? portable::pow(x, p) : 0; };
  return power(power(a, kPower) + power(b, kPower), 1 / kPower);
}

std::string hundredths(double x) {
  const int n = static_cast<int>(std::lround(100 * x));
  return (n >= 100 ? std::to_string(n / 100) : "") + "." + (n % 100 < 10 ? "0" : "") +
         std::to_string(n % 100);
}

}  // namespace

AtlasSample sample_atlas(const ConditionedMesh& source, const std::vector<Material>& source_materials,
                         const std::vector<Image>& source_images, const NestedScales& scales,
                         const std::vector<Material>& materials, const std::vector<Image>& images,
                         const RunContext& context) {
  AtlasSample out;
  out.charts = count_charts(scales.mesh);
  out.good = reason_without_pictures(source, source_materials);
  if (!out.good.empty()) return out;
  RunContext inner = context;
  inner.progress = nullptr;
  const auto shown = [&](const Mesh& mesh, const std::vector<Material>& of, const std::vector<Image>& with) {
    return shown_materials(of, with, mesh, enough_side_px(of), inner);
  };
  const ReferenceViews views =
      reference_views(source.mesh, shown(source.mesh, source_materials, source_images), kLargePx, inner);
  const ShownMaterials own = shown(scales.mesh, materials, images);
  const CompetingScales rivals(scales, own, views);
  const RivalPrices prices = rivals.prices_in_plans();
  const Mesh finest = lit_scale(scales, 0, inner);
  const double untouched =
      picture_loss(views, render_scene(finest, own.materials, own.textures.size()), own.textures, inner)
          .mean();
  context.report(0.2);
  const std::vector<Curve> textures = texture_curves(finest, own, views, inner);
  context.report(0.7);
  const Curve meshes = mesh_curve(scales, estimated_mesh_bytes(scales), own, views, untouched, inner);
  for (const std::uint64_t bytes : kSampledBytes) {
    double least = 1;
    for (const auto& [mesh, loss] : meshes) {
      const double left = static_cast<double>(bytes) - prices.besides - prices.mesh * mesh;
      if (left > 0) least = std::min(least, joined(loss, texture_loss(textures, left)));
    }
    out.flip.push_back(least);
    out.proxy_flip.push_back(1);
  }
  return out;
}

AtlasSample with_proxies(AtlasSample sample, const Proxies& proxies) {
  if (!sample.good.empty() || proxies.proxies.empty()) return sample;
  const auto first = static_cast<double>(proxies.proxies.front().glb.size());
  for (const Proxy& p : proxies.proxies)
    for (std::size_t i = 0; i < kSampledBytes.size(); ++i) {
      // Clients fetch the first one in any case.
      const bool is_first = &p == &proxies.proxies.front();
      const double bytes = static_cast<double>(p.glb.size()) + (is_first ? 0 : first);
      if (bytes <= static_cast<double>(kSampledBytes[i]) && !p.losses.empty())
        sample.proxy_flip.at(i) = std::min(sample.proxy_flip[i], p.losses.back().flip_mean);
    }
  return sample;
}

AtlasChoice choose_atlas(const AtlasSample& kept, const AtlasSample& rebuilt) {
  // What costs the source's coefficients must be more than noise.
  constexpr double kWorth = 0.97, kLeastFlip = 1e-3;
  if (!kept.good.empty()) return {false, "auto keeps the source's atlas: " + kept.good};
  if (rebuilt.charts >= kept.charts)
    return {false, "auto keeps the source's atlas of " + std::to_string(kept.charts) +
                       " charts: a new one has no fewer"};
  double sum = 0;
  for (std::size_t i = 0; i < kSampledBytes.size(); ++i) {
    // Both have proxies, which look alike.
    const auto shown = [&](const AtlasSample& of) {
      return std::clamp(of.flip.at(i), kLeastFlip, std::max(kept.proxy_flip.at(i), kLeastFlip));
    };
    sum += portable::log(shown(rebuilt) / shown(kept));
  }
  const double ratio = portable::exp(sum / double(kSampledBytes.size()));
  const auto atlas = [](const AtlasSample& of) {
    return "an atlas of " + std::to_string(of.charts) + " charts";
  };
  const std::string found =
      "sampled pictures of 200 kB to 1 MB are " + hundredths(ratio) + " times as far from the source";
  if (ratio < kWorth)
    return {true, "auto takes " + atlas(rebuilt) + " for " + std::to_string(kept.charts) + ": " + found};
  return {false, "auto keeps the source's atlas of " + std::to_string(kept.charts) + " charts: with " +
                     atlas(rebuilt) + " " + found};
}

}  // namespace texmesh
