// What a build does when the cache folder or the layers behind it are not what they should be.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <functional>

#include "format/base/sha256.h"
#include "pipeline/cache/cache_files.h"
#include "tests/support/small_builds.h"

namespace texmesh::testing::command_cache_layers_test {
namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

class BadCache : public ::testing::Test {
 protected:
  void prepare(int models) {
    write_text(folder_ / "profile.json", kCheapProfile);
    ASSERT_NO_FATAL_FAILURE(make_tiny_models(TEXMESH_MAKE_SCAN, models, folder_ / "models"));
  }

  std::vector<std::string> command(const std::string& out, const std::string& cache,
                                   const std::vector<std::string>& more = {}) const {
    std::vector<std::string> all{
        TEXMESH_BINARY,  "compile",   folder_ / "models",       "-o",     folder_ / out, "--cache",
        folder_ / cache, "--profile", folder_ / "profile.json", "--json", "--jobs",      "1"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
  CommandResult compile(const std::string& out, const std::string& cache,
                        const std::vector<std::string>& more = {}) const {
    return run_command(command(out, cache, more));
  }

  /// Replaces the records of a cache by ones that are sealed as they must be and say something else.
  void lie(const std::string& cache, const std::function<void(Json&)>& change) const {
    const fs::path records = fs::path(folder_ / cache) / "ac";
    for (const std::string& f : files_beneath(records.string())) {
      const std::string text = read_text((records / f).string());
      Json record = Json::parse(text.substr(0, text.rfind('}') + 1));
      change(record);
      write_text((records / f).string(), seal(record.dump(1)));
    }
  }

  TemporaryFolder folder_;
};

std::size_t count_events(const std::string& output, const std::string& code) {
  const auto events = events_of(output);
  return static_cast<std::size_t>(std::count_if(events.begin(), events.end(), [&](const auto& e) {
    return e["event"] == "cache" && e["code"] == code;
  }));
}

TEST_F(BadCache, ALayerThatLiesCostsWarningsNeverTheBuild) {
  ASSERT_NO_FATAL_FAILURE(prepare(1));
  ASSERT_EQ(compile("reference", "shared").exit_code, 0);
  const Packages reference = packages_in(folder_ / "reference");
  const std::string garbage = "garbage bytes that are no artefact at all";
  const Sha256 digest =
      sha256(std::span(reinterpret_cast<const std::uint8_t*>(garbage.data()), garbage.size()));
  const auto to_garbage = [&](Json& output) {
    output["sha256"] = to_hex(digest);
    output["bytes"] = garbage.size();
  };
  const std::vector<std::pair<std::string, std::function<void(Json&)>>> lies{
      {"version", [](Json& r) { r["version"] = "2"; }},
      {"bytes",
       [](Json& r) {
         for (Json& o : r["outputs"]) o["bytes"] = "many";
       }},
      {"everything",
       [&](Json& r) {
         for (Json& o : r["outputs"]) to_garbage(o);
       }},
      {"results", [&](Json& r) { to_garbage(r["outputs"][0]); }},
      {"one",
       [&](Json& r) {
         if (r["key"]["stage"] == "condition") to_garbage(r["outputs"][0]);
       }},
  };
  for (const auto& [name, change] : lies) {
    const std::string layer = "layer-" + name, cache = "cache-" + name, out = "out-" + name;
    fs::copy(folder_ / "shared", folder_ / layer, fs::copy_options::recursive);
    const fs::path blob = fs::path(folder_ / layer) / object_path("cas", digest);
    fs::create_directories(blob.parent_path());
    write_text(blob.string(), garbage);
    lie(layer, change);
    const CommandResult r = compile(out, cache, {"--cache-layer", folder_ / layer});
    EXPECT_EQ(r.exit_code, 0) << name << "\n" << r.output;
    EXPECT_GE(count_events(r.output, "cache-entry-damaged"), 1u) << name;
    EXPECT_TRUE(packages_in(folder_ / out) == reference) << name;
    // Nothing of it is left in the local cache.
    fs::remove_all(folder_ / out);
    const CommandResult again = compile(out, cache);
    EXPECT_EQ(again.exit_code, 0) << name;
    EXPECT_EQ(count_events(again.output, "cache-entry-damaged"), 0u) << name;
    EXPECT_TRUE(packages_in(folder_ / out) == reference) << name;
  }
}

TEST_F(BadCache, ARunThatOnlyLooksWritesNothing) {
  ASSERT_NO_FATAL_FAILURE(prepare(1));
  ASSERT_EQ(compile("reference", "shared").exit_code, 0);
  const CommandResult r = compile("out", "cache", {"--dry-run", "--cache-layer", folder_ / "shared"});
  EXPECT_EQ(r.exit_code, 0) << r.output;
  std::size_t hits = 0;
  for (const auto& e : events_of(r.output)) hits += e["event"] == "stage-explained" && e["verdict"] == "hit";
  EXPECT_GT(hits, 5u);
  EXPECT_FALSE(fs::exists(folder_ / "cache"));
  EXPECT_FALSE(fs::exists(folder_ / "out"));
}

TEST_F(BadCache, AFolderThatCannotBeMadeCostsOneWarning) {
  ASSERT_NO_FATAL_FAILURE(prepare(2));
  write_text(folder_ / "file", "not a folder");
  const CommandResult r = compile("out", "file/cache");
  EXPECT_EQ(r.exit_code, 0) << r.output;
  EXPECT_EQ(count_events(r.output, "cache-not-written"), 1u) << r.output;
  EXPECT_EQ(packages_in(folder_ / "out").size(), 2u);
}

/// Takes connections and never says a word.
class SilentServer {
 public:
  SilentServer() : fd_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    ok = ::bind(fd_, reinterpret_cast<sockaddr*>(&address), size) == 0 && ::listen(fd_, 16) == 0 &&
         ::getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &size) == 0;
    url = "http://127.0.0.1:" + std::to_string(ntohs(address.sin_port));
  }
  ~SilentServer() { ::close(fd_); }
  SilentServer(const SilentServer&) = delete;
  SilentServer& operator=(const SilentServer&) = delete;

