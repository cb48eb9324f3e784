#pragma once
#include <gtest/gtest.h>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "stages/base/run_context.h"
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/image/decode_image.h"
#include "stages/image/decode_jpeg.h"
#include "stages/jpeg/source_jpeg.h"
#include "stages/ladder/encode_rungs.h"
#include "stages/ladder/ladder.h"
#include "tests/support/images.h"

namespace texmesh::testing {

inline constexpr std::uint32_t kSide = 32;  // of fragments

struct Kind {
  const char* name;
  int channels = 3, across = 1, down = 1;  // luma's sampling factors
  bool progressive = false, rgb = false;
  int quality = 90;
  bool arithmetic = false;
  int restart_mcus = 0;
};

inline Bytes make_jpeg(const Kind& kind, int width, int height, Bytes picture = {}) {
  if (picture.empty()) picture = testing::test_picture(width, height, kind.channels);
  jpeg_compress_struct info{};
  jpeg_error_mgr errors{};
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* memory = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&info, &memory, &size);
  info.image_width = static_cast<JDIMENSION>(width), info.image_height = static_cast<JDIMENSION>(height);
  info.input_components = kind.channels;
  info.in_color_space = kind.channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
  jpeg_set_defaults(&info);
  if (kind.rgb) jpeg_set_colorspace(&info, JCS_RGB);
  jpeg_set_quality(&info, kind.quality, FALSE);
  info.comp_info[0].h_samp_factor = kind.across;
  info.comp_info[0].v_samp_factor = kind.down;
  info.arith_code = kind.arithmetic;
  info.restart_interval = static_cast<unsigned>(kind.restart_mcus);
  if (kind.progressive) jpeg_simple_progression(&info);
  jpeg_start_compress(&info, TRUE);
  for (int y = 0; y < height; ++y) {
    JSAMPROW row = picture.data() + static_cast<std::size_t>(y) * width * kind.channels;
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  jpeg_destroy_compress(&info);
  Bytes out(memory, memory + size);
  std::free(memory);
  return out;
}

inline Image image_of(Bytes bytes) { return probe_image("a picture", std::move(bytes), {}); }

/// A plane of fragments over the image, all covered but the second, and its pixels.
struct Scene {
  Image image;
  Fragments fragments;
  std::vector<Pixels> pixels;
  TexturePlane& plane() { return fragments.planes[0]; }
};

inline Pixels padded(const Pixels& from, std::uint32_t width, std::uint32_t height) {
  Pixels out{width, height, from.channels, {}};
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; ++x) {
      const std::uint8_t* p = from.at(std::min(x, from.width_px - 1), std::min(y, from.height_px - 1));
      out.data.insert(out.data.end(), p, p + from.channels);
    }
  return out;
}

inline Scene scene_of(Image image, std::uint32_t side = kSide) {
  TexturePlane plane;
  plane.width_px = image.width_px;
  plane.height_px = image.height_px;
  plane.channels = image.channels >= 3 ? 3 : 1;
  plane.fragment_width_px = plane.fragment_height_px = side;
  plane.columns = (image.width_px + side - 1) / side;
  plane.rows = (image.height_px + side - 1) / side;
  plane.covered_texels.assign(plane.fragment_count(), side * side);
  plane.surface_fraction.assign(plane.fragment_count(), 1.0f / static_cast<float>(plane.fragment_count()));
  if (plane.fragment_count() > 1) plane.covered_texels[1] = 0;
  Scene out;
  Pixels pixels = decode_image(image);
  if (pixels.channels != plane.channels) {  // alpha away
    Pixels colours{pixels.width_px, pixels.height_px, plane.channels, {}};
    for (std::size_t t = 0; t < pixels.data.size(); t += pixels.channels)
      colours.data.insert(colours.data.end(), &pixels.data[t], &pixels.data[t] + plane.channels);
    pixels = std::move(colours);
  }
  out.pixels.push_back(padded(pixels, plane.columns * side, plane.rows * side));
  out.fragments.planes.push_back(std::move(plane));
  out.image = std::move(image);
  return out;
}

