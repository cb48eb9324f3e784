#pragma once

#include "pipeline/io/new_folder.h"
#include "tools/extract/extract.h"

namespace texmesh {

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
  ExtractImages images = ExtractImages::kAuto;  // of the GLBs; not of oembed
  bool keep_units = false;                      // lengths in object units, also where their metres are known
  double screen_error_px = 16;                  // 3dtiles: the error at which its viewer takes the next level
  std::string url;                              // oembed: where the folder will stand, ends with a slash
  std::string provider;                         // oembed; "" = the host of `url`
  std::uint32_t width_px = 640, height_px = 480;  // oembed: of the frame
  std::string script;  // model-viewer: URL of the script; "" = a copy of `viewer`'s
  std::string viewer;  // folder with the built viewer, or of model-viewer with its script (view_server.h)
};

struct ExportedFile {
  std::string path;  // relative to the folder
  std::vector<std::uint8_t> bytes;
};
/// A file, or a folder with all that is in it, as it stands on this machine.
struct ExportedCopy {
  std::string path, source;
};

struct ListedFile {
  std::string path;
  std::optional<std::uint64_t> bytes;
  static void fields(auto& s, auto&& v) {
    v("path", s.path, FieldRule{.pattern = "."},
      "Relative to the folder. Without `bytes` a copy of the package, or of the viewer's folder.");
    v("bytes", s.bytes, "");
  }
};

struct Export {
  ExportTarget target = ExportTarget::k3dTiles;
  std::string package_id;  // SHA-256 of the manifest
  std::string open;        // path of the file that the target's viewer opens
  std::vector<ExportedFile> files;
  std::vector<ExportedCopy> copies;
  std::vector<std::string> notes;
  std::vector<ListedFile> listed() const {
    std::vector<ListedFile> out;
    for (const ExportedFile& f : files) out.push_back({f.path, f.bytes.size()});
    for (const ExportedCopy& c : copies) out.push_back({c.path, {}});
    return out;
  }
  static void fields(auto& s, auto&& v) {
    v("texmeshExport", Constant{1}, "");
    v("target", s.target, "");
    v("package", s.package_id, FieldRule{.pattern = "^[0-9a-f]{64}$"},
      "Id of the package: SHA-256 of its manifest.");
    v("open", s.open, FieldRule{.pattern = "."},
      "The file that the target's viewer opens, relative to the folder.");
    v("files", s.listed(), FieldRule{.count = Range{1, 1e6}}, "");
    v("notes", s.notes, "");
  }
};

/// A package in the form of another viewer. `path` is the package's own, for oembed, which copies it. Same
/// bytes for any thread count and machine. InputError with the reason where the target cannot hold the
/// package, FormatError when the package is damaged.
Export make_export(PackageReader& package, const std::string& path, const ExportOptions& options,
                   const RunContext& context);

/// Before a package on this machine is copied: FormatError where its file has no end, or a file of its tree
/// is missing or has another size. Fragments that stand in a tree as single files are not counted.
void check_completeness(PackageReader& package);

/// export.json of the folder, which names its files (schemas/export.v1.schema.json).
std::string export_list(const Export& made);

/// Writes the folder, which appears whole or not at all. An earlier export is replaced. InputError when the
/// folder holds anything else, or cannot be made.
void write_export(const Export& made, const std::string& folder);
/// The folder that this is: new, empty, or an earlier one.
FolderRule export_folder_rule();

// The parts of exports that tests look at by themselves.

/// A scale with textures that suit a displayed height: what `texmesh extract --display` gives for it.
struct TileLevel {
  int scale = 0;
  double displayed_px = 0;  // height up to which it is shown; kAnyDisplayPx for the finest
  double texture_px = 0;    // height that the textures suit; 0 = full size
  double error_max = 0;     // of the scale as the manifest has it, object units
  std::string uri;          // of its GLB, relative to tileset.json
  friend bool operator==(const TileLevel&, const TileLevel&) = default;
};

/// Planes of the textures that suit a displayed height; of 0 those of full size.
using PlanesOfHeight = std::function<std::vector<std::uint32_t>(double displayed_px)>;
/// Finest first: what suits `display_px` (0 = everything), then what suits 4096, 2048, ... 32 px where that
/// is something else than the level before, then the coarsest scale, which a viewer shows while it waits.
/// `uri` stays "".
std::vector<TileLevel> tile_levels(const Manifest& manifest, double display_px, const PlanesOfHeight& planes);

struct Tileset {
  std::vector<TileLevel> levels;  // finest first, at least one
  Box3d bounds;                   // of all contents, in their frame (y up) and unit
  Vec3d origin;                   // where that frame stands, in its unit
  double metres = 1;              // length of the object unit in the contents' unit
  double object_height = 0;       // Manifest::object_height, object units
  double screen_error_px = 16;    // the error at which a viewer takes the next level
  std::string version;            // of the content; viewers tell tilesets apart by it
  About about;
};

/// tileset.json of 3D Tiles 1.1: one tile inside the other, the coarsest outside, refine REPLACE. What a
/// level costs is screen_error_px / displayed_px of the object's height, so that a viewer with that limit
/// changes levels at the heights that the package measured; never less than error_max. Viewers turn glTF's y
/// axis to the z axis of tiles: (x, y, z) becomes (x, -z, y), and boxes and origin here are turned so. No
/// transform scales: versions of 3D Tiles differ in what that does to errors.
std::string tileset_text(const Tileset& tileset);

/// What an oEmbed answer is about. URLs are absolute.
struct EmbeddedObject {
  About about;
  std::string page_url;       // what the frame shows
  std::string thumbnail_url;  // "" = none
  std::uint32_t thumbnail_width_px = 0, thumbnail_height_px = 0;
  std::uint32_t width_px = 640, height_px = 480;  // of the frame
  std::string provider_name, provider_url;
  static void fields(auto& s, auto&& v) {
    v("version", Constant{"1.0"}, "");
    v("type", Constant{"rich"}, "");
    v("title", s.about.title, kMayMiss, "");
    v("author_name", s.about.creator, kMayMiss, "");
    v("provider_name", s.provider_name, kMayMiss, "");
    v("provider_url", s.provider_url, kMayMiss, "");
    v("cache_age", Constant{86400}, "seconds");
    v("thumbnail_url", s.thumbnail_url, kMayMiss, "");
    v("thumbnail_width", s.thumbnail_url.empty() ? 0 : s.thumbnail_width_px, kMayMiss, "");
    v("thumbnail_height", s.thumbnail_url.empty() ? 0 : s.thumbnail_height_px, kMayMiss, "");
    v("width", s.width_px, "");
    v("height", s.height_px, "");
    v("html", embedded_frame(s), "");
    v("license", s.about.licence, kMayMiss, "");
    v("license_url", s.about.licence_url, kMayMiss, "");
    v("attribution", s.about.attribution, kMayMiss, "");
    v("description", s.about.description, kMayMiss, "");
  }
};

/// The frame as HTML, for pages and for the answer.
std::string embedded_frame(const EmbeddedObject& object);
/// An answer of oEmbed 1.0, type rich, as JSON. Beside the fields of oEmbed: license, license_url,
/// attribution and description, where they are known.
std::string oembed_answer(const EmbeddedObject& object);

}  // namespace texmesh
