#include "stages/ladder/ladder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include <jpeglib.h>

#include "format/base/errors.h"
#include "stages/base/run_context.h"
#include "stages/fragment_codec/decode_rung.h"
#include "stages/jpeg/jpeg.h"
#include "stages/jpeg/jpeg_coder.h"
#include "tests/support/meshes.h"

namespace texmesh {
namespace {

using testing::Random;

enum class Content { kPhoto, kNoise, kFlat };

/// Something a photograph has: smooth shades, edges and grain.
std::uint8_t photo_texel(std::uint32_t x, std::uint32_t y, std::uint32_t c, Random& random) {
  const int shade = 90 + static_cast<int>((x * 3 + y * 2 + c * 40) % 97);
  const int edge = ((x / 23 + y / 17) % 3 == 0) ? 50 : 0;
  return static_cast<std::uint8_t>(std::min(255, shade + edge + static_cast<int>(random.next() % 12)));
}

struct Plane {
  Fragments fragments;
  std::vector<Pixels> pixels;
};

Plane make_plane(std::uint32_t columns, std::uint32_t rows, std::uint32_t side, std::uint32_t channels,
                 Content content = Content::kPhoto, TextureRole role = TextureRole::kBaseColour) {
  Plane out;
  TexturePlane plane;
  plane.role = role;
  plane.channels = channels;
  plane.columns = columns;
  plane.rows = rows;
  plane.fragment_width_px = plane.fragment_height_px = side;
  plane.width_px = columns * side;
  plane.height_px = rows * side;
  plane.covered_texels.assign(plane.fragment_count(), side * side);
  Pixels pixels{plane.width_px, plane.height_px, channels, {}};
  Random random{7};
  for (std::uint32_t y = 0; y < plane.height_px; ++y)
    for (std::uint32_t x = 0; x < plane.width_px; ++x)
      for (std::uint32_t c = 0; c < channels; ++c)
        pixels.data.push_back(content == Content::kFlat    ? std::uint8_t{100}
                              : content == Content::kNoise ? static_cast<std::uint8_t>(random.next())
                                                           : photo_texel(x, y, c, random));
  out.fragments.planes.push_back(plane);
  out.pixels.push_back(std::move(pixels));
  return out;
}

Ladder encode(const Plane& p, LadderOptions options = {}, int threads = 1) {
  RunContext context;
  context.threads = threads;
  return encode_ladder(p.fragments, p.pixels, {}, {}, options, context);
}

Pixels decode_baseline(const LadderRung& rung, std::size_t fragment) {
  return decode_jpeg(join_fragment(Codec::kJpeg, rung.table_stream, fragment_stream(rung, fragment)),
                     1 << 24);
}

/// The pixels of one fragment as an image of its own.
Pixels crop(const Pixels& from, const TexturePlane& plane, std::size_t fragment) {
  Pixels out{plane.fragment_width_px, plane.fragment_height_px, from.channels, {}};
  const auto left = static_cast<std::uint32_t>(fragment % plane.columns) * out.width_px;
  const auto top = static_cast<std::uint32_t>(fragment / plane.columns) * out.height_px;
  for (std::uint32_t y = 0; y < out.height_px; ++y)
    out.data.insert(out.data.end(), from.at(left, top + y),
                    from.at(left, top + y) + out.width_px * from.channels);
  return out;
}

TEST(Ladder, EveryFragmentDecodesToWhatADirectEncodeGives) {
  for (const std::uint32_t channels : {1u, 3u})
    for (const Subsampling subsampling : {Subsampling::k420, Subsampling::k444}) {
      const Plane p = make_plane(3, 2, 64, channels);
      LadderOptions options;
      options.subsampling = subsampling;
      const Ladder ladder = encode(p, options);
      ASSERT_EQ(ladder.planes[0].rungs.size(), options.rungs.size());
      for (const LadderRung& rung : ladder.planes[0].rungs) {
        ASSERT_EQ(rung.offset.size(), 7u);
        ASSERT_EQ(rung.offset.back(), rung.data.size());
        for (std::size_t f = 0; f < 6; ++f) {
          const Pixels direct = decode_jpeg(
              encode_jpeg(crop(p.pixels[0], p.fragments.planes[0], f), rung.quality, subsampling), 1 << 24);
          const Pixels ours = decode_baseline(rung, f);
          EXPECT_EQ(ours.channels, channels);
          EXPECT_TRUE(ours.data == direct.data) << "rung " << rung.quality << " fragment " << f;
        }
      }
    }
}

TEST(Ladder, FragmentsMeetAsInTheWholeImage) {
  for (const Subsampling subsampling : {Subsampling::k420, Subsampling::k444}) {
    const Plane p = make_plane(2, 2, 64, 3);
    LadderOptions options;
    options.subsampling = subsampling;
    options.rungs = {40, 95};
    const Ladder ladder = encode(p, options);
    for (const LadderRung& rung : ladder.planes[0].rungs) {
      const Pixels whole = decode_jpeg(encode_jpeg(p.pixels[0], rung.quality, subsampling), 1 << 24);
      std::size_t inner = 0, ring = 0;
      for (std::size_t f = 0; f < 4; ++f) {
        const Pixels expected = crop(whole, p.fragments.planes[0], f), got = decode_baseline(rung, f);
        for (std::uint32_t y = 0; y < 64; ++y)
          for (std::uint32_t x = 0; x < 64; ++x) {
            if (std::equal(got.at(x, y), got.at(x, y) + 3, expected.at(x, y))) continue;
            ++(x == 0 || y == 0 || x == 63 || y == 63 ? ring : inner);
          }
      }
      EXPECT_EQ(inner, 0u);
      EXPECT_TRUE(ring == 0 || subsampling == Subsampling::k420) << ring;
    }
  }
}

/// Each channel as a grey image of its own.
Pixels channels_apart(const Pixels& pixels, int quality) {
  Pixels out = pixels;
  for (std::size_t c = 0; c < 3; ++c) {
    Pixels channel{pixels.width_px, pixels.height_px, 1, {}};
    for (std::size_t k = c; k < pixels.data.size(); k += 3) channel.data.push_back(pixels.data[k]);
    const Pixels decoded = decode_jpeg(encode_jpeg(channel, quality, Subsampling::k444), 1 << 24);
    for (std::size_t k = 0; k < decoded.data.size(); ++k) out.data[3 * k + c] = decoded.data[k];
  }
  return out;
}

TEST(Ladder, ChannelsOfDataPlanesAreKeptApart) {
  for (const TextureRole role : {TextureRole::kNormal, TextureRole::kOcclusionRoughnessMetallic}) {
    const Plane data = make_plane(1, 1, 64, 3, Content::kPhoto, role);
    const Ladder ladder = encode(data);
    for (const LadderRung& rung : ladder.planes[0].rungs)
      EXPECT_TRUE(decode_baseline(rung, 0).data == channels_apart(data.pixels[0], rung.quality).data);
    EXPECT_TRUE(decode_fragment_luma(ladder.planes[0], 0, 0, 4096).data ==
                luma_of(decode_fragment(ladder.planes[0], 0, 0, 4096)).data);
  }
}

TEST(Ladder, EveryRoleHasItsOwnRungs) {
  LadderOptions options;
  options.rungs = {10, 20};
  options.normal_rungs = {30, 40, 50};
  options.data_rungs = {60};
  options.alpha_rungs = {70, 80, 90, 100};
  const auto rungs = [&](TextureRole role, std::uint32_t channels) {
    std::vector<int> out;
    const Ladder ladder = encode(make_plane(1, 1, 16, channels, Content::kPhoto, role), options);
    for (const LadderRung& rung : ladder.planes[0].rungs) out.push_back(rung.quality);
    return out;
  };
  for (const TextureRole role : {TextureRole::kBaseColour, TextureRole::kEmissive, TextureRole::kColour})
    EXPECT_EQ(rungs(role, 3), options.rungs);
  EXPECT_EQ(rungs(TextureRole::kNormal, 3), options.normal_rungs);
  EXPECT_EQ(rungs(TextureRole::kOcclusionRoughnessMetallic, 3), options.data_rungs);
  EXPECT_EQ(rungs(TextureRole::kData, 1), options.data_rungs);
  EXPECT_EQ(rungs(TextureRole::kAlpha, 1), options.alpha_rungs);
}

TEST(Ladder, StreamsHoldTheirDataAloneAndRise) {
  const Plane p = make_plane(2, 2, 64, 3);
  const Ladder ladder = encode(p);
  std::size_t last = 0;
  for (const LadderRung& rung : ladder.planes[0].rungs) {
    EXPECT_GT(rung.data.size(), last);
    last = rung.data.size();
    EXPECT_EQ(rung.table_stream[2], 0xff);
    EXPECT_EQ(rung.table_stream[3], 0xdb);  // DQT right after SOI
    EXPECT_EQ(rung.table_stream[rung.table_stream.size() - 16], 0xff);
    EXPECT_EQ(rung.table_stream[rung.table_stream.size() - 15], 0xda);  // SOS right before EOI: data follow
    for (std::size_t f = 0; f < 4; ++f) {
      const auto stream = fragment_stream(rung, f);
      EXPECT_EQ(stream[1], 0xd8);
      EXPECT_EQ(stream[stream.size() - 1], 0xd9);
      for (std::size_t k = 2; k + 2 < stream.size(); ++k)
        if (stream[k] == 0xff) EXPECT_EQ(stream[k + 1], 0) << "entropy-coded data between SOI and EOI only";
    }
  }
}

TEST(Ladder, TrainedTablesBeatTypicalOnes) {
  const Plane p = make_plane(4, 4, 64, 3);
  const Ladder ladder = encode(p);
  for (const LadderRung& rung : ladder.planes[0].rungs) {
    JpegCoder typical({3, rung.quality, Subsampling::k420});
    std::vector<std::uint8_t> bytes;
    for (std::size_t f = 0; f < 16; ++f)
      typical.append_body(
          {p.pixels[0].at(static_cast<std::uint32_t>(f % 4) * 64, static_cast<std::uint32_t>(f / 4) * 64),
           256 * 3, 64, 64},
          bytes);
    EXPECT_LT(rung.data.size(), bytes.size());
  }
}

TEST(Ladder, AFragmentUnlikeTheTrainingOnesStillHasCodes) {
  // 40 flat fragments and one of noise, which the training does not see. libjpeg-turbo does not report a
  // symbol without a code: its SIMD coder writes a damaged stream.
  Plane p = make_plane(41, 1, 32, 3, Content::kFlat);
  Random random{3};
  for (std::uint32_t y = 0; y < 32; ++y)
    for (std::uint32_t x = 0; x < 32 * 3; ++x)
      p.pixels[0].data[y * 41 * 32 * 3 + x] = static_cast<std::uint8_t>(random.next() % 2 * 255);
  LadderOptions options;
  options.rungs = {5, 50, 97, 100};
  options.training_fragments = 3;
  const Ladder ladder = encode(p, options);
  for (const LadderRung& rung : ladder.planes[0].rungs) {
    const Pixels direct = decode_jpeg(
        encode_jpeg(crop(p.pixels[0], p.fragments.planes[0], 0), rung.quality, Subsampling::k420), 1 << 24);
    EXPECT_TRUE(decode_baseline(rung, 0).data == direct.data) << rung.quality;
  }
}

TEST(Ladder, UncoveredFragmentsAreNotStored) {
  Plane p = make_plane(3, 1, 32, 3);
  p.fragments.planes[0].covered_texels = {0, 5, 0};
  const Ladder ladder = encode(p);
  for (const LadderRung& rung : ladder.planes[0].rungs) {
    EXPECT_TRUE(fragment_stream(rung, 0).empty());
    EXPECT_FALSE(fragment_stream(rung, 1).empty());
    EXPECT_TRUE(fragment_stream(rung, 2).empty());
  }
  p.fragments.planes[0].covered_texels = {0, 0, 0};
  const Ladder none = encode(p);
  EXPECT_TRUE(none.planes[0].rungs[0].data.empty());
  EXPECT_FALSE(none.planes[0].rungs[0].table_stream.empty());
}

TEST(Ladder, TablesAreTrainedOnCoveredFragmentsOnly) {
  Plane p = make_plane(4, 2, 32, 3);
  p.fragments.planes[0].covered_texels = {1024, 1024, 0, 0, 1024, 1024, 0, 0};
  const auto tables = [&] {
    std::vector<std::vector<std::uint8_t>> out;
    const Ladder ladder = encode(p);
    for (const LadderRung& rung : ladder.planes[0].rungs) out.push_back(rung.table_stream);
    return out;
  };
  const auto before = tables();
  Random random{5};
  for (std::uint32_t y = 0; y < 64; ++y)
    for (std::uint32_t x = 64 * 3; x < 128 * 3; ++x)
      p.pixels[0].data[y * 128 * 3 + x] = static_cast<std::uint8_t>(random.next());
  EXPECT_EQ(tables(), before);
  p.fragments.planes[0].covered_texels[2] = 1024;
  EXPECT_NE(tables(), before) << "the noise would show";
}

TEST(Ladder, SameBytesForAnyNumberOfThreads) {
  const Plane p = make_plane(5, 4, 48, 3);
  const Ladder one = encode(p, {}, 1), eight = encode(p, {}, 8);
  for (std::size_t r = 0; r < one.planes[0].rungs.size(); ++r) {
    EXPECT_TRUE(one.planes[0].rungs[r].data == eight.planes[0].rungs[r].data);
    EXPECT_TRUE(one.planes[0].rungs[r].table_stream == eight.planes[0].rungs[r].table_stream);
    EXPECT_EQ(one.planes[0].rungs[r].offset, eight.planes[0].rungs[r].offset);
  }
}

TEST(Ladder, RefusesRungsThatDoNotRiseAndPixelsThatDoNotFit) {
  Plane p = make_plane(1, 1, 16, 3);
  LadderOptions options;
  for (const std::vector<int>& rungs :
       {std::vector<int>{}, {10, 10}, {20, 10}, {0}, {101}, std::vector<int>(17, 1)}) {
    options.rungs = rungs;
    EXPECT_THROW(encode(p, options), StageError);
  }
  p.pixels[0].data.pop_back();
  EXPECT_THROW(encode(p), StageError);
  p.pixels.clear();
  EXPECT_THROW(encode(p), StageError);
  EXPECT_TRUE(encode({}).planes.empty());
}

TEST(Ladder, EveryTruncationIsRefused) {
  const Plane p = make_plane(1, 1, 32, 3);
  LadderOptions options;
  options.rungs = {30};
  const Ladder ladder = encode(p, options);
  const LadderRung& rung = ladder.planes[0].rungs[0];
  const auto whole = fragment_stream(rung, 0);
  for (std::size_t n = 0; n < whole.size(); ++n)
    EXPECT_THROW(decode_jpeg(join_fragment(Codec::kJpeg, rung.table_stream, whole.first(n)), 1 << 20),
                 FormatError)
        << n;
  const std::span<const std::uint8_t> tables(rung.table_stream);
  for (std::size_t n = 0; n < tables.size(); ++n)
    EXPECT_THROW(decode_jpeg(join_fragment(Codec::kJpeg, tables.first(n), whole), 1 << 20), FormatError) << n;
  const auto complete = join_fragment(Codec::kJpeg, rung.table_stream, whole);
  for (std::size_t n = 0; n < complete.size(); ++n)
    EXPECT_THROW(decode_jpeg(std::span(complete).first(n), 1 << 20), FormatError) << n;
}

TEST(Jpeg, RefusesWhatIsNoImageOrTooLarge) {
  const Plane p = make_plane(1, 1, 32, 3);
  auto bytes = encode_jpeg(p.pixels[0], 50, Subsampling::k420);
  EXPECT_NO_THROW(decode_jpeg(bytes, 32 * 32));
  EXPECT_THROW(decode_jpeg(bytes, 32 * 32 - 1), FormatError);
  bytes.push_back(0);
  EXPECT_THROW(decode_jpeg(bytes, 1 << 20), FormatError);
  bytes.pop_back();
  // No flipped byte may crash, and what decodes has the size that was asked for.
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    auto damaged = bytes;
    damaged[n] ^= static_cast<std::uint8_t>(1 + n % 255);
    try {
      const Pixels got = decode_jpeg(damaged, 1 << 16);
      EXPECT_EQ(got.data.size(), std::size_t{got.width_px} * got.height_px * got.channels);
    } catch (const FormatError&) {
    }
  }
  EXPECT_THROW(encode_jpeg(Pixels{2, 2, 2, std::vector<std::uint8_t>(8)}, 50, Subsampling::k420), StageError);
  EXPECT_THROW(encode_jpeg(Pixels{0, 0, 3, {}}, 50, Subsampling::k420), StageError);
  EXPECT_THROW(encode_jpeg(Pixels{2, 2, 3, {}}, 50, Subsampling::k420), StageError);
}

enum class Coding { kBaseline, kProgressive, kManyScans, kArithmetic, kCmyk };

/// Files that our own encoder never writes.
std::vector<std::uint8_t> foreign_jpeg(const Pixels& pixels, Coding coding) {
  jpeg_compress_struct info;
  jpeg_error_mgr errors;
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* data = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&info, &data, &size);
  info.image_width = pixels.width_px;
  info.image_height = pixels.height_px;
  info.input_components = static_cast<int>(pixels.channels);
  info.in_color_space = coding == Coding::kCmyk ? JCS_CMYK : JCS_RGB;
  jpeg_set_defaults(&info);
  jpeg_set_quality(&info, 70, TRUE);
  std::vector<jpeg_scan_info> scans;
  if (coding == Coding::kProgressive) jpeg_simple_progression(&info);
  if (coding == Coding::kArithmetic) info.arith_code = TRUE;
  if (coding == Coding::kManyScans) {
    scans.push_back({3, {0, 1, 2}, 0, 0, 0, 0});
    for (int component = 0; component < 3; ++component)
      for (int k = 1; k < 64; ++k) scans.push_back({1, {component}, k, k, 0, 0});
    info.scan_info = scans.data();
    info.num_scans = static_cast<int>(scans.size());
  }
  jpeg_start_compress(&info, TRUE);
  while (info.next_scanline < info.image_height) {
    JSAMPROW row = const_cast<JSAMPROW>(pixels.at(0, info.next_scanline));
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  jpeg_destroy_compress(&info);
  const std::vector<std::uint8_t> out(data, data + size);
  std::free(data);
  return out;
}

TEST(Jpeg, ReadsBaselineAndProgressiveAndRefusesOtherKinds) {
  const Plane p = make_plane(1, 1, 64, 3);
  const Pixels baseline = decode_jpeg(foreign_jpeg(p.pixels[0], Coding::kBaseline), 1 << 16);
  EXPECT_TRUE(decode_jpeg(foreign_jpeg(p.pixels[0], Coding::kProgressive), 1 << 16).data == baseline.data);
  EXPECT_THROW(decode_jpeg(foreign_jpeg(p.pixels[0], Coding::kManyScans), 1 << 16), FormatError);
  EXPECT_THROW(decode_jpeg(foreign_jpeg(p.pixels[0], Coding::kArithmetic), 1 << 16), FormatError);
  const Pixels four{8, 8, 4, std::vector<std::uint8_t>(256, 9)};
  EXPECT_THROW(decode_jpeg(foreign_jpeg(four, Coding::kCmyk), 1 << 16), FormatError);
}

TEST(Jpeg, LumaIsTheGreyOfTheColours) {
  const Plane p = make_plane(1, 1, 64, 3);
  const auto bytes = encode_jpeg(p.pixels[0], 90, Subsampling::k420);
  const Pixels colour = decode_jpeg(bytes, 1 << 16), luma = decode_jpeg_luma(bytes, 1 << 16);
  ASSERT_EQ(luma.channels, 1u);
  for (std::size_t k = 0; k < luma.data.size(); ++k) {
    const double y =
        0.299 * colour.data[3 * k] + 0.587 * colour.data[3 * k + 1] + 0.114 * colour.data[3 * k + 2];
    EXPECT_NEAR(luma.data[k], y, 2.5);  // colours were rounded, and clipped where out of range
  }
}

TEST(HuffmanTable, EverySymbolHasACodeOfAtMost16Bits) {
  Random random{11};
  for (int round = 0; round < 200; ++round) {
    std::vector<std::uint8_t> symbols;
    std::vector<std::uint64_t> weights;
    const std::size_t count = 1 + random.next() % 200;
    for (std::size_t k = 0; k < count; ++k) {
      symbols.push_back(static_cast<std::uint8_t>(k));
      // Fibonacci-like weights make the deepest trees.
      weights.push_back(round % 2 || k < 2 ? 1 + random.next() % 1000 : weights[k - 1] + weights[k - 2]);
      if (weights[k] > (std::uint64_t{1} << 50)) weights[k] = 1;
    }
    const HuffmanTable table = make_huffman_table(symbols, weights);
    std::uint64_t used = 0, codes = 0;
    for (std::size_t l = 1; l <= 16; ++l) {
      used += std::uint64_t{table.bits[l]} << (16 - l);
      codes += table.bits[l];
    }
    EXPECT_EQ(codes, count);
    EXPECT_LT(used, 65536u) << "the code of ones only stays free";
    std::vector<std::uint8_t> sorted = table.symbols;
    std::sort(sorted.begin(), sorted.end());
    EXPECT_EQ(sorted, symbols);
  }
  const HuffmanTable table = make_huffman_table({1, 2, 3}, {1, 1000, 10});
  EXPECT_EQ(table.symbols, (std::vector<std::uint8_t>{2, 3, 1}));
  EXPECT_EQ(table.bits[1], 1);
}

}  // namespace
}  // namespace texmesh
