// The real scans of shared/data (TEXMESH_DATA, or beside the source tree): counts of its INDEX.md. Skipped
// where the folder is not there: nothing of it is in the repository.
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>

#include <gtest/gtest.h>

#include "pipeline/import/import.h"
#include "stages/image/decode_image.h"
#include "tests/support/memory_resolver.h"

namespace texmesh::import_data_test {

using testing::count_notes;

std::filesystem::path data_folder() {
  if (const char* folder = std::getenv("TEXMESH_DATA")) return folder;
  return std::filesystem::path(TEXMESH_SOURCE_DIR) / "../shared/data";
}

Bytes read_file(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

class FolderResolver : public Resolver {
 public:
  explicit FolderResolver(std::filesystem::path folder) : folder_(std::move(folder)) {}
  std::optional<Bytes> read(const std::string& uri, std::uint64_t) override {
    if (!std::filesystem::is_regular_file(folder_ / uri)) return std::nullopt;
    return read_file(folder_ / uri);
  }

 private:
  std::filesystem::path folder_;
};

Model import_file(const std::filesystem::path& path) {
  FolderResolver resolver(path.parent_path());
  const Bytes bytes = read_file(path);
  return (path.extension() == ".obj" ? import_obj : import_ply)(path.filename(), bytes, resolver, {}, {})
      .model;
}

struct Expected {
  const char* file;
  std::size_t triangles, positions, positions_in_file, materials, images;
  bool uv, colours;
  const char* note;  // a code that must be there, "" = no warning at all
};

class ImportData : public ::testing::TestWithParam<Expected> {};

TEST_P(ImportData, CountsOfTheIndex) {
  const Expected& e = GetParam();
  const std::filesystem::path path = data_folder() / e.file;
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not there";
  const Model model = import_file(path);
  EXPECT_EQ(model.mesh.triangles.size(), e.triangles);
  EXPECT_EQ(model.mesh.positions.size(), e.positions_in_file);
  std::set<std::array<float, 3>> distinct;
  for (const Vec3f& p : model.mesh.positions) distinct.insert({p.x, p.y, p.z});
  EXPECT_EQ(distinct.size(), e.positions);
  EXPECT_EQ(model.materials.size(), e.materials);
  EXPECT_EQ(model.images.size(), e.images);
  EXPECT_EQ(!model.mesh.uv0.empty(), e.uv);
  EXPECT_EQ(!model.mesh.colours.empty(), e.colours);
  int warnings = 0;
  for (const Note& n : model.notes) {
    warnings += n.severity == Severity::kWarning;
    RecordProperty(n.code, n.place + ": " + n.text);
  }
  if (*e.note) {
    EXPECT_GE(count_notes(model, e.note), 1) << e.note;
  } else {
    EXPECT_EQ(warnings, 0);
  }
  for (const Image& image : model.images) EXPECT_EQ(decode_image(image).width_px, image.width_px);
}

INSTANTIATE_TEST_SUITE_P(
    All, ImportData,
    ::testing::Values(
        Expected{"marble_bust_4k/marble_bust_01_4k.obj", 17456, 8730, 8730, 1, 2, true, false, ""},
        Expected{"ycb_banana_4k/textured_simple_reoriented.obj", 15728, 7866, 7866, 1, 1, true, false, ""},
        Expected{"sterngarten/Sterngarten_Wien_innerArea.obj", 71673, 71772, 74445, 21, 14, true, false, ""},
        Expected{"fran_cyberware/fran_cut.obj", 4224, 2205, 2205, 1, 1, true, false, ""},
        Expected{"fran_cyberware/fran_cut.ply", 4224, 2205, 2205, 1, 1, true, false, ""},
        Expected{"realitycapture_site/site.obj", 7472, 3687, 10338, 2, 2, true, false, ""},
        Expected{"yurt/yurt_vertexcolours.ply", 14298, 7306, 7306, 1, 0, false, true, ""},
        Expected{"fuze_bottle/fuze.obj", 1000, 502, 502, 1, 1, true, false, ""},
        Expected{"fuze_bottle/fuze.ply", 1000, 502, 502, 1, 1, true, false, ""},
        Expected{"fuze_bottle/fuze_ascii.ply", 1000, 502, 502, 1, 1, true, false, "over-long-lines"},
        Expected{"asteroid_eros/eros.obj", 49152, 24578, 24993, 1, 1, true, false, ""},
        Expected{"demosthenes_photoscan/demosthenes-low-res.obj", 16719, 8394, 8394, 1, 0, false, false,
                 ""}));

// The malformed file gives the very mesh of the sound one, but for six-digit decimals.
TEST(ImportDataPairs, FuzeAsciiLosesNothing) {
  const std::filesystem::path folder = data_folder() / "fuze_bottle";
  if (!std::filesystem::exists(folder / "fuze_ascii.ply")) GTEST_SKIP();
  const Model a = import_file(folder / "fuze.ply");
  const Model b = import_file(folder / "fuze_ascii.ply");
  ASSERT_EQ(a.mesh.triangles.size(), b.mesh.triangles.size());
  for (std::size_t t = 0; t < a.mesh.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t wa = a.mesh.triangles[t][static_cast<std::size_t>(k)],
                          wb = b.mesh.triangles[t][static_cast<std::size_t>(k)];
      ASSERT_EQ(a.mesh.wedge_position[wa], b.mesh.wedge_position[wb]);
      ASSERT_NEAR(a.mesh.uv0[wa].x, b.mesh.uv0[wb].x, 1e-6);
      ASSERT_NEAR(a.mesh.uv0[wa].y, b.mesh.uv0[wb].y, 1e-6);
    }
}

TEST(ImportDataPairs, ObjAndPlyOfFranAgree) {
  const std::filesystem::path folder = data_folder() / "fran_cyberware";
  if (!std::filesystem::exists(folder / "fran_cut.ply")) GTEST_SKIP();
  const Model a = import_file(folder / "fran_cut.ply");
  const Model b = import_file(folder / "fran_cut.obj");
  ASSERT_EQ(a.mesh.triangles.size(), b.mesh.triangles.size());
  for (std::size_t t = 0; t < a.mesh.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2f ua = a.mesh.uv0[a.mesh.triangles[t][k]], ub = b.mesh.uv0[b.mesh.triangles[t][k]];
      ASSERT_NEAR(ua.x, ub.x, 1e-5);
      ASSERT_NEAR(ua.y, ub.y, 1e-5);
    }
}

}  // namespace texmesh::import_data_test
