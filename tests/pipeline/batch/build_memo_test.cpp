#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "pipeline/batch/build_memo.h"
#include "pipeline/io/names/similar_names.h"
#include "tests/support/command.h"

namespace texmesh::build_memo_test {
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
    return {name, true, digest_of(text), text.size(), *stamp_of(folder_ / name), false};
  }

  /// A record whose stamps prove something: as if the files had been old when they were looked at.
  PackageMemo record() {
    PackageMemo r;
    r.input_name = "model.obj";
    FileRequest model = write("model.obj", "v 0 0 0");
    model.uri = "";
    r.files = {model, write("model.mtl", "newmtl a"), {"missing.jpg", false, {}, 0, {}, false}};
    const FileRequest package = write("model.texmesh", "a package");
    r.package_stamp = package.stamp;
    r.package_digest = package.digest;
    r.package_bytes = package.bytes;
    r.looked_at_ns = wall_clock_ns() + kMinute_ns;
    return r;
  }
  /// Names like that of the missing file, of a folder that may have changed since.
  FileRequest similar() const {
    FileRequest r = similar_names(folder_ / "", "missing.jpg").request("missing.jpg");
    r.stamp = {};
    return r;
  }
  bool holds(PackageMemo& r) {
    return still_holds(r, folder_ / "model.obj", folder_ / "model.texmesh", refreshed_);
  }

  void expect_not_holding_after(const std::function<void()>& change) {
    PackageMemo r = record();
    ASSERT_TRUE(holds(r));
    change();
    EXPECT_FALSE(holds(r));
    fs::remove(folder_ / "missing.jpg");
  }

  std::string cache() const { return folder_ / "cache"; }
  /// The files of every memo.
  std::vector<std::string> segments() const {
    std::vector<std::string> paths;
    for (const std::string& f : testing::files_beneath(cache())) paths.push_back(cache() + "/" + f);
    return paths;
  }

  TemporaryFolder folder_;
  bool refreshed_ = false;
};

TEST_F(Memo, GivesBackWhatWasSaved) {
  PackageMemo r = record();
  r.request = digest_of("options");
  r.failed = true;
  r.seconds = 2.5;
  r.peak_memory_bytes = 123456789;
  r.keys = {{"import", digest_of("i")}, {"package", digest_of("p")}};
  r.error = {"input", "model.obj", "line 3", "a number", "x", "model.obj: line 3: ..."};
  {
    BuildMemo memo(cache(), "/out");
    memo.set("a.texmesh", r);
    EXPECT_TRUE(memo.save());
  }
  const BuildMemo memo(cache(), "/out");
  EXPECT_FALSE(memo.was_damaged());
  PackageMemo back;
  ASSERT_TRUE(memo.find("a.texmesh", back));
  EXPECT_EQ(back.request, r.request);
  EXPECT_EQ(back.failed, r.failed);
  EXPECT_EQ(back.looked_at_ns, r.looked_at_ns);
  EXPECT_EQ(back.package_stamp, r.package_stamp);
  EXPECT_EQ(back.package_digest, r.package_digest);
  EXPECT_EQ(back.package_bytes, r.package_bytes);
  EXPECT_EQ(back.peak_memory_bytes, r.peak_memory_bytes);
  EXPECT_EQ(back.seconds, r.seconds);
  EXPECT_EQ(memo.keys("a.texmesh"), r.keys);
  EXPECT_EQ(back.error, r.error);
  ASSERT_EQ(back.files.size(), r.files.size());
  for (std::size_t i = 0; i < r.files.size(); ++i) {
    EXPECT_EQ(back.files[i].uri, r.files[i].uri);
    EXPECT_EQ(back.files[i].found, r.files[i].found);
    EXPECT_EQ(back.files[i].digest, r.files[i].digest);
    EXPECT_EQ(back.files[i].bytes, r.files[i].bytes);
    EXPECT_EQ(back.files[i].stamp, r.files[i].stamp);
  }
  EXPECT_FALSE(memo.find("b.texmesh", back));
  EXPECT_FALSE(BuildMemo(cache(), "/elsewhere").find("a.texmesh", back));
}

