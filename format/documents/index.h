#pragma once
#include <vector>

#include "format/base/sha256.h"
#include "format/base/vec.h"

namespace texmesh {

/// Where an entry's data stands in the container, and its digest.
struct EntryRef {
  std::string path;
  std::uint64_t offset = 0, bytes = 0;  // of the data, not of the local header
  Sha256 digest{};
  friend bool operator==(const EntryRef&, const EntryRef&) = default;
};

/// An entry that a client may read in pages: its first head_bytes bytes tell where the pages are
/// and their digests.
struct PagedRef : EntryRef {
  std::uint64_t head_bytes = 0;
  Sha256 head_digest{};
  friend bool operator==(const PagedRef&, const PagedRef&) = default;
};

/// Where mesh/stream.bin stands. Its digest is the index's; a client that takes blocks of it checks the head
/// by this and the blocks by the head.
struct StreamRef {
  std::uint64_t offset = 0, bytes = 0, head_bytes = 0;
  Sha256 head_digest{};
  friend bool operator==(const StreamRef&, const StreamRef&) = default;
};

/// poster.jpg: one picture of the whole object, for lists and search engines.
struct PosterRef : EntryRef {
  std::uint32_t width_px = 0, height_px = 0;
  friend bool operator==(const PosterRef&, const PosterRef&) = default;
};

struct ByteRange {
  std::uint64_t offset = 0, bytes = 0;
  friend bool operator==(const ByteRange&, const ByteRange&) = default;
};

/// index.bin: every entry except manifest.json and index.bin itself. Page 0 holds the entries that belong
/// to no texture plane, then one page per plane (SPEC.md). A client that needs one plane reads the head
/// and that page.
inline constexpr std::uint32_t kNoPlane = kNoIndex;
struct IndexPage {
  std::uint32_t plane = kNoPlane;
  std::uint32_t entries = 0;
  std::uint64_t offset = 0, bytes = 0;  // within index.bin
  Sha256 digest{};
  friend bool operator==(const IndexPage&, const IndexPage&) = default;
};
struct IndexHead {
  int minor = 0;
  std::uint64_t bytes = 0;  // of the head itself
  std::vector<IndexPage> pages;
};
/// `entries` in container order. FormatError when paths are invalid or repeated, or offsets do not rise.
std::vector<std::uint8_t> write_index(const std::vector<EntryRef>& entries, int minor = 0);
/// `bytes` may stop after the head.
IndexHead read_index_head(std::span<const std::uint8_t> bytes);
/// One page's bytes, digest checked; entries in container order.
std::vector<EntryRef> read_index_page(const IndexHead& head, std::size_t page,
                                      std::span<const std::uint8_t> bytes);
/// All pages, every digest checked, merged into container order.
std::vector<EntryRef> read_index(std::span<const std::uint8_t> bytes);
/// The same of gltf/index.bin, which has files for viewers of glTF alone.
std::vector<EntryRef> read_gltf_index(std::span<const std::uint8_t> bytes);

}  // namespace texmesh
