// Names that differ from another in case, composition or encoding alone.
#include "pipeline/io/names/similar_names.h"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "pipeline/io/uri.h"
#include "tests/support/command.h"
#include "tests/support/sanitizers.h"

namespace texmesh::similar_names_test {

TEST(NameKey, IsEqualForNamesThatDifferInCaseCompositionOrEncodingAlone) {
  const std::vector<std::vector<std::string>> equal{
      {"scan.jpg", "SCAN.JPG", "Scan.jpg"},
      {"\xc3\x89.png", "\xc3\xa9.png", "E\xcc\x81.png", "e\xcc\x81.PNG", "\xe9.png", "\xc9.png"},
      {"stra\xc3\x9f"
       "e",
       "STRASSE"},
      {"\xd0\x99", "\xd0\xb9", "\xd0\x98\xcc\x86"},
      {"\xea\xb0\x80", "\xe1\x84\x80\xe1\x85\xa1"}};
  std::vector<std::string> keys;
  for (const auto& names : equal) {
    for (const std::string& name : names) EXPECT_EQ(name_key(name), name_key(names[0])) << name;
    EXPECT_EQ(std::count(keys.begin(), keys.end(), name_key(names[0])), 0);
    keys.push_back(name_key(names[0]));
  }
  EXPECT_NE(name_key("a.png"), name_key("a.jpg"));
  EXPECT_NE(name_key("e.png"), name_key("\xc3\xa9.png"));
  EXPECT_EQ(name_key(""), "");
}

TEST(NameKey, Utf8OfTakesWhatIsNoneForWindows1252) {
  EXPECT_EQ(utf8_of("B\xfcste \x80 \x85"), "B\xc3\xbcste \xe2\x82\xac \xe2\x80\xa6");
  EXPECT_EQ(utf8_of("B\xc3\xbcste"), "B\xc3\xbcste");
  for (int c = 1; c < 256; ++c) EXPECT_TRUE(is_utf8(utf8_of(std::string(9, static_cast<char>(c))))) << c;
}

TEST(SimilarNames, ListsOnlyWhereAPartIsNotThere) {
  const testing::TemporaryFolder folder;
  for (const char* file : {"Tex/A.png", "Tex/a.PNG", "tex2/b.png", "C.jpg"}) {
    std::filesystem::create_directories(std::filesystem::path(folder / file).parent_path());
    testing::write_text(folder / file, "x");
  }
  using Names = std::vector<std::string>;
  const auto similar = [&](const std::string& name) { return similar_names(folder.path().string(), name); };
  EXPECT_EQ(similar("tex/a.png").names, (Names{"Tex/A.png", "Tex/a.PNG"}));
  EXPECT_EQ(similar("Tex/A.png").names, Names{"Tex/a.PNG"});
  EXPECT_EQ(similar("c.JPG").names, Names{"C.jpg"});
  EXPECT_EQ(similar("C.jpg").names, Names{});
  EXPECT_EQ(similar("tex2/B.png").names, Names{"tex2/b.png"});
  EXPECT_EQ(similar("none/b.png").names, Names{});
  EXPECT_NE(similar("c.JPG").folder, FileStamp{});
  EXPECT_NE(similar("tex2/none").folder, FileStamp{});
  EXPECT_EQ(similar("tex/a.png").folder, FileStamp{}) << "it hangs on two folders";
  EXPECT_EQ(similar("c.JPG").request("c.JPG").bytes, 1u);
  EXPECT_EQ(similar_names(folder / "none", "a").names, Names{});
}

TEST(SimilarNames, AFolderIsListedAgainOnlyWhenItHasChanged) {
  const testing::TemporaryFolder folder;
  constexpr int kFiles = 4000;
  for (int i = 0; i < kFiles; ++i) testing::write_text(folder / ("b" + std::to_string(i)), "");
  FolderLists lists;
  const auto similar = [&](const std::string& name) {
    return similar_names(folder.path().string(), name, lists).names;
  };
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < kFiles; ++i) EXPECT_EQ(similar("a" + std::to_string(i)).size(), 0u);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  EXPECT_LT(took.count(), testing::sanitizers_take(3.0)) << "it lists the folder for each name";
  std::this_thread::sleep_for(std::chrono::milliseconds(20));  // more than a tick of the file system's clock
  testing::write_text(folder / "A7", "");
  EXPECT_EQ(similar("a7"), std::vector<std::string>{"A7"});
}

}  // namespace texmesh::similar_names_test
