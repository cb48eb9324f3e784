// Builds that are killed, or whose file system fails, at every call that changes a file: what they leave is
// either absent or whole, and the next build gives the same bytes as an undisturbed one. (Power loss is not
// covered: what the kernel was given counts as written.)
#include <gtest/gtest.h>

#include <cinttypes>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "pipeline/io/machine.h"
#include "tests/faults/shared_counts.h"
#include "tests/support/sanitizers.h"
#include "tests/support/small_builds.h"

namespace texmesh::testing::command_compile_faults_test {
namespace fs = std::filesystem;
using Json = nlohmann::json;

CommandResult texmesh(std::vector<std::string> arguments, const std::vector<std::string>& environment = {}) {
  arguments.insert(arguments.begin(), TEXMESH_BINARY);
  return run_command(arguments, environment);
}

/// One build's place: packages and cache.
class Site {
 public:
  Site(const std::string& models, const std::string& profile, const std::string& jobs)
      : models_(models), profile_(profile), jobs_(jobs) {
    fs::create_directories(out());
  }
  std::string out() const { return folder_ / "out"; }
  std::string cache() const { return folder_ / "cache"; }

  CommandResult build(const std::vector<std::string>& environment = {}) const {
    return texmesh(
        {"compile", models_, "-o", out(), "--cache", cache(), "--profile", profile_, "--jobs", jobs_},
        environment);
  }

  /// A build in which call number `at` beneath the folder (of the whole site by default) goes wrong.
  CommandResult build_with_fault(const std::string& action, std::uint64_t at, SharedCounts& counts,
                                 const std::string& under = "", const std::string& preload = "") const {
    return build({"LD_PRELOAD=" TEXMESH_FAULT_SHIM + preload, "TEXMESH_FAULT_FILE=" + counts.file(),
                  "TEXMESH_FAULT_UNDER=" + (under.empty() ? folder_.path().string() : under),
                  "TEXMESH_FAULT_ACTION=" + action, "TEXMESH_FAULT_AT=" + std::to_string(at)});
  }
  SharedCounts counts() const { return SharedCounts(folder_ / "counts"); }

  Packages packages() const { return packages_in(out()); }

  /// Temporary files anywhere, beneath the site.
  std::vector<std::string> temporaries() const {
    std::vector<std::string> found;
    for (const std::string& f : files_beneath(folder_.path().string()))
      if (f.find(".tmp") != std::string::npos) found.push_back(f);
    return found;
  }

  /// Processes of a killed build die one after the other.
  void wait_for_the_dead() const {
    for (int i = 0; i < 500 && fs::exists(cache()); ++i) {
      const CommandResult r = texmesh({"cache", "stat", "--json", "--cache", cache()});
      if (Json::parse(r.output, nullptr, false).value("running_builds", 0) == 0) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }

  void expect_sound_cache(const std::string& what) const {
    if (!fs::exists(cache())) return;
    const CommandResult r = texmesh({"cache", "verify", "--cache", cache()});
    EXPECT_EQ(r.exit_code, 0) << what << ": " << r.output << r.errors;
  }

 private:
  std::string models_, profile_, jobs_;
  TemporaryFolder folder_;
};

class Faults : public ::testing::Test {
 protected:
  void SetUp() override {
    if (testing::kSanitized) GTEST_SKIP() << "a preloaded library would come before the sanitizer's";
  }

  static void TearDownTestSuite() { std::printf("points of all sweeps that ran: %d\n", all_points_); }

  /// Makes `models` tiny models and compiles them undisturbed.
  void prepare(int models, const std::string& jobs) {
    models_ = folder_ / "models";
    profile_ = folder_ / "profile.json";
    jobs_ = jobs;
    write_text(profile_, kCheapProfile);
    ASSERT_NO_FATAL_FAILURE(make_tiny_models(TEXMESH_MAKE_SCAN, models, models_));
    const Site site(models_, profile_, jobs_);
    SharedCounts counts = site.counts();
    const CommandResult r = site.build_with_fault("none", 0, counts);
    ASSERT_EQ(r.exit_code, 0) << r.output << r.errors;
    reference_ = site.packages();
    ASSERT_EQ(reference_.size(), static_cast<std::size_t>(models));
    calls_ = (*counts).calls;
    ASSERT_GT(calls_, 100u * static_cast<std::uint64_t>(models)) << "the shim is not at work";
    EXPECT_TRUE(site.temporaries().empty());
  }

