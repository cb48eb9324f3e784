// The cache as several processes and a bad disk treat it.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <set>

#include "pipeline/cache/disk_store.h"
#include "tests/support/small_builds.h"

namespace texmesh::testing::command_cache_test {
namespace fs = std::filesystem;
using Json = nlohmann::json;
using Counts = std::map<std::string, std::size_t>;  // by stage

class SharedCache : public ::testing::Test {
 protected:
  void prepare(int models) {
    write_text(profile(), kCheapProfile);
    ASSERT_NO_FATAL_FAILURE(make_tiny_models(TEXMESH_MAKE_SCAN, models, folder_ / "models"));
  }
  std::string profile() const { return folder_ / "profile.json"; }

  std::vector<std::string> command(const std::string& out, const std::string& cache) const {
    return {TEXMESH_BINARY, "compile",       folder_ / "models", "-o",      folder_ / out,
            "--cache",      folder_ / cache, "--profile",        profile(), "--json"};
  }
  CommandResult compile(const std::string& out, const std::string& cache) const {
    return run_command(command(out, cache));
  }

  /// Keys of a cache, by stage.
  Counts keys_in(const std::string& cache) const {
    Counts keys;
    const std::string records = (fs::path(folder_ / cache) / "ac").string();
    for (const std::string& f : files_beneath(records)) {
      const std::string record = read_text((fs::path(records) / f).string());
      ++keys[Json::parse(record.substr(0, record.rfind('}') + 1))["key"]["stage"]];
    }
    return keys;
  }

  /// Adds the runs that a process has told of. Derived data has no keys: whoever needs it computes it.
  void add_runs(int process, const Counts& keys, Counts& runs) const {
    for (const Json& e : events_of(read_text(folder_ / ("events" + std::to_string(process)))))
      if (e["event"] == "stage-finished" && e["result"] == "ran" && keys.contains(e["stage"]))
        ++runs[e["stage"]];
  }

