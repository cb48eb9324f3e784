#pragma once
#include "format/documents/annotations.h"
#include "format/documents/manifest.h"
#include "pipeline/io/record.h"

namespace texmesh {

/// What can be told of a package's notes without a person who reads them.
struct NotesCount {
  std::uint64_t count = 0, outside = 0, without_language = 0;
  static void fields(auto& s, auto&& v) {
    v("count", s.count, "");
    v("outside", s.outside,
      "that lie outside the object: their coordinates are mostly of another frame or unit");
    v("without_language", s.without_language, "whose language nobody has said (und)");
  }
};

NotesCount count_notes(const Annotations& notes, const Manifest& manifest);
/// "3, 1 outside the object, 2 without a language".
std::string notes_words(const NotesCount& notes);

}  // namespace texmesh
