// dump, verify, pack and unpack as programs: exit codes, streams, documents. tests/tools/inspect/ tests
// what these commands compute.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/support/command.h"
#include "tests/support/schema.h"

namespace texmesh::command_dump_test {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::CommandResult;
using testing::follows_schema;
using testing::read_text;
using testing::write_text;

const std::string kSource = TEXMESH_SOURCE_DIR, kGolden = kSource + "/tests/golden/v2.0-scan.texmesh";

CommandResult texmesh(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), TEXMESH_BINARY);
  return testing::run_command(arguments);
}

struct CliInspect : ::testing::Test {
  CliInspect() {
    std::string bytes = read_text(kGolden);
    bytes[bytes.size() / 2] ^= 1;
    write_text(damaged, bytes);
  }
  testing::TemporaryFolder folder;
  std::string damaged = folder / "damaged.texmesh";
};

TEST_F(CliInspect, EveryCodecIsUnpackedAndPackedAgain) {
  ASSERT_EQ(testing::run_command({TEXMESH_MAKE_SCAN, "--triangles", "600", "--texture", "512", "--textures",
                                  "-o", folder / "scan.glb"})
                .exit_code,
            0);
  for (const char* codec : {"jpeg", "progressive", "webp"}) {
    const std::string package = folder / (std::string(codec) + ".texmesh"), tree = folder / codec,
                      again = folder / (std::string(codec) + "-again.texmesh");
    const CommandResult made = texmesh(
        {"compile", folder / "scan.glb", "-o", package, "--ladder", codec, "--cache", folder / "cache"});
    ASSERT_EQ(made.exit_code, 0) << codec << made.output << made.errors;
    EXPECT_EQ(texmesh({"verify", package}).exit_code, 0) << codec;
    for (const char* fragments : {"packs", "files"}) {
      EXPECT_EQ(texmesh({"unpack", package, "-o", tree + fragments, "--fragments", fragments}).exit_code, 0);
      const CommandResult packed = texmesh({"pack", tree + fragments, "-o", again});
      EXPECT_EQ(packed.exit_code, 0) << codec << packed.errors;
      EXPECT_TRUE(read_text(package) == read_text(again)) << codec << ' ' << fragments;
    }
  }
}

TEST_F(CliInspect, DumpShowsEveryPart) {
  for (const char* part : {"summary", "scales", "fragments", "ladder", "tables", "perceptual", "entries",
                           "about", "provenance", "all"}) {
    const CommandResult text = texmesh({"dump", kGolden, part}),
                        data = texmesh({"dump", kGolden, part, "--json"});
    EXPECT_EQ(text.exit_code, 0) << part << text.errors;
    EXPECT_GT(text.output.size(), 100u) << part;
    EXPECT_TRUE(json::accept(data.output)) << part;
  }
  EXPECT_EQ(texmesh({"dump", kGolden}).output, texmesh({"dump", kGolden, "summary"}).output);
  EXPECT_TRUE(
      follows_schema(json::parse(texmesh({"dump", kGolden, "scales", "--json"}).output), "dump-scales.v1"));
}

TEST_F(CliInspect, DumpOfTablesTakesAnyGamma) {
  const CommandResult own = texmesh({"dump", kGolden, "tables"}),
                      text = texmesh({"dump", kGolden, "tables", "--gamma", "0.125"}),
                      data = texmesh({"dump", kGolden, "all", "--gamma", "0.125", "--json"});
  EXPECT_EQ(text.exit_code, 0) << text.errors;
  EXPECT_NE(text.output.find("at Gamma 0.125"), std::string::npos) << text.output;
  EXPECT_EQ(own.output.find("at Gamma 0.125"), std::string::npos) << own.output;
  const json all = json::parse(data.output);
  ASSERT_FALSE(all["tables"][0]["scales"].empty());
  for (const json& scale : all["tables"][0]["scales"]) EXPECT_EQ(scale["gamma"], 0.125);
  for (const char* gamma : {"-0.1", "1.01", "nan", "inf", "much"})
    EXPECT_EQ(texmesh({"dump", kGolden, "tables", "--gamma", gamma}).exit_code, 2) << gamma;
  EXPECT_EQ(texmesh({"dump", kGolden, "scales", "--gamma", "0.5"}).exit_code, 2) << "nothing of it there";
}

TEST_F(CliInspect, DumpOfWhatIsNoPackage) {
  write_text(folder / "not.texmesh", "something else");
  for (const std::string& path : {folder / "not.texmesh", folder / "nowhere.texmesh"}) {
    const CommandResult r = texmesh({"dump", path});
    EXPECT_EQ(r.exit_code, 1);
    EXPECT_EQ(r.output, "");
    EXPECT_NE(r.errors.find(fs::path(path).filename().string()), std::string::npos) << r.errors;
  }
  EXPECT_EQ(texmesh({"dump", kGolden, "weather"}).exit_code, 2);
  EXPECT_EQ(texmesh({"dump"}).exit_code, 2);
}

