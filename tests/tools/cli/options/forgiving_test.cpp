// What people write in the place of what texmesh takes: it is understood where it can mean one thing only,
// else the message says what may have been meant.
#include <gtest/gtest.h>

#include <filesystem>

#include "pipeline/io/file_resolver.h"
#include "tests/support/command.h"
#include "tools/cli/options/common_options.h"
#include "tools/cli/options/units.h"

namespace texmesh::forgiving_test {

using testing::CommandResult;

void expect_told(const std::vector<std::string>& words, int exit_code, const std::string& text) {
  std::vector<std::string> line{TEXMESH_BINARY};
  line.insert(line.end(), words.begin(), words.end());
  const CommandResult r = testing::run_command(line);
  EXPECT_EQ(r.exit_code, exit_code) << text;
  EXPECT_NE((r.output + r.errors).find(text), std::string::npos) << r.output << r.errors;
}

TEST(Forgiving, AWordThatMeansNothingIsNamedWithOneThatDoes) {
  expect_told({"complie", "a.glb"}, 2, "texmesh: there is no command complie; did you mean compile?");
  expect_told({"qqq"}, 2, "texmesh: there is no command qqq (texmesh --help lists");
  expect_told({}, 2, "texmesh: a command is missing");
  expect_told({"cache", "stats"}, 2, "texmesh cache: there is no command stats; did you mean stat?");
  expect_told({"compile", "a.obj", "-o", "b", "--tilte=x"}, 2,
              "texmesh compile: there is no option --tilte; did you mean --title?");
  expect_told({"site", "a", "--out", "b"}, 2, "there is no option --out; did you mean --output?");
  expect_told({"compile", "a.obj", "-o", "b", "--up", "W"}, 2, "--up: expected one of");
  expect_told({"compile", "a.obj", "-o", "b", "--atlas", "rebuilt"}, 2, "; did you mean rebuild?");
  expect_told({"compile", "a.obj", "-o", "b", "--profile", "smal"}, 2, "; did you mean small?");
  expect_told({"dump", "a", "scale"}, 2, "texmesh dump: PART: expected one of summary, scales");
  expect_told({"export", "a", "-o", "b", "--to", "modelviewer"}, 2, "; did you mean model-viewer?");
  expect_told({"compile", "a.obj"}, 2, "texmesh compile: --output is required (texmesh compile --help");
  expect_told({"extract", "a", "-o", "b.glb", "--bytes", ""}, 2, "--bytes: expected a value");
  expect_told({"compile", "", "-o", "b"}, 2, "INPUT: expected a value, found an empty text");
  expect_told({"compile", "a.obj", "", "-o", "b"}, 2, "INPUT: expected a value, found an empty text");
  expect_told({"list", "", "-o", "b"}, 2, "INPUT: expected a value, found an empty text");
  expect_told({"help", "dump"}, 0, "Usage: texmesh dump");
  expect_told({"version"}, 0, "package format");
  expect_told({"compile", "a.obj", "-o", "b", "--rungs", "10,120"}, 2,
              "--rungs: /1: expected an integer in 1 .. 100");
}

TEST(Forgiving, AFileWhoseNameBeginsAsAnOptionDoes) {
  const testing::TemporaryFolder folder;
  testing::write_text(folder / "-x.glb", "x");
  const CommandResult r =
      testing::run_command({TEXMESH_BINARY, "dump", "-x.glb"}, {}, folder.path().string());
  EXPECT_EQ(r.exit_code, 2);
  EXPECT_NE(r.errors.find("-x.glb is no option; the file is ./-x.glb"), std::string::npos) << r.errors;
}

TEST(Forgiving, SizesAndRatesAreReadAsPeopleWriteThem) {
  for (const char* text : {"500kB", "500kb", "500KB", "500k", "500 kB", "0.5 MB", "500000"})
    EXPECT_EQ(parse_bytes(text, "--bytes"), 500'000u) << text;
  EXPECT_EQ(parse_bytes("2mib", "--bytes"), 2u << 20);
  for (const char* text : {"2Mbit/s", "2Mbps", "2Mbit", "2 Mb/s", "250kB/s", "2mbit", "2 MBIT/S", "2000Kbit"})
    EXPECT_EQ(parse_bandwidth(text, "--bandwidth"), 250'000) << text;
  for (const char* text : {"", "kB", "500 kBB", "-1kB", "5 0kB", "nan", "1e30"})
    EXPECT_THROW(parse_bytes(text, "--bytes"), UsageError) << text;
  for (const char* text : {"2mbps", "2MBPS", "0Mbps", "Mbps"})  // bits or bytes, milli or mega: nobody knows
    EXPECT_THROW(parse_bandwidth(text, "--bandwidth"), UsageError) << text;
}

TEST(Forgiving, AFolderIsNotMadeUnderTheNameOfAFile) {
  const testing::TemporaryFolder folder;
  for (const char* name : {"x.zip", "x.GLB", "x.TEXMESH", "x.texmsh", "x.tex-mesh", "a/b.html"})
    EXPECT_THROW(check_folder_name(name, ".texmesh"), UsageError) << name;
  EXPECT_THROW(check_folder_name("x.texmesh"), UsageError);
  for (const char* name : {"x", "x.texmesh", "x.v2", "scans.2026", "x.zip/", "", "."})
    EXPECT_NO_THROW(check_folder_name(name, ".texmesh")) << name;
  std::filesystem::create_directory(folder / "x.zip");
  EXPECT_NO_THROW(check_folder_name(folder / "x.zip", ".texmesh")) << "it is there";
}

TEST(Forgiving, WhatIsNoPackageIsCalledWhatItIs) {
  const testing::TemporaryFolder folder;
  const auto dumped = [&](const std::string& content, const std::string& told) {
    testing::write_text(folder / "x.texmesh", content);
    for (const char* command : {"dump", "view"}) expect_told({command, folder / "x.texmesh"}, 1, told);
  };
  for (const char* model : {"glTF\2", "ply\nformat ascii 1.0\n", "# a scan\nv 0 0 0\nv 1 0 0\nf 1 2 3\n",
                            "{\"asset\":{\"version\":\"2.0\"}}"})
    dumped(model, "texmesh compile makes a package of it");
  dumped("<!doctype html><title>Log in</title>", "a page of HTML");
  dumped("PK\3\4 other", "another ZIP archive");
  dumped("", "an empty file");
  dumped("garbage", "something else");
  const Bytes golden = read_input_file(TEXMESH_SOURCE_DIR "/tests/golden/v2.0-scan.texmesh", 1 << 24);
  dumped(std::string(golden.begin(), golden.begin() + 3000), "cut off");
  expect_told({"dump", folder / "."}, 1, "a folder without manifest.json");
  expect_told({"pack", folder / ".", "-o", "x.zip"}, 2, "a name that ends in .texmesh");
  expect_told({"unpack", "x", "-o", folder / "x.zip"}, 2, "the name of a folder");
  expect_told({"compile", TEXMESH_SOURCE_DIR "/tests/golden/v2.0-scan.texmesh", "-o", folder / "y.texmesh"},
              1, "which is compiled already");
}

}  // namespace texmesh::forgiving_test
