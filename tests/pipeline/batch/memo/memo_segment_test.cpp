#include "pipeline/batch/memo/memo_segment.h"

#include <gtest/gtest.h>

#include "format/base/archive.h"
#include "tests/support/command.h"

namespace texmesh {
namespace {

using testing::TemporaryFolder;

Sha256 sha256_of_text(const std::string& s) {
  return sha256({reinterpret_cast<const std::uint8_t*>(s.data()), s.size()});
}

MemoRecord record_with(double seconds, int keys) {
  MemoRecord r;
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
    const auto record = segment->record(e);
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
       {std::string("not a segment at all"), std::string("TXMEMO\0\1", 8), std::string()}) {
    testing::write_text(folder / "a.seg", text);
    EXPECT_TRUE(entries_of(folder / "a.seg", damaged).empty());
    EXPECT_TRUE(damaged) << text;
  }
  EXPECT_EQ(MemoSegment::read(folder / "b.seg", [](const MemoEntry&) {}), nullptr);
  EXPECT_EQ(MemoSegment::read(folder.path().string(), [](const MemoEntry&) {}), nullptr);
}

/// A finished file with one block, whose digest is right.
std::string with_block(const std::vector<std::uint8_t>& payload) {
  const Sha256 digest = sha256(payload);
  std::string file("TXMEMO\0\2", 8);
  for (int i = 0; i < 8; ++i) file += static_cast<char>(payload.size() >> 8 * i);
  file.append(digest.begin(), digest.end());
  return file.append(payload.begin(), payload.end());
}

struct HostileBlock {
  std::vector<std::string> stages;
  std::vector<MemoName> names;
  std::vector<std::int64_t> times;
  std::vector<std::uint32_t> sizes, key_sizes;
  std::vector<std::uint8_t> records;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.stages, s.names, s.times, s.sizes, s.key_sizes, s.records);
  }
};

TEST(MemoSegment, BlocksThatContradictThemselvesAreNotBelieved) {
  const TemporaryFolder folder;
  const HostileBlock blocks[] = {
      {{}, {MemoName{}}, {}, {1}, {0}, {0}},    {{}, {MemoName{}}, {1}, {}, {0}, {0}},
      {{}, {MemoName{}}, {1}, {1}, {}, {0}},    {{}, {MemoName{}}, {1}, {2}, {0}, {0}},
      {{}, {MemoName{}}, {1}, {~0u}, {2}, {0}}, {{}, {}, {}, {}, {}, {0}}};
  for (const HostileBlock& block : blocks) {
    testing::write_text(folder / "a.seg", with_block(encode_artefact(block)));
    bool damaged = false;
    EXPECT_TRUE(entries_of(folder / "a.seg", damaged).empty());
    EXPECT_TRUE(damaged) << &block - blocks;
  }
  bool damaged = false;
  testing::write_text(folder / "a.seg", with_block({1, 2, 3}));
  EXPECT_TRUE(entries_of(folder / "a.seg", damaged).empty());
  EXPECT_TRUE(damaged);
  // A record of garbage is told of, and then not believed.
  testing::write_text(folder / "a.open",
                      with_block(encode_artefact(HostileBlock{{}, {{}}, {1}, {3}, {2}, {1, 2, 3, 4, 5}})));
  std::vector<MemoEntry> entries;
  const auto segment =
      MemoSegment::read(folder / "a.open", [&](const MemoEntry& e) { entries.push_back(e); });
  ASSERT_EQ(entries.size(), 1u);
  EXPECT_FALSE(segment->record(entries[0]).has_value());
  EXPECT_TRUE(segment->keys(entries[0]).empty());
}

}  // namespace
}  // namespace texmesh
