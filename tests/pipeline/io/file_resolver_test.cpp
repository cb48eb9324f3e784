#include "pipeline/io/file_resolver.h"
#include "pipeline/io/resolver.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <fstream>

namespace texmesh::file_resolver_test {

namespace fs = std::filesystem;

void write(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

std::string text(const std::optional<std::vector<std::uint8_t>>& bytes) {
  return bytes ? std::string(bytes->begin(), bytes->end()) : "(none)";
}

/// Every case runs with openat2 and with the walk that replaces it.
class FileResolverTest : public ::testing::TestWithParam<FileResolver::Method> {
 protected:
  void SetUp() override {
    char name[] = "/tmp/texmesh_resolver_XXXXXX";
    root_ = ::mkdtemp(name);
    folder_ = root_ / "model";
    write(root_ / "secret", "secret");
    write(folder_ / "a.bin", "alpha");
    write(folder_ / "tex/deep/b c.png", "beta");
    write(folder_ / "empty", "");
  }
  void TearDown() override { fs::remove_all(root_); }

  void expect_refused(const std::string& uri) {
    FileResolver resolver(folder_, {}, GetParam());
    EXPECT_THROW(resolver.read(uri, 1000), InputError) << uri;
    ASSERT_EQ(resolver.requests().size(), 1u);
    EXPECT_FALSE(resolver.requests()[0].found);
  }
  void expect_missing(const std::string& uri) {
    FileResolver resolver(folder_, {}, GetParam());
    EXPECT_EQ(text(resolver.read(uri, 1000)), "(none)") << uri;
  }

  fs::path root_, folder_;
};

TEST_P(FileResolverTest, ReadsFilesBeneathItsFolder) {
  FileResolver resolver(folder_, {}, GetParam());
  EXPECT_EQ(text(resolver.read("a.bin", 1000)), "alpha");
  EXPECT_EQ(text(resolver.read("tex/deep/b c.png", 1000)), "beta");
  EXPECT_EQ(text(resolver.read("./tex//./deep/b c.png", 1000)), "beta");
  EXPECT_EQ(text(resolver.read("empty", 0)), "");
}

TEST_P(FileResolverTest, RecordsEveryRequestOnceInOrder) {
  FileResolver resolver(folder_, {}, GetParam());
  resolver.read("tex/none", 1000);
  resolver.read("a.bin", 1000);
  resolver.read("tex/none", 1000);
  resolver.read("a.bin", 1000);
  const std::vector<std::uint8_t> alpha{'a', 'l', 'p', 'h', 'a'};
  std::vector<FileRequest> requests = resolver.requests();
  for (FileRequest& request : requests) request.stamp = {};  // inode and times differ from run to run
  EXPECT_EQ(requests, (std::vector<FileRequest>{{"tex/none", false, {}, 0, {}, false},
                                                {"a.bin", true, sha256(alpha), 5, {}, false}}));
}

TEST_P(FileResolverTest, MissingFilesAreNoError) {
  expect_missing("none");
  expect_missing("none/none");
  expect_missing("a.bin/none");
  expect_missing(std::string(300, 'x'));
}

TEST_P(FileResolverTest, RefusesNamesThatLeaveTheFolder) {
  for (const char* uri : {"../secret",
                          "tex/../../secret",
                          "tex/../a.bin",
                          "..",
                          "tex/..",
                          "/etc/hostname",
                          "//host/x",
                          "C:/x",
                          "c:x",
                          "C:\\x",
                          "tex\\a",
                          "..\\secret",
                          "http://host/x",
                          "https://host/x",
                          "file:///etc/hostname",
                          "FILE:a",
                          "data:,x",
                          "",
                          ".",
                          "tex/",
                          "tex/.",
                          "a\nb"}) {
    expect_refused(uri);
  }
  expect_refused(std::string("a.bin\0.png", 10));
  expect_refused(std::string(5000, 'x'));
}

TEST_P(FileResolverTest, FollowsLinksThatStayWithinTheFolder) {
  fs::create_symlink("a.bin", folder_ / "inside");
  fs::create_symlink(folder_ / "a.bin", folder_ / "absolute");
  fs::create_symlink("inside", folder_ / "twice");
  fs::create_symlink("../../model/a.bin", folder_ / "tex/around");
  fs::create_directory_symlink("tex", folder_ / "tex2");
  FileResolver resolver(folder_, {}, GetParam());
  for (const char* uri : {"inside", "absolute", "twice", "tex/around"})
    EXPECT_EQ(text(resolver.read(uri, 9)), "alpha") << uri;
  EXPECT_EQ(text(resolver.read("tex2/deep/b c.png", 9)), "beta");
  EXPECT_EQ(text(resolver.read("tex2/none", 9)), "(none)");
  EXPECT_TRUE(resolver.is_there("inside"));
}

TEST_P(FileResolverTest, RefusesLinksThatLeadOut) {
  fs::create_symlink(root_ / "secret", folder_ / "out");
  fs::create_symlink("nowhere", folder_ / "dangling");
  fs::create_symlink("loop", folder_ / "loop");
  fs::create_symlink("/proc/self/status", folder_ / "process");
  fs::create_symlink("/dev/zero", folder_ / "device");
  fs::create_symlink("tex", folder_ / "folder");
  fs::create_directory_symlink(root_, folder_ / "up");
  fs::create_directory_symlink("/", folder_ / "slash");
  fs::create_directories(root_ / "model2");
  write(root_ / "model2/x", "other");
  fs::create_symlink("../model2/x", folder_ / "sibling");
  for (const char* uri : {"out", "dangling", "loop", "process", "device", "folder", "up/secret",
                          "slash/etc/hostname", "sibling"})
    expect_refused(uri);
}

TEST_P(FileResolverTest, FollowsLinksWithinFoldersThatTheUserNames) {
  write(root_ / "repository/.git/annex/objects/k", "kept");
  write(root_ / "repository/scans/own", "own");
  fs::create_symlink("../.git/annex/objects/k", root_ / "repository/scans/t.png");
  fs::create_symlink(root_ / "secret", root_ / "repository/scans/out");
  ASSERT_EQ(::mkfifo((root_ / "repository/fifo").c_str(), 0600), 0);
  fs::create_symlink("../fifo", root_ / "repository/scans/pipe");
  fs::create_directory_symlink(root_ / "repository", root_ / "by another name");
  EXPECT_THROW(FileResolver(root_ / "repository/scans", {}, GetParam()).read("t.png", 9), FileRefused);
  for (const char* within : {"repository", "repository/", "by another name", "repository/.git"}) {
    FileResolver resolver(root_ / "repository/scans", {(root_ / within).string()}, GetParam());
    EXPECT_EQ(text(resolver.read("t.png", 9)), "kept") << within;
    EXPECT_EQ(text(resolver.read("own", 9)), "own");
    EXPECT_THROW(resolver.read("out", 9), FileRefused) << within;
    EXPECT_THROW(resolver.read("pipe", 9), FileRefused) << within;
  }
}

/// As Sketchfab's downloads are: source/bust.obj, textures/bust.png.
TEST_P(FileResolverTest, ReadsTexturesBesideAFolderSourceBeneathWhatTheUserNames) {
  write(root_ / "get/source/bust.obj", "v");
  write(root_ / "get/textures/bust.png", "png");
  fs::create_symlink(root_ / "secret", root_ / "get/textures/out.png");
  const std::string name = "../textures/bust.png";
  for (const fs::path& named : {root_ / "get", root_}) {
    FileResolver resolver(root_ / "get/source", {named.string()}, GetParam());
    EXPECT_EQ(text(resolver.read_beside("bust.png", 1000)), "png") << named;
    EXPECT_EQ(resolver.requests().at(0).uri, name);
    EXPECT_TRUE(resolver.look(name, 1000)) << "as the next run asks";
    EXPECT_EQ(text(resolver.read_beside("none.png", 1000)), "(none)");
    EXPECT_EQ(text(resolver.read_beside("out.png", 1000)), "(none)") << "no link is followed";
    for (const char* out : {"../textures/../../secret", "../secret", "../textures//../x", "../textures/"})
      EXPECT_THROW(resolver.read(out, 1000), InputError) << out;
  }
  for (const std::vector<std::string>& named :
       {std::vector<std::string>{}, {(root_ / "get/textures").string()}, {(root_ / "get/source").string()}}) {
    FileResolver resolver(root_ / "get/source", named, GetParam());
    EXPECT_THROW(resolver.read_beside("bust.png", 1000), FileRefused);
    EXPECT_FALSE(resolver.is_there(name));
  }
  write(root_ / "get/model/bust.obj", "v");
  FileResolver other(root_ / "get/model", {root_.string()}, GetParam());
  EXPECT_EQ(text(other.read_beside("bust.png", 1000)), "(none)");
  EXPECT_TRUE(other.requests().empty());
  EXPECT_THROW(other.read(name, 1000), FileRefused);
}

TEST_P(FileResolverTest, RecordsWhatNamesThereAreLikeOne) {
  write(folder_ / "Tex2/B.png", "1");
  FileResolver resolver(folder_, {}, GetParam());
  EXPECT_EQ(resolver.similar("A.BIN"), std::vector<std::string>{"a.bin"});
  EXPECT_EQ(resolver.similar("TEX/deep/B C.PNG"), std::vector<std::string>{"tex/deep/b c.png"});
  EXPECT_EQ(resolver.similar("tex2/b.PNG"), std::vector<std::string>{"Tex2/B.png"});
  EXPECT_TRUE(resolver.similar("a.bin").empty());
  EXPECT_TRUE(resolver.similar("none/b").empty());
  ASSERT_EQ(resolver.requests().size(), 5u);
  EXPECT_TRUE(resolver.requests()[0].similar && resolver.requests()[0].found);
  EXPECT_NE(resolver.requests()[0].stamp, FileStamp{});
  EXPECT_EQ(resolver.requests()[2].stamp, FileStamp{}) << "it hangs on two folders";
  EXPECT_FALSE(resolver.requests()[4].found);
  const Sha256 none = resolver.requests()[4].digest;
  fs::create_directory_symlink(root_ / "model", folder_ / "none");
  EXPECT_TRUE(FileResolver(folder_, {}, GetParam()).similar("none/A.BIN").empty())
      << "links are not followed";
  write(folder_ / "NONE/B", "2");
  FileResolver again(folder_, {}, GetParam());
  again.similar("none/b");
  EXPECT_NE(again.requests()[0].digest, none);
}

TEST_P(FileResolverTest, RefusesWhatIsNoRegularFileWithoutWaitingForIt) {
  ASSERT_EQ(::mkfifo((folder_ / "fifo").c_str(), 0600), 0);
  const int s = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  (folder_ / "socket").string().copy(address.sun_path, sizeof address.sun_path - 1);
  ASSERT_EQ(::bind(s, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  for (const char* uri : {"fifo", "socket", "tex"}) expect_refused(uri);
  ::close(s);
}

TEST_P(FileResolverTest, RefusesFilesOverTheLimit) {
  FileResolver resolver(folder_, {}, GetParam());
  EXPECT_EQ(text(resolver.read("a.bin", 5)), "alpha");
  EXPECT_THROW(resolver.read("a.bin", 4), InputError);
}

TEST_P(FileResolverTest, FolderMayBeALinkButMustBeAFolder) {
  fs::create_directory_symlink(folder_, root_ / "link");
  EXPECT_EQ(text(FileResolver(root_ / "link", {}, GetParam()).read("a.bin", 9)), "alpha");
  EXPECT_THROW(FileResolver(root_ / "secret", {}, GetParam()), InputError);
  EXPECT_THROW(FileResolver(root_ / "none", {}, GetParam()), InputError);
}

TEST_P(FileResolverTest, UnreadableFilesAreNoMatterOfTheModel) {
  ASSERT_EQ(::chmod((folder_ / "a.bin").c_str(), 0), 0);
  if (::access((folder_ / "a.bin").c_str(), R_OK) == 0) GTEST_SKIP() << "this user may read everything";
  FileResolver resolver(folder_, {}, GetParam());
  EXPECT_THROW(resolver.read("a.bin", 9), ResourceError);
  EXPECT_TRUE(resolver.failed_for_resources());
}

INSTANTIATE_TEST_SUITE_P(Methods, FileResolverTest,
                         ::testing::Values(FileResolver::Method::kBest, FileResolver::Method::kWalk),
                         [](const auto& p) {
                           return p.param == FileResolver::Method::kBest ? "best" : "walk";
                         });

TEST(ReadInputFile, FollowsLinksAndRefusesTheRest) {
  char name[] = "/tmp/texmesh_input_XXXXXX";
  const fs::path root = ::mkdtemp(name);
  write(root / "a", "alpha");
  fs::create_symlink("a", root / "link");
  ASSERT_EQ(::mkfifo((root / "fifo").c_str(), 0600), 0);
  EXPECT_EQ(text(read_input_file(root / "link", 5)), "alpha");
  EXPECT_THROW(read_input_file(root / "a", 4), InputError);
  EXPECT_THROW(read_input_file(root / "fifo", 100), InputError);
  EXPECT_THROW(read_input_file(root / "none", 100), InputError);
  EXPECT_THROW(read_input_file(root, 100), InputError);
  EXPECT_THROW(read_input_file("/dev/zero", 100), InputError);
  EXPECT_GT(read_input_file("/proc/self/status", 1 << 20).size(), 0u);
  EXPECT_THROW(read_input_file("/proc/self/status", 10), InputError);
  fs::remove_all(root);
}

}  // namespace texmesh::file_resolver_test
