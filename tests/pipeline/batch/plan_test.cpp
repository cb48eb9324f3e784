#include <gtest/gtest.h>
#include <sys/inotify.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <map>
#include <set>

#include "format/base/errors.h"
#include "pipeline/batch/plan.h"
#include "pipeline/compile/options.h"
#include "tests/support/command.h"

namespace texmesh::plan_test {
namespace fs = std::filesystem;
using testing::TemporaryFolder;

std::vector<CollectionModel> read(const std::string& json, const FolderLister& list = {}) {
  return read_collection(json, "collection.json", {}, list);
}

TEST(Collection, PatternsApplyInTheirOrderAndTheModelsOwnOptionsWin) {
  const auto models = read(R"({"version":1,
    "options":{"ssf":{"scales":3},"zim":{"difference":10}},
    "patterns":[{"match":"statues/*","options":{"zim":{"difference":20},"ladder":{"rungs":[30]}}},
                {"match":"*.ply","options":{"zim":{"difference":40}}},
                {"match":"b?g.obj","options":{"ssf":{"scales":9}}}],
    "models":[{"input":"coin.obj"},{"input":"statues/old/turtle.obj"},{"input":"statues/bust.ply"},
              {"input":"big.obj","options":{"ssf":{"scales":5}}},{"input":"bug.obj"}]})");
  ASSERT_EQ(models.size(), 5u);
  EXPECT_EQ(models[0].options->ssf.scales, 3);
  EXPECT_EQ(models[0].options->zim.difference, 10);
  EXPECT_EQ(models[1].options->zim.difference, 20);  // '*' goes past '/'
  EXPECT_EQ(models[1].options->ladder.rungs, std::vector<int>{30});
  EXPECT_EQ(models[2].options->zim.difference, 40);  // the later pattern
  EXPECT_EQ(models[2].options->ladder.rungs, std::vector<int>{30});
  EXPECT_EQ(models[3].options->ssf.scales, 5);
  EXPECT_EQ(models[4].options->ssf.scales, 9);
}

TEST(Collection, ModelsWithEqualOptionsShareThem) {
  const auto models = read(R"({"version":1,"patterns":[{"match":"*","options":{"ssf":{"scales":4}}}],
                               "models":[{"input":"a.obj"},{"input":"b.obj"},{"input":"c.obj","options":{}}]})");
  EXPECT_EQ(models[0].options, models[1].options);
  EXPECT_EQ(models[2].options->ssf.scales, 4);
}

TEST(Collection, WhatIsListedAndFoundIsCompiledOnceAsListed) {
  const auto list = [](const std::string& folder) -> std::vector<std::string> {
    EXPECT_EQ(folder, "scans");
    return {"a.obj", "deep/b.glb", "c.ply"};
  };
  const auto models = read(
      R"({"version":1,"folders":["scans"],"models":[{"input":"scans/./a.obj","output":"first.texmesh"}]})",
      list);
  std::map<std::string, std::string> outputs;
  for (const CollectionModel& m : models) outputs[m.input] = m.output;
  EXPECT_EQ(outputs, (std::map<std::string, std::string>{{"scans/./a.obj", "first.texmesh"},
                                                         {"scans/deep/b.glb", "deep/b.texmesh"},
                                                         {"scans/c.ply", "c.texmesh"}}));
}

TEST(Collection, TheSamePackageTwiceAndWrongOptionsAreRefusedWithTheirPlace) {
  const auto place_of = [](const std::string& json) -> std::string {
    try {
      read(json);
    } catch (const InputError& e) {
      return e.place();
    }
    return "accepted";
  };
  EXPECT_EQ(place_of(R"({"version":1,"models":[{"input":"a.obj"},{"input":"b/a.ply"}]})"),
            "/models/1/output");
  EXPECT_EQ(place_of(R"({"version":1,"patterns":[{"match":"x","options":{"ssf":{"scales":0}}}],
                         "models":[{"input":"a.obj"}]})"),
            "/patterns/0/options/ssf/scales");
  EXPECT_EQ(place_of(R"({"version":1,"models":[{"input":"a.obj","output":"../a.texmesh"}]})"),
            "/models/0/output");
  EXPECT_EQ(place_of(R"({"version":1,"models":[{"input":"a.obj","options":{"ladder":{"rungs":[5,3]}}}]})"),
            "/models/0/options/ladder/rungs");
}

TEST(Collection, WhatIsFoundIsTold) {
  const auto found_in = [](const std::string& json) -> std::string {
    try {
      read(json);
    } catch (const InputError& e) {
      return e.found();
    }
    return "accepted";
  };
  EXPECT_EQ(found_in(R"({"version":1,"models":[]})"), "0");
  EXPECT_EQ(found_in(R"({"version":1,"models":{}})"), "object");
  EXPECT_EQ(found_in(R"({"version":1,"options":{"lader":{}},"models":[{"input":"a.obj"}]})"),
            "\"lader\"; did you mean ladder?");
}

