#include "format/documents/quality_table.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "tests/format/documents/tables_fixture.h"

namespace texmesh {
namespace {

TEST(Quality, RoundTripTruncationAndRules) {
  QualityTable t{{0, 4, 9}, {5, 30}, {}, {}, 6, 256};
  for (int k = 0; k < 6; ++k) {
    t.ssim.push_back(1 / (1.1f + static_cast<float>(k)));
    t.difference.push_back(static_cast<float>(k) / 7);
  }
  const std::string json = write_quality(t);
  const auto bytes = [](const std::string& s) {
    return std::span(reinterpret_cast<const std::uint8_t*>(s.data()), s.size());
  };
  EXPECT_EQ(read_quality(bytes(json)), t);
  for (std::size_t n = 0; n < json.size(); ++n) EXPECT_THROW(read_quality(bytes(json).first(n)), FormatError);
  for (std::size_t i = 0; i < json.size(); ++i)
    for (int bit = 0; bit < 8; ++bit) {
      std::string damaged = json;
      damaged[i] = static_cast<char>(damaged[i] ^ (1 << bit));
      try {
        write_quality(read_quality(bytes(damaged)));
      } catch (const FormatError&) {
      }
    }
  const auto refused = [&](auto change) {
    QualityTable bad = t;
    change(bad);
    EXPECT_THROW(write_quality(bad), FormatError);
  };
  refused([](QualityTable& q) { q.ssim.pop_back(); });
  refused([](QualityTable& q) { q.difference[2] = 1.5f; });
  refused([](QualityTable& q) { q.scales = {0, 9, 4}; });
  refused([](QualityTable& q) { q.rungs = {0, 30}; });
  refused([](QualityTable& q) { q.views = 0; });
}

TEST(Quality, FloatsSurviveTheirDecimalForm) {
  QualityTable t{{0}, {}, {}, {}, 1, 16};
  std::uint32_t bits = 1;
  for (int k = 1; k <= 100; ++k) {
    t.rungs.push_back(k);
    bits = bits * 1664525u + 1013904223u;
    t.ssim.push_back(std::ldexp(static_cast<float>(bits >> 8), -24 - k % 30));
    t.difference.push_back(std::nextafter(1.0f, 0.0f));
  }
  const std::string json = write_quality(t);
  EXPECT_EQ(read_quality(std::span(reinterpret_cast<const std::uint8_t*>(json.data()), json.size())), t);
}

}  // namespace
}  // namespace texmesh
