#include "stages/ladder/source_codec.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "stages/base/run_context.h"
#include "stages/fragment_codec/decode_rung.h"
#include "stages/image/decode_image.h"
#include "stages/image/decode_jpeg.h"
#include "stages/jpeg/source_jpeg.h"
#include "stages/ladder/ladder.h"
#include "tests/support/images.h"

namespace texmesh {
namespace {

constexpr std::uint32_t kSide = 32;  // of fragments

struct Kind {
  const char* name;
  int channels = 3, across = 1, down = 1;  // luma's sampling factors
  bool progressive = false, rgb = false;
  int quality = 90;
  bool arithmetic = false;
  int restart_mcus = 0;
};

Bytes make_jpeg(const Kind& kind, int width, int height, Bytes picture = {}) {
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

Image image_of(Bytes bytes) { return probe_image("a picture", std::move(bytes), {}); }

/// A plane of fragments over the image, all covered but the second, and its pixels.
struct Scene {
  Image image;
  Fragments fragments;
  std::vector<Pixels> pixels;
  TexturePlane& plane() { return fragments.planes[0]; }
};

Pixels padded(const Pixels& from, std::uint32_t width, std::uint32_t height) {
  Pixels out{width, height, from.channels, {}};
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; ++x) {
      const std::uint8_t* p = from.at(std::min(x, from.width_px - 1), std::min(y, from.height_px - 1));
      out.data.insert(out.data.end(), p, p + from.channels);
    }
  return out;
}

Scene scene_of(Image image, std::uint32_t side = kSide) {
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
void cover(TexturePlane& plane, const Hole& hole) {
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

LadderOptions asked(std::vector<int> rungs) {
  LadderOptions options;
  options.prune = false;
  options.rungs = options.normal_rungs = options.data_rungs = options.alpha_rungs = std::move(rungs);
  return options;
}

Ladder encode(const Scene& scene, const LadderOptions& options, int threads = 1) {
  RunContext context;
  context.threads = threads;
  return encode_ladder(scene.fragments, scene.pixels, {}, {scene.image}, options, context);
}

/// Blocks of the fragment that differ from the source's.
std::size_t foreign_blocks(const JpegCoefficients& source, const Bytes& file, const TexturePlane& plane,
                           std::size_t fragment) {
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
std::pair<std::size_t, std::size_t> other_texels(const Pixels& whole, const Pixels& part,
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

constexpr Kind kKinds[] = {{"4:4:4"},
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
  const SourceCodec source = make_source_codec(scene.plane(), scene.pixels[0], scene.image, {}, {});
  ASSERT_TRUE(source.codec);
  const std::vector<CodecRung> rungs = source.codec->train({}, {});
  ASSERT_GT(rungs.size(), 2u);
  EXPECT_EQ(rungs.back().quality, 95);
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

/// The note about a plane that is coded from its pixels.
std::string note_of(const Ladder& ladder) {
  EXPECT_FALSE(ladder.planes[0].source_rung);
  EXPECT_EQ(ladder.notes.size(), 1u);
  return ladder.notes.empty() ? "" : ladder.notes[0].text;
}

TEST(SourceCodec, JpegsThatCannotBeCutAreCodedAnewAndSaySo) {
  const Image wide = image_of(make_jpeg({"4:1:1", 3, 4, 1}, 64, 64));
  EXPECT_NE(note_of(encode(scene_of(wide, 16), asked({50}))).find("cross the borders"), std::string::npos);
  const Image coarse = image_of(make_jpeg({"16-bit quantisers", 3, 1, 1, false, false, 1}, 64, 64));
  EXPECT_NE(note_of(encode(scene_of(coarse), asked({50}))).find("exceed 255"), std::string::npos);
  const Image inks = image_of(testing::cmyk_jpeg(48, 48, {10, 20, 30, 40}, true));
  const std::string text = note_of(encode(scene_of(inks), asked({50, 97})));
  EXPECT_NE(text.find("converted"), std::string::npos) << text;
  EXPECT_NE(text.find("of 255 off on average"), std::string::npos) << text;
  Scene other = scene_of(image_of(make_jpeg({"4:4:4"}, 64, 64)));
  other.image = image_of(make_jpeg({"4:4:4"}, 64, 48));
  EXPECT_NE(note_of(encode(other, asked({50}))).find("another size"), std::string::npos);
}

TEST(SourceCodec, NoneForOtherFormatsMipsAlphaAndCodecs) {
  const auto has_one = [](Scene scene) {
    const SourceCodec source = make_source_codec(scene.plane(), scene.pixels[0], scene.image, {}, {});
    EXPECT_EQ(source.why_not, "");
    return source.codec != nullptr;
  };
  const Scene jpeg = scene_of(image_of(make_jpeg({""}, 64, 64)));
  EXPECT_TRUE(has_one(jpeg));
  EXPECT_FALSE(has_one(scene_of(image_of(testing::png_bytes(40, 40, 4)))));
  Scene other = jpeg;
  other.plane().mip = 1;
  EXPECT_FALSE(has_one(other));
  other = jpeg;
  other.plane().role = TextureRole::kAlpha;
  EXPECT_FALSE(has_one(other));
  LadderOptions webp = asked({50});
  webp.mode = LadderMode::kWebp;
  EXPECT_FALSE(encode(jpeg, webp).planes[0].source_rung);
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

TEST(SourceCodec, EveryTruncationHasNoCodec) {
  Scene scene = scene_of(image_of(make_jpeg({"", 3, 2, 2}, 48, 48)));
  const Bytes whole = scene.image.bytes;
  for (std::size_t length = 2; length + 2 < whole.size(); length += 1 + length / 40) {
    scene.image.bytes.assign(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length));
    try {
      const SourceCodec source = make_source_codec(scene.plane(), scene.pixels[0], scene.image, {}, {});
      EXPECT_FALSE(source.codec) << length;
      EXPECT_NE(source.why_not, "") << length;
    } catch (const InputError&) {  // the header's colour profile cannot be looked for
    }
  }
}

TEST(SourceCodec, FlippedBytesNeverCrash) {
  Scene scene = scene_of(image_of(make_jpeg({"", 3, 2, 2, true}, 48, 48)));
  const Bytes whole = scene.image.bytes;
  std::size_t taken = 0, refused = 0;
  for (std::size_t at = 2; at < whole.size(); at += 3) {
    scene.image.bytes = whole;
    scene.image.bytes[at] ^= 0x5a;
    try {
      const Ladder ladder = encode(scene, asked({40}));
      if (ladder.planes[0].source_rung) {
        ++taken;
        for (std::size_t r = 0; r < ladder.planes[0].rungs.size(); ++r)
          decode_fragment(ladder.planes[0], r, 0, 1 << 20);
      } else {
        ++refused;
      }
    } catch (const InputError&) {
      ++refused;
    }
  }
  EXPECT_GT(taken, 0u);
  EXPECT_GT(refused, 0u);
}

}  // namespace
}  // namespace texmesh
