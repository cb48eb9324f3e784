#include "pipeline/cache/disk_store.h"

#include <fcntl.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <set>
#include <thread>

#include "format/base/text_bytes.h"
#include "pipeline/cache/cache_files.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/machine.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;

class LockClaim : public Claim {
 public:
  explicit LockClaim(FileLock lock) : lock_(std::move(lock)) {}

 private:
  FileLock lock_;
};

/// running/<name>: named after this process, and locked while it lives. Pruning, which removes what nobody
/// holds and what no live process has made, may come between making the file and locking it.
class RunningBuild {
 public:
  explicit RunningBuild(const std::string& folder) {
    static std::atomic<unsigned> counter{0};
    constexpr int kAttempts = 1000;
    for (int i = 0; i < kAttempts; ++i) {
      path_ = folder + "/running/" + owner_mark() + "-" + std::to_string(counter++);
      lock_ = FileLock::attempt(path_);
      if (!lock_.held() && !lock_.busy()) return;  // locks do not work here
      if (!lock_.is_of(path_)) continue;
      ::utimensat(AT_FDCWD, path_.c_str(), nullptr, 0);  // this build's start
      return;
    }
  }
  ~RunningBuild() {
    if (lock_.is_of(path_)) ::unlink(path_.c_str());
  }
  RunningBuild(const RunningBuild&) = delete;
  RunningBuild& operator=(const RunningBuild&) = delete;

 private:
  std::string path_;
  FileLock lock_;
};

class DiskStore : public Store {
 public:
  DiskStore(const std::string& folder, bool writes)
      : folder_(folder), writes_(writes), start_ns_(wall_clock_ns()) {
    if (!writes_) return;
    if (const std::string reason = make_cache_folder(folder); !reason.empty())
      throw InputError(folder, "", "a cache folder", reason);
    running_.emplace(folder);
  }

  std::optional<std::vector<StoredBlob>> find(const Sha256& key) override {
    const FileLock gate = pass_gate();
    const std::string path = place("ac", key);
    const auto file = read(path);
    if (!file) return std::nullopt;
    auto entry = read_entry(file->bytes, key);
    if (!entry) {
      quarantine(path, *file, "the entry of a result does not have its digest");
      return std::nullopt;
    }
    for (const StoredBlob& b : entry->outputs)
      if (!verify(b)) return std::nullopt;
    touch(path);
    return std::move(entry->outputs);
  }

  SharedBytes load(const StoredBlob& blob) override {
    const std::string path = place("cas", blob.digest);
    auto file = read(path);
    if (!file) return nullptr;
    if (!is_verified(blob.digest, file->stamp) && !check(path, blob, *file)) return nullptr;
    return std::make_shared<const Bytes>(std::move(file->bytes));
  }

  bool put(const Key& key, const std::vector<std::pair<std::string, SharedBytes>>& outputs) override {
    if (!writes_) return false;
    const FileLock gate = pass_gate();
    CacheEntry entry{key.preimage(), {}};
    for (const auto& [name, bytes] : outputs) {
      const StoredBlob blob{name, sha256(*bytes), bytes->size()};
      const std::string path = place("cas", blob.digest);
      // A blob that is there already may be damaged: look, which moves it away.
      const bool was_there = stamp_of(path) && verify(blob);
      if (was_there)  // pruning that has listed it without this new user must see that it is used
        ::utimensat(AT_FDCWD, path.c_str(), nullptr, 0);
      else if (!publish_object(path, *bytes))
        return not_written();
      entry.outputs.push_back(blob);
    }
    const std::string text = write_entry(entry);
    return publish_object(place("ac", key.digest()), text_bytes(text)) || not_written();
  }

  std::optional<std::string> preimage(const Sha256& key) override {
    const auto bytes = read_whole(place("ac", key));
    const auto entry = bytes ? read_entry(*bytes, key) : std::nullopt;
    return entry ? std::optional(entry->preimage) : std::nullopt;
  }

  void reject(const Sha256& key, const std::vector<StoredBlob>& found, const std::string& reason) override {
    const FileLock gate = pass_gate();
    const std::string path = place("ac", key);
    const auto file = read(path);
    const auto entry = file ? read_entry(file->bytes, key) : std::nullopt;
    if (entry && entry->outputs == found)  // not what somebody else has put in its place meanwhile
      quarantine(path, *file, "the entry of a result names what is none (" + reason + ")");
  }

  std::optional<std::string> find_note(const Sha256& key) override {
    const std::string path = place("notes", key);
    const auto file = read(path);
    if (!file) return std::nullopt;
    auto text = unseal(file->bytes);
    if (text)
      touch(path);
    else
      quarantine(path, *file, "a note does not have its digest");
    return text;
  }

  bool put_note(const Sha256& key, const std::string& text) override {
    if (!writes_) return false;
    const std::string path = place("notes", key), sealed = seal(text);
    if (file_holds(path, text_bytes(sealed))) return true;
    std::error_code ec;
    fs::create_directories(fs::path(path).parent_path(), ec);
    try {
      write_file_atomically(path, text_bytes(sealed));
      return true;
    } catch (const InputError&) {
      return not_written();
    }
  }

