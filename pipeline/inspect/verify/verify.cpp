#include "pipeline/inspect/verify/verify.h"

#include <zlib.h>

#include <algorithm>
#include <map>
#include <optional>

#include "format/base/bytes.h"
#include "format/base/sha256.h"
#include "format/container/format_version.h"
#include "format/container/layout.h"
#include "pipeline/inspect/fragment_files.h"
#include "pipeline/inspect/verify/verify_checks.h"

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

class Verifier {
 public:
  Verifier(PackageStore& store, const RunContext& context) : store_(store), context_(context) {}

  VerifyReport run() {
    list_entries();
    if (read_bootstrap() && read_index_entry()) {
      check_entry_set();
      check_manifest(manifest_, findings_);
      check_references(manifest_, index_, findings_);
      read_documents();
      for (std::size_t k = 0; k < index_.size(); ++k) {
        context_.check_cancelled();
        context_.report(static_cast<double>(k) / static_cast<double>(index_.size()));
        check_entry(index_[k]);
      }
      if (store_.is_folder()) check_extra_files();
    }
    report_.findings = findings_.take();
    return std::move(report_);
  }

 private:
  /// Runs `body`, turning what it throws about the package into a finding.
  template <class F>
  bool guarded(const char* check, const std::string& entry, F&& body) {
    try {
      body();
      return true;
    } catch (const FormatError& e) {
      findings_.add(check, entry, e);
    } catch (const std::bad_alloc&) {
      findings_.add(check, entry, "", "data that fits the memory limit", "more");
    }
    return false;
  }

  void list_entries() {
    guarded("container", "", [&] { listed_ = store_.list(); });
    for (const ContainerEntry& e : listed_) by_path_[e.path] = &e;
    if (store_.is_folder() || listed_.empty()) return;
    findings_.require_equal(std::string(kManifestPath), listed_.front().path, "bootstrap", "", "first entry");
    const std::uint64_t end = listed_.front().offset + listed_.front().bytes;
    findings_.require(end <= kBootstrapBytes, "bootstrap", kManifestPath, "end",
                      "at most byte " + std::to_string(kBootstrapBytes), "byte " + std::to_string(end));
  }

  bool read_bootstrap() {
    return guarded("manifest", kManifestPath, [&] {
      const Bytes bytes = store_.read_manifest();
      check_stored(kManifestPath, bytes, 0);
      manifest_ = read_manifest(bytes);
    });
  }

  bool read_index_entry() {
    return guarded("index", kIndexPath, [&] {
      const Bytes bytes = read(manifest_.index);
      index_ = read_index(bytes);
      check_head(manifest_.index, bytes, read_index_head(bytes).bytes, "/index");
    });
  }

  void check_head(const PagedRef& ref, const Bytes& bytes, std::uint64_t head_bytes,
                  const std::string& field) {
    if (!findings_.require_equal(head_bytes, ref.head_bytes, "reference", kManifestPath,
                                 field + "/headBytes"))
      return;
    findings_.require_equal(to_hex(sha256(std::span(bytes).first(static_cast<std::size_t>(head_bytes)))),
                            to_hex(ref.head_digest), "reference", kManifestPath, field + "/headSha256");
  }

  /// The bytes of an entry, compared with the digest and the container's CRC. FormatError when they are not
  /// there.
  Bytes read(const EntryRef& ref) {
    Bytes bytes = store_.read(ref, 0, ref.bytes);
    findings_.require_equal(to_hex(ref.digest), to_hex(sha256(bytes)), "entry-digest", ref.path, "sha256");
    check_stored(ref.path, bytes, ref.offset);
    return bytes;
  }

  void check_stored(const std::string& path, const Bytes& bytes, std::uint64_t offset) {
    ++report_.entries;
    report_.bytes += bytes.size();
    const auto it = by_path_.find(path);
    if (it == by_path_.end()) return;  // check_entry_set says so
    if (!store_.is_folder())
      findings_.require_equal(hex8(crc_of(bytes)), hex8(it->second->crc32), "entry-crc", path, "CRC-32");
    if (!store_.is_folder() && path != kManifestPath)
      findings_.require_equal(it->second->offset, offset, "entry-set", path, "offset");
    findings_.require_equal<std::uint64_t>(it->second->bytes, bytes.size(), "entry-set", path, "bytes");
  }

