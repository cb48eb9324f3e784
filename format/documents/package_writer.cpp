#include "format/documents/package_writer.h"

#include <algorithm>
#include <map>
#include <set>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "format/base/rule_error.h"
#include "format/container/container.h"
#include "format/container/format_version.h"
#include "format/container/layout.h"
#include "format/documents/index.h"
#include "format/documents/tables.h"
#include "format/split/split_stream.h"

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

std::vector<std::uint8_t> write_index(const std::vector<EntryRef>& entries) {
  for (const EntryRef& e : entries) check_entry(e);
  check_entry_order(entries);
  // Page 0 is always there; planes follow by number.
  std::vector<EntryRef> general;
  std::map<std::uint32_t, std::vector<EntryRef>> planes;
  for (const EntryRef& e : entries) (plane_of(e) == kNoPlane ? general : planes[plane_of(e)]).push_back(e);

  BytesOut head, pages;
  write_entry_start(head, kIndexMagic);
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

namespace {

[[noreturn]] void fail_package(const std::string& place, const std::string& expected,
                               const std::string& found) {
  throw FormatError("package", place, expected, found);
}

Bytes to_bytes(const std::string& s) { return {s.begin(), s.end()}; }

/// Places of all entries for a manifest of `manifest_bytes` bytes; `refs` are in streaming order without the
/// manifest and have their sizes.
void place_entries(std::vector<EntryRef>& refs, std::uint64_t manifest_bytes) {
  std::uint64_t at = ContainerWriter::data_offset(0, kManifestPath, manifest_bytes) + manifest_bytes;
  for (EntryRef& ref : refs) {
    ref.offset = ContainerWriter::data_offset(at, ref.path, ref.bytes);
    at = ref.offset + ref.bytes;
  }
}

/// Everything of the manifest that is known once the entries have places.
class ManifestFiller {
 public:
  ManifestFiller(Manifest& manifest, const std::map<std::string, const Bytes*>& data)
      : manifest_(manifest), data_(data) {}

  void fill(const std::vector<EntryRef>& refs) {
    by_path_.clear();
    for (const EntryRef& ref : refs) by_path_[ref.path] = &ref;
    set(manifest_.textures, kTexturesPath);
    set(manifest_.quality, kQualityPath);
    set(manifest_.provenance, kProvenancePath);
    set(manifest_.about, kAboutPath);
    set(manifest_.index, kIndexPath);
    set_head(manifest_.index, read_index_head(*data_.at(kIndexPath)).bytes);
    set(manifest_.tables, kTablesPath);
    set_head(manifest_.tables, read_tables_head(*data_.at(kTablesPath)).bytes);
    for (ManifestScale& s : manifest_.scales)
      if (s.has_glb()) set(s.glb, mesh_path(s.scale));
    for (std::size_t k = 0; k < manifest_.proxies.size(); ++k)
      set(manifest_.proxies[k].glb, proxy_path(static_cast<std::uint32_t>(k)));
    fill_stream();
    manifest_.thesis.reset();
    if (by_path_.contains(kThesisPath)) set(manifest_.thesis.emplace(), kThesisPath);
    if (manifest_.poster) set(*manifest_.poster, kPosterPath);
  }

 private:
  void set(EntryRef& ref, const std::string& path) { ref = *by_path_.at(path); }
  void set_head(PagedRef& ref, std::uint64_t head_bytes) {
    ref.head_bytes = head_bytes;
    ref.head_digest = sha256(std::span(*data_.at(ref.path)).first(static_cast<std::size_t>(head_bytes)));
  }
  void fill_stream() {
    manifest_.stream.reset();
    const auto it = by_path_.find(kSplitStreamPath);
    if (it == by_path_.end()) return;
    const Bytes& bytes = *data_.at(kSplitStreamPath);
    const SplitStreamHead head = read_split_head(bytes);
    const std::uint64_t head_bytes = head.bytes;
    manifest_.stream = StreamRef{it->second->offset, it->second->bytes, head_bytes,
                                 sha256(std::span(bytes).first(static_cast<std::size_t>(head_bytes)))};
    for (ManifestScale& s : manifest_.scales)
      if (!s.has_glb()) fill_prefix(s, head, bytes);
  }
  void fill_prefix(ManifestScale& s, const SplitStreamHead& head, const Bytes& stream) {
    const std::uint64_t bytes = split_prefix_bytes(head, s.scale);
    s.glb = {kSplitStreamPath, manifest_.stream->offset, bytes,
             sha256(std::span(stream).first(static_cast<std::size_t>(bytes)))};
  }
  Manifest& manifest_;
  const std::map<std::string, const Bytes*>& data_;
  std::map<std::string, const EntryRef*> by_path_;
};

void check_entries(const Manifest& manifest, const std::vector<TextureInfo>& textures,
                   const std::vector<PackageEntry>& entries) {
  std::set<std::string> paths;
  for (const PackageEntry& e : entries) {
    const EntryName name = parse_entry_path(e.path);
    const EntryKind kind = name.kind;
    if (kind == EntryKind::kManifest || kind == EntryKind::kIndex || kind == EntryKind::kTextures ||
        kind == EntryKind::kContentCredential)
      fail_package("entry " + e.path, "an entry that write_package does not make itself", e.path);
    if (kind == EntryKind::kProxy && name.number >= manifest.proxies.size())
      fail_package("manifest", "figures of " + e.path, "none");
    if (!paths.insert(e.path).second) fail_package("entry " + e.path, "one entry of that path", "two");
  }
  std::vector<std::string> needed{kTablesPath, kQualityPath, kProvenancePath, kAboutPath};
  if (manifest.poster) needed.emplace_back(kPosterPath);
  for (const ManifestScale& s : manifest.scales)
    needed.push_back(s.has_glb() ? mesh_path(s.scale) : kSplitStreamPath);
  for (std::uint32_t k = 0; k < manifest.proxies.size(); ++k) needed.push_back(proxy_path(k));
  for (std::uint32_t p = 0; p < textures.size(); ++p) {
    if (textures[p].mip == 0) needed.push_back(preview_path(p));
    if (!textures[p].source_extension.empty()) needed.push_back(source_path(p, textures[p].source_extension));
    needed.push_back(table_streams_path(p));
    for (std::uint32_t r = 0; r < textures[p].rung_quality.size(); ++r) needed.push_back(rung_path(p, r));
  }
  for (const std::string& path : needed)
    if (!paths.contains(path)) fail_package("entry " + path, "an entry", "none");
  if (!manifest.poster && paths.contains(kPosterPath))
    fail_package("manifest", "the poster's width and height", "none");
  if (manifest.scales.empty() || manifest.plane_count != textures.size())
    fail_package("manifest", "scales, and as many planes as textures", std::to_string(manifest.plane_count));
}

}  // namespace

std::vector<std::uint8_t> write_package(Manifest manifest, std::vector<TextureInfo> textures,
                                        const std::vector<PackageEntry>& entries) {
  check_entries(manifest, textures, entries);
  const Bytes textures_json = to_bytes(write_textures(textures));
  Bytes index;
  std::map<std::string, const Bytes*> data{{kTexturesPath, &textures_json}, {kIndexPath, &index}};
  for (const PackageEntry& e : entries) data[e.path] = &e.bytes;
  std::vector<std::string> paths;
  for (const auto& [path, unused] : data) paths.push_back(path);

  std::vector<EntryRef> refs;
  for (const std::string& path : streaming_order(paths))
    refs.push_back({path, 64, data.at(path)->size(), {}});
  for (EntryRef& ref : refs)
    if (ref.path != kIndexPath) ref.digest = sha256(*data.at(ref.path));
  const auto index_ref = std::ranges::find(refs, std::string(kIndexPath), &EntryRef::path);
  const auto without_index = [&] {
    std::vector<EntryRef> others;
    for (const EntryRef& ref : refs)
      if (ref.path != kIndexPath) others.push_back(ref);
    return others;
  };

  // The manifest holds offsets that depend on its own length. Its slot grows until the text that its size
  // leads to fits, and blanks fill the rest; it only ever grows, and offsets have few digits, so this ends
  // after a handful of rounds.
  std::uint64_t slot = 1024;
  std::string text;
  for (;;) {
    place_entries(refs, slot);
    if (index.empty()) {  // its size does not depend on the offsets in it
      index = write_index(without_index());
      index_ref->bytes = index.size();
      place_entries(refs, slot);
    }
    index = write_index(without_index());
    index_ref->digest = sha256(index);
    ManifestFiller(manifest, data).fill(refs);
    text = write_manifest(manifest);
    if (text.size() <= slot) break;
    slot = text.size();
  }
  text.resize(static_cast<std::size_t>(slot), ' ');

  Bytes package;
  package.reserve(static_cast<std::size_t>(refs.back().offset + refs.back().bytes + 300 * (refs.size() + 2)));
  ContainerWriter writer(
      [&](std::span<const std::uint8_t> part) { package.insert(package.end(), part.begin(), part.end()); });
  writer.add(kManifestPath, to_bytes(text));
  for (const EntryRef& ref : refs) writer.add(ref.path, *data.at(ref.path));
  writer.finish();
  return package;
}

}  // namespace texmesh
