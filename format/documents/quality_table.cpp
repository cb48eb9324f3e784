#include "format/documents/quality_table.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "format/base/json_fields.h"
#include "format/base/text_bytes.h"
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

Json losses_json(const PictureLosses& losses) {
  return {{"flip", floats_json(losses.flip)},
          {"flipP95", floats_json(losses.flip_p95)},
          {"dssim", floats_json(losses.dssim)}};
}

Json group_json(const GroupLosses& group) {
  Json sizes = Json::array();
  for (const TextureLosses& t : group.sizes)
    sizes.push_back({{"texelDssim", floats_json(t.texel_dssim)},
                     {"coded", losses_json(t.coded)},
                     {"preview", losses_json(t.preview)},
                     {"finer", losses_json(t.finer)},
                     {"coarser", losses_json(t.coarser)}});
  return {{"group", enum_name(group.group)}, {"sizes", std::move(sizes)}};
}

std::vector<float> read_fractions(const JsonAt& at, std::size_t count) {
  at.array(count, count);
  std::vector<float> values;
  for (std::size_t i = 0; i < count; ++i) values.push_back(static_cast<float>(at[i].number(0, 1)));
  return values;
}

template <class T>
std::vector<T> read_rising(const JsonAt& at, std::size_t most, std::uint64_t lo, std::uint64_t hi) {
  std::vector<T> values;
  for (std::size_t i = 0, n = at.array(1, most); i < n; ++i) {
    const T v = static_cast<T>(at[i].integer(lo, hi));
    if (i > 0 && v <= values.back()) at[i].fail("a rising number", std::to_string(v));
    values.push_back(v);
  }
  return values;
}

PictureLosses read_losses(const JsonAt& at, std::size_t count) {
  return {read_fractions(at["flip"], count), read_fractions(at["flipP95"], count),
          read_fractions(at["dssim"], count)};
}

TextureLosses read_texture_losses(const JsonAt& at) {
  TextureLosses t;
  const JsonAt dssim = at["texelDssim"];
  for (std::size_t i = 0, n = dssim.array(1, kMaxQualitySamples); i < n; ++i) {
    const auto v = static_cast<float>(dssim[i].number(0, 2));
    if (!(v > (i > 0 ? t.texel_dssim.back() : 0)))
      dssim[i].fail("a rising number above 0", std::to_string(v));
    t.texel_dssim.push_back(v);
  }
  t.coded = read_losses(at["coded"], t.texel_dssim.size());
  t.preview = read_losses(at["preview"], 1);
  t.finer = read_losses(at["finer"], at["finer"]["flip"].array(1, kMaxFinerLevels + 1));
  t.coarser = read_losses(at["coarser"], at["coarser"]["flip"].array(0, kMaxCoarserLevels));
  return t;
}

GroupLosses read_group(const JsonAt& at, std::size_t sizes) {
  GroupLosses group;
  const std::string name = at["group"].text(20);
  const auto& names = EnumNames<PlaneGroup>::names;
  const auto found = std::ranges::find(names, name);
  if (found == names.end()) at["group"].by("W06").fail("colour, normal or data", name);
  group.group = static_cast<PlaneGroup>(found - names.begin());
  at["sizes"].array(sizes, sizes);
  for (std::size_t i = 0; i < sizes; ++i) group.sizes.push_back(read_texture_losses(at["sizes"][i]));
  return group;
}

}  // namespace

PlaneGroup group_of(std::string_view role) {
  if (role == "normal") return PlaneGroup::kNormal;
  return role == "data" || role == "occlusion-roughness-metallic" ? PlaneGroup::kData : PlaneGroup::kColour;
}

std::string write_quality(const QualityTable& table) {
  Json j;
  j["views"] = table.views;
  j["sizesPx"] = table.sizes_px;
  j["exponent"] = shortest_double(table.exponent);
  j["error"] = shortest_double(table.error);
  j["scales"] = table.scales;
  j["geometry"] = Json::array();
  for (const PictureLosses& losses : table.geometry) j["geometry"].push_back(losses_json(losses));
  j["groups"] = Json::array();
  for (const GroupLosses& group : table.groups) j["groups"].push_back(group_json(group));
  std::string json = dump_json(j, kQualityFile);
  read_quality(text_bytes(json));
  return json;
}

QualityTable read_quality(std::span<const std::uint8_t> json) {
  const nlohmann::json document = parse_json(json, kQualityFile, kMaxQualityBytes);
  const JsonAt at = JsonAt(document, kQualityFile).by("Q01");
  QualityTable table;
  table.views = static_cast<std::uint32_t>(at["views"].integer(1, 10000));
  table.sizes_px = read_rising<std::uint32_t>(at["sizesPx"], kMaxQualitySizes, 1, 65536);
  table.exponent = static_cast<float>(at["exponent"].number(1, 4));
  table.error = static_cast<float>(at["error"].number(0, 1e6));
  table.scales = read_rising<int>(at["scales"], 100, 0, 99);
  const std::size_t sizes = table.sizes_px.size();
  at["geometry"].array(sizes, sizes);
  for (std::size_t i = 0; i < sizes; ++i)
    table.geometry.push_back(read_losses(at["geometry"][i], table.scales.size()));
  for (std::size_t i = 0, n = at["groups"].array(0, kPlaneGroups); i < n; ++i) {
    table.groups.push_back(read_group(at["groups"][i], sizes));
    if (i > 0 && table.groups[i].group <= table.groups[i - 1].group)
      at["groups"][i]["group"].by("Q03").fail("groups in the order colour, normal, data",
                                              std::string(enum_name(table.groups[i].group)));
  }
  return table;
}

}  // namespace texmesh