TEST(Collection, APatternThatMatchesNoModelIsTold) {
  Notes notes;
  read_collection(R"({"version":1,"patterns":[{"match":"*.obj","options":{}},{"match":"*.objj","options":{}}],
                      "models":[{"input":"a.obj"}]})",
                  "c.json", {}, {}, PackageNames::kStem, {}, &notes);
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(notes[0].severity, Severity::kWarning);
  EXPECT_EQ(notes[0].place, "c.json");
  EXPECT_EQ(notes[0].text, "/patterns/1/match: no model's input matches \"*.objj\"");
}

TEST(Collection, PathsWithControlCharactersAreRefused) {
  const auto read = [](const std::string& model) {
    return read_collection(R"({"version":1,"models":[)" + model + "]}", "c.json", {}, {});
  };
  EXPECT_THROW(read(R"({"input":"a.obj","output":"a\u0000.texmesh"})"), InputError);
  EXPECT_THROW(read(R"({"input":"a\n.obj"})"), InputError);
}

TEST(Collection, TooDeepIsRefusedAndBracketsInTextsDoNotCount) {
  std::string deep = R"({"version":1,"models":[{"input":"a.obj","options":)";
  for (int i = 0; i < 20; ++i) deep += "[";
  EXPECT_THROW(read(deep), InputError);
  EXPECT_EQ(read(R"({"version":1,"models":[{"input":"[[[[[[[[[[[[[[[[[[[[\"[[.obj"}]})").size(), 1u);
  EXPECT_THROW(read(R"({"version":1,"models":[{"input":"a.obj"}]}])"), InputError);
}

class Plan : public ::testing::Test {
 protected:
  void add(const std::string& name, const std::string& text = "v 0 0 0") {
    fs::create_directories(fs::path(folder_ / name).parent_path());
    testing::write_text(folder_ / name, text);
  }
  BatchPlan plan(const std::vector<std::string>& names, int shard = 0, int shards = 1) {
    PlanRequest request;
    for (const std::string& n : names) request.inputs.push_back(folder_ / n);
    request.output = folder_ / "out";
    request.shard = {shard, shards};
    request.costs_s = costs_s_;
    request.apply_flags = [](CompileOptions& o) { o.package.title = "by flag"; };
    return plan_batch(request);
  }
  static std::set<std::string> outputs(const BatchPlan& p) {
    std::set<std::string> all;
    for (const PlannedModel& m : p.models) all.insert(m.output);
    return all;
  }
  TemporaryFolder folder_;
  std::map<std::string, double> costs_s_;
};

TEST_F(Plan, ShardsPartitionExactlyAndAreBalancedBySize) {
  constexpr int kModels = 200, kShards = 7;
  // A few large models and many small ones, as collections are: 2 MB stand for a second beside the first.
  for (int i = 0; i < kModels; ++i)
    add("in/m" + std::to_string(i) + ".obj", std::string(i % 20 == 0 ? 4'000'000 : 100, '#'));
  const auto whole = outputs(plan({"in"}));
  ASSERT_EQ(whole.size(), static_cast<std::size_t>(kModels));
  std::set<std::string> together;
  std::set<std::string> collections;
  for (int s = 0; s < kShards; ++s) {
    const BatchPlan p = plan({"in"}, s, kShards);
    double seconds = 0;
    for (const PlannedModel& m : p.models) {
      EXPECT_TRUE(together.insert(m.output).second) << m.output << " is in two shards";
      seconds += fs::file_size(m.input) > 1000 ? 3 : 1;
    }
    EXPECT_NEAR(seconds, (190 + 10 * 3.) / kShards, 1.5) << s;
    EXPECT_EQ(p.models_in_collection, whole.size());
    EXPECT_EQ(p.shard, (Shard{s, kShards}));
    collections.insert(p.collection);
  }
  EXPECT_EQ(together, whole);
  EXPECT_EQ(collections.size(), 1u);
  // Tasks that see other files can tell by the digest.
  add("in/new.obj");
  EXPECT_FALSE(collections.contains(plan({"in"}, 0, kShards).collection));
}

/// Names of the files of a folder that this process opened since.
class OpenedFiles {
 public:
  explicit OpenedFiles(const std::string& folder) : fd_(::inotify_init1(IN_NONBLOCK | IN_CLOEXEC)) {
    EXPECT_GE(::inotify_add_watch(fd_, folder.c_str(), IN_OPEN), 0);
  }
  ~OpenedFiles() { ::close(fd_); }
  OpenedFiles(const OpenedFiles&) = delete;
  OpenedFiles& operator=(const OpenedFiles&) = delete;
  std::set<std::string> names() {
    std::set<std::string> all;
    alignas(inotify_event) std::array<char, 65536> buffer;
    for (ssize_t bytes = 0; (bytes = ::read(fd_, buffer.data(), buffer.size())) > 0;)
      for (ssize_t at = 0; at < bytes;) {
        const auto* event = reinterpret_cast<const inotify_event*>(buffer.data() + at);
        if (event->len > 0) all.insert(event->name);
        at += static_cast<ssize_t>(sizeof(inotify_event) + event->len);
      }
    return all;
  }

 private:
  int fd_;
};

constexpr const char* kScan = R"({"version":1,"type":"cylindrical-range-scan"})";

TEST_F(Plan, AShardOpensOnlyItsOwnFiles) {
  constexpr int kShards = 4;
  for (int i = 0; i < 12; ++i) {
    add("in/m" + std::to_string(i) + ".obj");
    add("in/m" + std::to_string(i) + ".json", R"({"title":"what is known of the model beside it"})");
    add("in/s" + std::to_string(i) + ".json", kScan);
  }
  add("c.json", R"({"version":1,"folders":["in"]})");
  for (const char* input : {"in", "c.json"}) {
    const BatchPlan whole = plan({input});
    EXPECT_EQ(whole.models.size(), 24u);
    EXPECT_EQ(whole.models_in_collection, 24u);
    std::set<std::string> together, opened;
    for (int s = 0; s < kShards; ++s) {
      OpenedFiles files(folder_ / "in");
      const BatchPlan p = plan({input}, s, kShards);
      EXPECT_EQ(p.models.size(), 6u) << "as many of each kind";
      for (const PlannedModel& m : p.models) EXPECT_TRUE(together.insert(m.output).second) << m.output;
      for (const std::string& name : files.names())
        EXPECT_TRUE(opened.insert(name).second) << name << " was opened by two shards";
    }
    EXPECT_EQ(together, outputs(whole));
    EXPECT_EQ(opened.size(), 24u);
  }
}

TEST_F(Plan, AJsonThatIsNoModelTakesNoPackageFromAnother) {
  add("x/meta.json", "{}");
  add("y/meta.json", "{}");
  add("y/a.json", "{}");
  add("x/a.obj"), add("y/b.obj");
  add("c.json", R"({"version":1,"folders":["x","y"]})");
  for (const std::vector<std::string>& inputs :
       {std::vector<std::string>{"x", "y"}, std::vector<std::string>{"c.json"}})
    EXPECT_EQ(outputs(plan(inputs)),
              (std::set<std::string>{folder_ / "out/a.texmesh", folder_ / "out/b.texmesh"}));
  add("y/a.json", kScan);
  EXPECT_THROW(plan({"c.json"}), InputError);
}

TEST_F(Plan, WhatModelsTookBeforeWinsOverTheirSizes) {
  for (int i = 0; i < 9; ++i) add("in/m" + std::to_string(i) + ".obj");
  costs_s_["m4.texmesh"] = 100;
  int alone = 0;
  for (int s = 0; s < 2; ++s) alone += plan({"in"}, s, 2).models.size() == 1;
  EXPECT_EQ(alone, 1) << "the model that takes long has a shard of its own";
}

TEST_F(Plan, AShardDoesNotDependOnWhereTheOutputFolderIs) {
  for (int i = 0; i < 30; ++i) add("in/m" + std::to_string(i) + ".obj");
  const auto names = [&](const std::string& output) {
    PlanRequest request;
    request.inputs = {folder_ / "in"};
    request.output = output;
    request.shard = {0, 3};
    std::set<std::string> all;
    for (const PlannedModel& m : plan_batch(request).models) all.insert(fs::path(m.output).filename());
    return all;
  };
  EXPECT_EQ(names("/somewhere"), names("else/where/"));
}

TEST_F(Plan, FlagsWinOverWhatACollectionSays) {
  add("a.obj");
  add("c.json", R"({"version":1,"models":[{"input":"a.obj","options":{"package":{"title":"by model"},
                    "ssf":{"scales":6}}}]})");
  const BatchPlan p = plan({"c.json"});
  ASSERT_EQ(p.models.size(), 1u);
  EXPECT_EQ(p.files, std::vector<std::string>{folder_ / "c.json"});
  CompileOptions options;
  read_profile(options, *p.models[0].profile, "profile");
  EXPECT_EQ(options.package.title, "by flag");
  EXPECT_EQ(options.ssf.scales, 6);
}

TEST_F(Plan, TwoModelsForOnePackageAreRefused) {
  add("x/a.obj");
  add("c.json", R"({"version":1,"models":[{"input":"x/a.obj"}]})");
  EXPECT_THROW(plan({"c.json", "x"}), InputError);
  add("y/a.obj");
  EXPECT_THROW(plan({"x/a.obj", "y/a.obj"}), InputError);
}

TEST_F(Plan, EqualProfilesAreOneText) {
  for (int i = 0; i < 10; ++i) add("in/m" + std::to_string(i) + ".obj");
  add("c.json", R"({"version":1,"models":[{"input":"in/m0.obj","output":"x.texmesh","options":{}}]})");
  const BatchPlan p = plan({"in", "c.json"});
  std::set<const std::string*> texts;
  for (const PlannedModel& m : p.models) texts.insert(m.profile.get());
  EXPECT_EQ(texts.size(), 1u);
}

}  // namespace texmesh::plan_test
