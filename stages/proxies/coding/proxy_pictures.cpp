#include "stages/proxies/coding/proxy_pictures.h"

#include "format/base/portable_math.h"
#include "stages/image/webp.h"
#include "stages/render/shade.h"

namespace texmesh {
namespace {

constexpr float kOcclusionInColour = 0.5f;
constexpr int kLeastQuality = 1, kMostQuality = 95;
constexpr double kFull =
    -0.025;  // log of the share of the bytes: more is not worth another run of the encoder
// Normals and plain numbers need finer steps than colours for the same look.
constexpr int kNormalQualityAbove = 10, kOrmQualityBelow = 5;

std::uint8_t byte_of(float x) {
  return static_cast<std::uint8_t>(std::floor(std::clamp(x, 0.0f, 1.0f) * 255 + 0.5f));
}

Pixels srgb_pixels(const std::vector<Vec3f>& linear, std::uint32_t width_px, std::uint32_t height_px) {
  Pixels out = encode_srgb(Picture{width_px, linear, {}});
  out.width_px = width_px, out.height_px = height_px;
  return out;
}

Pixels plain_pixels(const std::vector<Vec3f>& values, std::uint32_t width_px, std::uint32_t height_px,
                    bool is_signed) {
  Pixels out{width_px, height_px, 3, {}};
  for (const Vec3f v : values)
    for (int k = 0; k < 3; ++k) out.data.push_back(byte_of(is_signed ? v[k] * 0.5f + 0.5f : v[k]));
  return out;
}

Pixels with_alpha(const Pixels& rgb, const std::vector<float>& alpha) {
  Pixels out{rgb.width_px, rgb.height_px, 4, {}};
  for (std::size_t i = 0; i < alpha.size(); ++i) {
    out.data.insert(out.data.end(), {rgb.data[3 * i], rgb.data[3 * i + 1], rgb.data[3 * i + 2]});
    out.data.push_back(byte_of(alpha[i]));
  }
  return out;
}

Bytes coded_picture(const Pixels& pixels, int quality) {
  WebpOptions options;
  options.quality = static_cast<float>(quality);
  options.alpha_quality = quality;
  return encode_webp(pixels, options);
}

enum MapKind : std::size_t { kBaseColour, kOrm, kNormal, kEmission };

ProxyPictures code_at(const MapPixels& maps, int quality, CodedPictures& coded) {
  const auto code = [&](MapKind kind, const Pixels& pixels, int its_quality) {
    its_quality = std::clamp(its_quality, 0, 100);
    const auto [at, is_new] = coded.images[kind].try_emplace(its_quality);
    if (is_new) at->second = {coded_picture(pixels, its_quality), pixels.width_px, pixels.height_px};
    return at->second;
  };
  ProxyPictures out;
  out.metallic = maps.metallic, out.roughness = maps.roughness, out.emissive = maps.emissive;
  out.quality = quality;
  out.base_colour = code(kBaseColour, maps.base_colour, quality);
  if (maps.choice.orm) out.orm = code(kOrm, maps.orm, quality - kOrmQualityBelow);
  if (maps.choice.normal) out.normal = code(kNormal, maps.normal, quality + kNormalQualityAbove);
  if (!maps.emission.data.empty()) out.emission = code(kEmission, maps.emission, quality);
  return out;
}

/// How fine libwebp's steps are at a quality, 0..1; logarithms of bytes grow evenly with it, while they grow
/// three times as fast with qualities above 75 as with those below.
double fineness_of(int quality) {
  const double q = std::max(quality, 1) / 100.0, share = q < 0.75 ? q * 2 / 3 : 2 * q - 1;
  return portable::exp(portable::log(share) / 3);
}
double quality_of(double fineness) {
  const double share = fineness * fineness * fineness;
  return 100 * (share < 0.5 ? share * 1.5 : (share + 1) / 2);
}

}  // namespace

MapPixels map_pixels(const BakedMaps& maps, const MapChoice& choice) {
  MapPixels out;
  out.choice = choice;
  // A map of one value says no more than a factor.
  constexpr float kSame = 1.5f / 255;
  bool varies = false;
  for (int k = 0; k < 3; ++k) varies = varies || maps.most_orm[k] - maps.least_orm[k] > kSame;
  out.choice.orm = choice.orm && (varies || maps.mean_orm.x < 1 - kSame);
  const std::uint32_t w = maps.width_px, h = maps.height_px;
  std::vector<Vec3f> base = maps.base_colour;
  if (!out.choice.orm)
    for (std::size_t i = 0; i < base.size(); ++i)
      base[i] = base[i] * (1 - kOcclusionInColour * (1 - maps.occlusion_roughness_metallic[i].x));
  out.base_colour = srgb_pixels(base, w, h);
  if (maps.has_alpha) out.base_colour = with_alpha(out.base_colour, maps.alpha);
  out.roughness = maps.mean_orm.y, out.metallic = maps.mean_orm.z;
  if (out.choice.orm) out.orm = plain_pixels(maps.occlusion_roughness_metallic, w, h, false);
  if (choice.normal) out.normal = plain_pixels(maps.normal, w, h, true);
  if (!maps.has_emission) return out;
  std::vector<Vec3f> emission = maps.emission;
  for (int k = 0; k < 3; ++k) {
    const float most = std::min(maps.most_emission[k], 1.0f);
    out.emissive[k] = most;
    for (Vec3f& e : emission) e[k] = most > 0 ? e[k] / most : 0;
  }
  out.emission = srgb_pixels(emission, w, h);
  return out;
}

ProxyPictures code_pictures(const MapPixels& maps, std::size_t max_bytes, CodedPictures& coded) {
  constexpr int kFirstGuess = 60;
  // Finenesses for e times the bytes.
  constexpr double kFirstSlope = 0.3, kLeastSlope = 0.1, kMostSlope = 1;
  std::optional<ProxyPictures> best;
  double slope = kFirstSlope, last_fill = 0;
  int last_quality = 0;
  int quality = coded.last_quality > 0 ? coded.last_quality : kFirstGuess;
  for (int low = kLeastQuality, high = kMostQuality; low <= high;) {
    ProxyPictures tried = code_at(maps, quality, coded);
    const double fill = portable::log(static_cast<double>(tried.bytes()) /
                                      static_cast<double>(std::max<std::size_t>(max_bytes, 1)));
    const double fineness = fineness_of(quality);
    if (last_quality > 0 && fill != last_fill)
      slope =
          std::clamp((fineness - fineness_of(last_quality)) / (fill - last_fill), kLeastSlope, kMostSlope);
    last_quality = quality, last_fill = fill;
    if (fill <= 0) {
      best = std::move(tried);
      if (fill >= kFull) break;
      low = quality + 1;
    } else {
      high = quality - 1;
    }
    // The aim is the middle of what is full enough.
    const double next = quality_of(std::clamp(fineness + (kFull / 2 - fill) * slope, 0.0, 1.0));
    if (low <= high) quality = std::clamp(static_cast<int>(std::floor(next + 0.5)), low, high);
  }
  if (!best) best = code_at(maps, kLeastQuality, coded);
  coded.last_quality = best->quality;
  return std::move(*best);
}

}  // namespace texmesh
