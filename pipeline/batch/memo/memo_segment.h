#pragma once
// What runs have found out about each package, and the files that hold it: blocks of memos, each file
// appended by one process.

#include <memory>

#include "format/base/note.h"
#include "pipeline/graph/store.h"
#include "pipeline/io/file_stamp.h"

namespace texmesh {

/// What the last run left of one package: enough to see, by looking at files' stamps alone, that
/// nothing has changed.
struct PackageMemo {
  Sha256 request{};  // of everything but files: options, strictness, tool
  std::string
      input_name;  // the model's, without its folder: the name says how to read it, and errors tell it
  bool failed = false;
  std::int64_t looked_at_ns = 0;  // when the stamps were true
  std::vector<FileRequest> files;
  FileStamp package_stamp;
  Sha256 package_digest{};
  std::uint64_t package_bytes = 0, peak_memory_bytes = 0;
  double seconds = 0;
  StageKeys keys;
  std::vector<std::string> error;  // kind, file, place, expected, found, message; empty unless failed
  Notes told;                      // WorkerDetails::told
  /// Keys go apart: a model that is up to date needs none of them.
  static void archive(auto& s, auto& a) {
    a(s.request, s.package_digest, s.failed, s.looked_at_ns, s.files, s.package_stamp, s.package_bytes,
      s.peak_memory_bytes, s.seconds, s.error, s.input_name, s.told);
  }
};

/// Whether every file is as the memo says: the model at `input` under the same name, what it refers to
/// beneath its folder, and, unless the memo is of a failure, the package at `output`. A file whose stamp
/// proves nothing (changed just before it was looked at, or touched since) is read and compared by digest;
/// the memo's stamps are then brought up to date and `refreshed` set.
bool still_holds(PackageMemo& memo, const std::string& input, const std::string& output, bool& refreshed);

/// The names of stages, which the memos of a file share: a memo's keys name them by number.
class StageNames {
 public:
  StageNames() = default;
  explicit StageNames(std::vector<std::string> names) : names_(std::move(names)) {}
  /// Adds a name that is new.
  std::uint32_t number_of(const std::string& stage);
  /// FormatError for a number without a name.
  const std::string& name_of(std::uint32_t number) const;
  const std::vector<std::string>& all() const { return names_; }

 private:
  std::vector<std::string> names_;
};

/// A package: the first half of the SHA-256 of its path within the output folder.
using MemoName = std::array<std::uint8_t, 16>;
MemoName memo_name(const std::string& package);

/// A packed memo in a segment.
struct MemoEntry {
  MemoName name{};
  std::int64_t looked_at_ns = 0;
  std::uint64_t offset = 0;
  std::uint32_t bytes = 0;
};

// File: 8 bytes of magic; then blocks of at most kMostBlockBytes and as much again:
//   u64 size of the payload, SHA-256 of the payload, payload = archive of
//   names of stages that are new in this block, names and times of the memos, sizes of each, size of the
//   body; body = the memos, then the keys of each. Each of both begins with the first 8 bytes of the
//   SHA-256 of its rest, and is checked when it is asked for: a run that finds everything up to date reads no
//   keys, which are two thirds.
// A finished file ends with a block without memos, and its name with ".seg"; that of a file that is being
// written ends with ".open", and what is cut off at its end is no damage.

/// Reads a segment. Not thread-safe.
class MemoSegment {
 public:
  /// Opens the file, checks every block's payload, and tells of each memo that a sound block names. Nothing
  /// when there is no such file (it has been merged into another), or when it cannot be opened.
  static std::unique_ptr<MemoSegment> read(const std::string& path,
                                           const std::function<void(MemoEntry)>& entry);

  const std::string& path() const { return path_; }
  std::uint64_t bytes() const { return bytes_; }
  std::int64_t modified_ns() const { return modified_ns_; }
  bool is_finished() const;
  /// Not all of it was believed: a block, or a memo or keys that were asked for.
  bool is_damaged() const { return damaged_; }
  /// The memo of an entry that read() told of, without its keys; nothing where its bytes are damaged.
  std::optional<PackageMemo> memo(const MemoEntry& entry) const;
  /// The memo's keys; none where the bytes of either are damaged.
  StageKeys keys(const MemoEntry& entry) const;

 private:
  struct Window {
    Bytes bytes;
    std::uint64_t at = 0;
  };
  MemoSegment() = default;
  bool read_blocks(const std::function<void(MemoEntry)>& entry);
  /// The body's size, whose memos begin at `body` in the file; nothing for a payload that contradicts
  /// itself.
  std::optional<std::uint64_t> tell_block(ByteSpan payload, std::uint64_t body,
                                          const std::function<void(MemoEntry)>& entry, bool& last);
  /// Bytes of the file; fewer when it has changed.
  ByteSpan look(Window& window, std::uint64_t at, std::size_t bytes) const;
  std::string path_;
  Descriptor file_;
  std::uint64_t bytes_ = 0;
  std::int64_t modified_ns_ = 0;
  mutable bool damaged_ = false;
  StageNames stages_;
  mutable Window memo_window_, key_window_;
};

/// Writes a segment of its own, which no other process writes. The file is made with the first memo. Losing
/// the end of it, when the machine stops, costs looking again: nothing waits for the disk.
class MemoSegmentWriter {
 public:
  /// `folder`: of the memo.
  explicit MemoSegmentWriter(std::string folder) : folder_(std::move(folder)) {}
  MemoSegmentWriter(const MemoSegmentWriter&) = delete;
  MemoSegmentWriter& operator=(const MemoSegmentWriter&) = delete;
  ~MemoSegmentWriter() { finish(); }

  /// Kept in memory until flush(), or until a block is full.
  void add(const MemoName& name, const PackageMemo& memo);
  /// False when something cannot be written; nothing is written from then on.
  bool flush();
  /// Ends the file, under its final name. False when that fails, or when nothing was written.
  bool finish();
  const std::string& path() const { return path_; }

 private:
  bool open();
  void end_memos();
  bool append(ByteSpan payload, ByteSpan body);
  std::string folder_, path_;  // of the file while it is written
  Descriptor file_;
  bool failed_ = false;
  StageNames stages_;
  std::size_t stages_written_ = 0;
  std::vector<MemoName> names_;
  std::vector<std::int64_t> times_;
  std::vector<std::uint32_t> sizes_;
  Bytes memos_, keys_;
};

}  // namespace texmesh
