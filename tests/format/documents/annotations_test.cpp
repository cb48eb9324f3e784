#include "format/documents/annotations.h"

#include <gtest/gtest.h>

#include "format/base/errors.h"
#include "tests/format/documents/manifest_fixture.h"

namespace texmesh::annotations_test {

using testing::as_bytes;

Annotations full_annotations() {
  Annotation nose;
  nose.position = {0.5, -1, 2};
  nose.normal = Vec3d{0, 0.6, 0.8};
  nose.texts = {{"en-GB", "A nose", "<script>alert(1)</script>"}, {"x-klingon", "ghIch", ""}};
  nose.camera = AnnotationCamera{{0, 0, 5}, {0.5, -1, 2}, 30};
  nose.images = {{"https://example.org/nose.jpg"}};
  Annotation foot;
  foot.texts = {{"und", "", ""}};
  return {AnnotationFrame::kPackage, {nose, foot}};
}

std::string rule_of(const std::string& json) {
  try {
    read_annotations(as_bytes(json));
  } catch (const RuleError& e) {
    return e.rule();
  } catch (const FormatError&) {
    return "another";
  }
  return "";
}

TEST(AnnotationsDocument, RoundTrip) {
  const std::string json = write_annotations(full_annotations());
  EXPECT_EQ(read_annotations(as_bytes(json)), full_annotations());
  EXPECT_NE(json.find("<script>"), std::string::npos) << "texts are kept as they are";
}

TEST(AnnotationsDocument, EveryTruncationIsTold) {
  const std::string json = write_annotations(full_annotations());
  for (std::size_t n = 0; n < json.size(); ++n)
    EXPECT_THROW(read_annotations(as_bytes(json.substr(0, n))), FormatError) << n;
}

TEST(AnnotationsDocument, LimitsHoldAtTheirBorders) {
  const auto breaks = [](const auto& change) {
    Annotations all = full_annotations();
    change(all);
    try {
      write_annotations(all);
    } catch (const RuleError& e) {
      return e.rule();
    }
    return std::string();
  };
  EXPECT_EQ(breaks([](Annotations& a) { a.list.resize(kMaxAnnotations, a.list[1]); }), "");
  EXPECT_EQ(breaks([](Annotations& a) { a.list.resize(kMaxAnnotations + 1, a.list[1]); }), "N01");
  EXPECT_EQ(breaks([](Annotations& a) { a.list.clear(); }), "N01");
  EXPECT_EQ(breaks([](Annotations& a) { a.list[0].texts[0].title.assign(200, 'x'); }), "");
  EXPECT_EQ(breaks([](Annotations& a) { a.list[0].texts[0].title.assign(201, 'x'); }), "N01");
  EXPECT_EQ(breaks([](Annotations& a) { a.list[0].texts[0].text.assign(10'001, 'x'); }), "N01");
  EXPECT_EQ(breaks([](Annotations& a) { a.list[0].texts.clear(); }), "N01");
  EXPECT_EQ(breaks([](Annotations& a) { a.list[0].texts[1].language = "en-GB"; }), "N02");
  EXPECT_EQ(breaks([](Annotations& a) { a.list[0].images[0].url = "javascript:alert(1)"; }), "N03");
  EXPECT_EQ(breaks([](Annotations& a) { a.list[0].images.resize(9, a.list[0].images[0]); }), "N01");
  EXPECT_EQ(breaks([](Annotations& a) { a.list[0].normal = Vec3d{0, 0, 1.0009}; }), "");
  EXPECT_EQ(breaks([](Annotations& a) { a.list[0].normal = Vec3d{0, 0, 1.002}; }), "N01");
  EXPECT_EQ(breaks([](Annotations& a) { a.list[0].camera->fov_degrees = 0.5; }), "N01");
  EXPECT_EQ(breaks([](Annotations& a) { a.list[0].position.x = 1e31; }), "N01");
}

TEST(AnnotationsDocument, APackageHasItsOwnFrame) {
  EXPECT_EQ(
      rule_of(
          R"({"frame":"source","annotations":[{"position":[0,0,0],"texts":[{"language":"en","title":""}]}]})"),
      "N04");
  EXPECT_EQ(
      rule_of(
          R"({"frame":"world","annotations":[{"position":[0,0,0],"texts":[{"language":"en","title":""}]}]})"),
      "N01");
}

TEST(AnnotationsDocument, LanguagesByTheirFormAlone) {
  for (const char* good : {"en", "de-AT", "zh-Hans-CN", "x-klingon", "qqq-12345678", "i"})
    EXPECT_TRUE(is_language_tag(good)) << good;
  for (const char* bad :
       {"", "-", "en-", "-en", "en_GB", "en--GB", "e1", "toolongtag", "en\"><script>", "d\xc3\xa9"})
    EXPECT_FALSE(is_language_tag(bad)) << bad;
  EXPECT_FALSE(is_language_tag("aa-bbbbbbbb-cccccccc-dddddddd-eeeeeeee"));
}

TEST(AnnotationsDocument, PointsFarOutsideTheBoxAreNamed) {
  Annotations all = full_annotations();
  Box3d box;
  box.min = {0, 0, 0}, box.max = {3, 0, 4};  // a diagonal of 5: half a unit around
  all.list[0].position = {3.4, 0.4, -0.4};
  all.list[1].position = {3.6, 0, 0};
  EXPECT_EQ(annotations_outside(all, box), std::vector<std::size_t>{2});
}

}  // namespace texmesh::annotations_test
