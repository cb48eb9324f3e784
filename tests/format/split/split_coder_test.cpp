#include "format/split/split_element_codec.h"

#include <gtest/gtest.h>

#include <cmath>

namespace texmesh::split_coder_test {

struct Random {
  std::uint64_t state;
  std::uint32_t below(std::uint32_t n) {
    state = state * 6364136223846793005ull + 1442695040888963407ull;
    return static_cast<std::uint32_t>((state >> 33) % n);
  }
};

TEST(BitCoder, GivesBackWhatWentInAtTheCostOfItsEntropy) {
  for (const std::uint32_t ones : {0u, 1u, 30u, 500u, 999u, 1000u}) {
    Random random{ones};
    std::vector<bool> bits;
    for (int i = 0; i < 20000; ++i) bits.push_back(random.below(1000) < ones);
    BitEncoder encoder;
    BitModel model;
    for (const bool b : bits) encoder.encode(model, b, 200);
    const std::vector<std::uint8_t> bytes = encoder.finish();
    BitDecoder decoder(bytes);
    BitModel again;
    for (const bool b : bits) ASSERT_EQ(decoder.decode(again, 200), b);
    const double p = ones / 1000.0;
    const double entropy = p > 0 && p < 1 ? -p * std::log2(p) - (1 - p) * std::log2(1 - p) : 0;
    EXPECT_LE(static_cast<double>(bytes.size()), 20000 * (entropy * 1.02 + 0.004) / 8 + 16) << ones;
  }
}

TEST(BitCoder, CarriesRunThroughHeldBytes) {
  // Unlikely ones after long likely runs drive `low` towards a carry; every length ends the code elsewhere.
  for (int length = 0; length < 300; ++length) {
    Random random{static_cast<std::uint64_t>(length)};
    std::vector<std::uint32_t> values;
    BitEncoder encoder;
    BitModel model;
    for (int i = 0; i < length; ++i) {
      values.push_back(random.below(8) == 0 ? random.below(1u << 20) : (1u << 20) - 1);
      encoder.encode(model, values.back() & 1, 60);
      encoder.encode_raw(values.back(), 20);
    }
    const std::vector<std::uint8_t> bytes = encoder.finish();
    EXPECT_TRUE(bytes.empty() || bytes.back() != 0);
    BitDecoder decoder(bytes);
    BitModel again;
    for (const std::uint32_t v : values) {
      ASSERT_EQ(decoder.decode(again, 60), (v & 1) != 0);
      ASSERT_EQ(decoder.decode_raw(20), v);
    }
  }
}

TEST(BitCoder, AnEncoderCanBeUsedAgain) {
  BitEncoder encoder;
  encoder.encode_raw(0xabcd, 16);
  const auto first = encoder.finish();
  encoder.encode_raw(0xabcd, 16);
  EXPECT_EQ(encoder.finish(), first);
  EXPECT_TRUE(encoder.finish().empty());
}

struct Encoding {
  BitEncoder encoder;
  bool bit(BitModel& m, bool v) {
    encoder.encode(m, v, ValueModels::kValueLimit);
    return v;
  }
  std::uint32_t raw(std::uint32_t v, int n) {
    encoder.encode_raw(v, n);
    return v;
  }
};
struct Decoding {
  BitDecoder decoder;
  bool bit(BitModel& m, bool) { return decoder.decode(m, ValueModels::kValueLimit); }
  std::uint32_t raw(std::uint32_t, int n) { return decoder.decode_raw(n); }
};

TEST(ResidualCodec, ResidualsOfEveryLengthSurvive) {
  std::vector<std::int32_t> residuals{0, 1, -1, 2, -2, 3};
  for (int bits = 2; bits <= 24; ++bits)
    for (const std::int32_t r : {(1 << bits) - 1, 1 << bits, -(1 << bits)})
      residuals.push_back(r), residuals.push_back(0);
  for (const int mean : {0, 7, 160, 510}) {
    Encoding out;
    ResidualCodec codec;
    codec.start(mean);
    for (std::size_t i = 0; i < residuals.size(); ++i) {
      codec.residual(out, static_cast<int>(i % 3), residuals[i]);
      codec.same(out, i % 5 == 0);
    }
    const auto bytes = out.encoder.finish();
    Decoding in{BitDecoder(bytes)};
    ResidualCodec again;
    again.start(mean);
    for (std::size_t i = 0; i < residuals.size(); ++i) {
      ASSERT_EQ(again.residual(in, static_cast<int>(i % 3), 0), residuals[i]) << mean;
      ASSERT_EQ(again.same(in, false), i % 5 == 0);
    }
  }
}

TEST(ResidualCodec, AnyBytesDecodeToResidualsOfBoundedLength) {
  Random random{5};
  for (int round = 0; round < 50; ++round) {
    std::vector<std::uint8_t> bytes(200);
    for (auto& b : bytes)
      b = static_cast<std::uint8_t>(random.below(round % 2 ? 256 : 2) * (round % 3 ? 1 : 127));
    Decoding in{BitDecoder(bytes)};
    ResidualCodec codec;
    codec.start(static_cast<int>(random.below(512)));
    for (int i = 0; i < 300; ++i)
      ASSERT_LE(residual_length(codec.residual(in, i % 4, 0)), ResidualCodec::kLongest);
  }
}

}  // namespace texmesh::split_coder_test