  /// All points, or a sample: spread over them, and more of the last ones, which write the package and the
  /// memo. Of all, TEXMESH_SWEEP_PART=1/4 names a part.
  std::set<std::uint64_t> points(std::uint64_t sample) const {
    std::set<std::uint64_t> all;
    std::uint64_t part = 0, parts = 1;
    if (const char* said = std::getenv("TEXMESH_SWEEP_PART"); said && full_sweeps())
      std::sscanf(said, "%" SCNu64 "/%" SCNu64, &part, &parts);
    if (parts > 1) {
      for (std::uint64_t at = 1 + part; at <= calls_; at += parts) all.insert(at);
      return all;
    }
    const std::uint64_t n = full_sweeps() ? calls_ : std::min(sample, calls_);
    for (std::uint64_t i = 0; i < n; ++i)
      all.insert(1 + i * (calls_ - 1) / std::max<std::uint64_t>(n - 1, 1));
    for (std::uint64_t back = 2; back <= 14; back += 3) all.insert(calls_ - back);
    return all;
  }

  static int wanted(int of_all, int of_a_sample) {
    return full_sweeps() && !std::getenv("TEXMESH_SWEEP_PART") ? of_all : of_a_sample;
  }

  void expect_nothing_torn(const Site& site, const std::string& what) const {
    site.expect_sound_cache(what);
    for (const auto& [name, bytes] : site.packages()) {
      if (name.find(".texmesh.tmp") != std::string::npos) continue;  // the next build removes it
      ASSERT_TRUE(reference_.contains(name)) << what << " left " << name;
      EXPECT_TRUE(bytes == reference_.at(name)) << what << " left a torn " << name;
    }
  }

  void expect_next_build_to_be_whole(const Site& site, const std::string& what) const {
    const CommandResult r = site.build();
    EXPECT_EQ(r.exit_code, 0) << what << ": " << r.output << r.errors;
    EXPECT_TRUE(site.packages() == reference_) << what << ": other packages, or something beside them";
    site.expect_sound_cache(what + ", next build");
    texmesh({"cache", "prune", "--size", "0", "--age", "0", "--cache", site.cache()});
    for (const std::string& f : site.temporaries()) ADD_FAILURE() << what << " leaves " << f << " for ever";
  }

  /// Errors of the file system at the points of a sweep. Returns how many builds failed, and how.
  void sweep_errors(const std::string& action, const std::string& reason, std::uint64_t sample) {
    prepare(1, "1");
    std::size_t failed = 0, succeeded = 0, silent = 0;
    std::map<int, int> by_call;
    for (const std::uint64_t at : points(sample)) {
      const Site site(models_, profile_, jobs_);
      SharedCounts counts = site.counts();
      const CommandResult r = site.build_with_fault(action, at, counts);
      const std::string what =
          action + " at call " + std::to_string(at) + " (kind " + std::to_string((*counts).fired_call) + ")";
      if ((*counts).fired == 0) continue;
      ++all_points_;
      const std::string text = r.output + r.errors;
      if (r.exit_code == 0) {
        ++succeeded;
        EXPECT_TRUE(site.packages() == reference_) << what << ": success without the package";
        if (text.find("cache:") == std::string::npos)
          ++silent, ++by_call[static_cast<int>((*counts).fired_call)];
      } else {
        ++failed;
        EXPECT_EQ(r.exit_code, 75) << what << ": " << text;
        EXPECT_NE(text.find(reason), std::string::npos) << what << ": " << text;
        EXPECT_TRUE(text.find(site.out()) != std::string::npos ||
                    text.find(site.cache()) != std::string::npos)
            << what << " does not name the file: " << text;
      }
      expect_nothing_torn(site, what);
      expect_next_build_to_be_whole(site, what);
    }
    std::string calls;
    for (const auto& [call, n] : by_call) calls += " kind " + std::to_string(call) + ": " + std::to_string(n);
    std::printf("%s: %zu builds failed with its name, %zu succeeded (%zu without a word:%s), of %llu calls\n",
                action.c_str(), failed, succeeded, silent, calls.c_str(),
                static_cast<unsigned long long>(calls_));
    EXPECT_GT(failed + succeeded, 0u);
  }

  /// Kills at the points of a sweep. Returns how many there were.
  int sweep_kills(std::uint64_t sample, const std::string& preload = "") {
    std::map<std::uint32_t, int> killed;
    int points_done = 0;
    for (const std::uint64_t at : points(sample)) {
      const Site site(models_, profile_, jobs_);
      SharedCounts counts = site.counts();
      const CommandResult r = site.build_with_fault("kill", at, counts, "", preload);
      if ((*counts).fired == 0) continue;  // threads: this run has made fewer calls
      ++points_done, ++all_points_;
      ++killed[(*counts).fired_call];
      const std::string what =
          "kill at call " + std::to_string(at) + " (kind " + std::to_string((*counts).fired_call) + ")";
      EXPECT_EQ(r.exit_code, 128 + 9) << what;
      site.wait_for_the_dead();
      expect_nothing_torn(site, what);
      expect_next_build_to_be_whole(site, what);
      if (HasFatalFailure()) break;
    }
    std::printf(
        "killed at %d of %llu calls: open %d, write %d, sync %d, link %d, rename %d, unlink %d, mkdir %d\n",
        points_done, static_cast<unsigned long long>(calls_), killed[0], killed[1], killed[2], killed[3],
        killed[4], killed[5], killed[6]);
    return points_done;
  }

