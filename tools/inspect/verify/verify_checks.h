#pragma once

#include "delivery/cpp/package/package_rules.h"
#include "stages/base/run_context.h"

namespace texmesh {

struct Provenance;

// The rules of verify.h, each over documents that have been read or bytes whose place is known. All add
// findings and go on.

/// Figures of the manifest that must agree: bounds, object height, scales from fine to coarse,
/// the step function.
void check_manifest(const Manifest& manifest, Findings& findings);

/// thesis.bin against what tables.bin says of the scales that are stored: fragments, Q_i, D_i(Gamma).
void check_thesis(const Manifest& manifest, const PackageTables& tables, const ThesisTables& thesis,
                  Findings& findings);

/// Scales and groups are those of the package, S_0 loses nothing, and the manifest's switch sizes lie between
/// the heights that were rendered.
void check_quality(const Manifest& manifest, const std::vector<TextureInfo>& textures,
                   const QualityTable& quality, Findings& findings);
void check_about(const Manifest& manifest, const About& about, Findings& findings);
void check_provenance(const Manifest& manifest, const std::vector<TextureInfo>& textures,
                      const Provenance& provenance, Findings& findings);

/// A GLB and what manifest and index say about it and about the previews that it shows. Returns its
/// positions, sorted; none when the GLB is broken. Textures without refs have not been found in the index; no
/// textures at all: textures.json could not be read, which has its finding.
std::vector<Vec3d> check_mesh(const Manifest& manifest, const ManifestScale& scale,
                              const std::optional<std::vector<TextureInfo>>& textures,
                              std::span<const std::uint8_t> glb, Findings& findings);

/// Files for viewers of glTF (SPEC.md, section 21): a scale of the stream as a GLB, whose images are among
/// `index`; a whole plane. True for a GLB that can be read.
bool check_gltf_scale(const Manifest& manifest, const std::vector<EntryRef>& index,
                      const std::vector<TextureInfo>& textures, const EntryRef& entry,
                      std::span<const std::uint8_t> glb, Findings& findings);
void check_gltf_image(const std::vector<TextureInfo>& textures, const std::string& entry,
                      std::span<const std::uint8_t> jpeg, Findings& findings);

/// What the GLBs of a package have in common, as JSON texts.
struct MeshShare {
  std::string materials, names;  // materials, textures and samplers; names of nodes
  std::size_t material_count = 0;
  bool known = false;
};

/// The first GLB says what is shared; the others must have the same. Where meshes list names of parts,
/// feature ids count them. `glb` has passed check_glb.
void check_shared(const std::string& entry, std::span<const std::uint8_t> glb, MeshShare& share,
                  Findings& findings);

/// A proxy and what the manifest says about it: a GLB that stands alone, within the model's bounds.
void check_proxy(const Manifest& manifest, const ManifestProxy& proxy, std::span<const std::uint8_t> glb,
                 Findings& findings);

/// Every position of a coarser scale is one of the finer scale, to the bit. Both sorted; an empty
/// list says nothing.
void check_nested(const ManifestScale& finer, const std::vector<Vec3d>& finer_positions,
                  const ManifestScale& coarser, const std::vector<Vec3d>& coarser_positions,
                  Findings& findings);

/// The stream of vertex splits: its head against the manifest, every block, and the triangles of every scale
/// it passes; its groups are of the files' materials. FormatError where it cannot be decoded.
void check_split_stream(const Manifest& manifest, std::span<const std::uint8_t> bytes, const MeshShare& share,
                        const RunContext& context, Findings& findings);

}  // namespace texmesh
