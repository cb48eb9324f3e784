#pragma once
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "format/base/bytes.h"
#include "format/documents/about.h"
#include "format/documents/manifest.h"
#include "format/documents/quality_table.h"
#include "format/documents/tables.h"
#include "format/documents/textures.h"
#include "format/documents/thesis_tables.h"
#include "format/model/model.h"

namespace texmesh::testing {

/// A GLB file in its two parts, so that tests can break either.
struct GlbParts {
  nlohmann::json json;
  Bytes binary;
  Bytes glb() const;
};
/// A valid GLB of a mesh without compression: positions, UVs, indices; `jpeg` as image "texture/0" unless
/// empty.
GlbParts make_glb(const Mesh& mesh, const Bytes& jpeg);
/// Gives the images the place of plane 0's preview in a package's tree.
void name_previews(GlbParts& glb);

/// The meshes of make_package_parts(): the coarser one has half of the finer one's triangles.
Mesh fine_mesh();
Mesh coarse_mesh();

/// A small but true package: fine_mesh() as S_0 and coarse_mesh() as S_5, one 64 x 48 texture of 2 x 2
/// fragments of which one is uncovered, two rungs. Tests change a part, then build().
struct PackageParts {
  Manifest manifest;
  std::vector<TextureInfo> textures;
  PackageTables tables;
  ThesisTables thesis;  // of the chain S_0 to S_5; no planes: the package has none
  QualityTable quality;
  nlohmann::json provenance;
  About about;  // but for the title, which is the manifest's
  std::map<int, Bytes> meshes;
  std::vector<Bytes> proxies;            // GLBs of manifest.proxies
  std::map<std::string, Bytes> streams;  // previews, table streams, rungs by path
  Bytes build() const;
};
PackageParts make_package_parts();
/// Adds two proxies of coarse_mesh() with a preview as texture, measured at 128 and 512 px.
void add_proxies(PackageParts& parts);

/// Changes a finished package in place; entries keep their sizes.
class PackagePatcher {
 public:
  explicit PackagePatcher(Bytes package);
  Bytes entry(const std::string& path) const;
  /// New bytes of the same size under the entry, its CRC made to fit. Digests stay as they were.
  PackagePatcher& patch(const std::string& path, const Bytes& bytes);
  PackagePatcher& edit(const std::string& path, const std::function<void(Bytes&)>& change);
  /// Makes every digest (index, tables head, manifest) fit the entries again, then lets `change` alter the
  /// manifest.
  PackagePatcher& seal(const std::function<void(Manifest&)>& change = {});
  /// The same, with a change of the index's entries.
  PackagePatcher& seal_index(const std::function<void(std::vector<EntryRef>&)>& change);
  const Bytes& package() const { return package_; }

 private:
  void write_manifest_entry(Manifest manifest);
  Bytes package_;
  Manifest manifest_;
};

}  // namespace texmesh::testing
