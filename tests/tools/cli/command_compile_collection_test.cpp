// Collections as a user compiles them again and again: what runs after which change, known failures, limits,
// interruption, reports.
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <fstream>
#include <set>
#include <thread>

#include "tests/support/sanitizers.h"
#include "tests/support/schema.h"
#include "tests/support/small_builds.h"

namespace texmesh::testing::command_compile_collection_test {
namespace fs = std::filesystem;
using Json = nlohmann::json;
using Stages = std::set<std::string>;

class Collection : public ::testing::Test {
 protected:
  void SetUp() override { write_text(folder_ / "profile.json", kCheapProfile); }

  /// OBJ with MTL and JPEG, in a folder of models.
  void add_model(const std::string& name, int seed) {
    fs::create_directories(folder_ / "in");
    const CommandResult made =
        run_command({TEXMESH_MAKE_SCAN, "--triangles", "48", "--texture", "32", "--seed",
                     std::to_string(seed), "-o", folder_ / ("in/" + name + ".obj")});
    ASSERT_EQ(made.exit_code, 0) << made.errors;
  }
  void add_three() {
    ASSERT_NO_FATAL_FAILURE(add_model("a", 1));
    ASSERT_NO_FATAL_FAILURE(add_model("b", 2));
    ASSERT_NO_FATAL_FAILURE(add_model("c", 3));
  }

