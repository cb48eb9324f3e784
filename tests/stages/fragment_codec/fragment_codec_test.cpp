#include "stages/fragment_codec/fragment_codec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "stages/jpeg/jpeg_coder.h"
#include "stages/jpeg/jpeg_stream.h"
#include "stages/ladder/ladder.h"
#include "tests/support/all_rungs.h"
#include "tests/support/meshes.h"

namespace texmesh::fragment_codec_test {

using Streams = std::vector<Bytes>;

/// Shades, edges and grain.
Pixels picture(std::uint32_t width, std::uint32_t height, std::uint32_t channels) {
  testing::Random random{5};
  Pixels out{width, height, channels, {}};
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; ++x)
      for (std::uint32_t c = 0; c < channels; ++c)
        out.data.push_back(static_cast<std::uint8_t>(
            60 + (x * 3 + y * 2 + c * 40) % 97 + ((x / 11 + y / 7) % 3 == 0 ? 60 : 0) + random.next() % 12));
  return out;
}

PixelWindow window_of(const Pixels& pixels) {
  return {pixels.data.data(), std::size_t{pixels.width_px} * pixels.channels, pixels.width_px,
          pixels.height_px};
}

double squared_error(const Pixels& a, const Pixels& b) {
  double sum = 0;
  for (std::size_t k = 0; k < a.data.size(); ++k) sum += (a.data[k] - b.data[k]) * (a.data[k] - b.data[k]);
  return sum;
}

/// One fragment of one plane at every rung of a codec.
struct Coded {
  Codec codec;
  std::vector<CodecRung> rungs;
  Streams streams;

  std::vector<std::span<const std::uint8_t>> parts(std::size_t rung) const {
    const std::size_t first = codec_traits(codec).incremental ? 0 : rung;
    return {streams.begin() + static_cast<std::ptrdiff_t>(first),
            streams.begin() + static_cast<std::ptrdiff_t>(rung + 1)};
  }
  const Bytes& tables(std::size_t rung) const {
    return rungs[codec_traits(codec).incremental ? 0 : rung].table_stream;
  }
  Bytes file(std::size_t rung) const { return join_fragment(codec, tables(rung), parts(rung)); }
  /// The file of the highest rung with other bytes as that rung's own stream.
  Bytes file_with(const Bytes& stream) const {
    auto all = parts(rungs.size() - 1);
    all.back() = stream;
    return join_fragment(codec, tables(rungs.size() - 1), all);
  }
};

Coded code(Codec codec, const Pixels& pixels, bool apart = false) {
  PlaneCoding plane;
  plane.channels = pixels.channels;
  plane.fragment_width_px = pixels.width_px;
  plane.fragment_height_px = pixels.height_px;
  plane.apart = apart;
  plane.qualities = {20, 60, 90};
  const auto coder = make_texture_codec(codec, plane);
  const PixelWindow window = window_of(pixels);
  Coded out{codec, coder->train(std::span(&window, 1), {}), {}};
  out.streams.resize(out.rungs.size());
  coder->encoder()->encode(window, out.streams);
  return out;
}

constexpr std::array<Codec, 3> kCodecs{Codec::kJpeg, Codec::kJpegProgressive, Codec::kWebp};

TEST(TextureCodec, EveryRungIsACompleteFileAndBetterThanTheOneBelow) {
  const Pixels pixels = picture(64, 48, 3);
  for (const Codec codec : kCodecs) {
    const Coded coded = code(codec, pixels);
    double last = 1e30;
    for (std::size_t r = 0; r < coded.rungs.size(); ++r) {
      ASSERT_FALSE(coded.streams[r].empty());
      EXPECT_TRUE(is_table_stream(codec, static_cast<std::uint32_t>(r), coded.rungs[r].table_stream));
      const Pixels got = decode_fragment_file(codec, coded.file(r), 64 * 48);
      ASSERT_EQ(got.width_px, 64u);
      ASSERT_EQ(got.height_px, 48u);
      ASSERT_EQ(got.channels, 3u);
      const double error = squared_error(got, pixels);
      // A pass over chroma alone may leave the sum of all channels where it was.
      EXPECT_LT(error, last * (codec == Codec::kJpegProgressive ? 1.01 : 1)) << codec_traits(codec).id << r;
      last = error;
      const Pixels luma = decode_fragment_file_luma(codec, coded.file(r), 64 * 48);
      EXPECT_EQ(luma.data.size(), 64u * 48u);
      EXPECT_THROW(decode_fragment_file(codec, coded.file(r), 64 * 48 - 1), FormatError);
      if (r > 0) EXPECT_GT(coded.rungs[r].quality, coded.rungs[r - 1].quality);
    }
  }
}

