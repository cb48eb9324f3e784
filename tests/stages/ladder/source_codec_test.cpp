#include "stages/ladder/encode_rungs.h"

#include <gtest/gtest.h>

#include "tests/stages/ladder/source_scenes.h"
#include "tests/support/wide_jpeg.h"

namespace texmesh::source_codec_test {

using namespace testing;  // NOLINT: fixtures

TEST(SourceCodec, TopFragmentsHaveTheSourcesCoefficientsAndPixels) {
  for (const Kind& kind : kKinds) {
    SCOPED_TRACE(kind.name);
    Scene scene = scene_of(image_of(make_jpeg(kind, 83, 61)));
    const TexturePlane& plane = scene.plane();
    const Ladder ladder = encode(scene, asked({5, 9}));
    const PlaneLadder& top = ladder.planes[0];
    ASSERT_TRUE(top.source_rung);
    EXPECT_TRUE(ladder.notes.empty());
    ASSERT_EQ(top.rungs.size(), 3u);
    EXPECT_EQ(top.rungs[2].quality, kind.quality);
    EXPECT_TRUE(fragment_stream(top.rungs[2], 1).empty());  // nothing covers it
    const JpegCoefficients source("source", scene.image.bytes);
    const Pixels whole = decode_image(scene.image);
    for (std::size_t f = 0; f < plane.fragment_count(); ++f) {
      if (f == 1) continue;
      EXPECT_EQ(foreign_blocks(source, fragment_file(top, 2, f), plane, f), 0u) << "fragment " << f;
      const auto [inner, ring] = other_texels(whole, decode_fragment(top, 2, f, 1 << 20), plane, f);
      EXPECT_EQ(inner, 0u) << "fragment " << f;
      if (kind.channels == 1 || kind.across * kind.down == 1) {
        EXPECT_EQ(ring, 0u) << "fragment " << f;
      }
    }
  }
}

TEST(SourceCodec, RungsBelowHaveTheSourcesComponents) {
  for (const Kind& kind : kKinds) {
    SCOPED_TRACE(kind.name);
    const Scene scene = scene_of(image_of(make_jpeg(kind, 83, 61)));
    const PlaneLadder ladder = encode(scene, asked({5, 9})).planes[0];
    const JpegCoefficients top("top", fragment_file(ladder, 2, 0));
    for (std::size_t r = 0; r < 2; ++r) {
      const JpegCoefficients below("below", fragment_file(ladder, r, 0));
      EXPECT_EQ(below.is_rgb(), top.is_rgb());
      ASSERT_EQ(below.components().size(), top.components().size());
      for (std::size_t c = 0; c < top.components().size(); ++c) {
        EXPECT_EQ(below.components()[c].across, top.components()[c].across);
        EXPECT_EQ(below.components()[c].down, top.components()[c].down);
      }
    }
  }
}

/// Shades without a jump, as far apart as photographs have them.
Bytes smooth_picture(int side) {
  Bytes out;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x)
      for (int c = 0; c < 3; ++c)
        out.push_back(
            static_cast<std::uint8_t>(128 + 60 * std::sin(x * (0.03 + 0.02 * c)) * std::cos(y * 0.05)));
  return out;
}

TEST(SourceCodec, FragmentsMeetWithoutSeams) {
  for (const Kind& kind :
       {Kind{"4:2:0", 3, 2, 2}, Kind{"4:2:2", 3, 2, 1}, Kind{"4:4:0", 3, 1, 2}, Kind{"4:1:1", 3, 4, 1}}) {
    SCOPED_TRACE(kind.name);
    Scene scene = scene_of(image_of(make_jpeg(kind, 128, 128, smooth_picture(128))));
    scene.plane().covered_texels[1] = kSide * kSide;
    const PlaneLadder ladder = encode(scene, asked({50})).planes[0];
    const Pixels whole = decode_image(scene.image);
    int most = 0;
    for (std::size_t f = 0; f < scene.plane().fragment_count(); ++f) {
      const Pixels part = decode_fragment(ladder, 1, f, 1 << 20);
      const TexelRectangle at = padded_fragment_rectangle(scene.plane(), f);
      for (std::uint32_t y = 0; y < kSide; ++y)
        for (std::uint32_t x = 0; x < kSide; ++x)
          for (std::uint32_t c = 0; c < 3; ++c)
            most = std::max(
                most, std::abs(int{part.at(x, y)[c]} - int{whole.at(at.left_px + x, at.top_px + y)[c]}));
    }
    // A repeated sample is a quarter of the step to its neighbour off, which is at most 9 here; blue takes
    // 1.77 of that.
    EXPECT_LE(most, 4);
  }
}

