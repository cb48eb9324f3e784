// The second reader (examples/reader, Python, written from format/SPEC.md alone) against the library over all
// golden packages of format 2, and both against packages that break one rule each.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "delivery/cpp/package/package_reader.h"
#include "format/base/errors.h"
#include "format/split/split_reader.h"
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/image/decode_image.h"
#include "tests/support/command.h"
#include "tools/inspect/verify/verify.h"

namespace texmesh::reader_test {

namespace fs = std::filesystem;
using testing::CommandResult;
using testing::TemporaryFolder;

const fs::path kSource = TEXMESH_SOURCE_DIR;

std::vector<std::string> golden_packages() {
  std::vector<std::string> paths;
  for (const auto& e : fs::directory_iterator(kSource / "tests" / "golden"))
    if (e.path().extension() == ".texmesh" && e.path().filename().string().starts_with("v2."))
      paths.push_back(e.path().string());
  std::sort(paths.begin(), paths.end());
  return paths;
}

/// A Python that has numpy and Pillow; "" where there is none.
std::string find_python() {
  for (const char* python : {"python3", "/usr/bin/python3"})
    if (testing::run_command({python, "-c", "import numpy, PIL"}).exit_code == 0) return python;
  return "";
}

struct SecondReader : ::testing::Test {
  static void SetUpTestSuite() { python = find_python(); }
  void SetUp() override {
    if (python.empty()) GTEST_SKIP() << "no Python with numpy and Pillow (python3-numpy, python3-pil)";
    if (golden_packages().empty()) GTEST_SKIP() << "no golden package of format 2";
  }
  static CommandResult run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(),
                     {python, (kSource / "examples" / "reader" / "texmesh_reader.py").string()});
    return testing::run_command(arguments, {"PYTHONDONTWRITEBYTECODE=1"});
  }
  static CommandResult check(std::vector<std::string> packages) {
    packages.insert(packages.begin(), "check");
    return run(std::move(packages));
  }
  static inline std::string python;
  TemporaryFolder folder;
};

SplitStreamReader decode_stream(PackageReader& package) {
  const std::vector<std::uint8_t> bytes = package.entry("mesh/stream.bin");
  SplitStreamReader reader(read_split_head(bytes));
  reader.read_to_scale(reader.head().scales.size() - 1, bytes);
  return reader;
}

/// What `mesh --raw` writes: whole numbers of points, wedges and faces.
std::string raw_numbers(const SplitMesh& mesh) {
  std::ostringstream out;
  for (const SplitMesh::Point& p : mesh.points()) out << "p " << p[0] << " " << p[1] << " " << p[2] << "\n";
  for (std::size_t w = 0; w < mesh.wedge_point().size(); ++w) {
    out << "w " << mesh.wedge_point()[w];
    for (std::size_t k = 0; k < mesh.attributes(); ++k) {
      const auto components = static_cast<std::size_t>(mesh.components(k));
      for (std::size_t c = 0; c < components; ++c) out << " " << mesh.values(k)[w * components + c];
    }
    out << "\n";
  }
  for (std::uint32_t f = 0; f < mesh.face_count(); ++f)
    out << "f " << mesh.wedge_at(f, 0) << " " << mesh.wedge_at(f, 1) << " " << mesh.wedge_at(f, 2) << " "
        << mesh.face_group()[f] << "\n";
  return out.str();
}

/// Numbers of the lines of an OBJ file that begin with `kind`.
std::vector<float> numbers_of(const std::string& obj, const std::string& kind) {
  std::istringstream lines(obj);
  std::vector<float> numbers;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string word;
    words >> word;
    if (word != kind) continue;
    while (words >> word) numbers.push_back(std::stof(word));
  }
  return numbers;
}

TEST_F(SecondReader, FindsNothingInGoldenPackages) {
  for (const std::string& path : golden_packages()) {
    const CommandResult result = check({path});
    EXPECT_EQ(result.exit_code, 0) << result.output;
  }
}

TEST_F(SecondReader, FindsNothingInTheGoldenTree) {
  const CommandResult result = check({(kSource / "tests" / "golden" / "v2.0-tree").string()});
  EXPECT_EQ(result.exit_code, 0) << result.output;
}

