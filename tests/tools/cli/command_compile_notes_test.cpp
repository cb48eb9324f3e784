// Notes at points of the object, from compile --annotations or an archive to whoever gets a file: dump,
// verify, extract, export.
#include <gtest/gtest.h>

#include <atomic>
#include <nlohmann/json.hpp>
#include <thread>

#include "format/base/text_bytes.h"
#include "stages/gltf/glb_container.h"
#include "tests/support/small_builds.h"
#include "tests/support/zip_writer.h"

namespace texmesh::testing::command_compile_notes_test {

using Json = nlohmann::json;

/// Points on a tent, and one far away; script as text; a language that nobody knows.
constexpr const char* kNotes =
    R"([{"name":"Top","content":{"raw":"<script>alert(1)</script>"},"position":[1,1,0.5],"eye":[1,-5,1],"target":[1,1,0.5]}])";
constexpr const char* kOwnNotes =
    R"({"annotations":[{"position":[1,1,0.5],"texts":[{"language":"x-klingon","title":"Top"}]},
        {"position":[1000,0,0],"texts":[{"language":"en","title":"Far"}]}]})";
constexpr const char* kTent = "# unit: cm\nv 0 0 0\nv 2 0 0\nv 2 2 1\nv 0 2 1\nf 1 2 3\nf 1 3 4\n";

