// The compile command as a user runs it: packages, determinism, events, limits.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mount.h>
#include <unistd.h>

#include <cstdlib>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>

#include "tests/support/command.h"
#include "tests/support/sanitizers.h"

namespace texmesh::testing::command_compile_test {
namespace fs = std::filesystem;
using Json = nlohmann::json;

CommandResult texmesh(std::vector<std::string> arguments, const std::vector<std::string>& environment = {},
                      const std::string& folder = "") {
  arguments.insert(arguments.begin(), TEXMESH_BINARY);
  return run_command(arguments, environment, folder);
}

/// One small scan for all tests, and its package as it comes out of a plain run.
class CompileCommand : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    shared_ = new TemporaryFolder;
    const CommandResult made =
        run_command({TEXMESH_MAKE_SCAN, "--triangles", "3000", "--texture", "512", "-o", scan()});
    ASSERT_EQ(made.exit_code, 0) << made.errors;
    const CommandResult r = texmesh({"compile", scan(), "-o", *shared_ / "scan.texmesh", "--no-cache"});
    ASSERT_EQ(r.exit_code, 0) << r.output << r.errors;
    package_ = read_text(*shared_ / "scan.texmesh");
    ASSERT_GT(package_.size(), 20000u);
  }
  static void TearDownTestSuite() { delete shared_; }
  static std::string scan() { return *shared_ / "scan.glb"; }

  std::string compile(std::vector<std::string> extra, const std::vector<std::string>& environment = {}) {
    const std::string out = folder_ / ("o" + std::to_string(count_++) + ".texmesh");
    std::vector<std::string> arguments{"compile", scan(), "-o", out};
    arguments.insert(arguments.end(), extra.begin(), extra.end());
    const CommandResult r = texmesh(arguments, environment);
    EXPECT_EQ(r.exit_code, 0) << r.output << r.errors;
    return read_text(out);
  }

  static TemporaryFolder* shared_;
  static std::string package_;
  TemporaryFolder folder_;
  int count_ = 0;
};
TemporaryFolder* CompileCommand::shared_ = nullptr;
std::string CompileCommand::package_;

TEST_F(CompileCommand, ThePackageVerifies) {
  const CommandResult r = texmesh({"verify", *shared_ / "scan.texmesh"});
  EXPECT_EQ(r.exit_code, 0) << r.output << r.errors;
}

TEST_F(CompileCommand, SameBytesForAnyNumberOfThreads) {
  EXPECT_EQ(compile({"--no-cache", "--jobs", "1"}), package_);
  EXPECT_EQ(compile({"--no-cache", "--jobs", "8"}), package_);
}

TEST_F(CompileCommand, SameBytesFromAnotherFolderNameAndLocale) {
  fs::create_directories(folder_ / "some where/else");
  fs::copy_file(scan(), folder_ / "some where/else/renamed.glb");
  const CommandResult r = texmesh({"compile", "renamed.glb", "-o", "x.texmesh", "--no-cache"},
                                  {"LC_ALL=de_DE.UTF-8", "TZ=Asia/Tokyo"}, folder_ / "some where/else");
  ASSERT_EQ(r.exit_code, 0) << r.errors;
  EXPECT_EQ(read_text(folder_ / "some where/else/x.texmesh"), package_);
}

TEST_F(CompileCommand, SameBytesOnOtherProcessorFeatures) {
  // Another libm and libjpeg path: what a machine without AVX2 and FMA would run.
  EXPECT_EQ(compile({"--no-cache"},
                    {"GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F,-ERMS", "JSIMD_FORCENONE=1"}),
            package_);
}

