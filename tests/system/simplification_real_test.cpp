// Simplification of the real scans on which other tools open cracks: several materials and open borders, a
// fragmented atlas with non-manifold edges, an atlas of scraps. Skipped where the data folder (TEXMESH_DATA,
// or shared/data beside the source tree) is not there.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "tests/stages/simplification/simplification_checks.h"

namespace texmesh::testing::simplification_real_test {
namespace fs = std::filesystem;

fs::path data_folder() {
  if (const char* folder = std::getenv("TEXMESH_DATA")) return folder;
  return fs::path(TEXMESH_SOURCE_DIR) / "../shared/data";
}

void expect_no_cracks(const char* file, double left) {
  const fs::path path = data_folder() / file;
  if (!fs::exists(path)) GTEST_SKIP() << "no real scan at " << path;
  std::ifstream in(path, std::ios::binary);
  const std::vector<char> text{std::istreambuf_iterator<char>(in), {}};
  const std::vector<std::uint8_t> bytes(text.begin(), text.end());
  FileResolver resolver(path.parent_path());
  const Mesh mesh = import_model(path.filename(), bytes, resolver, {}, kOneThread).model.mesh;
  const NestedScales scales = run(condition_mesh(mesh, true, {}, kOneThread), {.min_triangles = 100}, 6);
  expect_sound(scales);
  EXPECT_LT(static_cast<double>(scales.scales.back().triangles.size()),
            left * static_cast<double>(scales.scales[0].triangles.size()));
}

TEST(SimplificationOfRealScans, Site) { expect_no_cracks("realitycapture_site/site.glb", 0.4); }
TEST(SimplificationOfRealScans, FlightHelmet) { expect_no_cracks("flight_helmet/FlightHelmet.gltf", 0.1); }
TEST(SimplificationOfRealScans, Saxophone) { expect_no_cracks("saxophone/saxophone.glb", 0.12); }
TEST(SimplificationOfRealScans, Yurt) { expect_no_cracks("yurt/yurt.glb", 0.1); }

}  // namespace texmesh::testing::simplification_real_test
