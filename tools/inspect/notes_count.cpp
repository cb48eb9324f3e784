#include "tools/inspect/notes_count.h"

namespace texmesh {

NotesCount count_notes(const Annotations& notes, const Manifest& manifest) {
  Box3d box;
  box.extend(manifest.bounds_min);
  box.extend(manifest.bounds_max);
  NotesCount out{notes.list.size(), annotations_outside(notes, box).size(), 0};
  const auto is_unknown = [](const AnnotationText& t) { return t.language == kUnknownLanguage; };
  for (const Annotation& a : notes.list)
    out.without_language += std::any_of(a.texts.begin(), a.texts.end(), is_unknown);
  return out;
}

std::string notes_words(const NotesCount& notes) {
  std::string words = std::to_string(notes.count);
  if (notes.outside > 0) words += ", " + std::to_string(notes.outside) + " outside the object";
  if (notes.without_language > 0)
    words += ", " + std::to_string(notes.without_language) + " without a language";
  return words;
}

}  // namespace texmesh
