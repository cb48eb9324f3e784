#include "pipeline/cache/disk_store.h"

#include <fcntl.h>

#include <filesystem>
#include <set>

#include "pipeline/cache/cache_files.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/machine.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;
constexpr std::int64_t kSecond_ns = 1'000'000'000, kDay_ns = 86400 * kSecond_ns;

struct CacheFile {
  std::string path;  // absolute
  FileStamp stamp;
};

/// Regular files beneath folder/part, by path.
std::vector<CacheFile> list(const std::string& folder, const char* part) {
  std::vector<CacheFile> files;
  std::error_code ec;
  for (fs::recursive_directory_iterator it(folder + "/" + part, ec), end; !ec && it != end; it.increment(ec))
    if (const auto stamp = stamp_of(it->path().string())) files.push_back({it->path().string(), *stamp});
  std::sort(files.begin(), files.end(),
            [](const CacheFile& a, const CacheFile& b) { return a.path < b.path; });
  return files;
}

std::string name_of(const CacheFile& e) { return fs::path(e.path).filename().string(); }

bool is_object_name(const std::string& name) {
  Sha256 digest;
  return from_hex(name, digest);
}

/// A build is over when nobody holds its file and, where locks may be granted to all, its process is gone.
/// Names of another kind are not those of builds.
bool build_is_over(const CacheFile& e) {
  const std::string name = name_of(e);
  const std::string_view mark = std::string_view(name).substr(0, name.rfind('-'));
  return !is_owner_mark(mark) || !owner_may_live(mark, e.stamp.modified_ns);
}

/// Start of the oldest build that still runs; the largest time when none does. Forgets builds
/// that were killed.
std::int64_t oldest_running_ns(const std::string& folder, std::uint64_t* count = nullptr) {
  std::int64_t oldest = std::numeric_limits<std::int64_t>::max();
  for (const CacheFile& e : list(folder, "running")) {
    const FileLock lock = FileLock::attempt(e.path);
    if (lock.held() && build_is_over(e)) {
      if (lock.is_of(e.path)) ::unlink(e.path.c_str());
      continue;
    }
    if (count) ++*count;
    oldest = std::min(oldest, e.stamp.modified_ns);
  }
  return oldest;
}

class Pruning {
 public:
  Pruning(const std::string& folder, const CacheLimits& limits)
      : folder_(folder), limits_(limits), now_ns_(wall_clock_ns()), in_use_since_ns_(in_use_since_ns()) {}

  /// `orphans_too`: also where nothing has to go by size or age, look for blobs that no entry names.
  PruneResult run(bool orphans_too) {
    list_all();
    drop_others();
    drop_quarantined();
    if (orphans_too || too_much() || (!entries_.empty() && too_old(entries_.front().file))) {
      read_entries();
      drop_entries();
      drop_orphans();
    }
    result_.kept_bytes = total_bytes_;
    return result_;
  }

 private:
  struct Entry {
    CacheFile file;
    std::vector<std::string> blobs;  // names, each once
  };
  struct Blob {
    CacheFile file;
    std::size_t users = 0;
  };

  /// Names, sizes and times: whether anything has to go is known before any file is read.
  void list_all() {
    for (CacheFile& e : objects("ac")) entries_.push_back({std::move(e), {}});
    std::stable_sort(entries_.begin(), entries_.end(),
                     [](const Entry& a, const Entry& b) { return used_before(a.file, b.file); });
    for (CacheFile& e : objects("cas")) {
      const std::string name = name_of(e);
      blobs_.emplace(name, Blob{std::move(e), 0});
    }
    notes_ = objects("notes");
    memos_ = list(folder_, "memo");
    quarantined_ = list(folder_, "quarantine");
    for (const std::vector<CacheFile>* part : {&memos_, &quarantined_})
      for (const CacheFile& e : *part) total_bytes_ += e.stamp.bytes;
  }

  /// The files of a part that are named as objects are; counts them.
  std::vector<CacheFile> objects(const char* part) {
    std::vector<CacheFile> all;
    for (CacheFile& e : list(folder_, part)) {
      total_bytes_ += e.stamp.bytes;
      (is_object_name(name_of(e)) ? all : strays_).push_back(std::move(e));
    }
    return all;
  }

  static bool used_before(const CacheFile& a, const CacheFile& b) {
    return a.stamp.modified_ns < b.stamp.modified_ns;
  }

