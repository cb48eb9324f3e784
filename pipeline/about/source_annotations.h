#pragma once

#include "format/base/note.h"
#include "format/documents/annotations.h"

namespace texmesh {

/// Most bytes of a file of notes; what annotations.json itself may have is less.
inline constexpr std::uint64_t kMaxNotesFileBytes = 16'000'000;

/// Notes from a file: texmesh's own form (schemas/annotations.v2.schema.json; without "frame" coordinates are
/// the source's), Sketchfab's list of annotations (z up there), Voyager's SVX document, or W3C Web
/// Annotations, as IIIF points them at places (PointSelector, WktSelector "POINT Z"). Our own form is read
/// strictly. Of the others what cannot be kept is left out, and a note tells how much. Texts become plain
/// text. InputError for what is none of these, for a file without any note at a point, and for more than
/// kMaxAnnotations.
Annotations read_source_annotations(std::span<const std::uint8_t> json, const std::string& file,
                                    Notes& notes);

/// The notes of a file, as annotations.json has them.
std::string read_notes_file(const std::string& path, Notes& notes);

}  // namespace texmesh
