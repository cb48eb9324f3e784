#include "pipeline/batch/plan.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <map>

#include "format/base/errors.h"
#include "tests/support/command.h"

namespace texmesh {
namespace {
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
  EXPECT_FALSE(is_range_scan(folder / "x.json"));
}

TEST(FindModels, AFolderThatCannotBeListedIsAnError) {
  if (::geteuid() == 0) GTEST_SKIP() << "root lists everything";
  const TemporaryFolder folder;
  fs::create_directories(folder / "closed");
  write_text(folder / "a.glb", "x");
  ::chmod((folder / "closed").c_str(), 0);
  EXPECT_THROW(list_models(folder.path().string()), InputError);
  ::chmod((folder / "closed").c_str(), 0700);
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

TEST(FindModels, ModelsThatWouldShareAPackageKeepTheirExtension) {
  const TemporaryFolder folder;
  for (const char* f : {"site.glb", "site.obj", "yurt.glb"}) write_text(folder / f, "x");
  const auto m = find_models({folder.path().string()}, "out");
  ASSERT_EQ(m.size(), 3u);
  EXPECT_EQ(m[0].output, "out/site.glb.texmesh");
  EXPECT_EQ(m[1].output, "out/site.obj.texmesh");
  EXPECT_EQ(m[2].output, "out/yurt.texmesh");
}

TEST(FindModels, OfAJsonAndAnotherOnlyTheJsonKeepsItsExtension) {
  const TemporaryFolder folder;
  for (const char* f : {"site.json", "site.obj", "yurt.json", "yurt.obj", "yurt.ply"})
    write_text(folder / f, "x");
  std::map<std::string, std::string> outputs;
  for (const ModelPath& m : find_models({folder.path().string()}, "out"))
    outputs[fs::path(m.input).filename()] = m.output;
  EXPECT_EQ(outputs, (std::map<std::string, std::string>{{"site.json", "out/site.json.texmesh"},
                                                         {"site.obj", "out/site.texmesh"},
                                                         {"yurt.json", "out/yurt.json.texmesh"},
                                                         {"yurt.obj", "out/yurt.obj.texmesh"},
                                                         {"yurt.ply", "out/yurt.ply.texmesh"}}));
}

TEST(FindModels, AFolderWithoutModelsIsRefused) {
  const TemporaryFolder folder;
  EXPECT_THROW(find_models({folder.path().string()}, "out"), InputError);
  write_text(folder / "options.json", "{}");
  EXPECT_THROW(find_models({folder.path().string()}, "out"), InputError);
}

}  // namespace
}  // namespace texmesh
