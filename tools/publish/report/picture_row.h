#pragma once
#include <string>
#include <vector>

#include "format/base/bytes.h"
#include "stages/measure/picture.h"

namespace texmesh {

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

}  // namespace texmesh
