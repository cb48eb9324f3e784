#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "format/sha256.h"
#include "format/vec.h"

namespace texmesh {

inline constexpr int kFormatMajor = 1, kFormatMinor = 0;
/// The manifest with its ZIP header fits in this many bytes, whatever the model: one request bootstraps a client.
inline constexpr std::uint64_t kBootstrapBytes = 16384;

/// Where an entry's data stands in the container, and its digest.
struct EntryRef {
  std::string path;
  std::uint64_t offset = 0, bytes = 0;  // of the data, not of the local header
  Sha256 digest{};
  friend bool operator==(const EntryRef&, const EntryRef&) = default;
};

struct ManifestScale {
  int scale = 0;                          // scale number; 0 = S_0
  std::uint32_t triangles = 0, vertices = 0;
  EntryRef glb;
  bool major = false;
  double error_max = 0, error_rms = 0;    // object units
  double p95 = 0, p99 = 0;                // relative distance to S_0 (perceptual value), 0 for S_0
  // Displayed object height in px up to which the scale is enough; a large number (1e9) for S_0:
  double display_px_jnd = 0, display_px_error = 0, display_px_edge = 0;
  friend bool operator==(const ManifestScale&, const ManifestScale&) = default;
};

/// One step of the step function displayed size -> scale, coarse to fine; the last step's up_to_px is 1e9.
struct ManifestStep {
  double up_to_px = 0;
  int scale = 0;
  friend bool operator==(const ManifestStep&, const ManifestStep&) = default;
};

/// manifest.json (SPEC.md, section Manifest; schemas/manifest.v1.schema.json).
struct Manifest {
  int major = kFormatMajor, minor = kFormatMinor;
  std::vector<std::string> required_features;   // a reader must know every one of them
  std::string title;                            // option; "" by default
  Vec3d origin;                                 // local frame -> source coordinates
  Vec3d bounds_min, bounds_max;                 // local frame, object units
  double object_height = 0;                     // O_V
  double jnd = 0.1;
  std::vector<ManifestScale> scales;            // S_0 first
  std::vector<ManifestStep> steps;              // default rule: finer of JND and <= 1 px error
  std::uint32_t plane_count = 0;                // texture planes, see textures.json
  std::uint64_t first_picture_offset = 0, first_picture_bytes = 0;  // coarsest mesh: one contiguous range from here
  EntryRef index, tables, textures, quality, provenance;
  friend bool operator==(const Manifest&, const Manifest&) = default;
};

/// Canonical JSON: fixed key order, shortest round-trip numbers, no blanks.
std::string write_manifest(const Manifest& manifest);
/// Strict for what this version defines (types, ranges, order, digests), ignores unknown fields, refuses an unknown
/// major version and unknown required features. FormatError names the JSON pointer.
Manifest read_manifest(std::span<const std::uint8_t> json);

/// textures.json: one element per texture plane.
struct TextureInfo {
  std::uint32_t image = 0;             // GLB image "texture/<image>"
  std::string role;                    // base-colour, emissive, normal, occlusion-roughness-metallic, alpha
  std::string name;                    // as the source names the image
  std::string colour_space;            // srgb | linear
  std::string codec = "jpeg";
  std::uint32_t width_px = 0, height_px = 0, channels = 3;
  std::uint32_t fragment_width_px = 0, fragment_height_px = 0, columns = 0, rows = 0;
  std::string grid_reason;
  std::uint32_t preview_width_px = 0, preview_height_px = 0;
  EntryRef preview, tables;            // preview/<plane>.jpg; texture/<plane>/tables.pack, all rungs' table streams in rung order
  std::vector<EntryRef> rungs;         // texture/<plane>/rNN.pack, rising quality: fragments in PlaneTables::order
  std::vector<int> rung_quality;
  friend bool operator==(const TextureInfo&, const TextureInfo&) = default;
};
std::string write_textures(const std::vector<TextureInfo>& textures);
std::vector<TextureInfo> read_textures(std::span<const std::uint8_t> json);

/// index.bin: every entry except manifest.json and index.bin itself, in container order, paged (SPEC.md).
std::vector<std::uint8_t> write_index(const std::vector<EntryRef>& entries);
std::vector<EntryRef> read_index(std::span<const std::uint8_t> bytes);

}  // namespace texmesh
