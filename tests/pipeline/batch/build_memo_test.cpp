#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "pipeline/batch/build_memo.h"
#include "tests/support/command.h"

namespace texmesh {
namespace {
namespace fs = std::filesystem;
using testing::TemporaryFolder;

Sha256 digest_of(const std::string& s) {
  return sha256(std::span(reinterpret_cast<const std::uint8_t*>(s.data()), s.size()));
}

constexpr std::int64_t kMinute_ns = 60'000'000'000;

class Memo : public ::testing::Test {
 protected:
  /// A file, and what a run that has read it knows.
  FileRequest write(const std::string& name, const std::string& text) {
    testing::write_text(folder_ / name, text);
    return {name, true, digest_of(text), text.size(), *stamp_of(folder_ / name)};
  }

  /// A record whose stamps prove something: as if the files had been old when they were looked at.
  MemoRecord record() {
    MemoRecord r;
    FileRequest model = write("model.obj", "v 0 0 0");
    model.uri = "";
    r.files = {model, write("model.mtl", "newmtl a"), {"missing.jpg", false, {}, 0, {}}};
    const FileRequest package = write("model.texmesh", "a package");
    r.package_stamp = package.stamp;
    r.package_digest = package.digest;
    r.package_bytes = package.bytes;
    r.looked_at_ns = wall_clock_ns() + kMinute_ns;
    return r;
  }
  bool holds(MemoRecord& r) {
    return still_holds(r, folder_ / "model.obj", folder_ / "model.texmesh", refreshed_);
  }

  void expect_not_holding_after(const std::function<void()>& change) {
    MemoRecord r = record();
    ASSERT_TRUE(holds(r));
    change();
    EXPECT_FALSE(holds(r));
    fs::remove(folder_ / "missing.jpg");
  }

