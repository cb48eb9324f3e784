// What a run tells people and programs: reports against their schemas, progress lines, events.
#include "pipeline/batch/reports.h"

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

namespace texmesh {
namespace {
using Json = nlohmann::json;

/// Reads XML as strictly as the reports need it: balanced elements, quoted attributes, no bare & or <.
/// Returns how often each element occurs; "not well-formed" is among them when it is not.
std::map<std::string, int> elements_of(const std::string& xml) {
  std::map<std::string, int> count;
  std::vector<std::string> open;
  std::size_t at = xml.find("?>");
  if (!xml.starts_with("<?xml ") || at == std::string::npos) return {{"not well-formed", 1}};
  for (at += 2; at < xml.size();) {
    if (xml[at] == '\n') {
      ++at;
      continue;
    }
    if (xml[at] != '<') return {{"not well-formed", static_cast<int>(at)}};
    const bool closes = xml[at + 1] == '/';
    std::size_t end = at + 1;
    for (bool quoted = false; end < xml.size() && (quoted || xml[end] != '>'); ++end) {
      if (xml[end] == '"') quoted = !quoted;
      if (xml[end] == '<' || static_cast<unsigned char>(xml[end]) < 0x20) return {{"not well-formed", 2}};
      if (xml[end] == '&' && xml.find(';', end) > end + 5) return {{"not well-formed", 3}};
    }
    const std::string tag = xml.substr(at + 1 + closes, end - at - 1 - closes);
    const std::string name = tag.substr(0, tag.find_first_of(" /"));
    if (closes) {
      if (open.empty() || open.back() != name) return {{"not well-formed", 4}};
      open.pop_back();
    } else {
      ++count[name];
      if (tag.back() != '/') open.push_back(name);
    }
    at = end + 1;
  }
  if (!open.empty()) return {{"not well-formed", 5}};
  return count;
}

struct FakeRun {
  std::vector<PlannedModel> models;
  std::vector<WorkerReport> reports;