TEST_F(Memo, EveryRunReadsWhatEveryOtherHasSaved) {
  PackageMemo r = record();
  {
    BuildMemo one(cache(), "/out"), other(cache(), "/out");
    one.set("a.texmesh", r);
    other.set("b.texmesh", r);
    EXPECT_TRUE(one.save());
    EXPECT_TRUE(other.save());
    const BuildMemo beside(cache(), "/out");  // both are still at work
    EXPECT_FALSE(beside.was_damaged());
    EXPECT_TRUE(beside.find("a.texmesh", r));
    EXPECT_TRUE(beside.find("b.texmesh", r));
  }
  const BuildMemo after(cache(), "/out");
  EXPECT_TRUE(after.find("a.texmesh", r));
  EXPECT_TRUE(after.find("b.texmesh", r));
}

TEST_F(Memo, TheLaterRecordCountsWhoeverHasSavedItFirst) {
  for (const bool later_first : {false, true}) {
    PackageMemo early = record(), late = record();
    early.seconds = 1;
    late.seconds = 2;
    late.looked_at_ns = early.looked_at_ns + 1;
    const std::string out = later_first ? "/one" : "/other";
    for (const PackageMemo* r : {later_first ? &late : &early, later_first ? &early : &late}) {
      BuildMemo memo(cache(), out);
      memo.set("a.texmesh", *r);
      ASSERT_TRUE(memo.save());
    }
    PackageMemo found;
    ASSERT_TRUE(BuildMemo(cache(), out).find("a.texmesh", found));
    EXPECT_EQ(found.seconds, 2);
  }
}

TEST_F(Memo, ManyRunsLeaveFewFilesAndEveryRecord) {
  constexpr int kRuns = 100;
  const PackageMemo r = record();
  std::size_t most = 0;
  for (int i = 0; i < kRuns; ++i) {
    BuildMemo memo(cache(), "/out");
    for (int j = 0; j < i % 7 + 1; ++j) {
      PackageMemo mine = r;
      mine.seconds = i;
      mine.keys = {{"stage " + std::to_string(i % 3), digest_of(std::to_string(i))}};
      mine.looked_at_ns += i;
      memo.set(std::to_string(i * (j > 0)) + "-" + std::to_string(j), mine);
    }
    ASSERT_TRUE(memo.save());
    most = std::max(most, segments().size());
  }
  EXPECT_LE(most, 24u);
  const BuildMemo memo(cache(), "/out");
  EXPECT_FALSE(memo.was_damaged());
  for (int i = 0; i < kRuns; ++i)
    for (int j = 0; j < i % 7 + 1; ++j) {
      PackageMemo found;
      ASSERT_TRUE(memo.find(std::to_string(i * (j > 0)) + "-" + std::to_string(j), found)) << i << " " << j;
      if (j == 0) EXPECT_EQ(found.seconds, kRuns - 1);
      if (j > 0) {
        EXPECT_EQ(found.seconds, i);
        EXPECT_EQ(memo.keys(std::to_string(i * (j > 0)) + "-" + std::to_string(j)),
                  (StageKeys{{"stage " + std::to_string(i % 3), digest_of(std::to_string(i))}}));
      }
    }
}

TEST_F(Memo, ARunThatSavesNothingWritesNothing) {
  { const BuildMemo memo(cache(), "/out"); }
  EXPECT_FALSE(fs::exists(cache()));
}

TEST_F(Memo, ARunThatWasKilledLosesAtMostItsLastRecord) {
  const PackageMemo r = record();
  std::string open;
  std::size_t one_record = 0;
  {
    BuildMemo memo(cache(), "/out");
    memo.set("a.texmesh", r);
    ASSERT_TRUE(memo.save());
    open = segments().at(0);
    one_record = fs::file_size(open);
    memo.set("b.texmesh", r);
    ASSERT_TRUE(memo.save());
    const std::string good = testing::read_text(open);
    testing::write_text(folder_ / "killed", good);
  }
  fs::remove_all(cache());
  fs::create_directories(fs::path(open).parent_path());
  const std::string good = testing::read_text(folder_ / "killed");
  for (std::size_t bytes = 0; bytes <= good.size(); ++bytes) {
    testing::write_text(open, good.substr(0, bytes));
    const BuildMemo memo(cache(), "/out");
    PackageMemo found;
    ASSERT_FALSE(memo.was_damaged()) << bytes;
    ASSERT_EQ(memo.find("a.texmesh", found), bytes >= one_record) << bytes;
    ASSERT_EQ(memo.find("b.texmesh", found), bytes == good.size()) << bytes;
  }
}

