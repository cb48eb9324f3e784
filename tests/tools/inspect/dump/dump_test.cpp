#include <gtest/gtest.h>

#include "format/rules/allocation.h"
#include "pipeline/compile/options.h"
#include "pipeline/io/table.h"
#include "tests/support/packages.h"
#include "tools/inspect/dump/dump.h"
#include "tools/inspect/provenance.h"

namespace texmesh::dump_test {

using Json = nlohmann::ordered_json;

struct Dump : ::testing::Test {
  Bytes bytes = testing::make_package_parts().build();
  PackageReader package{open_container(memory_source(bytes))};

  std::string text(DumpPart part) { return dump_text(package, part); }
  bool says(DumpPart part, const std::string& line) { return text(part).find(line) != std::string::npos; }
};

TEST_F(Dump, ScalesJsonHasTheAgreedShape) {
  const Json j = dump_json(package, DumpPart::kScales);
  ASSERT_EQ(j.size(), 1u);
  ASSERT_EQ(j["scales"].size(), 2u);
  const Json& s = j["scales"][1];
  EXPECT_EQ(s["scale"], 5);
  EXPECT_EQ(s["triangles"], package.manifest().scales[1].triangles);
  EXPECT_EQ(s["vertices"], package.manifest().scales[1].vertices);
  EXPECT_EQ(s["bytes"], package.manifest().scales[1].glb.bytes);
  EXPECT_EQ(s["major"], true);
}

TEST_F(Dump, SummaryIsAPageThatExplainsThePackage) {
  const std::string page = text(DumpPart::kSummary);
  for (const std::string line :
       {"Two spheres\n", "format    2.0, made by texmesh test\n", "origin    10  20  30\n",
        "bounds    -1  -1  -1\n", "  S_5 ", "base-colour", "ball.jpg", "bytes by kind", "ladder.rungs"})
    EXPECT_NE(page.find(line), std::string::npos) << line << "\n" << page;
  EXPECT_EQ(page.find(" \n"), std::string::npos) << "blanks at a line's end";
  EXPECT_TRUE(says(DumpPart::kScales, "step function: displayed height in px"));
  EXPECT_TRUE(says(DumpPart::kScales, "O_V/E_S px"));
}

TEST_F(Dump, BytesByKindAddUpToTheEntries) {
  const auto kinds =
      bytes_by_kind(package.manifest(), package.store().read_manifest().size(), package.index());
  std::uint64_t sum = 0, expected = 0;
  for (const KindBytes& k : kinds) sum += k.bytes;
  for (const ContainerEntry& e : package.store().list()) expected += e.bytes;
  EXPECT_EQ(sum, expected);
}

TEST_F(Dump, FragmentsShowTheGridAndEverySize) {
  EXPECT_TRUE(says(DumpPart::kFragments, "  0 9\n  5 .\n")) << text(DumpPart::kFragments);
  const Json j = dump_json(package, DumpPart::kFragments)["fragments"][0];
  ASSERT_EQ(j["fragments"].size(), 3u);
  EXPECT_EQ(j["fragments"][0]["fragment"], 1);
  EXPECT_EQ(j["fragments"][0]["eta"], 1);
  EXPECT_EQ(j["fragments"][1]["eta"], 0.5);
  EXPECT_EQ(j["fragments"][0]["bytes"][1], package.tables().planes[0].size_bytes[4 + 1]);
}

TEST_F(Dump, LadderSumsTheFragments) {
  const Json rungs = dump_json(package, DumpPart::kLadder)["ladder"][0]["rungs"];
  ASSERT_EQ(rungs.size(), 2u);
  const auto& t = package.tables().planes[0];
  EXPECT_EQ(rungs[1]["bytes"], t.size_bytes[4] + t.size_bytes[5] + t.size_bytes[6]);
  EXPECT_NEAR(rungs[0]["mse"].get<double>(), 100, 0.1);
  EXPECT_NEAR(rungs[0]["ssim"].get<double>(), 0.75, 1e-3);
  EXPECT_TRUE(says(DumpPart::kLadder, "mean SSIM"));
}

TEST(RungFigures, WeighQualityByTexelsAndBySurface) {
  PlaneTables t;
  t.columns = 3, t.rows = 1;
  t.rung_quality = {20, 80};
  t.table_bytes = {1, 2};
  t.size_bytes = {10, 20, 0, 30, 40, 0};
  t.mse = {100, 10, 0, 50, 5, 0};
  t.dssim = {0.4f, 0.1f, 0, 0.2f, 0.05f, 0};
  t.skip_dssim = {0.5f, 0.2f, 0};
  t.covered_texels = {300, 100, 0};
  t.surface_fraction = {0.25f, 0.75f, 0};
  t.order = {0, 1};
  const std::vector<RungFigures> figures = rung_figures(t);
  const std::vector<float> weight = surface_weights(t);
  for (std::size_t r = 0; r < 2; ++r) {
    const double a = static_cast<double>(t.dssim[3 * r]), b = static_cast<double>(t.dssim[3 * r + 1]);
    EXPECT_NEAR(figures[r].ssim, 1 - (3 * a + b) / 4, 1e-9);
    const double wa = static_cast<double>(weight[0]), wb = static_cast<double>(weight[1]);
    EXPECT_NEAR(figures[r].surface_ssim, 1 - (wa * a + wb * b) / (wa + wb), 1e-9);
    EXPECT_GT(figures[r].surface_ssim, figures[r].ssim) << "most of the surface is the better one";
  }
}

TEST_F(Dump, TablesGiveTheModelAndTheAllocation) {
  EXPECT_TRUE(says(DumpPart::kTables, "of 3 fragments: medians A 300, B 0.5, correlation 0.9800"))
      << text(DumpPart::kTables);
  const Json j = dump_json(package, DumpPart::kTables);
  const Json& scale = j["tables"][0]["scales"][0];
  EXPECT_EQ(scale["total_bytes"].size(), 21u);
  EXPECT_EQ(scale["gamma"], 0.5);
  EXPECT_EQ(scale["bytes_at_gamma"], scale["total_bytes"][10]);
  EXPECT_TRUE(scale["fragment_quality"][3].is_null());
  EXPECT_EQ(j["measured_quality"]["scales"].size(), j["measured_quality"]["geometry"][0]["flip"].size());
  EXPECT_TRUE(says(DumpPart::kTables, "losses add up with exponent"));
}

TEST_F(Dump, TablesAtAnyGammaAreThoseOfTheLibrary) {
  const PlaneTables& t = package.tables().planes[0];
  EXPECT_EQ(text(DumpPart::kTables).find("by falling importance at Gamma"), std::string::npos);
  for (const double gamma : {0.0, 0.3, 1.0}) {
    const std::string page = dump_text(package, DumpPart::kTables, gamma);
    const Json scales = dump_json(package, DumpPart::kTables, gamma)["tables"][0]["scales"];
    ASSERT_EQ(scales.size(), t.scale_count());
    std::vector<std::string> lines(t.fragment_count());
    for (std::size_t s = 0; s < t.scale_count(); ++s) {
      const std::vector<float> quality = quality_of(t, s, gamma);
      const std::vector<std::uint32_t> spent = bytes_of(t, rungs_of(t, s, gamma));
      EXPECT_EQ(scales[s]["gamma"], gamma);
      EXPECT_EQ(scales[s]["bytes_at_gamma"], sum_of(spent));
      for (const std::uint16_t f : t.order) {
        EXPECT_EQ(scales[s]["fragment_quality"][f], quality[f]);
        EXPECT_EQ(scales[s]["fragment_bytes"][f], spent[f]);
      }
      const std::string line = fixed(static_cast<double>(quality[t.order[0]]), 1);
      EXPECT_NE(page.find(line), std::string::npos) << line << "\n" << page;
    }
    EXPECT_NE(page.find("at Gamma " + shortest(gamma) + ":"), std::string::npos) << page;
  }
  EXPECT_NE(dump_json(package, DumpPart::kTables, 0.0), dump_json(package, DumpPart::kTables, 1.0));
}

/// The fixture's chain is S_0 to S_5: every step .03, p95 .01 a step, chains .02.
TEST_F(Dump, PerceptualHasTheThesissTables) {
  const std::string page = text(DumpPart::kPerceptual);
  EXPECT_NE(page.find("(Table 7.1)"), std::string::npos) << page;
  EXPECT_NE(page.find("  0.0500   0.0671"), std::string::npos) << "p95, and .03 sqrt(5): " << page;
  const Json j = dump_json(package, DumpPart::kPerceptual)["perceptual"];
  EXPECT_EQ(j["jnd"], package.manifest().jnd);
  ASSERT_EQ(j["steps"].size(), 6u);
  EXPECT_EQ(j["steps"][5]["triangles"], package.manifest().scales[1].triangles);
  ASSERT_EQ(j["values"].size(), 7u);
  for (const Json& by : j["values"]) EXPECT_EQ(by["pairs"].size(), 15u) << by["by"];
  EXPECT_EQ(j["values"][0]["by"], "p95");
  EXPECT_EQ(j["values"][0]["pairs"][4]["to"], 5);
  EXPECT_NEAR(j["values"][1]["pairs"][4]["value"].get<double>(), 0.067082, 1e-6);
  EXPECT_EQ(j["values"][2]["pairs"][4]["value"], 0.02f);
}

TEST_F(Dump, EntriesStandInContainerOrder) {
  const Json entries = dump_json(package, DumpPart::kEntries)["entries"];
  const auto listed = package.store().list();
  ASSERT_EQ(entries.size(), listed.size());
  for (std::size_t k = 0; k < listed.size(); ++k) {
    EXPECT_EQ(entries[k]["path"], listed[k].path);
    EXPECT_EQ(entries[k]["offset"], listed[k].offset);
    EXPECT_EQ(entries[k]["bytes"], listed[k].bytes);
    EXPECT_EQ(entries[k]["sha256"], to_hex(sha256(testing::PackagePatcher(bytes).entry(listed[k].path))));
  }
}

TEST_F(Dump, AllJoinsTheParts) {
  const Json all = dump_json(package, DumpPart::kAll);
  for (const char* member :
       {"package", "scales", "fragments", "ladder", "tables", "perceptual", "entries", "provenance"})
    EXPECT_TRUE(all.contains(member)) << member;
  EXPECT_GT(text(DumpPart::kAll).size(), text(DumpPart::kSummary).size());
}

TEST(DumpUntextured, SaysSo) {
  testing::PackageParts p = testing::make_package_parts();
  p.textures.clear(), p.streams.clear(), p.tables.planes.clear(), p.thesis.planes.clear();
  p.manifest.plane_count = 0;
  p.quality.groups.clear();
  const Bytes bytes = p.build();
  PackageReader package(open_container(memory_source(bytes)));
  EXPECT_NE(dump_text(package, DumpPart::kSummary).find("textures: none\n"), std::string::npos);
  EXPECT_EQ(dump_text(package, DumpPart::kFragments), "no textures\n");
  EXPECT_EQ(dump_text(package, DumpPart::kLadder), "no textures\n");
  EXPECT_NO_THROW(dump_text(package, DumpPart::kAll));
}

TEST(DumpTitle, CannotCommandATerminal) {
  testing::PackageParts p = testing::make_package_parts();
  p.provenance["tool"] = "texmesh \x1b[2J";
  const Bytes bytes = p.build();
  PackageReader package(open_container(memory_source(bytes)));
  EXPECT_EQ(dump_text(package, DumpPart::kAll).find('\x1b'), std::string::npos);
}

TEST(OptionChanges, AreThoseThatDifferFromTheDefaults) {
  CompileOptions options;
  EXPECT_TRUE(changed_options(Json::parse(write_profile(options))).empty());
  options.ssf.scales = 7;
  Json profile = Json::parse(write_profile(options));
  profile["later_stage"]["new_option"] = true;
  const auto changes = changed_options(profile);
  ASSERT_EQ(changes.size(), 2u);
  EXPECT_EQ(changes[0].name, "ssf.scales");
  EXPECT_EQ(changes[0].value, "7");
  EXPECT_EQ(changes[0].fallback, "20");
  EXPECT_EQ(changes[1].name, "later_stage.new_option");
  EXPECT_EQ(changes[1].fallback, "");
}

}  // namespace texmesh::dump_test
