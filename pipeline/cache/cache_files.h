#pragma once

#include "pipeline/graph/store.h"
#include "pipeline/io/file_stamp.h"

// The cache folder's own files: what stands where, how a file is published, what an entry looks like.
//
//   ac/<k[0:2]>/<key>        an entry: the key's parts in the clear, the outputs' digests, its own digest
//   cas/<d[0:2]>/<digest>    the bytes of an output
//   notes/<k[0:2]>/<key>     small facts that are not results
//   memo/<name>/<segment>    what runs of a collection have found out (pipeline/batch/build_memo.h)
//   locks/<k[0:3]>           flock: held while a key that begins with these digits is computed
//   locks/quarantine         flock: held while a damaged file is moved away
//   gate                     flock: shared by lookups and puts of entries and blobs, exclusive for pruning
//   running/<name>           one per running build, locked until the build ends; its time is the start's
//   quarantine/<name>        objects that were found damaged
namespace texmesh {

/// Path of an object within a cache folder; `kind` is ac, cas or notes.
std::string object_path(const char* kind, const Sha256& digest);

/// The whole of a regular file; nothing when it is not there, longer than max_bytes or cannot be read.
std::optional<Bytes> read_whole(const std::string& path, std::uint64_t max_bytes = ~0ull);

/// Puts `bytes` under a new name: an unnamed temporary file, fdatasync, link, fsync of the folder. A file
/// that has the name already stays, and counts as success when it is as long as `bytes`. False when that
/// fails. A failure, or the end of the process at any point, leaves nothing behind.
bool publish_object(const std::string& path, ByteSpan bytes);

/// What became of a file that was found damaged.
struct QuarantineResult {
  enum class Fate : std::uint8_t { kMoved, kReplaced, kFailed };
  Fate fate = Fate::kMoved;
  std::string reason;  // kFailed: why the file could not be moved
};
/// Moves a damaged file of the cache at `folder` to quarantine/. `read` is the file's stamp from before its
/// bytes were read. Threads and processes may have read the same damaged file: one of them gets kMoved, the
/// others get kReplaced. kReplaced leaves what stands under the path by now: it may be sound.
QuarantineResult move_to_quarantine(const std::string& folder, const std::string& path,
                                    const FileStamp& read);

/// Text with its digest behind it, so that a cut or changed text is noticed; and back.
std::string seal(const std::string& body);
std::optional<std::string> unseal(ByteSpan bytes);

/// An entry of ac/: sealed JSON.
struct CacheEntry {
  std::string preimage;  // Key::preimage
  std::vector<StoredBlob> outputs;
};
std::string write_entry(const CacheEntry& entry);
/// Nothing when the entry is damaged, of another version, or its parts do not give `key`; without a key the
/// caller knows it by its name only (pruning).
std::optional<CacheEntry> read_entry(ByteSpan bytes, const std::optional<Sha256>& key = {});

/// flock on a file, which is made where it is missing. Released with the object.
class FileLock {
 public:
  enum class Mode : std::uint8_t { kShared, kExclusive };
  /// Waits. Not held when locks do not work there.
  static FileLock wait(const std::string& path, Mode mode);
  /// An exclusive one; does not wait.
  static FileLock attempt(const std::string& path);
  bool held() const { return file_.get() >= 0; }
  /// attempt() failed because somebody else holds the lock, not because locks do not work.
  bool busy() const { return busy_; }
  /// Whether the locked file still stands under this path and was not removed meanwhile.
  bool is_of(const std::string& path) const;

 private:
  static FileLock take(const std::string& path, int operation);
  Descriptor file_;
  bool busy_ = false;
};

}  // namespace texmesh
