#include "tools/publish/report/collection/collection_page.h"

#include <gtest/gtest.h>

#include "tests/tools/publish/pages/html_check.h"

namespace texmesh::collection_page_test {

ModelSummary model(const std::string& name, ModelResult result, const std::string& message = "") {
  ModelSummary m;
  m.model = name + ".glb";
  m.output = "out/" + name + ".texmesh";
  m.package = name + ".texmesh";
  m.result = result;
  m.bytes = 1'500'000;
  m.seconds = 2;
  m.peak_memory_bytes = 200'000'000;
  if (!message.empty()) m.error.kind = "input", m.error.message = message;
  return m;
}

std::optional<PackageFace> no_face(const ModelSummary&) { return std::nullopt; }
std::optional<PackageFace> a_face(const ModelSummary&) { return PackageFace{"A <bust>", {1, 2, 3}}; }

TEST(CollectionPage, FailuresComeFirstInTheWordsOfTheErrors) {
  RunSummary s;
  s.models = {model("good", ModelResult::kOk), model("bad<b>\xff", ModelResult::kFailed, "line 1: <nothing>"),
              model("late", ModelResult::kCancelled)};
  s.problems = {{"", "missing", "no summary of shards 2-5 of 6"}};
  const std::string html = collection_page(s, "posters", 10, no_face).html;
  const std::size_t failures = html.find("bad&lt;b&gt;"), problems = html.find("shards 2-5 of 6"),
                    models = html.find("good.glb");
  ASSERT_NE(failures, std::string::npos);
  ASSERT_NE(problems, std::string::npos);
  ASSERT_NE(models, std::string::npos);
  EXPECT_LT(failures, problems);
  EXPECT_NE(html.find("<table class=\"sentences\">"), std::string::npos)
      << "messages are laid out as numbers are";
  EXPECT_LT(problems, models);
  EXPECT_NE(html.find("line 1: &lt;nothing&gt;"), std::string::npos);
  EXPECT_NE(html.find("not reached"), std::string::npos);
  EXPECT_NE(html.find("2 without a new package"), std::string::npos);
  EXPECT_EQ(testing::tag_fault(html), "");
}

TEST(CollectionPage, WarningsOfPackagesThatAreThereStandInASectionOfTheirOwn) {
  RunSummary s;
  s.models = {model("plain", ModelResult::kUnchanged), model("grey", ModelResult::kUnchanged)};
  EXPECT_EQ(collection_page(s, "posters", 10, no_face).html.find("id=\"warnings\""), std::string::npos);
  add_warning(s.models[1].warnings, "missing-texture", "grey.mtl:3", "<scan.jpg> is not there");
  const std::string html = collection_page(s, "posters", 10, no_face).html;
  EXPECT_NE(html.find("1 with warnings"), std::string::npos);
  EXPECT_NE(html.find("missing-texture at grey.mtl:3: &lt;scan.jpg&gt; is not there"), std::string::npos);
  EXPECT_EQ(testing::tag_fault(html), "");
}

TEST(CollectionPage, PostersStandBesideThePageForTheFirstModels) {
  RunSummary s;
  for (const char* name : {"a", "b", "c"}) s.models.push_back(model(name, ModelResult::kUnchanged));
  s.models[0].made = EarlierCost{90, 0};
  const CollectionPage page = collection_page(s, "posters", 2, a_face);
  ASSERT_EQ(page.files.size(), 2u);
  EXPECT_EQ(page.files[1].name, "posters/00001.jpg");
  EXPECT_EQ(page.files[1].bytes, (std::vector<std::uint8_t>{1, 2, 3}));
  EXPECT_NE(page.html.find("src=\"posters/00001.jpg\""), std::string::npos);
  EXPECT_NE(collection_page(s, "my 100% #1", 2, a_face).html.find("src=\"my%20100%25%20%231/00001.jpg\""),
            std::string::npos)
      << "an address, not a path";
  EXPECT_NE(page.html.find("A &lt;bust&gt;"), std::string::npos);
  EXPECT_NE(page.html.find("1 min 30 s"), std::string::npos) << "what it took when it was made";
  EXPECT_NE(page.html.find("c.glb"), std::string::npos) << "in the table all the same";
  EXPECT_EQ(testing::tag_fault(page.html), "");
  EXPECT_NE(collection_page(s, "posters", 2, no_face).html.find("cannot be read"), std::string::npos);
  EXPECT_EQ(testing::tag_fault(collection_page({}, "posters", 2, no_face).html), "");
}

TEST(CollectionPage, WhatIsNoPackageHasNoFace) {
  EXPECT_FALSE(package_face("/none/such.texmesh"));
  const auto golden = package_face(TEXMESH_SOURCE_DIR "/tests/golden/v2.0-scan.texmesh");
  ASSERT_TRUE(golden);
  EXPECT_EQ(golden->poster.empty(), false);
}

}  // namespace texmesh::collection_page_test