  /// Which blobs the entries name.
  void read_entries() {
    for (Entry& r : entries_) {
      std::set<std::string> names;
      if (const auto bytes = read_whole(r.file.path, 1 << 24))
        if (const auto entry = read_entry(*bytes))
          for (const StoredBlob& b : entry->outputs) names.insert(to_hex(b.digest));
      r.blobs.assign(names.begin(), names.end());
      for (const std::string& b : r.blobs)
        if (const auto it = blobs_.find(b); it != blobs_.end()) ++it->second.users;
    }
  }

  bool too_old(const CacheFile& e) const {
    return limits_.max_age_s > 0 && e.stamp.modified_ns < now_ns_ - limits_.max_age_s * kSecond_ns;
  }
  bool too_much() const { return limits_.max_bytes > 0 && total_bytes_ > limits_.max_bytes; }

  /// Entries used later than this may be in use by a build that runs now.
  std::int64_t in_use_since_ns() const {
    const std::int64_t oldest = oldest_running_ns(folder_);
    return oldest == std::numeric_limits<std::int64_t>::max() ? oldest
                                                              : oldest - 2 * kTouchInterval_s * kSecond_ns;
  }

  /// An entry or a blob that no running build has used. Builds start at any time: under the gate it is asked
  /// again. (What was in use when pruning began is left alone without asking, which is never too little.)
  bool remove_unused(const CacheFile& e) { return e.stamp.modified_ns < in_use_since_ns_ && remove(e, true); }

  /// Removes a file unless it has been used since it was listed: under the gate nobody looks at it meanwhile.
  bool remove(const CacheFile& e, bool only_unused = false) {
    const FileLock gate = FileLock::wait(folder_ + "/gate", FileLock::Mode::kExclusive);
    if (only_unused && e.stamp.modified_ns >= in_use_since_ns()) return false;
    const auto stamp = stamp_of(e.path);
    if (!stamp || stamp->modified_ns != e.stamp.modified_ns || ::unlink(e.path.c_str()) != 0) return false;
    result_.bytes += e.stamp.bytes;
    total_bytes_ -= std::min(total_bytes_, e.stamp.bytes);
    return true;
  }

  void drop_entries() {
    for (const Entry& r : entries_) {
      if (!too_much() && !too_old(r.file)) break;
      if (!remove_unused(r.file)) {
        ++result_.kept_in_use;
        continue;
      }
      ++result_.entries;
      for (const std::string& b : r.blobs) {
        const auto it = blobs_.find(b);
        if (it == blobs_.end() || --it->second.users > 0) continue;
        if (remove_unused(it->second.file)) ++result_.blobs;
        blobs_.erase(it);
      }
    }
  }

  /// Blobs whose entry was never written (a killed build) or is damaged.
  void drop_orphans() {
    for (const auto& [name, blob] : blobs_)
      if (blob.users == 0 && blob.file.stamp.modified_ns < now_ns_ - kTouchInterval_s * kSecond_ns &&
          remove_unused(blob.file))
        ++result_.blobs;
  }

  void drop_others() {
    for (const CacheFile& e : notes_)
      if (too_old(e) && remove(e)) ++result_.others;
    for (const CacheFile& e : memos_)
      if (drop_temporary(e) || (too_old(e) && remove(e))) ++result_.others;
    for (const CacheFile& e : strays_)
      if (drop_temporary(e) || (e.stamp.modified_ns < now_ns_ - kDay_ns && remove(e))) ++result_.others;
  }

  bool drop_temporary(const CacheFile& e) {
    if (!remove_stale_temporary(e.path)) return false;
    total_bytes_ -= std::min(total_bytes_, e.stamp.bytes);
    return true;
  }

  /// What is of no use to a build goes before any result, the oldest first (by the time of the move).
  void drop_quarantined() {
    std::stable_sort(quarantined_.begin(), quarantined_.end(), [](const CacheFile& a, const CacheFile& b) {
      return a.stamp.changed_ns < b.stamp.changed_ns;
    });
    for (const CacheFile& e : quarantined_)
      if ((too_much() || e.stamp.changed_ns < now_ns_ - 7 * kDay_ns) && remove(e)) ++result_.others;
  }

  const std::string& folder_;
  const CacheLimits& limits_;
  std::int64_t now_ns_, in_use_since_ns_;
  std::uint64_t total_bytes_ = 0;
  std::vector<Entry> entries_;
  std::map<std::string, Blob> blobs_;
  std::vector<CacheFile> notes_, memos_, quarantined_, strays_;
  PruneResult result_;
};

/// Reads every object beneath a cache folder, beside builds and pruning: what disappears meanwhile is no
/// damage, and an entry is listed before the blobs that were put before it.
class Verification {
 public:
  explicit Verification(const std::string& folder) : folder_(folder) {}

