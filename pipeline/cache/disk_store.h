#pragma once

#include <memory>

#include "pipeline/graph/store.h"

namespace texmesh {

/// A cache folder (layout: cache_files.h).
/// - Objects are published whole and durable, blobs before the entry that names them.
/// - Every hit verifies entry and blobs by digest. A damaged object is moved to quarantine/ and reported.
/// - Safe between processes: results are equal whoever computes them, and claims only save work.
/// - While the store lives, the build is registered as running, and pruning leaves the objects alone that the
///   build has used.
/// InputError when the folder cannot be made.
std::unique_ptr<Store> open_disk_store(const std::string& folder);

/// The same folder only to look at: nothing is made, written, moved or marked as used. A folder that is not
/// there is no error.
std::unique_ptr<Store> look_into_disk_store(const std::string& folder);

/// Makes the folder of a cache. Returns the reason when that fails, else "".
std::string make_cache_folder(const std::string& folder);

/// --cache, else TEXMESH_CACHE, else $XDG_CACHE_HOME/texmesh, else ~/.cache/texmesh; "" when none is set.
std::string default_cache_folder(const std::string& flag);

/// Least time between two touches of an entry that is used; see prune_cache.
inline constexpr std::int64_t kTouchInterval_s = 3600;

struct CacheLimits {
  std::uint64_t max_bytes = 20'000'000'000;  // 0 = no limit
  std::int64_t max_age_s = 90 * 86400;       // since the last use; 0 = no limit
};

/// What a cache folder holds.
struct CacheStatistics {
  std::uint64_t entries = 0, entry_bytes = 0;  // runs of stages
  std::uint64_t blobs = 0, blob_bytes = 0;     // their results
  std::uint64_t notes = 0, note_bytes = 0;
  std::uint64_t quarantined = 0, quarantined_bytes = 0;
  std::uint64_t running = 0;      // builds that use it now
  std::int64_t oldest_use_s = 0;  // seconds since the last use of the oldest entry
  std::uint64_t bytes() const { return entry_bytes + blob_bytes + note_bytes + quarantined_bytes; }
};
CacheStatistics cache_statistics(const std::string& folder);

struct PruneResult {
  std::uint64_t entries = 0, blobs = 0, others = 0, bytes = 0;  // removed
  std::uint64_t kept_bytes = 0;
  std::uint64_t kept_in_use = 0;  // entries that had to go by size or age but belong to a running build
};

/// Removes notes that are too old, temporary files of killed processes and what was quarantined a week ago;
/// then, until the folder keeps the limits, what is quarantined, the oldest first, and what has not been used
/// for longest; entries before the blobs that no other entry needs; then blobs without an entry. Never what
/// a running build has used: those are entries used later than kTouchInterval_s before the start of the
/// oldest running build. Safe beside builds and other pruning.
PruneResult prune_cache(const std::string& folder, const CacheLimits& limits);

/// prune_cache when the last one is long enough ago (a tenth of an hour) for the folder to have grown; what
/// builds call when they are done. Where size and ages are within the limits no entry is read, and blobs
/// without an entry stay.
void prune_now_and_then(const std::string& folder, const CacheLimits& limits);

struct CacheDamage {
  std::string path, reason;  // beneath the folder
};
/// Reads every object; damaged ones are moved to quarantine and listed, by path.
std::vector<CacheDamage> verify_cache(const std::string& folder);

}  // namespace texmesh