  TemporaryFolder folder_;
};

std::size_t sum(const Counts& counts) {
  std::size_t all = 0;
  for (const auto& [stage, n] : counts) all += n;
  return all;
}

std::string quoted(const std::vector<std::string>& arguments) {
  std::string text;
  for (const std::string& a : arguments) text += "'" + a + "' ";
  return text;
}

constexpr int kProcesses = 8;

/// Starts the builds side by side, `beside` while they run, and waits; the exit code counts failed builds.
std::string side_by_side(const std::vector<std::string>& builds, const std::string& beside) {
  std::string script = "pids=()\n";
  for (const std::string& b : builds) script += b + " & pids+=($!)\n";
  if (!beside.empty()) script += "( while sleep 0.05; do " + beside + "; done ) & loop=$!\n";
  script += "bad=0; for p in \"${pids[@]}\"; do wait $p || bad=$((bad + 1)); done\n";
  if (!beside.empty()) script += "kill $loop; wait $loop 2>/dev/null\n";
  return script + "exit $bad";
}

TEST_F(SharedCache, EightProcessesComputeEachKeyOnce) {
  ASSERT_NO_FATAL_FAILURE(prepare(full_sweeps() ? 200 : 2));
  ASSERT_EQ(compile("reference", "reference-cache").exit_code, 0);
  const Packages reference = packages_in(folder_ / "reference");
  std::vector<std::string> builds;
  for (int k = 0; k < kProcesses; ++k)
    builds.push_back(quoted(command("out" + std::to_string(k), "cache")) + "--jobs 1 >'" +
                     (folder_ / ("events" + std::to_string(k))) + "'");
  EXPECT_EQ(run_command({"bash", "-c", side_by_side(builds, "")}, {}, "", 3600).exit_code, 0);
  const Counts keys = keys_in("reference-cache");
  Counts runs;
  for (int k = 0; k < kProcesses; ++k) {
    EXPECT_TRUE(packages_in(folder_ / ("out" + std::to_string(k))) == reference) << "process " << k;
    add_runs(k, keys, runs);
  }
  EXPECT_EQ(keys_in("cache"), keys);
  EXPECT_EQ(runs, keys);
  std::printf("%d processes, %zu models: %zu stage runs for %zu keys\n", kProcesses, reference.size(),
              sum(runs), sum(keys));
}

/// Entries are made old behind the builds' backs, even those that they are using, and pruned away.
TEST_F(SharedCache, EightProcessesBesideEvictionGiveNoWrongByte) {
  ASSERT_NO_FATAL_FAILURE(prepare(full_sweeps() ? 200 : 2));
  ASSERT_EQ(compile("reference", "reference-cache").exit_code, 0);
  const Packages reference = packages_in(folder_ / "reference");
  const Counts keys_by_stage = keys_in("reference-cache");
  std::vector<std::string> builds;
  for (int k = 0; k < kProcesses; ++k)
    builds.push_back(quoted(command("out" + std::to_string(k), "cache")) + "--jobs 1 --cache-size 100kB >'" +
                     (folder_ / ("events" + std::to_string(k))) + "'");
  const std::string cache = folder_ / "cache";
  const std::string evict = "find '" + cache + "/ac' '" + cache +
                            "/cas' -type f -print0 2>/dev/null | shuf -z -n 40 | "
                            "xargs -0 -r touch -c -d '1 day ago' 2>/dev/null; '" TEXMESH_BINARY
                            "' cache prune --json --size 1kB --cache '" +
                            cache + "' >>'" + (folder_ / "pruned") + "' 2>/dev/null";
  EXPECT_EQ(run_command({"bash", "-c", side_by_side(builds, evict)}, {}, "", 3600).exit_code, 0);
  Counts runs;
  std::size_t evicted = 0;
  for (int k = 0; k < kProcesses; ++k) {
    EXPECT_TRUE(packages_in(folder_ / ("out" + std::to_string(k))) == reference) << "process " << k;
    for (const Json& e : events_of(read_text(folder_ / ("events" + std::to_string(k)))))
      EXPECT_FALSE(e["event"] == "cache" && e["code"] == "cache-entry-damaged") << e;
    add_runs(k, keys_by_stage, runs);
  }
  const std::size_t keys = sum(keys_by_stage), ran = sum(runs);
  const std::string pruned = read_text(folder_ / "pruned");
  for (std::size_t at = 0; (at = pruned.find("\"removed_records\": ", at)) != std::string::npos; at += 19)
    evicted += std::stoul(pruned.substr(at + 19));
  std::printf("%d processes, %zu models: %zu keys, %zu computed again, %zu records evicted meanwhile\n",
              kProcesses, reference.size(), keys, ran - keys, evicted);
  EXPECT_GE(ran, keys);
  EXPECT_GT(evicted, 0u);
  EXPECT_LE(ran - keys, evicted * kProcesses);  // whoever was about to load an evicted result
  const CommandResult r = run_command({TEXMESH_BINARY, "cache", "verify", "--cache", cache});
  EXPECT_EQ(r.exit_code, 0) << r.output;
}

/// Results of other collections, unused for 30 to 129 days.
void put_old_results(const std::string& cache, int records) {
  {
    const auto store = open_disk_store(cache);
    for (int i = 0; i < records; ++i) {
      const std::string text = "foreign result " + std::to_string(i);
      const auto bytes = std::make_shared<const std::vector<std::uint8_t>>(text.begin(), text.end());
      ASSERT_TRUE(store->put(Key("foreign", 1).add("number", std::to_string(i)), {{"x", bytes}}));
    }
  }
  int days = 0;
  for (const std::string& f : files_beneath((fs::path(cache) / "ac").string()))
    fs::last_write_time(fs::path(cache) / "ac" / f,
                        fs::file_time_type::clock::now() - std::chrono::hours(24 * (30 + days++ % 100)));
  for (const std::string& f : files_beneath((fs::path(cache) / "cas").string()))
    fs::last_write_time(fs::path(cache) / "cas" / f,
                        fs::file_time_type::clock::now() - std::chrono::hours(24 * 30));
}

/// Eviction has enough to do with what nobody uses: it must leave alone what the builds have put.
TEST_F(SharedCache, EightProcessesBesideEvictionOfOldResultsComputeEachKeyOnce) {
  ASSERT_NO_FATAL_FAILURE(prepare(full_sweeps() ? 200 : 2));
  ASSERT_EQ(compile("reference", "reference-cache").exit_code, 0);
  const Packages reference = packages_in(folder_ / "reference");
  const Counts keys = keys_in("reference-cache");
  const std::string cache = folder_ / "cache";
  constexpr int kOld = 1000;
  ASSERT_NO_FATAL_FAILURE(put_old_results(cache, kOld));
  std::vector<std::string> builds;
  for (int k = 0; k < kProcesses; ++k)
    builds.push_back(quoted(command("out" + std::to_string(k), "cache")) + "--jobs 1 >'" +
                     (folder_ / ("events" + std::to_string(k))) + "'");
  // A day more each time: some have to go in every round, while the builds run.
  const std::string evict = "n=$((n + 1)); '" TEXMESH_BINARY
                            "' cache prune --json --size 0 --age $((n < 100 ? 130 - n : 30))d --cache '" +
                            cache + "' >>'" + (folder_ / "pruned") + "' 2>/dev/null";
  EXPECT_EQ(run_command({"bash", "-c", side_by_side(builds, evict)}, {}, "", 3600).exit_code, 0);
  Counts runs;
  for (int k = 0; k < kProcesses; ++k) {
    EXPECT_TRUE(packages_in(folder_ / ("out" + std::to_string(k))) == reference) << "process " << k;
    add_runs(k, keys, runs);
  }
  EXPECT_EQ(runs, keys);
  Counts left = keys_in("cache");
  const std::size_t old_left = left["foreign"];
  left.erase("foreign");
  EXPECT_EQ(left, keys);
  EXPECT_LT(old_left, static_cast<std::size_t>(kOld));
  std::printf("%d processes: %zu stage runs for %zu keys, %zu old results evicted meanwhile\n", kProcesses,
              sum(runs), sum(keys), kOld - old_left);
}

/// Files of the cache that hold something.
std::vector<std::string> contents_of(const std::string& cache) {
  std::vector<std::string> all;
  for (const std::string& f : files_beneath(cache)) {
    const bool holds = f.starts_with("ac/") || f.starts_with("cas/") || f.starts_with("notes/") ||
                       (f.starts_with("memo/") && !f.ends_with(".lock"));
    if (holds && fs::file_size(fs::path(cache) / f) > 0) all.push_back(f);
  }
  return all;
}

void flip_a_bit(const fs::path& file, std::size_t seed) {
  std::string bytes = read_text(file.string());
  const std::size_t bit = (seed * 2654435761u + 12345) % (bytes.size() * 8);
  bytes[bit / 8] = static_cast<char>(bytes[bit / 8] ^ (1 << bit % 8));
  std::ofstream(file, std::ios::binary | std::ios::trunc) << bytes;
}

std::string lines(const std::multiset<std::string>& texts) {
  std::string all;
  for (const std::string& t : texts) all += t + "\n";
  return all;
}

TEST_F(SharedCache, EveryFlippedBitIsFoundReportedAndMadeGood) {
  ASSERT_NO_FATAL_FAILURE(prepare(full_sweeps() ? 26 : 2));
  ASSERT_EQ(compile("out", "cache").exit_code, 0);
  const Packages reference = packages_in(folder_ / "out");
  std::size_t flipped = 0;
  for (const std::vector<std::string>& kinds :
       {std::vector<std::string>{"ac/", "cas/", "notes/", "memo/"}, std::vector<std::string>{"cas/"}}) {
    fs::remove_all(fs::path(folder_ / "cache") / "quarantine");
    std::set<std::string> damaged;
    for (const std::string& f : contents_of(folder_ / "cache"))
      if (std::any_of(kinds.begin(), kinds.end(), [&](const std::string& k) { return f.starts_with(k); })) {
        flip_a_bit(fs::path(folder_ / "cache") / f, damaged.size());
        damaged.insert(f);
      }
    fs::remove_all(folder_ / "out");
    const CommandResult r = compile("out", "cache");
    EXPECT_EQ(r.exit_code, 0) << r.output;
    EXPECT_TRUE(packages_in(folder_ / "out") == reference);
    std::multiset<std::string> told;  // each file once, whoever has read it
    for (const Json& e : events_of(r.output))
      if (e["event"] == "cache" && e["code"] == "cache-entry-damaged") told.insert(e["text"]);
    EXPECT_EQ(told.size(), damaged.size()) << lines(told);
    EXPECT_EQ(std::set<std::string>(told.begin(), told.end()).size(), damaged.size()) << lines(told);
    std::size_t moved = 0;
    for (const std::string& f : damaged)
      moved += fs::exists(fs::path(folder_ / "cache") / "quarantine" / fs::path(f).filename()) ? 1 : 0;
    const std::size_t memos = kinds.size() > 1 ? 1 : 0;  // written anew in its place
    EXPECT_EQ(moved + memos, damaged.size());
    const CommandResult verified =
        run_command({TEXMESH_BINARY, "cache", "verify", "--cache", folder_ / "cache"});
    EXPECT_EQ(verified.exit_code, 0) << verified.output;
    flipped += damaged.size();
  }
  std::printf("%zu files with a flipped bit: all found, reported and made good\n", flipped);
  EXPECT_GE(flipped, full_sweeps() ? 1000u : 50u);
}

}  // namespace texmesh::testing::command_cache_test
