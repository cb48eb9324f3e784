#include "format/documents/textures.h"

#include <map>

#include "format/base/text_bytes.h"
#include "format/container/layout.h"
#include "format/documents/json_members.h"
#include "format/documents/quality_table.h"

namespace texmesh {

// textures.json says what the planes are, quality.json what a picture loses by scales, rungs and mips.

namespace {

using Json = nlohmann::ordered_json;

const std::string kTexturesFile = kTexturesPath;
constexpr std::uint64_t kMaxTexturesBytes = 32u << 20;
constexpr std::size_t kMaxTextBytes = 1000;
constexpr std::uint64_t kMaxSide = 1u << 20, kMaxMip = 20;

void texture_members(auto& v, auto& t) {
  v.integer("image", t.image, 0, 0xffffffffu);
  if (v.has("mip", t.mip > 0)) v.integer("mip", t.mip, 1, kMaxMip);  // 0 is said by leaving it out
  if (t.mip > 0) v.integer("base", t.base, 0, kMaxPackagePlanes);
  v.text("role", t.role, 100);
  v.text("name", t.name, kMaxTextBytes);
  v.text("colourSpace", t.colour_space, 100);
  v.by("X03").check("colourSpace", t.colour_space == "srgb" || t.colour_space == "linear", "srgb or linear",
                    t.colour_space);
  v.by("X03").named(
      "codec", t.codec, [](Codec codec) { return codec_traits(codec).id; }, find_codec,
      "jpeg, jpeg-progressive, webp or jpeg-xy");
  v.integer("widthPx", t.width_px, 1, kMaxSide);
  v.integer("heightPx", t.height_px, 1, kMaxSide);
  v.integer("channels", t.channels, 1, 3);
  v.integer("fragmentWidthPx", t.fragment_width_px, 1, kMaxSide);
  v.integer("fragmentHeightPx", t.fragment_height_px, 1, kMaxSide);
  v.integer("columns", t.columns, 1, 65535);
  v.by("X05").integer("rows", t.rows, 1, 65535 / std::max<std::uint64_t>(t.columns, 1));
  v.text("gridReason", t.grid_reason, kMaxTextBytes);
  v.integer("previewWidthPx", t.preview_width_px, 1, kMaxSide);
  v.integer("previewHeightPx", t.preview_height_px, 1, kMaxSide);
  v.rising("rungQuality", t.rung_quality, kMaxPackageRungs, 1, 100);
  if (v.has("sourceRung", t.source_rung)) v.boolean("sourceRung", t.source_rung);
  if (!v.has("source", !t.source_extension.empty())) return;
  v.text("source", t.source_extension, 100);
  v.boolean("sourceColours", t.source_colours);
}

/// Fragments tile the plane: the last row and column may be partly outside, none wholly.
void check_grid(const JsonAt& at, const TextureInfo& t) {
  if (t.channels == 2) at["channels"].fail("1 or 3", "2");
  for (const char* side : {"fragmentWidthPx", "fragmentHeightPx"})  // whole MCUs even with 4:2:0
    if (at[side].integer(1) % 16 != 0)
      at[side].by("X04").fail("a multiple of 16", std::to_string(at[side].integer(1)));
  const auto tiles = [](std::uint64_t count, std::uint64_t side, std::uint64_t whole) {
    return count * side >= whole && (count - 1) * side < whole;
  };
  if (!tiles(t.columns, t.fragment_width_px, t.width_px))
    at["columns"].by("X05").fail("as many as cover the width", std::to_string(t.columns));
  if (!tiles(t.rows, t.fragment_height_px, t.height_px))
    at["rows"].by("X05").fail("as many as cover the height", std::to_string(t.rows));
}

void check_source(const JsonAt& at, const TextureInfo& t) {
  if (t.source_rung && (t.codec != Codec::kJpeg || t.mip > 0))
    at["sourceRung"].by("X11").fail("a full-size plane of codec jpeg", "another");
  if (t.source_extension.empty() && !at.has("source")) return;
  if (std::ranges::find(kSourceExtensions, t.source_extension) == std::end(kSourceExtensions))
    at["source"].by("X03").fail("jpg, png, tif, webp or exr", t.source_extension);
  if (t.mip > 0) at["source"].by("X11").fail("none, for a mip", t.source_extension);
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
  const MemberReader from(at);
  texture_members(from, t);
  check_grid(at, t);
  if (t.codec == Codec::kJpegXy && (t.channels != 3 || t.colour_space != "linear"))
    at["codec"].by("F24").fail("jpeg-xy for three linear channels alone", "another plane");
  check_source(at, t);
  for (std::uint32_t i = 0; i < t.rung_quality.size(); ++i) t.rungs.emplace_back().path = rung_path(plane, i);
  if (!t.source_extension.empty()) t.source.path = source_path(plane, t.source_extension);
  t.preview.path = preview_path(t.mip > 0 ? t.base : plane);
  t.tables.path = table_streams_path(plane);
  return t;
}

const std::string kQualityFile = kQualityPath;
constexpr std::uint64_t kMaxQualityBytes = 4u << 20;

/// `fewest` to `most` losses of each kind, as many of all.
void losses_members(auto& v, auto& losses, std::size_t fewest, std::size_t most) {
  v.numbers("flip", losses.flip, fewest, most, 1);
  const std::size_t count = losses.flip.size();
  v.numbers("flipP95", losses.flip_p95, count, count, 1);
  v.numbers("dssim", losses.dssim, count, count, 1);
}

void texture_losses_members(auto& v, auto& t) {
  const auto losses = [&v](const char* name, auto& of, std::size_t fewest, std::size_t most) {
    v.object(name, [&](auto& inner) { losses_members(inner, of, fewest, most); });
  };
  v.rising("texelDssim", t.texel_dssim, kMaxQualitySamples, 0, 2);
  v.check("texelDssim", t.texel_dssim.empty() || t.texel_dssim[0] > 0, "numbers above 0", "0");
  losses("coded", t.coded, t.texel_dssim.size(), t.texel_dssim.size());
  losses("preview", t.preview, 1, 1);
  losses("finer", t.finer, 1, kMaxFinerLevels + 1);
  losses("coarser", t.coarser, 0, kMaxCoarserLevels);
}

std::optional<PlaneGroup> find_group(const std::string& name) {
  const auto& names = EnumNames<PlaneGroup>::names;
  const auto found = std::ranges::find(names, name);
  if (found == names.end()) return std::nullopt;
  return static_cast<PlaneGroup>(found - names.begin());
}

void quality_members(auto& v, auto& table) {
  v.integer("views", table.views, 1, 10000);
  v.rising("sizesPx", table.sizes_px, kMaxQualitySizes, 1, 65536);
  v.number("exponent", table.exponent, 1, 4);
  v.number("error", table.error, 0, 1e6);
  v.rising("scales", table.scales, 100, 0, 99);
  const std::size_t sizes = table.sizes_px.size(), scales = table.scales.size();
  v.list("geometry", table.geometry, sizes, sizes,
         [&](auto& inner, auto& losses, std::size_t) { losses_members(inner, losses, scales, scales); });
  v.list("groups", table.groups, 0, kPlaneGroups, [&](auto& inner, auto& group, std::size_t i) {
    inner.by("W06").named("group", group.group, enum_name<PlaneGroup>, find_group, "colour, normal or data");
    inner.by("Q03").check("group", i == 0 || group.group > table.groups[i - 1].group,
                          "groups in the order colour, normal, data", "another order");
    inner.list("sizes", group.sizes, sizes, sizes,
               [](auto& size, auto& losses, std::size_t) { texture_losses_members(size, losses); });
  });
}

}  // namespace

std::size_t full_size_planes(const std::vector<TextureInfo>& textures) {
  return static_cast<std::size_t>(
      std::ranges::find_if(textures, [](const TextureInfo& t) { return t.mip > 0; }) - textures.begin());
}

std::string write_textures(const std::vector<TextureInfo>& textures) {
  Json j;
  MemberWriter(j).list("textures", textures, 0, kMaxPackagePlanes,
                       [](auto& to, const TextureInfo& t, std::size_t) { texture_members(to, t); });
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

PlaneGroup group_of(std::string_view role) {
  if (role == "normal") return PlaneGroup::kNormal;
  return role == "data" || role == "occlusion-roughness-metallic" ? PlaneGroup::kData : PlaneGroup::kColour;
}

std::string write_quality(const QualityTable& table) {
  Json j;
  MemberWriter to(j);
  quality_members(to, table);
  std::string json = dump_json(j, kQualityFile);
  read_quality(text_bytes(json));
  return json;
}

QualityTable read_quality(std::span<const std::uint8_t> json) {
  const nlohmann::json document = parse_json(json, kQualityFile, kMaxQualityBytes);
  const MemberReader from(JsonAt(document, kQualityFile).by("Q01"));
  QualityTable table;
  quality_members(from, table);
  return table;
}

}  // namespace texmesh
