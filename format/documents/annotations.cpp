#include "format/documents/annotations.h"

#include "format/base/text_bytes.h"
#include "format/container/layout.h"
#include "format/documents/json_members.h"

namespace texmesh {
namespace {

constexpr double kUnitDeviation = 1e-3;  // of a normal's length

void camera_members(auto& v, auto& c) {
  v.vector("position", c.position, kMaxAnnotationCoordinate);
  v.vector("target", c.target, kMaxAnnotationCoordinate);
  v.number("fovDegrees", c.fov_degrees, kLeastFovDegrees, kMostFovDegrees);
}

void text_members(auto& v, auto& t) {
  v.by("N02").text("language", t.language, kMaxLanguageTagBytes);
  v.by("N02").check("language", is_language_tag(t.language), "a BCP 47 tag", t.language);
  v.text("title", t.title, kMaxAnnotationTitleBytes);
  if (v.has("text", !t.text.empty())) v.text("text", t.text, kMaxAnnotationTextBytes);
}

void normal_member(auto& v, auto& normal) {
  if (!v.has("normal", normal.has_value())) return;
  if constexpr (requires { normal.emplace(); }) normal.emplace();
  v.vector("normal", *normal, 2);
  v.check("normal", std::abs(length(*normal) - 1) <= kUnitDeviation, "a vector of length 1",
          shortest_text(length(*normal)));
}

void annotation_members(auto& v, auto& a) {
  v.vector("position", a.position, kMaxAnnotationCoordinate);
  normal_member(v, a.normal);
  v.list("texts", a.texts, 1, kMaxAnnotationLanguages, [&](auto& inner, auto& text, std::size_t i) {
    text_members(inner, text);
    for (std::size_t k = 0; k < i; ++k)
      inner.by("N02").check("language", a.texts[k].language != text.language, "one text a language",
                            text.language + " again");
  });
  if (v.has("camera", a.camera.has_value())) {
    if constexpr (requires { a.camera.emplace(); }) a.camera.emplace();
    v.object("camera", [&](auto& inner) { camera_members(inner, *a.camera); });
  }
  if (v.has("images", !a.images.empty()))
    v.list("images", a.images, 1, kMaxAnnotationImages, [](auto& inner, auto& image, std::size_t) {
      inner.text("url", image.url, kMaxAboutTextBytes);
      inner.by("N03").check("url", is_web_url(image.url), "an http or https URL", image.url);
    });
}

std::optional<AnnotationFrame> frame_named(const std::string& name) {
  const auto& names = EnumNames<AnnotationFrame>::names;
  const auto it = std::ranges::find(names, name);
  if (it == names.end()) return {};
  return static_cast<AnnotationFrame>(it - names.begin());
}

void document_members(auto& v, auto& all) {
  v.named(
      "frame", all.frame, [](AnnotationFrame f) { return std::string(enum_name(f)); }, frame_named,
      "source or package");
  v.list("annotations", all.list, 1, kMaxAnnotations,
         [](auto& inner, auto& annotation, std::size_t) { annotation_members(inner, annotation); });
}

}  // namespace

nlohmann::ordered_json annotations_json(const Annotations& annotations) {
  nlohmann::ordered_json json;
  MemberWriter to(json);
  document_members(to, annotations);
  return json;
}

std::string write_annotations(const Annotations& annotations) {
  std::string text = dump_json(annotations_json(annotations), kAnnotationsPath);
  read_annotations(text_bytes(text), kAnnotationsPath);
  return text;
}

Annotations read_annotations(std::span<const std::uint8_t> json, const std::string& file) {
  const nlohmann::json document = parse_json(json, file, kMaxAnnotationsBytes);
  const MemberReader from(JsonAt(document, file).by("N01"));
  Annotations annotations;
  document_members(from, annotations);
  return annotations;
}

Annotations read_annotations(std::span<const std::uint8_t> json) {
  Annotations annotations = read_annotations(json, kAnnotationsPath);
  if (annotations.frame != AnnotationFrame::kPackage)
    throw RuleError("N04", kAnnotationsPath, "/frame", "package", "source");
  return annotations;
}

bool is_language_tag(std::string_view text) {
  if (text.size() > kMaxLanguageTagBytes) return false;
  std::size_t part = 0;
  bool is_first = true;
  for (const char c : text) {
    const bool is_letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
    if (c == '-') {
      if (part == 0) return false;
      part = 0, is_first = false;
    } else if (!is_letter && (is_first || c < '0' || c > '9')) {
      return false;
    } else if (++part > 8) {
      return false;
    }
  }
  return part > 0;
}

std::vector<std::size_t> annotations_outside(const Annotations& annotations, const Box3d& box) {
  const double around = length(box.max - box.min) / 10;
  std::vector<std::size_t> numbers;
  for (std::size_t i = 0; i < annotations.list.size(); ++i) {
    const Vec3d p = annotations.list[i].position;
    for (int axis = 0; axis < 3; ++axis)
      if (p[axis] < box.min[axis] - around || p[axis] > box.max[axis] + around) {
        numbers.push_back(i + 1);
        break;
      }
  }
  return numbers;
}

}  // namespace texmesh
