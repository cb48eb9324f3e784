#include "stages/fragment_codec/requantised_jpeg.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "stages/base/run_context.h"
#include "stages/image/decode_jpeg.h"
#include "stages/jpeg/jpeg.h"
#include "stages/jpeg/jpeg_coder.h"
#include "stages/jpeg/masked_jpeg.h"
#include "tests/support/images.h"

namespace texmesh::requantised_jpeg_test {

constexpr std::uint32_t kSide = 128;

struct Source {
  Pixels pixels{kSide, kSide, 3, testing::test_picture(kSide, kSide, 3)};
  Bytes file = encode_jpeg(pixels, 85, Subsampling::k420);
  JpegCoefficients coefficients{"a picture", file};
  SourceLayout layout;
  Source() {
    std::string why_not;
    layout = *source_layout(coefficients, kSide, kSide, why_not);
  }
  PixelWindow window() const { return {pixels.data.data(), std::size_t{kSide} * 3, kSide, kSide}; }
};

SourceRung rung_of(const Source& source, int quality, float cost) {
  JpegKind kind;
  kind.quality = quality;
  const JpegCoder coder(kind);
  const auto quantisers = coder.quantisers();
  const HuffmanTables tables = coder.tables();
  SourceRung out;
  for (std::size_t c = 0; c < 3; ++c) {
    const std::size_t pair = source.layout.pairs[c];
    out.coding.push_back(block_coding(c == 0 ? BlockKind::kLuma : BlockKind::kOther, quantisers[c],
                                      tables[2 * pair], tables[2 * pair + 1]));
    out.coding.back().bit_cost *= cost;
  }
  return out;
}

/// The file of the whole picture at a rung of the typical tables.
Bytes file_of(const Source& source, int quality, Bytes stream) {
  JpegKind kind;
  kind.quality = quality;
  const JpegCoder coder(kind);
  Bytes file = source_head(source.layout, coder.quantisers(), coder.tables(), kSide, kSide);
  file.resize(file.size() - 2);
  file.insert(file.end(), stream.begin() + 2, stream.end());
  return file;
}

TEST(RequantisedJpeg, ItsOwnQuantisersGiveTheSourcesCoefficients) {
  const Source source;
  RequantisedJpeg coder(source.coefficients, source.layout);
  Bytes stream;
  const SourceRung rung = rung_of(source, 85, 0);
  coder.append_bodies(source.window(), std::span(&rung, 1), std::span(&stream, 1));
  const JpegCoefficients again("again", file_of(source, 85, stream));
  for (std::size_t c = 0; c < 3; ++c)
    for (std::uint32_t y = 0; y < again.components()[c].blocks_down; ++y)
      for (std::uint32_t x = 0; x < again.components()[c].blocks_across; ++x)
        ASSERT_TRUE(
            std::equal(again.block(c, y, x), again.block(c, y, x) + 64, source.coefficients.block(c, y, x)));
}

TEST(RequantisedJpeg, CountsAreThoseOfTheStreams) {
  const Source source;
  RequantisedJpeg coder(source.coefficients, source.layout);
  const SourceRung rung = rung_of(source, 40, 1);
  SymbolCounts counts(4);
  ASSERT_TRUE(coder.count_symbols(source.window(), std::span(&rung, 1), std::span(&counts, 1)));
  Bytes stream;
  coder.append_bodies(source.window(), std::span(&rung, 1), std::span(&stream, 1));
  std::uint64_t bits = 0;
  for (std::size_t t = 0; t < 4; ++t)
    for (std::size_t s = 0; s < 256; ++s) {
      const BlockCoding& coding = rung.coding[t < 2 ? 0 : 1];
      bits += counts[t][s] * ((t % 2 ? coding.ac : coding.dc).bits[s] + (t % 2 ? s & 15 : s));
    }
  std::uint64_t stuffed = 0;
  for (std::size_t k = 2; k + 2 < stream.size(); ++k) stuffed += stream[k] == 0xff;
  EXPECT_EQ((bits + 7) / 8 + stuffed + 4, stream.size());
}

TEST(RequantisedJpeg, EstimatedBitsAreNearTheStreams) {
  const Source source;
  std::vector<QuantiserSet> sets;
  std::vector<double> bytes;
  const std::vector<BlockKind> kinds{BlockKind::kLuma, BlockKind::kOther, BlockKind::kOther};
  RequantisedJpeg coder(source.coefficients, source.layout);
  for (const int quality : {20, 40, 60}) {
    JpegKind kind;
    kind.quality = quality;
    sets.push_back({JpegCoder(kind).quantisers()});
    const SourceRung rung = rung_of(source, quality, 1);
    Bytes stream;
    coder.append_bodies(source.window(), std::span(&rung, 1), std::span(&stream, 1));
    bytes.push_back(static_cast<double>(stream.size()));
  }
  const PixelWindow window = source.window();
  const std::vector<double> bits =
      requantised_bits(source.coefficients, source.layout, kinds, std::span(&window, 1), sets, {});
  for (std::size_t k = 1; k < bits.size(); ++k)
    EXPECT_NEAR(bits[k] / bits[0], bytes[k] / bytes[0], 0.08 * bytes[k] / bytes[0]);
}

}  // namespace texmesh::requantised_jpeg_test
