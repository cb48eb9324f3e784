#include "stages/measure/scale_samples.h"

#include <algorithm>
#include <utility>

#include "stages/jpeg/jpeg.h"

namespace texmesh {
namespace {

BilinearPlace place_of(std::uint32_t at, std::uint32_t size, std::uint32_t coarse_size) {
  // Centres of texels, in 1/256 of a coarse texel.
  const std::int64_t centre = (2 * std::int64_t{at} + 1) * coarse_size * 128 / size - 128;
  const auto clamped =
      static_cast<std::uint32_t>(std::clamp<std::int64_t>(centre, 0, (std::int64_t{coarse_size} - 1) * 256));
  return {clamped / 256, std::min(clamped / 256 + 1, coarse_size - 1), clamped % 256};
}

}  // namespace

std::vector<BilinearPlace> bilinear_places(std::uint32_t first, std::uint32_t count, std::uint32_t size,
                                           std::uint32_t coarse_size) {
  std::vector<BilinearPlace> out;
  for (std::uint32_t k = 0; k < count; ++k)
    out.push_back(place_of(std::min(first + k, size - 1), size, coarse_size));
  return out;
}

Samples scaled_up(const SamplePatch& patch, const std::vector<BilinearPlace>& across,
                  const std::vector<BilinearPlace>& down) {
  const std::uint32_t left = patch.rectangle.left_px, top = patch.rectangle.top_px;
  const std::size_t width = patch.rectangle.width_px, count = across.size();
  Samples out;
  for (const std::vector<std::uint8_t>& samples : patch.samples) {
    const auto stretch = [&](std::uint32_t row, std::vector<std::uint32_t>& to) {
      const std::uint8_t* from = samples.data() + (row - top) * width;
      for (std::size_t k = 0; k < count; ++k) {
        const BilinearPlace& u = across[k];
        to[k] = from[u.first - left] * (256 - u.part) + from[u.second - left] * u.part;
      }
    };
    // Several rows of the result lie between the same two.
    std::vector<std::uint32_t> upper(count), lower(count);
    constexpr std::uint32_t kNone = 0xffffffff;
    std::uint32_t upper_row = kNone, lower_row = kNone;
    std::vector<std::uint8_t>& to = out.emplace_back(count * down.size());
    std::uint8_t* at = to.data();
    for (const BilinearPlace& v : down) {
      if (v.first == lower_row) std::swap(upper, lower), std::swap(upper_row, lower_row);
      if (v.first != upper_row) stretch(upper_row = v.first, upper);
      if (v.second != lower_row) stretch(lower_row = v.second, lower);
      for (std::size_t k = 0; k < count; ++k)
        *at++ = static_cast<std::uint8_t>((upper[k] * (256 - v.part) + lower[k] * v.part + 32768) >> 16);
    }
  }
  return out;
}

SamplePatch preview_samples(const TexturePlane& plane, const std::vector<std::uint8_t>& file) {
  constexpr std::uint64_t kMostPixels = 1u << 26;
  const std::size_t measured = measured_channels(plane);
  const Pixels pixels = measured > 1 ? decode_jpeg(file, kMostPixels) : decode_jpeg_luma(file, kMostPixels);
  return {{0, 0, pixels.width_px, pixels.height_px}, split_samples(pixels, measured)};
}

Samples show_preview(const TexturePlane& plane, const SamplePatch& preview, const TexelRectangle& rectangle) {
  return scaled_up(
      preview,
      bilinear_places(rectangle.left_px, rectangle.width_px, plane.width_px, preview.rectangle.width_px),
      bilinear_places(rectangle.top_px, rectangle.height_px, plane.height_px, preview.rectangle.height_px));
}

}  // namespace texmesh
