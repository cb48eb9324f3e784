#include "pipeline/cache/cache_files.h"

#include <fcntl.h>
#include <sys/file.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "format/base/text_bytes.h"
#include "pipeline/io/atomic_file.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;

constexpr int kEntryVersion = 2;
constexpr std::size_t kSealBytes = 66;  // newline, 64 digits, newline

bool is_there(const std::string& path, std::size_t bytes) {
  struct stat s {};
  return ::stat(path.c_str(), &s) == 0 && S_ISREG(s.st_mode) && static_cast<std::size_t>(s.st_size) == bytes;
}

/// For file systems without O_TMPFILE (NFS): a named sibling. Pruning removes what a killed process leaves.
bool publish_by_rename(const std::string& path, ByteSpan bytes) {
  try {
    write_file_atomically(path, bytes);
    return true;
  } catch (const InputError&) {
    return false;
  }
}

/// An entry as its file has it.
struct EntryText {
  Json key;  // Key::preimage
  std::vector<StoredBlob> outputs;
  static void fields(auto& s, auto&& v) {
    v("version", Constant{kEntryVersion}, "");
    v("key", s.key, "");
    v("outputs", s.outputs, "");
  }
};

}  // namespace

std::string object_path(const char* kind, const Sha256& digest) {
  const std::string hex = to_hex(digest);
  return std::string(kind) + "/" + hex.substr(0, 2) + "/" + hex;
}

std::optional<Bytes> read_whole(const std::string& path, std::uint64_t max_bytes) {
  const Descriptor d{::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)};
  struct stat s {};
  if (d.get() < 0 || ::fstat(d.get(), &s) != 0 || !S_ISREG(s.st_mode) ||
      static_cast<std::uint64_t>(s.st_size) > max_bytes)
    return std::nullopt;
  Bytes bytes(static_cast<std::size_t>(s.st_size));
  if (!read_at(d.get(), 0, bytes)) return std::nullopt;  // EIO, or somebody shortens the file
  return bytes;
}

bool publish_object(const std::string& path, ByteSpan bytes) {
  const std::string folder = fs::path(path).parent_path().string();
  std::error_code ec;
  fs::create_directories(folder, ec);
  if (ec) return false;
  const Descriptor d{::open(folder.c_str(), O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666)};
  if (d.get() < 0) {
    if (errno != EOPNOTSUPP && errno != EISDIR && errno != EINVAL && errno != ENOENT) return false;
    return is_there(path, bytes.size()) || publish_by_rename(path, bytes);
  }
  if (!write_all(d.get(), bytes) || ::fdatasync(d.get()) != 0) return false;
  const std::string self = "/proc/self/fd/" + std::to_string(d.get());
  if (::linkat(AT_FDCWD, self.c_str(), AT_FDCWD, path.c_str(), AT_SYMLINK_FOLLOW) != 0) {
    if (errno == EEXIST) return is_there(path, bytes.size());
    return errno == ENOENT && publish_by_rename(path, bytes);  // no /proc in this sandbox
  }
  return sync_folder(folder);
}

QuarantineResult move_to_quarantine(const std::string& folder, const std::string& path,
                                    const FileStamp& read) {
  using Fate = QuarantineResult::Fate;
  // Nobody publishes over a file that is there, and nobody else moves one away while this is held.
  const FileLock lock = FileLock::wait(folder + "/locks/quarantine", FileLock::Mode::kExclusive);
  if (stamp_of(path) != read) return {Fate::kReplaced, ""};
  std::error_code ec;
  fs::create_directories(folder + "/quarantine", ec);
  fs::rename(path, folder + "/quarantine/" + fs::path(path).filename().string(), ec);
  if (!ec) return {};
  // Where locks do not work, somebody else may have been faster.
  return ec == std::errc::no_such_file_or_directory ? QuarantineResult{Fate::kReplaced, ""}
                                                    : QuarantineResult{Fate::kFailed, ec.message()};
}

std::string seal(const std::string& body) { return body + "\n" + to_hex(sha256(text_bytes(body))) + "\n"; }

std::optional<std::string> unseal(ByteSpan bytes) {
  if (bytes.size() < kSealBytes) return std::nullopt;
  const std::string text(bytes.begin(), bytes.end());
  std::string body = text.substr(0, text.size() - kSealBytes);
  if (seal(body) != text) return std::nullopt;
  return body;
}

std::string write_entry(const CacheEntry& entry) {
  return seal(to_json(EntryText{Json::parse(entry.preimage), entry.outputs}).dump(1));
}

std::optional<CacheEntry> read_entry(ByteSpan bytes, const std::optional<Sha256>& key) {
  const auto body = unseal(bytes);
  if (!body) return std::nullopt;
  try {
    auto text = from_json<EntryText>(Json::parse(*body, nullptr, false), "entry");
    const auto parts = key_from_json(text.key);
    if (!parts || (key && parts->digest() != *key)) return std::nullopt;
    return CacheEntry{parts->preimage(), std::move(text.outputs)};
  } catch (const InputError&) {
    return std::nullopt;
  }
}

bool FileLock::is_of(const std::string& path) const {
  struct stat own {
  }, there{};
  return held() && ::fstat(file_.get(), &own) == 0 && ::lstat(path.c_str(), &there) == 0 &&
         own.st_dev == there.st_dev && own.st_ino == there.st_ino;
}

FileLock FileLock::take(const std::string& path, int operation) {
  FileLock lock;
  Descriptor file{::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666)};
  if (file.get() < 0) return lock;
  int rc;
  do rc = ::flock(file.get(), operation);
  while (rc != 0 && errno == EINTR && (operation & LOCK_NB) == 0);
  lock.busy_ = rc != 0 && (errno == EWOULDBLOCK || errno == EINTR);
  if (rc == 0) lock.file_ = std::move(file);
  return lock;
}

FileLock FileLock::wait(const std::string& path, Mode mode) {
  return take(path, mode == Mode::kShared ? LOCK_SH : LOCK_EX);
}

FileLock FileLock::attempt(const std::string& path) { return take(path, LOCK_EX | LOCK_NB); }

}  // namespace texmesh