TEST_F(CompileCommand, SameBytesThroughTheCacheAndNothingRunsTwice) {
  const std::string cache = folder_ / "cache", out = folder_ / "scan.texmesh";
  auto run = [&] { return texmesh({"compile", scan(), "-o", out, "--json", "--cache", cache}); };
  auto stages = [](const CommandResult& r, const std::string& result) {
    std::set<std::string> names;
    for (std::istringstream in(r.output); in;) {
      std::string line;
      if (!std::getline(in, line)) break;
      const Json e = Json::parse(line);
      if (e["event"] == "stage-finished" && e["result"] == result) names.insert(e["stage"]);
    }
    return names;
  };
  const CommandResult first = run();
  EXPECT_EQ(read_text(out), package_);
  EXPECT_EQ(stages(first, "ran").size(), 18u) << first.output;
  const auto written = fs::last_write_time(out);
  const CommandResult second = run();
  EXPECT_EQ(second.exit_code, 0);
  EXPECT_TRUE(stages(second, "ran").empty()) << second.output;
  EXPECT_NE(second.output.find("\"unchanged\""), std::string::npos);
  EXPECT_EQ(fs::last_write_time(out), written);  // left alone
  fs::remove(out);
  run();
  EXPECT_EQ(read_text(out), package_);
  // An option of one stage: that stage and what follows from other bytes, nothing else.
  const CommandResult third =
      texmesh({"compile", scan(), "-o", out, "--json", "--cache", cache, "--title", "Turtle"});
  EXPECT_EQ(stages(third, "ran"), std::set<std::string>{"package"});
}

TEST_F(CompileCommand, CacheFolderFromTheEnvironment) {
  EXPECT_EQ(compile({}, {"TEXMESH_CACHE=" + (folder_ / "c")}), package_);
  EXPECT_TRUE(fs::exists(folder_ / "c/cas"));
}

TEST_F(CompileCommand, FlagsAndProfileMeanTheSame) {
  write_text(folder_ / "p.json", R"({"version":1,"ladder":{"rungs":[10,60]},"ssf":{"scales":8}})");
  const std::string by_profile = compile({"--no-cache", "--profile", folder_ / "p.json"});
  EXPECT_EQ(by_profile, compile({"--no-cache", "--rungs", "10,60", "--ssf.scales", "8"}));
  EXPECT_NE(by_profile, package_);
}

TEST_F(CompileCommand, ProgressiveTexturesWorkOrAreWarnedOf) {
  const auto codec_of = [&](const std::string& bytes) {
    write_text(folder_ / "x.texmesh", bytes);
    const CommandResult dumped = texmesh({"dump", folder_ / "x.texmesh", "ladder", "--json"});
    return Json::parse(dumped.output)["ladder"][0]["codec"].get<std::string>();
  };
  EXPECT_EQ(codec_of(package_), "jpeg");
  EXPECT_EQ(codec_of(compile({"--no-cache", "--ladder", "progressive"})), "jpeg-progressive");
  const CommandResult small = texmesh({"compile", scan(), "-o", folder_ / "small.texmesh", "--no-cache",
                                       "--ladder", "progressive", "--fragmentation.min_fragment_px", "64"});
  EXPECT_EQ(small.exit_code, 0) << small.errors;
  EXPECT_NE((small.output + small.errors).find("too small for progressive files"), std::string::npos)
      << small.output << small.errors;
  EXPECT_EQ(codec_of(read_text(folder_ / "small.texmesh")), "jpeg");
  // The default's own value counts as well when somebody has asked for it.
  EXPECT_EQ(
      codec_of(compile({"--no-cache", "--ladder", "progressive", "--fragmentation.min_fragment_px", "128"})),
      "jpeg");
}

TEST_F(CompileCommand, TheSourceStaysWhereItIsWanted) {
  const std::string kept = compile({"--no-cache", "--keep-source"});
  EXPECT_EQ(kept, compile({"--no-cache", "--ladder.keep_source", "true", "--jobs", "1"}));
  EXPECT_GT(kept.size(), package_.size());
  write_text(folder_ / "kept.texmesh", kept);
  const CommandResult verified = texmesh({"verify", folder_ / "kept.texmesh"});
  EXPECT_EQ(verified.exit_code, 0) << verified.output << verified.errors;
  const CommandResult dumped = texmesh({"dump", folder_ / "kept.texmesh", "ladder"});
  EXPECT_NE(dumped.output.find("the source as it was"), std::string::npos) << dumped.output;
  for (const std::string fragments : {"packs", "files"}) {
    const std::string tree = folder_ / ("tree-" + fragments);
    std::vector<std::string> unpack{"unpack", folder_ / "kept.texmesh", "-o", tree};
    if (fragments == "files") unpack.insert(unpack.end(), {"--fragments", "files"});
    EXPECT_EQ(texmesh(unpack).exit_code, 0);
    EXPECT_EQ(texmesh({"verify", tree}).exit_code, 0);
    EXPECT_EQ(texmesh({"pack", tree, "-o", folder_ / (fragments + ".texmesh")}).exit_code, 0);
    EXPECT_EQ(read_text(folder_ / (fragments + ".texmesh")), kept);
  }
}

