#include "format/documents/index.h"

#include <map>

#include "format/container/container.h"
#include "format/container/layout.h"

namespace texmesh {
namespace {

const std::string kIndexFile = kIndexPath;
constexpr std::string_view kIndexMagic = "TXMX";
constexpr std::size_t kPageListHead = 16, kPageFixed = 44, kRecordFixed = 49;

std::uint32_t plane_of(const EntryRef& entry) {
  const EntryName name = parse_entry_path(entry.path);
  const bool textured = name.kind == EntryKind::kTableStreams || name.kind == EntryKind::kRung ||
                        name.kind == EntryKind::kFragmentFile;
  return textured ? name.number : kNoPlane;
}

/// What holds for any list of entries, whoever made it.
void check_entry(const EntryRef& e) {
  if (!is_valid_entry_path(e.path))
    throw RuleError("I06", kIndexFile, "entry " + e.path, "a valid path", "another");
  if (e.path == kManifestPath || e.path == kIndexPath || e.path == kContentCredentialPath)
    throw RuleError("I06", kIndexFile, "entry " + e.path,
                    "an entry other than manifest, index and content credential", e.path);
  if (e.offset % 64 != 0 || e.offset == 0)
    throw RuleError("I05", kIndexFile, "offset of " + e.path, "a multiple of 64, not 0",
                    std::to_string(e.offset));
  if (e.offset > std::uint64_t{1} << 53 || e.bytes > std::uint64_t{1} << 53)
    throw RuleError("I05", kIndexFile, "entry " + e.path, "offset and size up to 2^53", "more");
}

void check_entry_order(const std::vector<EntryRef>& entries) {
  std::set<std::string> paths;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const EntryRef& e = entries[i];
    if (!paths.insert(e.path).second)
      throw RuleError("I07", kIndexFile, "entry " + e.path, "each path once", "twice");
    if (i > 0 && e.offset <= entries[i - 1].offset + entries[i - 1].bytes)
      throw RuleError("I07", kIndexFile, "offset of " + e.path,
                      "more than where " + entries[i - 1].path + " ends", std::to_string(e.offset));
  }
}

Bytes write_page(const std::vector<EntryRef>& entries) {
  BytesOut out;
  for (const EntryRef& e : entries) {
    out.u64(e.offset);
    out.u64(e.bytes);
    out.raw(e.digest);
    out.u8(e.path.size());
    out.text(e.path);
  }
  return out.finish();
}

IndexHead read_pages(BytesIn& in) {
  IndexHead head;
  head.minor = read_entry_start(in, kIndexMagic, "I01");
  const std::uint64_t page_count = in.u32(), entry_count = in.u32();
  if (page_count == 0 || page_count > in.left() / kPageFixed)
    in.fail("a page count that fits the file", std::to_string(page_count));
  head.bytes = kPageListHead + page_count * kPageFixed;
  std::uint64_t offset = head.bytes, entries = 0;
  for (std::uint64_t i = 0; i < page_count; ++i) {
    IndexPage page;
    page.plane = in.u32();
    if (i == 0 ? page.plane != kNoPlane
               : page.plane == kNoPlane || (i > 1 && page.plane <= head.pages.back().plane))
      fail_by("I02", in, "page 0 without a plane, then rising planes", std::to_string(page.plane));
    page.entries = in.u32();
    page.offset = offset;
    page.bytes = in.u32();
    if (page.entries > page.bytes / kRecordFixed)
      fail_by("I04", in, "an entry count that fits the page", std::to_string(page.entries));
    const auto digest = in.raw(32);
    std::copy(digest.begin(), digest.end(), page.digest.begin());
    offset += page.bytes;
    entries += page.entries;
    head.pages.push_back(page);
  }
  if (entries != entry_count)
    in.fail(std::to_string(entry_count) + " entries on all pages", std::to_string(entries));
  return head;
}

std::vector<EntryRef> read_records(const IndexHead& head, const IndexPage& p, ByteSpan bytes,
                                   const std::string& place) {
  BytesIn in(bytes, kIndexFile + ": " + place);
  std::vector<EntryRef> entries;
  for (std::uint32_t i = 0; i < p.entries; ++i) {
    EntryRef e;
    e.offset = in.u64();
    e.bytes = in.u64();
    const auto digest = in.raw(32);
    std::copy(digest.begin(), digest.end(), e.digest.begin());
    e.path = in.text(in.u8());
    check_entry(e);
    if (plane_of(e) != p.plane) fail_by("I06", in, "entries of this page's plane", e.path);
    entries.push_back(std::move(e));
  }
  if (head.minor <= kFormatMinor) in.finish();  // later minor versions may add to a page's end
  check_entry_order(entries);
  return entries;
}

}  // namespace