  /// Polls, so that Ctrl-C ends the wait. A prefix of the key is enough: two keys that share a file wait for
  /// each other, which costs time and never more, and the folder stays small.
  std::unique_ptr<Claim> claim(const Sha256& key, const RunContext& context) override {
    if (!writes_) return nullptr;
    const std::string path = folder_ + "/locks/" + to_hex(key).substr(0, 3);
    for (;;) {
      FileLock lock = FileLock::attempt(path);
      if (lock.held()) return std::make_unique<LockClaim>(std::move(lock));
      if (!lock.busy()) return nullptr;
      context.check_cancelled();
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }

  std::vector<StoreEvent> take_events() override {
    const std::lock_guard lock(mutex_);
    return std::exchange(events_, {});
  }

 private:
  /// Nobody prunes while it is held.
  FileLock pass_gate() const {
    return writes_ ? FileLock::wait(folder_ + "/gate", FileLock::Mode::kShared) : FileLock();
  }

  std::string place(const char* kind, const Sha256& digest) const {
    return folder_ + "/" + object_path(kind, digest);
  }

  struct ReadFile {
    FileStamp stamp;  // from before the bytes were read
    Bytes bytes;
  };
  static std::optional<ReadFile> read(const std::string& path) {
    const auto stamp = stamp_of(path);
    auto bytes = stamp ? read_whole(path) : std::nullopt;
    if (!bytes) return std::nullopt;
    return ReadFile{*stamp, std::move(*bytes)};
  }

  /// A use moves an entry to the young end of the queue, at most hourly (pruning knows of that hour).
  void touch(const std::string& path) const {
    if (!writes_) return;
    struct stat s {};
    if (::stat(path.c_str(), &s) == 0 &&
        stamp_of(s).modified_ns < start_ns_ - kTouchInterval_s * 1'000'000'000)
      ::utimensat(AT_FDCWD, path.c_str(), nullptr, 0);
  }

  bool is_verified(const Sha256& digest, const std::optional<FileStamp>& stamp) {
    const std::lock_guard lock(mutex_);
    const auto it = verified_.find(digest);
    return stamp && it != verified_.end() && it->second == *stamp;
  }

  bool verify(const StoredBlob& blob) {
    const std::string path = place("cas", blob.digest);
    if (is_verified(blob.digest, stamp_of(path))) return true;
    const auto file = read(path);
    return file && check(path, blob, *file);
  }

  bool check(const std::string& path, const StoredBlob& blob, const ReadFile& file) {
    if (file.bytes.size() != blob.bytes || sha256(file.bytes) != blob.digest) {
      quarantine(path, file, "the result " + blob.name + " does not have its digest");
      return false;
    }
    touch(path);
    if (const auto stamp = stamp_of(path); stamp && stamp->is_settled(wall_clock_ns())) {
      const std::lock_guard lock(mutex_);
      verified_[blob.digest] = *stamp;
    }
    return true;
  }

  /// Tells of every damaged file once, however many threads and processes have read it.
  void quarantine(const std::string& path, const ReadFile& read, const std::string& what) {
    std::string fate = "left where it is";
    bool moved = false;
    if (writes_) {
      const QuarantineResult result = move_to_quarantine(folder_, path, read.stamp);
      if (result.fate == QuarantineResult::Fate::kReplaced) return;  // whoever has moved it tells of it
      moved = result.fate == QuarantineResult::Fate::kMoved;
      fate = (moved ? "moved to quarantine/" + fs::path(path).filename().string()
                    : "it could not be moved away (" + result.reason + ")") +
             ", computed again";
    }
    const std::lock_guard lock(mutex_);
    if (moved || told_where_it_is_.insert(path).second)
      events_.push_back({"cache-entry-damaged", what + "; " + fate});
  }

  bool not_written() {
    const std::lock_guard lock(mutex_);
    if (!std::exchange(told_not_written_, true))
      events_.push_back(
          {"cache-not-written", "results cannot be kept in " + folder_ + " (is the disk full?)"});
    return false;
  }

  std::string folder_;
  bool writes_;
  std::optional<RunningBuild> running_;
  std::int64_t start_ns_;
  std::mutex mutex_;
  std::map<Sha256, FileStamp> verified_;  // only stamps that prove something
  std::vector<StoreEvent> events_;
  std::set<std::string> told_where_it_is_;  // paths of damaged files that stay
  bool told_not_written_ = false;
};

}  // namespace

std::unique_ptr<Store> open_disk_store(const std::string& folder) {
  return std::make_unique<DiskStore>(folder, true);
}

std::unique_ptr<Store> look_into_disk_store(const std::string& folder) {
  return std::make_unique<DiskStore>(folder, false);
}

std::string make_cache_folder(const std::string& folder) {
  std::error_code ec;
  for (const char* part : {"ac", "cas", "notes", "memo", "locks", "running"}) {
    fs::create_directories(fs::path(folder) / part, ec);
    if (ec) return ec.message();
  }
  return "";
}

std::string default_cache_folder(const std::string& flag) {
  if (!flag.empty()) return flag;
  auto variable = [](const char* name) {
    const char* v = std::getenv(name);
    return std::string(v ? v : "");
  };
  if (const std::string v = variable("TEXMESH_CACHE"); !v.empty()) return v;
  if (const std::string v = variable("XDG_CACHE_HOME"); !v.empty() && v.front() == '/') return v + "/texmesh";
  if (const std::string v = variable("HOME"); !v.empty()) return v + "/.cache/texmesh";
  return "";
}

}  // namespace texmesh