TEST_F(CompileCommand, EventsAreJsonWithModelAndSummary) {
  const CommandResult r = texmesh({"compile", scan(), "-o", folder_ / "x.texmesh", "--json", "--no-cache"});
  std::istringstream in(r.output);
  std::vector<std::string> events;
  for (std::string line; std::getline(in, line);) events.push_back(Json::parse(line)["event"]);
  ASSERT_GE(events.size(), 4u);
  EXPECT_EQ(events.front(), "model-started");
  EXPECT_EQ(events[events.size() - 2], "model-finished");
  EXPECT_EQ(events.back(), "summary");
}

TEST_F(CompileCommand, OneBadModelDoesNotStopTheOthers) {
  fs::create_directories(folder_ / "in");
  fs::copy_file(scan(), folder_ / "in/good.glb");
  write_text(folder_ / "in/bad.glb", "glTF but no more");
  const CommandResult r = texmesh({"compile", folder_ / "in", "-o", folder_ / "out", "--no-cache"});
  EXPECT_EQ(r.exit_code, 1);
  EXPECT_EQ(files_beneath(folder_ / "out"), std::vector<std::string>{"good.texmesh"});
  EXPECT_EQ(read_text(folder_ / "out/good.texmesh"), package_);
  EXPECT_NE(r.output.find("bad.glb"), std::string::npos) << r.output;
  EXPECT_NE(r.output.find("1 compiled, 0 up to date, 1 failed"), std::string::npos) << r.output;
}

TEST_F(CompileCommand, UsageErrorsExitWithTwo) {
  EXPECT_EQ(texmesh({}).exit_code, 2);
  EXPECT_EQ(texmesh({"compile"}).exit_code, 2);
  EXPECT_EQ(texmesh({"compile", scan(), "-o", folder_ / "x.texmesh", "--ssf.scales", "0"}).exit_code, 2);
  EXPECT_EQ(texmesh({"compile", scan(), "-o", folder_ / "x.texmesh", "--ssf.scale", "4"}).exit_code, 2);
  EXPECT_EQ(
      texmesh({"compile", scan(), "-o", folder_ / "x.texmesh", "--profile", folder_ / "none.json"}).exit_code,
      2);
  EXPECT_EQ(texmesh({"compile", scan(), scan(), "-o", folder_ / "x.texmesh"}).exit_code, 2);
  EXPECT_TRUE(files_beneath(folder_.path().string()).empty());
  EXPECT_EQ(texmesh({"--help"}).exit_code, 0);
  EXPECT_EQ(texmesh({"compile", "--help"}).exit_code, 0);
  EXPECT_NE(texmesh({"--version"}).output.find("package format 2.1"), std::string::npos);
}

TEST_F(CompileCommand, MemoryLimitIsAnErrorOfTheModel) {
  const CommandResult r =
      texmesh({"compile", scan(), "-o", folder_ / "x.texmesh", "--no-cache", "--model-memory", "60MB"});
  if (!testing::kSanitized) EXPECT_NE(r.exit_code, 0) << r.output;
  if (r.exit_code != 0) EXPECT_TRUE(files_beneath(folder_.path().string()).empty());
}

TEST_F(CompileCommand, WallLimitIsAnErrorOfTheModel) {
  const CommandResult made =
      run_command({TEXMESH_MAKE_SCAN, "--triangles", "400000", "--texture", "0", "-o", folder_ / "big.ply"});
  ASSERT_EQ(made.exit_code, 0) << made.errors;
  // On a busy machine the first second may pass before a stage begins. The model takes many times longer than
  // its first stages, however busy the machine is.
  bool has_named_stages = false;
  for (int limit_s = 1; limit_s <= 32 && !has_named_stages; limit_s *= 2) {
    const CommandResult r = texmesh({"compile", folder_ / "big.ply", "-o", folder_ / "x.texmesh",
                                     "--no-cache", "--timeout", std::to_string(limit_s)});
    EXPECT_EQ(r.exit_code, 75);
    const std::string limit = "expected at most " + std::to_string(limit_s) + " s";
    ASSERT_TRUE(std::regex_search(r.output, std::regex("big.ply: (running [a-z_, ]+: )?" + limit)))
        << r.output;
    has_named_stages = std::regex_search(r.output, std::regex("big.ply: running [a-z_, ]+: " + limit));
  }
  EXPECT_TRUE(has_named_stages);
  EXPECT_EQ(files_beneath(folder_.path().string()), std::vector<std::string>{"big.ply"});
}

