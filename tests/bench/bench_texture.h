#pragma once
// What programs that measure the texture stages have in common: a made texture, planes that are wholly
// covered, plain libjpeg to compare with, and clocks.
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <utility>
#include <vector>

#include <jpeglib.h>

#include "stages/base/run_context.h"
#include "stages/data/coverage.h"
#include "stages/data/fragments.h"
#include "stages/data/pixels.h"

namespace texmesh {

inline double cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}
inline double wall_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

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
  TexturePlane p;
  p.channels = image.channels;
  p.fragment_width_px = p.fragment_height_px = side;
  p.columns = std::max(1u, image.width_px / side);
  p.rows = std::max(1u, image.height_px / side);
  p.width_px = p.columns * side;
  p.height_px = p.rows * side;
  p.coverage.assign(coverage_size_bytes(p.width_px, p.height_px), 0xff);
  p.covered_texels.assign(p.fragment_count(), side * side);
  p.surface_fraction.assign(p.fragment_count(), 1.0f / static_cast<float>(p.fragment_count()));
  p.features.assign(p.fragment_count(), 1);
  p.eta.assign(p.fragment_count(), 0);
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

/// Plain libjpeg as any program calls it: one file.
inline std::vector<std::uint8_t> plain_file(const Pixels& pixels, int quality, bool optimised) {
  jpeg_compress_struct info;
  jpeg_error_mgr errors;
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* out = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&info, &out, &size);
  info.image_width = pixels.width_px;
  info.image_height = pixels.height_px;
  info.input_components = static_cast<int>(pixels.channels);
  info.in_color_space = pixels.channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_set_defaults(&info);
  jpeg_set_quality(&info, quality, TRUE);
  info.optimize_coding = optimised ? TRUE : FALSE;
  jpeg_start_compress(&info, TRUE);
  while (info.next_scanline < info.image_height) {
    JSAMPROW row = const_cast<JSAMPROW>(pixels.at(0, info.next_scanline));
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  jpeg_destroy_compress(&info);
  std::vector<std::uint8_t> file(out, out + size);
  std::free(out);
  return file;
}

inline std::size_t plain_encode(const Pixels& pixels, int quality, bool optimised) {
  return plain_file(pixels, quality, optimised).size();
}

}  // namespace texmesh
