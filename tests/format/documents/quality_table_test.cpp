#include "format/documents/quality_table.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "tests/format/documents/tables_fixture.h"

namespace texmesh::quality_table_test {

PictureLosses losses(std::vector<float> flip) { return {flip, flip, flip}; }

/// Two displayed heights, three scales, colours and other numbers.
QualityTable make_table() {
  QualityTable t{6, {64, 256}, {0, 4, 9}, {}, {}, 1.5f, 0.0625f};
  t.geometry = {losses({0, 0.1f, 0.2f}), losses({0, 0.125f, 0.3f})};
  const TextureLosses small{
      {0.01f, 0.1f}, losses({0.02f, 0.07f}), losses({0.06f}), losses({0.02f, 0.01f, 0}), losses({0.05f})};
  const TextureLosses large{
      {0.02f, 0.2f}, losses({0.03f, 0.09f}), losses({0.08f}), losses({0.0625f}), losses({})};
  t.groups = {{PlaneGroup::kColour, {small, large}}, {PlaneGroup::kData, {large, small}}};
  return t;
}

std::span<const std::uint8_t> bytes_of(const std::string& s) {
  return std::span(reinterpret_cast<const std::uint8_t*>(s.data()), s.size());
}

TEST(Quality, RoundTripAndTruncation) {
  const QualityTable t = make_table();
  const std::string json = write_quality(t);
  EXPECT_EQ(read_quality(bytes_of(json)), t);
  for (std::size_t n = 0; n < json.size(); ++n)
    EXPECT_THROW(read_quality(bytes_of(json).first(n)), FormatError);
  for (std::size_t i = 0; i < json.size(); ++i)
    for (int bit = 0; bit < 8; ++bit) {
      std::string damaged = json;
      damaged[i] = static_cast<char>(damaged[i] ^ (1 << bit));
      try {
        write_quality(read_quality(bytes_of(damaged)));
      } catch (const FormatError&) {
      }
    }
}

TEST(Quality, RefusesWhatBreaksARule) {
  const auto refused = [](auto change) {
    QualityTable bad = make_table();
    change(bad);
    EXPECT_THROW(write_quality(bad), FormatError);
  };
  refused([](QualityTable& q) { q.geometry.pop_back(); });
  refused([](QualityTable& q) { q.geometry[1].flip.pop_back(); });
  refused([](QualityTable& q) { q.geometry[0].flip_p95[2] = 1.5f; });
  refused([](QualityTable& q) { q.geometry[0].dssim.push_back(0); });
  refused([](QualityTable& q) { q.scales = {0, 9, 4}; });
  refused([](QualityTable& q) { q.sizes_px = {256, 64}; });
  refused([](QualityTable& q) { q.views = 0; });
  refused([](QualityTable& q) { q.exponent = 0.5f; });
  refused([](QualityTable& q) { q.error = -1; });
  refused([](QualityTable& q) { q.groups[0].sizes.pop_back(); });
  refused([](QualityTable& q) { q.groups[1].group = PlaneGroup::kColour; });
  refused([](QualityTable& q) { q.groups[0].sizes[0].texel_dssim = {0.1f, 0.1f}; });
  refused([](QualityTable& q) { q.groups[0].sizes[0].texel_dssim = {0, 0.1f}; });
  refused([](QualityTable& q) { q.groups[0].sizes[0].preview.flip.clear(); });
  refused([](QualityTable& q) { q.groups[0].sizes[0].preview = losses({0.1f, 0.2f}); });
  refused([](QualityTable& q) { q.groups[0].sizes[1].coded.flip.push_back(0.5f); });
}

TEST(Quality, GroupsOfRoles) {
  for (const char* role : {"base-colour", "emissive", "alpha", "colour"})
    EXPECT_EQ(group_of(role), PlaneGroup::kColour) << role;
  EXPECT_EQ(group_of("normal"), PlaneGroup::kNormal);
  for (const char* role : {"occlusion-roughness-metallic", "data"})
    EXPECT_EQ(group_of(role), PlaneGroup::kData) << role;
}

TEST(Quality, FloatsSurviveTheirDecimalForm) {
  QualityTable t = make_table();
  TextureLosses& losses = t.groups[0].sizes[0];
  losses.texel_dssim.clear();
  losses.coded = {};
  std::uint32_t bits = 1;
  for (int k = 1; k <= 100; ++k) {
    losses.texel_dssim.push_back(0.0123f * static_cast<float>(k));
    bits = bits * 1664525u + 1013904223u;
    losses.coded.flip.push_back(std::ldexp(static_cast<float>(bits >> 8), -24 - k % 30));
    losses.coded.flip_p95.push_back(std::nextafter(1.0f, 0.0f));
    losses.coded.dssim.push_back(std::ldexp(static_cast<float>(bits >> 8), -30));
  }
  EXPECT_EQ(read_quality(bytes_of(write_quality(t))), t);
}

}  // namespace texmesh::quality_table_test
