#include "format/container/container.h"
#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "tests/support/check_crc.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>

namespace texmesh::container_test {

Bytes write(const std::vector<std::pair<std::string, Bytes>>& files) {
  Bytes out;
  ContainerWriter writer(
      [&](std::span<const std::uint8_t> part) { out.insert(out.end(), part.begin(), part.end()); });
  for (const auto& [path, data] : files) writer.add(path, data);
  writer.finish();
  return out;
}

Bytes text(std::string_view s) { return {s.begin(), s.end()}; }

std::vector<std::pair<std::string, Bytes>> small_files() {
  return {{"manifest.json", text("{}")},
          {"index.bin", Bytes(130, 7)},
          {"mesh/s09.glb", text("glTF")},
          {"texture/0/tables.pack", {}},
          {"provenance.json", text("{\"a\":1}")}};
}

std::vector<ContainerEntry> read(const Bytes& bytes) { return read_container(*memory_source(bytes)); }

/// Reads the directory and every entry's data: what verify does before it looks into entries.
void read_all(const Bytes& bytes) {
  const auto source = memory_source(bytes);
  for (const ContainerEntry& e : read_container(*source)) check_crc(*source, e);
}

TEST(Container, RoundTripKeepsOrderBytesAndAlignment) {
  const auto files = small_files();
  const Bytes bytes = write(files);
  const auto entries = read(bytes);
  ASSERT_EQ(entries.size(), files.size());
  for (std::size_t i = 0; i < files.size(); ++i) {
    EXPECT_EQ(entries[i].path, files[i].first);
    EXPECT_EQ(entries[i].offset % 64, 0u);
    EXPECT_EQ(memory_source(bytes)->read(entries[i].offset, entries[i].bytes), files[i].second);
  }
  EXPECT_EQ(entries[0].offset, 64u);  // SPEC.md: the manifest's data begins at byte 64
  read_all(bytes);
}

TEST(Container, AContentCredentialIsTheLastEntryAndTheOnlyPathWithCapitals) {
  auto files = small_files();
  const Bytes unsigned_package = write(files);
  files.emplace_back("META-INF/content_credential.c2pa", text("jumb"));
  const Bytes bytes = write(files);
  EXPECT_EQ(read(bytes).back().path, "META-INF/content_credential.c2pa");
  // The entries before it keep their places.
  const std::size_t end = read(bytes)[files.size() - 2].offset + read(bytes)[files.size() - 2].bytes;
  EXPECT_TRUE(
      std::equal(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(end), unsigned_package.begin()));
  std::swap(files[files.size() - 1], files[files.size() - 2]);
  EXPECT_THROW(write(files), FormatError);
  for (const char* path :
       {"META-INF/content_credential.C2PA", "META-INF/other.c2pa", "meta-INF/content_credential.c2pa"})
    EXPECT_FALSE(is_valid_entry_path(path)) << path;
}

TEST(Container, SameInputSameBytes) { EXPECT_EQ(write(small_files()), write(small_files())); }

TEST(Container, DataOffsetPredictsTheWriter) {
  // Path lengths 1..80 meet every residue, so also gaps too small for an extra record.
  Bytes out;
  ContainerWriter writer(
      [&](std::span<const std::uint8_t> part) { out.insert(out.end(), part.begin(), part.end()); });
  std::uint64_t at = 0;
  for (std::size_t n = 1; n <= 80; ++n) {
    const std::string path(n, 'a');
    const std::uint64_t expected = ContainerWriter::data_offset(at, path, n);
    writer.add(path, Bytes(n, 1));
    EXPECT_EQ(writer.entries().back().offset, expected);
    at = expected + n;
  }
  writer.finish();
  read_all(out);
}

TEST(Container, EmptyContainer) { EXPECT_TRUE(read(write({})).empty()); }

TEST(Container, EveryTruncationIsRefused) {
  const Bytes bytes = write(small_files());
  for (std::size_t n = 0; n < bytes.size(); ++n)
    EXPECT_THROW(read(Bytes(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(n))), FormatError)
        << n;
}

TEST(Container, ExtraBytesAreRefused) {
  Bytes after = write(small_files()), before = after;
  after.push_back(0);
  before.insert(before.begin(), 0);
  EXPECT_THROW(read(after), FormatError);
  EXPECT_THROW(read(before), FormatError);
}

TEST(Container, EveryFlippedBitIsRefused) {
  const Bytes bytes = write(small_files());
  for (std::size_t i = 0; i < bytes.size(); ++i)
    for (int bit = 0; bit < 8; ++bit) {
      Bytes damaged = bytes;
      damaged[i] = static_cast<std::uint8_t>(damaged[i] ^ (1 << bit));
      EXPECT_THROW(read_all(damaged), FormatError) << "byte " << i << " bit " << bit;
    }
}

TEST(Container, ErrorsNameEntryFieldAndValues) {
  Bytes bytes = write(small_files());
  bytes[8] = 8;  // method: deflate
  try {
    read(bytes);
    FAIL();
  } catch (const FormatError& e) {
    EXPECT_NE(std::string(e.place()).find("local header of manifest.json, method (stored)"),
              std::string::npos);
    EXPECT_EQ(e.expected(), "0");
    EXPECT_EQ(e.found(), "8");
  }
}

TEST(Container, GapsBetweenEntriesAreRefused) {
  // A byte between two entries, with all offsets behind it corrected, is no ZIP error but breaks the profile.
  Bytes bytes = write({{"a", text("x")}, {"b", text("y")}});
  const auto entries = read(bytes);
  bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(entries[0].offset + 1), 0);
  const std::size_t end = bytes.size() - 22;
  bytes[end + 16]++;  // directory offset (low byte does not overflow here)
  const std::size_t second = end - 47;
  bytes[second + 42]++;
  EXPECT_THROW(read(bytes), FormatError);
}

