#include "pipeline/compile/options.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "format/base/errors.h"

namespace texmesh::options_test {

OptionField& field(std::vector<OptionField>& fields, const std::string& path) {
  OptionField* found = find_option(fields, path);
  if (!found) throw std::out_of_range(path);
  return *found;
}

TEST(Options, EveryFieldHasAHelpTextAndAUniquePath) {
  CompileOptions o;
  std::set<std::string> paths;
  for (const OptionField& f : list_options(o)) {
    EXPECT_TRUE(paths.insert(f.path()).second) << f.path();
    EXPECT_GT(f.help.size(), 10u) << f.path();
  }
  EXPECT_GT(paths.size(), 40u);
}

TEST(Options, DefaultsLieInTheirRanges) {
  CompileOptions o;
  EXPECT_NO_THROW(read_profile(o, write_profile(o), "defaults"));
}

TEST(Options, InstalledProfilesAreRead) {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(TEXMESH_SOURCE_DIR "/profiles")) {
    std::ifstream in(entry.path());
    CompileOptions o;
    EXPECT_NO_THROW(read_profile(o, std::string(std::istreambuf_iterator<char>(in), {}), entry.path()));
    EXPECT_FALSE(o.set_by_user.empty()) << entry.path();
    names.insert(entry.path().stem());
  }
  EXPECT_EQ(names, (std::set<std::string>{"archive", "fast", "small", "thesis"}));
}

TEST(Options, ProfileRoundTripKeepsEveryChangedValue) {
  CompileOptions o;
  o.ssf.scales = 12;
  o.ladder.rungs = {10, 50, 90};
  o.scales.mesh_codec = MeshCodec::kMeshopt;
  o.perceptual_values.jnd = 0.07;
  o.package.title = "Bust \"A\" \xc3\xa9";
  CompileOptions back;
  read_profile(back, write_profile(o), "p");
  EXPECT_EQ(write_profile(back), write_profile(o));
  EXPECT_EQ(back.ladder.rungs, o.ladder.rungs);
  EXPECT_EQ(back.scales.mesh_codec, MeshCodec::kMeshopt);
  EXPECT_NE(write_profile(o), write_profile(CompileOptions{}));
}

TEST(Options, FlagsAndProfilesMeanTheSame) {
  CompileOptions by_flag, by_profile;
  auto fields = list_options(by_flag);
  set_option(field(fields, "ssf.scales"), "12", "--ssf.scales");
  set_option(field(fields, "ladder.rungs"), "8,18,53", "--rungs");
  set_option(field(fields, "scales.mesh_codec"), "none", "--mesh-codec");
  set_option(field(fields, "package.title"), "12", "--title");
  read_profile(
      by_profile,
      R"({"version":1,"ssf":{"scales":12},"ladder":{"rungs":[8,18,53]},"scales":{"mesh_codec":"none"},"package":{"title":"12"}})",
      "p");
  EXPECT_EQ(write_profile(by_flag), write_profile(by_profile));
}

TEST(Options, ADefaultFollowsFromOtherOptionsAndWhatTheUserSetsDoesNot) {
  CompileOptions o;
  EXPECT_EQ(write_profile(resolve_options(o)), write_profile(o));
  o.ladder.mode = LadderMode::kProgressive;
  EXPECT_EQ(resolve_options(o).fragmentation.min_fragment_px, 256);
  auto fields = list_options(o);
  set_option(field(fields, "fragmentation.min_fragment_px"), "128", "--fragmentation.min_fragment_px");
  EXPECT_EQ(resolve_options(o).fragmentation.min_fragment_px, 128);  // the default's value, but chosen
  o.fragmentation.min_fragment_px = 64;
  o.set_by_user.clear();
  EXPECT_EQ(resolve_options(o).fragmentation.min_fragment_px, 64);

  o.fragmentation.fill = Fill::kNone;
  EXPECT_EQ(resolve_options(o).ladder.uncovered, Uncovered::kKept);
  read_profile(o, R"({"version":1,"ladder":{"uncovered":"free"}})", "p");
  EXPECT_EQ(resolve_options(o).ladder.uncovered, Uncovered::kFree);
}