  TemporaryFolder folder_;
  bool refreshed_ = false;
};

TEST_F(Memo, GivesBackWhatWasSaved) {
  MemoRecord r = record();
  r.request = digest_of("options");
  r.failed = true;
  r.seconds = 2.5;
  r.peak_memory_bytes = 123456789;
  r.keys = {{"import", digest_of("i")}, {"package", digest_of("p")}};
  r.error = {"input", "model.obj", "line 3", "a number", "x", "model.obj: line 3: ..."};
  {
    BuildMemo memo(folder_ / "cache", "/out");
    memo.set("/out/a.texmesh", r);
    MemoRecord unsaved;
    EXPECT_TRUE(memo.find("/out/a.texmesh", unsaved));
    EXPECT_TRUE(memo.save());
  }
  const BuildMemo memo(folder_ / "cache", "/out");
  EXPECT_FALSE(memo.was_damaged());
  MemoRecord back;
  ASSERT_TRUE(memo.find("/out/a.texmesh", back));
  EXPECT_EQ(back.request, r.request);
  EXPECT_EQ(back.failed, r.failed);
  EXPECT_EQ(back.looked_at_ns, r.looked_at_ns);
  EXPECT_EQ(back.package_stamp, r.package_stamp);
  EXPECT_EQ(back.package_digest, r.package_digest);
  EXPECT_EQ(back.package_bytes, r.package_bytes);
  EXPECT_EQ(back.peak_memory_bytes, r.peak_memory_bytes);
  EXPECT_EQ(back.seconds, r.seconds);
  EXPECT_EQ(back.keys, r.keys);
  EXPECT_EQ(back.error, r.error);
  ASSERT_EQ(back.files.size(), r.files.size());
  for (std::size_t i = 0; i < r.files.size(); ++i) {
    EXPECT_EQ(back.files[i].uri, r.files[i].uri);
    EXPECT_EQ(back.files[i].found, r.files[i].found);
    EXPECT_EQ(back.files[i].digest, r.files[i].digest);
    EXPECT_EQ(back.files[i].bytes, r.files[i].bytes);
    EXPECT_EQ(back.files[i].stamp, r.files[i].stamp);
  }
  EXPECT_FALSE(memo.find("/out/b.texmesh", back));
  EXPECT_FALSE(BuildMemo(folder_ / "cache", "/elsewhere").find("/out/a.texmesh", back));
}

TEST_F(Memo, KeepsWhatOthersHaveSavedMeanwhile) {
  MemoRecord r = record();
  BuildMemo one(folder_ / "cache", "/out"), other(folder_ / "cache", "/out");
  one.set("/out/a.texmesh", r);
  other.set("/out/b.texmesh", r);
  EXPECT_TRUE(one.save());
  EXPECT_TRUE(other.save());
  const BuildMemo both(folder_ / "cache", "/out");
  EXPECT_TRUE(both.find("/out/a.texmesh", r));
  EXPECT_TRUE(both.find("/out/b.texmesh", r));
}

TEST_F(Memo, WithoutACacheNothingIsRemembered) {
  MemoRecord r = record();
  BuildMemo memo("", "/out");
  memo.set("/out/a.texmesh", r);
  EXPECT_TRUE(memo.save());
  EXPECT_FALSE(BuildMemo("", "/out").find("/out/a.texmesh", r));
}

TEST_F(Memo, EveryTruncationAndFlippedByteIsNoticedAndNothingIsBelieved) {
  MemoRecord r = record();
  {
    BuildMemo memo(folder_ / "cache", "/out");
    memo.set("/out/a.texmesh", r);
    ASSERT_TRUE(memo.save());
  }
  std::string file;
  for (const std::string& f : testing::files_beneath(folder_ / "cache"))
    if (!f.ends_with(".lock")) file = folder_ / ("cache/" + f);
  const std::string good = testing::read_text(file);
  ASSERT_GT(good.size(), 200u);
  for (std::size_t i = 0; i < 2 * good.size(); ++i) {
    std::string bad = good;
    if (i < good.size())
      bad[i] = static_cast<char>(bad[i] ^ (1 << i % 8));
    else
      bad.resize(i - good.size());
    testing::write_text(file, bad);
    const BuildMemo memo(folder_ / "cache", "/out");
    ASSERT_TRUE(memo.was_damaged()) << i;
    ASSERT_FALSE(memo.find("/out/a.texmesh", r)) << i;
  }
  BuildMemo memo(folder_ / "cache", "/out");
  memo.set("/out/a.texmesh", r);
  EXPECT_TRUE(memo.save());
  EXPECT_FALSE(BuildMemo(folder_ / "cache", "/out").was_damaged());
}

TEST_F(Memo, HoldsWhileEveryFileIsAsItWas) {
  MemoRecord r = record();
  EXPECT_TRUE(holds(r));
  EXPECT_FALSE(refreshed_);
}

TEST_F(Memo, AnotherContentOfTheSameSizeIsSeen) {
  expect_not_holding_after([&] { testing::write_text(folder_ / "model.obj", "v 1 0 0"); });
  expect_not_holding_after([&] { testing::write_text(folder_ / "model.mtl", "newmtl b"); });
  expect_not_holding_after([&] { testing::write_text(folder_ / "model.texmesh", "A package"); });
}

TEST_F(Memo, AContentOfTheSameSizeAndTimeIsSeen) {  // what comparing mtimes alone would miss
  expect_not_holding_after([&] {
    struct stat s {};
    ASSERT_EQ(::stat((folder_ / "model.mtl").c_str(), &s), 0);
    testing::write_text(folder_ / "model.mtl", "newmtl b");
    const timespec times[2] = {s.st_atim, s.st_mtim};
    ASSERT_EQ(::utimensat(AT_FDCWD, (folder_ / "model.mtl").c_str(), times, 0), 0);
  });
}

TEST_F(Memo, FilesThatComeAndGoAreSeen) {
  expect_not_holding_after([&] { testing::write_text(folder_ / "missing.jpg", "now it is there"); });
  expect_not_holding_after([&] { fs::remove(folder_ / "model.mtl"); });
  expect_not_holding_after([&] { fs::remove(folder_ / "model.texmesh"); });
  expect_not_holding_after([&] {
    fs::remove(folder_ / "model.mtl");
    fs::create_symlink("model.obj", folder_ / "model.mtl");  // import would not follow it either
  });
}

TEST_F(Memo, ATouchedFileIsReadAndItsStampRenewed) {
  MemoRecord r = record();
  ASSERT_EQ(::utimensat(AT_FDCWD, (folder_ / "model.mtl").c_str(), nullptr, 0), 0);
  EXPECT_TRUE(holds(r));
  EXPECT_TRUE(refreshed_);
  EXPECT_EQ(r.files[1].stamp, *stamp_of(folder_ / "model.mtl"));
}

TEST_F(Memo, AFileChangedJustBeforeItWasLookedAtIsReadAgain) {
  MemoRecord r = record();
  r.looked_at_ns = wall_clock_ns();  // the truth: the files are milliseconds old
  EXPECT_TRUE(holds(r));
  EXPECT_TRUE(refreshed_);
}

TEST_F(Memo, AFailureNeedsNoPackageAndNoFilesProveNothing) {
  MemoRecord r = record();
  r.failed = true;
  fs::remove(folder_ / "model.texmesh");
  EXPECT_TRUE(holds(r));
  r.files.clear();
  EXPECT_FALSE(holds(r));
}

}  // namespace
}  // namespace texmesh
