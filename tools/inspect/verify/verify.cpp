#include "tools/inspect/verify/verify.h"

#include <zlib.h>

#include <algorithm>
#include <cstdio>
#include <new>
#include <nlohmann/json.hpp>

#include "format/base/json_fields.h"
#include "format/documents/index.h"
#include "pipeline/io/record.h"
#include "stages/jpeg/jpeg.h"
#include "tools/inspect/fragment_files.h"
#include "tools/inspect/provenance.h"
#include "tools/inspect/verify/verify_checks.h"

namespace texmesh {

template <>
struct RecordFields<Finding> {
  static void fields(auto& s, auto&& v) {
    v("check", s.check, FieldRule{.pattern = "^[a-z0-9-]+$"}, "");
    v("rule", s.rule, FieldRule{.pattern = "^([A-Z][0-9][0-9])?$"},
      "the rule of format/SPEC.md that is broken");
    v("entry", s.entry, "");
    v("field", s.field, "");
    v("expected", s.expected, "");
    v("found", s.found, "");
  }
};

template <>
struct RecordFields<VerifiedPackage> {
  static void fields(auto& s, auto&& v) {
    v("package", s.package, "");
    v("ok", s.report.findings.empty(), "");
    v("entries", s.report.entries, "");
    v("bytes", s.report.bytes, "");
    v("meshes", s.report.meshes, "");
    v("previews", s.report.previews, "");
    v("fragments", s.report.fragments, "");
    v("content_credential", s.report.content_credential, "there is one; what it says was not checked");
    v("findings", s.report.findings, "");
  }
};

namespace {

/// What verify --json prints.
struct VerifiedPackages {
  std::vector<VerifiedPackage> packages;
  static void fields(auto& s, auto&& v) {
    v("packages", s.packages, "");
  }
};

constexpr std::uint64_t kMostProvenanceBytes = 64u << 20;

/// Runs `body`; what it throws about the package becomes a finding, and the result is false.
template <class Body>
bool guarded(Findings& findings, const Check& check, const std::string& entry, Body&& body) {
  try {
    body();
    return true;
  } catch (const FormatError& e) {
    findings.add(check, entry, e);
  } catch (const std::bad_alloc&) {
    findings.add(check, entry, "", "data that fits the memory limit", "more");
  }
  return false;
}

std::uint32_t crc_of(std::span<const std::uint8_t> bytes) {
  return static_cast<std::uint32_t>(crc32_z(crc32_z(0, nullptr, 0), bytes.data(), bytes.size()));
}

std::string hex8(std::uint32_t v) {
  char text[12];
  std::snprintf(text, sizeof text, "%08x", v);
  return text;
}

/// Reads the entries of a package, each compared with its digest and with what the container says of it.
class CheckedStore {
 public:
  /// Adds to `findings`, and to the entries and bytes of `report`.
  CheckedStore(PackageStore& store, Findings& findings, VerifyReport& report)
      : store_(store), findings_(findings), report_(report) {}

  void list_entries();
  Bytes read_manifest();
  /// FormatError when the bytes are not there.
  Bytes read(const EntryRef& ref);
  /// The index names exactly what is there, in the order that the format prescribes.
  void check_entry_set(std::vector<EntryRef> index, const EntryRef& index_entry);

  PackageStore& store() { return store_; }
  const std::vector<ContainerEntry>& listed() const { return listed_; }
  bool contains(const std::string& path) const { return by_path_.contains(path); }

 private:
  void check_content_credential(const ContainerEntry& entry);
  void check_stored(const std::string& path, const Bytes& bytes, std::uint64_t offset);

  PackageStore& store_;
  Findings& findings_;
  VerifyReport& report_;
  std::vector<ContainerEntry> listed_;
  std::map<std::string, const ContainerEntry*> by_path_;
};

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

/// The documents of a package, as far as they could be read.
struct VerifiedDocuments {
  Manifest manifest;
  std::vector<EntryRef> index;
  std::optional<std::vector<TextureInfo>> textures;
  std::optional<PackageTables> tables;
  std::vector<bool> consistent;  // per plane: textures.json and tables.bin describe the same grid and rungs
};

/// Looks at the entries that are no documents, against the documents.
class EntryVerifier {
 public:
  EntryVerifier(CheckedStore& store, const VerifiedDocuments& package, const RunContext& context,
                Findings& findings, VerifyReport& report)
      : store_(store), package_(package), context_(context), findings_(findings), report_(report) {}

  /// In container order.
  void check_entry(const EntryRef& e);
  /// Fragment files of `unpack --fragments files`: each is its fragment with the rung's tables in front.
  void check_extra_files();