  /// The index names exactly what is there, in the order that the format prescribes.
  void check_entry_set() {
    if (listed_.empty()) return;  // "container" says why
    std::vector<std::string> named{kManifestPath, kIndexPath};
    for (const EntryRef& e : index_) named.push_back(e.path);
    for (const std::string& path : named)
      findings_.require(by_path_.count(path) > 0, "entry-set", path, "",
                        "an entry of the package, as the index says", "none");
    std::vector<std::string> sorted = named;
    std::sort(sorted.begin(), sorted.end());
    for (const ContainerEntry& e : listed_) {
      const bool extra = store_.is_folder() && (parse_entry_path(e.path).kind == EntryKind::kFragmentFile ||
                                                e.path == kFragmentIndexPath);
      if (!extra && !std::binary_search(sorted.begin(), sorted.end(), e.path))
        findings_.add("entry-set", e.path, "", "to be named by the index", "not there");
    }
    const std::vector<std::string> order = streaming_order(named);
    for (std::size_t k = 0; k < std::min(order.size(), named.size()); ++k)
      if (!findings_.require_equal(order[k], named[k], "entry-order", kIndexPath,
                                   "entry " + std::to_string(k)))
        break;
  }

  void read_documents() {
    guarded("textures", kTexturesPath, [&] {
      auto textures = read_textures(read(manifest_.textures));
      resolve_textures(textures, index_);
      textures_ = std::move(textures);
    });
    guarded("tables", kTablesPath, [&] {
      const Bytes bytes = read(manifest_.tables);
      tables_ = read_tables(bytes);
      check_head(manifest_.tables, bytes, read_tables_head(bytes).bytes, "/tables");
    });
    guarded("quality", kQualityPath, [&] {
      const QualityTable quality = read_quality(read(manifest_.quality));
      if (tables_) check_quality(manifest_, *tables_, quality, findings_);
    });
    guarded("provenance", kProvenancePath, [&] {
      const Provenance provenance = read_provenance(read(manifest_.provenance));
      check_provenance(manifest_, textures_.value_or(std::vector<TextureInfo>{}), provenance, findings_);
    });
    if (!textures_ || !tables_) return;
    check_textures(manifest_, *textures_, *tables_, findings_);
    // Streams can be cut out of the packs only where grids and rungs agree.
    for (std::size_t k = 0; k < std::min(textures_->size(), tables_->planes.size()); ++k) {
      const TextureInfo& info = (*textures_)[k];
      const PlaneTables& t = tables_->planes[k];
      consistent_.push_back(info.columns == t.columns && info.rows == t.rows &&
                            info.rungs.size() == t.rung_count());
      if (consistent_.back()) check_plane_tables(info, static_cast<std::uint32_t>(k), t, findings_);
    }
  }

  void check_entry(const EntryRef& e) {
    const EntryName name = parse_entry_path(e.path);
    const bool texture = name.kind == EntryKind::kPreview || name.kind == EntryKind::kTableStreams ||
                         name.kind == EntryKind::kRung;
    if (name.kind == EntryKind::kMesh) {
      guarded("entry-read", e.path, [&] { check_mesh_entry(e, static_cast<int>(name.number)); });
    } else if (texture) {
      guarded("entry-read", e.path, [&] { check_texture_entry(e, name); });
    } else if (name.kind == EntryKind::kSplitStream) {
      guarded("split-stream", e.path, [&] { check_split_stream(manifest_, read(e), context_, findings_); });
    } else if (name.kind == EntryKind::kSource) {
      guarded("source", e.path, [&] { check_source_entry(e, name); });
    } else if (name.kind == EntryKind::kOther || name.kind == EntryKind::kFragmentFile) {
      findings_.require(manifest_.minor > kFormatMinor, "entry-unknown", e.path, "",
                        "an entry that format " + std::to_string(kFormatMajor) + "." +
                            std::to_string(kFormatMinor) + " defines",
                        "another");
      guarded("entry-read", e.path, [&] { read(e); });
    }
  }

  void check_mesh_entry(const EntryRef& e, int number) {
    const Bytes bytes = read(e);
    const auto scale = std::find_if(manifest_.scales.begin(), manifest_.scales.end(),
                                    [&](const ManifestScale& s) { return s.scale == number; });
    if (!findings_.require(scale != manifest_.scales.end(), "entry-set", e.path, "",
                           "a scale of the manifest", "none"))
      return;
    ++report_.meshes;
    std::vector<Vec3d> positions =
        check_mesh(manifest_, *scale, textures_.value_or(std::vector<TextureInfo>{}), bytes, findings_);
    // Meshes stand from coarse to fine; in any other order "entry-order" speaks up.
    if (coarser_ && coarser_->scale > scale->scale)
      check_nested(*scale, positions, *coarser_, coarser_positions_, findings_);
    coarser_ = &*scale;
    coarser_positions_ = std::move(positions);
  }

