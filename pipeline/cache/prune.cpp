#include "pipeline/cache/prune.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <map>
#include <set>

#include "pipeline/cache/cache_files.h"
#include "pipeline/file_stamp.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;
constexpr std::int64_t kSecond_ns = 1'000'000'000, kDay_ns = 86400 * kSecond_ns;

struct Entry {
  std::string path;  // absolute
  FileStamp stamp;
};

/// Regular files beneath folder/part, by path.
std::vector<Entry> list(const std::string& folder, const char* part) {
  std::vector<Entry> entries;
  std::error_code ec;
  for (fs::recursive_directory_iterator it(folder + "/" + part, ec), end; !ec && it != end; it.increment(ec))
    if (const auto stamp = stamp_of(it->path().string())) entries.push_back({it->path().string(), *stamp});
  std::sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) { return a.path < b.path; });
  return entries;
}

std::string name_of(const Entry& e) { return fs::path(e.path).filename().string(); }

bool is_object_name(const std::string& name) {
  Sha256 digest;
  return from_hex(name, digest);
}

/// Start of the oldest build that still runs; the largest time when none does. Forgets builds that were
/// killed.
std::int64_t oldest_running_ns(const std::string& folder, std::uint64_t* count = nullptr) {
  std::int64_t oldest = std::numeric_limits<std::int64_t>::max();
  for (const Entry& e : list(folder, "running")) {
    const FileLock lock = FileLock::attempt(e.path, FileLock::Mode::kExclusive);
    if (lock.held()) {
      ::unlink(e.path.c_str());
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
      : folder_(folder), limits_(limits), now_ns_(wall_clock_ns()) {
    const std::int64_t oldest = oldest_running_ns(folder);
    in_use_since_ns_ = oldest == std::numeric_limits<std::int64_t>::max()
                           ? oldest
                           : oldest - 2 * kTouchInterval_s * kSecond_ns;
  }

  PruneResult run() {
    read_records();
    read_blobs();
    drop_records();
    drop_orphans();
    drop_others();
    result_.kept_bytes = total_bytes_;
    return result_;
  }

 private:
  struct Record {
    Entry entry;
    std::vector<std::string> blobs;  // names
  };
  struct Blob {
    Entry entry;
    std::size_t users = 0;
  };

  void read_records() {
    for (Entry& e : list(folder_, "ac")) {
      if (!is_object_name(name_of(e))) {
        strays_.push_back(std::move(e));
        continue;
      }
      Record r{e, {}};
      if (const auto bytes = read_whole(e.path, 1 << 24))
        if (const auto record = read_record(*bytes))
          for (const StoredBlob& b : record->outputs) r.blobs.push_back(to_hex(b.digest));
      total_bytes_ += e.stamp.bytes;
      records_.push_back(std::move(r));
    }
    std::stable_sort(records_.begin(), records_.end(), [](const Record& a, const Record& b) {
      return a.entry.stamp.modified_ns < b.entry.stamp.modified_ns;
    });
  }

  void read_blobs() {
    for (Entry& e : list(folder_, "cas")) {
      if (!is_object_name(name_of(e))) {
        strays_.push_back(std::move(e));
        continue;
      }
      total_bytes_ += e.stamp.bytes;
      const std::string name = name_of(e);
      blobs_.emplace(name, Blob{std::move(e), 0});
    }
    for (const Record& r : records_)
      for (const std::string& b : std::set<std::string>(r.blobs.begin(), r.blobs.end()))
        if (const auto it = blobs_.find(b); it != blobs_.end()) ++it->second.users;
  }

  bool too_old(const Entry& e) const {
    return limits_.max_age_s > 0 && e.stamp.modified_ns < now_ns_ - limits_.max_age_s * kSecond_ns;
  }
  bool too_much() const { return limits_.max_bytes > 0 && total_bytes_ > limits_.max_bytes; }

  /// Removes a file unless it has been used since it was listed: under the gate nobody looks at it meanwhile.
  bool remove(const Entry& e) {
    const FileLock gate = FileLock::wait(folder_ + "/gate", FileLock::Mode::kExclusive);
    const auto stamp = stamp_of(e.path);
    if (!stamp || stamp->modified_ns != e.stamp.modified_ns || ::unlink(e.path.c_str()) != 0) return false;
    result_.bytes += e.stamp.bytes;
    total_bytes_ -= std::min(total_bytes_, e.stamp.bytes);
    return true;
  }

  void drop_records() {
    for (const Record& r : records_) {
      if (!too_much() && !too_old(r.entry)) break;
      if (r.entry.stamp.modified_ns >= in_use_since_ns_) {
        ++result_.kept_in_use;
        continue;
      }
      if (!remove(r.entry)) continue;
      ++result_.records;
      for (const std::string& b : std::set<std::string>(r.blobs.begin(), r.blobs.end())) {
        const auto it = blobs_.find(b);
        if (it == blobs_.end() || --it->second.users > 0) continue;
        if (it->second.entry.stamp.modified_ns < in_use_since_ns_ && remove(it->second.entry))
          ++result_.blobs;
        blobs_.erase(it);
      }
    }
  }

  /// Blobs whose record was never written (a killed build) or is damaged.
  void drop_orphans() {
    for (const auto& [name, blob] : blobs_)
      if (blob.users == 0 && blob.entry.stamp.modified_ns < in_use_since_ns_ &&
          blob.entry.stamp.modified_ns < now_ns_ - kTouchInterval_s * kSecond_ns && remove(blob.entry))
        ++result_.blobs;
  }

  void drop_others() {
    for (const char* part : {"notes", "memo"})
      for (const Entry& e : list(folder_, part)) {
        total_bytes_ += e.stamp.bytes;
        if (!is_object_name(name_of(e)) && std::string(part) == "notes")
          strays_.push_back(e);
        else if (too_old(e) && remove(e))
          ++result_.others;
      }
    for (const Entry& e : list(folder_, "quarantine")) {
      total_bytes_ += e.stamp.bytes;
      if (e.stamp.changed_ns < now_ns_ - 7 * kDay_ns && remove(e)) ++result_.others;
    }
    for (const Entry& e : strays_)
      if (e.stamp.modified_ns < now_ns_ - kDay_ns && remove(e)) ++result_.others;
  }

  const std::string& folder_;
  const CacheLimits& limits_;
  std::int64_t now_ns_, in_use_since_ns_ = 0;
  std::uint64_t total_bytes_ = 0;
  std::vector<Record> records_;
  std::map<std::string, Blob> blobs_;
  std::vector<Entry> strays_;
  PruneResult result_;
};

}  // namespace

CacheStatistics cache_statistics(const std::string& folder) {
  CacheStatistics s;
  std::int64_t oldest = wall_clock_ns();
  const std::int64_t now = oldest;
  for (const Entry& e : list(folder, "ac")) {
    ++s.records;
    s.record_bytes += e.stamp.bytes;
    oldest = std::min(oldest, e.stamp.modified_ns);
  }
  for (const Entry& e : list(folder, "cas")) ++s.blobs, s.blob_bytes += e.stamp.bytes;
  for (const char* part : {"notes", "memo"})
    for (const Entry& e : list(folder, part)) ++s.notes, s.note_bytes += e.stamp.bytes;
  for (const Entry& e : list(folder, "quarantine")) ++s.quarantined, s.quarantined_bytes += e.stamp.bytes;
  oldest_running_ns(folder, &s.running);
  s.oldest_use_s = (now - oldest) / kSecond_ns;
  return s;
}

PruneResult prune_cache(const std::string& folder, const CacheLimits& limits) {
  return Pruning(folder, limits).run();
}

void prune_now_and_then(const std::string& folder, const CacheLimits& limits) {
  const std::string stamp_path = folder + "/pruned";
  const auto last = stamp_of(stamp_path);
  if (last && last->modified_ns > wall_clock_ns() - kTouchInterval_s / 10 * kSecond_ns) return;
  const int fd = ::open(stamp_path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
  if (fd < 0) return;
  ::futimens(fd, nullptr);
  ::close(fd);
  prune_cache(folder, limits);
}

std::vector<CacheDamage> verify_cache(const std::string& folder) {
  std::vector<CacheDamage> damage;
  std::error_code ec;
  const auto condemn = [&](const Entry& e, const std::string& reason) {
    fs::create_directories(folder + "/quarantine", ec);
    fs::rename(e.path, folder + "/quarantine/" + name_of(e), ec);
    damage.push_back({fs::path(e.path).lexically_relative(folder).string(), reason});
  };
  std::map<std::string, std::uint64_t> sound;
  for (const Entry& e : list(folder, "cas")) {
    Sha256 digest;
    if (!from_hex(name_of(e), digest)) continue;
    const auto bytes = read_whole(e.path);
    if (!bytes || sha256(*bytes) != digest)
      condemn(e, "the bytes do not have the digest that is their name");
    else
      sound[name_of(e)] = bytes->size();
  }
  for (const Entry& e : list(folder, "ac")) {
    Sha256 key;
    if (!from_hex(name_of(e), key)) continue;
    const auto bytes = read_whole(e.path);
    const auto record = bytes ? read_record(*bytes, key) : std::nullopt;
    if (!record) {
      condemn(e, "the record is damaged or not that of its key");
      continue;
    }
    for (const StoredBlob& b : record->outputs) {
      const auto it = sound.find(to_hex(b.digest));
      if (it != sound.end() && it->second == b.bytes) continue;
      condemn(e, "the result " + b.name + " is missing or damaged");
      break;
    }
  }
  for (const Entry& e : list(folder, "notes")) {
    if (!is_object_name(name_of(e))) continue;
    const auto bytes = read_whole(e.path);
    if (!bytes || !unseal(*bytes)) condemn(e, "the note is damaged");
  }
  std::sort(damage.begin(), damage.end(),
            [](const CacheDamage& a, const CacheDamage& b) { return a.path < b.path; });
  return damage;
}

}  // namespace texmesh
