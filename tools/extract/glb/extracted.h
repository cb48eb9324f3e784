#pragma once
#include <optional>
#include <string>

#include "tools/extract/glb/image_codecs.h"
#include "tools/render/plane_pixels.h"

namespace texmesh {

/// What kind of image a standalone file gets. kAuto: for a number of bytes what looks best, otherwise JPEG;
/// images with alpha become PNG where JPEG would be taken.
enum class ExtractImages : std::uint8_t { kAuto, kJpeg, kWebp, kPng };

/// Of a file of so many bytes, one in this many may say what the object is (about_within()).
inline constexpr std::uint64_t kAboutShare = 20;
/// Displayed height at which files of a number of bytes are compared where none is said, px.
inline constexpr double kBudgetDisplayPx = 512;

/// A standalone file's wishes: a number of bytes, or a scale and a rung, or what suits a displayed height.
struct ExtractRequest {
  std::uint64_t bytes = 0;             // most bytes of the file, 0 = no limit
  std::optional<std::uint32_t> proxy;  // this proxy and nothing else
  std::optional<int> scale;            // this one; else by `display_px`, or by the search for `bytes`
  std::uint32_t rung = kBestRung;      // of full-size planes, where `bytes` is 0
  double display_px = 0;  // displayed height, device px; 0 = not said (with `bytes`: kBudgetDisplayPx)
  ExtractImages images = ExtractImages::kAuto;
  bool recentre = false;  // the frame of the package's meshes instead of the source's coordinates
  bool metres =
      false;  // lengths in metres where the object unit is known, by a node that scales; not with `bytes`
  bool plain = false;  // no extension that compresses (plain_file()); not with `bytes` or `lods`
  bool lods = false;   // all major scales and the one chosen, as MSFT_lod
};

struct ExtractedImage {
  std::uint32_t image = 0;
  std::string role;
  FileImage format = FileImage::kJpeg;
  std::uint32_t width_px = 0, height_px = 0;
  double quality = 0;  // of its coder; 100 for PNG
  std::uint64_t bytes = 0;
};

struct Extracted {
  std::vector<std::uint8_t> glb;
  int scale = 0;                                // the finest in the file; of a proxy the package's coarsest
  std::optional<std::uint32_t> proxy;           // the file is this proxy, or made of it
  std::vector<int> levels;                      // with lods: all, finest first
  std::uint64_t triangles = 0, mesh_bytes = 0;  // mesh_bytes: everything but images; all of a whole proxy
  std::vector<ExtractedImage> images;
  /// With `bytes`: FLIP of the file's lit pictures against those of the package's best, 0 = equal, measured
  /// from `views` directions at `side_px`; -1 without.
  double difference = -1;
  double mesh_difference = -1;  // the same with the best textures instead: what the mesh alone costs
  int views = 0;
  std::uint32_t side_px = 0;
  /// With `bytes`: whether the file has at most `bytes`, and at least 98 % of them or all that the package
  /// has of the source, or is a proxy that looks better than any such file. If not, it is the nearest that
  /// the package can give.
  bool within = true;
  std::vector<std::string> notes;
};

}  // namespace texmesh
