// texmesh site as a user runs it: a site of good, damaged and hostile packages.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "format/container/layout.h"
#include "format/documents/annotations.h"
#include "pipeline/io/uri.h"
#include "tests/support/command.h"
#include "tests/support/packages.h"
#include "tests/support/schema.h"
#include "tests/support/small_builds.h"
#include "tests/tools/publish/pages/html_check.h"

namespace texmesh::testing::command_site_test {

using Json = nlohmann::json;
namespace fs = std::filesystem;

const std::string kGolden = TEXMESH_SOURCE_DIR "/tests/golden/";

class SiteCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_ / "viewer");
    fs::create_directories(folder_ / "in/deep");
    write_text(folder_ / "viewer/index.html", "<!DOCTYPE html>");
    add("b.texmesh", "Bust", {});
  }
  void add(const std::string& path, const std::string& title, const About& about) {
    PackageParts parts = make_package_parts();
    parts.manifest.title = title;
    parts.about = about;
    const Bytes bytes = parts.build();
    write_text(folder_ / ("in/" + path), std::string(bytes.begin(), bytes.end()));
  }
  CommandResult site(std::vector<std::string> more = {}) {
    std::vector<std::string> all{TEXMESH_BINARY,  "site",     folder_ / "in",    "-o",
                                 folder_ / "www", "--viewer", folder_ / "viewer"};
    all.insert(all.end(), more.begin(), more.end());
    return run_command(all);
  }
  std::string text(const std::string& file) const { return read_text(folder_ / ("www/" + file)); }
  bool exists(const std::string& file) const { return fs::exists(folder_ / ("www/" + file)); }
  TemporaryFolder folder_;
};

/// Addresses of a page that are no file of the site.
std::vector<std::string> broken_links(const fs::path& www, const std::string& page) {
  std::vector<std::string> out;
  const std::string html = read_text((www / page).string());
  for (const char* name : {"href", "src"})
    for (std::string link : attributes(html, name)) {
      if (link.starts_with("#") || link.starts_with("https://")) continue;
      link = percent_decoded(link.substr(0, link.find('?')));
      if (!fs::exists((www / page).parent_path() / link)) out.push_back(link);
    }
  return out;
}

TEST_F(SiteCommand, HasAPageForEveryPackageAndNoLinkLeadsNowhere) {
  fs::copy_file(kGolden + "v2.0-scan.texmesh", folder_ / "in/deep/scan.texmesh");
  fs::copy(kGolden + "v2.0-tree", folder_ / "in/tree", fs::copy_options::recursive);
  const CommandResult r = site({"--title", "Casts & more", "--json"});
  ASSERT_EQ(r.exit_code, 0) << r.errors;
  const Json j = Json::parse(r.output);
  EXPECT_TRUE(follows_schema(j, "site.v1"));
  ASSERT_EQ(j["objects"].size(), 3u);
  for (const Json& o : j["objects"]) {
    const std::string page = o["page"];
    EXPECT_EQ(tag_fault(text(page)), "") << page;
    EXPECT_EQ(broken_links(folder_ / "www", page), std::vector<std::string>{}) << page;
  }
  EXPECT_EQ(tag_fault(text("index.html")), "");
  EXPECT_EQ(broken_links(folder_ / "www", "index.html"), std::vector<std::string>{});
  EXPECT_NE(text("index.html").find("<h1>Casts &amp; more</h1>"), std::string::npos);
  const Packages packages = packages_in(folder_ / "www");
  EXPECT_TRUE(std::ranges::any_of(packages, [](const auto& p) {
    return p.first.find("deep/scan.") != std::string::npos &&
           p.second == read_text(kGolden + "v2.0-scan.texmesh");
  }));
  const Json listed = Json::parse(text("viewer/packages.json"))["packages"];
  ASSERT_EQ(listed.size(), 3u);
  for (const Json& p : listed) {
    const std::string url = p["url"];
    if (url.ends_with("/")) EXPECT_TRUE(exists("viewer/" + url + "manifest.json")) << url;
  }
}

