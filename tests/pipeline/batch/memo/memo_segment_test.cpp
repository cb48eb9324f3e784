#include "pipeline/batch/memo/memo_segment.h"

#include <gtest/gtest.h>

#include "format/base/archive.h"
#include "tests/support/command.h"

namespace texmesh::memo_segment_test {

using testing::TemporaryFolder;

Sha256 sha256_of_text(const std::string& s) {
  return sha256({reinterpret_cast<const std::uint8_t*>(s.data()), s.size()});
}

PackageMemo record_with(double seconds, int keys) {
  PackageMemo r;
  r.seconds = seconds;
  r.looked_at_ns = static_cast<std::int64_t>(seconds) + 7;
  r.files = {{"", true, sha256_of_text("model"), 5, {0, 1, 5, 2, 3}}};
  for (int k = 0; k < keys; ++k) r.keys["stage " + std::to_string(k)] = sha256_of_text(std::to_string(k));
  return r;
}

std::vector<MemoEntry> entries_of(const std::string& path, bool& damaged) {
  std::vector<MemoEntry> entries;
  const auto segment = MemoSegment::read(path, [&](const MemoEntry& e) { entries.push_back(e); });
  damaged = !segment || segment->is_damaged();
  return entries;
}

TEST(MemoSegment, BlocksShareTheNamesOfStages) {
  const TemporaryFolder folder;
  MemoSegmentWriter writer(folder / "memo");
  for (int i = 0; i < 5; ++i) {
    writer.add(memo_name(std::to_string(i)), record_with(i, i));
    ASSERT_TRUE(writer.flush());
  }
  ASSERT_TRUE(writer.finish());
  std::vector<MemoEntry> entries;
  const auto segment = MemoSegment::read(writer.path(), [&](const MemoEntry& e) { entries.push_back(e); });
  ASSERT_NE(segment, nullptr);
  EXPECT_TRUE(segment->is_finished());
  EXPECT_FALSE(segment->is_damaged());
  ASSERT_EQ(entries.size(), 5u);
  for (int i = 0; i < 5; ++i) {
    const MemoEntry& e = entries[static_cast<std::size_t>(i)];
    EXPECT_EQ(e.name, memo_name(std::to_string(i)));
    EXPECT_EQ(e.looked_at_ns, i + 7);
    const auto record = segment->memo(e);
    ASSERT_TRUE(record.has_value());
    EXPECT_EQ(record->seconds, i);
    EXPECT_TRUE(record->keys.empty());
    EXPECT_EQ(segment->keys(e), record_with(i, i).keys);
  }
}

TEST(MemoSegment, ManyRecordsBecomeBlocksThatAReaderTakes) {
  const TemporaryFolder folder;
  MemoSegmentWriter writer(folder / "memo");
  constexpr int kRecords = 20'000;
  for (int i = 0; i < kRecords; ++i) writer.add(memo_name(std::to_string(i)), record_with(i, 3));
  ASSERT_TRUE(writer.finish());
  bool damaged = true;
  EXPECT_EQ(entries_of(writer.path(), damaged).size(), static_cast<std::size_t>(kRecords));
  EXPECT_FALSE(damaged);
}

TEST(MemoSegment, AFileThatIsNoSegmentIsDamagedAndAMissingOneIsNone) {
  const TemporaryFolder folder;
  bool damaged = false;
  for (const std::string& text :
       {std::string("not a segment at all"), std::string("TXMEMO\0\2", 8), std::string()}) {
    testing::write_text(folder / "a.seg", text);
    EXPECT_TRUE(entries_of(folder / "a.seg", damaged).empty());
    EXPECT_TRUE(damaged) << text;
  }
  EXPECT_EQ(MemoSegment::read(folder / "b.seg", [](const MemoEntry&) {}), nullptr);
  EXPECT_EQ(MemoSegment::read(folder.path().string(), [](const MemoEntry&) {}), nullptr);
}

/// A finished file with one block, whose digest is right.
std::string with_block(const std::vector<std::uint8_t>& payload, const std::string& body = "") {
  const Sha256 digest = sha256(payload);
  std::string file("TXMEMO\0\4", 8);
  for (int i = 0; i < 8; ++i) file += static_cast<char>(payload.size() >> 8 * i);
  file.append(digest.begin(), digest.end());
  return file.append(payload.begin(), payload.end()) + body;
}

struct HostileBlock {
  std::vector<std::string> stages;
  std::vector<MemoName> names;
  std::vector<std::int64_t> times;
  std::vector<std::uint32_t> sizes;
  std::uint64_t body_bytes = 0;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.stages, s.names, s.times, s.sizes, s.body_bytes);
  }
};

TEST(MemoSegment, BlocksThatContradictThemselvesAreNotBelieved) {
  const TemporaryFolder folder;
  const HostileBlock blocks[] = {{{}, {MemoName{}}, {}, {1}, 1},          {{}, {MemoName{}}, {1}, {}, 1},
                                 {{}, {MemoName{}}, {1}, {2}, 1},         {{}, {}, {1}, {}, 1},
                                 {{}, {MemoName{}}, {1}, {~0u}, ~0u},     {{}, {MemoName{}}, {1}, {1}, 2},
                                 {{}, {MemoName{}}, {1}, {1}, ~0ull - 7}, {{}, {}, {}, {}, 0}};
  for (const HostileBlock& block : blocks) {
    testing::write_text(folder / "a.seg", with_block(encode_artefact(block), "x"));
    bool damaged = false;
    EXPECT_TRUE(entries_of(folder / "a.seg", damaged).empty());
    EXPECT_TRUE(damaged) << &block - blocks;
  }
  bool damaged = false;
  testing::write_text(folder / "a.seg", with_block({1, 2, 3}));
  EXPECT_TRUE(entries_of(folder / "a.seg", damaged).empty());
  EXPECT_TRUE(damaged);
}

/// As a record or its keys stand in a file.
std::string checked(const std::string& bytes) {
  const std::uint64_t check = truncated(sha256_of_text(bytes));
  return std::string(reinterpret_cast<const char*>(&check), sizeof check) + bytes;
}

TEST(MemoSegment, ARecordOfGarbageIsToldOfAndThenNotBelieved) {
  const TemporaryFolder folder;
  const std::string far("\xff\xff\xff\x7f\xff\xff\xff\x7f", 8), outside("\0\0\1\0\0\0\1\0", 8),
      here("\0\0\0\0\5\0\0\0", 8);
  for (const std::string& record :
       {std::string("12345"), std::string("12345678901234567890"), checked(""), checked("1234"), checked(far),
        checked(far + "text"), checked(outside + "text"), checked(here + "text")}) {
    const auto bytes = static_cast<std::uint32_t>(record.size());
    testing::write_text(folder / "a.open",
                        with_block(encode_artefact(HostileBlock{{}, {{}}, {1}, {bytes}, bytes}), record));
    std::vector<MemoEntry> entries;
    const auto segment =
        MemoSegment::read(folder / "a.open", [&](const MemoEntry& e) { entries.push_back(e); });
    ASSERT_EQ(entries.size(), 1u);
    EXPECT_FALSE(segment->memo(entries[0]).has_value());
    EXPECT_TRUE(segment->keys(entries[0]).empty());
  }
}

}  // namespace texmesh::memo_segment_test