  bool ok = false;
  std::string url;

 private:
  int fd_;
};

TEST_F(BadCache, ASilentServerIsWaitedForOnceInABuild) {
  ASSERT_NO_FATAL_FAILURE(prepare(3));
  const SilentServer server;
  ASSERT_TRUE(server.ok);
  const CommandResult r = compile("out", "cache", {"--cache-layer", server.url, "--timeout", "20"});
  EXPECT_EQ(r.exit_code, 0) << r.output;
  EXPECT_EQ(count_events(r.output, "cache-layer-unreachable"), 1u) << r.output;
  EXPECT_EQ(r.output.find("layer-left-out"), std::string::npos);  // between parent and child
  EXPECT_EQ(packages_in(folder_ / "out").size(), 3u);
}

TEST_F(BadCache, ACancelledBuildDoesNotStayToPrune) {
  ASSERT_NO_FATAL_FAILURE(prepare(2));
  std::string text;
  for (const std::string& a : command("out", "cache")) text += "'" + a + "' ";
  const std::string events = folder_ / "events";
  const CommandResult r =
      run_command({"bash", "-c",
                   text + "> '" + events + "' & p=$!; until grep -q '\"ran\"' '" + events +
                       "'; do sleep 0.02; kill -0 $p || exit 99; done; kill -TERM $p; wait $p; exit 0"});
  ASSERT_EQ(r.exit_code, 0) << r.errors;
  EXPECT_LT(packages_in(folder_ / "out").size(), 2u);
  EXPECT_FALSE(fs::exists(fs::path(folder_ / "cache") / "pruned"));
}

}  // namespace texmesh::testing::command_cache_layers_test