  TemporaryFolder folder_;
  std::string models_, profile_, jobs_;
  Packages reference_;
  std::uint64_t calls_ = 0;
  static inline int all_points_ = 0;
};

TEST_F(Faults, KilledAtEveryCall) {
  ASSERT_NO_FATAL_FAILURE(prepare(full_sweeps() ? 3 : 1, full_sweeps() ? "2" : "1"));
  EXPECT_GE(sweep_kills(6), wanted(500, 5));
}

TEST_F(Faults, KilledAtEveryCallWhereLocksAreGrantedToAll) {
  ASSERT_NO_FATAL_FAILURE(prepare(1, "1"));
  EXPECT_GE(sweep_kills(2, ":" TEXMESH_GRANT_LOCKS), wanted(200, 2));
}

TEST_F(Faults, TheDiskIsFullFromEveryCallOn) {
  ASSERT_NO_FATAL_FAILURE(sweep_errors("full", "No space left on device", 4));
}

TEST_F(Faults, AnInputOutputErrorAtEveryCall) {
  ASSERT_NO_FATAL_FAILURE(sweep_errors("eio", "Input/output error", 4));
}

/// A cache that cannot be written costs the next build's time, and nothing else.
TEST_F(Faults, ACacheThatIsReadOnlyOrFullFromEveryCallOn) {
  ASSERT_NO_FATAL_FAILURE(prepare(1, "1"));
  int points_done = 0;
  for (const char* action : {"frozen", "full"})
    for (const std::uint64_t at : points(3)) {
      const Site site(models_, profile_, jobs_);
      fs::create_directories(site.cache());
      SharedCounts counts = site.counts();
      const CommandResult r = site.build_with_fault(action, at, counts, site.cache());
      if ((*counts).fired == 0) continue;  // fewer calls are made beneath the cache than in all
      ++points_done, ++all_points_;
      const std::string what = std::string(action) + " cache at call " + std::to_string(at);
      EXPECT_EQ(r.exit_code, 0) << what << ": " << r.output << r.errors;
      EXPECT_TRUE(site.packages() == reference_) << what;
      site.expect_sound_cache(what);
      expect_next_build_to_be_whole(site, what);
    }
  std::printf("caches read-only or full: %d points\n", points_done);
  EXPECT_GE(points_done, 4);
}

TEST_F(Faults, ShortReadsAndWritesAndSignalsChangeNothing) {
  ASSERT_NO_FATAL_FAILURE(prepare(2, "1"));
  const Site site(models_, profile_, jobs_);
  for (const char* build : {"first build", "no-op"}) {
    SharedCounts counts = site.counts();
    const CommandResult r = site.build_with_fault("choppy", 0, counts);
    EXPECT_EQ(r.exit_code, 0) << build << ": " << r.output << r.errors;
    EXPECT_GT((*counts).fired, 10u) << build << ": the shim is not at work";
    std::printf("%s: %llu reads and writes cut or interrupted\n", build,
                static_cast<unsigned long long>((*counts).fired));
    EXPECT_TRUE(site.packages() == reference_) << build;
    site.expect_sound_cache(build);
  }
  fs::remove_all(site.out());
  fs::create_directories(site.out());
  SharedCounts counts = site.counts();
  EXPECT_EQ(site.build_with_fault("choppy", 0, counts).exit_code, 0) << "packages from the cache";
  expect_next_build_to_be_whole(site, "short reads");
}

TEST_F(Faults, ClocksThatJumpChangeNothing) {
  ASSERT_NO_FATAL_FAILURE(prepare(2, "1"));
  const Site site(models_, profile_, jobs_);
  for (const char* build : {"first build", "no-op", "again"}) {
    SharedCounts counts = site.counts();
    const CommandResult r = site.build_with_fault("clock", 0, counts);
    EXPECT_EQ(r.exit_code, 0) << build << ": " << r.output << r.errors;
    EXPECT_GT((*counts).fired, 1u) << build << ": the shim is not at work";
    EXPECT_TRUE(site.packages() == reference_) << build;
  }
  // A model that changes is seen, whatever the clock had said when it was looked at.
  const std::string model = models_ + "/scan_00000.glb";
  std::string bytes = read_text(models_ + "/scan_00001.glb");
  const std::string before = read_text(model);
  write_text(model, bytes);
  EXPECT_EQ(site.build().exit_code, 0);
  EXPECT_FALSE(site.packages() == reference_) << "a change was not seen";
  write_text(model, before);
  expect_next_build_to_be_whole(site, "clocks that jump");
}

TEST_F(Faults, WithoutLocksEveryPackageIsMade) {
  ASSERT_NO_FATAL_FAILURE(prepare(2, "1"));
  const Site site(models_, profile_, jobs_);
  SharedCounts counts = site.counts();
  const CommandResult r = site.build_with_fault("nolock", 0, counts);
  EXPECT_EQ(r.exit_code, 0) << r.output << r.errors;
  EXPECT_GT((*counts).fired, 0u) << "the shim is not at work";
  EXPECT_TRUE(site.packages() == reference_);
  expect_next_build_to_be_whole(site, "no locks");
}

/// The merged summary is the old one or the new one, whatever happens to the process that writes it.
TEST_F(Faults, AMergeThatIsKilledOrFailsAtEveryCall) {
  prepare(2, "1");
  std::vector<std::string> parts;
  for (const std::string shard : {"0", "1"}) {
    parts.push_back(folder_ / ("part" + shard + ".json"));
    const CommandResult r =
        texmesh({"compile", models_, "-o", folder_ / "out", "--cache", folder_ / "cache", "--profile",
                 profile_, "--shard", shard + "/2", "--summary", parts.back()});
    ASSERT_EQ(r.exit_code, 0) << r.output << r.errors;
  }
  const std::string place = folder_ / "merged";
  fs::create_directories(place);
  const std::string all = place + "/all.json", page = place + "/all.html", cases = place + "/all.xml";
  SharedCounts none(folder_ / "counts");
  const auto merge = [&](const std::string& action, std::uint64_t at, const SharedCounts& counts) {
    return texmesh({"summary", "merge", parts[0], parts[1], "-o", all, "--junit", cases, "--html", page},
                   {"LD_PRELOAD=" TEXMESH_FAULT_SHIM, "TEXMESH_FAULT_FILE=" + counts.file(),
                    "TEXMESH_FAULT_UNDER=" + place, "TEXMESH_FAULT_ACTION=" + action,
                    "TEXMESH_FAULT_AT=" + std::to_string(at)});
  };
  ASSERT_EQ(merge("none", 0, none).exit_code, 0);
  const Packages reference = packages_in(place);
  const std::uint64_t calls = (*none).calls;
  ASSERT_GT(calls, 5u);
  int points_done = 0;
  for (const char* action : {"kill", "eio", "full", "frozen"})
    for (std::uint64_t at = 1; at <= calls; ++at) {
      fs::remove_all(place);
      fs::create_directories(place);
      write_text(all, "old");
      SharedCounts counts(folder_ / "counts");
      const CommandResult r = merge(action, at, counts);
      if ((*counts).fired == 0) continue;
      ++points_done, ++all_points_;
      const std::string what = std::string(action) + " at call " + std::to_string(at) + " of a merge";
      const std::string text = read_text(all);
      EXPECT_TRUE(text == "old" || text == reference.at("all.json")) << what << " left a torn summary";
      EXPECT_NE(r.exit_code, 1) << what << ": models are not to blame: " << r.output << r.errors;
      if (r.exit_code == 0)
        EXPECT_EQ(text, reference.at("all.json")) << what << ": success without the summary";
    }
  std::printf("merges: %d points\n", points_done);
  EXPECT_GE(points_done, 20);
}

/// Lustre with localflock, NFS with local_lock: every process gets every lock.
TEST_F(Faults, LocksThatAreGrantedToAllCostNoPackage) {
  constexpr int kModels = 3, kRuns = 3;
  prepare(kModels, "1");
  const Site site(models_, profile_, jobs_);
  const std::string live = site.out() + "/scan_00000.texmesh.tmp-" + owner_mark() + "-0",
                    elsewhere = site.out() + "/scan_00001.texmesh.tmp-node7-0123456789ab-1-0";
  write_text(live, "somebody is writing this");
  write_text(elsewhere, "so is another machine");
  std::vector<std::thread> runs;
  std::vector<CommandResult> results(kRuns);
  for (int i = 0; i < kRuns; ++i)
    runs.emplace_back([&, i] { results[i] = site.build({"LD_PRELOAD=" TEXMESH_GRANT_LOCKS}); });
  for (std::thread& run : runs) run.join();
  for (const CommandResult& r : results) EXPECT_EQ(r.exit_code, 0) << r.output << r.errors;
  EXPECT_EQ(read_text(live), "somebody is writing this");
  EXPECT_EQ(read_text(elsewhere), "so is another machine");
  fs::remove(live);
  fs::remove(elsewhere);
  EXPECT_TRUE(site.packages() == reference_) << "other packages, or something beside them";
  site.expect_sound_cache("locks granted to all");
  expect_next_build_to_be_whole(site, "locks granted to all");
}

}  // namespace texmesh::testing::command_compile_faults_test
