#pragma once
#include <vector>

#include "format/base/vec.h"
#include "format/documents/entry_ref.h"

namespace texmesh {

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
std::vector<std::uint8_t> write_index(const std::vector<EntryRef>& entries);
/// `bytes` may stop after the head.
IndexHead read_index_head(std::span<const std::uint8_t> bytes);
/// One page's bytes, digest checked; entries in container order.
std::vector<EntryRef> read_index_page(const IndexHead& head, std::size_t page,
                                      std::span<const std::uint8_t> bytes);
/// All pages, every digest checked, merged into container order.
std::vector<EntryRef> read_index(std::span<const std::uint8_t> bytes);

}  // namespace texmesh
