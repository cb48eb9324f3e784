#pragma once
#include <optional>

#include "format/container/layout.h"
#include "format/documents/index.h"

namespace texmesh {

/// The manifest with its ZIP header fits in this many bytes, whatever the model: one request
/// bootstraps a client.
inline constexpr std::uint64_t kBootstrapBytes = 16384;
/// "Enough at any size": display_px of S_0 and the last step's up_to_px.
inline constexpr double kAnyDisplayPx = 1e9;
/// Longest title in bytes of UTF-8; control characters are not allowed in it.
inline constexpr std::size_t kMaxTitleBytes = 200;
/// What a client asks for in its first request. A container whose first picture ends within these bytes is
/// shown after one round trip (see start_bytes()).
inline constexpr std::uint64_t kStartBytes = 45056;

/// The measured figures (errors, p95, p99, display_px_*) are written with six significant digits.
struct ManifestScale {
  int scale = 0;  // scale number; 0 = S_0
  std::uint32_t triangles = 0, vertices = 0;
  // What a client reads for the scale: the entry mesh_path(scale), or a prefix of the vertex-split stream.
  // Then the path is kSplitStreamPath, and bytes and digest are those of the prefix.
  EntryRef glb;
  bool has_glb() const { return glb.path != kSplitStreamPath; }
  bool major = false;
  double error_max = 0, error_rms = 0;  // object units
  double p95 = 0, p99 = 0;              // relative distance to S_0 (perceptual value), 0 for S_0
  // Displayed object height in px up to which the scale is enough; kAnyDisplayPx for S_0:
  double display_px_jnd = 0, display_px_error = 0, display_px_edge = 0;
  // The same by lit pictures: from the table's least height up to this one no view of the scale can be told
  // from S_0's (stages/quality); 0 = at no height.
  double display_px_flip = 0;
  // Why it has more vertices than its scale asks for, or why no scale is coarser; else "".
  std::string floor;
  friend bool operator==(const ManifestScale&, const ManifestScale&) = default;
};

/// The whole object with textures of its own in a small GLB that any viewer opens alone.
struct ManifestProxy {
  EntryRef glb;  // proxy_path(k), k its place in Manifest::proxies
  std::uint32_t triangles = 0, vertices = 0;
  std::uint32_t texture_px = 0;  // longest side of its textures; 0 = it has none
  // Mean FLIP of lit pictures against S_0 with the source's textures, and its 95th percentile, 0..1: one per
  // Manifest::proxy_sizes_px.
  std::vector<double> flip, flip_p95;
  friend bool operator==(const ManifestProxy&, const ManifestProxy&) = default;
};
/// Most displayed heights at which proxies are measured, and the largest of them, px.
inline constexpr std::size_t kMaxProxySizes = 8;
inline constexpr double kMaxProxySizePx = 65536;
/// Longest side that a proxy's textures may have.
inline constexpr std::uint32_t kMaxProxyTexturePx = 8192;

/// Longest side of a poster, px, and most bytes of its file.
inline constexpr std::uint32_t kMaxPosterSide = 4096;
inline constexpr std::uint64_t kMaxPosterBytes = 1'000'000;
/// Longest ManifestScale::floor, bytes.
inline constexpr std::size_t kMaxFloorBytes = 100;

/// One step of the step function displayed size -> scale, coarse to fine; the last step's
/// up_to_px is kAnyDisplayPx.
struct ManifestStep {
  double up_to_px = 0;
  int scale = 0;
  friend bool operator==(const ManifestStep&, const ManifestStep&) = default;
};

/// manifest.json (SPEC.md, section Manifest; schemas/manifest.v2.schema.json).
struct Manifest {
  int major = kFormatMajor, minor = 0;
  std::vector<std::string> required_features;  // a reader must know every one of them
  std::string title;                           // option; "" by default
  Vec3d origin;                                // local frame -> source coordinates
  Vec3d bounds_min, bounds_max;                // local frame, object units
  double object_height = 0;                    // O_V
  double surface_area = 0;                     // of S_0, object units squared, six digits
  double jnd = 0.1;
  std::vector<ManifestScale> scales;  // S_0 first
  std::vector<ManifestStep> steps;    // by the default rule, see viewing.h
  std::vector<double>
      proxy_sizes_px;  // displayed heights of ManifestProxy::flip, rising; none without proxies
  std::vector<ManifestProxy> proxies;  // bytes rise strictly
  std::uint32_t plane_count = 0;       // texture planes, mips included, see textures.json
  PagedRef index, tables;
  EntryRef textures, quality, provenance, about;
  std::optional<StreamRef> stream;  // vertex splits
  std::optional<EntryRef> thesis;   // thesis_tables.h
  std::optional<PosterRef> poster;
  std::optional<EntryRef> annotations;  // annotations.h; from 2.1 on
  std::optional<EntryRef> gltf;         // index of the files for viewers of glTF; from 2.1 on
  friend bool operator==(const Manifest&, const Manifest&) = default;
};

/// What a client shows first: the smallest proxy, where there is none the GLB of the coarsest scale.
const EntryRef& first_picture(const Manifest& manifest);
/// Bytes from the container's begin to the end of the first picture.
std::uint64_t start_bytes(const Manifest& manifest);

/// Canonical JSON: fixed key order, shortest round-trip numbers, no blanks. FormatError when the manifest
/// breaks a rule that read_manifest checks, or does not fit kBootstrapBytes with its ZIP header.
std::string write_manifest(const Manifest& manifest);
/// Strict for what this version defines (types, ranges, order, digests), ignores unknown fields, refuses an
/// unknown major version and unknown required features. FormatError names the JSON pointer. Blanks after the
/// JSON are allowed.
Manifest read_manifest(std::span<const std::uint8_t> json);

}  // namespace texmesh
