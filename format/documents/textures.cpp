#include "format/documents/textures.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "format/base/errors.h"
#include "format/base/json_fields.h"
#include "format/base/text_bytes.h"
#include "format/container/layout.h"
#include "format/documents/quality_table.h"

namespace texmesh {

// textures.json says what the planes are, quality.json what a picture loses by scales, rungs and mips.

namespace {

using Json = nlohmann::ordered_json;

const std::string kTexturesFile = kTexturesPath;
constexpr std::uint64_t kMaxTexturesBytes = 32u << 20;
constexpr std::size_t kMaxTextBytes = 1000;
constexpr std::uint64_t kMaxSide = 1u << 20, kMaxMip = 20;

Json texture_json(const TextureInfo& t) {
  Json j;
  j["image"] = t.image;
  if (t.mip > 0) {
    j["mip"] = t.mip;
    j["base"] = t.base;
  }
  j["role"] = t.role;
  j["name"] = t.name;
  j["colourSpace"] = t.colour_space;
  j["codec"] = codec_traits(t.codec).id;
  j["widthPx"] = t.width_px;
  j["heightPx"] = t.height_px;
  j["channels"] = t.channels;
  j["fragmentWidthPx"] = t.fragment_width_px;
  j["fragmentHeightPx"] = t.fragment_height_px;
  j["columns"] = t.columns;
  j["rows"] = t.rows;
  j["gridReason"] = t.grid_reason;
  j["previewWidthPx"] = t.preview_width_px;
  j["previewHeightPx"] = t.preview_height_px;
  j["rungQuality"] = t.rung_quality;
  if (t.source_rung) j["sourceRung"] = true;
  if (!t.source_extension.empty()) {
    j["source"] = t.source_extension;
    j["sourceColours"] = t.source_colours;
  }
  return j;
}

std::uint32_t u32(const JsonAt& at, std::uint64_t lo, std::uint64_t hi) {
  return static_cast<std::uint32_t>(at.integer(lo, hi));
}

/// Fragments tile the plane: the last row and column may be partly outside, none wholly.
void read_grid(const JsonAt& at, TextureInfo& t) {
  t.width_px = u32(at["widthPx"], 1, kMaxSide);
  t.height_px = u32(at["heightPx"], 1, kMaxSide);
  t.channels = u32(at["channels"], 1, 3);
  if (t.channels == 2) at["channels"].fail("1 or 3", "2");
  t.fragment_width_px = u32(at["fragmentWidthPx"], 1, kMaxSide);
  t.fragment_height_px = u32(at["fragmentHeightPx"], 1, kMaxSide);
  for (const char* side : {"fragmentWidthPx", "fragmentHeightPx"})  // whole MCUs even with 4:2:0
    if (at[side].integer(1) % 16 != 0)
      at[side].by("X04").fail("a multiple of 16", std::to_string(at[side].integer(1)));
  t.columns = u32(at["columns"], 1, 65535);
  t.rows = u32(at["rows"].by("X05"), 1, 65535 / t.columns);
  const auto tiles = [](std::uint64_t count, std::uint64_t side, std::uint64_t whole) {
    return count * side >= whole && (count - 1) * side < whole;
  };
  if (!tiles(t.columns, t.fragment_width_px, t.width_px))
    at["columns"].by("X05").fail("as many as cover the width", std::to_string(t.columns));
  if (!tiles(t.rows, t.fragment_height_px, t.height_px))
    at["rows"].by("X05").fail("as many as cover the height", std::to_string(t.rows));
  t.grid_reason = at["gridReason"].text(kMaxTextBytes);
}

void read_mip(const JsonAt& at, TextureInfo& t) {
  if (at.has("mip")) t.mip = u32(at["mip"], 1, kMaxMip);  // 0 is said by leaving it out
  if (t.mip > 0) t.base = u32(at["base"], 0, kMaxPackagePlanes);
}

void read_source(const JsonAt& at, std::uint32_t plane, TextureInfo& t) {
  if (at.has("sourceRung")) t.source_rung = at["sourceRung"].boolean();
  if (t.source_rung && (t.codec != Codec::kJpeg || t.mip > 0))
    at["sourceRung"].by("X11").fail("a full-size plane of codec jpeg", "another");
  if (!at.has("source")) return;
  t.source_extension = at["source"].text(100);
  if (std::ranges::find(kSourceExtensions, t.source_extension) == std::end(kSourceExtensions))
    at["source"].by("X03").fail("jpg, png, tif, webp or exr", t.source_extension);
  if (t.mip > 0) at["source"].by("X11").fail("none, for a mip", t.source_extension);
  t.source_colours = at["sourceColours"].boolean();
  t.source.path = source_path(plane, t.source_extension);
}

/// Full-size planes first, then mips by (base, mip), each of its base's image and size.
void check_mips(const JsonAt& list, const std::vector<TextureInfo>& textures) {
  const std::size_t full = full_size_planes(textures);
  for (std::size_t p = full; p < textures.size(); ++p) {
    const TextureInfo& t = textures[p];
    if (t.mip == 0) list[p].by("X06").fail("a mip, as the plane before is one", "a full-size plane");
    if (t.base >= full) list[p]["base"].by("X06").fail("a full-size plane", std::to_string(t.base));
    const TextureInfo& base = textures[t.base];
    const std::uint32_t before = p > full && textures[p - 1].base == t.base ? textures[p - 1].mip : 0;
    if (t.mip <= before || (p > full && textures[p - 1].base > t.base))
      list[p]["mip"].by("X06").fail("mips by base and mip", std::to_string(t.mip));
    const auto side = [&](std::uint64_t px) { return (px + (std::uint64_t{1} << t.mip) - 1) >> t.mip; };
    if (t.width_px != side(base.width_px) || t.height_px != side(base.height_px))
      list[p]["widthPx"].by("X07").fail("sides of 1 / 2^mip of the full size, rounded up",
                                        std::to_string(t.width_px));
    if (t.image != base.image || t.role != base.role || t.channels != base.channels ||
        t.colour_space != base.colour_space || t.preview_width_px != base.preview_width_px ||
        t.preview_height_px != base.preview_height_px)
      list[p].by("X07").fail(
          "image, role, channels, colour space and preview of plane " + std::to_string(t.base), "others");
  }
}

TextureInfo read_texture(const JsonAt& at, std::uint32_t plane) {
  TextureInfo t;
  t.image = u32(at["image"], 0, 0xffffffffu);
  t.role = at["role"].text(100);
  t.name = at["name"].text(kMaxTextBytes);
  t.colour_space = at["colourSpace"].text(100);
  if (t.colour_space != "srgb" && t.colour_space != "linear")
    at["colourSpace"].by("X03").fail("srgb or linear", t.colour_space);
  const std::string codec = at["codec"].text(100);
  if (!find_codec(codec)) at["codec"].by("X03").fail("jpeg, jpeg-progressive, webp or jpeg-xy", codec);
  t.codec = *find_codec(codec);
  read_grid(at, t);
  if (t.codec == Codec::kJpegXy && (t.channels != 3 || t.colour_space != "linear"))
    at["codec"].by("F24").fail("jpeg-xy for three linear channels alone", codec);
  t.preview_width_px = u32(at["previewWidthPx"], 1, kMaxSide);
  t.preview_height_px = u32(at["previewHeightPx"], 1, kMaxSide);
  const JsonAt qualities = at["rungQuality"];
  for (std::size_t i = 0, n = qualities.array(1, kMaxPackageRungs); i < n; ++i) {
    const int quality = static_cast<int>(qualities[i].integer(1, 100));
    if (i > 0 && quality <= t.rung_quality.back())
      qualities[i].fail("a rising number", std::to_string(quality));
    t.rung_quality.push_back(quality);
    t.rungs.emplace_back().path = rung_path(plane, static_cast<std::uint32_t>(i));
  }
  read_mip(at, t);
  read_source(at, plane, t);
  t.preview.path = preview_path(t.mip > 0 ? t.base : plane);
  t.tables.path = table_streams_path(plane);
  return t;
}

}  // namespace

std::size_t full_size_planes(const std::vector<TextureInfo>& textures) {
  return static_cast<std::size_t>(
      std::ranges::find_if(textures, [](const TextureInfo& t) { return t.mip > 0; }) - textures.begin());
}

std::string write_textures(const std::vector<TextureInfo>& textures) {
  Json j;
  j["textures"] = Json::array();
  for (const TextureInfo& t : textures) j["textures"].push_back(texture_json(t));
  std::string json = dump_json(j, kTexturesFile);
  read_textures(text_bytes(json));
  return json;
}

std::vector<TextureInfo> read_textures(std::span<const std::uint8_t> json) {
  const nlohmann::json document = parse_json(json, kTexturesFile, kMaxTexturesBytes);
  const JsonAt list = JsonAt(document, kTexturesFile)["textures"];
  std::vector<TextureInfo> textures;
  for (std::size_t i = 0, n = list.array(0, kMaxPackagePlanes); i < n; ++i)
    textures.push_back(read_texture(list[i], static_cast<std::uint32_t>(i)));
  check_mips(list, textures);
  return textures;
}

void resolve_textures(std::vector<TextureInfo>& textures, const std::vector<EntryRef>& index) {
  std::map<std::string, const EntryRef*> by_path;
  for (const EntryRef& e : index) by_path[e.path] = &e;
  const auto resolve = [&](EntryRef& ref) {
    const auto it = by_path.find(ref.path);
    if (it == by_path.end())
      throw RuleError("R07", kIndexPath, ref.path, "an entry, for " + kTexturesFile + " speaks of it",
                      "none");
    ref = *it->second;
  };
  for (TextureInfo& t : textures) {
    resolve(t.preview);
    resolve(t.tables);
    for (EntryRef& rung : t.rungs) resolve(rung);
    if (!t.source_extension.empty()) resolve(t.source);
  }
}

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
