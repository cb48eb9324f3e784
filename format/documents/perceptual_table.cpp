#include "format/documents/perceptual_table.h"

#include <string>

#include "format/base/rule_error.h"
#include "format/container/layout.h"

namespace texmesh {
namespace {

constexpr float kMostPerceptualValue = 1e30f;
constexpr std::size_t kBytesOfRow = 1 + 4 + 4 + 4 * 4, kBytesOfPair = 4 * 4;

using Values = std::vector<float> PerceptualTable::*;
constexpr std::array<Values, 4> kStepValues{&PerceptualTable::average, &PerceptualTable::largest,
                                            &PerceptualTable::least, &PerceptualTable::deviation};
constexpr std::array<Values, 4> kPairValues{&PerceptualTable::p95, &PerceptualTable::chain_average,
                                            &PerceptualTable::chain_largest, &PerceptualTable::chain_least};

[[noreturn]] void fail_perceptual(const std::string& expected, const std::string& found) {
  throw RuleError("O05", kThesisPath, "perceptual table", expected, found);
}

void check_perceptual_table(const PerceptualTable& t) {
  const std::size_t rows = t.scale.size();
  if (rows == 0 || rows > kMostChainScales || t.triangles.size() != rows || t.collapses.size() != rows)
    fail_perceptual("1 to 100 scales", std::to_string(rows));
  for (std::size_t k = 0; k < rows; ++k)
    if (k == 0 ? t.scale[0] != 0 || t.collapses[0] != 0 : t.scale[k] <= t.scale[k - 1])
      fail_perceptual("scale numbers rising from 0", std::to_string(t.scale[k]));
  if (t.scale.back() >= kMostChainScales) fail_perceptual("scale numbers below 100", "more");
  const auto require = [](const std::vector<float>& values, std::size_t count) {
    if (values.size() != count) fail_perceptual(std::to_string(count), std::to_string(values.size()));
    for (const float v : values)
      if (!(v >= 0 && v <= kMostPerceptualValue)) fail_perceptual("0 to 1e30", std::to_string(v));
  };
  for (const Values step : kStepValues) require(t.*step, rows);
  for (const Values pair : kPairValues) require(t.*pair, pair_count(rows));
}

}  // namespace

Bytes write_perceptual_section(const PerceptualTable& t) {
  check_perceptual_table(t);
  BytesOut out;
  out.u8(t.scale.size());
  out.u8(0);
  out.u16(0);
  out.raw(t.scale);
  for (const std::uint32_t v : t.triangles) out.u32(v);
  for (const std::uint32_t v : t.collapses) out.u32(v);
  for (const auto& group : {kStepValues, kPairValues})
    for (const Values values : group)
      for (const float v : t.*values) out.f32(v);
  return out.finish();
}

PerceptualTable read_perceptual_section(BytesIn& in, bool reserved_is_zero) {
  PerceptualTable t;
  const std::size_t rows = in.u8(), pairs = pair_count(rows);
  if (in.number(3) != 0 && reserved_is_zero) fail_by("W05", in, "3 zero bytes", "others");
  if (rows == 0 || rows > kMostChainScales || in.left() < rows * kBytesOfRow + pairs * kBytesOfPair)
    in.fail("a table of 1 to 100 scales", std::to_string(rows));
  const ByteSpan scale = in.raw(rows);
  t.scale.assign(scale.begin(), scale.end());
  for (std::size_t k = 0; k < rows; ++k) t.triangles.push_back(in.u32());
  for (std::size_t k = 0; k < rows; ++k) t.collapses.push_back(in.u32());
  for (const Values values : kStepValues)
    for (std::size_t k = 0; k < rows; ++k) (t.*values).push_back(in.f32());
  for (const Values values : kPairValues)
    for (std::size_t k = 0; k < pairs; ++k) (t.*values).push_back(in.f32());
  check_perceptual_table(t);
  return t;
}

}  // namespace texmesh
