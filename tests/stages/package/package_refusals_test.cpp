// Inputs and entries that a package must not be made of.
#include <gtest/gtest.h>

#include "tests/stages/package/package_inputs.h"

namespace texmesh::package_refusals_test {

using namespace testing;  // NOLINT: fixtures

TEST(Package, NamesFromTheSourceAreMadeSafe) {
  Inputs inputs(1);
  inputs.images[0].name = "a\xff\x1b[2J\xc3\xa4\xed\xa0\x80" + std::string(300, 'x');
  const Bytes package = inputs.assemble();
  const std::string name = read_textures(part(package, manifest_of(package).textures))[0].name;
  EXPECT_EQ(name.substr(0, 11), "a\x3f\x3f[2J\xc3\xa4\x3f\x3f\x3f");
  EXPECT_EQ(name.size(), 200u);
}

TEST(Package, InputsThatDoNotBelongTogetherAreRefused) {
  const auto refused = [](auto change) {
    Inputs inputs(1);
    change(inputs);
    EXPECT_THROW(inputs.assemble(), StageError);
  };
  refused([](Inputs& i) { i.perceptual.p95.pop_back(); });
  refused([](Inputs& i) { i.files.files.clear(); });
  refused([](Inputs& i) { i.files.files[0].scale = 5; });
  refused([](Inputs& i) { i.files.files.erase(i.files.files.begin()); });
  refused([](Inputs& i) { i.ladder.planes.clear(); });
  refused([](Inputs& i) { i.previews.planes.clear(); });
  refused([](Inputs& i) { i.ladder.planes[0].rungs.pop_back(); });
  refused([](Inputs& i) { i.ladder.planes[0].rungs[1].offset.pop_back(); });
  refused([](Inputs& i) { i.ladder.planes[0].rungs[1].offset[3] += 1; });
  refused([](Inputs& i) { i.ladder.planes[0].rungs[1].table_stream.pop_back(); });
  refused([](Inputs& i) { i.ladder.planes[0].rungs[1].quality += 1; });
  refused([](Inputs& i) { i.images.clear(); });
  Inputs long_title(1);
  long_title.options.title = std::string(201, 'a');
  EXPECT_THROW(long_title.assemble(), FormatError);
}

TEST(Package, WriterRefusesMissingAndForeignEntries) {
  const Bytes package = Inputs(1).assemble();
  const Manifest m = manifest_of(package);
  const auto textures = read_textures(part(package, m.textures));
  std::vector<PackageEntry> files;
  for (const EntryRef& e : read_index(part(package, m.index)))
    if (e.path != kTexturesPath) files.push_back({e.path, part(package, e)});
  EXPECT_EQ(write_package(m, textures, files), package);
  for (std::size_t i = 0; i < files.size(); ++i) {
    auto fewer = files;
    fewer.erase(fewer.begin() + static_cast<std::ptrdiff_t>(i));
    if (files[i].path == kThesisPath) {  // not every package has it
      EXPECT_FALSE(manifest_of(write_package(m, textures, fewer)).thesis.has_value());
      continue;
    }
    EXPECT_THROW(write_package(m, textures, fewer), FormatError) << files[i].path;
  }
  auto more = files;
  more.push_back({"extra/later.bin", {1, 2, 3}});  // a later minor version may have entries of its own
  EXPECT_EQ(read_container(*memory_source(write_package(m, textures, more))).size(), files.size() + 4);
  more.back().path = "Extra";
  EXPECT_THROW(write_package(m, textures, more), FormatError);
  more.back().path = kManifestPath;
  EXPECT_THROW(write_package(m, textures, more), FormatError);
}

}  // namespace texmesh::package_refusals_test
