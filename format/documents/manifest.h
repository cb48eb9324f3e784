#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "format/base/no_index.h"
#include "format/base/sha256.h"
#include "format/base/vec.h"
#include "format/container/format_version.h"
#include "format/model/codec.h"

namespace texmesh {

/// The manifest with its ZIP header fits in this many bytes, whatever the model: one request bootstraps a
/// client.
inline constexpr std::uint64_t kBootstrapBytes = 16384;
/// "Enough at any size": display_px of S_0 and the last step's up_to_px.
inline constexpr double kAnyDisplayPx = 1e9;
/// Longest title in bytes of UTF-8; control characters are not allowed in it.
inline constexpr std::size_t kMaxTitleBytes = 200;
/// Most previews whose place the manifest itself tells; those of further planes stand in the index only.
inline constexpr std::size_t kMaxManifestPreviews = 256;

/// Where an entry's data stands in the container, and its digest.
struct EntryRef {
  std::string path;
  std::uint64_t offset = 0, bytes = 0;  // of the data, not of the local header
  Sha256 digest{};
  friend bool operator==(const EntryRef&, const EntryRef&) = default;
};

/// An entry that a client may read in pages: its first head_bytes bytes tell where the pages are and their
/// digests.
struct PagedRef : EntryRef {
  std::uint64_t head_bytes = 0;
  Sha256 head_digest{};
  friend bool operator==(const PagedRef&, const PagedRef&) = default;
};

/// Where mesh/stream.bin stands. Its digest is the index's; a client that takes blocks of it checks the head
/// by this and the blocks by the head.
struct StreamRef {
  std::uint64_t offset = 0, bytes = 0, head_bytes = 0;
  Sha256 head_digest{};
  friend bool operator==(const StreamRef&, const StreamRef&) = default;
};

struct ByteRange {
  std::uint64_t offset = 0, bytes = 0;
  friend bool operator==(const ByteRange&, const ByteRange&) = default;
};

/// The measured figures (errors, p95, p99, display_px_*) are written with six significant digits.
struct ManifestScale {
  int scale = 0;  // scale number; 0 = S_0
  std::uint32_t triangles = 0, vertices = 0;
  EntryRef glb;  // path is always mesh_path(scale)
  bool major = false;
  double error_max = 0, error_rms = 0;  // object units
  double p95 = 0, p99 = 0;              // relative distance to S_0 (perceptual value), 0 for S_0
  // Displayed object height in px up to which the scale is enough; kAnyDisplayPx for S_0:
  double display_px_jnd = 0, display_px_error = 0, display_px_edge = 0;
  std::string
      floor;  // why it has more vertices than its scale asks for, or no scale is coarser; else "" (since 1.1)
  friend bool operator==(const ManifestScale&, const ManifestScale&) = default;
};

/// Longest ManifestScale::floor, bytes.
inline constexpr std::size_t kMaxFloorBytes = 100;

/// One step of the step function displayed size -> scale, coarse to fine; the last step's up_to_px is
/// kAnyDisplayPx.
struct ManifestStep {
  double up_to_px = 0;
  int scale = 0;
  friend bool operator==(const ManifestStep&, const ManifestStep&) = default;
};

/// manifest.json (SPEC.md, section Manifest; schemas/manifest.v1.schema.json).
struct Manifest {
  int major = kFormatMajor, minor = kFormatMinor;
  std::vector<std::string> required_features;  // a reader must know every one of them
  std::string title;                           // option; "" by default
  Vec3d origin;                                // local frame -> source coordinates
  Vec3d bounds_min, bounds_max;                // local frame, object units
  double object_height = 0;                    // O_V
  double surface_area = 0;  // of S_0, object units squared, six digits; 0 = not said (since 1.1)
  double jnd = 0.1;
  std::vector<ManifestScale> scales;  // S_0 first
  std::vector<ManifestStep> steps;    // default rule: finer of JND and <= 1 px error
  std::uint32_t plane_count = 0;      // texture planes, mips included, see textures.json
  // One contiguous range: coarsest mesh, previews, table streams, with the ZIP headers between them; its
  // SHA-256.
  std::uint64_t first_picture_offset = 0, first_picture_bytes = 0;
  Sha256 first_picture_digest{};
  // Of the full-size planes 0.., at most kMaxManifestPreviews; inside the first picture.
  std::vector<ByteRange> previews;
  PagedRef index, tables;
  EntryRef textures, quality, provenance;
  std::optional<StreamRef> stream;  // vertex splits (since 1.1)
  friend bool operator==(const Manifest&, const Manifest&) = default;
};

/// Canonical JSON: fixed key order, shortest round-trip numbers, no blanks. FormatError when the manifest
/// breaks a rule that read_manifest checks, or does not fit kBootstrapBytes with its ZIP header.
std::string write_manifest(const Manifest& manifest);
/// Strict for what this version defines (types, ranges, order, digests), ignores unknown fields, refuses an
/// unknown major version and unknown required features. FormatError names the JSON pointer. Blanks after the
/// JSON are allowed.
Manifest read_manifest(std::span<const std::uint8_t> json);

/// textures.json: one element per texture plane, in plane order. It says what the planes are; where their
/// bytes stand is said by the index only, so the file needs no offsets: writing leaves offset, bytes and
/// digest of the refs out, reading fills in the paths, and resolve_textures() the rest.
struct TextureInfo {
  std::uint32_t image = 0;  // GLB image "texture/<image>"
  std::uint32_t mip = 0;    // sides are 1 / 2^mip of the full-size plane's, rounded up; 0 = full size
  std::uint32_t base = 0;   // of a mip: the full-size plane
  std::string role;  // base-colour, emissive, normal, occlusion-roughness-metallic, alpha, colour, data
  std::string name;  // as the source names the image
  std::string colour_space;  // srgb | linear
  Codec codec = Codec::kJpeg;
  std::uint32_t width_px = 0, height_px = 0, channels = 3;
  std::uint32_t fragment_width_px = 0, fragment_height_px = 0, columns = 0, rows = 0;
  std::string grid_reason;
  std::uint32_t preview_width_px = 0, preview_height_px = 0;
  EntryRef preview,             // preview/NNN.jpg; that of the full-size plane for a mip
      tables;                   // texture/<plane>/tables.pack, all rungs' table streams in rung order
  std::vector<EntryRef> rungs;  // texture/<plane>/rNN.pack, rising quality: fragments in PlaneTables::order
  std::vector<int> rung_quality;
  bool lossless = false;  // the last rung holds the coefficients of the source, a JPEG (since 1.1)
  std::string
      source_extension;  // jpg, png, tif, webp, exr: the package holds the source image; "" = it does not
  bool source_colours = true;  // its numbers are the plane's; false: import has converted them
  EntryRef source;             // source/NNN.<extension>
  friend bool operator==(const TextureInfo&, const TextureInfo&) = default;
};
/// The feature that packages with mips require.
inline constexpr const char* kMipsFeature = "mips";
/// How many of the planes have full size; they stand first.
std::size_t full_size_planes(const std::vector<TextureInfo>& textures);
std::string write_textures(const std::vector<TextureInfo>& textures);
std::vector<TextureInfo> read_textures(std::span<const std::uint8_t> json);
/// Fills offset, bytes and digest of every ref from the index; FormatError when an entry is not there.
void resolve_textures(std::vector<TextureInfo>& textures, const std::vector<EntryRef>& index);

/// index.bin: every entry except manifest.json and index.bin itself. Page 0 holds the entries that belong to
/// no texture plane, then one page per plane (SPEC.md). A client that needs one plane reads the head and that
/// page.
inline constexpr std::uint32_t kNoPlane = kNoIndex;
struct IndexPage {
  std::uint32_t plane = kNoPlane;
  std::uint32_t entries = 0;
  std::uint64_t offset = 0, bytes = 0;  // within index.bin
  Sha256 digest{};
  friend bool operator==(const IndexPage&, const IndexPage&) = default;
};
struct IndexHead {
  int minor = 0;
  std::uint64_t bytes = 0;  // of the head itself
  std::vector<IndexPage> pages;
};
/// `entries` in container order. FormatError when paths are invalid or repeated, or offsets do not rise.
std::vector<std::uint8_t> write_index(const std::vector<EntryRef>& entries);
/// `bytes` may stop after the head.
IndexHead read_index_head(std::span<const std::uint8_t> bytes);
/// One page's bytes, digest checked; entries in container order.
std::vector<EntryRef> read_index_page(const IndexHead& head, std::size_t page,
                                      std::span<const std::uint8_t> bytes);
/// All pages, every digest checked, merged into container order.
std::vector<EntryRef> read_index(std::span<const std::uint8_t> bytes);

}  // namespace texmesh
