#pragma once
#include <string>

namespace texmesh {

struct UnpackOptions {
  bool fragment_files = false;  // also every fragment as a complete JPEG (fragment_files.h)
  bool force = false;  // replace a folder that holds an unpacked package; any other folder is refused even so
};

/// Writes the entries of a package as files beneath `folder`, every digest checked on the way. All or
/// nothing: the tree is made under a temporary name beside `folder`, synced, then renamed. Throws FormatError
/// for a damaged package and InputError when `folder` is not empty or cannot be written.
void unpack_package(const std::string& package, const std::string& folder, const UnpackOptions& options);

/// The container of an unpacked tree, byte for byte the file it came from: entries in the order of the index,
/// offsets checked against it. Fragment files are left out; a rung whose entry is missing is put together
/// from them. A content credential stays the last entry. Throws FormatError when a file is missing, too many,
/// or not what its digest says.
void pack_folder(const std::string& folder, const std::string& package);

}  // namespace texmesh
