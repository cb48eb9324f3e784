// Copies into a folder that is being made.
#include "pipeline/io/new_folder.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <csignal>

#include "format/base/text_bytes.h"
#include "tests/support/command.h"

namespace texmesh::testing::new_folder_test {
namespace fs = std::filesystem;

std::string error_of_copy(const TemporaryFolder& folder, const std::string& name) {
  NewFolder made(folder / "made", {true, [](const fs::path&) { return true; }, "", ""});
  try {
    made.copy("copy/file", folder / name);
    made.publish();
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST(NewFolder, CopiesFilesForEverybodyToRead) {
  TemporaryFolder folder;
  const std::string text(3'000'001, 'x');
  write_text(folder / "source", text);
  fs::permissions(folder / "source", fs::perms{0400});
  EXPECT_EQ(error_of_copy(folder, "source"), "");
  EXPECT_TRUE(read_text(folder / "made/copy/file") == text);
  EXPECT_EQ(fs::status(folder / "made/copy/file").permissions(), fs::perms{0644});
}

void make_site(const std::string& path, const std::string& page) {
  NewFolder made(path, marked_folder_rule("index.html", "<!-- a site", "an earlier site"));
  made.add("index.html", text_bytes("<!-- a site" + page));
  made.add("pages/" + page, text_bytes(page));
  made.publish();
}

TEST(NewFolder, KeepsWhatSomebodyElseHasPutThere) {
  TemporaryFolder folder;
  const std::string site = folder / "site";
  make_site(site, "old");
  fs::create_directories(site + "/mine/scans");
  for (const char* name : {"imprint.html", ".htaccess", "mine/scans/bust.texmesh", "pages/mine"})
    write_text(site + "/" + name, name);
  fs::create_symlink("imprint.html", site + "/link");
  for (int again = 0; again < 2; ++again) {
    make_site(site, "new");
    EXPECT_EQ(read_text(site + "/index.html"), "<!-- a sitenew");
    EXPECT_FALSE(fs::exists(site + "/pages/old"));
    for (const char* name : {"imprint.html", ".htaccess", "mine/scans/bust.texmesh", "pages/mine"})
      EXPECT_EQ(read_text(site + "/" + name), name);
    EXPECT_EQ(fs::read_symlink(site + "/link"), "imprint.html");
  }
}

TEST(NewFolder, ReplacesNobodysFile) {
  TemporaryFolder folder;
  const std::string site = folder / "site";
  make_site(site, "old");
  write_text(site + "/pages/new", "mine");
  EXPECT_THROW(make_site(site, "new"), InputError);
  EXPECT_EQ(read_text(site + "/pages/new"), "mine");
  EXPECT_EQ(read_text(site + "/pages/old"), "old");
  fs::remove(site + "/" + kMadeFiles);
  EXPECT_THROW(make_site(site, "other"), InputError) << "nobody knows what is whose";
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1) << "nothing is left beside it";
}

TEST(NewFolder, RefusesWhatIsNoFile) {
  TemporaryFolder folder;
  ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
  EXPECT_NE(error_of_copy(folder, "pipe").find("cannot be copied"), std::string::npos);
  EXPECT_NE(error_of_copy(folder, "none").find("none: cannot be copied: No such file"), std::string::npos);
}

TEST(NewFolder, SaysWhyACopyCannotBeWritten) {
  TemporaryFolder folder;
  write_text(folder / "source", std::string(10000, 'x'));
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ::getrlimit(RLIMIT_FSIZE, &before);
  const rlimit little{4096, before.rlim_max};
  ::setrlimit(RLIMIT_FSIZE, &little);
  const std::string error = error_of_copy(folder, "source");
  ::setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_NE(error.find("cannot be written: File too large"), std::string::npos) << error;
}

}  // namespace texmesh::testing::new_folder_test