TEST(TextureCodec, OnlyTheFinestBaselineRungHasItsChannelsApart) {
  const Pixels pixels = picture(64, 48, 3);
  const PixelWindow whole = window_of(pixels);
  std::vector<std::uint8_t> coverage(64 / 8 * 48, 255);
  coverage[0] = 0;
  PixelWindow part = whole;
  part.coverage = {CoverageMask(coverage, 64, 48), 0, 0};
  PlaneCoding plane;
  plane.fragment_width_px = 64, plane.fragment_height_px = 48;
  plane.qualities = {60, 97, kFinestQuality};
  const auto coder = make_texture_codec(Codec::kJpeg, plane);
  const std::array<PixelWindow, 2> sample{whole, part};
  const std::vector<CodecRung> rungs = coder->train(sample, {});
  const std::string apart = "Adobe";
  for (std::size_t r = 0; r < rungs.size(); ++r) {
    const auto& head = rungs[r].table_stream;
    EXPECT_EQ(std::search(head.begin(), head.end(), apart.begin(), apart.end()) != head.end(), r == 2) << r;
  }
  for (const PixelWindow& window : sample) {
    std::vector<Bytes> streams(3), last(1);
    coder->encoder()->encode(window, streams);
    const std::size_t finest = 2;
    coder->encoder(std::span(&finest, 1))->encode(window, last);
    EXPECT_EQ(last[0], streams[2]);
    const Bytes file = join_fragment(Codec::kJpeg, rungs[2].table_stream, streams[2]);
    const Pixels got = decode_fragment_file(Codec::kJpeg, file, 64 * 48);
    for (std::size_t k = 0; k < pixels.data.size(); ++k)
      if (window.coverage.mask.empty() || k / 3 >= 64 * 8 || k / 3 % 64 >= 8)
        EXPECT_NEAR(got.data[k], pixels.data[k], 3) << k;
  }
}

TEST(TextureCodec, TheFinestRungLeavesFewerSamplesOffThanLibjpeg) {
  Pixels noise{64, 64, 3, {}};
  testing::Random random{4};
  for (std::size_t k = 0; k < std::size_t{64} * 64 * 3; ++k)
    noise.data.push_back(static_cast<std::uint8_t>(random.next()));
  const auto off = [&](const Bytes& file) {
    const Pixels got = decode_fragment_file(Codec::kJpeg, file, 64 * 64);
    std::size_t count = 0;
    for (std::size_t k = 0; k < got.data.size(); ++k) count += got.data[k] != noise.data[k];
    return static_cast<double>(count) / static_cast<double>(got.data.size());
  };
  PlaneCoding plane;
  plane.fragment_width_px = plane.fragment_height_px = 64;
  plane.qualities = {kFinestQuality};
  const auto coder = make_texture_codec(Codec::kJpeg, plane);
  const std::array<PixelWindow, 1> sample{window_of(noise)};
  const std::vector<CodecRung> rungs = coder->train(sample, {});
  std::vector<Bytes> streams(1);
  coder->encoder()->encode(sample[0], streams);
  JpegKind libjpeg;
  libjpeg.quality = kFinestQuality;
  libjpeg.rgb = true;
  EXPECT_LT(off(join_fragment(Codec::kJpeg, rungs[0].table_stream, streams[0])), 0.067);
  EXPECT_GT(off(JpegCoder(libjpeg).complete(sample[0])), 0.08);
}

