#include "stages/proxies/coding/proxy_pictures.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "format/base/portable_math.h"
#include "stages/proxies/coding/webp_picture.h"
#include "stages/render/shade.h"

namespace texmesh::proxies {
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

ProxyImage code_picture(const Pixels& pixels, int quality) {
  return {encode_webp(pixels, std::clamp(quality, 0, 100)), pixels.width_px, pixels.height_px};
}

ProxyPictures code_at(const MapPixels& maps, int quality) {
  ProxyPictures out;
  out.metallic = maps.metallic, out.roughness = maps.roughness, out.emissive = maps.emissive;
  out.quality = quality;
  out.base_colour = code_picture(maps.base_colour, quality);
  if (maps.choice.orm) out.orm = code_picture(maps.orm, quality - kOrmQualityBelow);
  if (maps.choice.normal) out.normal = code_picture(maps.normal, quality + kNormalQualityAbove);
  if (!maps.emission.data.empty()) out.emission = code_picture(maps.emission, quality);
  return out;
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

ProxyPictures code_pictures(const MapPixels& maps, std::size_t max_bytes) {
  constexpr int kFirstGuess = 60;
  constexpr double kFirstSlope = 45, kLeastSlope = 8, kMostSlope = 120;  // qualities for e times the bytes
  std::optional<ProxyPictures> best;
  double slope = kFirstSlope, last_fill = 0;
  int last_quality = 0;
  for (int low = kLeastQuality, high = kMostQuality, quality = kFirstGuess; low <= high;) {
    ProxyPictures coded = code_at(maps, quality);
    const double fill = portable::log(static_cast<double>(coded.bytes()) /
                                      static_cast<double>(std::max<std::size_t>(max_bytes, 1)));
    if (last_quality > 0 && fill != last_fill)
      slope = std::clamp((quality - last_quality) / (fill - last_fill), kLeastSlope, kMostSlope);
    last_quality = quality, last_fill = fill;
    if (fill <= 0) {
      best = std::move(coded);
      if (fill >= kFull) break;
      low = quality + 1;
    } else {
      high = quality - 1;
    }
    // The aim is the middle of what is full enough.
    const double step = std::floor((kFull / 2 - fill) * slope + 0.5);
    quality = low <= high ? std::clamp(quality + static_cast<int>(step), low, high) : quality;
  }
  return best ? std::move(*best) : code_at(maps, kLeastQuality);
}

}  // namespace texmesh::proxies
