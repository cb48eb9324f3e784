// Files that a model names, as a user meets them: links, files that come later, dependencies.
#include <gtest/gtest.h>

#include "pipeline/compile/workers/sandbox.h"
#include "tests/support/small_builds.h"

namespace texmesh::testing::command_compile_names_test {
namespace fs = std::filesystem;

class Names : public ::testing::Test {
 protected:
  void SetUp() override {
    write_text(folder_ / "profile.json", kCheapProfile);
    fs::create_directories(folder_ / "repository/scans");
    const CommandResult made = run_command({TEXMESH_MAKE_SCAN, "--triangles", "48", "--texture", "32", "-o",
                                            folder_ / "repository/scans/a.obj"});
    ASSERT_EQ(made.exit_code, 0) << made.errors;
    for (const std::string& file : files_beneath(folder_ / "repository/scans"))
      if (file.ends_with(".jpg") || file.ends_with(".png")) texture_ = file;
    ASSERT_FALSE(texture_.empty());
  }
  std::string scans(const std::string& name) const { return folder_ / ("repository/scans/" + name); }
  /// What is said; the package is compiled again only where something has changed.
  std::string compile(const std::string& input, const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{TEXMESH_BINARY,
                                       "compile",
                                       input,
                                       "-o",
                                       folder_ / "out",
                                       "--cache",
                                       folder_ / "cache",
                                       "--profile",
                                       folder_ / "profile.json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const CommandResult r = run_command(arguments);
    EXPECT_EQ(r.exit_code, 0) << r.output << r.errors;
    return r.output;
  }
  TemporaryFolder folder_;
  std::string texture_;  // the picture that the model names
};

TEST_F(Names, AFileThatComesLaterIsSeen) {
  fs::rename(scans(texture_), folder_ / "kept");
  EXPECT_NE(compile(scans("a.obj")).find("missing-texture"), std::string::npos);
  EXPECT_NE(compile(scans("a.obj")).find("up to date"), std::string::npos);
  std::string upper = texture_;
  std::transform(upper.begin(), upper.end(), upper.begin(), [](unsigned char c) { return std::toupper(c); });
  fs::copy_file(folder_ / "kept", scans(upper));
  EXPECT_NE(compile(scans("a.obj")).find("similar-name"), std::string::npos);
  EXPECT_NE(compile(scans("a.obj")).find("up to date"), std::string::npos);
  fs::copy_file(folder_ / "kept", scans(texture_));
  const std::string exact = compile(scans("a.obj"));
  EXPECT_EQ(exact.find("warning"), std::string::npos) << exact;
  EXPECT_EQ(exact.find("up to date"), std::string::npos) << exact;
}

TEST_F(Names, ADownloadOfSketchfabFindsItsTextures) {
  fs::create_directories(folder_ / "get/textures");
  fs::rename(folder_ / "repository/scans", folder_ / "get/source");
  fs::rename(folder_ / ("get/source/" + texture_), folder_ / ("get/textures/" + texture_));
  const std::vector<std::string> required = sandbox_support().complete()
                                                ? std::vector<std::string>{"--sandbox", "require"}
                                                : std::vector<std::string>{};
  const std::string alone = compile(folder_ / "get/source/a.obj", required);
  EXPECT_NE(alone.find("missing-texture"), std::string::npos) << alone;
  EXPECT_NE(alone.find("compile the folder of both"), std::string::npos) << alone;
  const std::string both = compile(folder_ / "get", required);
  EXPECT_NE(both.find("moved-file"), std::string::npos) << both;
  EXPECT_EQ(both.find("missing-texture"), std::string::npos) << both;
  EXPECT_NE(compile(folder_ / "get").find("up to date"), std::string::npos);
  fs::remove(folder_ / ("get/textures/" + texture_));
  EXPECT_NE(compile(folder_ / "get").find("missing-texture"), std::string::npos);
  EXPECT_EQ(run_command({TEXMESH_BINARY, "verify", folder_ / "out/source/a.texmesh"}).exit_code, 0);
}

TEST_F(Names, LinksAreFollowedWithinTheFolderThatWasNamed) {
  fs::create_directories(folder_ / "repository/.annex");
  fs::rename(scans(texture_), folder_ / "repository/.annex/key");
  fs::create_symlink("../.annex/key", scans(texture_));
  const std::vector<std::string> required = sandbox_support().complete()
                                                ? std::vector<std::string>{"--sandbox", "require"}
                                                : std::vector<std::string>{};
  const std::string refused = compile(scans("a.obj"), required);
  EXPECT_NE(refused.find("missing-texture"), std::string::npos) << refused;
  EXPECT_NE(refused.find("--links-within DIR"), std::string::npos) << refused;
  std::vector<std::string> more = required;
  more.insert(more.end(), {"--links-within", folder_ / "repository"});
  EXPECT_EQ(compile(scans("a.obj"), more).find("warning"), std::string::npos);
  EXPECT_NE(compile(scans("a.obj"), more).find("up to date"), std::string::npos);
  EXPECT_NE(compile(scans("a.obj"), required).find("missing-texture"), std::string::npos)
      << "not what was found with the option";
  write_text(folder_ / "repository/c.json",
             R"({"version":1,"models":[{"input":"scans/a.obj","output":"a.texmesh"}]})");
  const std::string whole = compile(folder_ / "repository/c.json", required);
  EXPECT_EQ(whole.find("warning"), std::string::npos) << whole;
  EXPECT_EQ(whole.find("up to date"), std::string::npos) << "the folder that was named decides";
  EXPECT_NE(compile(folder_ / "repository/c.json", required).find("up to date"), std::string::npos);
}

TEST_F(Names, ALinkToAFolderThatIsNotThereIsAUsageError) {
  EXPECT_EQ(run_command({TEXMESH_BINARY, "compile", scans("a.obj"), "-o", folder_ / "x.texmesh",
                         "--links-within", folder_ / "none"})
                .exit_code,
            2);
}

TEST_F(Names, DependenciesHoldNamesThatAreNotThere) {
  fs::remove(scans(texture_));
  compile(scans("a.obj"), {"--depfile", folder_ / "d"});
  const std::string rule = read_text(folder_ / "d");
  EXPECT_NE(rule.find(scans(texture_)), std::string::npos) << rule;
}

TEST_F(Names, AModelThatIsNotThereButForItsCaseIsNamed) {
  write_text(folder_ / "c.json", R"({"version":1,"models":[{"input":"repository\\scans\\A.OBJ"}]})");
  const CommandResult r =
      run_command({TEXMESH_BINARY, "compile", folder_ / "c.json", "-o", folder_ / "out", "--no-cache"});
  EXPECT_EQ(r.exit_code, 1) << r.output << r.errors;
  EXPECT_NE(r.output.find("only a.obj, whose name differs in case"), std::string::npos)
      << r.output << r.errors;
}

TEST_F(Names, WhatATerminalTakesForCommandsIsNotPrinted) {
  fs::rename(scans("a.obj"), scans("a\x1b[31m\nb.obj"));
  const std::string said = compile(folder_ / "repository/scans");
  EXPECT_NE(said.find("a?[31m?b"), std::string::npos) << said;
  EXPECT_EQ(said.find('\x1b'), std::string::npos) << said;
  const CommandResult missing = run_command({TEXMESH_BINARY, "dump", folder_ / "\x1b[2J.texmesh"});
  EXPECT_NE(missing.errors.find("?[2J.texmesh"), std::string::npos) << missing.errors;
  const CommandResult forged = run_command({TEXMESH_BINARY, "dump", folder_ / "x\ntexmesh: all is well"});
  EXPECT_NE(forged.errors.find("x?texmesh: all is well: "), std::string::npos) << forged.errors;
  const CommandResult list =
      run_command({TEXMESH_BINARY, "list", folder_ / "repository/scans", "-o", folder_ / "out"});
  EXPECT_NE(list.output.find("a?[31m?b.obj -> "), std::string::npos) << list.output << list.errors;
  EXPECT_EQ(list.output.find('\x1b'), std::string::npos) << list.output;
}

TEST_F(Names, WarningsGiveATerminalNoCommands) {
  std::string material = read_text(scans("a.mtl"));
  material.replace(material.find(texture_), texture_.size(), "\x1b[2J.jpg");
  write_text(scans("a.mtl"), material);
  const CommandResult r = run_command({TEXMESH_BINARY, "doctor", scans("a.obj")});
  EXPECT_NE(r.errors.find("?[2J"), std::string::npos) << r.errors;
  EXPECT_EQ(r.errors.find('\x1b'), std::string::npos) << r.errors;
}

TEST_F(Names, ALimitOnFilesIsToldAsOne) {
  compile(folder_ / "repository/scans");
  const std::string package = folder_ / "out/a.texmesh";
  const CommandResult r = run_command({"bash", "-c", "ulimit -f 1; exec \"$0\" unpack \"$1\" -o \"$2\"",
                                       TEXMESH_BINARY, package, folder_ / "unpacked"});
  EXPECT_EQ(r.exit_code, 1);
  EXPECT_NE(r.errors.find("cannot be written: File too large"), std::string::npos) << r.errors;
}

}  // namespace texmesh::testing::command_compile_names_test