 private:
  void check_mesh_entry(const EntryRef& e, int number);
  void check_proxy_entry(const EntryRef& e, std::size_t number);
  void check_texture_entry(const EntryRef& e, const EntryName& name);
  void check_source_entry(const EntryRef& e, const EntryName& name);
  void check_poster_entry(const EntryRef& e);
  void check_rung_entry(const TextureInfo& info, const PlaneTables& t, const EntryName& name, Bytes bytes);

  CheckedStore& store_;
  const VerifiedDocuments& package_;
  const RunContext& context_;
  Findings& findings_;
  VerifyReport& report_;
  const ManifestScale* coarser_ = nullptr;  // the mesh looked at last
  std::vector<Vec3d> coarser_positions_;
  MeshShare share_;
  std::map<std::uint32_t, PlaneStreams> streams_;  // per plane
};

void EntryVerifier::check_entry(const EntryRef& e) {
  const EntryName name = parse_entry_path(e.path);
  const bool texture = name.kind == EntryKind::kPreview || name.kind == EntryKind::kTableStreams ||
                       name.kind == EntryKind::kRung;
  if (name.kind == EntryKind::kMesh) {
    guarded(findings_, "entry-read", e.path, [&] { check_mesh_entry(e, static_cast<int>(name.number)); });
  } else if (name.kind == EntryKind::kProxy) {
    guarded(findings_, "entry-read", e.path, [&] { check_proxy_entry(e, name.number); });
  } else if (texture) {
    guarded(findings_, "entry-read", e.path, [&] { check_texture_entry(e, name); });
  } else if (name.kind == EntryKind::kSplitStream) {
    guarded(findings_, {"split-stream", "S08"}, e.path,
            [&] { check_split_stream(package_.manifest, store_.read(e), share_, context_, findings_); });
  } else if (name.kind == EntryKind::kPoster) {
    guarded(findings_, {"poster", "O01"}, e.path, [&] { check_poster_entry(e); });
  } else if (name.kind == EntryKind::kThesis) {
    findings_.require(package_.manifest.thesis.has_value(), {"entry-set", "E03"}, e.path, "",
                      "to be named by the manifest", "not there");
  } else if (name.kind == EntryKind::kSource) {
    guarded(findings_, {"source", "O02"}, e.path, [&] { check_source_entry(e, name); });
  } else if (name.kind == EntryKind::kOther || name.kind == EntryKind::kFragmentFile) {
    findings_.require(package_.manifest.minor > kFormatMinor, {"entry-unknown", "E03"}, e.path, "",
                      "an entry that format " + std::to_string(kFormatMajor) + "." +
                          std::to_string(kFormatMinor) + " defines",
                      "another");
    guarded(findings_, "entry-read", e.path, [&] { store_.read(e); });
  }
}

void EntryVerifier::check_mesh_entry(const EntryRef& e, int number) {
  const Bytes bytes = store_.read(e);
  const auto scale = std::find_if(package_.manifest.scales.begin(), package_.manifest.scales.end(),
                                  [&](const ManifestScale& s) { return s.scale == number; });
  if (!findings_.require(scale != package_.manifest.scales.end() && scale->has_glb(), {"entry-set", "E03"},
                         e.path, "", "a file of a scale of the manifest", "none"))
    return;
  ++report_.meshes;
  std::vector<Vec3d> positions = check_mesh(package_.manifest, *scale, package_.textures, bytes, findings_);
  if (!positions.empty()) check_shared(e.path, bytes, share_, findings_);
  // Meshes stand from coarse to fine; any other order is a finding of "entry-order".
  if (coarser_ && coarser_->scale > scale->scale)
    check_nested(*scale, positions, *coarser_, coarser_positions_, findings_);
  coarser_ = &*scale;
  coarser_positions_ = std::move(positions);
}

void EntryVerifier::check_proxy_entry(const EntryRef& e, std::size_t number) {
  const Bytes bytes = store_.read(e);
  const std::vector<ManifestProxy>& proxies = package_.manifest.proxies;
  if (!findings_.require(number < proxies.size(), "entry-set", e.path, "", "to be named by the manifest",
                         "not there"))
    return;
  ++report_.meshes;
  check_proxy(package_.manifest, proxies[number], bytes, findings_);
}

void EntryVerifier::check_texture_entry(const EntryRef& e, const EntryName& name) {
  const Bytes bytes = store_.read(e);
  if (!package_.textures || !package_.tables) return;  // they have their findings
  const std::size_t plane = name.number;
  if (!findings_.require(plane < package_.textures->size(), {"entry-set", "E03"}, e.path, "",
                         "a plane of textures.json", "none"))
    return;
  const TextureInfo& info = (*package_.textures)[plane];
  if (name.kind == EntryKind::kPreview) {
    ++report_.previews;
    check_preview(info, bytes, findings_);
  }
  if (plane >= package_.consistent.size() || !package_.consistent[plane]) return;
  const PlaneTables& t = package_.tables->planes[plane];
  if (name.kind == EntryKind::kTableStreams) {
    check_table_streams(info, t, bytes, findings_);
  } else if (name.kind == EntryKind::kRung) {
    if (!findings_.require(name.rung < t.rung_count(), {"entry-set", "E03"}, e.path, "",
                           "a rung of textures.json", "none"))
      return;
    check_rung_entry(info, t, name, bytes);
  }
}

void EntryVerifier::check_source_entry(const EntryRef& e, const EntryName& name) {
  Bytes bytes = store_.read(e);
  if (!package_.textures) return;
  const bool named = name.number < package_.textures->size() &&
                     (*package_.textures)[name.number].source_extension == name.extension;
  if (findings_.require(named, {"entry-set", "E03"}, e.path, "", "to be named by textures.json", "not there"))
    check_source((*package_.textures)[name.number], std::move(bytes), findings_);
}

void EntryVerifier::check_poster_entry(const EntryRef& e) {
  const Bytes bytes = store_.read(e);
  const std::optional<PosterRef>& poster = package_.manifest.poster;
  if (!findings_.require(poster.has_value(), {"entry-set", "E03"}, e.path, "", "to be named by the manifest",
                         "not there"))
    return;
  const Pixels pixels = decode_jpeg(bytes, std::uint64_t{kMaxPosterSide} * kMaxPosterSide);
  findings_.require_equal(poster->width_px, pixels.width_px, {"poster", "O01"}, e.path, "width");
  findings_.require_equal(poster->height_px, pixels.height_px, {"poster", "O01"}, e.path, "height");
}

void EntryVerifier::check_rung_entry(const TextureInfo& info, const PlaneTables& t, const EntryName& name,
                                     Bytes bytes) {
  std::uint64_t table_bytes = 0, rung_bytes = 0;
  for (const std::uint32_t n : t.table_bytes) table_bytes += n;
  for (std::size_t f = 0; f < t.fragment_count(); ++f)
    rung_bytes += t.size_bytes[name.rung * t.fragment_count() + f];
  if (info.tables.bytes != table_bytes || bytes.size() != rung_bytes) return;  // check_textures says so
  auto streams = streams_.find(name.number);
  if (streams == streams_.end())
    streams =
        streams_.try_emplace(name.number, info.codec, t, store_.store().read(info.tables, 0, table_bytes))
            .first;
  streams->second.add_pack(name.rung, std::move(bytes));
  report_.fragments += check_rung(info, t, name.rung, streams->second, context_, findings_);
}

void EntryVerifier::check_extra_files() {
  if (!package_.textures || !package_.tables || !store_.contains(kFragmentIndexPath)) {
    for (const ContainerEntry& e : store_.listed())
      if (parse_entry_path(e.path).kind == EntryKind::kFragmentFile)
        findings_.add("fragment-file", e.path, "",
                      std::string("a ") + kFragmentIndexPath + " beside fragment files", "none");
    return;
  }
  if (std::find(package_.consistent.begin(), package_.consistent.end(), false) != package_.consistent.end())
    return;
  guarded(findings_, "fragment-file", kFragmentIndexPath, [&] {
    check_fragment_files(store_.store(), store_.listed(), *package_.textures, *package_.tables, findings_);
  });
}

class Verifier {
 public:
  Verifier(PackageStore& store, const RunContext& context)
      : store_(store, findings_, report_), context_(context) {}

