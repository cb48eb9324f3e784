#include "format/documents/manifest.h"
#include "format/documents/index.h"
#include "format/documents/textures.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "format/base/errors.h"
#include "format/container/container.h"
#include "tests/format/documents/manifest_fixture.h"

namespace texmesh {
namespace {

using testing::as_bytes;
using testing::make_manifest;
using Json = nlohmann::ordered_json;

Manifest read(const std::string& json) { return read_manifest(as_bytes(json)); }

/// Writes a manifest, lets `change` edit the JSON, reads it, and gives the place that the error names ("" =
/// accepted).
template <class Change>
std::string place_after(Change change) {
  Json j = Json::parse(write_manifest(make_manifest(3, 2)));
  change(j);
  try {
    read(j.dump());
  } catch (const FormatError& e) {
    EXPECT_EQ(e.file(), "manifest.json");
    EXPECT_FALSE(e.expected().empty());
    EXPECT_FALSE(e.found().empty());
    return e.place();
  }
  return "";
}

TEST(Manifest, RoundTrip) {
  for (const auto& [scales, planes] : {std::pair{1, 0u}, {3, 2u}, {21, 4u}, {2, 300u}}) {
    const Manifest m = make_manifest(scales, planes);
    const std::string json = write_manifest(m);
    EXPECT_EQ(read(json), m);
    EXPECT_EQ(write_manifest(read(json)), json);
  }
}

TEST(Manifest, FitsTheBootstrapWhateverTheModel) {
  for (const std::uint32_t planes : {220u, 1000u}) {
    const Manifest m = make_manifest(40, planes, true);
    const std::string json = write_manifest(m);
    EXPECT_LE(ContainerWriter::data_offset(0, kManifestPath, json.size()) + json.size(), kBootstrapBytes);
    EXPECT_EQ(read(json).scales.size(), 40u);
    RecordProperty("bytes", static_cast<int>(json.size()));
  }
}

TEST(Manifest, WriterRefusesWhatDoesNotFit) {
  EXPECT_THROW(write_manifest(make_manifest(100, 256, true)), FormatError);
  Manifest m = make_manifest(3, 2);
  m.title = std::string(kMaxTitleBytes + 1, 'a');
  EXPECT_THROW(write_manifest(m), FormatError);
}

TEST(Manifest, WriterRefusesBadValues) {
  const auto refused = [](auto change) {
    Manifest m = make_manifest(3, 2);
    change(m);
    EXPECT_THROW(write_manifest(m), FormatError);
  };
  refused([](Manifest& m) { m.object_height = std::numeric_limits<double>::quiet_NaN(); });
  refused([](Manifest& m) { m.origin.x = std::numeric_limits<double>::infinity(); });
  refused([](Manifest& m) { m.title = "\xff\xfe"; });
  refused([](Manifest& m) { m.title = "a\nb"; });
  refused([](Manifest& m) { m.scales[1].p95 = -1; });
  refused([](Manifest& m) { m.required_features = {"x"}; });
  refused([](Manifest& m) { m.steps.pop_back(); });
}

TEST(Manifest, MeasuredFiguresHaveSixDigits) {
  Manifest m = make_manifest(3, 2);
  m.scales[1].error_max = 0.123456789;
  const Manifest back = read(write_manifest(m));
  EXPECT_EQ(back.scales[1].error_max, 0.123457);
  EXPECT_EQ(back.bounds_min, m.bounds_min);  // these keep every bit
}

TEST(Manifest, EveryTruncationIsRefused) {
  const std::string json = write_manifest(make_manifest(3, 2));
  for (std::size_t n = 0; n < json.size(); ++n) EXPECT_THROW(read(json.substr(0, n)), FormatError) << n;
  EXPECT_THROW(read(json + "x"), FormatError);
  EXPECT_EQ(read(json + "   "), read(json));  // the writer pads with blanks
}

TEST(Manifest, FlippedBitsAreRefusedOrStayInRange) {
  const std::string json = write_manifest(make_manifest(2, 1));
  for (std::size_t i = 0; i < json.size(); ++i)
    for (int bit = 0; bit < 8; ++bit) {
      std::string damaged = json;
      damaged[i] = static_cast<char>(damaged[i] ^ (1 << bit));
      try {
        const Manifest m = read(damaged);
        EXPECT_EQ(write_manifest(m), write_manifest(read(write_manifest(m))));
      } catch (const FormatError&) {
      }
    }
}

TEST(Manifest, Versions) {
  EXPECT_EQ(place_after([](Json& j) { j["version"]["minor"] = 7; }), "");
  EXPECT_EQ(place_after([](Json& j) { j["version"]["major"] = 2; }), "/version/major");
  EXPECT_EQ(place_after([](Json& j) { j["version"]["major"] = 0; }), "/version/major");
  EXPECT_EQ(place_after([](Json& j) { j["format"] = "other"; }), "/format");
  EXPECT_EQ(place_after([](Json& j) { j["requiredFeatures"] = {"x-rays"}; }), "/requiredFeatures/0");
}

TEST(Manifest, UnknownFieldsAreIgnored) {
  EXPECT_EQ(place_after([](Json& j) {
              j["future"] = {{"a", {1, 2}}};
              j["scales"]["future"] = {1};
              j["index"]["future"] = nullptr;
            }),
            "");
}

TEST(Manifest, EveryFieldIsRequired) {
  const Json whole = Json::parse(write_manifest(make_manifest(3, 2)));
  for (const auto& [name, value] : whole.items()) {
    EXPECT_EQ(place_after([&, n = name](Json& j) { j.erase(n); }), "/" + name);
    if (!value.is_object()) continue;
    for (const auto& [inner, unused] : value.items()) {
      const bool optional = name == "scales" && inner == "floor";
      EXPECT_EQ(place_after([&, n = name, i = inner](Json& j) { j[n].erase(i); }),
                optional ? "" : "/" + name + "/" + inner);
    }
  }
}

TEST(Manifest, TypesRangesAndOrderAreChecked) {
  using P = const char*;
  const auto expect = [](P place, auto change) { EXPECT_EQ(place_after(change), place); };
  expect("/version/major", [](Json& j) { j["version"]["major"] = "1"; });
  expect("/version/minor", [](Json& j) { j["version"]["minor"] = 0.5; });
  expect("/title", [](Json& j) { j["title"] = 3; });
  expect("/title", [](Json& j) { j["title"] = std::string(201, 'a'); });
  expect("/origin", [](Json& j) { j["origin"] = {1, 2}; });
  expect("/origin/1", [](Json& j) { j["origin"][1] = "2"; });
  expect("/bounds/max/0", [](Json& j) { j["bounds"]["max"][0] = -1; });
  expect("/jnd", [](Json& j) { j["jnd"] = 1.5; });
  expect("/scales/triangles", [](Json& j) { j["scales"]["triangles"].push_back(1); });
  expect("/scales/scale", [](Json& j) { j["scales"]["scale"] = Json::array(); });
  expect("/scales/scale/0", [](Json& j) { j["scales"]["scale"][0] = 1; });
  expect("/scales/scale/2", [](Json& j) { j["scales"]["scale"][2] = 1; });
  expect("/scales/triangles/1", [](Json& j) { j["scales"]["triangles"][1] = 0; });
  expect("/scales/triangles/1", [](Json& j) { j["scales"]["triangles"][1] = 4294967296; });
  expect("/scales/triangles/1", [](Json& j) { j["scales"]["triangles"][1] = -1; });
  expect("/scales/offset/1", [](Json& j) { j["scales"]["offset"][1] = 100; });
  expect("/scales/bytes/1", [](Json& j) { j["scales"]["bytes"][1] = 0; });
  expect("/scales/bytes/1", [](Json& j) { j["scales"]["bytes"][1] = 9007199254740993; });
  expect("/scales/sha256/1", [](Json& j) { j["scales"]["sha256"][1] = std::string(64, 'A'); });
  expect("/scales/sha256/1", [](Json& j) { j["scales"]["sha256"][1] = std::string(63, 'a'); });
  expect("/scales/major/1", [](Json& j) { j["scales"]["major"][1] = 1; });
  expect("/scales/p95/1", [](Json& j) { j["scales"]["p95"][1] = -0.5; });
  expect("/steps", [](Json& j) { j["steps"] = Json::array(); });
  expect("/steps/0/1", [](Json& j) { j["steps"][0][1] = 50; });
  expect("/steps/1/0", [](Json& j) { j["steps"][1][0] = 1; });
  expect("/steps/1/1", [](Json& j) { j["steps"][1][1] = 2; });
  expect("/steps/2/0", [](Json& j) { j["steps"][2][0] = 5e8; });
  expect("/firstPicture/offset", [](Json& j) { j["firstPicture"]["offset"] = 64; });
  expect("/previews", [](Json& j) { j["previews"].erase(0); });
  expect("/previews/1", [](Json& j) { j["previews"][1][1] = 1000000; });
  expect("/index/headBytes", [](Json& j) { j["index"]["headBytes"] = 100000; });
  expect("/tables/sha256", [](Json& j) { j["tables"]["sha256"] = ""; });
}

TEST(Manifest, HostileJson) {
  EXPECT_THROW(read(std::string(100000, '[')), FormatError);  // too large for the bootstrap
  EXPECT_THROW(read("{\"a\":" + std::string(65, '[') + std::string(65, ']') + "}"), FormatError);
  EXPECT_THROW(read(R"({"format":"texmesh","format":"texmesh"})"), FormatError);  // a name twice
  EXPECT_THROW(read(R"({"format":1e999})"), FormatError);
  EXPECT_THROW(read(""), FormatError);
  EXPECT_THROW(read("null"), FormatError);
  EXPECT_THROW(read("[]"), FormatError);
  EXPECT_THROW(read("{\"format\":\"\xff\"}"), FormatError);
}

TextureInfo texture(std::uint32_t plane, int rungs) {
  TextureInfo t;
  t.image = plane / 2;
  t.role = plane % 2 ? "alpha" : "base-colour";
  t.name = "wall \xc3\xa4.jpg";
  t.colour_space = plane % 2 ? "linear" : "srgb";
  t.channels = plane % 2 ? 1 : 3;
  t.width_px = 1000;
  t.height_px = 500;
  t.fragment_width_px = t.fragment_height_px = 256;
  t.columns = 4;
  t.rows = 2;
  t.grid_reason = "because";
  t.preview_width_px = 62;
  t.preview_height_px = 31;
  t.preview.path = preview_path(plane);
  t.tables.path = table_streams_path(plane);
  for (int r = 0; r < rungs; ++r) {
    t.rung_quality.push_back(5 + 10 * r);
    t.rungs.emplace_back().path = rung_path(plane, static_cast<std::uint32_t>(r));
  }
  return t;
}

TEST(Textures, RoundTripTruncationAndFlips) {
  const std::vector<TextureInfo> textures{texture(0, 3), texture(1, 10)};
  const std::string json = write_textures(textures);
  EXPECT_EQ(read_textures(as_bytes(json)), textures);
  EXPECT_EQ(read_textures(as_bytes(write_textures({}))), std::vector<TextureInfo>{});
  for (std::size_t n = 0; n < json.size(); ++n)
    EXPECT_THROW(read_textures(as_bytes(json).first(n)), FormatError) << n;
  for (std::size_t i = 0; i < json.size(); ++i)
    for (int bit = 0; bit < 8; ++bit) {
      std::string damaged = json;
      damaged[i] = static_cast<char>(damaged[i] ^ (1 << bit));
      try {
        write_textures(read_textures(as_bytes(damaged)));  // what was read can be written: it is in range
      } catch (const FormatError&) {
      }
    }
}

/// Two full-size planes and the mips of both.
std::vector<TextureInfo> with_mips() {
  std::vector<TextureInfo> textures{texture(0, 3), texture(1, 10)};
  for (const auto& [base, mip] : {std::pair{0u, 1u}, {0u, 3u}, {1u, 1u}}) {
    const auto plane = static_cast<std::uint32_t>(textures.size());
    TextureInfo t = texture(plane, 2);
    const TextureInfo& full = textures[base];
    t.image = full.image, t.role = full.role, t.channels = full.channels, t.colour_space = full.colour_space;
    t.mip = mip, t.base = base;
    t.width_px = mip == 1 ? 500 : 125;
    t.height_px = mip == 1 ? 250 : 63;
    t.columns = mip == 1 ? 2 : 1, t.rows = 1;
    t.preview.path = full.preview.path;
    textures.push_back(t);
  }
  return textures;
}

TEST(Textures, MipsRoundTripAndTheirRulesAreChecked) {
  const std::vector<TextureInfo> textures = with_mips();
  EXPECT_EQ(read_textures(as_bytes(write_textures(textures))), textures);
  EXPECT_EQ(full_size_planes(textures), 2u);
  const auto refused = [&](const char* place, auto change) {
    Json j = Json::parse(write_textures(textures));
    change(j["textures"]);
    try {
      read_textures(as_bytes(j.dump()));
      ADD_FAILURE() << place;
    } catch (const FormatError& e) {
      EXPECT_EQ(e.place(), std::string("/textures/") + place);
    }
  };
  refused("2/base", [](Json& j) { j[2].erase("base"); });
  refused("2/base", [](Json& j) { j[2]["base"] = 2; });
  refused("2/base", [](Json& j) { j[2]["base"] = -1; });
  refused("2/mip", [](Json& j) { j[2]["mip"] = 21; });
  refused("3", [](Json& j) { j[3].erase("mip"); });
  refused("3/mip", [](Json& j) { j[3]["mip"] = 1; });
  refused("3/widthPx", [](Json& j) { j[3]["mip"] = 2; });
  refused("4/mip", [](Json& j) { std::swap(j[3], j[4]); });
  refused("2", [](Json& j) { j[2]["image"] = 5; });
  refused("2", [](Json& j) { j[2]["channels"] = 1; });
  refused("4", [](Json& j) { j[4]["previewWidthPx"] = 7; });
}

TEST(Textures, TheLosslessTopRoundTripsAndItsRulesAreChecked) {
  std::vector<TextureInfo> textures = with_mips();
  textures[0].lossless = true;
  textures[1].source_extension = "exr";
  textures[1].source_colours = false;
  textures[1].source.path = "source/001.exr";
  EXPECT_EQ(read_textures(as_bytes(write_textures(textures))), textures);
  std::vector<TextureInfo> resolved = textures;
  EXPECT_THROW(resolve_textures(resolved, {}), FormatError);
  const auto refused = [&](const char* place, auto change) {
    Json j = Json::parse(write_textures(textures));
    change(j["textures"]);
    try {
      read_textures(as_bytes(j.dump()));
      ADD_FAILURE() << place;
    } catch (const FormatError& e) {
      EXPECT_EQ(e.place(), std::string("/textures/") + place);
    }
  };
  refused("0/lossless", [](Json& j) { j[0]["lossless"] = 1; });
  refused("0/lossless", [](Json& j) { j[0]["codec"] = "webp"; });
  refused("2/lossless", [](Json& j) { j[2]["lossless"] = true; });
  refused("1/source", [](Json& j) { j[1]["source"] = "../png"; });
  refused("1/sourceColours", [](Json& j) { j[1].erase("sourceColours"); });
  refused("1/sourceColours", [](Json& j) { j[1]["sourceColours"] = "no"; });
  refused("2/source", [](Json& j) { j[2]["source"] = "png", j[2]["sourceColours"] = true; });
}

TEST(Manifest, OnlyMipsMayLackPreviews) {
  Manifest m = make_manifest(3, 4);
  m.previews.resize(2);
  EXPECT_THROW(write_manifest(m), FormatError);
  m.required_features = {kMipsFeature};
  EXPECT_EQ(read_manifest(as_bytes(write_manifest(m))), m);
  m.previews.clear();
  EXPECT_THROW(write_manifest(m), FormatError);
}

TEST(Textures, RulesAreChecked) {
  const auto refused = [](const char* place, auto change) {
    Json j = Json::parse(write_textures({texture(0, 3)}));
    change(j["textures"][0]);
    try {
      read_textures(as_bytes(j.dump()));
      ADD_FAILURE() << place;
    } catch (const FormatError& e) {
      EXPECT_EQ(e.place(), std::string("/textures/0/") + place);
    }
  };
  refused("codec", [](Json& j) { j["codec"] = "jpeg-xl"; });
  refused("colourSpace", [](Json& j) { j["colourSpace"] = "p3"; });
  refused("channels", [](Json& j) { j["channels"] = 2; });
  refused("columns", [](Json& j) { j["columns"] = 5; });
  refused("rows", [](Json& j) { j["rows"] = 1; });
  refused("fragmentWidthPx", [](Json& j) { j["fragmentWidthPx"] = 255; });
  refused("rungQuality", [](Json& j) { j["rungQuality"] = Json::array(); });
  refused("rungQuality/1", [](Json& j) { j["rungQuality"][1] = 5; });
  refused("widthPx", [](Json& j) { j["widthPx"] = 0; });
  refused("name", [](Json& j) { j["name"] = "a\x1b[2J"; });
}

std::vector<EntryRef> index_entries(std::uint32_t planes) {
  std::vector<EntryRef> entries;
  std::uint64_t at = 64;
  const auto add = [&](const std::string& path, std::uint64_t bytes) {
    at = ContainerWriter::data_offset(at, path, bytes);
    entries.push_back({path, at, bytes, sha256(as_bytes(path))});
    at += bytes;
  };
  add(kTablesPath, 500);
  add(mesh_path(3), 1000);
  for (std::uint32_t p = 0; p < planes; ++p) add(table_streams_path(p), 10);
  for (std::uint32_t r = 0; r < 3; ++r)
    for (std::uint32_t p = 0; p < planes; ++p)
      add(rung_path(p, r), r);  // 0 bytes: a plane without stored fragments
  add(kProvenancePath, 5);
  return entries;
}

TEST(Index, RoundTripWholeAndByPages) {
  for (const std::uint32_t planes : {0u, 1u, 5u}) {
    const auto entries = index_entries(planes);
    const auto bytes = write_index(entries);
    EXPECT_EQ(read_index(bytes), entries);
    const IndexHead whole = read_index_head(bytes);
    const IndexHead head = read_index_head(std::span(bytes).first(whole.bytes));
    ASSERT_EQ(head.pages.size(), planes + 1);
    for (std::uint32_t p = 0; p < planes; ++p) {
      const IndexPage& page = head.pages[p + 1];
      EXPECT_EQ(page.plane, p);
      const auto found = read_index_page(head, p + 1, std::span(bytes).subspan(page.offset, page.bytes));
      ASSERT_EQ(found.size(), 4u);
      EXPECT_EQ(found[0].path, table_streams_path(p));
      EXPECT_EQ(found[3].path, rung_path(p, 2));
    }
  }
}

TEST(Index, EveryTruncationExtraByteAndFlip) {
  const auto bytes = write_index(index_entries(2));
  for (std::size_t n = 0; n < bytes.size(); ++n)
    EXPECT_THROW(read_index(std::span(bytes).first(n)), FormatError) << n;
  auto longer = bytes;
  longer.push_back(0);
  EXPECT_THROW(read_index(longer), FormatError);
  // Bytes 6 and 7 are the minor version, which a reader accepts whatever it is.
  for (std::size_t i = 0; i < bytes.size(); ++i)
    for (int bit = 0; bit < 8; ++bit) {
      auto damaged = bytes;
      damaged[i] = static_cast<std::uint8_t>(damaged[i] ^ (1 << bit));
      if (i == 6 || i == 7) {
        EXPECT_EQ(read_index(damaged), read_index(bytes));
      } else {
        EXPECT_THROW(read_index(damaged), FormatError) << i << " " << bit;
      }
    }
}

TEST(Index, WriterRefusesBadEntries) {
  const auto refused = [](auto change) {
    auto entries = index_entries(1);
    change(entries);
    EXPECT_THROW(write_index(entries), FormatError);
  };
  using Entries = std::vector<EntryRef>;
  refused([](Entries& e) { e[1].path = e[0].path; });
  refused([](Entries& e) { e[1].path = "../x"; });
  refused([](Entries& e) { e[1].path = kManifestPath; });
  refused([](Entries& e) { e[1].offset += 1; });
  refused([](Entries& e) { std::swap(e[0], e[1]); });
  refused([](Entries& e) { e[0].bytes = 1u << 30; });
}

TEST(Layout, PathsParseOnlyInTheirCanonicalSpelling) {
  EXPECT_EQ(parse_entry_path(mesh_path(7)).kind, EntryKind::kMesh);
  EXPECT_EQ(parse_entry_path(mesh_path(7)).number, 7u);
  EXPECT_EQ(parse_entry_path(preview_path(1234)).number, 1234u);
  const EntryName rung = parse_entry_path(rung_path(12, 3));
  EXPECT_EQ(rung.kind, EntryKind::kRung);
  EXPECT_EQ(rung.number, 12u);
  EXPECT_EQ(rung.rung, 3u);
  const EntryName file = parse_entry_path(fragment_file_path(1, 2, 33));
  EXPECT_EQ(file.kind, EntryKind::kFragmentFile);
  EXPECT_EQ(file.fragment, 33u);
  const EntryName source = parse_entry_path(source_path(7, "webp"));
  EXPECT_EQ(source.kind, EntryKind::kSource);
  EXPECT_EQ(source.number, 7u);
  EXPECT_EQ(source.extension, "webp");
  for (const char* other : {"source/7.png", "source/007.gif", "source/007.", "mesh/s7.glb", "mesh/s007.glb",
                            "mesh/s07.glbx", "preview/1.jpg", "texture/01/r00.pack", "texture/0/r0.pack",
                            "texture/0/rx.pack", "texture/99999999999/r00.pack", "a", ""})
    EXPECT_EQ(parse_entry_path(other).kind, EntryKind::kOther) << other;
}

TEST(Layout, StreamingOrder) {
  const std::vector<std::string> order{"manifest.json",         "index.bin",          "tables.bin",
                                       "textures.json",         "quality.json",       "mesh/s09.glb",
                                       "preview/000.jpg",       "preview/001.jpg",    "texture/0/tables.pack",
                                       "texture/1/tables.pack", "texture/0/r00.pack", "texture/1/r00.pack",
                                       "texture/0/r01.pack",    "texture/1/r01.pack", "mesh/s04.glb",
                                       "texture/0/r02.pack",    "texture/1/r02.pack", "texture/0/r03.pack",
                                       "mesh/s00.glb",          "extra/thing.bin",    "provenance.json"};
  std::vector<std::string> shuffled = order;
  std::ranges::sort(shuffled);
  EXPECT_EQ(streaming_order(shuffled), order);
  std::ranges::reverse(shuffled);
  EXPECT_EQ(streaming_order(shuffled), order);
  // Untextured: meshes from coarse to fine.
  EXPECT_EQ(
      streaming_order({"mesh/s00.glb", "mesh/s02.glb", "mesh/s01.glb", "provenance.json", "manifest.json"}),
      (std::vector<std::string>{"manifest.json", "mesh/s02.glb", "mesh/s01.glb", "mesh/s00.glb",
                                "provenance.json"}));
}

}  // namespace
}  // namespace texmesh
