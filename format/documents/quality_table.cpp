#include "format/documents/quality_table.h"

#include <nlohmann/json.hpp>

#include "format/base/json_fields.h"
#include "format/container/layout.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

const std::string kQualityFile = kQualityPath;
constexpr std::uint64_t kMaxQualityBytes = 4u << 20;

Json floats_json(const std::vector<float>& values) {
  Json j = Json::array();
  for (const float v : values) j.push_back(shortest_double(v));
  return j;
}

std::vector<float> read_fractions(const JsonAt& at, std::size_t count) {
  at.array(count, count);
  std::vector<float> values;
  for (std::size_t i = 0; i < count; ++i) values.push_back(static_cast<float>(at[i].number(0, 1)));
  return values;
}

std::vector<int> read_rising(const JsonAt& at, std::uint64_t lo, std::uint64_t hi) {
  std::vector<int> values;
  for (std::size_t i = 0, n = at.array(1, 100); i < n; ++i) {
    const int v = static_cast<int>(at[i].integer(lo, hi));
    if (i > 0 && v <= values.back()) at[i].fail("a rising number", std::to_string(v));
    values.push_back(v);
  }
  return values;
}

}  // namespace

std::string write_quality(const QualityTable& table) {
  Json j;
  j["views"] = table.views;
  j["sizePx"] = table.size_px;
  j["scales"] = table.scales;
  j["rungs"] = table.rungs;
  j["ssim"] = floats_json(table.ssim);
  j["difference"] = floats_json(table.difference);
  std::string json = dump_json(j, kQualityFile);
  read_quality(std::span(reinterpret_cast<const std::uint8_t*>(json.data()), json.size()));
  return json;
}

QualityTable read_quality(std::span<const std::uint8_t> json) {
  const nlohmann::json document = parse_json(json, kQualityFile, kMaxQualityBytes);
  const JsonAt at(document, kQualityFile);
  QualityTable table;
  table.views = static_cast<std::uint32_t>(at["views"].integer(1, 10000));
  table.size_px = static_cast<std::uint32_t>(at["sizePx"].integer(1, 65536));
  table.scales = read_rising(at["scales"], 0, 99);
  table.rungs = read_rising(at["rungs"], 1, 100);
  const std::size_t count = table.scales.size() * table.rungs.size();
  table.ssim = read_fractions(at["ssim"], count);
  table.difference = read_fractions(at["difference"], count);
  return table;
}

}  // namespace texmesh
