#include "pipeline/about/source_annotations.h"

#include <gtest/gtest.h>

#include "format/base/errors.h"
#include "format/base/text_bytes.h"

namespace texmesh::source_annotations_test {

struct Read {
  Annotations all;
  Notes notes;
};
Read read(const std::string& json) {
  Read out;
  out.all = read_source_annotations(text_bytes(json), "notes.json", out.notes);
  return out;
}
std::string refused(const std::string& json) {
  try {
    read(json);
  } catch (const InputError& e) {
    EXPECT_EQ(e.file(), "notes.json");
    return e.expected();
  } catch (const Error&) {
    return "JSON";
  }
  return "";
}

TEST(SourceAnnotations, OurOwnFormIsTheSourcesUnlessItSaysOtherwise) {
  const std::string list = R"("annotations":[{"position":[1,2,3],"texts":[{"language":"de","title":"A"}]}])";
  EXPECT_EQ(read("{" + list + "}").all.frame, AnnotationFrame::kSource);
  EXPECT_EQ(read(R"({"frame":"package",)" + list + "}").all.frame, AnnotationFrame::kPackage);
  EXPECT_EQ(refused(R"({"frame":"package","annotations":[{"position":[1,2]}]})"), "3 elements");
}

TEST(SourceAnnotations, SketchfabsPointsHaveZUpAndTheirPicturesBecomeLinks) {
  const Read r = read(R"([{"name":"Nose","content":{"raw":"Mended ![a](https://a.b/c.jpg) in\n1820"},
      "position":[1,2,3],"eye":[0,-5,1],"target":[0,0,1]}, {"title":"No place"},
      {"name":"","content":"only <b>text</b>","position":[0,0,0]}])");
  ASSERT_EQ(r.all.list.size(), 2u);
  const Annotation& nose = r.all.list[0];
  EXPECT_EQ(nose.position, (Vec3d{1, 3, -2}));
  ASSERT_TRUE(nose.camera);
  EXPECT_EQ(nose.camera->position, (Vec3d{0, 1, 5}));
  EXPECT_EQ(nose.texts[0], (AnnotationText{"und", "Nose", "Mended  in 1820"}));
  EXPECT_EQ(nose.images[0].url, "https://a.b/c.jpg");
  EXPECT_EQ(r.all.list[1].texts[0].title, "only <b>text</b>")
      << "a note's text is its title where it has no other";
  ASSERT_EQ(r.notes.size(), 1u);
  EXPECT_EQ(r.notes[0].text, "1 notes without a place are left out");
}

TEST(SourceAnnotations, VoyagersDocumentHasItsLanguages) {
  const Read r =
      read(R"({"asset":{"type":"application/si-dpo-3d.document+json"},"models":[{"units":"mm","annotations":[
      {"id":"a","titles":{"EN":"Nose","DE":"Nase"},"leads":{"EN":"<i>Mended</i>"},"position":[1,2,3],"direction":[0,0,2],
       "imageUri":"nose.jpg"},
      {"title":"Old","lead":"Form","position":[0,0,0]}]}]})");
  ASSERT_EQ(r.all.list.size(), 2u);
  EXPECT_EQ(r.all.list[0].position, (Vec3d{1, 2, 3}));
  EXPECT_EQ(*r.all.list[0].normal, (Vec3d{0, 0, 1}));
  ASSERT_EQ(r.all.list[0].texts.size(), 2u);
  EXPECT_NE(std::ranges::find(r.all.list[0].texts, AnnotationText{"en", "Nose", "Mended"}),
            r.all.list[0].texts.end());
  EXPECT_EQ(r.all.list[1].texts[0], (AnnotationText{"und", "Old", "Form"}));
  ASSERT_EQ(r.notes.size(), 1u) << "an image beside the document has no URL";
}

