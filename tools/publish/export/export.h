#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "delivery/cpp/package/package_reader.h"
#include "format/base/fields.h"
#include "stages/base/run_context.h"

namespace texmesh {

struct DocumentSchema;  // pipeline/io/record.h

/// Whose form a package gets.
enum class ExportTarget : std::uint8_t { k3dTiles, kGltfLod, kModelViewer, kOembed };
/// What --to calls the target.
template <>
struct EnumNames<ExportTarget> {
  static constexpr std::array<std::string_view, 4> names{"3dtiles", "gltf-lod", "model-viewer", "oembed"};
};

struct ExportOptions {
  ExportTarget target = ExportTarget::k3dTiles;
  double display_px = 0;    // nothing finer than this displayed height needs; 0 = the target's own default
  std::uint64_t bytes = 0;  // most bytes of the GLB, of gltf-lod and model-viewer; 0 = no limit
  bool plain = false;       // no extension that compresses; not of gltf-lod
  double screen_error_px = 16;  // 3dtiles: the error at which its viewer takes the next level
  std::string url;              // oembed: where the folder will stand, ends with a slash
  std::string provider;         // oembed; "" = the host of `url`
  std::uint32_t width_px = 640, height_px = 480;  // oembed: of the frame
  std::string script;                             // model-viewer: URL of the script; "" = kModelViewerScript
  std::string viewer;                             // oembed: folder with the built viewer
};

/// Where a page gets <model-viewer> from, and the digest that its browser asks for.
inline constexpr const char* kModelViewerScript =
    "https://cdn.jsdelivr.net/npm/@google/model-viewer@4.4.0/dist/model-viewer.min.js";
inline constexpr const char* kModelViewerIntegrity =
    "sha384-wjsPzEO+lXOf7d9csIDfAQpPt2OKuUU3m0K9qsdKIuzX4N8czSF6hdh23eAbZa3p";

struct ExportedFile {
  std::string path;  // relative to the folder
  std::vector<std::uint8_t> bytes;
};
/// A file, or a folder with all that is in it, as it stands on this machine.
struct ExportedCopy {
  std::string path, source;
};

struct Export {
  ExportTarget target = ExportTarget::k3dTiles;
  std::string package_id;  // SHA-256 of the manifest
  std::string open;        // path of the file that the target's viewer opens
  std::vector<ExportedFile> files;
  std::vector<ExportedCopy> copies;
  std::vector<std::string> notes;
};

/// A package in the form of another viewer. `path` is the package's own, for oembed, which copies it. Same
/// bytes for any thread count and machine. InputError with the reason where the target cannot hold the
/// package, FormatError when the package is damaged.
Export make_export(PackageReader& package, const std::string& path, const ExportOptions& options,
                   const RunContext& context);

/// export.json of the folder, which names its files (schemas/export.v1.schema.json).
std::string export_json(const Export& made);
DocumentSchema export_schema();

/// Writes the folder, which appears whole or not at all. An earlier export is replaced. InputError when the
/// folder holds anything else, or cannot be made.
void write_export(const Export& made, const std::string& folder);
/// The same refusals, before the work.
void check_export_folder(const std::string& folder);

}  // namespace texmesh