  std::vector<CacheDamage> run() {
    const std::vector<CacheFile> entries = list(folder_, "ac");
    check_each(list(folder_, "cas"), &Verification::check_blob);
    check_each(entries, &Verification::check_entry);
    check_each(list(folder_, "notes"), &Verification::check_note);
    std::sort(damage_.begin(), damage_.end(),
              [](const CacheDamage& a, const CacheDamage& b) { return a.path < b.path; });
    return damage_;
  }

 private:
  /// Listing may be long ago: a check gets the file as it is just before the check reads it.
  void check_each(const std::vector<CacheFile>& listed, void (Verification::*check)(const CacheFile&)) {
    for (const CacheFile& e : listed)
      if (const auto stamp = stamp_of(e.path)) (this->*check)({e.path, *stamp});
  }

  /// A build that has moved the file away meanwhile tells of it.
  void condemn(const CacheFile& e, const std::string& reason) {
    if (move_to_quarantine(folder_, e.path, e.stamp).fate != QuarantineResult::Fate::kReplaced)
      damage_.push_back({fs::path(e.path).lexically_relative(folder_).string(), reason});
  }

  void check_blob(const CacheFile& e) {
    Sha256 digest;
    if (!from_hex(name_of(e), digest)) return;
    const auto bytes = read_whole(e.path);
    if (!bytes || sha256(*bytes) != digest)
      condemn(e, "the bytes do not have the digest that is their name");
    else
      sound_[name_of(e)] = bytes->size();
  }

  bool is_sound(const StoredBlob& blob) {
    if (const auto it = sound_.find(to_hex(blob.digest)); it != sound_.end()) return it->second == blob.bytes;
    const auto bytes = read_whole(folder_ + "/" + object_path("cas", blob.digest));  // put since
    return bytes && bytes->size() == blob.bytes && sha256(*bytes) == blob.digest;
  }

  void check_entry(const CacheFile& e) {
    Sha256 key;
    if (!from_hex(name_of(e), key)) return;
    const FileLock gate = FileLock::wait(folder_ + "/gate", FileLock::Mode::kShared);
    const auto bytes = read_whole(e.path);
    const auto entry = bytes ? read_entry(*bytes, key) : std::nullopt;
    if (!entry) return condemn(e, "the entry is damaged or not that of its key");
    for (const StoredBlob& b : entry->outputs)
      if (!is_sound(b)) return condemn(e, "the result " + b.name + " is missing or damaged");
  }

  void check_note(const CacheFile& e) {
    if (!is_object_name(name_of(e))) return;
    const auto bytes = read_whole(e.path);
    if (!bytes || !unseal(*bytes)) condemn(e, "the note is damaged");
  }

  const std::string& folder_;
  std::map<std::string, std::uint64_t> sound_;  // blobs, with their sizes
  std::vector<CacheDamage> damage_;
};

}  // namespace

CacheStatistics cache_statistics(const std::string& folder) {
  CacheStatistics s;
  std::int64_t oldest = wall_clock_ns();
  const std::int64_t now = oldest;
  for (const CacheFile& e : list(folder, "ac")) {
    ++s.entries;
    s.entry_bytes += e.stamp.bytes;
    oldest = std::min(oldest, e.stamp.modified_ns);
  }
  for (const CacheFile& e : list(folder, "cas")) ++s.blobs, s.blob_bytes += e.stamp.bytes;
  for (const char* part : {"notes", "memo"})
    for (const CacheFile& e : list(folder, part)) ++s.notes, s.note_bytes += e.stamp.bytes;
  for (const CacheFile& e : list(folder, "quarantine")) ++s.quarantined, s.quarantined_bytes += e.stamp.bytes;
  oldest_running_ns(folder, &s.running);
  s.oldest_use_s = (now - oldest) / kSecond_ns;
  return s;
}

PruneResult prune_cache(const std::string& folder, const CacheLimits& limits) {
  return Pruning(folder, limits).run(true);
}

void prune_now_and_then(const std::string& folder, const CacheLimits& limits) {
  const std::string stamp_path = folder + "/pruned";
  const auto last = stamp_of(stamp_path);
  if (last && last->modified_ns > wall_clock_ns() - kTouchInterval_s / 10 * kSecond_ns) return;
  const int fd = ::open(stamp_path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
  if (fd < 0) return;
  ::futimens(fd, nullptr);
  ::close(fd);
  Pruning(folder, limits).run(false);
}

std::vector<CacheDamage> verify_cache(const std::string& folder) { return Verification(folder).run(); }

}  // namespace texmesh