TEST(TextureCodec, JoiningAndSplittingAreInverse) {
  const Pixels pixels = picture(32, 32, 3);
  for (const Codec codec : kCodecs) {
    const Coded coded = code(codec, pixels);
    std::uint64_t lower = 0;
    for (std::size_t r = 0; r < coded.rungs.size(); ++r) {
      const Bytes file = coded.file(r);
      EXPECT_EQ(split_fragment(codec, coded.tables(r), file, lower), coded.streams[r]);
      lower += coded.streams[r].size();
    }
  }
}

TEST(TextureCodec, AProgressiveFilesLastRungIsTheBaselineImage) {
  for (const std::uint32_t channels : {1u, 3u})
    for (const bool apart : {false, true}) {
      const Pixels pixels = picture(48, 32, channels);
      const Coded progressive = code(Codec::kJpegProgressive, pixels, apart);
      const Coded baseline = code(Codec::kJpeg, pixels, apart);
      const Pixels a = decode_fragment_file(Codec::kJpegProgressive,
                                            progressive.file(progressive.rungs.size() - 1), 48 * 32);
      const Pixels b = decode_fragment_file(Codec::kJpeg, baseline.file(baseline.rungs.size() - 1), 48 * 32);
      EXPECT_TRUE(a.data == b.data);
      EXPECT_EQ(progressive.rungs.back().quality, 90);
    }
}

Bytes first_bytes(const Bytes& bytes, std::size_t count) {
  return {bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count)};
}

TEST(TextureCodec, EveryTruncationIsRefused) {
  const Pixels pixels = picture(32, 32, 3);
  for (const Codec codec : {Codec::kJpeg, Codec::kWebp}) {
    const Coded coded = code(codec, pixels);
    Bytes whole = coded.streams.back();
    for (std::size_t n = 0; n < whole.size(); ++n)
      EXPECT_THROW(decode_fragment_file(codec, coded.file_with(first_bytes(whole, n)), 32 * 32), FormatError)
          << codec_traits(codec).id << " " << n;
    whole.push_back(0);
    EXPECT_THROW(decode_fragment_file(codec, coded.file_with(whole), 32 * 32), FormatError);
  }
}

TEST(TextureCodec, ATruncatedProgressiveFileIsRefusedOrTheImageOfItsWholeScans) {
  // Cut behind a scan or behind a table, it is a sound file of lower quality: the package's digests tell.
  const Coded coded = code(Codec::kJpegProgressive, picture(32, 32, 3));
  const auto decode = [&](const Bytes& stream) {
    return decode_fragment_file(Codec::kJpegProgressive, coded.file_with(stream), 32 * 32).data;
  };
  const Bytes& whole = coded.streams.back();
  std::vector<std::size_t> ends = scan_ends(whole);
  ends.insert(ends.begin(), 0);
  std::size_t scans = 0, refused = 0;
  for (std::size_t n = 0; n < whole.size(); ++n) {
    if (n == ends[scans + 1]) ++scans;
    try {
      EXPECT_TRUE(decode(first_bytes(whole, n)) == decode(first_bytes(whole, ends[scans]))) << n;
    } catch (const FormatError&) {
      EXPECT_NE(n, ends[scans]);
      ++refused;
    }
  }
  EXPECT_GT(refused, whole.size() * 9 / 10);
}

TEST(TextureCodec, FlippedBytesAreRefusedOrGiveAnImageOfAnAllowedSize) {
  const Pixels pixels = picture(32, 32, 3);
  for (const Codec codec : kCodecs) {
    const Coded coded = code(codec, pixels);
    const Bytes file = coded.file(coded.rungs.size() - 1);
    std::size_t refused = 0;
    for (std::size_t n = 0; n < file.size(); ++n) {
      Bytes damaged = file;
      damaged[n] ^= static_cast<std::uint8_t>(1 + n % 255);
      try {
        const Pixels got = decode_fragment_file(codec, damaged, 4096);
        EXPECT_LE(std::uint64_t{got.width_px} * got.height_px, 4096u);
        EXPECT_EQ(got.data.size(), std::size_t{got.width_px} * got.height_px * got.channels);
      } catch (const FormatError&) {
        ++refused;
      }
    }
    EXPECT_GT(refused, 0u);
  }
}

