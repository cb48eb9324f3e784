#pragma once

#include "format/base/note.h"
#include "format/documents/quality_table.h"

namespace texmesh {

/// What lit pictures say about the kept scales and their textures.
struct MeasuredQuality {
  QualityTable table;
  /// Per QualityTable::scales: ManifestScale::display_px_flip.
  std::vector<float> display_px_flip;
  Notes notes;  // what of the object the pictures do not show
  static void archive(auto& s, auto& a) { a(s.table, s.display_px_flip, s.notes); }
};

}  // namespace texmesh
