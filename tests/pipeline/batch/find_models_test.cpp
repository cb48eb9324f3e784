#include "pipeline/batch/plan.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <map>

#include "pipeline/io/resolver.h"
#include "tests/support/command.h"

namespace texmesh::find_models_test {
namespace fs = std::filesystem;
using testing::TemporaryFolder;
using testing::write_text;

TEST(FindModels, OneFileOnePackage) {
  const auto m = find_models({"a/b.glb"}, "out.texmesh");
  ASSERT_EQ(m.size(), 1u);
  EXPECT_EQ(m[0].input, "a/b.glb");
  EXPECT_EQ(m[0].output, "out.texmesh");
  EXPECT_EQ(find_models({"a/b.glb"}, "out")[0].output, "out/b.texmesh");
}

TEST(FindModels, SeveralNeedAFolder) {
  EXPECT_THROW(find_models({"a.glb", "b.glb"}, "out.texmesh"), InputError);
  const auto m = find_models({"a.glb", "x/b.obj"}, "out");
  EXPECT_EQ(m[1].output, "out/b.texmesh");
}

TEST(FindModels, WaitsForNoPipeAndEntersNoHiddenFolder) {
  const TemporaryFolder folder;
  fs::create_directories(folder / ".trash");
  write_text(folder / ".trash/old.glb", "x");
  write_text(folder / "a.glb", "x");
  ASSERT_EQ(::mkfifo((folder / "x.json").c_str(), 0600), 0);
  EXPECT_EQ(list_models(folder.path().string()), std::vector<std::string>{"a.glb"});
  EXPECT_FALSE(holds_model(folder / "x.json"));
}

TEST(FindModels, WhatTexmeshHasMadeIsNoScan) {
  const TemporaryFolder folder;
  fs::create_directories(folder / "site/downloads");
  write_text(folder / "site/.texmesh-files", "downloads/a.glb\n");
  write_text(folder / "site/downloads/a.glb", "x");
  write_text(folder / "a.glb", "x");
  EXPECT_EQ(list_models(folder.path().string()), std::vector<std::string>{"a.glb"});
}

TEST(FindModels, AFolderThatCannotBeListedIsAnError) {
  if (::geteuid() == 0) GTEST_SKIP() << "root lists everything";
  const TemporaryFolder folder;
  fs::create_directories(folder / "closed");
  write_text(folder / "a.glb", "x");
  ::chmod((folder / "closed").c_str(), 0);
  EXPECT_THROW(list_models(folder.path().string()), PermissionError);
  ::chmod((folder / "closed").c_str(), 0700);
}

TEST(FindModels, ScansInFormatsThatAreNotReadAreTold) {
  const TemporaryFolder folder;
  for (const char* f : {"a.FBX", "notes.txt", "z.usdz"}) write_text(folder / f, "x");
  try {
    list_models(folder.path().string());
    ADD_FAILURE();
  } catch (const InputError& e) {
    EXPECT_EQ(e.found(), "none, but a.FBX");
  }
  write_text(folder / "a.glb", "x");
  Notes notes;
  EXPECT_EQ(list_models(folder.path().string(), &notes), std::vector<std::string>{"a.glb"});
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(notes[0].place, folder.path().string());
  EXPECT_EQ(notes[0].text, "2 files of formats that texmesh does not read are left out, a.FBX among them");
}

TEST(FindModels, ACollectionFileThatAFolderHasIsToldOf) {
  const TemporaryFolder folder;
  write_text(folder / "a.glb", "x");
  write_text(folder / "collection.json", "{}");
  Notes notes;
  list_models(folder.path().string(), &notes);
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(notes[0].code, "collection-not-read");
  EXPECT_NE(notes[0].text.find("compile " + (folder / "collection.json") + " itself"), std::string::npos)
      << notes[0].text;
}

TEST(FindModels, FoldersKeepTheirTreeAndSkipWhatIsNoModel) {
  const TemporaryFolder folder;
  fs::create_directories(folder / "sub/deep");
  for (const char* f : {"b.GLB", "a.obj", "a.mtl", "sub/deep/c.stl", "texture.png", ".hidden.glb"})
    write_text(folder / f, "x");
  write_text(folder / "sub/options.json", "{}");
  write_text(folder / "sub/scan.json", R"({"version":1,"type":"cylindrical-range-scan"})");
  const auto m = find_models({folder.path().string()}, "out");
  ASSERT_EQ(m.size(), 5u);
  EXPECT_EQ(m[0].output, "out/a.texmesh");
  EXPECT_EQ(m[1].output, "out/b.texmesh");
  EXPECT_EQ(m[2].output, "out/sub/deep/c.texmesh");
  EXPECT_EQ(m[3].output, "out/sub/options.texmesh");
  EXPECT_EQ(m[4].output, "out/sub/scan.texmesh");
  for (const ModelPath& p : m) EXPECT_EQ(p.unread, p.input.ends_with(".json")) << p.input;
}

std::map<std::string, std::string> outputs_of(const TemporaryFolder& folder, PackageNames names) {
  std::map<std::string, std::string> outputs;
  for (const ModelPath& m : find_models({folder.path().string()}, "out", names))
    outputs[fs::path(m.input).filename()] = m.output;
  return outputs;
}

TEST(FindModels, NoOtherModelChangesAName) {
  const std::vector<std::string> files{"site.glb", "site.obj", "yurt.json", "yurt.ply", "a.b.stl"};
  for (const PackageNames names : {PackageNames::kStem, PackageNames::kFull}) {
    const TemporaryFolder all;
    for (const std::string& file : files) write_text(all / file, "\"cylindrical-range-scan\"");
    const auto outputs = outputs_of(all, names);
    for (const std::string& file : files) {
      const TemporaryFolder alone;
      write_text(alone / file, "\"cylindrical-range-scan\"");
      EXPECT_EQ(outputs_of(alone, names), (std::map<std::string, std::string>{{file, outputs.at(file)}}));
    }
    EXPECT_EQ(outputs.at("a.b.stl"),
              names == PackageNames::kStem ? "out/a.b.texmesh" : "out/a.b.stl.texmesh");
  }
}

/// What plan_batch() says of a folder with these files, of which `again` is given beside the folder; "" where
/// it takes it.
std::string refusal_of(const std::vector<std::string>& files, PackageNames names = PackageNames::kStem,
                       const std::string& again = "") {
  const TemporaryFolder folder;
  for (const std::string& file : files) {
    fs::create_directories(fs::path(folder / file).parent_path());
    write_text(folder / file, file.starts_with("scan") ? "\"cylindrical-range-scan\"" : "{}");
  }
  PlanRequest request;
  request.inputs = {folder.path().string()};
  if (!again.empty()) request.inputs.push_back(folder / again);
  request.output = folder / "out";
  request.names = names;
  try {
    plan_batch(request);
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST(FindModels, TwoModelsOfOneNameAreRefusedAndBothNamed) {
  for (const auto& [a, b] :
       {std::pair{"site.glb", "site.obj"}, {"scan.json", "scan.ply"}, {"d/x.glb", "d/x.STL"}}) {
    const std::string said = refusal_of({a, b, "other.glb"});
    EXPECT_NE(said.find(a), std::string::npos) << said;
    EXPECT_NE(said.find(b), std::string::npos) << said;
    EXPECT_NE(said.find("--names full"), std::string::npos) << said;
    EXPECT_EQ(refusal_of({a, b, "other.glb"}, PackageNames::kFull), "");
  }
}

TEST(FindModels, AModelThatIsGivenTwiceIsToldSo) {
  for (const PackageNames names : {PackageNames::kStem, PackageNames::kFull}) {
    const std::string said = refusal_of({"site.glb", "other.glb"}, names, "site.glb");
    EXPECT_NE(said.find("every model once"), std::string::npos) << said;
    EXPECT_EQ(said.find("--names full"), std::string::npos) << said;
  }
}

TEST(FindModels, NamesThatOneFileSystemTakesForOneAreRefused) {
  for (const auto& [a, b] :
       {std::pair{"Bust.glb", "bust.glb"}, {"\u00fc.glb", "\u00dc.obj"}, {"\u00fc.glb", "u\u0308.glb"}})
    for (const PackageNames names : {PackageNames::kStem, PackageNames::kFull}) {
      const bool meets = names == PackageNames::kStem || std::string(b).ends_with(".glb");
      EXPECT_EQ(refusal_of({a, b}, names) != "", meets) << a << " " << b;
    }
}

TEST(FindModels, AJsonThatIsNoModelIsNobodysNeighbour) {
  EXPECT_EQ(refusal_of({"site.json", "site.obj", "d/site.obj"}), "");
}

TEST(FindModels, AFolderWithoutModelsIsRefused) {
  const TemporaryFolder folder;
  EXPECT_THROW(find_models({folder.path().string()}, "out"), InputError);
  write_text(folder / "options.json", "{}");
  EXPECT_THROW(find_models({folder.path().string()}, "out"), InputError);
}

}  // namespace texmesh::find_models_test