  void check_texture_entry(const EntryRef& e, const EntryName& name) {
    const Bytes bytes = read(e);
    if (!textures_ || !tables_) return;  // they have their findings
    const std::size_t plane = name.number;
    if (!findings_.require(plane < textures_->size(), "entry-set", e.path, "", "a plane of textures.json",
                           "none"))
      return;
    const TextureInfo& info = (*textures_)[plane];
    if (name.kind == EntryKind::kPreview) {
      ++report_.previews;
      check_preview(info, bytes, findings_);
    }
    if (plane >= consistent_.size() || !consistent_[plane]) return;
    const PlaneTables& t = tables_->planes[plane];
    if (name.kind == EntryKind::kTableStreams) {
      check_table_streams(info, t, bytes, findings_);
    } else if (name.kind == EntryKind::kRung) {
      if (!findings_.require(name.rung < t.rung_count(), "entry-set", e.path, "", "a rung of textures.json",
                             "none"))
        return;
      check_rung_entry(info, t, name, bytes);
    }
  }

  void check_source_entry(const EntryRef& e, const EntryName& name) {
    Bytes bytes = read(e);
    if (!textures_) return;
    const bool named =
        name.number < textures_->size() && (*textures_)[name.number].source_extension == name.extension;
    if (findings_.require(named, "entry-set", e.path, "", "to be named by textures.json", "not there"))
      check_source((*textures_)[name.number], std::move(bytes), findings_);
  }

  void check_rung_entry(const TextureInfo& info, const PlaneTables& t, const EntryName& name, Bytes bytes) {
    std::uint64_t table_bytes = 0, rung_bytes = 0;
    for (const std::uint32_t n : t.table_bytes) table_bytes += n;
    for (std::size_t f = 0; f < t.fragment_count(); ++f)
      rung_bytes += t.size_bytes[name.rung * t.fragment_count() + f];
    if (info.tables.bytes != table_bytes || bytes.size() != rung_bytes) return;  // check_textures says so
    auto streams = streams_.find(name.number);
    if (streams == streams_.end())
      streams =
          streams_.try_emplace(name.number, info.codec, t, store_.read(info.tables, 0, table_bytes)).first;
    streams->second.add_pack(name.rung, std::move(bytes));
    report_.fragments += check_rung(info, t, name.rung, streams->second, context_, findings_);
  }

  /// Fragment files of `unpack --fragments files`: each is its fragment with the rung's tables in front.
  void check_extra_files() {
    if (!textures_ || !tables_ || !by_path_.count(kFragmentIndexPath)) {
      for (const ContainerEntry& e : listed_)
        if (parse_entry_path(e.path).kind == EntryKind::kFragmentFile)
          findings_.add("fragment-file", e.path, "",
                        std::string("a ") + kFragmentIndexPath + " beside fragment files", "none");
      return;
    }
    if (std::find(consistent_.begin(), consistent_.end(), false) != consistent_.end()) return;
    guarded("fragment-file", kFragmentIndexPath,
            [&] { check_fragment_files(store_, listed_, *textures_, *tables_, findings_); });
  }

  PackageStore& store_;
  const RunContext& context_;
  Findings findings_;
  VerifyReport report_;
  std::vector<ContainerEntry> listed_;
  std::map<std::string, const ContainerEntry*> by_path_;
  Manifest manifest_;
  std::vector<EntryRef> index_;
  std::optional<std::vector<TextureInfo>> textures_;
  std::optional<PackageTables> tables_;
  const ManifestScale* coarser_ = nullptr;  // the mesh looked at last
  std::vector<Vec3d> coarser_positions_;
  std::vector<bool> consistent_;  // per plane: textures.json and tables.bin describe the same grid and rungs
  std::map<std::uint32_t, PlaneStreams> streams_;  // per plane
};

}  // namespace

VerifyReport verify_package(PackageStore& store, const RunContext& context) {
  return Verifier(store, context).run();
}

}  // namespace texmesh
