#include "tools/publish/site/site.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <map>

#include "format/base/errors.h"
#include "pipeline/batch/stale_packages.h"
#include "pipeline/io/uri.h"
#include "tests/support/command.h"
#include "tests/support/packages.h"

namespace texmesh::site_test {

using testing::TemporaryFolder;

TEST(ObjectName, IsThePathInLettersThatEverySystemTakes) {
  EXPECT_EQ(object_name("bust.texmesh"), "bust");
  EXPECT_EQ(object_name("casts/Bust_2.v1/"), "casts/bust_2.v1");
  EXPECT_EQ(object_name("a  <b>.texmesh"), "a  =3Cb=3E");
  EXPECT_EQ(object_name("Zo\u00e9 \u96d5.texmesh"), "zo\u00e9 \u96d5");
  EXPECT_EQ(object_name(".hidden.texmesh"), "=2Ehidden");
  EXPECT_EQ(object_name(".texmesh"), "=");
}

/// Names of all kinds that people give: blanks, dots, signs, letters of many scripts, long ones.
std::vector<std::string> all_names() {
  std::vector<std::string> names{"a b",      "a-b",          "a_b",
                                 "a=20b",    "a%20b",        "a..b",
                                 "a.",       "a ",           ".a",
                                 "..",       "...",          "=",
                                 "==",       "=3D",          "-",
                                 "--",       "a#b",          "a?b",
                                 "a&b",      "a\"b",         "a:b",
                                 "a\\b",     "con",          "\u00fc",
                                 "u\u0308x", "\u96d5\u523b", "\u0441\u043a\u0430\u043d",
                                 "\xff",     "\xfe",         "a+b",
                                 "a@b",      "a~1",          "a\tb",
                                 "x.y.z",    "index",        "0"};
  for (const std::size_t length : {179u, 180u, 181u, 200u, 2000u}) {
    names.push_back(std::string(length, 'x'));
    names.push_back(std::string(length, 'x') + "y");
    std::string umlauts;
    while (umlauts.size() < length) umlauts += "\u00e4";
    if (length % 2 == 0) names.push_back(umlauts);
  }
  std::vector<std::string> all = names;
  for (const std::string& folder : names)
    for (const std::string& name : {names[0], names[5], names.back()}) all.push_back(folder + "/" + name);
  return all;
}

TEST(ObjectName, DifferentPathsHaveDifferentNamesThatEveryFileSystemTells) {
  std::map<std::string, std::string> path_of;
  for (const std::string& path : all_names()) {
    const std::string name = object_name(path + ".texmesh");
    const auto [other, fresh] = path_of.emplace(name_key(name), path);
    EXPECT_TRUE(fresh) << path << " and " << other->second;
    EXPECT_TRUE(is_utf8(name)) << path;
    for (std::size_t begin = 0, end = 0; begin <= name.size(); begin = end + 1) {
      end = std::min(name.find('/', begin), name.size());
      const std::string part = name.substr(begin, end - begin);
      EXPECT_FALSE(part.empty()) << path;
      EXPECT_LE(part.size(), 200u) << path;
      EXPECT_NE(part.front(), '.') << path;
      EXPECT_EQ(part.find_first_of("<>:\"|?*\\\t"), part.npos) << path;
      EXPECT_TRUE(part.back() != '.' && part.back() != ' ') << path;
    }
  }
}

TEST(ObjectName, CaseAndCompositionDoNotCount) {
  EXPECT_EQ(object_name("\u00dcber/Bust.texmesh"), object_name("u\u0308ber/bUST.texmesh"));
}

/// Writes a package of this title under a name.
std::size_t add_package(const TemporaryFolder& folder, const std::string& file, const std::string& title) {
  testing::PackageParts parts = testing::make_package_parts();
  parts.manifest.title = title;
  const Bytes bytes = parts.build();
  testing::write_text(folder / file, std::string(bytes.begin(), bytes.end()));
  return bytes.size();
}

TEST(Site, AnAddressDependsOnNoOtherPackage) {
  TemporaryFolder one, many;
  add_package(one, "\u96d5.texmesh", "");
  for (const char* name : {"-", "\u523b", "\u96d5", "a"})
    add_package(many, std::string(name) + ".texmesh", "");
  const Site few = read_site(one.path().string(), {}), all = read_site(many.path().string(), {});
  const auto found = std::ranges::find(all.objects, "\u96d5", &SiteObject::name);
  ASSERT_NE(found, all.objects.end());
  EXPECT_EQ(found->address, few.objects.at(0).address);
  EXPECT_EQ(all.objects.size(), 4u);
}

TEST(Site, ContentHasAnAddressOfItsOwn) {
  TemporaryFolder folder;
  add_package(folder, "a.texmesh", "first");
  const std::string before = read_site(folder.path().string(), {}).objects.at(0).address;
  add_package(folder, "a.texmesh", "second");
  const std::string after = read_site(folder.path().string(), {}).objects.at(0).address;
  EXPECT_NE(before, after);
  EXPECT_TRUE(after.starts_with("packages/a.") && after.ends_with(".texmesh")) << after;
}

TEST(Site, LeavesOutWhatNoModelMakesAndNamesThatMeet) {
  TemporaryFolder folder;
  for (const char* name : {"a", "A", "b", "c"}) add_package(folder, std::string(name) + ".texmesh", "");
  testing::write_text(folder / kStaleList, "b.texmesh\n");
  const Site site = read_site(folder.path().string(), {});
  EXPECT_EQ(site.objects.size(), 2u);
  ASSERT_EQ(site.faults.size(), 1u);
  EXPECT_NE(site.faults[0].message.find("A.texmesh"), std::string::npos) << site.faults[0].message;
  EXPECT_EQ(site.stale, std::vector<std::string>{"b.texmesh"});
}

TEST(Site, OneBeneathThePackagesAddsNoneToAnother) {
  TemporaryFolder folder;
  add_package(folder, "a.texmesh", "");
  std::filesystem::create_directories(folder / "site/packages");
  std::filesystem::copy_file(folder / "a.texmesh", folder / "site/packages/a.texmesh");
  EXPECT_EQ(read_site(folder.path().string(), {}).objects.size(), 2u);
  testing::write_text(folder / "site/.texmesh-files", "packages/a.texmesh\n");
  EXPECT_EQ(read_site(folder.path().string(), {}).objects.size(), 1u);
}

TEST(Site, HasFiguresOfEveryPackageByTitle) {
  TemporaryFolder folder;
  add_package(folder, "1.texmesh", "zebra");
  const std::size_t bytes = add_package(folder, "2.texmesh", "Ape");
  add_package(folder, "3.texmesh", "");
  const Site site = read_site(folder.path().string(), {});
  ASSERT_EQ(site.objects.size(), 3u);
  EXPECT_EQ(site.objects[0].title, "3");  // the file's name
  EXPECT_EQ(site.objects[1].title, "Ape");
  EXPECT_EQ(site.objects[2].title, "zebra");
  EXPECT_EQ(site.objects[1].bytes, bytes);
  EXPECT_EQ(site.objects[1].texture_px, 64u);
  EXPECT_GT(site.objects[1].start_bytes, 0u);
  EXPECT_EQ(site.objects[1].address, "packages/2." + site.objects[1].digest + ".texmesh");
}

TEST(Site, APackageThatACopyCutOffIsAFault) {
  TemporaryFolder folder;
  const std::size_t bytes = add_package(folder, "cut.texmesh", "");
  add_package(folder, "whole.texmesh", "");
  std::filesystem::resize_file(folder / "cut.texmesh", bytes - 1);
  const std::string tree = std::string(TEXMESH_SOURCE_DIR) + "/tests/golden/v2.0-tree";
  for (const char* name : {"tree", "torn", "short"})
    std::filesystem::copy(tree, folder / name, std::filesystem::copy_options::recursive);
  std::filesystem::remove(folder / "torn/mesh/s00.glb");
  std::filesystem::resize_file(folder / "short/mesh/s00.glb", 100);
  const Site site = read_site(folder.path().string(), {});
  std::set<std::string> faults;
  for (const SiteFault& f : site.faults) faults.insert(f.path);
  EXPECT_EQ(faults, (std::set<std::string>{"cut.texmesh", "short/", "torn/"}));
  EXPECT_EQ(site.objects.size(), 2u);
}

/// The page of the one object of a site whose package says this of itself.
std::string page_of(const About& about, SiteOptions options = {}) {
  TemporaryFolder folder;
  testing::PackageParts parts = testing::make_package_parts();
  parts.about = about;
  const Bytes bytes = parts.build();
  for (const char* name : {"in", "viewer"}) std::filesystem::create_directory(folder / name);
  testing::write_text(folder / "in/a.texmesh", std::string(bytes.begin(), bytes.end()));
  options.viewer = folder / "viewer";
  write_site(read_site(folder / "in", options), folder / "www");
  return testing::read_text(folder / "www/objects/a.html");
}

TEST(Site, AFrameOnPagesOfOthersHasNoDevelopersPanel) {
  SiteOptions options;
  options.url = "https://museum.example/";
  const std::string page = page_of({}, options);
  EXPECT_NE(page.find("viewer/index.html?panel=none&amp;amp;pkg="), page.npos);
  EXPECT_EQ(page.find("panel=0"), page.npos);
}

TEST(Site, ACitationHasTheYearOfTheModelAndItsCredit) {
  About about;
  about.attribution = "Museum & Co";
  about.licence = "CC0-1.0";
  const std::pair<std::vector<NamedText>, const char*> years[] = {
      {{{"found", "1897"}, {"scanned", "spring 2021"}}, "2021"},
      {{{"dc:date", "1897"}, {"xmp:CreateDate", "2020-01-02"}}, "2020"},
      {{{"created", "20190304"}}, "2019"},
      {{{"date", "no. 12345, 3.4.2018"}}, "2018"},
      {{{"found", "1897"}, {"Scanned", "last year"}}, ""}};
  for (const auto& [dates, year] : years) {
    about.dates = dates;
    const std::string page = page_of(about);
    const std::string expected = *year ? fmt::format("year = {{{}}}", year) : "";
    EXPECT_NE(page.find(expected), page.npos) << year;
    EXPECT_EQ(page.find("year = ") != page.npos, *year != 0) << dates[0].text;
    EXPECT_EQ(page.find("issued") != page.npos, *year != 0) << dates[0].text;
    EXPECT_NE(page.find("note = {Museum \\&amp; Co; Licence: CC0-1.0}"), page.npos);
    EXPECT_NE(page.find("&quot;note&quot;: &quot;Museum &amp; Co; Licence: CC0-1.0&quot;"), page.npos);
  }
}

TEST(Site, DownloadsOfUnknownUnitsAreTold) {
  TemporaryFolder folder;
  for (const char* name : {"a", "b"}) add_package(folder, std::string(name) + ".texmesh", "");
  SiteOptions options;
  EXPECT_EQ(unknown_units(read_site(folder.path().string(), options)), "");
  options.downloads_px = 64;
  Site site = read_site(folder.path().string(), options);
  for (SiteObject& o : site.objects) o.about.metres_per_unit = 0;
  EXPECT_TRUE(
      unknown_units(site).starts_with("the unit of length of 2 packages is not known, as of a.texmesh;"))
      << unknown_units(site);
  site.objects[0].about.metres_per_unit = 0.001;
  EXPECT_TRUE(unknown_units(site).starts_with("the unit of length of b.texmesh is not known; "));
  site.objects[1].about.metres_per_unit = 1;
  EXPECT_EQ(unknown_units(site), "");
}

TEST(Site, AFolderWithoutPackagesIsRefused) {
  TemporaryFolder folder;
  EXPECT_THROW(read_site(folder.path().string(), {}), InputError);
  EXPECT_THROW(read_site(folder / "none", {}), InputError);
}

}  // namespace texmesh::site_test