TEST_F(SiteCommand, SamePackagesGiveTheSameBytes) {
  ASSERT_EQ(site().exit_code, 0);
  const Packages first = packages_in(folder_ / "www");
  ASSERT_EQ(site().exit_code, 0) << "an earlier site is replaced";
  EXPECT_EQ(packages_in(folder_ / "www"), first);
}

TEST_F(SiteCommand, ADamagedPackageIsLeftOutAndSaidTheOthersAreThere) {
  write_text(folder_ / "in/torn.texmesh", "no package");
  ASSERT_EQ(run_command({"python3", kGolden + "make_later", kGolden + "v2.0-webp.texmesh",
                         folder_ / "in/later.texmesh"})
                .exit_code,
            0);
  const CommandResult r = site({"--json"});
  EXPECT_EQ(r.exit_code, 1);
  EXPECT_NE(r.errors.find("torn.texmesh"), std::string::npos);
  const Json j = Json::parse(r.output);
  EXPECT_EQ(j["objects"].size(), 2u);
  ASSERT_EQ(j["faults"].size(), 1u);
  EXPECT_EQ(j["faults"][0]["package"], "torn.texmesh");
  EXPECT_FALSE(exists("packages/torn.texmesh"));
}

TEST_F(SiteCommand, HostileTextAndNamesStayText) {
  About about;
  about.description = "{{facts}}<iframe src=x>";
  about.attribution = "\" onmouseover=\"alert(1)";
  about.licence = "</a><script>alert(1)</script>";
  add("<script>alert(2).texmesh", "\"'><img src=x onerror=alert(1)>", about);
  add("\xff\xfe \n\".texmesh", "", {});
  add("a b.texmesh", "", {});
  add("a-b.texmesh", "", {});
  add("A-B.texmesh", "", {});
  const CommandResult r = site({"--json", "--title", "<b>{{cards}}"});
  ASSERT_EQ(r.exit_code, 1) << "one of two names that differ in case alone";
  const Json j = Json::parse(r.output);
  ASSERT_EQ(j["objects"].size(), 5u);
  EXPECT_TRUE(follows_schema(j, "site.v1"));
  std::set<std::string> pages;
  for (const Json& o : j["objects"]) {
    std::string page = o["page"];
    const std::string html = text(page);
    EXPECT_EQ(tag_fault(html), "") << page;
    for (const char* tag : {"<iframe", "<script>", "<img src=x", "<b>"})
      EXPECT_EQ(html.find(tag), std::string::npos) << tag;
    EXPECT_TRUE(attributes(html, "onmouseover").empty());
    EXPECT_EQ(broken_links(folder_ / "www", page), std::vector<std::string>{});
    std::ranges::transform(page, page.begin(), [](unsigned char c) { return std::tolower(c); });
    pages.insert(page);
  }
  EXPECT_EQ(pages.size(), 5u) << "names differ on file systems that know no case, too";
  EXPECT_EQ(text("index.html").find("<b>"), std::string::npos);
}

/// What the page tells programs: its one element of JSON-LD.
Json linked_data(const std::string& html) {
  const std::string begin = "<script type=\"application/ld+json\">";
  const std::size_t at = html.find(begin) + begin.size();
  return Json::parse(html.substr(at, html.find("</script>", at) - at));
}