TEST(TextureCodec, ForeignStreamsAreRefused) {
  const Pixels pixels = picture(16, 16, 3);
  const Coded jpeg = code(Codec::kJpeg, pixels), webp = code(Codec::kWebp, pixels);
  const std::span<const std::uint8_t> two[]{jpeg.streams[0], jpeg.streams[1]};
  EXPECT_THROW(join_fragment(Codec::kJpeg, jpeg.tables(0), two), FormatError);
  EXPECT_THROW(join_fragment(Codec::kJpeg, jpeg.tables(0), webp.streams[0]), FormatError);
  EXPECT_THROW(join_fragment(Codec::kWebp, {}, jpeg.streams[0]), FormatError);
  EXPECT_THROW(join_fragment(Codec::kJpegProgressive, jpeg.tables(0), Bytes{}), FormatError);
  EXPECT_THROW(join_fragment(Codec::kJpegProgressive, jpeg.tables(0), Bytes{1, 0xff}), FormatError);
  EXPECT_THROW(decode_fragment_file(Codec::kWebp, jpeg.file(0), 256), FormatError);
  EXPECT_THROW(decode_fragment_file(Codec::kJpeg, webp.file(0), 256), FormatError);
  EXPECT_THROW(code(Codec::kWebp, picture(16, 16, 1)), StageError);
  EXPECT_THROW(code(Codec::kWebp, pixels, true), StageError);
  EXPECT_THROW(code(Codec::kJpeg, picture(16, 16, 2)), StageError);
}

/// Blocks in which every coefficient in turn is as large as it can be, with either sign, and both one after
/// the other so that DC steps are as large as they can be.
Pixels extreme_blocks() {
  Pixels out{16 * 8, 64 * 8, 3, std::vector<std::uint8_t>(16 * 8 * 64 * 8 * 3)};
  for (std::uint32_t y = 0; y < out.height_px; ++y)
    for (std::uint32_t x = 0; x < out.width_px; ++x) {
      const double u = y / 8 % 8, v = y / 64;
      const double wave =
          std::cos((x % 8 + 0.5) * u * 3.14159265 / 8) * std::cos((y % 8 + 0.5) * v * 3.14159265 / 8);
      const bool high = (wave >= 0) != (x / 8 % 2 == 0);
      for (std::uint32_t c = 0; c < 3; ++c)  // grey on the left, and blue against yellow for large chroma
        out.data[(std::size_t{y} * out.width_px + x) * 3 + c] =
            high != (c == 2 && x >= out.width_px / 2) ? 255 : 0;
    }
  return out;
}

TEST(JpegCoder, PossibleSymbolsAreAllThatImagesTake) {
  const Pixels extreme = extreme_blocks();
  testing::Random random{9};
  Pixels noise{128, 128, 3, {}};
  for (int k = 0; k < 128 * 128 * 3; ++k) noise.data.push_back(random.next() % 2 ? 255 : 0);
  for (const Subsampling subsampling : {Subsampling::k420, Subsampling::k444})
    for (int quality = 1; quality <= 100; quality += quality < 90 ? 7 : 1) {
      JpegCoder coder({3, quality, subsampling});
      SymbolCounts counts(4);
      coder.count_symbols(window_of(extreme), counts);
      coder.count_symbols(window_of(noise), counts);
      const auto possible = coder.possible_symbols();
      ASSERT_EQ(possible.size(), 4u);
      for (std::size_t t = 0; t < 4; ++t)
        for (int symbol = 0; symbol < 256; ++symbol)
          if (counts[t][static_cast<std::size_t>(symbol)] > 0)
            EXPECT_TRUE(std::find(possible[t].begin(), possible[t].end(), symbol) != possible[t].end())
                << "quality " << quality << " table " << t << " symbol " << symbol;
    }
  EXPECT_LT(JpegCoder({3, 5, Subsampling::k420}).possible_symbols()[1].size(), 100u);
  EXPECT_EQ(JpegCoder({1, 100, Subsampling::k444}).possible_symbols()[1].size(), 162u);
}