TEST(SourceCodec, CoveredTexelsAreTheSourcesAndTheRestIsCheap) {
  for (const Kind& kind : {Kind{"4:4:4"}, Kind{"4:2:0", 3, 2, 2}, Kind{"4:1:1", 3, 4, 1}, Kind{"grey", 1}}) {
    SCOPED_TRACE(kind.name);
    Scene scene = scene_of(image_of(make_jpeg(kind, 128, 96)));
    TexturePlane& plane = scene.plane();
    cover(plane, [](std::uint32_t x, std::uint32_t y) { return x > 20 + y / 2 && (x < 90 || y < 11); });
    const auto shown = [&](Uncovered uncovered) {
      LadderOptions options = asked({30});
      options.uncovered = uncovered;
      return encode(scene, options).planes[0];
    };
    const PlaneLadder cheap = shown(Uncovered::kFree), kept = shown(Uncovered::kKept);
    EXPECT_LT(cheap.rungs[1].data.size(),
              kept.rungs[1].data.size() * 4 / 5);  // chroma blocks of 32 px reach far
    EXPECT_LT(cheap.rungs[0].data.size(),
              kept.rungs[0].data.size() * 4 / 5);  // chroma blocks of 32 px reach far
    std::size_t other = 0;
    for (std::size_t f = 0; f < plane.fragment_count(); ++f) {
      if (plane.covered_texels[f] == 0) continue;
      const Pixels a = decode_fragment(cheap, 1, f, 1 << 20), b = decode_fragment(kept, 1, f, 1 << 20);
      const TexelRectangle at = fragment_rectangle(plane, f);
      for (std::uint32_t y = 0; y < at.height_px; ++y)
        for (std::uint32_t x = 0; x < at.width_px; ++x) {
          const bool same = std::equal(a.at(x, y), a.at(x, y) + a.channels, b.at(x, y));
          if (CoverageMask(plane).covered(at.left_px + x, at.top_px + y))
            EXPECT_TRUE(same) << "fragment " << f << " at " << x << ", " << y;
          else
            other += !same;
        }
    }
    EXPECT_GT(other, 1000u);
  }
}

double squared_error(const Scene& scene, const PlaneLadder& ladder, std::size_t rung) {
  const TexturePlane& plane = scene.fragments.planes[0];
  double sum = 0;
  for (std::size_t f = 0; f < plane.fragment_count(); ++f) {
    if (fragment_stream(ladder.rungs[rung], f).empty()) continue;
    const Pixels part = decode_fragment(ladder, rung, f, 1 << 20);
    const TexelRectangle at = fragment_rectangle(plane, f);
    for (std::uint32_t y = 0; y < at.height_px; ++y)
      for (std::uint32_t x = 0; x < at.width_px; ++x) {
        const std::uint8_t* from = scene.pixels[0].at(at.left_px + x, at.top_px + y);
        for (std::uint32_t c = 0; c < part.channels; ++c)
          sum += std::pow(double{part.at(x, y)[c] * 1.0 - from[c]}, 2);
      }
  }
  return sum;
}

