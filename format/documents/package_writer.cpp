#include "format/documents/package_writer.h"

#include <map>

#include "format/container/container.h"
#include "format/documents/tables.h"
#include "format/split/split_stream.h"

namespace texmesh {
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
    for (auto [entry, path] :
         {std::pair(&manifest_.thesis, kThesisPath), std::pair(&manifest_.annotations, kAnnotationsPath),
          std::pair(&manifest_.gltf, kGltfIndexPath)}) {
      entry->reset();
      if (by_path_.contains(path)) set(entry->emplace(), path);
    }
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
        kind == EntryKind::kGltfIndex || kind == EntryKind::kContentCredential)
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

/// What an index names: all but itself, and either the files for viewers of glTF or the others.
std::vector<EntryRef> named_by(const std::string& index, const std::vector<EntryRef>& refs) {
  std::vector<EntryRef> named;
  std::ranges::copy_if(refs, std::back_inserter(named), [&](const EntryRef& ref) {
    return ref.path != index && is_gltf_file(ref.path) == is_gltf_file(index);
  });
  return named;
}

}  // namespace

std::vector<std::uint8_t> write_package(Manifest manifest, std::vector<TextureInfo> textures,
                                        const std::vector<PackageEntry>& entries) {
  check_entries(manifest, textures, entries);
  const Bytes textures_json = to_bytes(write_textures(textures));
  Bytes index, gltf_index;
  std::map<std::string, const Bytes*> data{{kTexturesPath, &textures_json}, {kIndexPath, &index}};
  for (const PackageEntry& e : entries) data[e.path] = &e.bytes;
  if (std::ranges::any_of(entries, [](const PackageEntry& e) { return is_gltf_file(e.path); }))
    data[kGltfIndexPath] = &gltf_index;
  std::vector<std::string> paths;
  for (const auto& [path, unused] : data) paths.push_back(path);

  std::vector<EntryRef> refs;
  for (const std::string& path : streaming_order(paths))
    refs.push_back({path, 64, data.at(path)->size(), {}});
  for (EntryRef& ref : refs)
    if (ref.path != kIndexPath && ref.path != kGltfIndexPath) ref.digest = sha256(*data.at(ref.path));
  const auto write_indices = [&] {
    for (EntryRef& ref : refs) {
      const bool of_gltf = ref.path == kGltfIndexPath;
      if (!of_gltf && ref.path != kIndexPath) continue;
      Bytes& bytes = of_gltf ? gltf_index : index;
      bytes = write_index(named_by(ref.path, refs), manifest.minor);
      ref.bytes = bytes.size();
      ref.digest = sha256(bytes);
    }
  };

  // The manifest holds offsets that depend on its own length. Its slot grows until the text that its size
  // leads to fits, and blanks fill the rest; it only ever grows, and offsets have few digits, so this ends
  // after a handful of rounds.
  std::uint64_t slot = 1024;
  std::string text;
  for (;;) {
    place_entries(refs, slot);
    if (index.empty()) {  // sizes of indices do not depend on the offsets in them
      write_indices();
      place_entries(refs, slot);
    }
    write_indices();
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
