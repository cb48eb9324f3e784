#include "stages/proxies/coding/proxy_pictures.h"

#include <algorithm>
#include <cmath>

#include "format/base/errors.h"
#include "stages/proxies/coding/webp_picture.h"
#include "stages/render/shade.h"

namespace texmesh::proxies {
namespace {

constexpr float kOcclusionInColour = 0.5f;
constexpr int kLeastQuality = 5, kMostQuality = 95;
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

/// Means of 2 x 2; sides of one stay.
Pixels halved(const Pixels& fine) {
  Pixels out{std::max(fine.width_px / 2, 1u), std::max(fine.height_px / 2, 1u), fine.channels, {}};
  out.data.reserve(std::size_t{out.width_px} * out.height_px * out.channels);
  const auto at = [&](std::uint32_t x, std::uint32_t y, std::uint32_t k) -> int {
    x = std::min(x, fine.width_px - 1), y = std::min(y, fine.height_px - 1);
    return fine.data[(std::size_t{y} * fine.width_px + x) * fine.channels + k];
  };
  for (std::uint32_t y = 0; y < out.height_px; ++y)
    for (std::uint32_t x = 0; x < out.width_px; ++x)
      for (std::uint32_t k = 0; k < out.channels; ++k) {
        const int sum = at(2 * x, 2 * y, k) + at(2 * x + 1, 2 * y, k) + at(2 * x, 2 * y + 1, k) +
                        at(2 * x + 1, 2 * y + 1, k);
        out.data.push_back(static_cast<std::uint8_t>((sum + 2) / 4));
      }
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
  out.base_colour = code_picture(maps.base_colour, quality);
  const char* oq=getenv("OQ"),*nq=getenv("NQ");
  if (maps.choice.orm) out.orm = code_picture(maps.orm, quality + (oq?atoi(oq):-kOrmQualityBelow));
  if (maps.choice.normal) out.normal = code_picture(maps.normal, quality + (nq?atoi(nq):kNormalQualityAbove));
  if (!maps.emission.data.empty()) out.emission = code_picture(maps.emission, quality);
  return out;
}

}  // namespace

MapPixels map_pixels(const BakedMaps& maps, const MapChoice& choice) {
  MapPixels out;
  out.choice = choice;
  const std::uint32_t w = maps.width_px, h = maps.height_px;
  std::vector<Vec3f> base = maps.base_colour;
  if (!choice.orm)
    for (std::size_t i = 0; i < base.size(); ++i)
      base[i] = base[i] * (1 - kOcclusionInColour * (1 - maps.occlusion_roughness_metallic[i].x));
  out.base_colour = srgb_pixels(base, w, h);
  if (maps.has_alpha) out.base_colour = with_alpha(out.base_colour, maps.alpha);
  out.roughness = maps.mean_orm.y, out.metallic = maps.mean_orm.z;
  if (choice.orm) {
    out.orm = plain_pixels(maps.occlusion_roughness_metallic, w, h, false);
    for(int i=0;i<(getenv("OD")?atoi(getenv("OD")):1);++i) out.orm = halved(out.orm);
  }
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
  ProxyPictures best = code_at(maps, kLeastQuality);
  for (int low = kLeastQuality + 1, high = kMostQuality; low <= high;) {
    const int quality = (low + high) / 2;
    ProxyPictures coded = code_at(maps, quality);
    if (coded.bytes() <= max_bytes) {
      best = std::move(coded);
      low = quality + 1;
    } else {
      high = quality - 1;
    }
  }
  return best;
}

}  // namespace texmesh::proxies