TEST(SourceCodec, RungsRiseInBytesAndFallInError) {
  for (const TextureRole role : {TextureRole::kBaseColour, TextureRole::kNormal})
    for (const bool masked : {false, true}) {
      Scene scene = scene_of(image_of(make_jpeg({"", 3, 2, 2}, 256, 256, smooth_picture(256))), 64);
      scene.plane().role = role;
      if (masked) cover(scene.plane(), [](std::uint32_t x, std::uint32_t y) { return (x + y) % 90 > 70; });
      const PlaneLadder ladder = encode(scene, asked({5, 20, 50, 75})).planes[0];
      ASSERT_EQ(ladder.rungs.size(), 5u);
      for (std::size_t r = 1; r < 5; ++r) {
        EXPECT_GT(ladder.rungs[r].quality, ladder.rungs[r - 1].quality);
        EXPECT_GT(ladder.rungs[r].data.size(), ladder.rungs[r - 1].data.size());
        if (!masked) EXPECT_LT(squared_error(scene, ladder, r), squared_error(scene, ladder, r - 1));
      }
    }
}

TEST(SourceCodec, BytesAreAtMostTheSources) {
  Scene scene = scene_of(image_of(make_jpeg({"", 3, 2, 2}, 512, 512)), 256);
  scene.plane().covered_texels.assign(4, 256 * 256);
  const PlaneLadder ladder = encode(scene, asked({50})).planes[0];
  EXPECT_LT(ladder.rungs[1].data.size(), scene.image.bytes.size());  // tables of its own
}

TEST(SourceCodec, ChosenQualitiesAreByBytes) {
  Scene scene = scene_of(image_of(make_jpeg({"", 3, 2, 2, false, false, 95}, 512, 512)), 64);
  scene.plane().covered_texels.assign(64, 64 * 64);
  const SourceCodec source = make_source_codec(scene.plane(), scene.pixels[0], scene.image, {}, false, {});
  ASSERT_TRUE(source.codec);
  const std::vector<CodecRung> rungs = source.codec->train({}, {});
  ASSERT_GT(rungs.size(), 2u);
  EXPECT_EQ(rungs.back().quality, 95);
  const SourceCodec alone = make_source_codec(scene.plane(), scene.pixels[0], scene.image, {}, true, {});
  EXPECT_EQ(alone.codec->train({}, {}).size(), 1u);
  EXPECT_FALSE(source.bits.empty());
  EXPECT_TRUE(alone.bits.empty()) << "measured for nothing";
  std::vector<Bytes> streams(rungs.size());
  const auto encoder = source.codec->encoder();
  const Pixels& pixels = scene.pixels[0];
  for (std::uint32_t f = 0; f < 64; ++f) {
    const TexelRectangle at = padded_fragment_rectangle(scene.plane(), f);
    encoder->encode(
        {pixels.at(at.left_px, at.top_px), std::size_t{512} * 3, 64, 64, {{}, at.left_px, at.top_px}},
        streams);
  }
  for (std::size_t r = 1; r < rungs.size(); ++r) {
    EXPECT_GT(rungs[r].quality, rungs[r - 1].quality);
    EXPECT_GT(streams[r].size(), 4 * streams[r - 1].size() / 3);
    // What the choice went by is what the bytes are.
    const double bits = source.bits[static_cast<std::size_t>(rungs[r].quality)] /
                        source.bits[static_cast<std::size_t>(rungs[r - 1].quality)];
    EXPECT_NEAR(static_cast<double>(streams[r].size()) / static_cast<double>(streams[r - 1].size()) / bits, 1,
                0.1);
  }
}

TEST(SourceCodec, EveryRungThatIsAskedForIsStored) {
  const Scene scene = scene_of(image_of(make_jpeg({"", 3, 2, 2, false, false, 60}, 96, 64)));
  const auto qualities = [&](std::vector<int> rungs) {
    std::vector<int> out;
    const Ladder ladder = encode(scene, asked(std::move(rungs)));
    for (const LadderRung& rung : ladder.planes[0].rungs) {
      out.push_back(rung.quality);
      EXPECT_FALSE(rung.data.empty());
    }
    return out;
  };
  EXPECT_EQ(qualities({5, 30}), (std::vector<int>{5, 30, 60}));
  EXPECT_EQ(qualities({30, 60}), (std::vector<int>{30, 60, 61}));
  EXPECT_EQ(qualities({5, 97}), (std::vector<int>{5, 97, 98}));
  EXPECT_EQ(qualities({50, 100}), (std::vector<int>{50, 60}));
  EXPECT_EQ(qualities({100}), (std::vector<int>{60}));
}