TEST_F(Memo, WithoutACacheNothingIsRemembered) {
  PackageMemo r = record();
  BuildMemo memo("", "/out");
  memo.set("a.texmesh", r);
  EXPECT_TRUE(memo.save());
  EXPECT_FALSE(BuildMemo("", "/out").find("a.texmesh", r));
}

TEST_F(Memo, EveryTruncationAndFlippedByteIsNoticedAndNothingWrongIsBelieved) {
  PackageMemo r = record();
  r.keys = {{"import", digest_of("i")}, {"package", digest_of("p")}};
  const StageKeys keys = r.keys;
  {
    BuildMemo memo(cache(), "/out");
    memo.set("a.texmesh", r);
    ASSERT_TRUE(memo.save());
  }
  const std::string file = segments().at(0), good = testing::read_text(file);
  ASSERT_TRUE(file.ends_with(".seg"));
  ASSERT_GT(good.size(), 200u);
  for (std::size_t i = 0; i < 2 * good.size(); ++i) {
    std::string bad = good;
    if (i < good.size())
      bad[i] = static_cast<char>(bad[i] ^ (1 << i % 8));
    else
      bad.resize(i - good.size());
    testing::write_text(file, bad);
    const BuildMemo memo(cache(), "/out");
    const bool found = memo.find("a.texmesh", r);
    const StageKeys found_keys = memo.keys("a.texmesh");
    ASSERT_TRUE(memo.was_damaged() || !found || found_keys.empty()) << i;
    if (found) ASSERT_EQ(r.package_digest, record().package_digest) << i;
    if (!found_keys.empty()) ASSERT_EQ(found_keys, keys) << i;
  }
  {
    BuildMemo memo(cache(), "/out");
    memo.set("b.texmesh", r);
    EXPECT_TRUE(memo.save());
  }
  EXPECT_FALSE(BuildMemo(cache(), "/out").was_damaged()) << "what is damaged is merged away";
  EXPECT_TRUE(BuildMemo(cache(), "/out").find("b.texmesh", r));
}

TEST_F(Memo, HoldsWhileEveryFileIsAsItWas) {
  PackageMemo r = record();
  EXPECT_TRUE(holds(r));
  EXPECT_FALSE(refreshed_);
}

TEST_F(Memo, NamesLikeAMissingOneAreListedAgainOnlyWhenTheFolderHasChanged) {
  PackageMemo r = record();
  r.files.push_back(similar());
  ASSERT_TRUE(holds(r));
  EXPECT_TRUE(refreshed_) << "listed";
  r.looked_at_ns = wall_clock_ns() + kMinute_ns;
  ASSERT_TRUE(holds(r));
  EXPECT_FALSE(refreshed_) << "known by the folder's stamp";
  r.files.back().stamp = {};
  testing::write_text(folder_ / "Missing.JPG", "this may be meant");
  EXPECT_FALSE(holds(r));
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
  PackageMemo r = record();
  ASSERT_EQ(::utimensat(AT_FDCWD, (folder_ / "model.mtl").c_str(), nullptr, 0), 0);
  EXPECT_TRUE(holds(r));
  EXPECT_TRUE(refreshed_);
  EXPECT_EQ(r.files[1].stamp, *stamp_of(folder_ / "model.mtl"));
}

TEST_F(Memo, AFileChangedJustBeforeItWasLookedAtIsReadAgain) {
  PackageMemo r = record();
  r.looked_at_ns = wall_clock_ns();  // the truth: the files are milliseconds old
  EXPECT_TRUE(holds(r));
  EXPECT_TRUE(refreshed_);
}

TEST_F(Memo, AFailureNeedsNoPackageAndNoFilesProveNothing) {
  PackageMemo r = record();
  r.failed = true;
  fs::remove(folder_ / "model.texmesh");
  EXPECT_TRUE(holds(r));
  r.files.clear();
  EXPECT_FALSE(holds(r));
}

}  // namespace texmesh::build_memo_test
