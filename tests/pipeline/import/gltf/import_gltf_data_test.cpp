// The real scans beside the repository, where they are there.
#include <gtest/gtest.h>

#include <array>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <set>

#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"

namespace texmesh::import_gltf_data_test {

namespace fs = std::filesystem;

struct Expected {
  const char* file;
  std::size_t triangles, vertices, distinct, materials, images;  // distinct: positions that differ
};

class RealScan : public ::testing::TestWithParam<Expected> {};

TEST_P(RealScan, HasTheCountsOfItsIndex) {
  const char* folder = std::getenv("TEXMESH_DATA");
  const fs::path data = folder ? fs::path(folder) : fs::path(TEXMESH_SOURCE_DIR) / "../shared/data";
  const fs::path path = data / GetParam().file;
  if (!fs::exists(path)) GTEST_SKIP() << path << " is not here";
  const ImportOptions options;
  FileResolver resolver(path.parent_path());
  const ImportedModel m =
      import_gltf(path.filename().string(), read_input_file(path, 1u << 30), resolver, options, {});
  EXPECT_EQ(m.model.mesh.triangles.size(), GetParam().triangles);
  const Mesh& mesh = m.model.mesh;
  EXPECT_EQ(mesh.positions.size(), GetParam().vertices);
  std::set<std::array<float, 3>> distinct;
  for (const Vec3f& p : mesh.positions) distinct.insert({p.x, p.y, p.z});
  EXPECT_EQ(distinct.size(), GetParam().distinct);
  EXPECT_EQ(m.model.materials.size(), GetParam().materials);
  EXPECT_EQ(m.model.images.size(), GetParam().images);
  for (const Image& image : m.model.images) EXPECT_GT(image.bytes.size(), 100u) << image.name;
  for (const Note& n : m.model.notes) {
    EXPECT_EQ(n.severity, Severity::kInfo) << n.code << " " << n.place << " " << n.text;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Index, RealScan,
    ::testing::Values(
        Expected{"sea_turtle/sea_turtle.glb", 150000, 83111, 74998, 1, 3},
        Expected{"sea_turtle/original/sea_turtle-20k-thumb.glb", 20000, 12482, 9998, 1, 2},
        Expected{"sea_turtle/original/sea_turtle-150k-1024-low.glb", 150000, 83111, 74998, 1, 3},
        Expected{"sea_turtle/original/sea_turtle-150k-2048-medium.glb", 150000, 83111, 74998, 1, 3},
        Expected{"apple_4k/food_apple_01_4k.gltf", 7012, 4019, 3504, 1, 3},
        Expected{"flight_helmet/FlightHelmet.gltf", 94722, 55392, 47561, 6, 15},
        Expected{"saxophone/saxophone.glb", 100000, 72824, 48721, 1, 4},
        Expected{"saxophone/original/saxophone_draco.glb", 100000, 72824, 48721, 1, 4},
        Expected{"lee_perry_smith_head/LeePerrySmith.gltf", 17684, 9223, 8839, 1, 2},
        Expected{"lee_perry_smith_head/original/LeePerrySmith.draco.glb", 17684, 9223, 8839, 1, 0},
        Expected{"realitycapture_site/site.glb", 7472, 10338, 3687, 2, 2},
        Expected{"yurt/yurt.glb", 14298, 7522, 7306, 1, 1}),
    [](const auto& p) {
      std::string name = p.param.file;
      for (char& c : name) c = std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
      return name;
    });

}  // namespace texmesh::import_gltf_data_test
