#pragma once
#include <cstddef>

#include "format/base/bytes.h"

namespace texmesh {

/// Writes `bytes` under `path` so that the path holds either what it held before or all of the new bytes,
/// whatever happens: temporary sibling, write, fdatasync, rename, fsync of the folder. On any failure the
/// temporary is removed and fail_to_write() tells. `temporary` may
/// name the sibling (a parent process that wants to remove it if this one is killed; should somebody else be
/// writing a file of that name, another one is taken); "" makes a name of its own.
void write_file_atomically(const std::string& path, ByteSpan bytes, const std::string& temporary = "");

/// Throws PermissionError where this path cannot be written by this user, else ResourceError. `step`: the
/// call that failed with `error`, "" where it goes without saying.
[[noreturn]] void fail_to_write(const std::string& path, const std::string& step, int error);

/// A device, a pipe, a socket, a link to one, or a name beneath /dev or /proc: it is written into, never
/// replaced by a file.
bool is_special_file(const std::string& path);

/// Writes a file that a user has named: where a special file stands, into it; where a symbolic link stands,
/// what it leads to (atomically, and the link stays); else as write_file_atomically.
void write_output_file(const std::string& path, ByteSpan bytes, const std::string& temporary = "");

/// Throws InputError when write_output_file() could not write there, PermissionError where this user may not:
/// for commands that work long before they do.
void check_output_file(const std::string& path);

/// The name of a temporary sibling of `path`. It says which process of which machine writes it
/// (owner_mark()); `number` tells those of one process apart.
std::string temporary_name(const std::string& path, std::size_t number);

/// Removes what a killed process has left of write_file_atomically: `path` must have a temporary's name, and
/// its writer must be gone (owner_may_live()). False when it was not removed.
bool remove_stale_temporary(const std::string& path);

/// The same for every file of a folder whose name without the temporary's ending ends with `ending`. Returns
/// how many were removed; a folder that cannot be listed holds none.
std::size_t remove_stale_temporaries(const std::string& folder, const std::string& ending);

/// True when `path` is a regular file that holds exactly these bytes.
bool file_holds(const std::string& path, ByteSpan bytes);

}  // namespace texmesh
