#pragma once
// Inside the room only: what a report shows in colours.
#include <cstdint>
#include <string>
#include <vector>

#include "delivery/cpp/package/package_reader.h"
#include "format/base/bytes.h"
#include "format/base/vec.h"
#include "stages/data/pixels.h"
#include "stages/measure/picture.h"

namespace texmesh {

/// The colour of a value 0..1 (clipped) on a scale from black over purple and orange to pale yellow, whose
/// lightness rises evenly: it reads in grey, too. sRGB, 0..255.
Vec3<std::uint8_t> heat_colour(double value);

/// A square picture of FLIP values, `side_px` a side, in heat colours: 0 is black, `full` and more is the
/// last colour.
Pixels heat_picture(const std::vector<float>& values, std::uint32_t side_px, double full);

/// Such a colour for HTML: "#rrggbb".
std::string heat_hex(double value);

/// A file that stands beside the page.
struct ReportFile {
  std::string path;
  Bytes bytes;
};

/// FLIP that has the last colour of maps.
inline constexpr double kFullHeat = 0.4;

/// Two pictures and their FLIP map side by side, cut to what they show, as PNG files.
struct PictureRow {
  std::string name;                         // of the files: letters, digits and '-'
  std::string reference_name, tested_name;  // HTML, above the pictures
  std::string alt;                          // plain text: what is seen
  double enlarge_to_px = 220;               // small pictures are shown this wide, in whole multiples
};
/// HTML; the files are appended.
std::string picture_row(const PictureRow& row, const Picture& reference, const Picture& tested,
                        std::vector<ReportFile>& files);

/// What stands on the fragments of a plane: 0..1, -1 = not stored.
struct FragmentHeat {
  std::string name;           // plain text: what the colours mean
  std::vector<double> value;  // per fragment; empty = the grid alone
};
/// Bytes per covered texel at the best rung, and feature density eta of S_0; each over its largest value.
std::vector<FragmentHeat> fragment_heats(PackageReader& package, std::uint32_t plane);

/// The plane's preview, a file of that name beside the page, beneath the grid of fragments in heat colours.
/// HTML; `plane` is a full-size one.
std::string fragment_map(PackageReader& package, std::uint32_t plane, const FragmentHeat& heat,
                         const std::string& preview);

}  // namespace texmesh