TEST_F(SiteCommand, WithItsAddressItTellsEnginesNetworksAndCitations) {
  About about;
  about.description = "A cast </script><script>alert(1)</script>";
  about.creator = "N. & M. {x}";
  about.licence = "CC-BY-4.0";
  about.licence_url = "https://creativecommons.org/licenses/by/4.0/";
  about.dates = {{"created", "1923-05"}};
  add("c.texmesh", "50 % \"bust\"", about);
  ASSERT_EQ(site({"--url", "no"}).exit_code, 2);
  const CommandResult made =
      site({"--url", "https://museum.example/casts", "--downloads", "64", "--title", "Casts"});
  ASSERT_EQ(made.exit_code, 0) << made.errors;
  EXPECT_NE(made.errors.find("note: the unit of length of 2 packages"), std::string::npos) << made.errors;
  const std::string html = text("objects/c.html");
  EXPECT_EQ(tag_fault(html), "");
  EXPECT_EQ(html.find("<script>"), std::string::npos);
  const Json j = linked_data(html);
  EXPECT_EQ(j["@type"], "3DModel");
  EXPECT_EQ(j["description"], about.description);
  EXPECT_EQ(j["license"], about.licence_url);
  EXPECT_EQ(j["url"], "https://museum.example/casts/objects/c.html");
  ASSERT_EQ(j["encoding"].size(), 3u);
  for (const Json& e : j["encoding"]) {
    const std::string url = e["contentUrl"];
    EXPECT_TRUE(exists(url.substr(std::string("https://museum.example/casts/").size()))) << url;
  }
  for (const char* part : {"@misc{c,", "author = {{N. \\&amp; M. \\{x\\}}}", "title = {{50 \\% ",
                           "year = {1923}", "og:title", "rel=\"canonical\"", "&lt;iframe src=", "rel=\"ar\""})
    EXPECT_NE(html.find(part), std::string::npos) << part;
  EXPECT_EQ(broken_links(folder_ / "www", "objects/c.html"), std::vector<std::string>{});
  const std::string map = text("sitemap.xml");
  EXPECT_NE(map.find("<loc>https://museum.example/casts/objects/c.html</loc>"), std::string::npos);
}

TEST_F(SiteCommand, WithoutItsAddressNothingIsSaidThatNeedsOne) {
  ASSERT_EQ(site().exit_code, 0);
  EXPECT_FALSE(exists("sitemap.xml"));
  EXPECT_FALSE(exists("downloads"));
  const std::string html = text("objects/b.html");
  EXPECT_FALSE(linked_data(html).contains("url"));
  for (const char* part : {"canonical", "og:image", "&lt;iframe", "rel=\"ar\""})
    EXPECT_EQ(html.find(part), std::string::npos) << part;
}

TEST_F(SiteCommand, LinksAndHiddenFilesAreNotFollowed) {
  write_text(folder_ / "secret.texmesh", read_text(folder_ / "in/b.texmesh"));
  fs::create_symlink(folder_ / "secret.texmesh", folder_ / "in/link.texmesh");
  write_text(folder_ / "in/.hidden.texmesh", read_text(folder_ / "in/b.texmesh"));
  const CommandResult r = site({"--json"});
  EXPECT_EQ(Json::parse(r.output)["objects"].size(), 1u);
  EXPECT_NE(r.errors.find("note: 1 symbolic link is left out"), std::string::npos) << r.errors;
  EXPECT_NE(r.errors.find("link.texmesh"), std::string::npos) << r.errors;
}

TEST_F(SiteCommand, PackagesMayStandElsewhere) {
  ASSERT_EQ(site({"--packages-url", "https://files.example/a b"}).exit_code, 2);
  ASSERT_EQ(site({"--packages-url", "https://files.example/x"}).exit_code, 0);
  EXPECT_FALSE(exists("packages"));
  EXPECT_NE(text("objects/b.html").find("pkg=https%3A//files.example/x/b.texmesh"), std::string::npos);
}

TEST_F(SiteCommand, OtherFoldersAndEmptyOnesAreRefused) {
  fs::create_directories(folder_ / "www");
  write_text(folder_ / "www/mine.txt", "x");
  EXPECT_EQ(site().exit_code, 1);
  EXPECT_EQ(text("mine.txt"), "x");
  fs::remove_all(folder_ / "www");
  fs::remove(folder_ / "in/b.texmesh");
  EXPECT_EQ(site().exit_code, 1);
  EXPECT_FALSE(fs::exists(folder_ / "www"));
  EXPECT_EQ(run_command({TEXMESH_BINARY, "site", folder_ / "in"}).exit_code, 2);
}

