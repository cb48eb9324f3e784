// Reports of a small package: the page, what it shows, and its folder.
#include "tools/publish/report/report.h"
#include "pipeline/io/markup.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "format/base/errors.h"
#include "format/container/layout.h"
#include "stages/jpeg/jpeg.h"
#include "tests/support/command.h"
#include "tests/support/packages.h"
#include "tests/support/schema.h"
#include "tests/tools/publish/pages/html_check.h"
#include "tools/publish/pages/page.h"
#include "tools/publish/report/report_pictures.h"

namespace texmesh::testing::report_test {

constexpr const char* kHostile = "<img src=//x onerror=alert(1)> & \"x\" 'y'";

PackageParts parts_with_poster() {
  PackageParts parts = make_package_parts();
  parts.manifest.title = kHostile;
  parts.manifest.origin = {};  // as the meshes stand in files
  parts.manifest.poster = PosterRef{{}, 32, 32};
  Pixels grey{32, 32, 3, std::vector<std::uint8_t>(32 * 32 * 3, 120)};
  parts.streams[kPosterPath] = encode_jpeg(grey, 80, Subsampling::k420);
  return parts;
}

Report report_of(const Bytes& package, ReportOptions options = {}, int threads = 1, int views = 3) {
  PackageReader reader(open_container(memory_source(package)));
  RunContext context;
  context.threads = threads;
  options.views = views;
  return make_report(reader, options, context);
}
std::string page_of(const Report& report) {
  return {report.files.at(0).bytes.begin(), report.files.at(0).bytes.end()};
}

const Bytes& sample() {
  static const Bytes bytes = parts_with_poster().build();
  return bytes;
}

TEST(Report, ThePageIsWellFormedAndStandsAlone) {
  const Report report = report_of(sample());
  const std::string page = page_of(report);
  EXPECT_EQ(report.files[0].path, "index.html");
  EXPECT_EQ(tag_fault(page), "");
  for (const char* never :
       {"http://", "https://", "<script", "url(", "@import", "\"nan", ">nan", " nan", "onerror=alert(1)>"})
    EXPECT_EQ(page.find(never), std::string::npos)
        << never << ": " << page.substr(page.find(never) - std::min<std::size_t>(page.find(never), 60), 120);
  std::set<std::string> files;
  for (const ReportFile& f : report.files) EXPECT_TRUE(files.insert(f.path).second) << f.path;
  std::set<std::string> ids, used;
  for (const std::string& id : attributes(page, "id")) EXPECT_TRUE(ids.insert(id).second) << id;
  for (const std::string& src : attributes(page, "src")) used.insert(src);
  for (const std::string& href : attributes(page, "href"))
    if (href.starts_with("#"))
      EXPECT_TRUE(ids.contains(href.substr(1))) << href;
    else if (href != "data:,")  // no icon
      used.insert(href);
  files.erase("index.html");
  EXPECT_EQ(used, files);
}

TEST(Report, TextOfThePackageIsEscaped) {
  const std::string page = page_of(report_of(sample()));
  EXPECT_NE(page.find("<h1>" + markup_escaped(kHostile) + "</h1>"), std::string::npos);
  EXPECT_EQ(page.find("<img src=//"), std::string::npos);
}

TEST(Report, PicturesHaveTextAndSizes) {
  const std::string page = page_of(report_of(sample()));
  std::size_t images = 0;
  for (std::size_t at = page.find("<img "); at != std::string::npos; at = page.find("<img ", at + 1)) {
    const std::string tag = page.substr(at, page.find('>', at) - at);
    EXPECT_NE(tag.find(" alt=\""), std::string::npos) << tag;
    EXPECT_EQ(tag.find(" alt=\"\""), std::string::npos) << tag;
    EXPECT_NE(tag.find(" width=\""), std::string::npos) << tag;
    ++images;
  }
  EXPECT_GE(images, 1 + 2 * 3u);  // the poster, and two rows of three
}

TEST(Report, SaysWhatTheSwitchSizesAre) {
  const Report report = report_of(sample());
  ASSERT_EQ(report.switches.size(), 1u);
  const SwitchSize& s = report.switches[0];
  EXPECT_EQ(s.scale, 5);
  EXPECT_EQ(s.rendered_px, 200);
  EXPECT_EQ(s.views.mean.size(), 3u);
  EXPECT_GT(s.views.worst_mean(), 0);
  ReportOptions generous, strict;
  generous.limits = {1, 1};
  strict.limits = {0, 0};
  EXPECT_TRUE(report_of(sample(), generous).holds);
  const Report failing = report_of(sample(), strict);
  EXPECT_FALSE(failing.holds);
  EXPECT_NE(failing.verdict.find("S_5 at 200 px"), std::string::npos) << failing.verdict;
  EXPECT_NE(page_of(failing).find(markup_escaped(failing.verdict)), std::string::npos);
}

TEST(Report, ProxiesHaveASectionWhereThereAreAny) {
  PackageParts parts = parts_with_poster();
  add_proxies(parts);
  const std::string page = page_of(report_of(parts.build())), without = page_of(report_of(sample()));
  EXPECT_EQ(tag_fault(page), "");
  for (const char* text : {"id=\"proxies\"", "href=\"#proxies\"", "proxy00-front", "proxy01-side",
                           "FLIP at 128 px", "FLIP at 512 px", "0.060, P95 0.200"}) {
    EXPECT_NE(page.find(text), std::string::npos) << text;
    EXPECT_EQ(without.find(text), std::string::npos) << text;
  }
}

TEST(Report, CurvesFallWithBytes) {
  const Report report = report_of(sample());
  ASSERT_FALSE(report.curves.empty());
  for (const QualityCurves& c : report.curves) {
    EXPECT_EQ(c.scales.size(), 2u);
    ASSERT_FALSE(c.budgets.empty());
    for (std::size_t i = 1; i < c.budgets.size(); ++i) {
      EXPECT_GT(c.budgets[i].bytes, c.budgets[i - 1].bytes);
      EXPECT_LE(c.budgets[i].flip, c.budgets[i - 1].flip + 1e-9);
    }
  }
}

TEST(Report, SameBytesForAnyThreadCount) {
  const Report a = report_of(sample()), b = report_of(sample(), {}, 4);
  ASSERT_EQ(a.files.size(), b.files.size());
  for (std::size_t i = 0; i < a.files.size(); ++i)
    EXPECT_EQ(a.files[i].bytes, b.files[i].bytes) << a.files[i].path;
  EXPECT_EQ(to_json_line(a), to_json_line(b));
}

TEST(Report, JsonFollowsItsSchema) {
  const nlohmann::json j = nlohmann::json::parse(to_json_line(report_of(sample())));
  EXPECT_TRUE(follows_schema(j, "report.v1"));
  EXPECT_EQ(j["title"], kHostile);
}

TEST(Report, AgainstTheSource) {
  const TemporaryFolder folder;
  const Bytes glb = parts_with_poster().meshes.rbegin()->second;
  write_text(folder / "bust <b>.glb", std::string(glb.begin(), glb.end()));
  ReportOptions options;
  options.against = folder / "bust <b>.glb";
  const Report report = report_of(sample(), options);
  ASSERT_TRUE(report.source);
  EXPECT_EQ(report.source->file, "bust <b>.glb");
  EXPECT_GT(report.source->views.worst_mean(), 0.1);  // the coarsest file has half of the triangles
  EXPECT_EQ(tag_fault(page_of(report)), "");
  EXPECT_TRUE(follows_schema(nlohmann::json::parse(to_json_line(report)), "report.v1"));
  options.against = folder / "none.glb";
  EXPECT_THROW(report_of(sample(), options), InputError);
}

TEST(Report, ASingleViewStandsThereOnce) {
  const TemporaryFolder folder;
  const Bytes glb = parts_with_poster().meshes.rbegin()->second;
  write_text(folder / "a.glb", std::string(glb.begin(), glb.end()));
  ReportOptions options;
  options.against = folder / "a.glb";
  const Report report = report_of(sample(), options, 1, 1);
  write_report(report, folder / "r");
  EXPECT_EQ(files_beneath(folder / "r").size(), report.files.size() + 1);
  const std::string page = page_of(report);
  EXPECT_NE(page.find("source-front"), std::string::npos);
  EXPECT_EQ(page.find("-worst"), std::string::npos);
}

TEST(Report, TheFolderAppearsWholeAndReplacesReportsOnly) {
  const TemporaryFolder folder;
  const Report report = report_of(sample());
  write_report(report, folder / "r");
  EXPECT_EQ(files_beneath(folder / "r").size(), report.files.size() + 1) << "and the list of them";
  write_text(folder / "r/mine.txt", "x");
  write_report(report, folder / "r");
  EXPECT_EQ(files_beneath(folder / "r").size(), report.files.size() + 2);
  EXPECT_EQ(read_text(folder / "r/index.html"), page_of(report));

  std::filesystem::create_directories(folder / "other");
  write_text(folder / "other/index.html", "<!DOCTYPE html>\n<title>somebody's</title>");
  EXPECT_THROW(NewFolder(folder / "other", report_folder_rule()), InputError);
  EXPECT_THROW(write_report(report, folder / "other"), InputError);
  EXPECT_EQ(files_beneath(folder / "other").size(), 1u);
  NewFolder(folder / "new", report_folder_rule());
  EXPECT_FALSE(std::filesystem::exists(folder / "new"));
}

TEST(HeatColour, GrowsLighterFromBlack) {
  int before = -1;
  for (int i = 0; i <= 16; ++i) {
    const auto c = heat_colour(i / 16.0);
    const int light = 2 * c[0] + 5 * c[1] + c[2];
    EXPECT_GT(light, before);
    before = light;
  }
  EXPECT_EQ(heat_hex(-1), heat_hex(0));
  EXPECT_EQ(heat_hex(2), "#fcfdbf");
}

}  // namespace texmesh::testing::report_test
