#pragma once

#include "delivery/cpp/package/package_reader.h"
#include "format/base/finding.h"
#include "pipeline/io/record.h"

namespace texmesh {

struct UnpackOptions {
  bool fragment_files = false;  // also every fragment as a complete JPEG
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

/// A tree made with `unpack --fragments files` holds, beside the entries of the package, every fragment as a
/// complete image file (fragment_file_path) for servers without Range requests, and this index of them
/// (schemas/fragments.v1.schema.json). Neither is part of the package: `pack` leaves them out again. Other
/// trees have an index without planes: a browser that asked for it in vain would print an error.
inline constexpr const char* kFragmentIndexPath = "fragments.json";

/// Bytes and digests of the fragment files of one package, in the order in which a client wants them.
struct FragmentIndex {
  struct Rung {
    std::vector<std::uint64_t> bytes;  // per fragment of the plane's order: of the complete file; 0 = no file
    std::vector<std::string> digests;  // its SHA-256's first 8 bytes, 16 lower-case digits; zeros = no file
    static void fields(auto& s, auto&& v) {
      v("bytes", s.bytes, Range{0, 4294967296.0}, "");
      v("sha256", s.digests, "");
    }
  };
  struct Plane {
    std::vector<std::uint16_t> order;  // as PlaneTables::order
    std::vector<Rung> rungs;
    static void fields(auto& s, auto&& v) {
      v("order", s.order, "");
      v("rungs", s.rungs, "");
    }
  };
  std::vector<Plane> planes;
  static void fields(auto& s, auto&& v) {
    v("version", Constant{1}, "");
    v("planes", s.planes, "");
  }
};
/// Strict; FormatError names the JSON pointer.
FragmentIndex read_fragment_index(std::span<const std::uint8_t> json);

/// Every fragment file of a tree against the index and against the tree's own rung entries: all there, none
/// besides, bytes and digests as stated, contents equal. Findings of check "fragment-file".
void check_fragment_files(PackageStore& folder, const std::vector<ContainerEntry>& listed,
                          const std::vector<TextureInfo>& textures, const PackageTables& tables,
                          Findings& findings);

}  // namespace texmesh