struct Plane {
  Fragments fragments;
  std::vector<Pixels> pixels;
};

Plane plane_of(std::uint32_t side, TextureRole role) {
  Plane out;
  TexturePlane plane;
  plane.role = role;
  plane.channels = 3;
  plane.columns = 2;
  plane.rows = 1;
  plane.fragment_width_px = plane.fragment_height_px = side;
  plane.width_px = 2 * side;
  plane.height_px = side;
  plane.covered_texels.assign(2, side * side);
  out.fragments.planes.push_back(plane);
  out.pixels.push_back(picture(plane.width_px, plane.height_px, 3));
  return out;
}

Ladder encode(const Plane& p, LadderMode mode, int threads = 1) {
  LadderOptions options = testing::all_rungs();
  options.mode = mode;
  RunContext context;
  context.threads = threads;
  return encode_ladder(p.fragments, p.pixels, {}, {}, options, context);
}

TEST(LadderModes, ProgressiveRungsAreCutsOfOneFile) {
  const Plane p = plane_of(256, TextureRole::kBaseColour);
  const Ladder ladder = encode(p, LadderMode::kProgressive);
  const PlaneLadder& plane = ladder.planes[0];
  ASSERT_EQ(plane.codec, Codec::kJpegProgressive);
  EXPECT_EQ(plane.rungs.size(), 10u);
  for (std::size_t f = 0; f < 2; ++f) {
    std::uint64_t sum = 0;
    const Bytes whole = fragment_file(plane, plane.rungs.size() - 1, f);
    for (std::size_t r = 0; r < plane.rungs.size(); ++r) {
      sum += fragment_stream(plane.rungs[r], f).size();
      EXPECT_EQ(bytes_to_show(plane, r, f), sum);
      const Bytes file = fragment_file(plane, r, f);
      EXPECT_TRUE(std::equal(file.begin(), file.end() - 2, whole.begin())) << "a prefix, then EOI";
      EXPECT_EQ(decode_fragment(plane, r, f, 65536).width_px, 256u);
    }
  }
  const Ladder eight = encode(p, LadderMode::kProgressive, 8);
  for (std::size_t r = 0; r < plane.rungs.size(); ++r) {
    EXPECT_EQ(plane.rungs[r].quality, eight.planes[0].rungs[r].quality);
    EXPECT_TRUE(plane.rungs[r].data == eight.planes[0].rungs[r].data);
  }
}

TEST(LadderModes, WhatAModeCannotCodeIsBaselineWithANote) {
  const Ladder small = encode(plane_of(128, TextureRole::kBaseColour), LadderMode::kProgressive);
  EXPECT_EQ(small.planes[0].codec, Codec::kJpeg);
  ASSERT_EQ(small.notes.size(), 1u);
  EXPECT_EQ(small.notes[0].code, "small-fragments-not-progressive");
  EXPECT_EQ(small.notes[0].severity, Severity::kWarning) << "what was asked for is not done";
  const Ladder normal = encode(plane_of(32, TextureRole::kNormal), LadderMode::kWebp);
  EXPECT_EQ(normal.planes[0].codec, Codec::kJpeg);
  ASSERT_EQ(normal.notes.size(), 1u);
  EXPECT_EQ(normal.notes[0].code, "not-webp");
  const Ladder colour = encode(plane_of(32, TextureRole::kBaseColour), LadderMode::kWebp);
  EXPECT_EQ(colour.planes[0].codec, Codec::kWebp);
  EXPECT_TRUE(colour.notes.empty());
}

}  // namespace texmesh::fragment_codec_test
