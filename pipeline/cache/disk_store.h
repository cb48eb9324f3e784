#pragma once
#include <memory>
#include <string>

#include "pipeline/graph/store.h"

namespace texmesh {

/// A cache folder (layout: cache_files.h).
/// - Objects are published whole and durable, blobs before the record that names them.
/// - Every hit verifies record and blobs by digest. A damaged object is moved to quarantine/ and reported.
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

}  // namespace texmesh