TEST(SourceAnnotations, VoyagersViewsAndToursComeInTheModelsCoordinates) {
  const std::string setup = R"("scenes":[{"units":"cm"}],"setups":[{"tours":[{"title":"T","steps":[
      {"id":"one","title":"Seen already"},{"id":"two","titles":{"EN":"Behind"}},{"id":"none","title":"No view"}]}],
      "snapshots":{"targets":["setups/0/reader/enabled","setups/0/navigation/orbit","setups/0/navigation/offset"],"states":[
      {"id":"one","values":[true,[-90,0,0],[0,0,100]]},{"id":"two","values":[true,[0,90,0],[10,20,50]]},
      {"id":"odd","values":[true,[0,1e300,0],[0,0,1]]},{"id":"none","values":[true]}]}}])";
  const std::string note = R"("annotations":[{"title":"Top","position":[1,2,3],"viewId":"one"}])";
  const Read plain = read("{" + setup + R"(,"models":[{)" + note + "}]}");
  ASSERT_EQ(plain.all.list.size(), 2u);
  const auto expect_near = [](const Vec3d& found, const Vec3d& expected) {
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(found[i], expected[i], 1e-9);
  };
  expect_near(plain.all.list[0].camera.value().position, {0, 100, 0});  // from above
  expect_near(plain.all.list[0].camera->target, {0, 0, 0});
  EXPECT_EQ(plain.all.list[1].texts[0], (AnnotationText{"en", "Behind", ""}));
  expect_near(plain.all.list[1].camera.value().position, {50, 20, -10});  // from +x
  expect_near(plain.all.list[1].position, {0, 20, -10});
  // Millimetres in a scene of centimetres, turned by 90 degrees about y, then shifted.
  const Read placed =
      read("{" + setup + R"(,"models":[{"units":"mm","translation":[0,5,0],"rotation":[0,0.5,0,0.5],)" +
           note + "}]}");
  expect_near(placed.all.list[0].position, {1, 2, 3});
  expect_near(placed.all.list[0].camera.value().position, {0, 950, 0});
  expect_near(placed.all.list[1].camera.value().position, {100, 150, 500});
}

TEST(SourceAnnotations, WebAnnotationsPointByTheirSelectors) {
  const Read r = read(R"x({"type":"AnnotationPage","items":[
      {"type":"Annotation","motivation":["painting"],"body":{"type":"Model"},"target":{"selector":{"type":"PointSelector","x":9,"y":9,"z":9}}},
      {"type":"Annotation","label":{"en":["Nose"]},
       "body":[{"type":"TextualBody","value":"<p>Mended</p>","format":"text/html","language":"en"},{"type":"Image","id":"https://a.b/c.jpg"}],
       "target":{"source":"https://a.b/scene","selector":[{"type":"PointSelector","x":1,"y":2,"z":3}]}},
      {"type":"Annotation","body":"Foot","target":[{"selector":{"type":"WktSelector","value":"POINT Z (1 2.5 -3)"}}]}]})x");
  ASSERT_EQ(r.all.list.size(), 2u);
  EXPECT_EQ(r.all.list[0].texts[0], (AnnotationText{"en", "Nose", "Mended"}));
  EXPECT_EQ(r.all.list[0].images.size(), 1u);
  EXPECT_EQ(r.all.list[1].position, (Vec3d{1, 2.5, -3}));
  EXPECT_EQ(r.all.list[1].texts[0].title, "Foot");
}

TEST(SourceAnnotations, TooManyNoneAndOthersAreRefused) {
  std::string list;
  for (int i = 0; i < 10'000; ++i) list += std::string(i ? "," : "") + R"({"name":"A","position":[0,0,0]})";
  EXPECT_EQ(refused("[" + list + "]"), "at most 1000 notes");
  for (const char* json :
       {"[]", "{}", "3", "null", R"({"models":[]})", R"({"type":"AnnotationPage","items":[]})",
        R"([{"name":"A","position":[0,0]}])", R"([{"name":"A","position":[1e300,0,0]}])",
        R"({"models":[{"annotations":3}]})", R"({"models":"x","annotations":[3,null]})"})
    EXPECT_NE(refused(json), "") << json;
  EXPECT_EQ(refused("[{\"name\""), "JSON");
  EXPECT_EQ(refused(std::string(200, '[')), "JSON");
}

TEST(SourceAnnotations, LanguagesThatAreNoTagsAreNotKnown) {
  const Read r = read(
      R"([{"type":"Annotation","body":{"value":"A","language":"\"><script>"},"target":{"selector":{"x":0,"y":0,"z":0}}}])");
  EXPECT_EQ(r.all.list[0].texts[0].language, "und");
}

}  // namespace texmesh::source_annotations_test
