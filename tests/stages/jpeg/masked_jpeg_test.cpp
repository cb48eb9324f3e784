#include "stages/jpeg/masked_jpeg.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "stages/base/run_context.h"
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/jpeg/jpeg.h"
#include "stages/jpeg/jpeg_stream.h"
#include "stages/ladder/ladder.h"
#include "tests/support/all_rungs.h"
#include "tests/support/meshes.h"

namespace texmesh::masked_jpeg_test {

using testing::Random;

constexpr std::uint32_t kWidth = 64, kHeight = 48;

struct Picture {
  Pixels pixels;
  std::vector<std::uint8_t> coverage;
  bool covered(std::uint32_t x, std::uint32_t y) const {
    return coverage[y * (kWidth / 8) + x / 8] >> (7 - x % 8) & 1;
  }
  PixelWindow window(bool masked) const {
    PixelWindow out{pixels.data.data(), std::size_t{kWidth} * pixels.channels, kWidth, kHeight};
    if (masked) out.coverage = {{coverage, kWidth, kHeight}, 0, 0};
    return out;
  }
};

/// A shaded, grainy disc; what lies around it is noise, which costs a lot.
Picture disc(std::uint32_t channels, double radius = 22) {
  Picture out{{kWidth, kHeight, channels, {}}, std::vector<std::uint8_t>(kWidth / 8 * kHeight)};
  Random random{5};
  for (std::uint32_t y = 0; y < kHeight; ++y)
    for (std::uint32_t x = 0; x < kWidth; ++x) {
      const double dx = x - 30.0, dy = y - 23.0;
      const bool inside = dx * dx + dy * dy < radius * radius;
      if (inside) out.coverage[y * (kWidth / 8) + x / 8] |= static_cast<std::uint8_t>(0x80 >> x % 8);
      for (std::uint32_t c = 0; c < channels; ++c)
        out.pixels.data.push_back(
            inside ? static_cast<std::uint8_t>(70 + 2 * x + y + 20 * c + random.next() % 14)
                   : static_cast<std::uint8_t>(random.next()));
    }
  return out;
}

struct Coded {
  std::vector<std::uint8_t> body;
  Pixels pixels;
};

Coded code(const Picture& picture, const JpegKind& kind, bool masked) {
  JpegCoder coder(kind);
  Coded out;
  if (masked) {
    const std::vector<MaskedRung> rungs{masked_rung(kind, coder.quantisers(), coder.tables())};
    MaskedJpeg jpeg(kind);
    std::vector<std::vector<std::uint8_t>> streams(1);
    jpeg.append_bodies(picture.window(true), rungs, streams);
    out.body = streams[0];
  } else {
    coder.append_body(picture.window(false), out.body);
  }
  const std::vector<std::uint8_t> head = coder.head_stream(kWidth, kHeight);
  out.pixels =
      decode_jpeg(join_fragment(Codec::kJpeg, head, std::span<const std::uint8_t>(out.body)), 1 << 20);
  return out;
}

double covered_error(const Picture& picture, const Pixels& decoded) {
  double sum = 0, count = 0;
  for (std::uint32_t y = 0; y < kHeight; ++y)
    for (std::uint32_t x = 0; x < kWidth; ++x)
      for (std::uint32_t c = 0; c < decoded.channels && picture.covered(x, y); ++c, ++count) {
        const int d = picture.pixels.at(x, y)[c] - decoded.at(x, y)[c];
        sum += d * d;
      }
  return sum / count;
}

std::vector<JpegKind> kinds(int quality) {
  return {{1, quality, Subsampling::k420},
          {3, quality, Subsampling::k420},
          {3, quality, Subsampling::k444},
          {3, quality, Subsampling::k420, true}};
}

TEST(MaskedJpeg, DecodesAndOnlyCoveredTexelsCostBytes) {
  for (const int quality : {1, 5, 30, 75, 97, 100})
    for (const JpegKind& kind : kinds(quality)) {
      const Picture picture = disc(kind.channels);
      const Coded plain = code(picture, kind, false), masked = code(picture, kind, true);
      EXPECT_LT(masked.body.size(), plain.body.size() * 3 / 4) << quality << " " << kind.channels;
      EXPECT_LT(covered_error(picture, masked.pixels), 1.25 * covered_error(picture, plain.pixels) + 1)
          << quality << " " << kind.channels << kind.rgb;
    }
}

TEST(MaskedJpeg, BlocksThatNobodySeesAreFlatAndTakeTwoCodes) {
  const JpegKind kind{1, 75, Subsampling::k420};
  Picture picture = disc(1, 0);
  picture.coverage[0] = 0x80;  // one texel
  const Coded coded = code(picture, kind, true);
  for (std::uint32_t y = 0; y < kHeight; ++y)
    for (std::uint32_t x = 8; x < kWidth; ++x)
      ASSERT_EQ(coded.pixels.at(x, y)[0], coded.pixels.at(x / 8 * 8, y / 8 * 8)[0]);
  EXPECT_NEAR(coded.pixels.at(0, 0)[0], picture.pixels.at(0, 0)[0], 12);
  // 47 blocks of at most 2 + 4 bits, if no DC moves; the first one has some more.
  EXPECT_LT(coded.body.size(), 47 * 6 / 8 + 20u);
}

/// Mean of a block of 8 x 8; how many of its texels are covered.
double block_mean(const Pixels& pixels, std::uint32_t left, std::uint32_t top) {
  double sum = 0;
  for (std::uint32_t k = 0; k < 64; ++k) sum += pixels.at(left + k % 8, top + k / 8)[0];
  return sum / 64;
}
int covered_in_block(const Picture& picture, std::uint32_t left, std::uint32_t top) {
  int count = 0;
  for (std::uint32_t k = 0; k < 64; ++k) count += picture.covered(left + k % 8, top + k / 8);
  return count;
}

// Mips that a client makes of decoded fragments show uncovered texels, too.
TEST(MaskedJpeg, BlocksCoveredInPartKeepTheirMean) {
  for (const int quality : {53, 97}) {
    Picture picture = disc(1);
    for (std::uint32_t y = 0; y < kHeight; ++y)
      for (std::uint32_t x = 0; x < kWidth; ++x)
        if (!picture.covered(x, y))
          picture.pixels.data[y * kWidth + x] = static_cast<std::uint8_t>(60 + 2 * x + y);
    const Coded coded = code(picture, {1, quality, Subsampling::k420}, true);
    double squares = 0, blocks = 0;
    for (std::uint32_t y = 0; y < kHeight; y += 8)
      for (std::uint32_t x = 0; x < kWidth; x += 8)
        if (const int covered = covered_in_block(picture, x, y); covered > 0 && covered < 64) {
          const double off = block_mean(coded.pixels, x, y) - block_mean(picture.pixels, x, y);
          squares += off * off;
          ++blocks;
        }
    ASSERT_GT(blocks, 10);
    EXPECT_LT(std::sqrt(squares / blocks), quality == 53 ? 4 : 2.5) << quality;  // 9.2 and 7.3 without
  }
}

TEST(MaskedJpeg, CountsTheSymbolsThatItWrites) {
  for (const JpegKind& kind : kinds(60)) {
    const Picture picture = disc(kind.channels);
    JpegCoder coder(kind);
    const MaskedRung rung = masked_rung(kind, coder.quantisers(), coder.tables());
    MaskedJpeg jpeg(kind);
    SymbolCounts ours(coder.tables().size()), theirs(coder.tables().size());
    jpeg.count_symbols(picture.window(true), std::span(&rung, 1), std::span(&ours, 1));
    std::vector<std::vector<std::uint8_t>> streams(1);
    jpeg.append_bodies(picture.window(true), std::span(&rung, 1), streams);
    std::vector<std::uint8_t> mcu{0};
    if (kind.channels == 3 && kind.rgb) mcu = {0, 0, 1};
    if (kind.channels == 3 && !kind.rgb && kind.subsampling == Subsampling::k444) mcu = {0, 1, 1};
    if (kind.channels == 3 && !kind.rgb && kind.subsampling == Subsampling::k420) mcu = {0, 0, 0, 0, 1, 1};
    const std::size_t side = mcu.size() == 6 ? 16 : 8;
    count_symbols(std::span(streams[0]).subspan(2, streams[0].size() - 4), mcu,
                  kWidth / side * (kHeight / side) * mcu.size(), coder.tables(), theirs);
    EXPECT_EQ(ours, theirs);
  }
}

BlockCoding coding_without_rate(float quantiser) {
  BlockCoding out;
  out.quantisers.fill(quantiser);
  out.dc.bits.fill(4);
  out.ac.bits.fill(4);
  return out;
}

BlockValues random_values(Random& random, float scale) {
  BlockValues out;
  for (float& v : out) v = (static_cast<float>(random.next() % 2001) / 1000 - 1) * scale;
  return out;
}

TEST(MaskedBlock, WithoutAMaskAndARateItIsPlainQuantisation) {
  Random random{3};
  for (int n = 0; n < 20; ++n) {
    const BlockValues samples = random_values(random, 100);
    BlockValues weights;
    weights.fill(1);
    const BlockCoding coding = coding_without_rate(9);
    MaskedBlock block;
    block.load(samples, weights);
    const CodedBlock ours = block.quantise(coding, 0), plain = quantise_whole(block_dct(samples), coding);
    for (std::size_t k = 0; k < 64; ++k) {
      const float exact = block_dct(samples)[kNaturalOfZigzag[k]] / 9;
      EXPECT_LE(std::fabs(static_cast<float>(plain.values[k]) - exact), 0.501f);
      EXPECT_EQ(plain.used >> k & 1, plain.values[k] != 0);
      EXPECT_EQ(ours.used >> k & 1, ours.values[k] != 0);
      if (std::fabs(exact - std::floor(exact) - 0.5f) > 1e-2f)
        EXPECT_EQ(ours.values[k], plain.values[k]) << k;
    }
  }
}

/// Weighted squared error of what the coefficients decode to, by the definition of the DCT.
double error_of(const CodedBlock& block, const BlockCoding& coding, const BlockValues& samples,
                const BlockValues& weights) {
  double sum = 0;
  for (std::size_t y = 0; y < 8; ++y)
    for (std::size_t x = 0; x < 8; ++x) {
      double value = 0;
      for (std::size_t k = 0; k < 64; ++k) {
        const std::size_t u = kNaturalOfZigzag[k] % 8, v = kNaturalOfZigzag[k] / 8;
        value += block.values[k] * static_cast<double>(coding.quantisers[kNaturalOfZigzag[k]]) *
                 (u ? 0.5 : std::sqrt(0.125)) * (v ? 0.5 : std::sqrt(0.125)) *
                 std::cos((2.0 * x + 1) * u * M_PI / 16) * std::cos((2.0 * y + 1) * v * M_PI / 16);
      }
      const double d = value - samples[y * 8 + x];
      sum += weights[y * 8 + x] * d * d;
    }
  return sum;
}

TEST(MaskedBlock, NoSingleStepMakesItBetter) {
  Random random{11};
  for (int n = 0; n < 10; ++n) {
    const BlockValues samples = random_values(random, 60);
    BlockValues weights{};
    for (float& w : weights) w = random.next() % 3 == 0 ? 1.0f : 0.003f;
    const BlockCoding coding = coding_without_rate(12);
    MaskedBlock block;
    block.load(samples, weights);
    CodedBlock found = block.quantise(coding, 0);
    const double least = error_of(found, coding, samples, weights);
    EXPECT_LT(least, error_of({}, coding, samples, weights) / 8);
    for (std::size_t k = 0; k < 64; ++k)
      for (const int step : {-1, 1}) {
        found.values[k] = static_cast<std::int16_t>(found.values[k] + step);
        EXPECT_GT(error_of(found, coding, samples, weights), least - 0.05) << k;
        found.values[k] = static_cast<std::int16_t>(found.values[k] - step);
      }
  }
}

TEST(MaskedBlock, NeverTakesASymbolWithoutACode) {
  Random random{17};
  const BlockValues samples = random_values(random, 127);
  BlockValues weights{};
  for (std::size_t k = 0; k < 64; k += 3) weights[k] = 1;
  BlockCoding coding = coding_without_rate(1);
  coding.bit_cost = 0.1f;
  for (std::size_t s = 0; s < 256; ++s)
    if ((s & 15u) > 5) coding.ac.bits[s] = 0;  // no coefficient above 31
  MaskedBlock block;
  block.load(samples, weights);
  // The second time starts at the first one's values; then from ones that have no code.
  for (const float finer : {1.0f, 1.0f, 0.25f}) {
    for (float& q : coding.quantisers) q *= finer;
    const CodedBlock found = block.quantise(coding, 0);
    EXPECT_GE(std::ranges::count_if(found.values, [](int v) { return v != 0; }), 2);
    for (std::size_t k = 1; k < 64; ++k) EXPECT_LE(std::abs(found.values[k]), 31);
  }
}

/// Bits of the AC coefficients with coding_without_rate().
int ac_bits(const CodedBlock& block) {
  int bits = 0, zeros = 0;
  for (std::size_t k = 1; k < 64; ++k) {
    if (block.values[k] == 0) {
      ++zeros;
      continue;
    }
    for (; zeros > 15; zeros -= 16) bits += 4;
    bits += 4 + static_cast<int>(std::bit_width(static_cast<unsigned>(std::abs(block.values[k]))));
    zeros = 0;
  }
  return bits + (zeros > 0 ? 4 : 0);
}

TEST(MaskedBlock, RungsThatStartAtTheOneBeforeCostNoMoreThanOnesThatStartAtNothing) {
  Random random{29};
  double next_cost = 0, fresh_cost = 0;
  for (int n = 0; n < 40; ++n) {
    const BlockValues samples = random_values(random, 90);
    BlockValues weights{};
    for (float& w : weights) w = random.next() % 2 == 0 ? 1.0f : 0.003f;
    MaskedBlock ladder;
    ladder.load(samples, weights);
    for (const float quantiser : {80.0f, 40.0f, 20.0f, 10.0f, 5.0f}) {
      BlockCoding coding = coding_without_rate(quantiser);
      coding.bit_cost = 0.09f * quantiser * quantiser;
      MaskedBlock alone;
      alone.load(samples, weights);
      const auto cost = [&](const CodedBlock& block) {
        return error_of(block, coding, samples, weights) / coding.bit_cost + ac_bits(block);
      };
      next_cost += cost(ladder.quantise(coding, 0));
      fresh_cost += cost(alone.quantise(coding, 0));
    }
  }
  EXPECT_LT(next_cost, 1.03 * fresh_cost);
}

TEST(BlockGram, HoldsTheWeightedProductsOfTheBasis) {
  Random random{31};
  BlockValues weights;
  for (float& w : weights) w = static_cast<float>(random.next() % 1000) / 1000;
  BlockGram gram;
  gram.set_weights(weights, 0);
  for (std::size_t k = 0; k < 64; k += 5) {
    BlockValues unit{};
    unit[k] = 1;
    BlockValues shown = block_inverse_dct(unit);
    for (std::size_t n = 0; n < 64; ++n) shown[n] *= weights[n];
    const BlockValues wanted = block_dct(shown);
    EXPECT_NEAR(gram.diagonal()[k], wanted[k], 1e-5);
    for (std::size_t n = 0; n < 64; ++n) EXPECT_NEAR(gram.column(k)[n], wanted[n], 1e-5) << k << " " << n;
  }
}

/// Two fragments, of which the first is covered wholly.
struct Scene {
  Fragments fragments;
  std::vector<Pixels> pixels;
};

Scene scene() {
  Scene out;
  TexturePlane plane;
  plane.channels = 3;
  plane.columns = 2, plane.rows = 1;
  plane.fragment_width_px = plane.fragment_height_px = 64;
  plane.width_px = 120, plane.height_px = 64;  // 8 columns are padding
  plane.coverage.assign(15 * 64, 0xff);
  for (std::size_t y = 0; y < 64; ++y)
    for (std::size_t byte = 10 + y / 16; byte < 15; ++byte) plane.coverage[y * 15 + byte] = 0;
  plane.covered_texels = {4096, 1500};
  Pixels pixels{128, 64, 3, {}};
  Random random{23};
  for (std::uint32_t k = 0; k < 128 * 64 * 3; ++k)
    pixels.data.push_back(static_cast<std::uint8_t>(80 + k % 128 / 3 + random.next() % 30));
  out.fragments.planes.push_back(plane);
  out.pixels.push_back(pixels);
  return out;
}

Ladder ladder_of(const Scene& s, Uncovered uncovered, int threads = 1) {
  LadderOptions options = testing::all_rungs();
  options.uncovered = uncovered;
  RunContext context;
  context.threads = threads;
  return encode_ladder(s.fragments, s.pixels, {}, {}, options, context);
}

std::vector<std::uint8_t> stream(const LadderRung& rung, std::size_t f) {
  const auto bytes = fragment_stream(rung, f);
  return {bytes.begin(), bytes.end()};
}

TEST(MaskedLadder, WhollyCoveredPlanesAndKeptTexelsAreCodedAsWithoutCoverage) {
  Scene part = scene(), none = scene(), all = scene();
  none.fragments.planes[0].coverage.clear();
  all.fragments.planes[0].width_px = 128;
  all.fragments.planes[0].coverage.assign(16 * 64, 0xff);
  const Ladder plain = ladder_of(none, Uncovered::kFree), kept = ladder_of(part, Uncovered::kKept),
               whole = ladder_of(all, Uncovered::kFree), free = ladder_of(part, Uncovered::kFree);
  std::size_t less = 0;
  for (std::size_t r = 0; r < plain.planes[0].rungs.size(); ++r) {
    EXPECT_EQ(kept.planes[0].rungs[r].data, plain.planes[0].rungs[r].data);
    EXPECT_EQ(whole.planes[0].rungs[r].data, plain.planes[0].rungs[r].data);
    const Pixels a = decode_fragment(plain.planes[0], r, 0, 4096),
                 b = decode_fragment(free.planes[0], r, 0, 4096);
    EXPECT_EQ(a.data, b.data);  // covered wholly: other tables, the same coefficients
    less += 2 * stream(free.planes[0].rungs[r], 1).size() < stream(plain.planes[0].rungs[r], 1).size();
  }
  EXPECT_GE(less, 5u);  // half of the rungs
}

TEST(MaskedLadder, IsTheSameForAnyThreadCount) {
  const Ladder one = ladder_of(scene(), Uncovered::kFree), eight = ladder_of(scene(), Uncovered::kFree, 8);
  for (std::size_t r = 0; r < one.planes[0].rungs.size(); ++r) {
    EXPECT_EQ(one.planes[0].rungs[r].table_stream, eight.planes[0].rungs[r].table_stream);
    EXPECT_EQ(one.planes[0].rungs[r].data, eight.planes[0].rungs[r].data);
  }
}

}  // namespace texmesh::masked_jpeg_test