  CommandResult compile(const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{TEXMESH_BINARY,          "compile", folder_ / "in",    "-o",
                                       folder_ / "out",         "--cache", folder_ / "cache", "--profile",
                                       folder_ / "profile.json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_command(arguments);
  }
  std::vector<Json> events(const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = more;
    arguments.push_back("--json");
    return events_of(compile(arguments).output);
  }
  std::string model(const std::string& name) const { return folder_ / ("in/" + name); }

  TemporaryFolder folder_;
};

/// Stages that ran, by model's file name.
std::map<std::string, Stages> ran_in(const std::vector<Json>& events) {
  std::map<std::string, Stages> ran;
  for (const Json& e : events)
    if (e["event"] == "stage-finished" && e["result"] == "ran")
      ran[fs::path(e["model"].get<std::string>()).filename()].insert(e["stage"].get<std::string>());
  return ran;
}

std::map<std::string, std::string> results_in(const std::vector<Json>& events) {
  std::map<std::string, std::string> results;
  for (const Json& e : events)
    if (e["event"] == "model-finished")
      results[fs::path(e["model"].get<std::string>()).filename()] = e["result"];
  return results;
}

// Not "scales": its files hold previews of the textures.
const Stages kGeometryStages{"condition", "skeletonization", "ssf", "simplification", "perceptual_values"};

TEST_F(Collection, AnUnchangedOneRunsNothingAndSaysSoInOneLine) {
  ASSERT_NO_FATAL_FAILURE(add_three());
  ASSERT_EQ(compile().exit_code, 0);
  const auto written = fs::last_write_time(folder_ / "out/a.texmesh");
  const CommandResult again = compile({"--explain"});
  EXPECT_EQ(again.exit_code, 0);
  EXPECT_EQ(again.output, "3 of 3 models are up to date: no input, option or tool has changed\n");
  for (const Json& e : events()) EXPECT_FALSE(e["event"] == "model-started") << e;
  EXPECT_EQ(fs::last_write_time(folder_ / "out/a.texmesh"), written);
  const CommandResult forecast = compile({"--dry-run"});
  EXPECT_EQ(forecast.output,
            "3 of 3 models are up to date: no input, option or tool has changed. Nothing was written.\n");
}

TEST_F(Collection, APackageWithoutItsModelIsToldUntilItIsRemoved) {
  ASSERT_NO_FATAL_FAILURE(add_three());
  ASSERT_EQ(compile().exit_code, 0);
  EXPECT_FALSE(fs::exists(folder_ / "out/.texmesh-stale"));
  fs::remove(folder_ / "in/b.obj");
  const auto told = [](const CommandResult& r) {
    return r.output.find("b.texmesh: no model makes") != std::string::npos;
  };
  EXPECT_TRUE(told(compile({"--dry-run"})));
  EXPECT_FALSE(fs::exists(folder_ / "out/.texmesh-stale")) << "a dry run writes nothing";
  EXPECT_TRUE(told(compile()));
  EXPECT_TRUE(told(compile({"--quiet"}))) << "as long as it is there";
  EXPECT_EQ(read_text(folder_ / "out/.texmesh-stale"), "b.texmesh\n");
  EXPECT_EQ(events().back()["stale"], Json::array({"b.texmesh"}));
  const std::vector<std::string> list{TEXMESH_BINARY, "list", folder_ / "in", "-o", folder_ / "out"};
  EXPECT_TRUE(told(run_command(list)));
  EXPECT_FALSE(told(run_command({TEXMESH_BINARY, "compile", folder_ / "in/a.obj", "-o", folder_ / "out",
                                 "--cache", folder_ / "cache", "--profile", folder_ / "profile.json"})))
      << "a file's siblings are no business of its run";
  EXPECT_TRUE(fs::exists(folder_ / "out/b.texmesh"));
  fs::create_directories(folder_ / "out/site/packages");
  for (const char* file : {"out/site/.texmesh-files", "out/site/packages/x.texmesh"})
    write_text(folder_ / file, "");
  const CommandResult removed = compile({"--remove-stale"});
  EXPECT_TRUE(fs::exists(folder_ / "out/site/packages/x.texmesh")) << "a site's packages are its own";
  EXPECT_NE(removed.output.find("b.texmesh: removed"), std::string::npos) << removed.output;
  EXPECT_FALSE(fs::exists(folder_ / "out/b.texmesh"));
  EXPECT_TRUE(fs::exists(folder_ / "out/a.texmesh"));
  EXPECT_FALSE(fs::exists(folder_ / "out/.texmesh-stale"));
  EXPECT_FALSE(told(compile()));
}

TEST_F(Collection, AnotherTextureRunsThatModelsTextureStagesOnly) {
  ASSERT_NO_FATAL_FAILURE(add_three());
  ASSERT_EQ(compile().exit_code, 0);
  const Packages before = packages_in(folder_ / "out");
  fs::copy_file(model("c.jpg"), model("b.jpg"), fs::copy_options::overwrite_existing);
  const CommandResult forecast = compile({"--dry-run"});
  EXPECT_NE(forecast.output.find("1 would run, 2 up to date"), std::string::npos) << forecast.output;
  const auto ran = ran_in(events());
  ASSERT_EQ(ran.size(), 1u);
  const Stages& of_b = ran.at("b.obj");
  for (const std::string& stage : kGeometryStages) EXPECT_FALSE(of_b.contains(stage)) << stage;
  for (const char* stage : {"import", "zim", "ladder", "package"}) EXPECT_TRUE(of_b.contains(stage)) << stage;
  Packages after = packages_in(folder_ / "out");
  EXPECT_NE(after.at("b.texmesh"), before.at("b.texmesh"));
  after["b.texmesh"] = before.at("b.texmesh");
  EXPECT_EQ(after, before);
  EXPECT_TRUE(ran_in(events()).empty());
}

TEST_F(Collection, AnotherOptionRunsItsStageAndWhatSeesOtherBytes) {
  ASSERT_NO_FATAL_FAILURE(add_model("a", 1));
  ASSERT_EQ(compile().exit_code, 0);
  // Other JPEG qualities: not the geometry, not the zeta maps.
  const auto ran = ran_in(events({"--rungs", "50"}));
  ASSERT_EQ(ran.size(), 1u);
  EXPECT_TRUE(ran.at("a.obj").contains("ladder"));
  EXPECT_TRUE(ran.at("a.obj").contains("package"));
  for (const std::string& stage : kGeometryStages) EXPECT_FALSE(ran.at("a.obj").contains(stage)) << stage;
  EXPECT_FALSE(ran.at("a.obj").contains("zim"));
  EXPECT_FALSE(ran.at("a.obj").contains("import"));
  // Nothing but the title.
  EXPECT_EQ(ran_in(events({"--rungs", "50", "--title", "Coin"})),
            (std::map<std::string, Stages>{{"a.obj", {"package"}}}));
  const CommandResult explained = compile({"--rungs", "50", "--title", "Vase", "--explain"});
  EXPECT_EQ(explained.errors.find("--title"), std::string::npos) << "one model: " << explained.errors;
  EXPECT_NE(explained.output.find("runs: package.title \"Coin\" -> \"Vase\""), std::string::npos)
      << explained.output;
  EXPECT_EQ(explained.output.find("runs: "), explained.output.rfind("runs: ")) << explained.output;
}

TEST_F(Collection, AKnownFailureIsRememberedUntilItsFileChanges) {
  ASSERT_NO_FATAL_FAILURE(add_model("a", 1));
  write_text(model("bad.obj"), "f 1 2 3\n");
  EXPECT_EQ(compile().exit_code, 1);
  const auto again = events();
  EXPECT_EQ(results_in(again),
            (std::map<std::string, std::string>{{"a.obj", "unchanged"}, {"bad.obj", "failed"}}));
  for (const Json& e : again) EXPECT_NE(e["event"], "model-started");
  const CommandResult plain = compile();
  EXPECT_EQ(plain.exit_code, 1);
  EXPECT_NE(plain.output.find("--retry-failed tries again"), std::string::npos) << plain.output;
  const auto retried = events({"--retry-failed"});
  EXPECT_EQ(std::count_if(retried.begin(), retried.end(),
                          [](const Json& e) { return e["event"] == "model-started"; }),
            1);
  EXPECT_EQ(results_in(retried)["bad.obj"], "failed");
  fs::copy_file(model("a.obj"), model("bad.obj"), fs::copy_options::overwrite_existing);
  EXPECT_EQ(compile().exit_code, 0);
  EXPECT_TRUE(fs::exists(folder_ / "out/bad.texmesh"));
}

TEST_F(Collection, AFailureOfAFileOfAnotherNameIsNotRemembered) {
  ASSERT_NO_FATAL_FAILURE(add_model("a", 1));
  const auto compile_file = [&](const std::string& file) {
    return run_command({TEXMESH_BINARY, "compile", model(file), "-o", folder_ / "out.texmesh", "--cache",
                        folder_ / "cache", "--profile", folder_ / "profile.json"});
  };
  fs::rename(model("a.obj"), model("a.txt"));
  const CommandResult wrong = compile_file("a.txt");
  EXPECT_EQ(wrong.exit_code, 1);
  EXPECT_NE(wrong.output.find("a.txt"), std::string::npos) << wrong.output;
  fs::rename(model("a.txt"), model("a.obj"));
  const CommandResult right = compile_file("a.obj");
  EXPECT_EQ(right.exit_code, 0) << right.output;
  EXPECT_EQ(right.output.find("a.txt"), std::string::npos) << right.output;
  // And the other way round: what was read as one kind is not up to date as another.
  fs::rename(model("a.obj"), model("a.txt"));
  EXPECT_EQ(compile_file("a.txt").exit_code, 1);
}

TEST_F(Collection, AWarningIsToldAsLongAsItHolds) {
  ASSERT_NO_FATAL_FAILURE(add_three());
  fs::rename(model("b.jpg"), folder_ / "b.jpg");
  const std::vector<std::string> reports{"--summary", folder_ / "s.json", "--junit", folder_ / "j.xml"};
  const auto warned = [&](const CommandResult& r) {
    return r.output.find("b.obj: warning") != std::string::npos &&
           r.output.find("b.jpg") != std::string::npos &&
           r.output.find("; 1 with warnings") != std::string::npos;
  };
  for (int run = 0; run < 3; ++run) {
    const CommandResult r = compile(reports);
    EXPECT_TRUE(warned(r)) << run << r.output;
    std::vector<std::string> told;
    const Json summary = Json::parse(read_text(folder_ / "s.json"));
    for (const Json& m : summary["models"])
      for (const Json& n : m.value("warnings", Json::array()))
        if (n["severity"] == "warning") told.push_back(m["package"]);
    EXPECT_EQ(told, std::vector<std::string>{"b.texmesh"}) << run;
    const std::string junit = read_text(folder_ / "j.xml");
    EXPECT_NE(junit.find("<system-out>missing-texture"), std::string::npos) << junit;
    EXPECT_EQ(junit.find("<system-out>"), junit.rfind("<system-out>"));
  }
  EXPECT_NE(compile({"--quiet"}).output.find("b.obj: warning"), std::string::npos);
  const auto again = events();
  EXPECT_EQ(std::ranges::count_if(again, [](const Json& e) { return e["event"] == "note"; }), 1);
  EXPECT_EQ(again.back()["warned"], 1);
  fs::rename(folder_ / "b.jpg", model("b.jpg"));
  EXPECT_EQ(compile().output.find("warning"), std::string::npos);
  EXPECT_EQ(compile().output.find("warning"), std::string::npos);
}

TEST_F(Collection, ADryRunSaysFirstHowManyAndThenALineAModel) {
  ASSERT_NO_FATAL_FAILURE(add_three());
  const auto lines = [](const std::string& text) { return std::ranges::count(text, '\n'); };
  const CommandResult fresh = compile({"--dry-run"});
  EXPECT_TRUE(fresh.output.starts_with("3 would run, 0 up to date. Nothing was written.\n")) << fresh.output;
  EXPECT_EQ(lines(fresh.output), 4) << fresh.output;
  EXPECT_GT(lines(compile({"--dry-run", "--explain"}).output), 40) << "each stage";
  ASSERT_EQ(compile().exit_code, 0);
  fs::remove(folder_ / "out/b.texmesh");
  const CommandResult again = compile({"--dry-run"});
  EXPECT_NE(again.output.find("b.obj: every stage from the cache\n"), std::string::npos) << again.output;
  const CommandResult title = compile({"--dry-run", "--title", "Coin"});
  EXPECT_NE(title.errors.find("--title: all 3 packages have this title"), std::string::npos) << title.errors;
  EXPECT_NE(title.output.find("a.obj: package runs: package.title \"\" -> \"Coin\""), std::string::npos)
      << title.output;
}

TEST_F(Collection, ADryRunCountsWhatFailedBefore) {
  ASSERT_NO_FATAL_FAILURE(add_model("a", 1));
  write_text(model("bad.obj"), "f 1 2 3\n");
  ASSERT_EQ(compile().exit_code, 1);
  const auto says = [&](const char* counts, std::vector<std::string> more = {}) {
    more.emplace_back("--dry-run");
    const CommandResult r = compile(more);
    EXPECT_NE(r.output.find(std::string(counts) + ". Nothing was written.\n"), std::string::npos) << r.output;
  };
  says("0 would run, 1 up to date, 1 failed before");
  says("1 would run, 1 up to date", {"--retry-failed"});
  ASSERT_NO_FATAL_FAILURE(add_model("b", 2));
  says("1 would run, 1 up to date, 1 failed before");
}

TEST_F(Collection, AnErrorOfTheMachineIsNotRemembered) {
  ASSERT_NO_FATAL_FAILURE(add_model("a", 1));
  fs::create_directories(folder_ / "out/a.texmesh/in the way");  // the package cannot take this name
  const CommandResult failed = compile();
  EXPECT_EQ(failed.exit_code, 1) << failed.output;
  EXPECT_NE(failed.output.find("out/a.texmesh: cannot be written: rename: "), std::string::npos)
      << failed.output;
  fs::remove_all(folder_ / "out/a.texmesh");
  const CommandResult r = compile();
  EXPECT_EQ(r.exit_code, 0) << r.output;
}

TEST_F(Collection, FailFastStartsNothingAfterAFailureAndTheNextRunDoesTheRest) {
  ASSERT_NO_FATAL_FAILURE(add_three());
  write_text(model("bad.obj"), "f 1 2 3\n" + std::string(4'000'000, '#'));  // the largest one starts first
  const auto stopped = results_in(events({"--fail-fast", "--jobs", "1"}));
  EXPECT_EQ(stopped.at("bad.obj"), "failed");
  EXPECT_EQ(packages_in(folder_ / "out").size(), 0u);
  const CommandResult kept_going = compile({"--keep-going", "--jobs", "1"});
  EXPECT_EQ(kept_going.exit_code, 1);
  EXPECT_NE(kept_going.output.find("3 compiled, 0 up to date, 1 failed"), std::string::npos)
      << kept_going.output;
}

TEST_F(Collection, FailFastStopsAtARememberedFailureToo) {
  ASSERT_NO_FATAL_FAILURE(add_three());
  write_text(model("bad.obj"), "f 1 2 3\n");
  EXPECT_EQ(compile({"--jobs", "1"}).exit_code, 1);
  for (const char* name : {"a", "b", "c"}) fs::remove(folder_ / ("out/" + std::string(name) + ".texmesh"));
  EXPECT_EQ(compile({"--fail-fast"}).exit_code, 1);
  EXPECT_EQ(packages_in(folder_ / "out").size(), 0u);
}

TEST_F(Collection, AFailureKeepsWhatWasLearnedOfTheModel) {
  ASSERT_NO_FATAL_FAILURE(add_model("a", 1));
  ASSERT_EQ(compile().exit_code, 0);
  const std::string good = read_text(model("a.obj"));
  write_text(model("a.obj"), "f 1 2 3\n");
  ASSERT_EQ(compile().exit_code, 1);
  write_text(model("a.obj"), "# another\n" + good);
  const CommandResult r = compile({"--explain"});
  EXPECT_EQ(r.exit_code, 0) << r.output;
  EXPECT_EQ(r.output.find("no earlier run"), std::string::npos) << r.output;
}

TEST_F(Collection, NamesThatAreNoUtf8AreNamesAsOthers) {
  ASSERT_NO_FATAL_FAILURE(add_model("a", 1));
  std::string obj = read_text(model("a.obj")), mtl = read_text(model("a.mtl"));
  const std::string image =
      mtl.substr(mtl.find("map_Kd ") + 7, mtl.find('\n', mtl.find("map_Kd ")) - mtl.find("map_Kd ") - 7);
  mtl.replace(mtl.find(image), image.size(), "L\xf6we.jpg");
  obj.replace(obj.find("a.mtl"), 5, "b.mtl");
  fs::copy_file(model(image), model("L\xf6we.jpg"));
  write_text(model("b.mtl"), mtl);
  write_text(model("\xff.obj"), obj);
  const CommandResult first = compile();
  EXPECT_EQ(first.exit_code, 0) << first.output << first.errors;
  EXPECT_EQ(packages_in(folder_ / "out").size(), 2u);
  EXPECT_TRUE(compile({"--explain"})
                  .output.ends_with("2 of 2 models are up to date: no input, option or tool has changed\n"));
  write_text(model("L\xf6we.jpg"), read_text(model("L\xf6we.jpg")) + "more");
  const auto again = events();
  EXPECT_EQ(
      std::count_if(again.begin(), again.end(), [](const Json& e) { return e["event"] == "model-started"; }),
      1);
  EXPECT_EQ(compile({"--package.title", "\xff"}).exit_code, 2);
}

TEST_F(Collection, ReportsGoIntoDevicesAndOneThatCannotBeWrittenIsUsage) {
  ASSERT_NO_FATAL_FAILURE(add_model("a", 1));
  EXPECT_EQ(compile({"--summary", folder_ / "none/s.json"}).exit_code, 2);
  EXPECT_FALSE(fs::exists(folder_ / "out/a.texmesh"));
  const CommandResult r = compile({"--summary", "/dev/null", "--depfile", "/dev/null"});
  EXPECT_EQ(r.exit_code, 0) << r.output << r.errors;
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
  write_text(folder_ / "in/a;b.obj", read_text(model("a.obj")));
  EXPECT_EQ(run_command({TEXMESH_BINARY, "compile", folder_ / "in/a;b.obj", "-o", folder_ / "q.texmesh",
                         "--depfile", folder_ / "d"})
                .exit_code,
            2);
}

TEST_F(Collection, AFolderThatCannotBeWrittenIsToldBeforeTheWork) {
  if (::geteuid() == 0) GTEST_SKIP() << "root writes everywhere";
  ASSERT_NO_FATAL_FAILURE(add_model("a", 1));
  const std::string out = folder_ / "out";
  fs::create_directories(out);
  ::chmod(out.c_str(), 0500);
  const CommandResult early = compile({"--verbose"});
  EXPECT_EQ(early.output.find("simplification"), std::string::npos) << early.output;
  EXPECT_NE(early.errors.find("out/a.texmesh: "), std::string::npos) << early.errors;
  EXPECT_NE(early.exit_code, 0);
  ::chmod(out.c_str(), 0700);
  ASSERT_EQ(compile().exit_code, 0);
  ::chmod(out.c_str(), 0500);
  fs::remove_all(folder_ / "cache");
  EXPECT_EQ(compile().exit_code, 0) << "what is up to date needs no folder that can be written";
  ::chmod(out.c_str(), 0700);
}

TEST_F(Collection, ShardsTogetherMakeEveryPackageOnce) {
  ASSERT_NO_FATAL_FAILURE(add_three());
  std::multiset<std::string> made;
  for (const char* shard : {"0/3", "1/3", "2/3"}) {
    const auto told = events({"--shard", shard});
    for (const auto& [name, result] : results_in(told)) {
      EXPECT_EQ(result, "ok") << Json(told).dump();
      made.insert(name);
    }
  }
  EXPECT_EQ(made, (std::multiset<std::string>{"a.obj", "b.obj", "c.obj"}));
  for (const char* wrong : {"3/3", "-1/3", "1", "1/0", "x/3", "1/3x"})
    EXPECT_EQ(compile({"--shard", wrong}).exit_code, 2) << wrong;
  const CommandResult lost = compile({"--shard", "auto"});
  EXPECT_EQ(lost.exit_code, 2);
  EXPECT_NE(lost.errors.find("none of them set"), std::string::npos) << lost.errors;
}

TEST_F(Collection, AFileChangedWithItsTimePutBackIsSeen) {
  ASSERT_NO_FATAL_FAILURE(add_model("a", 1));
  ASSERT_NO_FATAL_FAILURE(add_model("b", 2));
  ASSERT_EQ(compile().exit_code, 0);
  const auto time = fs::last_write_time(model("a.jpg"));
  std::string jpeg = read_text(model("a.jpg"));
  const std::string other = read_text(model("b.jpg"));
  write_text(model("a.jpg"), other);
  fs::last_write_time(model("a.jpg"), time);
  EXPECT_EQ(ran_in(events()).size(), 1u);
  write_text(model("a.jpg"), jpeg);
  fs::last_write_time(model("a.jpg"), time);
  EXPECT_EQ(results_in(events())["a.obj"], "ok");
}

TEST_F(Collection, ReportsAndEventsOfARealRunFollowTheirSchemas) {
  ASSERT_NO_FATAL_FAILURE(add_three());
  write_text(model("bad.obj"), "f 1 2 3\n");
  const CommandResult r = compile({"--json", "--explain", "--jobs", "2", "--summary", folder_ / "s.json",
                                   "--junit", folder_ / "j.xml", "--trace", folder_ / "t.json"});
  EXPECT_EQ(r.exit_code, 1);
  for (const Json& e : events_of(r.output)) EXPECT_TRUE(testing::follows_schema(e, "event.v1"));
  const Json summary = Json::parse(read_text(folder_ / "s.json"));
  EXPECT_TRUE(testing::follows_schema(summary, "summary.v1"));
  EXPECT_EQ(summary["compiled"], 3);
  EXPECT_EQ(summary["failed"], 1);
  for (const Json& m : summary["models"])
    if (m["result"] == "ok") {
      EXPECT_EQ(m["bytes"], fs::file_size(m["output"].get<std::string>()));
      EXPECT_GT(m["peak_memory_bytes"], 1'000'000);
    }
  EXPECT_NE(read_text(folder_ / "j.xml").find("tests=\"4\" failures=\"1\""), std::string::npos);
  std::set<int> lanes, named;
  const Json trace = Json::parse(read_text(folder_ / "t.json"));
  for (const Json& e : trace["traceEvents"])
    if (e["ph"] == "X")
      lanes.insert(e["pid"].get<int>());
    else if (e["name"] == "process_name")
      named.insert(e["pid"].get<int>());
  EXPECT_EQ(lanes, named);
  EXPECT_EQ(lanes, (std::set<int>{0, 1}));
}

/// Interrupts a run of two models that are quick and one that is not, while it is at the latter.
void interrupt(const std::string& folder, const std::string& profile, const std::string& signal,
               bool whole_group) {
  // The build is a process group of its own, as in a terminal.
  const std::string script =
      "set -m; '" TEXMESH_BINARY "' compile '" + folder + "/in' -o '" + folder + "/out' --cache '" + folder +
      "/cache' --profile '" + profile + "' --jobs 2 >'" + folder +
      "/log' 2>&1 & p=$!; for ((i = 0; i < 2400; ++i)); do [[ -e '" + folder + "/out/a.texmesh' && -e '" +
      folder + "/out/b.texmesh' ]] && break; sleep 0.05; done; sleep 0.3; s=$(date +%s%N); kill -" + signal +
      " " + (whole_group ? "-- -$p" : "$p") +
      "; wait $p; c=$?; e=$(date +%s%N); left=$(pgrep -c -g $p); "
      "echo \"took $(((e - s) / 1000000)) left $left\"; exit $c";
  const CommandResult r = run_command({"bash", "-c", script});
  EXPECT_EQ(r.exit_code, 75) << r.output << r.errors << read_text(folder + "/log");
  int took = -1, left = -1;
  ASSERT_EQ(std::sscanf(r.output.c_str(), "took %d left %d", &took, &left), 2) << r.output;
  EXPECT_LT(took, testing::sanitizers_take(2500)) << "two seconds, and some for a busy machine";
  EXPECT_EQ(left, 0);
  EXPECT_NE(read_text(folder + "/log").find("1 cancelled"), std::string::npos) << read_text(folder + "/log");
}

TEST_F(Collection, AnInterruptedRunLeavesNothingAndTheNextOneContinues) {
  const CommandResult made =
      run_command({TEXMESH_MAKE_SCAN, "--triangles", "400000", "--texture", "0", "-o", folder_ / "slow.ply"});
  ASSERT_EQ(made.exit_code, 0);
  for (const bool keyboard : {true, false}) {
    fs::remove_all(folder_ / "out");
    fs::remove_all(folder_ / "cache");  // else the slow model resumes and may end before the signal
    ASSERT_NO_FATAL_FAILURE(add_model("a", keyboard ? 1 : 3));
    ASSERT_NO_FATAL_FAILURE(add_model("b", keyboard ? 2 : 4));
    fs::rename(folder_ / "slow.ply", model("slow.ply"));
    ASSERT_NO_FATAL_FAILURE(
        interrupt(folder_.path().string(), folder_ / "profile.json", keyboard ? "INT" : "TERM", keyboard));
    EXPECT_EQ(packages_in(folder_ / "out").size(), 2u);  // and no temporary file
    const CommandResult stat =
        run_command({TEXMESH_BINARY, "cache", "stat", "--json", "--cache", folder_ / "cache"});
    EXPECT_EQ(Json::parse(stat.output)["running_builds"], 0);
    fs::rename(model("slow.ply"), folder_ / "slow.ply");
    EXPECT_EQ(results_in(events()),
              (std::map<std::string, std::string>{{"a.obj", "unchanged"}, {"b.obj", "unchanged"}}));
    EXPECT_TRUE(ran_in(events()).empty());
  }
}

}  // namespace texmesh::testing::command_compile_collection_test
