#pragma once

#include "format/base/sha256.h"

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

}  // namespace texmesh
