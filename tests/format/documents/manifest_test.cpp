#include "format/documents/manifest.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "format/base/errors.h"
#include "format/container/container.h"
#include "format/container/layout.h"
#include "tests/format/documents/manifest_fixture.h"

namespace texmesh::manifest_test {

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
  EXPECT_EQ(place_after([](Json& j) { j["version"]["major"] = 3; }), "/version/major");
  EXPECT_EQ(place_after([](Json& j) { j["version"]["major"] = 1; }), "/version/major");
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

TEST(Manifest, APosterMayStandInIt) {
  Manifest m = make_manifest(3, 2);
  EXPECT_FALSE(m.poster);
  m.poster = PosterRef{{kPosterPath, 640, 39000, m.quality.digest}, 512, 384};
  EXPECT_EQ(read(write_manifest(m)), m);
  const auto refused = [&](auto change) {
    Manifest bad = m;
    change(*bad.poster);
    EXPECT_THROW(write_manifest(bad), FormatError);
  };
  refused([](PosterRef& p) { p.width_px = 0; });
  refused([](PosterRef& p) { p.height_px = kMaxPosterSide + 1; });
  refused([](PosterRef& p) { p.bytes = kMaxPosterBytes + 1; });
  refused([](PosterRef& p) { p.bytes = 0; });
  refused([](PosterRef& p) { p.offset = 63; });
}

TEST(Manifest, OldPackagesAreToBeCompiledAgain) {
  Json j = Json::parse(write_manifest(make_manifest(3, 2)));
  j["version"]["major"] = 1;
  try {
    read(j.dump());
    FAIL() << "was read";
  } catch (const FormatError& e) {
    EXPECT_EQ(e.found(), "1, which is no longer read: compile the model again");
  }
}

TEST(Manifest, TablesOfTheThesisMayStandInIt) {
  Manifest m = make_manifest(3, 2);
  EXPECT_FALSE(m.thesis);
  m.thesis = EntryRef{kThesisPath, 640, 3900, m.quality.digest};
  EXPECT_EQ(read(write_manifest(m)), m);
  m.thesis->bytes = 0;
  EXPECT_THROW(write_manifest(m), FormatError);
}

TEST(Manifest, EveryFieldIsRequired) {
  const Json whole = Json::parse(write_manifest(make_manifest(3, 2)));
  for (const auto& [name, value] : whole.items()) {
    EXPECT_EQ(place_after([&, n = name](Json& j) { j.erase(n); }), "/" + name);
    if (!value.is_object()) continue;
    for (const auto& [inner, unused] : value.items()) {
      EXPECT_EQ(place_after([&, n = name, i = inner](Json& j) { j[n].erase(i); }), "/" + name + "/" + inner);
    }
  }
}

TEST(Manifest, NoNumberIsLargerThanJsonHolds) {
  Json j = Json::parse(write_manifest(make_manifest(3, 2)));
  j["scales"]["bytes"][1] = 9007199254740993;
  EXPECT_THROW(read(j.dump()), FormatError);
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
  expect("/scales/sha256/1", [](Json& j) { j["scales"]["sha256"][1] = std::string(64, 'A'); });
  expect("/scales/sha256/1", [](Json& j) { j["scales"]["sha256"][1] = std::string(63, 'a'); });
  expect("/scales/major/1", [](Json& j) { j["scales"]["major"][1] = 1; });
  expect("/scales/p95/1", [](Json& j) { j["scales"]["p95"][1] = -0.5; });
  expect("/steps", [](Json& j) { j["steps"] = Json::array(); });
  expect("/steps/0/1", [](Json& j) { j["steps"][0][1] = 50; });
  expect("/steps/1/0", [](Json& j) { j["steps"][1][0] = 1; });
  expect("/steps/1/1", [](Json& j) { j["steps"][1][1] = 2; });
  expect("/steps/2/0", [](Json& j) { j["steps"][2][0] = 5e8; });
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

/// Five scales, those between as prefixes of a stream.
Manifest with_stream() {
  Manifest m = make_manifest(5, 1);
  m.stream = StreamRef{1 << 20, 90000, 100, m.quality.digest};
  for (std::size_t k = 1; k + 1 < m.scales.size(); ++k)
    m.scales[k].glb = {kSplitStreamPath, m.stream->offset, 50000 - 10000 * k, m.quality.digest};
  return m;
}

TEST(Manifest, ScalesMayBePrefixesOfTheStream) {
  const Manifest m = with_stream();
  EXPECT_TRUE(m.scales[0].has_glb() && m.scales[4].has_glb());
  EXPECT_FALSE(m.scales[1].has_glb() || m.scales[3].has_glb());
  EXPECT_EQ(read(write_manifest(m)), m);
  const auto refused = [&](auto change) {
    Manifest bad = with_stream();
    change(bad);
    EXPECT_THROW(write_manifest(bad), FormatError);
  };
  refused([](Manifest& bad) { bad.scales[0].glb = bad.scales[1].glb; });
  refused([](Manifest& bad) { bad.scales[4].glb = bad.scales[3].glb; });
  refused([](Manifest& bad) { bad.scales[3].glb.bytes = bad.stream->head_bytes; });
  refused([](Manifest& bad) { bad.scales[1].glb.bytes = bad.stream->bytes + 1; });
  refused([](Manifest& bad) { bad.scales[2].glb.bytes = bad.scales[3].glb.bytes; });
}

/// Two proxies, measured at two sizes.
Manifest with_proxies() {
  Manifest m = make_manifest(3, 2);
  m.proxy_sizes_px = {128, 512};
  m.proxies = {{{proxy_path(0), 8192, 20000, m.quality.digest}, 2000, 1500, 192, {0.1, 0.2}, {0.3, 0.4}},
               {{proxy_path(1), 65536, 50000, m.quality.digest}, 5000, 4000, 0, {0.05, 0.1}, {0.2, 0.3}}};
  return m;
}

TEST(Manifest, ProxiesMayStandInIt) {
  EXPECT_TRUE(make_manifest(3, 2).proxies.empty());
  EXPECT_EQ(write_manifest(make_manifest(3, 2)).find("proxies"), std::string::npos);
  const Manifest m = with_proxies();
  EXPECT_EQ(read(write_manifest(m)), m);
  EXPECT_EQ(start_bytes(m), 28192u);  // the smallest proxy is the first picture
  const auto refused = [](auto change) {
    Manifest bad = with_proxies();
    change(bad);
    EXPECT_THROW(write_manifest(bad), FormatError);
  };
  refused([](Manifest& bad) { bad.proxies[1].glb.bytes = bad.proxies[0].glb.bytes; });
  refused([](Manifest& bad) { bad.proxies[1].glb.offset = 100; });
  refused([](Manifest& bad) { bad.proxies[0].triangles = 0; });
  refused([](Manifest& bad) { bad.proxies[0].vertices = 0; });
  refused([](Manifest& bad) { bad.proxies[0].texture_px = kMaxProxyTexturePx + 1; });
  refused([](Manifest& bad) { bad.proxies[1].flip.pop_back(); });
  refused([](Manifest& bad) { bad.proxies[1].flip_p95.push_back(0.5); });
  refused([](Manifest& bad) { bad.proxies[1].flip[0] = 1.5; });
  refused([](Manifest& bad) { bad.proxies[1].flip_p95[0] = -0.5; });
  refused([](Manifest& bad) { bad.proxy_sizes_px = {512, 128}; });
  refused([](Manifest& bad) { bad.proxy_sizes_px = {128, 128}; });
  refused([](Manifest& bad) { bad.proxy_sizes_px = {0.5, 128}; });
  refused([](Manifest& bad) {
    bad.proxy_sizes_px.clear();
    for (ManifestProxy& p : bad.proxies) p.flip.clear(), p.flip_p95.clear();
  });
  refused([](Manifest& bad) {
    while (bad.proxies.size() <= kMaxPackageProxies) {
      bad.proxies.push_back(bad.proxies.back());
      ++bad.proxies.back().glb.bytes;
    }
  });
}

TEST(Manifest, ProxiesNeedEveryColumn) {
  const Json whole = Json::parse(write_manifest(with_proxies()));
  for (const auto& [name, unused] : whole["proxies"].items()) {
    Json missing = whole, shorter = whole;
    missing["proxies"].erase(name);
    EXPECT_THROW(read(missing.dump()), FormatError) << name;
    shorter["proxies"][name].erase(0);
    EXPECT_THROW(read(shorter.dump()), FormatError) << name;
  }
}

TEST(Manifest, TheStartEndsWithTheCoarsestGlb) {
  const Manifest m = with_stream();
  EXPECT_EQ(start_bytes(m), m.scales[4].glb.offset + m.scales[4].glb.bytes);
}

}  // namespace texmesh::manifest_test
