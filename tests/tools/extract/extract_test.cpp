// extract_files() on small packages made by code.
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "stages/gltf/check_glb.h"
#include "stages/image/decode_image.h"
#include "tests/support/packages.h"
#include "tools/extract/budget/candidates.h"
#include "tools/extract/extract.h"
#include "tools/extract/usdz/usdz.h"

namespace texmesh::extract_test {

using testing::make_package_parts;

PackageReader open(const Bytes& package) { return PackageReader(open_container(memory_source(package))); }
const Bytes& package_bytes() {
  static const Bytes bytes = make_package_parts().build();
  return bytes;
}

Extracted extract(const ExtractRequest& request, int threads = 2) {
  PackageReader package = open(package_bytes());
  RunContext context;
  context.threads = threads;
  return extract_model(package, request, context);
}

ExtractBudget budget(const std::vector<std::uint64_t>& bytes) {
  ExtractBudget b;
  b.bytes = bytes;
  b.display_px = 64;  // small pictures, quick tests
  return b;
}

Extracted extract_within(std::uint64_t bytes, int threads = 2) { return extract({budget({bytes})}, threads); }

void expect_valid(const Bytes& glb, const std::string& what) {
  Findings findings;
  const GlbFacts facts = check_glb(glb, "x.glb", findings, GlbRules::kStandalone);
  for (const Finding& f : findings.list()) ADD_FAILURE() << what << ": " << to_string(f);
  EXPECT_GT(facts.triangles, 0u);
}

nlohmann::json json_of(const Bytes& glb) {
  const std::size_t bytes = glb[12] | glb[13] << 8 | glb[14] << 16;
  return nlohmann::json::parse(glb.begin() + 20, glb.begin() + 20 + static_cast<std::ptrdiff_t>(bytes));
}

Pixels image_of(const Bytes& glb, std::size_t k) {
  const nlohmann::json root = json_of(glb);
  const nlohmann::json& view = root["bufferViews"][root["images"][k]["bufferView"].get<std::size_t>()];
  const std::size_t at =
      28u + (glb[12] | glb[13] << 8 | glb[14] << 16) + view["byteOffset"].get<std::size_t>();
  const auto begin = glb.begin() + static_cast<std::ptrdiff_t>(at);
  return decode_image(probe_image(
      "x", {begin, begin + static_cast<std::ptrdiff_t>(view["byteLength"].get<std::size_t>())}, {}));
}

Bytes package_with_proxies() {
  testing::PackageParts parts = make_package_parts();
  testing::add_proxies(parts);
  return parts.build();
}

TEST(ExtractModel, AProxyIsWrittenAsItIs) {
  const Bytes bytes = package_with_proxies();
  PackageReader package = open(bytes);
  ExtractRequest r{ExtractProxy{1}};
  const Extracted moved = extract_model(package, r, {});
  expect_valid(moved.glb, "proxy 1");
  EXPECT_EQ(moved.proxy, 1u);
  EXPECT_EQ(moved.triangles, package.manifest().proxies[1].triangles);
  Findings findings;
  const GlbFacts facts = check_glb(moved.glb, "x.glb", findings, GlbRules::kStandalone);
  EXPECT_NEAR(facts.bounds_min.x, 9, 1e-3);  // where the source has it
  EXPECT_EQ(facts.largest_image_px, package.manifest().proxies[1].texture_px);
  r.recentre = true;
  EXPECT_NEAR(check_glb(extract_model(package, r, {}).glb, "x.glb", findings).bounds_min.x, -1, 1e-3);
  r.file = ExtractProxy{2};
  EXPECT_THROW(extract_model(package, r, {}), InputError);
  PackageReader without = open(package_bytes());
  r.file = ExtractProxy{0};
  EXPECT_THROW(extract_model(without, r, {}), InputError);
}

TEST(ExtractModel, TheBestRungAsPngIsThePlanePutTogetherAgain) {
  ExtractScale r;
  r.scale = 0;
  r.images = ExtractImages::kPng;
  const Extracted e = extract({r});
  expect_valid(e.glb, "png");
  const Pixels image = image_of(e.glb, 0);
  ASSERT_EQ(image.width_px, 64u);
  ASSERT_EQ(image.height_px, 48u);
  // Fragment by fragment, as a client would decode them; fragment 3 is not stored.
  PackageReader package = open(package_bytes());
  for (const std::uint32_t f : {0u, 1u, 2u}) {
    const Pixels part = decode_image(probe_image("f", package.complete_fragment(0, 1, f), {}));
    for (std::uint32_t y = 0; y < 32; ++y)
      for (std::uint32_t x = 0; x < 32; ++x) {
        const std::uint32_t px = f % 2 * 32 + x, py = f / 2 * 32 + y;
        if (py < 48) ASSERT_TRUE(std::equal(part.at(x, y), part.at(x, y) + 3, image.at(px, py))) << f;
      }
  }
}

TEST(ExtractModel, EveryKindOfRequestGivesAValidFile) {
  for (const ExtractImages images : {ExtractImages::kAuto, ExtractImages::kJpeg, ExtractImages::kWebp,
                                     ExtractImages::kAvif, ExtractImages::kPng})
    for (const bool lods : {false, true})
      for (const double display : {0.0, 50.0, 5000.0}) {
        ExtractScale r;
        r.images = images;
        if (lods) r.form = ExtractScale::Form::kLevels;
        r.display_px = display;
        const Extracted e = extract({r});
        expect_valid(e.glb, std::to_string(static_cast<int>(images)) + " " + std::to_string(display));
        const nlohmann::json root = json_of(e.glb);
        const std::string required = root.value("extensionsRequired", nlohmann::json::array()).dump();
        EXPECT_EQ(required.find("EXT_texture_webp") != std::string::npos, images == ExtractImages::kWebp);
        EXPECT_EQ(required.find("EXT_texture_avif") != std::string::npos, images == ExtractImages::kAvif);
        EXPECT_EQ(e.scale, display == 50 ? 5 : 0);
        EXPECT_EQ(e.levels.size(), lods && e.scale == 0 ? 2u : 1u);
      }
}

TEST(ExtractModel, LevelsShareTexturesAndStandBehindTheFinest) {
  ExtractScale r;
  r.form = ExtractScale::Form::kLevels;
  const Extracted e = extract({r});
  const nlohmann::json root = json_of(e.glb);
  EXPECT_EQ(root["images"].size(), 1u);
  EXPECT_EQ(root["meshes"].size(), 2u);
  ASSERT_EQ(root["scenes"][0]["nodes"].size(), 1u);
  const nlohmann::json& placed = root["nodes"][root["scenes"][0]["nodes"][0].get<std::size_t>()];
  EXPECT_EQ(placed["translation"], nlohmann::json::parse("[10.0, 20.0, 30.0]"));
  ASSERT_EQ(placed["children"].size(), 1u);
  const nlohmann::json& top = root["nodes"][placed["children"][0].get<std::size_t>()];
  ASSERT_EQ(top["extensions"]["MSFT_lod"]["ids"].size(), 1u);
  const auto coverage = top["extras"]["MSFT_screencoverage"].get<std::vector<double>>();
  ASSERT_EQ(coverage.size(), 2u);
  EXPECT_GT(coverage[0], coverage[1]);
  EXPECT_EQ(coverage[1], 0);
}

TEST(ExtractModel, ALevelIsAStepAndCoversTheScreenUntilTheNextOneIsEnough) {
  Manifest m;
  for (const int scale : {0, 2, 4, 7, 10, 17}) {
    m.scales.emplace_back().scale = scale;
    m.scales.back().major = scale == 17;
  }
  m.steps = {{135, 10}, {540, 7}, {1080, 4}, {kAnyDisplayPx, 0}};
  const auto coverages = [&](const std::vector<int>& levels) {
    std::vector<double> out;
    for (std::size_t l = 0; l < levels.size(); ++l) out.push_back(screen_coverage_of(m, levels, l));
    return out;
  };
  EXPECT_EQ(levels_of(m, 0), (std::vector<int>{0, 4, 7, 10}));
  EXPECT_EQ(coverages({0, 4, 7, 10}), (std::vector<double>{1, 0.25, 0.015625, 0}));
  EXPECT_EQ(levels_of(m, 2), (std::vector<int>{2, 4, 7, 10}));
  EXPECT_EQ(levels_of(m, 10), (std::vector<int>{10, 17})) << "no step has a coarser scale";
  EXPECT_EQ(coverages({10, 17}), (std::vector<double>{0, 0}));
  EXPECT_EQ(levels_of(m, 17), std::vector<int>{17});
}

TEST(ExtractModel, BytesAreMetWithinTwoPercentFromBelow) {
  const std::uint64_t smallest = extract_within(1).glb.size();
  const Extracted most = extract_within(10'000'000);
  EXPECT_TRUE(most.within);
  EXPECT_TRUE(std::ranges::any_of(most.notes, [](const std::string& note) {
    return note.find("no more to put into the file") != std::string::npos;
  }));
  int within = 0, asked = 0;
  for (std::uint64_t bytes = smallest + 300; bytes < most.glb.size(); bytes += 160, ++asked) {
    const Extracted e = extract_within(bytes);
    EXPECT_LE(e.glb.size(), bytes);
    EXPECT_GE(static_cast<double>(e.glb.size()), 0.98 * static_cast<double>(bytes));
    expect_valid(e.glb, std::to_string(bytes));
    EXPECT_EQ(e.mesh_bytes + e.images[0].bytes, e.glb.size());
    EXPECT_TRUE(e.within) << bytes << " got " << e.glb.size() << " S_" << e.scale << " "
                          << e.images[0].width_px << " q" << e.images[0].quality;
    within += e.within;
  }
  EXPECT_GT(asked, 4);
  EXPECT_EQ(within, asked);
}

TEST(ExtractModel, OutsideTheReachTheNearestFileIsGiven) {
  const Extracted small = extract_within(100);
  EXPECT_FALSE(small.within);
  EXPECT_EQ(small.scale, 5);
  expect_valid(small.glb, "smallest");
  EXPECT_LE(small.glb.size(), extract_within(small.glb.size() + 200).glb.size());
}

TEST(ExtractModel, MoreBytesGiveNoWorsePicture) {
  double before = 1;
  for (const std::uint64_t bytes : {5000u, 8000u, 12000u}) {
    const Extracted e = extract_within(bytes);
    EXPECT_LE(e.difference, before + 0.005) << bytes;
    before = e.difference;
  }
}

TEST(ExtractModel, FilesOfTheOtherScaleAreNotNearer) {
  int compared = 0;
  for (const std::uint64_t bytes : {6000u, 9000u}) {
    const Extracted chosen = extract_within(bytes);
    for (const int scale : {0, 5}) {
      if (scale == chosen.scale) continue;
      ExtractBudget r = budget({bytes});
      r.scale = scale;
      const Extracted other = extract({r});
      if (other.glb.size() > bytes) continue;
      EXPECT_LE(chosen.difference, 1.01 * other.difference) << bytes << " S_" << *r.scale;
      ++compared;
    }
  }
  EXPECT_GT(compared, 0) << "no file of another scale fits";
}

TEST(ExtractModel, ThreadsDoNotChangeAByte) {
  EXPECT_EQ(extract_within(7000, 1).glb, extract_within(7000, 8).glb);
  EXPECT_EQ(extract({}, 1).glb, extract({}, 8).glb);
}

TEST(ExtractModel, SaysWhichScaleOrRungIsNotThere) {
  ExtractScale r;
  r.scale = 3;
  EXPECT_THROW(extract({r}), InputError);
  ExtractBudget b = budget({9000});
  b.scale = 3;
  EXPECT_THROW(extract({b}), InputError);
  ExtractScale rung;
  rung.rung = 2;
  EXPECT_THROW(extract({rung}), InputError);
  rung.rung = 0;
  EXPECT_EQ(extract({rung}).images[0].quality, 20);
}

TEST(ExtractModel, DamageIsAnErrorWhereverItIs) {
  for (const char* entry : {"texture/0/r01.pack", "texture/0/tables.pack", "mesh/s00.glb", "tables.bin"}) {
    testing::PackagePatcher patcher(package_bytes());
    patcher.edit(entry, [](Bytes& b) { b[b.size() / 2] ^= 0x55; });
    ExtractScale r;
    r.scale = 0;
    EXPECT_THROW(
        {
          PackageReader package = open(patcher.package());
          extract_model(package, {r}, {});
        },
        FormatError)
        << entry;
  }
  // Sealed again, so that only its content is wrong.
  for (const char* entry : {"texture/0/r01.pack", "mesh/s00.glb"})
    for (const std::size_t at : {0u, 13u, 40u}) {
      testing::PackagePatcher patcher(package_bytes());
      patcher.edit(entry, [at](Bytes& b) { b[at] ^= 0xff; }).seal();
      ExtractBudget r = budget({8000});
      r.scale = 0;
      try {
        PackageReader package = open(patcher.package());
        expect_valid(extract_model(package, {r}, {}).glb, entry);  // some bytes only change texels
      } catch (const Error& e) {
        EXPECT_FALSE(std::string(e.what()).empty());
      }
    }
}

TEST(ExtractModel, AvifFillsTheBytesAndIsReadAgain) {
  ExtractBudget r = budget({6000});
  r.images = ExtractImages::kAvif;
  const Extracted e = extract({r});
  expect_valid(e.glb, "avif");
  EXPECT_LE(e.glb.size(), 6000u);
  ASSERT_FALSE(e.images.empty());
  for (const ExtractedImage& i : e.images) EXPECT_EQ(i.format, FileImage::kAvif);
  EXPECT_EQ(
      std::ranges::count_if(e.notes, [](const auto& n) { return n.find("Blender does not") != n.npos; }), 1);
  r.images = ExtractImages::kWebp;
  EXPECT_EQ(extract({r}).notes.size() + 1, e.notes.size());
  NoFiles none;
  const Model model = import_package_glb("x.glb", e.glb, none, {}).model;
  ASSERT_EQ(model.images.size(), e.images.size());
  EXPECT_EQ(model.images[0].width_px, e.images[0].width_px);
}

/// Its meshes take several times a GLB's bytes: the fifth GLB that is tried fits, no earlier one.
TEST(ExtractModel, AUsdzOfFewBytesIsLookedForUntilItFits) {
  PackageReader package(open_store(TEXMESH_SOURCE_DIR "/tests/golden/v2.0-scan.texmesh"));
  const Extracted found = extract_usdz(package, {budget({25'000})}, {}).front();
  EXPECT_TRUE(found.within);
  EXPECT_LE(found.glb.size(), 25'000u);
  const Extracted least = extract_usdz(package, {budget({1})}, {}).front();
  EXPECT_FALSE(least.within);
  EXPECT_LT(least.glb.size(), found.glb.size());
}

TEST(ExtractModel, AUsdzHasJpegWhereWebpOrAvifIsAskedForAndSaysSo) {
  for (const ExtractImages images : {ExtractImages::kWebp, ExtractImages::kAvif}) {
    ExtractScale scale;
    scale.images = images;
    ExtractBudget bytes = budget({60'000});
    bytes.images = images;
    for (const ExtractRequest& request : {ExtractRequest{scale}, ExtractRequest{bytes}}) {
      PackageReader package = open(package_bytes());
      const Extracted file = extract_usdz(package, request, {}).front();
      EXPECT_EQ(file.images.at(0).format, FileImage::kJpeg);
      EXPECT_EQ(std::ranges::count_if(file.notes,
                                      [](const auto& n) { return n.find("are JPEG or PNG") != n.npos; }),
                1);
    }
  }
}

TEST(ExtractModel, ReportsAreJson) {
  ExtractBudget r = budget({3000});
  r.images = ExtractImages::kWebp;
  const auto json = nlohmann::json::parse(to_json_line(extract({r})));
  EXPECT_EQ(json["asked_bytes"], 3000);
  EXPECT_EQ(json["images"][0]["format"], "webp");
  EXPECT_NE(extract_text(extract({r})).find(": "), std::string::npos);
}

TEST(ExtractFiles, EveryFileIsTheOneThatItsNumberAloneGives) {
  const Bytes with = package_with_proxies();
  for (const Bytes* bytes : {&package_bytes(), &with}) {
    // Out of order, twice the same search, too few bytes for anything, and more than there is.
    const std::vector<std::uint64_t> numbers{9000, 2500, 4000, 10, 2600, 1000000};
    PackageReader package = open(*bytes);
    const std::vector<Extracted> together = extract_files(package, {budget(numbers)}, {});
    ASSERT_EQ(together.size(), numbers.size());
    for (std::size_t k = 0; k < numbers.size(); ++k) {
      PackageReader fresh = open(*bytes);
      const Extracted alone = extract_model(fresh, {budget({numbers[k]})}, {});
      EXPECT_EQ(together[k].glb, alone.glb) << numbers[k];
      EXPECT_EQ(together[k].difference, alone.difference) << numbers[k];
      EXPECT_EQ(together[k].mesh_difference, alone.mesh_difference) << numbers[k];
      EXPECT_EQ(together[k].within, alone.within) << numbers[k];
      EXPECT_EQ(together[k].proxy, alone.proxy) << numbers[k];
      EXPECT_EQ(together[k].notes, alone.notes) << numbers[k];
    }
  }
}

TEST(ExtractFiles, LevelsOfDetailToo) {
  const std::vector<std::uint64_t> numbers{6000, 12000};
  PackageReader package = open(package_bytes());
  ExtractBudget r = budget(numbers);
  r.levels = true;
  const std::vector<Extracted> together = extract_files(package, {r}, {});
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    r.bytes = {numbers[k]};
    EXPECT_EQ(together[k].glb, extract_model(package, {r}, {}).glb) << numbers[k];
  }
}

TEST(ExtractFiles, ProgressRisesToOne) {
  PackageReader package = open(package_bytes());
  std::vector<double> seen;
  RunContext context;
  context.progress = [&](double fraction) { seen.push_back(fraction); };
  extract_files(package, {budget({3000, 5000})}, context);
  ASSERT_FALSE(seen.empty());
  EXPECT_TRUE(std::ranges::is_sorted(seen));
  EXPECT_EQ(seen.back(), 1);
}

}  // namespace texmesh::extract_test