/// Every texel is covered but those for which hole(x, y).
template <class Hole>
inline void cover(TexturePlane& plane, const Hole& hole) {
  const std::size_t stride = (plane.width_px + 7) / 8;
  plane.coverage.assign(stride * plane.height_px, 0);
  plane.covered_texels.assign(plane.fragment_count(), 0);
  for (std::uint32_t y = 0; y < plane.height_px; ++y)
    for (std::uint32_t x = 0; x < plane.width_px; ++x) {
      if (hole(x, y)) continue;
      plane.coverage[y * stride + x / 8] |= static_cast<std::uint8_t>(128 >> x % 8);
      ++plane.covered_texels[y / plane.fragment_height_px * plane.columns + x / plane.fragment_width_px];
    }
}

inline LadderOptions asked(std::vector<int> rungs) {
  LadderOptions options;
  options.prune = false;
  options.rungs = options.normal_rungs = options.data_rungs = options.alpha_rungs = std::move(rungs);
  return options;
}

inline Ladder encode(const Scene& scene, const LadderOptions& options, int threads = 1) {
  RunContext context;
  context.threads = threads;
  return encode_ladder(scene.fragments, scene.pixels, {}, {scene.image}, options, context);
}

/// Blocks of the fragment that differ from the source's.
inline std::size_t foreign_blocks(const JpegCoefficients& source, const Bytes& file,
                                  const TexturePlane& plane, std::size_t fragment) {
  const JpegCoefficients cut("fragment", file);
  std::size_t foreign = 0;
  EXPECT_EQ(cut.width_px(), kSide);
  EXPECT_EQ(cut.components().size(), source.components().size());
  for (std::size_t c = 0; c < cut.components().size(); ++c) {
    const auto& from = source.components()[c];
    const auto& to = cut.components()[c];
    foreign += from.quantisers != to.quantisers;
    const auto left = static_cast<std::uint32_t>(fragment % plane.columns) * to.blocks_across;
    const auto top = static_cast<std::uint32_t>(fragment / plane.columns) * to.blocks_down;
    for (std::uint32_t y = 0; y < to.blocks_down; ++y)
      for (std::uint32_t x = 0; x < to.blocks_across; ++x) {
        const std::int16_t* block = cut.block(c, y, x);
        if (top + y < from.blocks_down && left + x < from.blocks_across)
          foreign += !std::equal(block, block + 64, source.block(c, top + y, left + x));
        else  // beyond the image
          foreign += std::count(block + 1, block + 64, 0) != 63;
      }
  }
  return foreign;
}

/// Texels of the image that differ from the whole image's, away from the ring and on it.
inline std::pair<std::size_t, std::size_t> other_texels(const Pixels& whole, const Pixels& part,
                                                        const TexturePlane& plane, std::size_t fragment) {
  const auto left = static_cast<std::uint32_t>(fragment % plane.columns) * kSide;
  const auto top = static_cast<std::uint32_t>(fragment / plane.columns) * kSide;
  std::size_t inner = 0, ring = 0;
  for (std::uint32_t y = 0; y < kSide && top + y < whole.height_px; ++y)
    for (std::uint32_t x = 0; x < kSide && left + x < whole.width_px; ++x) {
      const std::uint8_t* a = whole.at(left + x, top + y);
      if (std::equal(a, a + whole.channels, part.at(x, y))) continue;
      const bool edge = x == 0 || y == 0 || x + 1 == kSide || y + 1 == kSide ||
                        left + x + 1 == whole.width_px || top + y + 1 == whole.height_px;
      ++(edge ? ring : inner);
    }
  return {inner, ring};
}

inline constexpr Kind kKinds[] = {{"4:4:4"},
                                  {"4:2:0", 3, 2, 2},
                                  {"4:2:2", 3, 2, 1},
                                  {"4:4:0", 3, 1, 2},
                                  {"4:1:1", 3, 4, 1},
                                  {"four rows of luma", 3, 1, 4},
                                  {"grey", 1},
                                  {"grey with factors", 1, 2, 2},
                                  {"progressive 4:2:0", 3, 2, 2, true},
                                  {"progressive grey", 1, 1, 1, true},
                                  {"RGB", 3, 1, 1, false, true},
                                  {"finest 4:2:0", 3, 2, 2, false, false, 100},
                                  {"coarse 4:2:0", 3, 2, 2, false, false, 25},
                                  {"arithmetic", 3, 2, 2, false, false, 90, true},
                                  {"progressive arithmetic", 3, 2, 2, true, false, 90, true},
                                  {"restarts", 3, 2, 2, false, false, 90, false, 3}};

}  // namespace texmesh::testing
