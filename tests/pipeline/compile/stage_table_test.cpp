#include "pipeline/compile/stage_table.h"

#include <gtest/gtest.h>

#include <set>

#include "pipeline/compile/options.h"

namespace texmesh::stage_table_test {

TEST(StageTable, EveryInputIsMadeBeforeItIsUsedAndEveryOptionIsRead) {
  std::set<std::string> read;
  CompileOptions o;
  for (const AtlasMode mode : {AtlasMode::kKeep, AtlasMode::kRebuild}) {
    o.atlas.mode = mode;
    std::set<std::string> made{"source", "provenance"};
    for (const Stage& s : stage_table(o)) {
      for (const ArtefactName& input : s.inputs)
        EXPECT_TRUE(made.contains(input.name)) << s.name << " reads " << input.name;
      for (const StageOutput& output : s.outputs) EXPECT_TRUE(made.insert(output.name).second) << output.name;
      for (const StageOption& option : s.options)
        for (const auto& [path, text] : option.fields) read.insert(path);
      EXPECT_GE(s.version, 1);
    }
  }
  for (const OptionField& f : list_options(o))
    EXPECT_TRUE(read.contains(f.path())) << f.path() << " is in no key";
}

/// A stage without a share would let the progress bar stand still.
TEST(StageTable, EveryStageHasAShareOfTheTimeWhateverTheModel) {
  for (const ModelSize& size : {ModelSize{}, ModelSize{0, 0, 0}, ModelSize{1e7, 1000, 220}}) {
    double all = 0;
    for (const auto& [stage, share] : time_shares({}, size)) {
      EXPECT_GT(share, 0) << stage;
      all += share;
    }
    EXPECT_NEAR(all, 1, 1e-9);
  }
}

/// Proxies of a large scan take as long as all else.
TEST(StageTable, SharesFollowTheModel) {
  const auto proxies = [](double triangles, ProxyMode mode) {
    CompileOptions o;
    o.proxies.mode = mode;
    return time_shares(o, {triangles, 16, 2}).at("proxies");
  };
  EXPECT_GT(proxies(150e3, ProxyMode::kAuto), .3);
  EXPECT_LT(proxies(10e3, ProxyMode::kAuto), .2);
  EXPECT_LT(proxies(150e3, ProxyMode::kNone), .01);
}

/// Without an atlas of its own a package has the bytes that it had before there was such a stage.
TEST(StageTable, TheAtlasIsAStageWhereItIsNotKept) {
  const auto has_atlas = [](const std::vector<Stage>& table) {
    return std::ranges::find(table, "atlas", &Stage::name) != table.end();
  };
  EXPECT_FALSE(has_atlas(default_stage_table()));
  CompileOptions o;
  o.atlas.mode = AtlasMode::kRebuild;
  EXPECT_TRUE(has_atlas(stage_table(o)));
  for (const Stage& s : stage_table(o)) {
    const auto reads = [&](const char* name) {
      return std::ranges::find(s.inputs, name, &ArtefactName::name) != s.inputs.end();
    };
    if (s.name != "atlas") EXPECT_FALSE(reads("import.images") || reads("import.materials")) << s.name;
  }
}

TEST(StageTable, AnOptionHasTheNameOfThePlaceWhereItStands) {
  const CompileOptions o;
  EXPECT_EQ(option_name(o, o.import), "import");
  EXPECT_EQ(option_name(o, o.ladder.mode), "ladder.mode");
  EXPECT_EQ(option_name(o, o.perceptual_values.jnd), "perceptual_values.jnd");
  const double elsewhere = o.perceptual_values.jnd;
  EXPECT_THROW(option_name(o, elsewhere), std::logic_error);
}

/// Texts of all options in keys, by stage.
std::map<std::string, OptionTexts> key_texts(const CompileOptions& options) {
  std::map<std::string, OptionTexts> texts;
  for (const Stage& s : stage_table(resolve_options(options)))
    for (const StageOption& option : s.options)
      texts[s.name].insert(texts[s.name].end(), option.fields.begin(), option.fields.end());
  return texts;
}

TEST(StageTable, OptionsThatResolveToTheSameHaveTheSameKeys) {
  CompileOptions by_default, explicitly;
  by_default.ladder.mode = explicitly.ladder.mode = LadderMode::kProgressive;
  by_default.fragmentation.fill = explicitly.fragmentation.fill = Fill::kNone;
  explicitly.fragmentation.min_fragment_px = static_cast<int>(kLeastProgressiveSide);
  explicitly.ladder.uncovered = Uncovered::kKept;
  EXPECT_EQ(key_texts(by_default), key_texts(explicitly));
  explicitly.fragmentation.min_fragment_px = 64;
  EXPECT_NE(key_texts(by_default), key_texts(explicitly));
}

TEST(StageTable, AStageInTheMiddleNeedsOnlyWhatStandsBeforeIt) {
  const std::vector<Stage>& table = default_stage_table();
  const std::vector<Stage> graph = graph_towards(table[3], {});
  std::vector<std::string> names;
  for (const Stage& s : graph) names.push_back(s.name);
  EXPECT_EQ(names, (std::vector<std::string>{"import", "condition", "ssf"}));
}

}  // namespace texmesh::stage_table_test
