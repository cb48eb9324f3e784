// Summaries of runs: what is written, read, merged, and how badly written ones are told.
#include "pipeline/batch/fleet/run_summary.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "format/base/errors.h"
#include "tests/support/command.h"
#include "tests/support/schema.h"

namespace texmesh::run_summary_test {
using Json = nlohmann::json;
using testing::TemporaryFolder;

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

struct RunOfModels {
  BatchPlan plan;
  std::vector<WorkerReport> reports;

  WorkerReport& add(const std::string& name, ModelResult result, double seconds = 0) {
    plan.output_prefix = "out/";
    plan.models.push_back({name, "out/" + name + ".texmesh", false, false, nullptr});
    WorkerReport r;
    r.result = result;
    r.ran = result != ModelResult::kCancelled;
    r.seconds = seconds;
    reports.push_back(r);
    return reports.back();
  }
  RunSummary summary() const { return summarize_run(plan, reports, 2.5); }
};

/// Names and messages that break careless writers: quotes, markup, control characters, bytes that are no
/// UTF-8.
RunOfModels ugly_run() {
  RunOfModels run;
  WorkerReport& ok = run.add("a<b>&\"c\".obj", ModelResult::kOk, 1.5);
  ok.bytes = 1234;
  ok.peak_memory_bytes = 1 << 27;
  ok.stages_ran = 3;
  run.add("unchanged\n\x01.obj", ModelResult::kUnchanged).ran = false;
  WorkerReport& bad = run.add("bad\xff\xfe.obj", ModelResult::kFailed, 0.5);
  const std::string message = "bad\xff.obj: line 1: expected <number>, found \"&\"\t\x02";
  bad.more->error = {"input", message, "", "", message, message};
  WorkerReport& dead = run.add("dead.obj", ModelResult::kInternal, 0.1);
  dead.more->error = {"internal", "", "",
                      "",         "", "dead.obj: expected a worker that finishes, found signal Killed"};
  run.add("late.obj", ModelResult::kCancelled);
  return run;
}

TEST(Summary, FollowsItsSchemaWhateverTheNames) {
  const Json summary = Json::parse(write_summary(ugly_run().summary()));
  EXPECT_TRUE(testing::follows_schema(summary, "summary.v1"));
  EXPECT_EQ(summary["models"].size(), 5u);
  EXPECT_EQ(summary["compiled"], 1);
  EXPECT_EQ(summary["unchanged"], 1);
  EXPECT_EQ(summary["failed"], 2);
  EXPECT_EQ(summary["cancelled"], 1);
  EXPECT_EQ(summary["models"][0]["bytes"], 1234);
  EXPECT_EQ(summary["models"][2]["error"]["kind"], "input");
  EXPECT_FALSE(summary["models"][0].contains("error"));
  EXPECT_TRUE(testing::follows_schema(Json::parse(write_summary({})), "summary.v1"));
}

TEST(Junit, IsWellFormedAndCountsAsTheSummaryDoes) {
  const std::string xml = write_junit(ugly_run().summary());
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

std::span<const std::uint8_t> span_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

TEST(Summary, IsReadAsItWasWritten) {
  RunOfModels run;
  run.add("a", ModelResult::kOk, 1.5).bytes = 10;
  WorkerReport& known = run.add("b", ModelResult::kUnchanged);
  known.made_s = 4.5;
  known.made_memory_bytes = 77;
  WorkerReport& bad = run.add("c", ModelResult::kFailed, 0.5);
  bad.more->error = {"resource", "", "", "", "", "c: time"};
  run.plan.shard = {1, 3};
  run.plan.models_in_collection = 9;
  run.plan.collection = std::string(64, 'a');
  const std::string text = write_summary(run.summary());
  EXPECT_TRUE(testing::follows_schema(Json::parse(text), "summary.v1"));
  const RunSummary read = read_summary(span_of(text), "s.json");
  EXPECT_EQ(write_summary(read), text);
  EXPECT_EQ(recorded_costs_s(read), (std::map<std::string, double>{{"a.texmesh", 1.5}, {"b.texmesh", 4.5}}));
}

TEST(Summary, EveryTruncationIsNamedAsHalfWritten) {
  const TemporaryFolder folder;
  RunOfModels run;
  run.add("a", ModelResult::kOk, 1.5);
  const std::string text = write_summary(run.summary()), file = folder / "s.json";
  for (std::size_t length = 0; length + 2 < text.size(); length += 7) {  // the last byte is a line break
    testing::write_text(file, text.substr(0, length));
    EXPECT_EQ(open_summary(file).kind, "half-written") << length;
  }
  EXPECT_EQ(open_summary(folder / "none.json").kind, "half-written");
  for (const char* other : {"{}", "[1]", "7", R"({"version":1,"models":7,"compiled":0})",
                            R"({"version":1,"models":[{"model":"a"}],"compiled":0,"seconds":1})"}) {
    testing::write_text(file, other);
    EXPECT_EQ(open_summary(file).kind, "foreign") << other;
  }
  testing::write_text(file, text);
  EXPECT_TRUE(open_summary(file).summary);
}

SummaryFile shard_file(int index, int count, const std::vector<std::string>& models, char collection = 'a',
                       ModelResult result = ModelResult::kOk) {
  RunOfModels run;
  for (const std::string& m : models) run.add(m, result, 1);
  run.plan.shard = {index, count};
  run.plan.collection = std::string(64, collection);
  return {std::to_string(index) + ".json", run.summary(), "", ""};
}

std::vector<std::string> kinds_of(const RunSummary& merged) {
  std::vector<std::string> kinds;
  for (const SummaryProblem& p : merged.problems) kinds.push_back(p.kind);
  return kinds;
}

TEST(MergeSummaries, ShardsOfOneCollectionMakeOneReport) {
  const RunSummary merged = merge_summaries({shard_file(1, 2, {"b", "d"}), shard_file(0, 2, {"a", "c"})});
  EXPECT_TRUE(merged.problems.empty());
  EXPECT_EQ(merged.seconds, 5);
  ASSERT_EQ(merged.models.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(merged.models[i].package[0], "abcd"[i]);
  EXPECT_EQ(merged.parts.size(), 2u);
  EXPECT_EQ(exit_code_of(merged), 0);
  EXPECT_TRUE(testing::follows_schema(Json::parse(write_summary(merged)), "summary.v1"));
  // A merged report is merged again.
  const SummaryFile whole{"whole.json", read_summary(span_of(write_summary(merged)), "w"), "", ""};
  EXPECT_EQ(merge_summaries({whole}).parts.size(), 2u);
}

TEST(MergeSummaries, ForeignDoubleHalfWrittenAndMissingOnesAreNamed) {
  const SummaryFile torn{"torn.json", {}, "half-written", "byte 7"};
  const RunSummary merged =
      merge_summaries({shard_file(0, 6, {"a"}), shard_file(1, 6, {"b"}), shard_file(2, 6, {"c"}, 'b'), torn,
                       shard_file(0, 6, {"a"}, 'a', ModelResult::kCancelled)});
  EXPECT_EQ(kinds_of(merged), (std::vector<std::string>{"foreign", "half-written", "double", "missing"}));
  EXPECT_EQ(merged.models.size(), 2u);
  EXPECT_EQ(merged.models[0].result, ModelResult::kOk) << "the better of two results";
  EXPECT_EQ(merged.problems.back().text, "no summary of shards 2-5 of 6");
  EXPECT_EQ(merged.problems[2].text, "1 of its packages are those of 0.json");
  EXPECT_EQ(exit_code_of(merged), 75);
  EXPECT_TRUE(testing::follows_schema(Json::parse(write_summary(merged)), "summary.v1"));
}

TEST(MergeSummaries, TheExitCodeSaysWhetherTryingAgainIsOfUse) {
  const auto code = [](ModelResult result, const std::string& kind) {
    SummaryFile f = shard_file(0, 1, {"a", "b"}, 'a', result);
    f.summary->models[0].error.kind = kind;
    f.summary->models[1].error.kind = kind;
    return exit_code_of(merge_summaries({shard_file(0, 1, {"c"}), f}));
  };
  EXPECT_EQ(code(ModelResult::kOk, ""), 0);
  EXPECT_EQ(code(ModelResult::kFailed, "input"), 1);
  EXPECT_EQ(code(ModelResult::kFailed, "resource"), 75);
  EXPECT_EQ(code(ModelResult::kCancelled, ""), 75);
  EXPECT_EQ(code(ModelResult::kInternal, "internal"), 3);
  EXPECT_EQ(graver_exit_code(1, 75), 75);
  EXPECT_EQ(graver_exit_code(0, 1), 1);
  EXPECT_EQ(graver_exit_code(0, 0), 0);
}

}  // namespace texmesh::run_summary_test