TEST_F(SecondReader, DecodesVerticesBitForBit) {
  for (const std::string& path : golden_packages()) {
    PackageReader package(open_store(path));
    if (!package.manifest().stream) continue;
    const SplitStreamReader stream = decode_stream(package);
    const SplitMesh& mesh = stream.mesh();
    ASSERT_EQ(run({"mesh", path, "--raw", "-o", folder / "raw"}).exit_code, 0) << path;
    EXPECT_EQ(testing::read_text(folder / "raw"), raw_numbers(mesh)) << path;
    ASSERT_EQ(run({"mesh", path, "-o", folder / "mesh.obj"}).exit_code, 0) << path;
    const std::string obj = testing::read_text(folder / "mesh.obj");
    const std::vector<float> positions = numbers_of(obj, "v"), normals = numbers_of(obj, "vn");
    const std::size_t wedges = mesh.wedge_point().size(), per_vertex = positions.size() / wedges;
    ASSERT_EQ(positions.size(), wedges * per_vertex);
    for (std::size_t w = 0; w < wedges; ++w)
      for (std::size_t axis = 0; axis < 3; ++axis)
        EXPECT_EQ(positions[w * per_vertex + axis],
                  stream.head().position.value(mesh.points()[mesh.wedge_point()[w]][axis], int(axis)));
    for (std::size_t k = 0; k < mesh.attributes(); ++k) {
      const SplitAttribute& attribute = stream.head().attributes[k];
      if (attribute.kind != SplitKind::kNormal) continue;
      ASSERT_EQ(normals.size(), 3 * wedges);
      for (std::size_t w = 0; w < wedges; ++w) {
        const auto expected =
            octahedral_normal(mesh.values(k)[2 * w], mesh.values(k)[2 * w + 1], attribute.grid.bits);
        for (std::size_t axis = 0; axis < 3; ++axis) EXPECT_EQ(normals[3 * w + axis], expected[axis]);
      }
    }
  }
}

/// Pictures of planes at all of their rungs, FOLDER/PLANE-RUNG.png, by one start of Python.
constexpr const char* kPictures = R"(
import sys
sys.path.insert(0, sys.argv[1])
from texmesh_reader import Model
model = Model(sys.argv[2])
for plane in map(int, sys.argv[4:]):
    for rung in range(len(model.textures[plane].rungQuality)):
        model.picture(plane, rung).save(f"{sys.argv[3]}/{plane}-{rung}.png", compress_level=1)
)";

TEST_F(SecondReader, DecodesTheSameTexels) {
  for (const std::string& path : golden_packages()) {
    PackageReader package(open_store(path));
    // Of 220 planes one in 19.
    const auto planes = static_cast<std::uint32_t>(package.textures().size());
    std::vector<std::string> command{
        python, "-c", kPictures, (kSource / "examples" / "reader").string(), path, folder / ""};
    for (std::uint32_t plane = 0; plane < planes; plane += 1 + planes / 12)
      command.push_back(std::to_string(plane));
    ASSERT_EQ(testing::run_command(command, {"PYTHONDONTWRITEBYTECODE=1"}).exit_code, 0);
    for (std::uint32_t plane = 0; plane < planes; plane += 1 + planes / 12) {
      const TextureInfo& t = package.textures()[plane];
      for (std::uint32_t rung = 0; rung < t.rungs.size(); ++rung) {
        const std::string text =
            testing::read_text(folder / (std::to_string(plane) + "-" + std::to_string(rung) + ".png"));
        const Pixels whole = decode_image(probe_image("plane.png", {text.begin(), text.end()}, {}));
        ASSERT_EQ(whole.width_px, t.width_px);
        for (const std::uint16_t f : package.tables().planes[plane].order) {
          const Pixels part = decode_fragment_file(t.codec, package.complete_fragment(plane, rung, f),
                                                   std::uint64_t{t.fragment_width_px} * t.fragment_height_px);
          const std::uint32_t left = f % t.columns * t.fragment_width_px,
                              top = f / t.columns * t.fragment_height_px;
          std::size_t others = 0;
          for (std::uint32_t y = 0; y < part.height_px && top + y < t.height_px; ++y)
            for (std::uint32_t x = 0; x < part.width_px && left + x < t.width_px; ++x)
              others += !std::equal(part.at(x, y), part.at(x, y) + t.channels, whole.at(left + x, top + y));
          EXPECT_EQ(others, 0u) << path << " plane " << plane << " rung " << rung << " fragment " << f;
        }
      }
    }
  }
  EXPECT_EQ(run({"picture", golden_packages().front(), "-o", folder / "highest.png"}).exit_code, 0);
}

