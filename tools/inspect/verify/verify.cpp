#include "tools/inspect/verify/verify.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "format/base/json_fields.h"
#include "format/base/sha256.h"
#include "format/container/layout.h"
#include "format/documents/index.h"
#include "tools/inspect/provenance.h"
#include "tools/inspect/verify/verify_checks.h"
#include "tools/inspect/verify/verify_entries.h"
#include "tools/inspect/verify/verify_guard.h"
#include "tools/inspect/verify/verify_store.h"

namespace texmesh {
namespace {

constexpr std::uint64_t kMostProvenanceBytes = 64u << 20;

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

}  // namespace texmesh
