#pragma once
#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "format/base/fields.h"
#include "format/base/vec.h"
#include "format/documents/about.h"

namespace texmesh {

// Limits of annotations.json (SPEC.md, section annotations.json); of texts in bytes of UTF-8.
inline constexpr std::uint64_t kMaxAnnotationsBytes = 4'000'000;
inline constexpr std::size_t kMaxAnnotations = 1'000, kMaxAnnotationLanguages = 32, kMaxAnnotationImages = 8,
                             kMaxLanguageTagBytes = 35, kMaxAnnotationTitleBytes = 200,
                             kMaxAnnotationTextBytes = 10'000;
inline constexpr std::string_view kUnknownLanguage = "und";
inline constexpr double kMaxAnnotationCoordinate = 1e30;
inline constexpr double kLeastFovDegrees = 1, kMostFovDegrees = 170, kDefaultFovDegrees = 45;

/// What a note says in one language. Plain text: nothing in it is markup.
struct AnnotationText {
  std::string language;  // BCP 47, "und" where nobody has said; any well-formed tag
  std::string title, text;
  friend bool operator==(const AnnotationText&, const AnnotationText&) = default;
};

struct AnnotationCamera {
  Vec3d position, target;
  double fov_degrees = kDefaultFovDegrees;  // from the top of the picture to its bottom
  friend bool operator==(const AnnotationCamera&, const AnnotationCamera&) = default;
};

struct AnnotationImage {
  std::string url;  // http or https
  friend bool operator==(const AnnotationImage&, const AnnotationImage&) = default;
};

/// A note at a point of the object.
struct Annotation {
  Vec3d position;
  std::optional<Vec3d> normal;        // unit: where the note looks to
  std::vector<AnnotationText> texts;  // one a language, the first is shown where none suits
  std::optional<AnnotationCamera> camera;
  std::vector<AnnotationImage> images;
  friend bool operator==(const Annotation&, const Annotation&) = default;
};

/// Of what coordinates are: of the source file, or those that meshes of a package have.
enum class AnnotationFrame : std::uint8_t { kSource, kPackage };
template <>
struct EnumNames<AnnotationFrame> {
  static constexpr std::array<std::string_view, 2> names{"source", "package"};
};

struct Annotations {
  AnnotationFrame frame = AnnotationFrame::kPackage;
  std::vector<Annotation> list;  // in the order of their numbers
  friend bool operator==(const Annotations&, const Annotations&) = default;
};

/// Canonical JSON: fixed order of names, no blanks; what is missing is left out. FormatError when a value
/// breaks a rule that read_annotations checks.
std::string write_annotations(const Annotations& annotations);
/// The same document, unchecked.
nlohmann::ordered_json annotations_json(const Annotations& annotations);
/// Strict for what this version defines, ignores unknown members. FormatError names the JSON pointer. `file`
/// is what it calls the document.
Annotations read_annotations(std::span<const std::uint8_t> json, const std::string& file);
/// annotations.json of a package: also refuses another frame (N04).
Annotations read_annotations(std::span<const std::uint8_t> json);

/// Whether a text has the form of a BCP 47 tag: parts of 1 to 8 letters and digits, the first of letters,
/// with
/// "-" between.
bool is_language_tag(std::string_view text);

/// Numbers, from 1 on, of the notes that lie outside the box with a tenth of its diagonal around it.
std::vector<std::size_t> annotations_outside(const Annotations& annotations, const Box3d& box);

/// Every point through `move`, every normal through `turn`.
void transform_annotations(Annotations& annotations, const auto& move, const auto& turn) {
  for (Annotation& a : annotations.list) {
    a.position = move(a.position);
    if (a.normal) a.normal = turn(*a.normal);
    if (a.camera) a.camera->position = move(a.camera->position), a.camera->target = move(a.camera->target);
  }
}

}  // namespace texmesh