TEST(Container, PathsAreChecked) {
  for (const char* good : {"a", "a/b", "manifest.json", "texture/0/r00.pack", "..a", "a_-.9"})
    EXPECT_TRUE(is_valid_entry_path(good)) << good;
  for (const char* bad : {"", "/", "/a", "a/", "a//b", ".", "..", "../a", "a/../b", "a/.", "A", "a b", "a\\b",
                          "c:/a", "a\xc3\xa4", "a*"})
    EXPECT_FALSE(is_valid_entry_path(bad)) << bad;
  EXPECT_TRUE(is_valid_entry_path(std::string(200, 'a')));
  EXPECT_FALSE(is_valid_entry_path(std::string(201, 'a')));
  EXPECT_FALSE(is_valid_entry_path(std::string("a\0b", 3)));
}

TEST(Container, WriterRefusesBadAndCollidingPaths) {
  EXPECT_THROW(write({{"../a", {}}}), FormatError);
  EXPECT_THROW(write({{"a", {}}, {"a", {}}}), FormatError);
  EXPECT_THROW(write({{"a", {}}, {"a/b", {}}}), FormatError);
  EXPECT_THROW(write({{"a/b", {}}, {"a", {}}}), FormatError);
  EXPECT_NO_THROW(write({{"a/b", {}}, {"a/c", {}}}));
}

TEST(Container, ReaderRefusesDuplicateAndEscapingNames) {
  // Renames an entry in both headers of a well-formed container.
  const auto rename = [](Bytes bytes, std::string_view from, std::string_view to) {
    for (auto at = bytes.begin();
         (at = std::search(at, bytes.end(), from.begin(), from.end())) != bytes.end();)
      at = std::copy(to.begin(), to.end(), at);
    return bytes;
  };
  const Bytes bytes = write({{"abcd", text("x")}, {"efgh", text("y")}});
  EXPECT_NO_THROW(read(rename(bytes, "efgh", "efgi")));
  for (const char* name : {"abcd", "../h", "/fgh", "EFGH", "e\\gh", "e//h"})
    EXPECT_THROW(read(rename(bytes, "efgh", name)), FormatError) << name;
}

TEST(Container, StreamedEntryMustKeepItsPromise) {
  const auto add = [](std::uint64_t bytes, std::uint32_t crc) {
    ContainerWriter writer([](auto) {});
    writer.add("a", bytes, crc, [](const ContainerWriter::Sink& sink) { sink(text("xyz")); });
  };
  const auto crc = static_cast<std::uint32_t>(crc32(0, text("xyz").data(), 3));
  EXPECT_NO_THROW(add(3, crc));
  EXPECT_THROW(add(4, crc), FormatError);
  EXPECT_THROW(add(3, crc + 1), FormatError);
}

/// A sink and source that remembers only bytes that are not part of one huge run of zeros.
class SparseStore final : public ByteSource {
 public:
  void append(std::span<const std::uint8_t> part) {
    if (part.size() < (1u << 20)) pieces_[size_] = Bytes(part.begin(), part.end());
    size_ += part.size();
  }
  std::uint64_t size() override { return size_; }
  Bytes read(std::uint64_t offset, std::uint64_t bytes) override {
    if (offset > size_ || bytes > size_ - offset) throw FormatError("sparse", "", "bytes", "the end");
    Bytes out(static_cast<std::size_t>(bytes));
    for (const auto& [at, piece] : pieces_)
      for (std::size_t i = 0; i < piece.size(); ++i)
        if (at + i >= offset && at + i < offset + bytes)
          out[static_cast<std::size_t>(at + i - offset)] = piece[i];
    return out;
  }

