#include "format/documents/index.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "format/base/errors.h"
#include "format/container/container.h"
#include "tests/format/documents/manifest_fixture.h"

namespace texmesh::index_test {

using testing::as_bytes;
using testing::make_manifest;
using Json = nlohmann::ordered_json;

std::vector<EntryRef> index_entries(std::uint32_t planes) {
  std::vector<EntryRef> entries;
  std::uint64_t at = 64;
  const auto add = [&](const std::string& path, std::uint64_t bytes) {
    at = ContainerWriter::data_offset(at, path, bytes);
    entries.push_back({path, at, bytes, sha256(as_bytes(path))});
    at += bytes;
  };
  add(kTablesPath, 500);
  add(mesh_path(3), 1000);
  for (std::uint32_t p = 0; p < planes; ++p) add(table_streams_path(p), 10);
  for (std::uint32_t r = 0; r < 3; ++r)
    for (std::uint32_t p = 0; p < planes; ++p)
      add(rung_path(p, r), r);  // 0 bytes: a plane without stored fragments
  add(kProvenancePath, 5);
  return entries;
}

TEST(Index, RoundTripWholeAndByPages) {
  for (const std::uint32_t planes : {0u, 1u, 5u}) {
    const auto entries = index_entries(planes);
    const auto bytes = write_index(entries);
    EXPECT_EQ(read_index(bytes), entries);
    const IndexHead whole = read_index_head(bytes);
    const IndexHead head = read_index_head(std::span(bytes).first(whole.bytes));
    ASSERT_EQ(head.pages.size(), planes + 1);
    for (std::uint32_t p = 0; p < planes; ++p) {
      const IndexPage& page = head.pages[p + 1];
      EXPECT_EQ(page.plane, p);
      const auto found = read_index_page(head, p + 1, std::span(bytes).subspan(page.offset, page.bytes));
      ASSERT_EQ(found.size(), 4u);
      EXPECT_EQ(found[0].path, table_streams_path(p));
      EXPECT_EQ(found[3].path, rung_path(p, 2));
    }
  }
}

TEST(Index, EveryTruncationExtraByteAndFlip) {
  const auto bytes = write_index(index_entries(2));
  for (std::size_t n = 0; n < bytes.size(); ++n)
    EXPECT_THROW(read_index(std::span(bytes).first(n)), FormatError) << n;
  auto longer = bytes;
  longer.push_back(0);
  EXPECT_THROW(read_index(longer), FormatError);
  // Bytes 6 and 7 are the minor version, which a reader accepts whatever it is.
  for (std::size_t i = 0; i < bytes.size(); ++i)
    for (int bit = 0; bit < 8; ++bit) {
      auto damaged = bytes;
      damaged[i] = static_cast<std::uint8_t>(damaged[i] ^ (1 << bit));
      if (i == 6 || i == 7) {
        EXPECT_EQ(read_index(damaged), read_index(bytes));
      } else {
        EXPECT_THROW(read_index(damaged), FormatError) << i << " " << bit;
      }
    }
}

TEST(Index, WriterRefusesBadEntries) {
  const auto refused = [](auto change) {
    auto entries = index_entries(1);
    change(entries);
    EXPECT_THROW(write_index(entries), FormatError);
  };
  using Entries = std::vector<EntryRef>;
  refused([](Entries& e) { e[1].path = e[0].path; });
  refused([](Entries& e) { e[1].path = "../x"; });
  refused([](Entries& e) { e[1].path = kManifestPath; });
  refused([](Entries& e) { e[1].offset += 1; });
  refused([](Entries& e) { std::swap(e[0], e[1]); });
  refused([](Entries& e) { e[0].bytes = 1u << 30; });
}

}  // namespace texmesh::index_test
