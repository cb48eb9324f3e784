#include "tools/inspect/verify/verify_store.h"

#include <zlib.h>

#include <algorithm>
#include <cstdio>

#include "format/base/sha256.h"
#include "format/container/layout.h"
#include "format/documents/manifest.h"
#include "tools/inspect/fragment_files.h"
#include "tools/inspect/verify/verify_guard.h"

namespace texmesh {
namespace {

std::uint32_t crc_of(std::span<const std::uint8_t> bytes) {
  return static_cast<std::uint32_t>(crc32_z(crc32_z(0, nullptr, 0), bytes.data(), bytes.size()));
}

std::string hex8(std::uint32_t v) {
  char text[12];
  std::snprintf(text, sizeof text, "%08x", v);
  return text;
}

}  // namespace

void CheckedStore::list_entries() {
  guarded(findings_, "container", "", [&] { listed_ = store_.list(); });
  for (const ContainerEntry& e : listed_) by_path_[e.path] = &e;
  if (store_.is_folder() || listed_.empty()) return;
  findings_.require_equal(std::string(kManifestPath), listed_.front().path, {"bootstrap", "K11"}, "",
                          "first entry");
  const std::uint64_t end = listed_.front().offset + listed_.front().bytes;
  findings_.require(end <= kBootstrapBytes, {"bootstrap", "K12"}, kManifestPath, "end",
                    "at most byte " + std::to_string(kBootstrapBytes), "byte " + std::to_string(end));
}

Bytes CheckedStore::read_manifest() {
  Bytes bytes = store_.read_manifest();
  check_stored(kManifestPath, bytes, 0);
  return bytes;
}

Bytes CheckedStore::read(const EntryRef& ref) {
  Bytes bytes = store_.read(ref, 0, ref.bytes);
  findings_.require_equal(to_hex(ref.digest), to_hex(sha256(bytes)), {"entry-digest", "I08"}, ref.path,
                          "sha256");
  check_stored(ref.path, bytes, ref.offset);
  return bytes;
}

void CheckedStore::check_stored(const std::string& path, const Bytes& bytes, std::uint64_t offset) {
  ++report_.entries;
  report_.bytes += bytes.size();
  const auto it = by_path_.find(path);
  if (it == by_path_.end()) return;  // check_entry_set says so
  if (!store_.is_folder())
    findings_.require_equal(hex8(crc_of(bytes)), hex8(it->second->crc32), {"entry-crc", "K07"}, path,
                            "CRC-32");
  if (!store_.is_folder() && path != kManifestPath)
    findings_.require_equal(it->second->offset, offset, {"entry-set", "I08"}, path, "offset");
  findings_.require_equal<std::uint64_t>(it->second->bytes, bytes.size(), {"entry-set", "I08"}, path,
                                         "bytes");
}

/// It is the last entry: list() has seen to that.
void CheckedStore::check_content_credential(const ContainerEntry& entry) {
  report_.content_credential = true;
  findings_.require(
      entry.bytes > 0 && entry.bytes <= kMaxContentCredentialBytes, {"content-credential", "O07"}, entry.path,
      "", "1 to " + std::to_string(kMaxContentCredentialBytes) + " bytes", std::to_string(entry.bytes));
}

void CheckedStore::check_entry_set(std::vector<EntryRef> index, const EntryRef& index_entry) {
  if (listed_.empty()) return;  // "container" says why
  index.insert(std::ranges::upper_bound(index, index_entry.offset, {}, &EntryRef::offset), index_entry);
  std::vector<std::string> named{kManifestPath};
  for (const EntryRef& e : index) named.push_back(e.path);
  for (const std::string& path : named)
    findings_.require(contains(path), {"entry-set", "I08"}, path, "",
                      "an entry of the package, as the index says", "none");
  std::vector<std::string> sorted = named;
  std::sort(sorted.begin(), sorted.end());
  for (const ContainerEntry& e : listed_) {
    const bool extra = store_.is_folder() && (parse_entry_path(e.path).kind == EntryKind::kFragmentFile ||
                                              e.path == kFragmentIndexPath);
    if (e.path == kContentCredentialPath)
      check_content_credential(e);
    else if (!extra && !std::binary_search(sorted.begin(), sorted.end(), e.path))
      findings_.add({"entry-set", "I08"}, e.path, "", "to be named by the index", "not there");
  }
  const std::vector<std::string> order = streaming_order(named);
  for (std::size_t k = 0; k < std::min(order.size(), named.size()); ++k)
    if (!findings_.require_equal(order[k], named[k], {"entry-order", "E04"}, kIndexPath,
                                 "entry " + std::to_string(k)))
      break;
}

}  // namespace texmesh
