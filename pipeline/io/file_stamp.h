#pragma once
#include <sys/stat.h>

#include <algorithm>

#include "format/base/descriptor.h"
#include "pipeline/io/record.h"

namespace texmesh {

/// Writes all of it, in pieces that every system takes at once; false, with errno, where that fails.
inline bool write_all(int fd, ByteSpan bytes) {
  constexpr std::size_t kPieceBytes = 1 << 24;
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd, bytes.data(), std::min(bytes.size(), kPieceBytes));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(n));
  }
  return true;
}

/// The folder that a file stands in; "." for a name alone.
std::string folder_of_file(const std::string& path);
/// False, with errno, where what a folder lists is not on the disk yet. Some file systems cannot sync
/// folders; what was renamed in them stands all the same.
bool sync_folder(const std::string& folder);

/// What tells, without reading a file, that it has not changed: device, inode, size, and the times of the
/// last change of content and of inode, in nanoseconds since 1970. Device is 0 where its number is that of a
/// mount (NFS, overlay, tmpfs), which says nothing on another node.
struct FileStamp {
  std::uint64_t device = 0, inode = 0, bytes = 0;
  std::int64_t modified_ns = 0, changed_ns = 0;
  friend bool operator==(const FileStamp&, const FileStamp&) = default;
  static void archive(auto& s, auto& a) { a(s.device, s.inode, s.bytes, s.modified_ns, s.changed_ns); }
  static void fields(auto& s, auto&& v) {
    v("device", s.device, "");
    v("inode", s.inode, "");
    v("bytes", s.bytes, "");
    v("modified_ns", s.modified_ns, "");
    v("changed_ns", s.changed_ns, "");
  }

  /// A file that was changed this shortly before it was looked at may be changed again within the clock's
  /// tick: its stamp is no proof.
  bool is_settled(std::int64_t looked_at_ns) const {
    return modified_ns < looked_at_ns - kSettleNs && changed_ns < looked_at_ns - kSettleNs;
  }
  static constexpr std::int64_t kSettleNs = 2'000'000'000;
};

/// What a model asked of the files beside it: a file, or (`similar`) which names there are like one that is
/// not there (similar_names.h): then `digest` and `bytes` are of their list, `found` says that it is not
/// empty, and `stamp` is that of the folder. `digest`, `bytes` and `stamp` of a file are zero unless found.
/// All but the stamp become part of the cache key: the same requests with the same answers give the same
/// model.
struct FileRequest {
  std::string uri;  // relative to the model's folder; "" = the model itself
  bool found = false;
  Sha256 digest{};
  std::uint64_t bytes = 0;
  FileStamp stamp;  // when it was read; no part of any key
  bool similar = false;
  friend bool operator==(const FileRequest&, const FileRequest&) = default;
  static void archive(auto& s, auto& a) { a(s.uri, s.found, s.digest, s.bytes, s.stamp, s.similar); }
  static void fields(auto& s, auto&& v) {
    v("uri", s.uri, kNamesFile, "");
    v("found", s.found, "");
    v("sha256", s.digest, "");
    v("bytes", s.bytes, "");
    v("stamp", s.stamp, kMayMiss, "");
    v("similar", s.similar, kMayMiss, "");
  }
};

FileStamp stamp_of(const struct stat& status);
/// Nothing when `path` is not a regular file that can be looked at (symbolic links are followed).
std::optional<FileStamp> stamp_of(const std::string& path);

/// Wall clock in nanoseconds since 1970. For stamps and for the age of cache entries, never for results.
std::int64_t wall_clock_ns();

}  // namespace texmesh
