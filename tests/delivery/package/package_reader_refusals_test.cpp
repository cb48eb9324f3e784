#include <gtest/gtest.h>

#include <functional>
#include <ostream>

#include "delivery/cpp/package/package_reader.h"
#include "format/base/errors.h"
#include "format/container/layout.h"
#include "format/split/split_writer.h"
#include "tests/format/container/package_fixture.h"
#include "tests/format/split/split_fixture.h"
#include "tests/support/packages.h"

namespace texmesh::package_reader_refusals_test {

using testing::PackageParts;
using testing::PackagePatcher;

/// Documents that do not fit each other, by the number of the rule in SPEC.md. Digests are right throughout:
/// whoever makes such a package on purpose writes them, too.
struct Refusal {
  const char* rule;
  const char* says;  // part of the error's text
  std::function<Bytes()> package;
};
void PrintTo(const Refusal& r, std::ostream* out) { *out << r.rule << ": " << r.says; }

/// With a stream of splits, a poster and tables of the thesis.
PackageParts whole_parts() {
  PackageParts p = testing::make_package_parts();
  p.streams[kSplitStreamPath] = write_split_stream(testing::split_fixture(3).source);
  p.streams[kPosterPath] = Bytes(100, 1);
  p.manifest.poster = PosterRef{{}, 64, 48};
  return p;
}

std::function<Bytes()> built(const std::function<void(PackageParts&)>& change) {
  return [change] {
    PackageParts p = whole_parts();
    change(p);
    return p.build();
  };
}
std::function<Bytes()> sealed(const std::function<void(Manifest&)>& change) {
  return [change] { return PackagePatcher(whole_parts().build()).seal(change).package(); };
}
std::function<Bytes()> edited(const char* path, const std::function<void(Bytes&)>& change) {
  return [=] { return PackagePatcher(whole_parts().build()).edit(path, change).seal().package(); };
}
/// Another path, as long, in the index.
std::function<Bytes()> renamed(const std::string& from, const std::string& to) {
  return [=] {
    const auto rename = [&](std::vector<EntryRef>& index) {
      for (EntryRef& e : index)
        if (e.path == from) e.path = to;
    };
    return PackagePatcher(whole_parts().build()).seal_index(rename).package();
  };
}

std::vector<Refusal> refusals() {
  const auto later_minor = [](Bytes& b) { b[6] = 1; };
  const auto other = [](EntryRef& ref) { ref.digest[0] ^= 1; };
  std::vector<Refusal> all{
      {"R1", "index.bin", sealed([](Manifest& m) { m.minor = 1; })},
      {"R1", "tables.bin", edited(kTablesPath, later_minor)},
      {"R1", "thesis.bin", edited(kThesisPath, later_minor)},
      {"R2", "head of index.bin", sealed([](Manifest& m) { m.index.head_bytes = 16; })},
      {"R2", "head of index.bin", sealed([](Manifest& m) { m.index.head_digest[0] ^= 1; })},
      {"R2", "head of tables.bin", sealed([](Manifest& m) { m.tables.head_digest[0] ^= 1; })},
      {"R3", "manifest.json, /tables", sealed([=](Manifest& m) { other(m.tables); })},
      {"R3", "manifest.json, /textures", sealed([=](Manifest& m) { other(m.textures); })},
      {"R3", "manifest.json, /quality", sealed([=](Manifest& m) { other(m.quality); })},
      {"R3", "manifest.json, /provenance", sealed([=](Manifest& m) { other(m.provenance); })},
      {"R3", "manifest.json, /about", sealed([=](Manifest& m) { other(m.about); })},
      {"R3", "manifest.json, /thesis", sealed([=](Manifest& m) { other(*m.thesis); })},
      {"R3", "manifest.json, /poster", sealed([=](Manifest& m) { other(*m.poster); })},
      {"R3", "manifest.json, /scales/offset/1", sealed([=](Manifest& m) { other(m.scales[1].glb); })},
      {"R3", "manifest.json, /scales/offset/0", sealed([](Manifest& m) { m.scales[0].glb.bytes += 1; })},
      {"R3", "manifest.json, /stream", sealed([](Manifest& m) { m.stream->offset += 64; })},
      {"R4", "textures.json", sealed([](Manifest& m) { m.plane_count = 2; })},
      {"R4", "tables.bin", built([](PackageParts& p) { p.tables.planes.push_back(p.tables.planes[0]); })},
      {"R5", "codec-webp", built([](PackageParts& p) { p.textures[0].codec = Codec::kWebp; })},
      {"R7", "preview/000.jpg", renamed(preview_path(0), "preview/009.jpg")},
      {"R7", "texture/0/r01.pack", renamed(rung_path(0, 1), rung_path(0, 9))},
      {"R7", "texture/0/tables.pack", renamed(table_streams_path(0), "texture/0/tables_pack")},
      {"R8", "plane 0, grid", built([](PackageParts& p) {
         p.textures[0].fragment_width_px = 64;
         p.textures[0].columns = 1;
       })},
      {"R8", "plane 0, grid", built([](PackageParts& p) {
         p.textures[0].fragment_height_px = 48;
         p.textures[0].rows = 1;
       })},
      {"R9", "rungs of the qualities in textures.json", built([](PackageParts& p) {
         p.textures[0].rung_quality = {20, 71};
       })},
      {"R10", "plane 0, incremental", built([](PackageParts& p) { p.tables.planes[0].incremental = true; })},
      {"R11", "plane 0, scales", built([](PackageParts& p) { p.tables = select_scales(p.tables, {0}); })},
      {"R12", "tables.pack", built([](PackageParts& p) { p.tables.planes[0].table_bytes[1] += 1; })},
      {"R13", "r00.pack", built([](PackageParts& p) { p.tables.planes[0].size_bytes[0] += 1; })},
      {"R14", "/scales", built([](PackageParts& p) {
         p.quality.scales = {0, 6};
       })},
      {"R15", "/groups", built([](PackageParts& p) { p.quality.groups.clear(); })},
      {"R15", "/groups", built([](PackageParts& p) { p.quality.groups[0].group = PlaneGroup::kNormal; })},
      {"R16", "planes of the package",
       built([](PackageParts& p) { p.thesis.planes.push_back(p.thesis.planes[0]); })},
      {"R16", "predictors of the plane's fragments", built([](PackageParts& p) {
         PlaneThesis& t = p.thesis.planes[0];
         for (auto* v : {&t.z, &t.i, &t.zeta, &t.m, &t.vqp}) v->pop_back();
       })},
      {"R16", "sizes of all scales", built([](PackageParts& p) {
         p.thesis.planes[0].quality.resize(5);
         p.thesis.planes[0].total_bytes.resize(5 * kGammaSteps);
       })},
  };
  return all;
}

void read_documents(const Bytes& package) {
  PackageReader reader(open_container(memory_source(package)));
  reader.index();
  reader.textures();
  reader.tables();
  reader.quality();
  reader.plane_thesis(0);
}

struct Refusals : ::testing::TestWithParam<Refusal> {};

TEST_P(Refusals, TheReaderSaysWhatDoesNotFit) {
  const Bytes package = GetParam().package();
  try {
    read_documents(package);
    FAIL() << "was read";
  } catch (const FormatError& e) {
    EXPECT_NE(std::string(e.what()).find(GetParam().says), std::string::npos) << e.what();
  }
}

INSTANTIATE_TEST_SUITE_P(All, Refusals, ::testing::ValuesIn(refusals()), [](const auto& test) {
  return std::string(test.param.rule) + "_" + std::to_string(test.index);
});

TEST(Refusals, TheUnchangedPackageIsRead) {
  EXPECT_NO_THROW(read_documents(whole_parts().build()));
  EXPECT_NO_THROW(read_documents(sealed({})()));
  EXPECT_NO_THROW(read_documents(testing::make_package(2)));
}

}  // namespace texmesh::package_reader_refusals_test