TEST_F(SiteCommand, ChoicesAreThoseThatTellObjectsApart) {
  About about;
  about.licence = "CC0-1.0";
  about.creator = "A. Smith; B. <Jones>";
  about.extras = R"({"keywords":["bust"," marble "],"period":"Roman"})";
  add("c.texmesh", "Cast", about);
  ASSERT_EQ(site().exit_code, 0);
  const std::string index = text("index.html");
  for (const char* choice :
       {"<select data-facet=\"licence\">", "<option value=\"CC0-1.0\">CC0-1.0 (1)</option>",
        "<option value=\"B. &lt;Jones&gt;\">", "<option value=\"marble\">", "<select data-facet=\"period\">"})
    EXPECT_NE(index.find(choice), std::string::npos) << choice;
  EXPECT_NE(index.find("&quot;keyword=bust&quot;"), std::string::npos) << "the card says what it has";
  about.extras = R"({"keywords":{"a":[1]},"period":3})";
  add("b.texmesh", "Bust", about);
  add("c.texmesh", "Cast", about);
  ASSERT_EQ(site().exit_code, 0);
  EXPECT_EQ(text("index.html").find("<select"), std::string::npos) << "all objects are alike";
}

TEST_F(SiteCommand, NotesStandOnThePageAsText) {
  PackageParts parts = make_package_parts();
  parts.manifest.title = "Noted";
  parts.manifest.minor = 1;
  Annotation note;
  note.texts = {{"en", "A <nose>", "<script>alert(1)</script>"}, {"de", "Nase", ""}};
  note.images = {{"https://a.b/c.jpg"}};
  const std::string notes = write_annotations({AnnotationFrame::kPackage, {note}});
  parts.streams[kAnnotationsPath] = Bytes(notes.begin(), notes.end());
  const Bytes bytes = parts.build();
  write_text(folder_ / "in/n.texmesh", std::string(bytes.begin(), bytes.end()));
  const CommandResult r = site();
  ASSERT_EQ(r.exit_code, 0) << r.errors;
  const std::string page = text("objects/n.html");
  EXPECT_NE(page.find("<li id=\"note-1\"><div lang=\"en\"><h3>A &lt;nose&gt;</h3>"), std::string::npos)
      << page;
  EXPECT_NE(page.find("<div lang=\"de\"><h3>Nase</h3></div>"), std::string::npos);
  EXPECT_EQ(page.find("<script>alert"), std::string::npos);
  EXPECT_EQ(text("objects/b.html").find("class=\"notes\""), std::string::npos);
}

TEST_F(SiteCommand, SpeaksTheWordsOfAFileAndWearsTheStyleOfAnother) {
  write_text(folder_ / "de.json",
             R"({"language":"de","search":"Suche","object":"Objekt","show":"In 3D <zeigen>"})");
  write_text(folder_ / "own.css", ":root { --a: #702020; }\n");
  ASSERT_EQ(site({"--words", folder_ / "de.json", "--style", folder_ / "own.css"}).exit_code, 0);
  EXPECT_NE(text("index.html").find("<html lang=\"de\">"), std::string::npos);
  EXPECT_NE(text("index.html").find("1 Objekt"), std::string::npos);
  EXPECT_NE(text("objects/b.html").find("In 3D &lt;zeigen&gt;"), std::string::npos);
  EXPECT_NE(text("objects/b.html").find("Open full screen"), std::string::npos)
      << "English where the file is silent";
  EXPECT_TRUE(text("site.css").ends_with(":root { --a: #702020; }\n"));
  const std::string english = run_command({TEXMESH_BINARY, "site", "--print-words"}).output;
  EXPECT_EQ(Json::parse(english)["language"], "en");
  for (const char* wrong : {R"({"serach":"x"})", R"({"search":3})", "[]", "{", R"({"language":"d\"e"})"}) {
    write_text(folder_ / "de.json", wrong);
    const CommandResult refused = site({"--words", folder_ / "de.json"});
    EXPECT_NE(refused.exit_code, 0) << wrong;
    EXPECT_NE(refused.errors.find("de.json"), std::string::npos) << refused.errors;
  }
}

}  // namespace texmesh::testing::command_site_test
