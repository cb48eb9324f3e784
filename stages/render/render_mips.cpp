#include <algorithm>
#include <array>
#include <stdexcept>

#include "format/base/srgb.h"
#include "stages/base/parallel.h"
#include "stages/render/render_texture.h"
#include "stages/render/srgb_encoder.h"

namespace texmesh {
namespace {

/// What a texel of the coarser level reads along one axis.
struct Pair {
  std::uint32_t first, second;
  float part;
};
std::vector<Pair> pairs(std::uint32_t fine, std::uint32_t coarse) {
  std::vector<Pair> out(coarse);
  for (std::uint32_t i = 0; i < coarse; ++i) {
    // (i + 0.5) fine / coarse - 0.5, as a fraction of 2 coarse
    const std::uint64_t at = (2ull * i + 1) * fine - coarse;
    const auto first = static_cast<std::uint32_t>(at / (2ull * coarse));
    out[i] = {first, std::min(first + 1, fine - 1),
              static_cast<float>(at % (2ull * coarse)) / static_cast<float>(2ull * coarse)};
  }
  return out;
}

/// The mean of 2 x 2 numbers, as next_level() rounds it: exact in floats, too.
void halve_numbers(const std::uint8_t* upper, const std::uint8_t* lower, std::size_t channels,
                   std::size_t texels, std::uint8_t* to) {
  for (std::size_t x = 0; x < texels; ++x, upper += 2 * channels, lower += 2 * channels)
    for (std::size_t k = 0; k < channels; ++k)
      *to++ = static_cast<std::uint8_t>(
          (upper[k] + upper[channels + k] + lower[k] + lower[channels + k] + 2) >> 2);
}

Pixels next_level(const Pixels& fine, bool srgb, const RunContext& context) {
  Pixels out{std::max(fine.width_px / 2, 1u), std::max(fine.height_px / 2, 1u), fine.channels, {}};
  out.data.resize(static_cast<std::size_t>(out.width_px) * out.height_px * out.channels);
  const std::vector<Pair> across = pairs(fine.width_px, out.width_px),
                          down = pairs(fine.height_px, out.height_px);
  const std::size_t n = fine.channels;
  const std::size_t colours = !srgb ? 0 : n % 2 == 0 ? n - 1 : n;  // alpha stays a plain number
  const bool even = fine.width_px == 2 * out.width_px && fine.height_px == 2 * out.height_px;
  const render::SrgbEncoder& encode = render::srgb_encoder();
  const auto& light = light_of_bytes();
  parallel_for(context, out.height_px, 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y) {
      const Pair& d = down[y];
      std::uint8_t* to = out.data.data() + y * out.width_px * n;
      if (colours == 0 && even) {
        halve_numbers(fine.at(0, d.first), fine.at(0, d.second), n, out.width_px, to);
        continue;
      }
      for (const Pair& a : across) {
        const std::uint8_t *p = fine.at(a.first, d.first), *q = fine.at(a.second, d.first),
                           *r = fine.at(a.first, d.second), *s = fine.at(a.second, d.second);
        auto mean = [&](float pv, float qv, float rv, float sv) {
          const float top = pv + (qv - pv) * a.part, bottom = rv + (sv - rv) * a.part;
          return top + (bottom - top) * d.part;
        };
        for (std::size_t k = 0; k < n; ++k)
          *to++ = k < colours ? encode(mean(light[p[k]], light[q[k]], light[r[k]], light[s[k]]))
                              : static_cast<std::uint8_t>(mean(p[k], q[k], r[k], s[k]) + 0.5f);
      }
    }
  });
  return out;
}

}  // namespace

Pixels coarser_level(Pixels image, bool srgb, std::uint32_t levels, const RunContext& context) {
  for (; levels > 0 && (image.width_px > 1 || image.height_px > 1); --levels)
    image = next_level(image, srgb, context);
  return image;
}

void complete_mips(RenderTexture& texture, const RunContext& context) {
  while (texture.levels.back().width_px > 1 || texture.levels.back().height_px > 1)
    texture.levels.push_back(next_level(texture.levels.back(), texture.srgb, context));
}

RenderTexture render_texture(Pixels image, bool srgb, std::uint32_t first_level, const RunContext& context) {
  if (image.width_px == 0 || image.height_px == 0 || image.channels < 1 || image.channels > 4 ||
      image.data.size() != static_cast<std::size_t>(image.width_px) * image.height_px * image.channels)
    throw std::invalid_argument("render_texture: no image of 1 to 4 channels");
  RenderTexture out;
  out.width_px = image.width_px;
  out.height_px = image.height_px;
  out.srgb = srgb;
  out.levels.push_back(std::move(image));
  while (out.first_level < first_level && (out.levels[0].width_px > 1 || out.levels[0].height_px > 1)) {
    out.levels[0] = next_level(out.levels[0], srgb, context);
    ++out.first_level;
  }
  complete_mips(out, context);
  return out;
}

}  // namespace texmesh