  VerifyReport run() {
    store_.list_entries();
    for (const char* path :
         {kIndexPath, kTablesPath, kTexturesPath, kQualityPath, kAboutPath, kProvenancePath})
      findings_.require(store_.listed().empty() || store_.contains(path), {"entry-set", "E01"}, path, "",
                        "an entry of the package", "none");
    if (read_bootstrap() && read_index_entry()) {
      store_.check_entry_set(package_.index, package_.manifest.index);
      check_manifest(package_.manifest, findings_);
      check_references(package_.manifest, package_.index, findings_);
      read_documents();
      check_entries();
    }
    report_.findings = findings_.release();
    return std::move(report_);
  }

 private:
  bool read_bootstrap() {
    return guarded(findings_, "manifest", kManifestPath,
                   [&] { package_.manifest = read_manifest(store_.read_manifest()); });
  }

  bool read_index_entry() {
    return guarded(findings_, "index", kIndexPath, [&] {
      const Bytes bytes = store_.read(package_.manifest.index);
      package_.index = read_index(bytes);
      const IndexHead head = read_index_head(bytes);
      check_minor(head.minor, kIndexPath);
      check_head(package_.manifest.index, bytes, head.bytes, "/index");
    });
  }

  void check_minor(int minor, const char* entry) {
    findings_.require_equal(package_.manifest.minor, minor, {"version", "R01"}, entry, "minor version");
  }

