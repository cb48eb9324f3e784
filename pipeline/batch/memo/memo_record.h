#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "pipeline/graph/key.h"
#include "pipeline/io/file_stamp.h"

namespace texmesh {

/// What the last run left of one package: enough to see, by looking at files' stamps alone, that
/// nothing has changed.
struct MemoRecord {
  Sha256 request{};  // of everything but files: options, strictness, tool
  bool failed = false;
  std::int64_t looked_at_ns = 0;  // when the stamps were true
  std::vector<FileRequest> files;
  FileStamp package_stamp;
  Sha256 package_digest{};
  std::uint64_t package_bytes = 0, peak_memory_bytes = 0;
  double seconds = 0;
  StageKeys keys;
  std::vector<std::string> error;  // kind, file, place, expected, found, message; empty unless failed
};

/// The names of stages, which the records of a file share: a record's keys name them by number.
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

// Keys go apart: a model that is up to date needs none of them. FormatError for bytes that are not what pack
// gave.
std::vector<std::uint8_t> pack_record(const MemoRecord& record);
MemoRecord unpack_record(std::span<const std::uint8_t> bytes);
std::vector<std::uint8_t> pack_keys(const StageKeys& keys, StageNames& stages);
StageKeys unpack_keys(std::span<const std::uint8_t> bytes, const StageNames& stages);

/// Whether every file is as the record says: the model at `input`, what it refers to beneath its folder, and,
/// unless the record is of a failure, the package at `output`. A file whose stamp proves nothing (changed
/// just before it was looked at, or touched since) is read and compared by digest; the record's stamps are
/// then brought up to date and `refreshed` set.
bool still_holds(MemoRecord& record, const std::string& input, const std::string& output, bool& refreshed);

}  // namespace texmesh
