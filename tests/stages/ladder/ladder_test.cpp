#include "stages/ladder/ladder.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "format/base/errors.h"
#include "stages/base/run_context.h"
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/jpeg/jpeg.h"
#include "stages/jpeg/jpeg_coder.h"
#include "tests/support/all_rungs.h"
#include "tests/support/meshes.h"

namespace texmesh::ladder_test {

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

Ladder encode(const Plane& p, LadderOptions options = testing::all_rungs(), int threads = 1) {
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
      LadderOptions options = testing::all_rungs();
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
    LadderOptions options = testing::all_rungs();
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

TEST(Ladder, ChannelsOfDataPlanesAreKeptApartWhereTheyHaveNothingInCommon) {
  for (const TextureRole role : {TextureRole::kNormal, TextureRole::kOcclusionRoughnessMetallic}) {
    const Plane data = make_plane(1, 1, 64, 3, Content::kNoise, role);
    const Ladder ladder = encode(data);
    for (const LadderRung& rung : ladder.planes[0].rungs) {
      const Pixels decoded = decode_baseline(rung, 0),
                   expected = channels_apart(data.pixels[0], rung.quality);
      for (std::size_t k = 0; k < data.pixels[0].data.size(); ++k) {
        if (role == TextureRole::kNormal && k % 3 == 2) continue;  // z may have quantisers of its own
        ASSERT_EQ(decoded.data[k], expected.data[k]) << rung.quality << " " << k;
      }
    }
    EXPECT_TRUE(decode_fragment_luma(ladder.planes[0], 0, 0, 4096).data ==
                luma_of(decode_fragment(ladder.planes[0], 0, 0, 4096)).data);
  }
}

TEST(Ladder, DataWhoseChannelsAreAlikeAreCodedAsYcc) {
  Plane data = make_plane(1, 1, 64, 3, Content::kPhoto, TextureRole::kOcclusionRoughnessMetallic);
  std::vector<std::uint8_t>& texels = data.pixels[0].data;
  for (std::size_t k = 0; k < texels.size(); k += 3) texels[k + 1] = texels[k + 2] = texels[k];
  const Ladder ladder = encode(data);
  for (const LadderRung& rung : ladder.planes[0].rungs)
    EXPECT_EQ(std::ranges::search(rung.table_stream, std::string("Adobe")).begin(), rung.table_stream.end());
}

TEST(Ladder, EveryRoleHasItsOwnRungs) {
  LadderOptions options = testing::all_rungs();
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
  LadderOptions options = testing::all_rungs();
  options.rungs = {5, 50, 97, 100};
  options.training_fragments = 3;
  const Ladder ladder = encode(p, options);
  for (const LadderRung& rung : ladder.planes[0].rungs) {
    const Pixels fragment = crop(p.pixels[0], p.fragments.planes[0], 0);
    const Pixels coded = decode_baseline(rung, 0);
    if (rung.quality == kFinestQuality) {
      for (std::size_t k = 0; k < fragment.data.size(); ++k)
        ASSERT_NEAR(coded.data[k], fragment.data[k], 1) << k;
      continue;
    }
    const Pixels direct = decode_jpeg(encode_jpeg(fragment, rung.quality, Subsampling::k420), 1 << 24);
    EXPECT_TRUE(coded.data == direct.data) << rung.quality;
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
  const Ladder one = encode(p, testing::all_rungs(), 1), eight = encode(p, testing::all_rungs(), 8);
  for (std::size_t r = 0; r < one.planes[0].rungs.size(); ++r) {
    EXPECT_TRUE(one.planes[0].rungs[r].data == eight.planes[0].rungs[r].data);
    EXPECT_TRUE(one.planes[0].rungs[r].table_stream == eight.planes[0].rungs[r].table_stream);
    EXPECT_EQ(one.planes[0].rungs[r].offset, eight.planes[0].rungs[r].offset);
  }
}

TEST(Ladder, RefusesRungsThatDoNotRiseAndPixelsThatDoNotFit) {
  Plane p = make_plane(1, 1, 16, 3);
  LadderOptions options = testing::all_rungs();
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
  LadderOptions options = testing::all_rungs();
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

}  // namespace texmesh::ladder_test