TEST(SourceCodec, FilesAreKeptWhereTheyAreWanted) {
  LadderOptions keep = asked({50});
  keep.keep_source = true;
  const Scene jpeg = scene_of(image_of(make_jpeg({""}, 64, 64)));
  EXPECT_EQ(encode(jpeg, asked({50})).planes[0].source, SourceFile::kNone);
  EXPECT_EQ(encode(jpeg, keep).planes[0].source, SourceFile::kSameColours);
  Scene png = scene_of(image_of(testing::png_bytes(40, 40, 4)));
  EXPECT_EQ(encode(png, keep).planes[0].source, SourceFile::kSameColours);
  png.plane().role = TextureRole::kAlpha;
  EXPECT_EQ(encode(png, keep).planes[0].source, SourceFile::kNone);  // the colour plane's has it
  const Scene inks = scene_of(image_of(testing::cmyk_jpeg(48, 48, {10, 20, 30, 40}, true)));
  EXPECT_EQ(encode(inks, keep).planes[0].source, SourceFile::kOtherColours);
}

const Note* note_of(const Ladder& ladder, const std::string& code) {
  for (const Note& note : ladder.notes)
    if (note.code == code) return &note;
  return nullptr;
}

TEST(SourceCodec, WideAndDamagedFilesAreCodedFromTheirPixels) {
  std::vector<std::uint16_t> ramp;
  for (int i = 0; i < 64 * 64; ++i) ramp.push_back(static_cast<std::uint16_t>(i));
  const Bytes whole = make_jpeg({""}, 64, 64);
  Image damaged = image_of(Bytes(whole.begin(), whole.end() - static_cast<std::ptrdiff_t>(whole.size() / 8)));
  damaged.accept_damage = true;
  LadderOptions keep = asked({50});
  keep.keep_source = true;
  for (const LadderMode mode : {LadderMode::kJpeg, LadderMode::kProgressive}) {
    keep.mode = mode;
    const Ladder wide = encode(scene_of(image_of(testing::wide_jpeg(64, 64, ramp, 12))), keep);
    EXPECT_FALSE(note_of(wide, "damaged-image"));
    EXPECT_EQ(wide.planes[0].source, SourceFile::kSameColours);
    const Ladder ladder = encode(scene_of(damaged), keep);
    const Note* damage = note_of(ladder, "damaged-image");
    ASSERT_TRUE(damage);
    EXPECT_EQ(damage->severity, Severity::kWarning);
    EXPECT_NE(damage->text.find(" of 64: "), std::string::npos) << damage->text;
    EXPECT_EQ(ladder.planes[0].source, SourceFile::kNone) << "a file that is not whole is kept";
    if (mode != LadderMode::kJpeg) continue;
    for (const Ladder* l : {&wide, &ladder}) {
      ASSERT_TRUE(note_of(*l, "jpeg-coded-anew"));
      EXPECT_NE(note_of(*l, "jpeg-coded-anew")->text.find(" of 255 off on average"), std::string::npos);
    }
  }
}

TEST(SourceCodec, ThreadsMakeNoDifference) {
  Scene scene = scene_of(image_of(make_jpeg({"", 3, 2, 2, true}, 300, 200)));
  cover(scene.plane(), [](std::uint32_t x, std::uint32_t y) { return (x * y) % 700 > 500; });
  const Ladder one = encode(scene, asked({10, 40}), 1), eight = encode(scene, asked({10, 40}), 8);
  for (std::size_t r = 0; r < 3; ++r) {
    EXPECT_EQ(one.planes[0].rungs[r].table_stream, eight.planes[0].rungs[r].table_stream);
    EXPECT_EQ(one.planes[0].rungs[r].data, eight.planes[0].rungs[r].data);
  }
  EXPECT_EQ(one.planes[0].knots.position, eight.planes[0].knots.position);
}

}  // namespace texmesh::source_codec_test