TEST_F(CompileCommand, TerminationEndsCleanlyWithinTwoSeconds) {
  const CommandResult made =
      run_command({TEXMESH_MAKE_SCAN, "--triangles", "400000", "--texture", "0", "-o", folder_ / "big.ply"});
  ASSERT_EQ(made.exit_code, 0);
  const std::string command =
      std::string(TEXMESH_BINARY) + " compile '" + (folder_ / "big.ply") + "' -o '" +
      (folder_ / "x.texmesh") +
      "' --no-cache & p=$!; for ((i = 0; i < 1200; ++i)); do pgrep -P $p >/dev/null && break; sleep 0.05; done; "
      "sleep 0.5; kill -TERM $p; s=$(date +%s%N); wait $p; c=$?; " +
      "e=$(date +%s%N); echo took $(( (e - s) / 1000000 )); exit $c";
  const CommandResult r = run_command({"bash", "-c", command});
  EXPECT_EQ(r.exit_code, 75) << r.output << r.errors;
  const std::size_t at = r.output.rfind("took ");
  ASSERT_NE(at, std::string::npos);
  EXPECT_LT(std::stoi(r.output.substr(at + 5)), testing::sanitizers_take(2500)) << r.output;
  EXPECT_EQ(files_beneath(folder_.path().string()), std::vector<std::string>{"big.ply"});
}

TEST_F(CompileCommand, AFullDiskLeavesNothing) {
  // A file size limit stands for the full disk: the same failing write() in the middle of the package.
  const CommandResult r = run_command({"bash", "-c",
                                       std::string("ulimit -f 8; exec ") + TEXMESH_BINARY + " compile '" +
                                           scan() + "' -o '" + (folder_ / "x.texmesh") + "' --no-cache"});
  EXPECT_EQ(r.exit_code, 75) << r.output;
  EXPECT_NE(r.output.find("x.texmesh: cannot be written: write: "), std::string::npos) << r.output;
  EXPECT_TRUE(files_beneath(folder_.path().string()).empty());
}

TEST_F(CompileCommand, AFullTemporaryFileSystemLeavesNothing) {
  fs::create_directories(folder_ / "small");
  if (::mount("tmpfs", (folder_ / "small").c_str(), "tmpfs", 0, "size=16k") != 0)
    GTEST_SKIP() << "mounting needs root";
  const CommandResult r = texmesh({"compile", scan(), "-o", folder_ / "small/x.texmesh", "--no-cache"});
  const auto left = files_beneath(folder_ / "small");
  ::umount((folder_ / "small").c_str());
  EXPECT_EQ(r.exit_code, 75) << r.output;
  EXPECT_TRUE(left.empty());
}

TEST_F(CompileCommand, AnUnwritableOutputIsAnError) {
  const CommandResult r = texmesh({"compile", scan(), "-o", "/proc/none/x.texmesh", "--no-cache"});
  EXPECT_EQ(r.exit_code, 1) << r.output << r.errors;
  fs::create_directories(folder_ / "x.texmesh/inside");
  EXPECT_EQ(texmesh({"compile", scan(), "-o", folder_ / "x.texmesh/inside/..", "--no-cache"}).exit_code,
            0);  // a folder: x.texmesh/scan.texmesh
}

TEST_F(CompileCommand, AnUnusableCacheIsAWarningWithItsName) {
  write_text(folder_ / "file", "");
  const CommandResult r =
      texmesh({"compile", scan(), "-o", folder_ / "x.texmesh", "--cache", folder_ / "file/cache"});
  EXPECT_EQ(r.exit_code, 0);
  EXPECT_NE(r.output.find("cache: " + (folder_ / "file/cache") + " cannot be made"), std::string::npos)
      << r.output;
  EXPECT_TRUE(std::filesystem::exists(folder_ / "x.texmesh"));
}

}  // namespace texmesh::testing::command_compile_test
