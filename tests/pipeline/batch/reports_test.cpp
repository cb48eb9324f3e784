// What a run tells people and programs: reports against their schemas, progress lines, events.
#include "pipeline/batch/run.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <thread>

#include "pipeline/batch/progress.h"
#include "tests/support/schema.h"

namespace texmesh::reports_test {
using Json = nlohmann::json;

struct FakeRun {
  std::vector<PlannedModel> models;
  std::vector<WorkerReport> reports;

  WorkerReport& add(const std::string& name, ModelResult result, int lane = 0, double start_s = 0,
                    double seconds = 0) {
    models.push_back({name, "out/" + name + ".texmesh", false, false, nullptr});
    WorkerReport r;
    r.result = result;
    r.ran = result != ModelResult::kCancelled;
    r.lane = lane;
    r.start_s = start_s;
    r.seconds = seconds;
    reports.push_back(r);
    return reports.back();
  }
};

TEST(Trace, HasOneProcessPerLaneAndNothingOverlapsInAThread) {
  FakeRun run;
  run.add("one", ModelResult::kOk, 0, 0, 3).more->spans = {
      {"import", 0, 1, false}, {"zim", 1, 2.5, false}, {"ssf", 1, 2, false}, {"lut", 2, 3, true}};
  run.add("two", ModelResult::kOk, 1, 0.5, 1).more->spans = {{"import", 0.5, 1.5, false}};
  run.add("three", ModelResult::kFailed, 1, 1.5, 1);
  run.add("recalled", ModelResult::kUnchanged).ran = false;
  const Json trace = Json::parse(write_trace(run.models, run.reports));
  std::map<std::pair<int, int>, std::vector<std::pair<double, double>>> spans;
  std::map<int, std::string> lanes;
  std::set<std::string> names;
  for (const Json& e : trace["traceEvents"]) {
    if (e["ph"] == "X") {
      spans[{e["pid"], e["tid"]}].push_back({e["ts"], e["ts"].get<double>() + e["dur"].get<double>()});
      names.insert(e["name"]);
      EXPECT_GT(e["dur"], 0);
    } else {
      EXPECT_EQ(e["ph"], "M");
      if (e["name"] == "process_name") EXPECT_TRUE(lanes.emplace(e["pid"], e["args"]["name"]).second);
    }
  }
  EXPECT_EQ(lanes, (std::map<int, std::string>{{0, "worker 0"}, {1, "worker 1"}}));
  EXPECT_TRUE(names.contains("three"));
  EXPECT_FALSE(names.contains("recalled"));
  for (auto& [thread, list] : spans) {
    EXPECT_TRUE(lanes.contains(thread.first));
    std::sort(list.begin(), list.end());
    for (std::size_t i = 1; i < list.size(); ++i) EXPECT_LE(list[i - 1].second, list[i].first);
  }
}

TEST(Trace, ALaneWhoseModelsRanNoStageIsNamedToo) {
  FakeRun run;
  run.add("broken", ModelResult::kFailed, 3, 0, 1);
  bool named = false;
  const Json trace = Json::parse(write_trace(run.models, run.reports));
  for (const Json& e : trace["traceEvents"]) named = named || (e["name"] == "process_name" && e["pid"] == 3);
  EXPECT_TRUE(named);
}

/// An event line of a child, which does not know what the run calls its model.
WorkerEvent told_by_child(const std::string& line) {
  Json event = Json::parse(line);
  event["model"] = "";
  return read_event(event.dump()).value();
}

/// One model that is compiled, one that fails, one that is known to be up to date.
std::string told(OutputMode mode, bool verbose, bool explain) {
  std::ostringstream out;
  Progress progress(out, mode, verbose, explain);
  progress.begin({{"a.obj", 2}, {"b.obj", 1}, {"c.obj", 0}});
  WorkerReport a, b, c;
  a.result = ModelResult::kOk;
  a.ran = b.ran = true;
  a.stages_ran = 1;
  b.result = ModelResult::kFailed;
  b.more->error = {"input", "", "", "", "", "b.obj: no faces"};
  c.result = ModelResult::kUnchanged;
  progress.recalled(2, c, "c.texmesh");
  progress.started(0, "a.texmesh");
  progress.event(0, told_by_child(R"({"event":"stage-explained","stage":"zim","verdict":"runs","history":true,
                        "changes":[{"part":"option zim.difference","from":"24","to":"30"}]})"));
  progress.event(0, told_by_child(R"({"event":"stage-started","stage":"zim"})"));
  progress.event(0, told_by_child(R"({"event":"stage-progress","stage":"zim","fraction":0.5})"));
  progress.event(0,
                 told_by_child(R"({"event":"stage-finished","stage":"zim","result":"ran","seconds":0.25})"));
  progress.event(
      0, told_by_child(
             R"({"event":"note","severity":"info","code":"fine","place":"","text":"nothing to see"})"));
  progress.event(
      0, told_by_child(
             R"({"event":"note","severity":"warning","code":"odd","place":"mesh","text":"look at this"})"));
  for (int twice = 0; twice < 2; ++twice)
    progress.event(0, told_by_child(R"({"event":"cache","code":"cache-entry-damaged","text":"moved away"})"));
  progress.finished(0, a, "a.texmesh");
  progress.started(1, "b.texmesh");
  progress.event(
      1, told_by_child(R"({"event":"error","kind":"input","file":"b.obj","place":"","expected":"faces",
                        "found":"none","message":"b.obj: no faces"})"));
  progress.finished(1, b, "b.texmesh");
  progress.summary({a, b, c}, 1.5, {}, false);
  return out.str();
}

TEST(Progress, ErrorsNameTheModelWithItsFolder) {
  std::ostringstream out;
  Progress progress(out, OutputMode::kPlain, false, false);
  progress.begin({{"in/b.obj", 1}});
  progress.started(0, "b.texmesh");
  for (const char* message : {"b.obj: no faces", "b.objx: no", "other.mtl: no line"})
    progress.event(0, told_by_child(Json{
                          {"event", "error"},
                          {"kind", "input"},
                          {"file", ""},
                          {"place", ""},
                          {"expected", ""},
                          {"found", ""},
                          {"message",
                           message}}.dump()));
  EXPECT_EQ(out.str(),
            "error: in/b.obj: no faces\nerror: in/b.obj: b.objx: no\nerror: in/b.obj: other.mtl: no line\n");
}

TEST(Progress, PlainLinesAreLinesWithoutControlCharacters) {
  const std::string text = told(OutputMode::kPlain, false, false);
  for (const char ch : text) EXPECT_TRUE(ch == '\n' || static_cast<unsigned char>(ch) >= 0x20) << text;
  EXPECT_EQ(text.back(), '\n');
  EXPECT_NE(text.find("a.obj: a.texmesh"), std::string::npos) << text;
  EXPECT_NE(text.find("a.obj: warning: odd at mesh: look at this"), std::string::npos) << text;
  EXPECT_NE(text.find("error: b.obj: no faces"), std::string::npos) << text;
  EXPECT_NE(text.find("1 compiled, 1 up to date, 1 failed"), std::string::npos) << text;
  EXPECT_EQ(text.find("nothing to see"), std::string::npos) << text;  // --verbose says it
  EXPECT_EQ(text.find("moved away"), text.rfind("cache: moved away") + 7) << "told more than once:\n" << text;
  EXPECT_NE(told(OutputMode::kPlain, true, false).find("nothing to see"), std::string::npos);
  EXPECT_NE(told(OutputMode::kPlain, false, true).find("runs: zim.difference 24 -> 30"), std::string::npos);
}

TEST(Progress, QuietSaysOnlyWhatIsWrong) {
  const std::string text = told(OutputMode::kQuiet, false, false);
  EXPECT_EQ(text.find("a.texmesh"), std::string::npos) << text;
  EXPECT_NE(text.find("look at this"), std::string::npos) << text;
  EXPECT_NE(text.find("b.obj: no faces"), std::string::npos) << text;
}

TEST(Progress, TheBarEndsWithoutATrace) {
  const std::string text = told(OutputMode::kTerminal, false, false);
  EXPECT_NE(text.find("\r\033[K["), std::string::npos);
  EXPECT_NE(text.find("3/3"), std::string::npos) << text;
  const std::size_t last_bar = text.rfind("\r\033[K[");
  EXPECT_NE(text.find("\r\033[K", last_bar + 4), std::string::npos) << "the last bar is not wiped";
  EXPECT_EQ(text.back(), '\n');
}

TEST(Progress, WhatBecameOfAnAtlasThatWasAskedForIsTold) {
  for (const char* code : {"atlas-rebuilt", "atlas-kept", "atlas-chosen"}) {
    std::ostringstream out;
    Progress progress(out, OutputMode::kPlain, false, false);
    progress.begin({{"a.obj", 1}});
    progress.started(0, "a.texmesh");
    progress.event(
        0,
        told_by_child(Json{
            {"event", "note"}, {"severity", "info"}, {"code", code}, {"place", ""}, {"text", "this and that"}}
                          .dump()));
    EXPECT_NE(out.str().find("this and that"), std::string::npos) << code;
  }
}

TEST(Progress, CancelledModelsAreNotDone) {
  std::ostringstream out;
  Progress progress(out, OutputMode::kTerminal, false, false);
  progress.begin({{"a.obj", 1}, {"b.obj", 1}});
  WorkerReport cancelled;
  cancelled.result = ModelResult::kCancelled;
  progress.started(0, "a.texmesh");
  progress.finished(0, cancelled, "a.texmesh");
  EXPECT_NE(out.str().find("[                        ] 0/2"), std::string::npos) << out.str();
}

TEST(Progress, ABarIsNoWiderThanTheTerminal) {
  std::ostringstream out;  // 80 columns where nobody knows
  Progress progress(out, OutputMode::kTerminal, false, false);
  const std::string name = "a/" + std::string(60, 'x') + "/L\xc3\xb6we-" + std::string(60, 'y') + ".obj";
  progress.begin({{name, 1}});
  progress.started(0, "a.texmesh");
  progress.event(0, SharesTold{"", {{"simplification", .5}}});
  progress.event(0, told_by_child(R"({"event":"stage-started","stage":"simplification"})"));
  std::this_thread::sleep_for(std::chrono::milliseconds(110));
  progress.event(0, told_by_child(R"({"event":"stage-progress","stage":"simplification","fraction":0.5})"));
  const std::string text = out.str();
  ASSERT_NE(text.find("..."), std::string::npos) << text;
  std::size_t columns = 0;
  for (std::size_t i = text.rfind("\033[K") + 3; i < text.size(); ++i)
    columns += (static_cast<unsigned char>(text[i]) & 0xc0) != 0x80;
  EXPECT_LT(columns, 80u);
  EXPECT_GT(columns, 60u);
  EXPECT_NE(text.find("[=", text.rfind("\033[K")), std::string::npos)
      << "half a stage is no progress: " << text;
}

/// TEXMESH_WRITE_SCHEMAS=1 writes them.
TEST(Schemas, InTheRepositoryAreWhatTheProgramSays) {
  for (const DocumentSchema& schema : pipeline_schemas()) {
    const std::string file = TEXMESH_SOURCE_DIR "/schemas/" + schema.name + ".schema.json";
    if (std::getenv("TEXMESH_WRITE_SCHEMAS")) std::ofstream(file) << schema.text;
    std::ostringstream text;
    text << std::ifstream(file).rdbuf();
    EXPECT_EQ(text.str(), schema.text) << schema.name;
  }
}

TEST(Progress, EventsFollowTheirSchema) {
  std::istringstream in(told(OutputMode::kJson, false, false));
  std::multiset<std::string> kinds;
  for (std::string line; std::getline(in, line);) {
    const Json e = Json::parse(line);
    EXPECT_TRUE(testing::follows_schema(e, "event.v1")) << line;
    kinds.insert(e["event"]);
  }
  EXPECT_EQ(kinds.count("model-started"), 2u);
  EXPECT_EQ(kinds.count("model-finished"), 3u);
  EXPECT_EQ(kinds.count("error"), 1u);
  EXPECT_EQ(kinds.count("summary"), 1u);
  std::ostringstream out;
  Progress(out, OutputMode::kJson, false, false).cache_event("cache-not-written", "the disk is full");
  EXPECT_TRUE(testing::follows_schema(Json::parse(out.str()), "event.v1")) << out.str();
}

}  // namespace texmesh::reports_test