std::vector<std::uint8_t> write_index(const std::vector<EntryRef>& entries, int minor) {
  for (const EntryRef& e : entries) check_entry(e);
  check_entry_order(entries);
  // Page 0 is always there; planes follow by number.
  std::vector<EntryRef> general;
  std::map<std::uint32_t, std::vector<EntryRef>> planes;
  for (const EntryRef& e : entries) (plane_of(e) == kNoPlane ? general : planes[plane_of(e)]).push_back(e);

  BytesOut head, pages;
  write_entry_start(head, kIndexMagic, minor);
  head.u32(planes.size() + 1);
  head.u32(entries.size());
  const auto add_page = [&](std::uint32_t plane, const std::vector<EntryRef>& page_entries) {
    const Bytes page = write_page(page_entries);
    head.u32(plane);
    head.u32(page_entries.size());
    head.u32(page.size());
    head.raw(sha256(page));
    pages.raw(page);
  };
  add_page(kNoPlane, general);
  for (const auto& [plane, page_entries] : planes) add_page(plane, page_entries);
  head.raw(pages.finish());
  return head.finish();
}

IndexHead read_index_head(std::span<const std::uint8_t> bytes) {
  BytesIn in(bytes, kIndexFile);
  return under_rule("I03", [&] { return read_pages(in); });
}

std::vector<EntryRef> read_index_page(const IndexHead& head, std::size_t page,
                                      std::span<const std::uint8_t> bytes) {
  const IndexPage& p = head.pages.at(page);
  const std::string place = "page " + std::to_string(page);
  if (bytes.size() != p.bytes)
    throw RuleError("I03", kIndexFile, place, std::to_string(p.bytes) + " bytes",
                    std::to_string(bytes.size()));
  if (sha256(bytes) != p.digest)
    throw RuleError("I04", kIndexFile, place, "SHA-256 " + to_hex(p.digest), to_hex(sha256(bytes)));
  return under_rule("I04", [&] { return read_records(head, p, bytes, place); });
}

std::vector<EntryRef> read_index(std::span<const std::uint8_t> bytes) {
  const IndexHead head = read_index_head(bytes);
  const IndexPage& last = head.pages.back();
  if (last.offset + last.bytes != bytes.size())
    throw RuleError("I03", kIndexFile, "", std::to_string(last.offset + last.bytes) + " bytes",
                    std::to_string(bytes.size()));
  std::vector<EntryRef> entries;
  for (std::size_t i = 0; i < head.pages.size(); ++i) {
    const IndexPage& p = head.pages[i];
    for (EntryRef& e : read_index_page(head, i, bytes.subspan(p.offset, p.bytes)))
      entries.push_back(std::move(e));
  }
  std::ranges::sort(entries, {}, &EntryRef::offset);
  check_entry_order(entries);
  return entries;
}

std::vector<EntryRef> read_gltf_index(std::span<const std::uint8_t> bytes) {
  std::vector<EntryRef> entries = under_rule("H02", [&] { return read_index(bytes); });
  for (const EntryRef& e : entries)
    if (!is_gltf_file(e.path) || e.path == kGltfIndexPath)
      throw RuleError("H02", kGltfIndexPath, "entry " + e.path, "another file under gltf/", "another");
  return entries;
}

}  // namespace texmesh