  WorkerReport& add(const std::string& name, ModelResult result, int lane = 0, double start_s = 0,
                    double seconds = 0) {
    models.push_back({name, "out/" + name + ".texmesh", name, nullptr});
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

/// Names and messages that break careless writers: quotes, markup, control characters, bytes that are no
/// UTF-8.
FakeRun ugly_run() {
  FakeRun run;
  WorkerReport& ok = run.add("a<b>&\"c\".obj", ModelResult::kOk, 0, 0, 1.5);
  ok.package_bytes = 1234;
  ok.peak_memory_bytes = 1 << 27;
  ok.stages_ran = 3;
  run.add("unchanged\n\x01.obj", ModelResult::kUnchanged).ran = false;
  WorkerReport& bad = run.add("bad\xff\xfe.obj", ModelResult::kFailed, 1, 0.25, 0.5);
  bad.error_kind = "input";
  bad.error_message = "bad\xff.obj: line 1: expected <number>, found \"&\"\t\x02";
  bad.error_file = bad.error_found = bad.error_message;
  WorkerReport& dead = run.add("dead.obj", ModelResult::kInternal, 1, 1, 0.1);
  dead.error_kind = "internal";
  dead.error_message = "dead.obj: expected a worker that finishes, found signal Killed";
  run.add("late.obj", ModelResult::kCancelled);
  return run;
}

TEST(Summary, FollowsItsSchemaWhateverTheNames) {
  const FakeRun run = ugly_run();
  const Json summary = Json::parse(write_summary(run.models, run.reports, 2.5));
  EXPECT_TRUE(testing::follows_schema(summary, "summary.v1"));
  EXPECT_EQ(summary["models"].size(), 5u);
  EXPECT_EQ(summary["compiled"], 1);
  EXPECT_EQ(summary["unchanged"], 1);
  EXPECT_EQ(summary["failed"], 2);
  EXPECT_EQ(summary["cancelled"], 1);
  EXPECT_EQ(summary["models"][0]["bytes"], 1234);
  EXPECT_EQ(summary["models"][2]["error"]["kind"], "input");
  EXPECT_FALSE(summary["models"][0].contains("error"));
  EXPECT_TRUE(testing::follows_schema(Json::parse(write_summary({}, {}, 0)), "summary.v1"));
}

TEST(Junit, IsWellFormedAndCountsAsTheSummaryDoes) {
  const FakeRun run = ugly_run();
  const std::string xml = write_junit(run.models, run.reports, 2.5);
  const auto elements = elements_of(xml);
  EXPECT_EQ(elements, (std::map<std::string, int>{{"testsuites", 1},
                                                  {"testsuite", 1},
                                                  {"testcase", 5},
                                                  {"failure", 2},
                                                  {"skipped", 1},
                                                  {"properties", 5},
                                                  {"property", 30}}))
      << xml;
  EXPECT_NE(xml.find("tests=\"5\" failures=\"2\" errors=\"0\" skipped=\"1\""), std::string::npos) << xml;
  EXPECT_NE(xml.find("a&lt;b&gt;&amp;&quot;c&quot;.obj"), std::string::npos) << xml;
  EXPECT_EQ(elements_of("<?xml ?>\n<a><b></a></b>").count("not well-formed"), 1u);  // the reader itself
  EXPECT_EQ(elements_of("<?xml ?>\n<a x=\"a&b\"/>").count("not well-formed"), 1u);
}

TEST(Trace, HasOneProcessPerLaneAndNothingOverlapsInAThread) {
  FakeRun run;
  run.add("one", ModelResult::kOk, 0, 0, 3).spans = {
      {"import", 0, 1, false}, {"zim", 1, 2.5, false}, {"ssf", 1, 2, false}, {"lut", 2, 3, true}};
  run.add("two", ModelResult::kOk, 1, 0.5, 1).spans = {{"import", 0.5, 1.5, false}};
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
  b.error_kind = "input";
  b.error_message = "b.obj: no faces";
  c.result = ModelResult::kUnchanged;
  progress.recalled(2, c, "c.texmesh");
  progress.started(0, "a.texmesh");
  progress.event(0, R"({"event":"stage-explained","stage":"zim","verdict":"runs","history":true,
                        "changes":[{"part":"option zim.difference","from":"24","to":"30"}]})");
  progress.event(0, R"({"event":"stage-started","stage":"zim"})");
  progress.event(0, R"({"event":"stage-progress","stage":"zim","fraction":0.5})");
  progress.event(0, R"({"event":"stage-finished","stage":"zim","result":"ran","seconds":0.25})");
  progress.event(0, R"({"event":"note","severity":"info","code":"fine","place":"","text":"nothing to see"})");
  progress.event(
      0, R"({"event":"note","severity":"warning","code":"odd","place":"mesh","text":"look at this"})");
  for (int twice = 0; twice < 2; ++twice)
    progress.event(0, R"({"event":"cache","code":"cache-entry-damaged","text":"moved away"})");
  progress.finished(0, a, "a.texmesh");
  progress.started(1, "b.texmesh");
  progress.event(1, R"({"event":"error","kind":"input","file":"b.obj","place":"","expected":"faces",
                        "found":"none","message":"b.obj: no faces"})");
  progress.finished(1, b, "b.texmesh");
  progress.summary({a, b, c}, 1.5);
  return out.str();
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

TEST(Progress, ABarIsNoWiderThanTheTerminal) {
  std::ostringstream out;  // 80 columns where nobody knows
  Progress progress(out, OutputMode::kTerminal, false, false);
  const std::string name = "a/" + std::string(60, 'x') + "/L\xc3\xb6we-" + std::string(60, 'y') + ".obj";
  progress.begin({{name, 1}});
  progress.started(0, "a.texmesh");
  progress.event(0, R"({"event":"stage-started","stage":"simplification"})");
  std::this_thread::sleep_for(std::chrono::milliseconds(110));
  progress.event(0, R"({"event":"stage-progress","stage":"simplification","fraction":0.5})");
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

}  // namespace
}  // namespace texmesh
