#include "tools/publish/site/site.h"

#include <gtest/gtest.h>

#include "format/base/errors.h"
#include "tests/support/command.h"
#include "tests/support/packages.h"

namespace texmesh {
namespace {

using testing::TemporaryFolder;

std::string name_of(const std::string& path, std::vector<std::string> taken = {}) {
  return object_name(path, taken);
}

TEST(ObjectName, KeepsWhatEveryServerTakes) {
  EXPECT_EQ(name_of("bust.texmesh"), "bust");
  EXPECT_EQ(name_of("casts/Bust_2.v1/"), "casts-Bust_2.v1");
  EXPECT_EQ(name_of("a  <b>.texmesh"), "a-b-");
}

TEST(ObjectName, IsNeverEmptyHiddenOrLong) {
  for (const char* path : {".texmesh", "\xff.texmesh", "..texmesh", ".hidden.texmesh"}) {
    const std::string name = name_of(path);
    EXPECT_FALSE(name.empty());
    EXPECT_NE(name.front(), '.');
  }
  EXPECT_LE(name_of(std::string(3000, 'x') + ".texmesh").size(), 112u);
}

TEST(ObjectName, NoTwoAreAlikeInAnyCase) {
  std::vector<std::string> taken;
  const std::string first = object_name("a b.texmesh", taken), second = object_name("A-B.texmesh", taken);
  EXPECT_EQ(first, "a-b");
  EXPECT_NE(second, "A-B");
  EXPECT_EQ(taken.size(), 2u);
  EXPECT_EQ(name_of("A-B.texmesh", {"a-b"}), second) << "by the path alone";
}

TEST(Site, HasFiguresOfEveryPackageByTitle) {
  TemporaryFolder folder;
  const auto add = [&](const std::string& file, const std::string& title) {
    testing::PackageParts parts = testing::make_package_parts();
    parts.manifest.title = title;
    const Bytes bytes = parts.build();
    testing::write_text(folder / file, std::string(bytes.begin(), bytes.end()));
    return bytes.size();
  };
  add("1.texmesh", "zebra");
  const std::size_t bytes = add("2.texmesh", "Ape");
  add("3.texmesh", "");
  const Site site = read_site(folder.path().string(), {});
  ASSERT_EQ(site.objects.size(), 3u);
  EXPECT_EQ(site.objects[0].title, "3");  // the file's name
  EXPECT_EQ(site.objects[1].title, "Ape");
  EXPECT_EQ(site.objects[2].title, "zebra");
  EXPECT_EQ(site.objects[1].bytes, bytes);
  EXPECT_EQ(site.objects[1].texture_px, 64u);
  EXPECT_GT(site.objects[1].start_bytes, 0u);
  EXPECT_EQ(site.objects[1].address, "packages/2.texmesh");
}

TEST(Site, AFolderWithoutPackagesIsRefused) {
  TemporaryFolder folder;
  EXPECT_THROW(read_site(folder.path().string(), {}), InputError);
  EXPECT_THROW(read_site(folder / "none", {}), InputError);
}

}  // namespace
}  // namespace texmesh