TEST_F(SecondReader, TellsTheSameDigests) {
  for (const std::string& path : golden_packages()) {
    PackageReader package(open_store(path));
    const std::string info = run({"info", path}).output;
    EXPECT_NE(info.find("id " + to_hex(package.id()) + "\n"), std::string::npos) << path;
    for (const EntryRef& e : package.index()) {
      const std::string line = to_hex(e.digest) + " " + std::to_string(e.offset) + " " +
                               std::to_string(e.bytes) + " " + e.path + "\n";
      EXPECT_NE(info.find(line), std::string::npos) << line;
    }
  }
}

/// verify_package has a finding that names this rule.
void expect_verify_names(const std::string& path, const std::string& rule) {
  std::string found;
  try {
    for (const Finding& f : verify_package(*open_store(path), {}).findings) {
      if (f.rule == rule) return;
      found += "\n  " + to_string(f);
    }
  } catch (const Error& e) {
    if (rule_of(e) == rule) return;
    found += std::string("\n  ") + e.what();
  }
  ADD_FAILURE() << path << ": texmesh verify does not name " << rule << ", but:" << found;
}

/// Invalid packages of every case: of the golden with most in it, of others where that one has nothing to
/// break.
const std::vector<std::string>& invalid_packages(const std::string& python) {
  static const TemporaryFolder made;
  static std::vector<std::string> paths;
  if (!paths.empty()) return paths;
  const std::string folder = made / "invalid";
  const fs::path golden = kSource / "tests" / "golden";
  const std::string script = (golden / "make_invalid").string();
  const auto make = [&](const char* name, std::vector<std::string> cases) {
    cases.insert(cases.begin(), {python, script, (golden / name).string(), folder});
    EXPECT_EQ(testing::run_command(cases, {"PYTHONDONTWRITEBYTECODE=1"}).exit_code, 0) << name;
  };
  make("v2.0-scan.texmesh", {});
  make("v2.0-webp.texmesh", {"F07-no-webp", "R05-codec-without-feature"});
  make("v2.0-progressive.texmesh", {"F06-ends-with-ff"});
  make("v2.0-source.texmesh", {"O02-damaged-source"});
  std::istringstream cases(testing::run_command({python, script, "--list"}).output);
  for (std::string name; cases >> name;) {
    paths.push_back(folder + "/" + name + ".texmesh");
    EXPECT_TRUE(fs::exists(paths.back())) << "no golden package can show " << name;
  }
  return paths;
}

TEST_F(SecondReader, RefusesByTheRuleThatIsBrokenAndSoDoesVerify) {
  const std::vector<std::string>& arguments = invalid_packages(python);
  EXPECT_GT(arguments.size(), 150u);
  const std::string told = check(arguments).output;
  for (const std::string& path : arguments) {
    const std::string rule = fs::path(path).filename().string().substr(0, 3);
    const std::size_t line = told.find(path + ": ");
    EXPECT_NE(told.find(path + ": refused: " + rule + ": "), std::string::npos)
        << path << ": "
        << (line == std::string::npos ? told : told.substr(line, told.find('\n', line) - line));
    expect_verify_names(path, rule);
  }
}

TEST_F(SecondReader, InvalidPackagesBreakOneRuleEach) {
  const CommandResult result =
      testing::run_command({python, (kSource / "tests" / "golden" / "check_invalid").string(),
                            fs::path(invalid_packages(python).front()).parent_path().string()},
                           {"PYTHONDONTWRITEBYTECODE=1"}, "", 900);
  EXPECT_EQ(result.exit_code, 0) << result.errors;
}

/// All that PackageReader reads, except measurements.
void read_everything(const std::string& path) {
  PackageReader package(open_store(path));
  package.index();
  package.quality();
  package.about();
  package.annotations();
  package.plane_thesis(0);
  for (std::uint32_t plane = 0; plane < package.textures().size(); ++plane) {
    const TextureInfo& t = package.textures()[plane];
    package.preview(plane);
    for (std::uint32_t rung = 0; rung < t.rungs.size(); ++rung)
      for (const std::uint16_t f : package.tables().planes[plane].order)
        package.complete_fragment(plane, rung, f);
  }
  for (const ManifestScale& s : package.manifest().scales)
    s.has_glb() ? package.scale_glb(s.scale) : package.split_prefix(s.scale);
  if (!package.manifest().stream) return;
  package.split_stream_head();
  decode_stream(package);
}

