#pragma once
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/graph/key.h"
#include "pipeline/io/file_request.h"

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

/// The memos of the packages of one output folder (or of one single package), kept in the cache folder.
/// Losing it costs looking every model over again in its child process, never a wrong result. Not
/// thread-safe; save() merges with what other processes have saved meanwhile.
class BuildMemo {
 public:
  /// `outputs`: absolute path of the output folder, or of the package where a run makes one only. Without a
  /// cache folder nothing is remembered.
  BuildMemo(const std::string& cache_folder, const std::string& outputs);
  /// There was a memo, but not with its digest: nothing is remembered.
  bool was_damaged() const { return was_damaged_; }
  /// `package`: path of the package as the run names it.
  bool find(const std::string& package, MemoRecord& record) const;
  void set(const std::string& package, const MemoRecord& record);
  /// False when it cannot be written.
  bool save();

 private:
  void load();
  std::string path_;
  bool was_damaged_ = false;
  std::vector<std::uint8_t> bytes_;
  std::map<std::string_view, std::pair<std::size_t, std::size_t>> index_;  // into bytes_: offset and length
  std::map<std::string, std::vector<std::uint8_t>> changed_;
};

/// Whether every file is as the record says: the model at `input`, what it refers to beneath its folder, and,
/// unless the record is of a failure, the package at `output`. A file whose stamp proves nothing (changed
/// just before it was looked at, or touched since) is read and compared by digest; the record's stamps are
/// then brought up to date and `refreshed` set.
bool still_holds(MemoRecord& record, const std::string& input, const std::string& output, bool& refreshed);

}  // namespace texmesh
