#pragma once
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "delivery/cpp/package/plane_streams.h"
#include "format/base/bytes.h"
#include "format/container/layout.h"
#include "format/documents/manifest.h"
#include "format/documents/tables.h"
#include "format/documents/textures.h"
#include "stages/base/run_context.h"
#include "tools/inspect/verify/verify_checks.h"
#include "tools/inspect/verify/verify_store.h"

namespace texmesh {

// A part of verify_package; no interface.

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

}  // namespace texmesh
