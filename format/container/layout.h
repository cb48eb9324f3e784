#pragma once

#include "format/base/bytes.h"

namespace texmesh {

/// Major version of packages that this library writes and reads (SPEC.md, Version history).
inline constexpr int kFormatMajor = 2;
/// Latest minor version that this library knows. It reads packages of later ones, too, and writes the least
/// that a package needs: needed_minor().
inline constexpr int kFormatMinor = 1;

/// What a reader says it has found instead of kFormatMajor.
inline std::string describe_other_major(int major) {
  return std::to_string(major) + (major < kFormatMajor ? ", which is no longer read: compile the model again"
                                                       : ", which a later reader is for");
}

/// Magic word and version, with which index.bin, tables.bin and thesis.bin begin.
inline void write_entry_start(BytesOut& out, std::string_view magic, int minor) {
  out.text(magic);
  out.u16(kFormatMajor);
  out.u16(static_cast<std::uint64_t>(minor));
}
/// The minor version. RuleError for another magic word (`magic_rule`) or major version (W03).
inline int read_entry_start(BytesIn& in, std::string_view magic, const char* magic_rule) {
  under_rule(magic_rule, [&] { in.expect("the magic " + std::string(magic), magic); });
  if (const auto major = under_rule(magic_rule, [&] { return in.u16(); }); major != kFormatMajor)
    fail_by("W03", in, "major version " + std::to_string(kFormatMajor), describe_other_major(major));
  return under_rule(magic_rule, [&] { return in.u16(); });
}

// Paths of a package's entries and the order in which they stand in the container (SPEC.md, section Entries).

inline constexpr const char* kManifestPath = "manifest.json";
inline constexpr const char* kIndexPath = "index.bin";
inline constexpr const char* kTablesPath = "tables.bin";
inline constexpr const char* kTexturesPath = "textures.json";
inline constexpr const char* kQualityPath = "quality.json";
inline constexpr const char* kProvenancePath = "provenance.json";
inline constexpr const char* kAboutPath = "about.json";
// Not every package has these:
inline constexpr const char* kSplitStreamPath = "mesh/stream.bin";
inline constexpr const char* kPosterPath = "poster.jpg";
inline constexpr const char* kThesisPath = "thesis.bin";
inline constexpr const char* kAnnotationsPath = "annotations.json";
/// The index of the files for viewers of glTF, which index.bin does not name (SPEC.md, section 21).
inline constexpr const char* kGltfIndexPath = "gltf/index.bin";

/// A C2PA manifest store over the container, where there is one: the last entry, named by neither manifest
/// nor index, because it signs them; and its most bytes.
inline constexpr const char* kContentCredentialPath = "META-INF/content_credential.c2pa";
inline constexpr std::uint64_t kMaxContentCredentialBytes = std::uint64_t{64} << 20;

/// Media type of a container.
inline constexpr const char* kContainerMediaType = "application/vnd.texmesh+zip";

/// Most texture planes of a package, mips included, and most rungs of a plane.
inline constexpr std::uint32_t kMaxPackagePlanes = 10000, kMaxPackageRungs = 100;
/// Most baked proxies of a package.
inline constexpr std::uint32_t kMaxPackageProxies = 8;

std::string mesh_path(int scale);                                // mesh/s07.glb
std::string proxy_path(std::uint32_t proxy);                     // proxies/00.glb; 0 = the smallest
std::string preview_path(std::uint32_t plane);                   // preview/003.jpg
std::string table_streams_path(std::uint32_t plane);             // texture/3/tables.pack
std::string rung_path(std::uint32_t plane, std::uint32_t rung);  // texture/3/r07.pack; 0 = lowest rung
/// source/003.png: the source image of a full-size plane as it was; not every plane has one.
inline constexpr std::string_view kSourceExtensions[] = {"jpg", "png", "tif", "webp", "exr"};
std::string source_path(std::uint32_t plane, std::string_view extension);
/// texture/3/r07/0123.jpg: one fragment as a complete file of its codec (CodecTraits::extension), in trees
/// made with `unpack --fragments files` only.
std::string fragment_file_path(std::uint32_t plane, std::uint32_t rung, std::uint32_t fragment,
                               std::string_view extension = "jpg");

/// A scale of the stream as a GLB, and a whole plane at the quality of a rung: files for viewers of glTF.
std::string gltf_scale_path(int scale);                                // gltf/s07.glb
std::string gltf_image_path(std::uint32_t plane, std::uint32_t rung);  // gltf/003-r01.jpg

/// What a path stands for; kOther for paths that this version does not define.
enum class EntryKind : std::uint8_t {
  kManifest,
  kIndex,
  kTables,
  kTextures,
  kQuality,
  kMesh,
  kProxy,
  kPreview,
  kTableStreams,
  kRung,
  kFragmentFile,
  kSource,
  kSplitStream,
  kPoster,
  kThesis,
  kOther,
  kProvenance,
  kAbout,
  kAnnotations,
  kGltfIndex,
  kGltfScale,
  kGltfImage,
  kContentCredential
};
struct EntryName {
  EntryKind kind = EntryKind::kOther;
  std::uint32_t number =
      0;  // scale of a mesh; number of a proxy; plane of everything that belongs to a texture
  std::uint32_t rung = 0, fragment = 0;
  std::string_view extension = "jpg";  // of a fragment file or source
};
/// Only canonical spellings count: mesh/s7.glb is kOther.
EntryName parse_entry_path(const std::string& path);
/// A file for viewers of glTF, the index of these among them.
inline bool is_gltf_file(const std::string& path) { return path.starts_with("gltf/"); }

/// The one order that SPEC.md prescribes for a set of entries: the first picture (the smallest proxy, else
/// the coarsest GLB), what a first plan needs, then the other meshes (the stream, GLBs from coarse to fine)
/// between texture rungs from low to high, provenance, and files for viewers of glTF last. Depends on the set
/// only, not on its order.
std::vector<std::string> streaming_order(std::vector<std::string> paths);

}  // namespace texmesh
