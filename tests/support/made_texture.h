#pragma once
// A made texture with the spectrum of a photograph, and planes that are wholly covered by it.
#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "lab/study/fragment_study.h"
#include "stages/base/run_context.h"
#include "stages/data/fragments.h"
#include "stages/data/pixels.h"

namespace texmesh::testing {

inline std::uint32_t texture_hash(std::uint32_t x, std::uint32_t y, std::uint32_t c) {
  std::uint32_t h = x * 0x9e3779b1u ^ y * 0x85ebca77u ^ c * 0xc2b2ae3du;
  h = (h ^ h >> 15) * 0x2c1b3c6du;
  return (h ^ h >> 12) * 0x297a2d39u >> 16;
}

/// Bilinear noise of one octave, 0..65535.
inline std::uint32_t octave(std::uint32_t x, std::uint32_t y, std::uint32_t c, std::uint32_t step) {
  const std::uint32_t u = x / step, v = y / step, a = x % step, b = y % step;
  const std::uint64_t top =
      std::uint64_t{texture_hash(u, v, c)} * (step - a) + std::uint64_t{texture_hash(u + 1, v, c)} * a;
  const std::uint64_t low = std::uint64_t{texture_hash(u, v + 1, c)} * (step - a) +
                            std::uint64_t{texture_hash(u + 1, v + 1, c)} * a;
  return static_cast<std::uint32_t>((top * (step - b) + low * b) / (std::uint64_t{step} * step));
}

/// A spectrum like a photograph's down to 128 px, and nothing coarser: neighbouring rows of a fragment are as
/// different as any two, so every row begins with a large DC step, and fragments have more rows than the
/// whole image. It costs up to 3 % against one optimised file where scans cost less than 2.
inline Pixels made_texture(std::uint32_t size) {
  Pixels out{size, size, 3, {}};
  out.data.resize(std::size_t{size} * size * 3);
  std::uint8_t* to = out.data.data();
  for (std::uint32_t y = 0; y < size; ++y)
    for (std::uint32_t x = 0; x < size; ++x) {
      std::uint32_t grey = 0;
      for (std::uint32_t step = 128, weight = 64; step >= 1; step /= 2, weight = weight * 5 / 9)
        grey += octave(x, y, step, step) * weight >> 16;
      for (std::uint32_t c = 0; c < 3; ++c)
        *to++ = static_cast<std::uint8_t>(std::min(255u, 10 + grey + (octave(x, y, 200 + c, 64) * 60 >> 16)));
    }
  return out;
}

struct Scene {
  Fragments fragments;
  std::vector<Pixels> pixels;
};

/// Every fragment covered; the image is cut to whole fragments.
inline Scene make_scene(Pixels image, std::uint32_t side) {
  Scene scene;
  TexturePlane p =
      covered_plane(std::max(1u, image.width_px / side), std::max(1u, image.height_px / side), side, side);
  p.channels = image.channels;
  p.features.assign(p.fragment_count(), 1);
  if (p.width_px != image.width_px || p.height_px != image.height_px) {
    Pixels cut{p.width_px, p.height_px, image.channels, {}};
    for (std::uint32_t y = 0; y < cut.height_px; ++y)
      cut.data.insert(cut.data.end(), image.at(0, y),
                      image.at(0, y) + std::size_t{cut.width_px} * cut.channels);
    image = std::move(cut);
  }
  scene.fragments.planes = {p};
  scene.pixels.push_back(std::move(image));
  return scene;
}

inline RunContext threads(int count) {
  RunContext context;
  context.threads = count;
  return context;
}

}  // namespace texmesh::testing