TEST(Options, NewChartsHaveDefaultsOfTheirOwn) {
  CompileOptions o;
  EXPECT_EQ(resolve_options(o).simplification.seam_weight, 1);
  EXPECT_EQ(resolve_options(o).proxies.mode, ProxyMode::kAuto);
  o.atlas.mode = AtlasMode::kAuto;
  EXPECT_EQ(resolve_options(o).atlas.mode, AtlasMode::kAuto);
  EXPECT_EQ(resolve_options(o).simplification.seam_weight, 1);
  o.atlas.mode = AtlasMode::kRebuild;
  EXPECT_EQ(resolve_options(o).simplification.seam_weight, 0.1);
  EXPECT_EQ(resolve_options(o).simplification.order, CollapseOrder::kTouching);
  EXPECT_EQ(resolve_options(o).simplification.coarsest_vertices, 220);
  EXPECT_EQ(resolve_options(o).proxies.mode, ProxyMode::kAlways);
  EXPECT_EQ(resolve_options(o).ladder.uncovered, Uncovered::kKept);
  EXPECT_EQ(write_profile(resolve_options(resolve_options(o))), write_profile(resolve_options(o)));
  read_profile(o, R"({"version":1,"simplification":{"seam_weight":1},"proxies":{"mode":"auto"}})", "p");
  EXPECT_EQ(resolve_options(o).simplification.seam_weight, 1);  // the defaults' values, but chosen
  EXPECT_EQ(resolve_options(o).proxies.mode, ProxyMode::kAuto);
}

TEST(Options, RungsThatAreGivenAreAllStored) {
  EXPECT_TRUE(resolve_options({}).ladder.prune);
  for (const char* name :
       {"ladder.rungs", "ladder.normal_rungs", "ladder.data_rungs", "ladder.alpha_rungs"}) {
    CompileOptions o;
    auto fields = list_options(o);
    const std::string usual = "18,30,53,75,86,93,97";  // the default of two of them, but chosen
    set_option(field(fields, name), usual, name);
    EXPECT_FALSE(resolve_options(o).ladder.prune) << name;
    set_option(field(fields, "ladder.prune"), "true", "--ladder.prune");
    EXPECT_TRUE(resolve_options(o).ladder.prune) << name;
  }
}

TEST(Options, ResolvedOptionsTravelAsAProfile) {
  CompileOptions o, back;
  o.ladder.mode = LadderMode::kProgressive;
  read_profile(o, R"({"version":1,"fragmentation":{"min_fragment_px":128}})", "p");
  const std::string profile = write_profile(resolve_options(o));
  read_profile(back, profile, "job");
  EXPECT_EQ(write_profile(resolve_options(back)), profile);
  EXPECT_EQ(back.fragmentation.min_fragment_px, 128);
}

TEST(Options, KeysAndDocumentsWriteValuesTheSameWay) {
  CompileOptions o;
  o.package.title = "Bust \"A\" \xc3\xa9";
  for (const OptionField& f : list_options(o)) EXPECT_EQ(option_text(f), option_json(f).dump()) << f.path();
}

struct Bad {
  const char* json;
  const char* place;
};
class BadProfile : public ::testing::TestWithParam<Bad> {};
TEST_P(BadProfile, NamesThePlace) {
  CompileOptions o;
  try {
    read_profile(o, GetParam().json, "p.json");
    FAIL() << "accepted " << GetParam().json;
  } catch (const InputError& e) {
    EXPECT_EQ(e.file(), "p.json");
    EXPECT_EQ(e.place(), GetParam().place) << e.what();
    EXPECT_FALSE(e.found().empty());
  }
}
INSTANTIATE_TEST_SUITE_P(
    Options, BadProfile,
    ::testing::Values(Bad{"[]", ""}, Bad{"{", "line 1, column 2"}, Bad{"{}", "/version"},
                      Bad{R"({"version":2})", "/version"}, Bad{R"({"version":1,"sfs":{}})", "/sfs"},
                      Bad{R"({"version":1,"ssf":3})", "/ssf"},
                      Bad{R"({"version":1,"ssf":{"scale":3}})", "/ssf/scale"},
                      Bad{R"({"version":1,"ssf":{"scales":"3"}})", "/ssf/scales"},
                      Bad{R"({"version":1,"ssf":{"scales":0}})", "/ssf/scales"},
                      Bad{R"({"version":1,"ssf":{"scales":1e99}})", "/ssf/scales"},
                      Bad{R"({"version":1,"ssf":{"rate_cap":null}})", "/ssf/rate_cap"},
                      Bad{R"({"version":1,"scales":{"mesh_codec":"zip"}})", "/scales/mesh_codec"},
                      Bad{R"({"version":1,"ladder":{"rungs":[]}})", "/ladder/rungs"},
                      Bad{R"({"version":1,"ladder":{"rungs":[50,10]}})", "ladder.rungs"},
                      Bad{R"({"version":1,"lut":{"quality_min":90,"quality_max":20}})", "lut.quality_min"}));

TEST(Options, DeepJsonIsRefusedBeforeItIsParsed) {
  CompileOptions o;
  EXPECT_THROW(read_profile(o, std::string(100000, '['), "deep"), InputError);
}

}  // namespace texmesh::options_test
