// Every real scan of the data folder (TEXMESH_DATA, or shared/data beside the source tree) goes in, and a
// package that verifies comes out. The small ones always, all of them with tests/run --full; skipped where
// the folder is not there.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "tests/support/command.h"

namespace texmesh::testing::command_compile_real_scans_test {
namespace fs = std::filesystem;

fs::path data_folder() {
  if (const char* folder = std::getenv("TEXMESH_DATA")) return folder;
  return fs::path(TEXMESH_SOURCE_DIR) / "../shared/data";
}

bool is_model(const std::string& file) {
  const std::string extension = fs::path(file).extension();
  return extension == ".glb" || extension == ".gltf" || extension == ".obj" || extension == ".ply";
}

/// Largest model file that the short run takes.
constexpr std::uintmax_t kSmallBytes = 300'000;

TEST(RealScans, CompileAndVerify) {
  const fs::path data = data_folder();
  if (!fs::exists(data)) GTEST_SKIP() << "no real scans at " << data;
  const TemporaryFolder folder;
  int compiled = 0;
  for (const std::string& file : files_beneath(data.string())) {
    if (!is_model(file)) continue;
    if (!std::getenv("TEXMESH_FULL") && fs::file_size(data / file) > kSmallBytes) continue;
    const std::string package = folder / ("p" + std::to_string(compiled++) + ".texmesh");
    const CommandResult made = run_command(
        {TEXMESH_BINARY, "compile", (data / file).string(), "-o", package, "--no-cache"}, {}, "", 600);
    EXPECT_EQ(made.exit_code, 0) << file << ": " << made.output << made.errors;
    const CommandResult checked = run_command({TEXMESH_BINARY, "verify", package});
    EXPECT_EQ(checked.exit_code, 0) << file << ": " << checked.output;
    fs::remove(package);
  }
  EXPECT_GT(compiled, 0);
}

}  // namespace texmesh::testing::command_compile_real_scans_test