TEST_F(CliInspect, VerifyTellsSoundFromDamaged) {
  EXPECT_EQ(texmesh({"verify", kGolden}).exit_code, 0);
  EXPECT_EQ(texmesh({"verify", kGolden, "--quiet"}).output, "");
  const CommandResult both = texmesh({"verify", damaged, folder / "nowhere.texmesh", kGolden});
  EXPECT_EQ(both.exit_code, 1);
  EXPECT_NE(both.output.find("damaged.texmesh: "), std::string::npos);
  EXPECT_NE(both.output.find("[entry-digest]"), std::string::npos);
  EXPECT_NE(both.output.find("nowhere.texmesh: "), std::string::npos);
  EXPECT_NE(both.output.find("v2.0-scan.texmesh: ok ("), std::string::npos)
      << "the others are looked at all the same";
  EXPECT_EQ(texmesh({"verify"}).exit_code, 2);
}

TEST_F(CliInspect, VerifyReportsAsJson) {
  const CommandResult r = texmesh({"verify", damaged, kGolden, "--json"});
  EXPECT_EQ(r.exit_code, 1);
  const json report = json::parse(r.output);
  EXPECT_TRUE(follows_schema(report, "verify.v1")) << r.output;
  EXPECT_EQ(report["packages"][0]["ok"], false);
  EXPECT_FALSE(report["packages"][0]["findings"].empty());
  EXPECT_EQ(report["packages"][1]["ok"], true);
}

TEST_F(CliInspect, UnpackAndPackGiveTheSameFile) {
  for (const char* fragments : {"packs", "files"}) {
    const std::string tree = folder / fragments, package = folder / (std::string(fragments) + ".texmesh");
    EXPECT_EQ(texmesh({"unpack", kGolden, "-o", tree, "--fragments", fragments}).exit_code, 0);
    EXPECT_EQ(texmesh({"verify", tree}).exit_code, 0);
    EXPECT_EQ(texmesh({"dump", tree}).output, texmesh({"dump", kGolden}).output);
    EXPECT_EQ(texmesh({"pack", tree, "-o", package}).exit_code, 0);
    EXPECT_EQ(read_text(package), read_text(kGolden));
  }
  EXPECT_EQ(texmesh({"unpack", kGolden, "-o", folder / "packs"}).exit_code, 1);
  EXPECT_EQ(texmesh({"unpack", kGolden, "-o", folder / "packs", "--force"}).exit_code, 0);
  EXPECT_EQ(texmesh({"unpack", kGolden}).exit_code, 2);
}

TEST_F(CliInspect, DamageLeavesNothing) {
  EXPECT_EQ(texmesh({"unpack", damaged, "-o", folder / "tree"}).exit_code, 1);
  EXPECT_EQ(texmesh({"pack", folder.path().string(), "-o", folder / "out.texmesh"}).exit_code, 1);
  EXPECT_EQ(texmesh({"unpack", kGolden, "-o", "/proc/tree"}).exit_code, 1);
  EXPECT_EQ(testing::files_beneath(folder.path().string()), std::vector<std::string>{"damaged.texmesh"});
}

TEST_F(CliInspect, CompileEventsFollowTheirSchema) {
  ASSERT_EQ(testing::run_command(
                {TEXMESH_MAKE_SCAN, "-o", folder / "scan.glb", "--triangles", "200", "--texture", "64"})
                .exit_code,
            0);
  write_text(folder / "broken.glb", "glTF");
  const CommandResult r =
      texmesh({"compile", folder / "scan.glb", folder / "broken.glb", "-o", folder / "out", "--no-cache",
               "--json", "--quality.views", "1", "--quality.largest_px", "128"});
  EXPECT_EQ(r.exit_code, 1);
  std::istringstream lines(r.output);
  std::map<std::string, int> events;
  for (std::string line; std::getline(lines, line);) {
    const json event = json::parse(line, nullptr, false);
    EXPECT_TRUE(follows_schema(event, "event.v1")) << line;
    ++events[event.value("event", "")];
  }
  EXPECT_EQ(events["model-started"], 2);
  EXPECT_EQ(events["model-finished"], 2);
  EXPECT_EQ(events["error"], 1);
  EXPECT_EQ(events["summary"], 1);
  EXPECT_GT(events["stage-finished"], 10);
}

TEST_F(CliInspect, HelpTeaches) {
  for (const char* command : {"dump", "verify", "pack", "unpack"}) {
    const CommandResult r = texmesh({command, "--help"});
    EXPECT_EQ(r.exit_code, 0);
    EXPECT_NE(r.output.find("Example"), std::string::npos) << command;
    EXPECT_NE(r.output.find("Exit code"), std::string::npos) << command;
  }
}

}  // namespace texmesh::command_dump_test
