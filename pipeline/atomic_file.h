#pragma once
#include <cstdint>
#include <span>
#include <string>

namespace texmesh {

/// Writes `bytes` under `path` so that the path holds either what it held before or all of the new bytes,
/// whatever happens: temporary sibling, write, fdatasync, rename, fsync of the folder. On any failure the
/// temporary is removed and InputError{path, "", "a writable file", reason} is thrown. `temporary` may name
/// the sibling (a parent process that wants to remove it if this one is killed); "" makes a name of its own.
void write_file_atomically(const std::string& path, std::span<const std::uint8_t> bytes,
                           const std::string& temporary = "");

/// True when `path` is a regular file that holds exactly these bytes.
bool file_holds(const std::string& path, std::span<const std::uint8_t> bytes);

}  // namespace texmesh
