#include "stages/ladder/lossless_top.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "format/documents/textures.h"
#include "stages/fragment_codec/decode_rung.h"
#include "stages/image/decode_image.h"
#include "stages/image/decode_jpeg.h"
#include "tests/support/images.h"

namespace texmesh {
namespace {

struct Kind {
  const char* name;
  int channels = 3, across = 1, down = 1;  // luma's sampling factors
  bool progressive = false, rgb = false;
  int quality = 90;
};

Bytes make_jpeg(const Kind& kind, int width, int height) {
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
  if (kind.progressive) jpeg_simple_progression(&info);
  jpeg_start_compress(&info, TRUE);
  Bytes picture = testing::test_picture(width, height, kind.channels);
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

/// A plane of fragments of 32 x 32 px over the image, all covered but the second.
TexturePlane plane_of(const Image& image) {
  TexturePlane plane;
  plane.width_px = image.width_px;
  plane.height_px = image.height_px;
  plane.channels = image.channels >= 3 ? 3 : 1;
  plane.fragment_width_px = plane.fragment_height_px = 32;
  plane.columns = (image.width_px + 31) / 32;
  plane.rows = (image.height_px + 31) / 32;
  plane.covered_texels.assign(plane.fragment_count(), 1024);
  if (plane.fragment_count() > 1) plane.covered_texels[1] = 0;
  return plane;
}

Image image_of(Bytes bytes) { return probe_image("a picture", std::move(bytes), {}); }

/// A ladder as encode_ladder() leaves it, as far as the top goes.
Ladder ladder_below(const std::vector<int>& qualities) {
  Ladder ladder;
  ladder.planes.resize(1);
  for (const int q : qualities) ladder.planes[0].rungs.push_back({q, {}, {}, {}});
  return ladder;
}

/// The ladder with the top of `image`, as encode_ladder() makes it.
Ladder topped(const TexturePlane& plane, const Image& image, Ladder ladder) {
  ladder.planes[0] = with_lossless_top(std::move(ladder.planes[0]), plane, image, ladder.notes, {});
  return ladder;
}

RunContext with_threads(int threads) {
  RunContext context;
  context.threads = threads;
  return context;
}

/// Blocks of the fragment that differ from the source's.
std::size_t foreign_blocks(const JpegCoefficients& source, const Bytes& file, const TexturePlane& plane,
                           std::size_t fragment) {
  const JpegCoefficients cut("fragment", file);
  std::size_t foreign = 0;
  EXPECT_EQ(cut.width_px(), 32u);
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
  const auto left = static_cast<std::uint32_t>(fragment % plane.columns) * 32;
  const auto top = static_cast<std::uint32_t>(fragment / plane.columns) * 32;
  std::size_t inner = 0, ring = 0;
  for (std::uint32_t y = 0; y < 32 && top + y < whole.height_px; ++y)
    for (std::uint32_t x = 0; x < 32 && left + x < whole.width_px; ++x) {
      const std::uint8_t* a = whole.at(left + x, top + y);
      if (std::equal(a, a + whole.channels, part.at(x, y))) continue;
      const bool edge = x == 0 || y == 0 || x == 31 || y == 31 || left + x + 1 == whole.width_px ||
                        top + y + 1 == whole.height_px;
      ++(edge ? ring : inner);
    }
  return {inner, ring};
}

constexpr Kind kKinds[] = {{"4:4:4"},
                           {"4:2:0", 3, 2, 2},
                           {"4:2:2", 3, 2, 1},
                           {"4:4:0", 3, 1, 2},
                           {"grey", 1},
                           {"grey with factors", 1, 2, 2},
                           {"progressive 4:2:0", 3, 2, 2, true},
                           {"progressive grey", 1, 1, 1, true},
                           {"RGB", 3, 1, 1, false, true},
                           {"finest 4:2:0", 3, 2, 2, false, false, 100}};

TEST(LosslessTop, FragmentsHaveTheSourcesCoefficientsAndPixels) {
  for (const Kind& kind : kKinds) {
    SCOPED_TRACE(kind.name);
    const Image image = image_of(make_jpeg(kind, 83, 61));
    const TexturePlane plane = plane_of(image);
    const Ladder ladder = topped(plane, image, ladder_below({50, 97}));
    const PlaneLadder& top = ladder.planes[0];
    ASSERT_TRUE(top.lossless);
    EXPECT_EQ(top.source, SourceFile::kNone);
    ASSERT_EQ(top.rungs.size(), 3u);
    EXPECT_EQ(top.rungs[2].quality, kLosslessQuality);
    EXPECT_TRUE(fragment_stream(top.rungs[2], 1).empty());  // nothing covers it
    const JpegCoefficients source("source", image.bytes);
    const Pixels whole = decode_image(image);
    for (std::size_t f = 0; f < plane.fragment_count(); ++f) {
      if (f == 1) continue;
      const Bytes file = fragment_file(top, 2, f);
      EXPECT_EQ(foreign_blocks(source, file, plane, f), 0u) << "fragment " << f;
      const auto [inner, ring] = other_texels(whole, decode_fragment(top, 2, f, 1 << 20), plane, f);
      EXPECT_EQ(inner, 0u) << "fragment " << f;
      if (kind.channels == 1 || kind.across * kind.down == 1) {
        EXPECT_EQ(ring, 0u) << "fragment " << f;
      }
    }
  }
}

TEST(LosslessTop, BytesAreThoseOfTheSource) {
  const Image image = image_of(make_jpeg({"", 3, 2, 2}, 512, 512));
  TexturePlane plane = plane_of(image);
  plane.fragment_width_px = plane.fragment_height_px = 256;
  plane.columns = plane.rows = 2;
  plane.covered_texels.assign(4, 1);
  const Ladder ladder = topped(plane, image, ladder_below({50}));
  EXPECT_LT(ladder.planes[0].rungs[1].data.size(), image.bytes.size());  // tables of its own
}

TEST(LosslessTop, OtherFormatsStayAsTheyAre) {
  const Image png = image_of(testing::png_bytes(40, 40, 4));
  Ladder ladder = topped(plane_of(png), png, ladder_below({50, 97}));
  EXPECT_EQ(ladder.planes[0].rungs.size(), 2u);
  EXPECT_FALSE(ladder.planes[0].lossless);
  EXPECT_EQ(ladder.planes[0].source, SourceFile::kSameColours);
  EXPECT_TRUE(ladder.notes.empty());

  TexturePlane alpha = plane_of(png);
  alpha.role = TextureRole::kAlpha;
  ladder = topped(alpha, png, ladder_below({50, 97}));
  EXPECT_EQ(ladder.planes[0].source, SourceFile::kNone);  // the colour plane's has it
}

TEST(LosslessTop, MipsHaveNone) {
  const Image png = image_of(testing::png_bytes(40, 40, 3));
  TexturePlane mip = plane_of(png);
  EXPECT_EQ(topped(mip, png, ladder_below({50})).planes[0].source, SourceFile::kSameColours);
  mip.mip = 1;
  EXPECT_EQ(topped(mip, png, ladder_below({50})).planes[0].source, SourceFile::kNone);
}

TEST(LosslessTop, JpegsThatCannotBeCutStayWhole) {
  const Image wide = image_of(make_jpeg({"4:1:1", 3, 4, 1}, 64, 64));
  Ladder ladder = topped(plane_of(wide), wide, ladder_below({50}));
  EXPECT_FALSE(ladder.planes[0].lossless);
  EXPECT_EQ(ladder.planes[0].source, SourceFile::kSameColours);
  ASSERT_EQ(ladder.notes.size(), 1u);
  EXPECT_NE(ladder.notes[0].text.find("wider than 16 px"), std::string::npos);

  const Image coarse = image_of(make_jpeg({"16-bit quantisers", 3, 1, 1, false, false, 1}, 64, 64));
  ladder = topped(plane_of(coarse), coarse, ladder_below({50}));
  EXPECT_FALSE(ladder.planes[0].lossless);
  EXPECT_EQ(ladder.planes[0].source, SourceFile::kSameColours);

  const Image inks = image_of(testing::cmyk_jpeg(48, 48, {10, 20, 30, 40}, true));
  ladder = topped(plane_of(inks), inks, ladder_below({50}));
  EXPECT_FALSE(ladder.planes[0].lossless);
  EXPECT_EQ(ladder.planes[0].source, SourceFile::kOtherColours);
}

TEST(LosslessTop, OtherCodecsKeepTheFile) {
  const Image image = image_of(make_jpeg({""}, 64, 64));
  Ladder ladder = ladder_below({50});
  ladder.planes[0].codec = Codec::kWebp;
  ladder = topped(plane_of(image), image, std::move(ladder));
  EXPECT_FALSE(ladder.planes[0].lossless);
  EXPECT_EQ(ladder.planes[0].source, SourceFile::kSameColours);
}

TEST(LosslessTop, ARungOfQuality100MakesRoom) {
  const Image image = image_of(make_jpeg({""}, 64, 64));
  for (const std::vector<int>& below : {std::vector<int>{60, 100}, std::vector<int>{100}}) {
    const Ladder ladder = topped(plane_of(image), image, ladder_below(below));
    const auto& rungs = ladder.planes[0].rungs;
    ASSERT_EQ(rungs.size(), 2u);
    EXPECT_LT(rungs[0].quality, kLosslessQuality);
    EXPECT_EQ(rungs[1].quality, kLosslessQuality);
    EXPECT_FALSE(rungs[1].data.empty());
  }
}

TEST(LosslessTop, ThreadsMakeNoDifference) {
  const Image image = image_of(make_jpeg({"", 3, 2, 2, true}, 300, 200));
  const TexturePlane plane = plane_of(image);
  std::string why_not;
  const auto first = cut_coefficients(plane, image, why_not, with_threads(1));
  const auto second = cut_coefficients(plane, image, why_not, with_threads(8));
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->table_stream, second->table_stream);
  EXPECT_EQ(first->data, second->data);
  EXPECT_EQ(first->offset, second->offset);
}

TEST(LosslessTop, EveryTruncationIsAnErrorOrAWholeImage) {
  const Bytes whole = make_jpeg({"", 3, 2, 2}, 48, 48);
  const Image image = image_of(whole);
  for (std::size_t length = 0; length < whole.size(); length += 1 + length / 40) {
    Image cut = image;
    cut.bytes.resize(length);
    std::string why_not;
    EXPECT_THROW(cut_coefficients(plane_of(image), cut, why_not, {}), InputError) << length;
  }
}

TEST(LosslessTop, FlippedBytesNeverCrash) {
  const Bytes whole = make_jpeg({"", 3, 2, 2, true}, 48, 48);
  const Image image = image_of(whole);
  std::size_t taken = 0, refused = 0;
  for (std::size_t at = 0; at < whole.size(); at += 3) {
    Image flipped = image;
    flipped.bytes[at] ^= 0x5a;
    std::string why_not;
    try {
      if (cut_coefficients(plane_of(image), flipped, why_not, {}))
        ++taken;
      else
        ++refused;
    } catch (const Error&) {
      ++refused;
    }
  }
  EXPECT_GT(taken, 0u);
  EXPECT_GT(refused, 0u);
}

}  // namespace
}  // namespace texmesh
