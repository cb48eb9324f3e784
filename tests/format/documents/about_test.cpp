#include "format/documents/about.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "format/base/errors.h"
#include "tests/format/documents/manifest_fixture.h"

namespace texmesh::about_test {

using testing::as_bytes;

About full_about() {
  About a;
  a.title = "B\xc3\xbcste";
  a.description = "found in 1897";
  a.creator = "A. Smith; B. Jones";
  a.attribution = "Museum of Casts";
  a.licence = "CC-BY-4.0";
  a.licence_url = "https://spdx.org/licenses/CC-BY-4.0.html";
  a.source_url = "http://museum.example/17";
  a.capture = "photogrammetry";
  a.identifiers = {{"doi", "10.1/2"}, {"inventory", "17"}};
  a.dates = {{"found", "1897"}};
  a.unit = "mm";
  a.metres_per_unit = 0.001;
  a.up_axis = "z";
  a.crs = "local grid";
  a.epsg = 25832;
  a.source = R"({"format":"glb","extras":[{"path":"","value":"\u0007"}]})";
  a.extras = R"({"room":4})";
  return a;
}

TEST(AboutDocument, RoundTripAndNothingForNothing) {
  EXPECT_EQ(write_about({}), "{}");
  EXPECT_EQ(read_about(as_bytes("{}")), About());
  const std::string json = write_about(full_about());
  const About again = read_about(as_bytes(json));
  EXPECT_EQ(again.title, full_about().title);
  EXPECT_EQ(nlohmann::json::parse(again.source), nlohmann::json::parse(full_about().source));
  EXPECT_EQ(write_about(again), write_about(read_about(as_bytes(write_about(again)))));
  for (auto member :
       {&About::description, &About::creator, &About::attribution, &About::licence, &About::licence_url,
        &About::source_url, &About::capture, &About::unit, &About::up_axis, &About::crs, &About::extras})
    EXPECT_EQ(again.*member, full_about().*member);
  EXPECT_EQ(again.identifiers, full_about().identifiers);
  EXPECT_EQ(again.dates, full_about().dates);
  EXPECT_EQ(again.metres_per_unit, 0.001);
  EXPECT_EQ(again.epsg, 25832u);
}

TEST(AboutDocument, EveryTruncationIsTold) {
  const std::string json = write_about(full_about());
  for (std::size_t n = 0; n < json.size(); ++n)
    EXPECT_THROW(read_about(as_bytes(json.substr(0, n))), FormatError) << n;
}

TEST(AboutDocument, LimitsAreTheSpecifications) {
  const auto refused = [](const std::string& json, const std::string& place) {
    try {
      read_about(as_bytes(json));
    } catch (const FormatError& e) {
      EXPECT_EQ(e.place(), place) << json.substr(0, 80);
      return;
    }
    ADD_FAILURE() << json.substr(0, 80);
  };
  About longest;
  longest.title = std::string(kMaxAboutTitleBytes, 't');
  longest.description = std::string(kMaxAboutDescriptionBytes, 'd');
  longest.identifiers.assign(kMaxAboutList, {std::string(100, 's'), std::string(500, 'v')});
  longest.metres_per_unit = kMaxMetresPerUnit;
  longest.unit = "u";
  longest.epsg = kMaxEpsgCode;
  EXPECT_EQ(read_about(as_bytes(write_about(longest))), longest);
  refused(R"({"title":")" + std::string(kMaxAboutTitleBytes + 1, 't') + "\"}", "/title");
  refused(R"({"extras":")" + std::string(kMaxAboutExtrasBytes, 't') + "\"}", "/extras");
  refused(R"({"source":{"a":")" + std::string(kMaxAboutSourceBytes, 't') + "\"}}", "/source");
  refused(R"({"title":"a\u0001"})", "/title");
  refused(R"({"title":""})", "/title");
  refused(R"({"licenceUrl":"javascript:alert"})", "/licenceUrl");
  refused(R"({"sourceUrl":"https://"})", "/sourceUrl");
  refused(R"({"unit":{"name":"m","metres":-1}})", "/unit/metres");
  refused(R"({"unit":{"name":"m"}})", "/unit/metres");
  refused(R"({"coordinateReference":{}})", "/coordinateReference");
  refused(R"({"coordinateReference":{"epsg":1000000}})", "/coordinateReference/epsg");
  refused(R"({"upAxis":"w"})", "/upAxis");
  refused(R"({"identifiers":[]})", "/identifiers");
  refused("[]", "/");
  longest.identifiers.push_back({"s", "v"});
  EXPECT_THROW(write_about(longest), FormatError);
}

TEST(AboutDocument, UnknownMembersExtensionsAndExtrasAreNobodysBusiness) {
  const About a = read_about(as_bytes(R"({"later":[1],"extensions":{"A_b":{"c":"\u0000"}},"extras":"\u0000",
                                          "unit":{"name":"m","metres":1,"extras":2}})"));
  EXPECT_EQ(a.metres_per_unit, 1);
  EXPECT_EQ(a.extras, R"("\u0000")");
}

TEST(AboutDocument, MergeIsByFieldAndALicenceBringsItsOwnPage) {
  About over;
  over.licence = "CC0-1.0";
  over.epsg = 4326;
  over.dates = {{"scanned", "2020"}};
  const About merged = merge_about(full_about(), over);
  EXPECT_EQ(merged.licence, "CC0-1.0");
  EXPECT_EQ(merged.licence_url, "");
  EXPECT_EQ(merged.crs, "");
  EXPECT_EQ(merged.dates, over.dates);
  EXPECT_EQ(merged.identifiers, full_about().identifiers);
  EXPECT_EQ(merge_about(full_about(), {}), full_about());
  EXPECT_EQ(merge_about({}, full_about()), full_about());
}

TEST(AboutDocument, ThePageOfAnotherCreatorGoes) {
  About under, over;
  under.creator = "A", under.identifiers = {{"doi", "10.1/2"}, {"creator", "https://a.example"}};
  over.creator = "B";
  EXPECT_EQ(creator_url(merge_about(under, {})), "https://a.example");
  EXPECT_EQ(merge_about(under, over).identifiers, (std::vector<NamedText>{{"doi", "10.1/2"}}));
  over.identifiers = {{"creator", "not an address"}};
  EXPECT_EQ(creator_url(merge_about(under, over)), "");
}

TEST(AboutDocument, CopyrightLineNamesTheLicenceOnce) {
  EXPECT_EQ(copyright_line({}), "");
  EXPECT_EQ(copyright_line(full_about()), "Museum of Casts. Licence: CC-BY-4.0");
  About a = full_about();
  a.attribution = "Museum, CC-BY-4.0";
  EXPECT_EQ(copyright_line(a), "Museum, CC-BY-4.0");
  a.attribution.clear();
  a.licence.clear();
  EXPECT_EQ(copyright_line(a), "A. Smith; B. Jones");
}

}  // namespace texmesh::about_test
