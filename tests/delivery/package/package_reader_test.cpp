#include "delivery/cpp/package/package_reader.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <utility>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "tests/format/container/package_fixture.h"

namespace texmesh::package_reader_test {

namespace fs = std::filesystem;
using testing::fake_fragment;
using testing::fake_jpeg;
using testing::make_package;
PackageReader open_memory(Bytes package) {
  return PackageReader(open_container(memory_source(std::move(package))));
}

/// Counts what is read from a package.
class CountingSource final : public ByteSource {
 public:
  CountingSource(const Bytes& bytes, std::vector<std::pair<std::uint64_t, std::uint64_t>>& reads)
      : source_(memory_source(bytes)), reads_(reads) {}
  std::uint64_t size() override { return source_->size(); }
  Bytes read(std::uint64_t offset, std::uint64_t bytes) override {
    reads_.emplace_back(offset, bytes);
    return source_->read(offset, bytes);
  }

 private:
  std::unique_ptr<ByteSource> source_;
  std::vector<std::pair<std::uint64_t, std::uint64_t>>& reads_;
};

class Folder {
 public:
  Folder()
      : path_(fs::temp_directory_path() /
              ("texmesh_reader_" + std::to_string(::getpid()) + "_" + std::to_string(++count_))) {
    fs::create_directories(path_);
  }
  ~Folder() { fs::remove_all(path_); }
  std::string path() const { return path_.string(); }
  fs::path operator/(const std::string& name) const { return path_ / name; }
  void write(const std::string& name, const Bytes& bytes) const {
    fs::create_directories((path_ / name).parent_path());
    std::ofstream(path_ / name, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  }
  void unpack(const Bytes& package) const {
    const auto source = memory_source(package);
    for (const ContainerEntry& e : read_container(*source)) write(e.path, source->read(e.offset, e.bytes));
  }

 private:
  static inline int count_ = 0;
  fs::path path_;
};

/// Asks for everything that a package offers.
void read_everything(PackageReader& reader) {
  for (const EntryRef& e : reader.index()) reader.entry(e);
  for (const ManifestScale& s : reader.manifest().scales) reader.scale_glb(s.scale);
  reader.quality();
  for (std::uint32_t p = 0; p < reader.textures().size(); ++p) {
    reader.preview(p);
    const PlaneTables& t = reader.tables().planes[p];
    for (std::uint32_t r = 0; r < t.rung_count(); ++r)
      for (const std::uint16_t f : t.order) reader.complete_fragment(p, r, f);
  }
}

void expect_contents(PackageReader& reader) {
  ASSERT_EQ(reader.textures().size(), 2u);
  EXPECT_EQ(reader.scale_glb(4), Bytes(200, 4));
  EXPECT_EQ(reader.preview(1), fake_jpeg(40, 'p'));
  const PlaneTables& t = reader.tables().planes[1];
  EXPECT_EQ(reader.table_stream(1, 1), fake_jpeg(21, 'u'));
  for (std::uint32_t r = 0; r < 2; ++r)
    for (std::uint32_t f = 0; f < 2; ++f) EXPECT_EQ(reader.fragment(1, r, f), fake_fragment(t, r, f));
  Bytes joined = fake_jpeg(20, 't');
  joined.resize(18);
  const Bytes fragment = fake_fragment(t, 0, 1);
  joined.insert(joined.end(), fragment.begin() + 2, fragment.end());
  EXPECT_EQ(reader.complete_fragment(1, 0, 1), joined);
  EXPECT_EQ(reader.quality().scales, (std::vector<int>{0, 4, 9}));
  read_everything(reader);
}

TEST(PackageReader, ReadsContainerAndTreeAlike) {
  const Bytes package = make_package(2);
  PackageReader container = open_memory(package);
  expect_contents(container);
  const Folder folder;
  folder.unpack(package);
  PackageReader tree(open_store(folder.path()));
  EXPECT_TRUE(tree.store().is_folder());
  expect_contents(tree);
  EXPECT_EQ(tree.id(), container.id());
  EXPECT_EQ(tree.index(), container.index());
  const auto listed = tree.store().list();
  EXPECT_EQ(listed.size(), container.store().list().size());
  EXPECT_TRUE(std::ranges::is_sorted(listed, {}, &ContainerEntry::path));
  const Folder other;
  other.write("p.texmesh", package);
  PackageReader file(open_store((other / "p.texmesh").string()));
  EXPECT_FALSE(file.store().is_folder());
  expect_contents(file);
}

TEST(PackageReader, UntexturedPackage) {
  PackageReader reader = open_memory(make_package(0));
  EXPECT_TRUE(reader.textures().empty());
  EXPECT_TRUE(reader.tables().planes.empty());
  read_everything(reader);
  EXPECT_THROW(reader.preview(0), FormatError);
}

TEST(PackageReader, OneReadBootstrapsAndNothingIsReadUnasked) {
  const Bytes package = make_package(2, 20000);
  std::vector<std::pair<std::uint64_t, std::uint64_t>> reads;
  PackageReader reader(open_container(std::make_unique<CountingSource>(package, reads)));
  ASSERT_EQ(reads.size(), 1u);
  EXPECT_EQ(reads[0], std::pair(std::uint64_t{0}, kBootstrapBytes));
  reader.scale_glb(9);
  ASSERT_EQ(reads.size(), 2u);
  EXPECT_EQ(reads[1].first, reader.manifest().scales.back().glb.offset);
  reader.textures();
  reader.tables();
  reader.table_stream(0, 0);
  const std::size_t before = reads.size();
  reader.complete_fragment(0, 1, 0);
  EXPECT_EQ(reads.size(), before + 1);  // the fragment alone
  EXPECT_EQ(reads.back().second, reader.fragment_range(0, 1, 0).bytes);
}

TEST(PackageReader, QuestionsOutOfRangeAreRefused) {
  PackageReader reader = open_memory(make_package(1));
  EXPECT_THROW(reader.scale_glb(1), InputError);
  EXPECT_THROW(reader.preview(1), FormatError);
  EXPECT_THROW(reader.table_stream(0, 2), FormatError);
  EXPECT_THROW(reader.table_stream(1, 0), FormatError);
  EXPECT_THROW(reader.fragment(0, 2, 0), FormatError);
  EXPECT_THROW(reader.fragment(0, 0, 2), FormatError);
  EXPECT_THROW(reader.fragment(1, 0, 0), FormatError);
  EXPECT_THROW(reader.entry("nothing"), FormatError);
  const EntryRef entry = reader.find(kQualityPath);
  EXPECT_THROW(reader.store().read(entry, 0, entry.bytes + 1), FormatError);
  EXPECT_THROW(reader.store().read(entry, entry.bytes + 1, 0), FormatError);
  EXPECT_THROW(reader.store().read(entry, 1, ~std::uint64_t{0}), FormatError);
}

TEST(PackageReader, EveryTruncationIsNoticed) {
  const Bytes package = make_package(1);
  for (std::size_t n = 0; n < package.size(); n += 1) {
    const Bytes shorter(package.begin(), package.begin() + static_cast<std::ptrdiff_t>(n));
    EXPECT_THROW(
        {
          PackageReader reader = open_memory(shorter);
          reader.store().list();
        },
        FormatError)
        << n;
  }
}

/// A flipped bit is either in what list() checks (headers, padding), or in data that a digest covers.
TEST(PackageReader, EveryFlippedByteIsNoticed) {
  const Bytes package = make_package(1);
  for (std::size_t i = 0; i < package.size(); ++i) {
    Bytes damaged = package;
    damaged[i] = static_cast<std::uint8_t>(damaged[i] ^ (1 << i % 8));
    try {
      PackageReader reader = open_memory(damaged);
      reader.store().list();
      // The manifest is covered by no digest inside the package: its hash is the package's name.
      if (reader.id() != open_memory(package).id()) continue;
      read_everything(reader);
      ADD_FAILURE() << "byte " << i << " was changed and nobody noticed";
    } catch (const FormatError&) {
    }
  }
}

/// A package whose second plane is a mip of the first.
Bytes package_with_mip() {
  const Bytes package = make_package(2);
  PackageReader reader = open_memory(package);
  std::vector<TextureInfo> textures = reader.textures();
  TextureInfo& mip = textures[1];
  mip.image = 0, mip.mip = 1, mip.base = 0;
  mip.width_px = 250, mip.height_px = 128, mip.fragment_width_px = mip.fragment_height_px = 128;
  std::vector<PackageEntry> entries;
  for (const EntryRef& e : reader.index())
    if (e.path != kTexturesPath && e.path != preview_path(1)) entries.push_back({e.path, reader.entry(e)});
  Manifest m = reader.manifest();
  return write_package(m, textures, entries);
}

TEST(PackageReader, MipsArePlanesWithTheirBasesPreview) {
  PackageReader reader = open_memory(package_with_mip());
  EXPECT_TRUE(reader.manifest().required_features.empty());
  EXPECT_EQ(reader.preview(1), reader.preview(0));
  read_everything(reader);
}

TEST(PackageReader, DocumentsMustAgree) {
  const Bytes package = make_package(1);
  const auto source = memory_source(package);
  // Replaces entries, lays the package out anew with fitting digests, and reads everything.
  const auto refused = [&](auto change) {
    PackageReader reader = open_memory(package);
    Manifest m = reader.manifest();
    std::vector<TextureInfo> textures = reader.textures();
    PackageTables tables = reader.tables();
    std::map<std::string, Bytes> files;
    for (const EntryRef& e : reader.index())
      if (e.path != kTexturesPath) files[e.path] = reader.entry(e);
    change(m, textures, tables, files);
    if (files.contains(kTablesPath)) files[kTablesPath] = write_tables(tables);
    std::vector<PackageEntry> entries;
    for (const auto& [path, bytes] : files) entries.push_back({path, bytes});
    const Bytes changed = write_package(m, textures, entries);
    PackageReader again = open_memory(changed);
    EXPECT_THROW(read_everything(again), FormatError);
  };
  using M = Manifest&;
  using T = std::vector<TextureInfo>&;
  using P = PackageTables&;
  using F = std::map<std::string, Bytes>&;
  refused([](M, T, P p, F) { p.planes[0].digest[0] ^= 1; });
  refused([](M, T, P p, F) { p.planes[0].size_bytes[0] += 1; });
  refused([](M, T, P p, F) { p.planes[0].table_bytes[0] += 1; });
  refused([](M, T, P p, F) { p.planes[0].rung_quality[1] += 1; });
  refused([](M, T, P p, F) { p.planes.clear(); });
  refused([](M, T, P p, F) { std::swap(p.planes[0].order[0], p.planes[0].order[1]); });
  refused([](M, T t, P, F) { t[0].rung_quality[1] += 1; });
  refused([](M, T t, P, F) {
    t[0].columns = 1;
    t[0].fragment_width_px = 512;
  });
  refused([](M, T, P, F f) { f["texture/0/r01.pack"].push_back(0); });
  refused([](M, T, P, F f) { f["texture/0/tables.pack"][1] = 0; });
}

TEST(PackageReader, TreesFromElsewhereCannotPointOutOfThemselves) {
  const Bytes package = make_package(1);
  const auto refuses = [](const Folder& folder) {
    EXPECT_THROW(
        {
          PackageReader reader(open_folder(folder.path()));
          read_everything(reader);
        },
        FormatError);
    EXPECT_THROW(open_folder(folder.path())->list(), FormatError);
  };
  {
    const Folder folder, outside;
    folder.unpack(package);
    fs::rename(folder / "mesh/s04.glb", outside / "s04.glb");
    fs::create_symlink(outside / "s04.glb", folder / "mesh/s04.glb");
    refuses(folder);
  }
  {
    const Folder folder, outside;
    folder.unpack(package);
    fs::rename(folder / "mesh", outside / "mesh");
    fs::create_directory_symlink(outside / "mesh", folder / "mesh");
    refuses(folder);
  }
  {
    const Folder folder;
    folder.unpack(package);
    fs::remove(folder / "mesh/s04.glb");
    ASSERT_EQ(::mkfifo((folder / "mesh/s04.glb").c_str(), 0600), 0);
    refuses(folder);
  }
  const Folder folder;
  folder.unpack(package);
  folder.write("mesh/Upper.glb", {});
  EXPECT_THROW(open_folder(folder.path())->list(), FormatError);
  EXPECT_THROW(open_folder(folder.path() + "/none"), InputError);
}

TEST(PackageReader, WhatIsNoPackageIsRefused) {
  for (const Bytes& bytes : {Bytes{}, Bytes(100, 0), Bytes(20000, 'P'), Bytes{'P', 'K', 3, 4}})
    EXPECT_THROW(open_memory(bytes), FormatError);
  EXPECT_THROW(open_store("/nonexistent"), InputError);
}

TEST(JoinJpeg, ChecksItsMarkers) {
  const Bytes good = fake_jpeg(10, 1), bad(10, 1);
  EXPECT_EQ(join_fragment(Codec::kJpeg, good, good).size(), 16u);
  EXPECT_THROW(join_fragment(Codec::kJpeg, bad, good), FormatError);
  EXPECT_THROW(join_fragment(Codec::kJpeg, good, bad), FormatError);
  EXPECT_THROW(join_fragment(Codec::kJpeg, {}, good), FormatError);
  EXPECT_THROW(join_fragment(Codec::kJpeg, good, Bytes{0xff, 0xd8}), FormatError);
}

TEST(SelectScale, FollowsTheStepFunction) {
  PackageReader reader = open_memory(make_package(0));
  const Manifest& m = reader.manifest();
  EXPECT_EQ(select_scale(m, 0), 9);
  EXPECT_EQ(select_scale(m, 100), 9);
  EXPECT_EQ(select_scale(m, 100.1), 4);
  EXPECT_EQ(select_scale(m, 600), 4);
  EXPECT_EQ(select_scale(m, 601), 0);
  EXPECT_EQ(select_scale(m, 1e12), 0);
}

}  // namespace texmesh::package_reader_test