 private:
  std::map<std::uint64_t, Bytes> pieces_;
  std::uint64_t size_ = 0;
};

constexpr std::uint64_t kFourGib = std::uint64_t{1} << 32;

TEST(Container, EntriesAround4GiBUseZip64OnlyWhereNeeded) {
  constexpr std::size_t kChunk = 1 << 26;
  const Bytes zeros(kChunk, 0);
  const auto crc_of_zeros = [&](std::uint64_t n) {
    const auto chunk_crc = crc32_z(0, zeros.data(), kChunk);
    uLong crc = 0;
    for (std::uint64_t i = 0; i < n / kChunk; ++i) crc = crc32_combine(crc, chunk_crc, kChunk);
    return static_cast<std::uint32_t>(crc32_combine(crc, crc32_z(0, zeros.data(), n % kChunk), n % kChunk));
  };
  // 0xffffffff is ZIP's "see ZIP64", so the last size without it is 4 GiB - 2.
  for (const auto& [bytes, zip64] :
       {std::pair{kFourGib - 2, false}, {kFourGib - 1, true}, {kFourGib + 1, true}}) {
    SparseStore store;
    ContainerWriter writer([&](std::span<const std::uint8_t> part) { store.append(part); });
    writer.add("a", text("first"));
    const std::uint64_t size = bytes;
    writer.add("big", size, crc_of_zeros(size), [&](const ContainerWriter::Sink& sink) {
      for (std::uint64_t left = size; left > 0;) {
        const std::uint64_t n = std::min<std::uint64_t>(left, kChunk);
        sink(std::span(zeros).first(static_cast<std::size_t>(n)));
        left -= n;
      }
    });
    writer.add("last", text("last"));
    writer.finish();
    const auto entries = read_container(store);
    ASSERT_EQ(entries.size(), 3u);
    EXPECT_EQ(entries[1].bytes, size);
    EXPECT_EQ(entries[1].offset % 64, 0u);
    EXPECT_EQ(store.read(entries[2].offset, 4), text("last"));
    const Bytes header = store.read(entries[0].offset + entries[0].bytes, 30);
    EXPECT_EQ(header[4], zip64 ? 45 : 10);  // version needed
    check_crc(store, entries[2]);
  }
}

TEST(Container, EntryCountsAround65535) {
  for (const std::size_t count : {65534u, 65535u, 65536u}) {
    Bytes out;
    ContainerWriter writer(
        [&](std::span<const std::uint8_t> part) { out.insert(out.end(), part.begin(), part.end()); });
    for (std::size_t i = 0; i < count; ++i) writer.add("e" + std::to_string(i), {});
    writer.finish();
    EXPECT_EQ(read(out).size(), count);
    const std::size_t end = out.size() - 22;
    EXPECT_EQ(out[end - 20] == 'P' && out[end - 18] == 6 && out[end - 17] == 7, count >= 65535) << count;
  }
}

TEST(Container, UnzipAndPythonOpenIt) {
  if (std::system("command -v unzip >/dev/null && command -v python3 >/dev/null") != 0)
    GTEST_SKIP() << "no unzip or python3";
  const auto folder = std::filesystem::temp_directory_path() / ("texmesh_zip_" + std::to_string(::getpid()));
  std::filesystem::create_directory(folder);
  const auto path = folder / "p.zip";
  auto check = [&](const Bytes& bytes) {
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    EXPECT_EQ(std::system(("unzip -tqq '" + path.string() + "' >/dev/null").c_str()), 0);
    EXPECT_EQ(
        std::system(
            ("python3 -c 'import sys,zipfile; z=zipfile.ZipFile(sys.argv[1]); sys.exit(z.testzip() is not "
             "None or any(i.compress_type or i.date_time[0]!=1980 for i in z.infolist()))' '" +
             path.string() + "'")
                .c_str()),
        0);
  };
  check(write(small_files()));
  std::vector<std::pair<std::string, Bytes>> many;
  for (int i = 0; i < 66000; ++i) many.emplace_back("e" + std::to_string(i), Bytes{});
  check(write(many));
  std::filesystem::remove_all(folder);
}

TEST(Container, FileSourceRefusesWhatIsNoFile) {
  EXPECT_THROW(open_file_source("/nonexistent/package"), InputError);
  EXPECT_THROW(open_file_source("/tmp"), InputError);
  const auto fifo = std::filesystem::temp_directory_path() / ("texmesh_fifo_" + std::to_string(::getpid()));
  ASSERT_EQ(::mkfifo(fifo.c_str(), 0600), 0);
  EXPECT_THROW(open_file_source(fifo.string()), InputError);  // and does not hang
  std::filesystem::remove(fifo);
}

}  // namespace texmesh::container_test