class CompileNotes : public ::testing::Test {
 protected:
  CompileNotes() {
    write_text(folder_ / "profile.json", kCheapProfile);
    write_text(folder_ / "tent.obj", kTent);
    write_text(folder_ / "notes.json", kNotes);
    write_text(folder_ / "own.json", kOwnNotes);
  }
  CommandResult compile(const std::vector<std::string>& more, const std::string& input = "tent.obj") {
    std::vector<std::string> arguments{
        TEXMESH_BINARY,    "compile",   folder_ / input,         "-o", package_, "--cache",
        folder_ / "cache", "--profile", folder_ / "profile.json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_command(arguments);
  }
  Json notes() {
    const CommandResult dumped = run_command({TEXMESH_BINARY, "dump", package_, "annotations", "--json"});
    EXPECT_EQ(dumped.exit_code, 0) << dumped.errors;
    return Json::parse(dumped.output).value("annotations", Json::array());
  }
  TemporaryFolder folder_;
  std::string package_ = folder_ / "tent.texmesh";
};

TEST_F(CompileNotes, NotesGoTheWayOfTheMesh) {
  ASSERT_EQ(compile({"--up", "keep"}).exit_code, 0);
  const std::string without = read_text(package_);
  EXPECT_EQ(notes(), Json::array());
  ASSERT_EQ(compile({"--up", "keep", "--annotations", folder_ / "own.json"}).exit_code, 0);
  const Json kept = notes();
  ASSERT_EQ(kept.size(), 2u);
  EXPECT_EQ(kept[0]["texts"][0]["language"], "x-klingon");
  ASSERT_EQ(compile({"--up", "z", "--annotations", folder_ / "own.json"}).exit_code, 0);
  const Json turned = notes();
  const Json info = Json::parse(run_command({TEXMESH_BINARY, "dump", package_, "--json"}).output)["object"];
  for (int axis = 0; axis < 3; ++axis) {  // (1, 1, 0.5) turned
    const double expected[] = {1, 0.5, -1};
    EXPECT_NEAR(turned[0]["position"][axis].get<double>() + info["origin"][axis].get<double>(),
                expected[axis], 1e-9);
  }
  EXPECT_EQ(run_command({TEXMESH_BINARY, "verify", package_}).exit_code, 0);
  ASSERT_EQ(compile({"--up", "keep"}).exit_code, 0);
  EXPECT_EQ(read_text(package_), without) << "without notes nothing is there of them";
}

TEST_F(CompileNotes, PointsOutsideAreToldAndTooManyRefused) {
  const CommandResult made = compile({"--up", "keep", "--verbose", "--annotations", folder_ / "own.json"});
  ASSERT_EQ(made.exit_code, 0) << made.errors;
  EXPECT_NE((made.output + made.errors).find("1 of 2 notes lie outside the object, the first is note 2"),
            std::string::npos)
      << made.output << made.errors;
  Json many = Json::array();
  for (int i = 0; i < 10'000; ++i) many.push_back({{"name", "A"}, {"position", {0, 0, 0}}});
  write_text(folder_ / "many.json", many.dump());
  const CommandResult refused = compile({"--annotations", folder_ / "many.json"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_NE(refused.errors.find("at most 1000 notes"), std::string::npos) << refused.errors;
  EXPECT_EQ(compile({"--annotations", folder_ / "none.json"}).exit_code, 2);
}

TEST_F(CompileNotes, VerifyDumpAndDoctorSayWhatCanBeTold) {
  const auto said = [&](const std::string& command) {
    const CommandResult r = run_command({TEXMESH_BINARY, command, package_});
    EXPECT_EQ(r.exit_code, 0) << r.errors;
    return r.output;
  };
  ASSERT_EQ(compile({"--up", "keep", "--annotations", folder_ / "own.json"}).exit_code, 0);
  EXPECT_NE(said("verify").find("; notes: 2, 1 outside the object)"), std::string::npos) << said("verify");
  EXPECT_NE(said("dump").find("notes     2, 1 outside the object\n"), std::string::npos);
  EXPECT_NE(said("doctor").find("notes: 2, 1 outside the object\n"), std::string::npos);
  ASSERT_EQ(compile({"--up", "keep", "--annotations", folder_ / "notes.json"}).exit_code, 0);
  const CommandResult r = run_command({TEXMESH_BINARY, "verify", package_, "--json"});
  EXPECT_EQ(Json::parse(r.output)["packages"][0]["notes"],
            (Json{{"count", 1}, {"outside", 1}, {"without_language", 1}}))
      << r.output;
  ASSERT_EQ(compile({"--up", "keep"}).exit_code, 0);
  EXPECT_EQ(said("verify").find("notes"), std::string::npos);
}

TEST_F(CompileNotes, ACollectionNamesThemForEachModel) {
  write_text(folder_ / "hut.obj", kTent);
  write_text(folder_ / "collection.json",
             R"({"version":1,"options":{"import":{"up":"keep"}},"models":[
               {"input":"tent.obj","annotations":"own.json"},{"input":"hut.obj"}]})");
  const std::string out = folder_ / "out";
  const CommandResult made = run_command({TEXMESH_BINARY, "compile", folder_ / "collection.json", "-o", out,
                                          "--no-cache", "--profile", folder_ / "profile.json"});
  ASSERT_EQ(made.exit_code, 0) << made.errors;
  package_ = out + "/tent.texmesh";
  EXPECT_EQ(notes().size(), 2u);
  package_ = out + "/hut.texmesh";
  EXPECT_EQ(notes().size(), 0u);
  const CommandResult list =
      run_command({TEXMESH_BINARY, "list", folder_ / "collection.json", "-o", out, "--json"});
  EXPECT_NE(list.output.find("own.json"), std::string::npos) << list.output << list.errors;
  write_text(folder_ / "collection.json",
             R"({"version":1,"models":[{"input":"tent.obj","annotations":"../none.json"}]})");
  EXPECT_EQ(run_command({TEXMESH_BINARY, "compile", folder_ / "collection.json", "-o", out}).exit_code, 2);
}

/// While it is compiled the archive becomes another one again and again, whole or cut; each package is one
/// state's, notes and all, or there is none.
TEST_F(CompileNotes, AnArchiveThatChangesGivesOneStateOrAnError) {
  const auto zip = [](const std::string& notes) {
    const Bytes bytes = zip_of({{"tent/tent.obj", kTent}, {"tent/annotations.json", notes}});
    return std::string(bytes.begin(), bytes.end());
  };
  const std::array<std::string, 2> states{zip(kNotes), zip(kOwnNotes)};
  std::array<std::string, 2> packages;
  for (std::size_t i = 0; i < 2; ++i) {
    write_text(folder_ / "tent.zip", states[i]);
    ASSERT_EQ(compile({"--up", "keep"}, "tent.zip").exit_code, 0);
    packages[i] = read_text(package_);
  }
  std::atomic<bool> over = false;
  std::thread writer([&] {
    for (std::size_t i = 0; !over; ++i)
      write_text(folder_ / "tent.zip",
                 states[i % 2].substr(0, i % 3 == 0 ? i % states[0].size() : states[0].npos));
  });
  int made = 0;
  for (int i = 0; i < 20; ++i) {
    std::filesystem::remove(package_);
    const CommandResult r = compile({"--up", "keep"}, "tent.zip");
    if (r.exit_code != 0) {
      EXPECT_FALSE(std::filesystem::exists(package_));
      continue;
    }
    ++made;
    const std::string package = read_text(package_);
    EXPECT_TRUE(package == packages[0] || package == packages[1]) << r.output << r.errors;
  }
  over = true;
  writer.join();
  write_text(folder_ / "tent.zip", states[0]);
  ASSERT_EQ(compile({"--up", "keep"}, "tent.zip").exit_code, 0);
  EXPECT_EQ(read_text(package_), packages[0]) << "after " << made << " packages";
}

TEST_F(CompileNotes, AnArchiveBringsItsNotes) {
  const auto archive = [&](const std::string& notes) {
    const Bytes zip = zip_of({{"tent/tent.obj", kTent}, {"tent/annotations.json", notes}});
    write_text(folder_ / "tent.zip", std::string(zip.begin(), zip.end()));
  };
  archive(kNotes);
  ASSERT_EQ(compile({"--up", "keep"}, "tent.zip").exit_code, 0);
  const Json list = notes();
  ASSERT_EQ(list.size(), 1u);
  EXPECT_EQ(list[0]["texts"][0]["text"], "<script>alert(1)</script>");
  const std::string first = read_text(package_);
  ASSERT_EQ(compile({"--up", "keep", "--annotations", folder_ / "own.json"}, "tent.zip").exit_code, 0);
  EXPECT_EQ(notes().size(), 2u) << "the user's notes win";
  archive("[]");
  const CommandResult told = compile({"--up", "keep", "--verbose"}, "tent.zip");
  EXPECT_EQ(told.exit_code, 0);
  EXPECT_NE((told.output + told.errors).find("the notes are left out"), std::string::npos) << told.output;
  EXPECT_EQ(notes().size(), 0u);
  archive(kNotes);
  ASSERT_EQ(compile({"--up", "keep"}, "tent.zip").exit_code, 0);
  EXPECT_EQ(read_text(package_), first);
}

TEST_F(CompileNotes, FilesHaveThemInTheirOwnCoordinates) {
  ASSERT_EQ(compile({"--up", "keep", "--annotations", folder_ / "own.json"}).exit_code, 0);
  const std::string glb = folder_ / "tent.glb";
  ASSERT_EQ(run_command({TEXMESH_BINARY, "extract", package_, "-o", glb}).exit_code, 0);
  const auto bytes = read_text(glb);
  const GlbParts parts = read_glb(text_bytes(bytes), glb);
  const auto& list = parts.root["extras"]["texmesh"]["annotations"];
  ASSERT_EQ(list.size(), 2u);
  EXPECT_NEAR(list[0]["position"][0].get<double>(), 0.01, 1e-9) << "centimetres become metres";
  EXPECT_NEAR(list[0]["position"][2].get<double>(), 0.005, 1e-9);
  const CommandResult small = run_command({TEXMESH_BINARY, "extract", package_, "-o", glb, "--bytes", "2kB"});
  EXPECT_NE((small.output + small.errors).find("the bytes do not hold the notes"), std::string::npos)
      << small.output;
  const std::string page = folder_ / "page";
  ASSERT_EQ(run_command(
                {TEXMESH_BINARY, "export", package_, "--to", "model-viewer", "--script", "x.js", "-o", page})
                .exit_code,
            0);
  const std::string html = read_text(page + "/index.html");
  EXPECT_NE(html.find("slot=\"hotspot-2\""), std::string::npos);
  EXPECT_NE(html.find("<div lang=\"x-klingon\"><h3>Top</h3>"), std::string::npos) << html;
}

TEST_F(CompileNotes, ScriptStaysText) {
  ASSERT_EQ(compile({"--up", "keep", "--annotations", folder_ / "notes.json"}).exit_code, 0);
  const std::string page = folder_ / "page";
  ASSERT_EQ(run_command(
                {TEXMESH_BINARY, "export", package_, "--to", "model-viewer", "--script", "x.js", "-o", page})
                .exit_code,
            0);
  const std::string html = read_text(page + "/index.html");
  EXPECT_EQ(html.find("<script>alert"), std::string::npos);
  EXPECT_NE(html.find("&lt;script&gt;alert(1)"), std::string::npos);
}

}  // namespace texmesh::testing::command_compile_notes_test
