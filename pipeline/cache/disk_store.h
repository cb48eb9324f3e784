#pragma once
#include <memory>
#include <string>

#include "pipeline/graph/store.h"

namespace texmesh {

/// A cache folder (layout: cache_files.h). Objects are published whole and durable, blobs before the record
/// that names them; every hit verifies record and blobs by digest; what is damaged is moved to quarantine/
/// and reported. Safe between processes: results are equal whoever computes them, claims only save the work.
/// While the object lives the build is registered as running, and pruning leaves alone what it used.
/// InputError when the folder cannot be made.
std::unique_ptr<Store> open_disk_store(const std::string& folder);

/// The same folder only to look at: nothing is made, written, moved or marked as used. No error when it
/// is not there.
std::unique_ptr<Store> look_into_disk_store(const std::string& folder);

/// Makes the folder of a cache; why it cannot be made, "" when it stands.
std::string make_cache_folder(const std::string& folder);

/// --cache, else TEXMESH_CACHE, else $XDG_CACHE_HOME/texmesh, else ~/.cache/texmesh; "" when none of them is
/// there.
std::string default_cache_folder(const std::string& flag);

}  // namespace texmesh