/// Names of invalid packages that PackageReader cannot see anything of: container, GLBs, pictures,
/// measurements.
bool is_seen_by_checkers_only(const std::string& name) {
  static const std::set<std::string> rules{
      "K01", "K02", "K03", "K04", "K05", "K06", "K07", "K08", "K09", "K10", "E01", "E03", "E04",
      "J02", "J10", "M04", "M07", "M12", "M13", "M16", "M20", "M22", "I08", "X08", "T11", "T12",
      "F08", "F10", "F12", "F13", "F16", "G01", "G02", "G04", "G05", "G06", "G07", "G09", "G10",
      "G13", "G14", "G15", "H02", "H03", "H04", "S21", "S23", "Q02", "B03", "O01", "O02", "O06"};
  return name == "R03-no-mesh" || rules.contains(name.substr(0, 3));
}

TEST_F(SecondReader, ClientsRefuseByTheRuleThatIsBroken) {
  for (const fs::path path : invalid_packages(python)) {
    const std::string name = path.stem().string();
    if (is_seen_by_checkers_only(name)) continue;
    try {
      read_everything(path.string());
      ADD_FAILURE() << name << " is read";
    } catch (const Error& error) {
      EXPECT_TRUE(std::string(error.what()).ends_with("[" + name.substr(0, 3) + "]"))
          << name << ": " << error.what();
    }
  }
}

TEST_F(SecondReader, ReadsALaterMinorVersionWithAZip64EndRecord) {
  const fs::path tests = kSource / "tests" / "golden";
  const std::string package = folder / "later.texmesh";
  ASSERT_EQ(testing::run_command(
                {python, (tests / "make_later").string(), (tests / "v2.0-webp.texmesh").string(), package})
                .exit_code,
            0);
  const CommandResult result = check({package});
  EXPECT_EQ(result.exit_code, 0) << result.output;
  const VerifyReport report = verify_package(*open_store(package), {});
  for (const Finding& f : report.findings) ADD_FAILURE() << to_string(f);
  EXPECT_EQ(report.entries, 65534u);  // the content credential is the last
  EXPECT_TRUE(report.content_credential);
}

TEST_F(SecondReader, FindsDamageEverywhere) {
  const std::string whole = testing::read_text((kSource / "tests" / "golden" / "v2.0-webp.texmesh").string());
  std::vector<std::string> arguments;
  const auto add = [&](const std::string& bytes) {
    arguments.push_back(folder / std::to_string(arguments.size()) + ".texmesh");
    testing::write_text(arguments.back(), bytes);
  };
  for (std::size_t at = 0; at < whole.size(); at += 499) {
    add(whole.substr(0, at));
    std::string flipped = whole;
    flipped[at] = static_cast<char>(flipped[at] ^ 0x20);
    add(flipped);
  }
  const std::string told = check(arguments).output;
  for (const std::string& path : arguments)
    EXPECT_NE(told.find(path + ": refused: "), std::string::npos) << path << told.substr(0, 400);
}

TEST_F(SecondReader, AcceptsOrRefusesWhateverComes) {
  const CommandResult result = testing::run_command(
      {python, (kSource / "tests" / "fuzz" / "check_reader").string(), "--runs", "300"}, {}, "", 600);
  EXPECT_EQ(result.exit_code, 0) << result.output << result.errors;
}

TEST_F(SecondReader, ReadsTheTreeAsWell) {
  const std::string texmesh = TEXMESH_BINARY;
  for (const std::string& golden : golden_packages()) {
    const std::string tree = folder / fs::path(golden).stem().string();
    ASSERT_EQ(testing::run_command({texmesh, "unpack", golden, "-o", tree}).exit_code, 0);
    EXPECT_EQ(check({tree}).exit_code, 0) << golden;
    EXPECT_EQ(run({"mesh", tree, "--raw", "-o", folder / "tree.raw"}).exit_code, 0);
    EXPECT_EQ(run({"mesh", golden, "--raw", "-o", folder / "container.raw"}).exit_code, 0);
    EXPECT_EQ(testing::read_text(folder / "tree.raw"), testing::read_text(folder / "container.raw"))
        << golden;
  }
}

}  // namespace texmesh::reader_test