  void check_head(const PagedRef& ref, const Bytes& bytes, std::uint64_t head_bytes,
                  const std::string& field) {
    if (!findings_.require_equal(head_bytes, ref.head_bytes, {"reference", "R02"}, kManifestPath,
                                 field + "/headBytes"))
      return;
    findings_.require_equal(to_hex(sha256(std::span(bytes).first(static_cast<std::size_t>(head_bytes)))),
                            to_hex(ref.head_digest), {"reference", "R02"}, kManifestPath,
                            field + "/headSha256");
  }

  void read_documents() {
    guarded(findings_, "textures", kTexturesPath, [&] {
      auto textures = read_textures(store_.read(package_.manifest.textures));
      resolve_textures(textures, package_.index);
      package_.textures = std::move(textures);
    });
    guarded(findings_, "tables", kTablesPath, [&] {
      const Bytes bytes = store_.read(package_.manifest.tables);
      package_.tables = read_tables(bytes);
      const TablesHead head = read_tables_head(bytes);
      check_minor(head.minor, kTablesPath);
      check_head(package_.manifest.tables, bytes, head.bytes, "/tables");
    });
    guarded(findings_, "thesis", kThesisPath, [&] {
      if (!package_.manifest.thesis) return;
      const ThesisFile thesis = read_thesis(store_.read(*package_.manifest.thesis));
      check_minor(thesis.minor, kThesisPath);
      if (package_.tables) check_thesis(package_.manifest, *package_.tables, thesis.tables, findings_);
    });
    guarded(findings_, "quality", kQualityPath, [&] {
      const QualityTable quality = read_quality(store_.read(package_.manifest.quality));
      if (package_.textures) check_quality(package_.manifest, *package_.textures, quality, findings_);
    });
    guarded(findings_, "about", kAboutPath, [&] {
      check_about(package_.manifest, read_about(store_.read(package_.manifest.about)), findings_);
    });
    guarded(findings_, {"provenance", "O03"}, kProvenancePath, [&] {
      const Bytes bytes = store_.read(package_.manifest.provenance);
      parse_json(bytes, kProvenancePath, kMostProvenanceBytes);  // by the rules of all documents
      const Provenance provenance = read_provenance(bytes);
      check_provenance(package_.manifest, package_.textures.value_or(std::vector<TextureInfo>{}), provenance,
                       findings_);
    });
    if (!package_.textures || !package_.tables) return;
    check_textures(package_.manifest, *package_.textures, *package_.tables, findings_);
    // Streams can be cut out of the packs only where grids and rungs agree.
    for (std::size_t k = 0; k < std::min(package_.textures->size(), package_.tables->planes.size()); ++k) {
      const TextureInfo& info = (*package_.textures)[k];
      const PlaneTables& t = package_.tables->planes[k];
      package_.consistent.push_back(info.columns == t.columns && info.rows == t.rows &&
                                    info.rungs.size() == t.rung_count());
      if (package_.consistent.back()) check_plane_tables(info, static_cast<std::uint32_t>(k), t, findings_);
    }
  }

  void check_entries() {
    EntryVerifier entries(store_, package_, context_, findings_, report_);
    for (std::size_t k = 0; k < package_.index.size(); ++k) {
      context_.check_cancelled();
      context_.report(static_cast<double>(k) / static_cast<double>(package_.index.size()));
      entries.check_entry(package_.index[k]);
    }
    if (store_.store().is_folder()) entries.check_extra_files();
  }

  Findings findings_;
  VerifyReport report_;
  CheckedStore store_;
  const RunContext& context_;
  VerifiedDocuments package_;
};

}  // namespace

VerifyReport verify_package(PackageStore& store, const RunContext& context) {
  return Verifier(store, context).run();
}

std::string verify_json(const std::vector<VerifiedPackage>& packages) {
  return to_json_line(VerifiedPackages{packages});
}

DocumentSchema verify_schema() {
  return document_schema("verify.v1", "texmesh verify report, version 1",
                         "Output of `texmesh verify PKG... --json`.", schema_of<VerifiedPackages>());
}

}  // namespace texmesh
