#include "pipeline/about/source_annotations.h"

#include <nlohmann/json.hpp>

#include "format/base/bounded_json.h"
#include "format/base/portable_math.h"
#include "format/base/text_bytes.h"
#include "pipeline/about/source_fields.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/names/closest_word.h"

namespace texmesh {
namespace {

const std::string kNoLanguage(kUnknownLanguage);
constexpr std::size_t kShortTitleBytes = 80;  // of a title that a note's text has to give

/// The member of an object, or null.
const Json& member(const Json& object, std::string_view name) {
  static const Json none;
  if (!object.is_object()) return none;
  const auto it = object.find(std::string(name));
  return it == object.end() ? none : *it;
}
std::string text_member(const Json& object, std::string_view name) {
  const Json& value = member(object, name);
  return value.is_string() ? value.get<std::string>() : "";
}

std::optional<Vec3d> point_of(const Json& x, const Json& y, const Json& z) {
  Vec3d p;
  const Json* parts[] = {&x, &y, &z};
  for (int i = 0; i < 3; ++i) {
    if (!parts[i]->is_number()) return {};
    p[i] = parts[i]->get<double>();
    if (!(std::abs(p[i]) <= kMaxAnnotationCoordinate)) return {};
  }
  return p;
}
std::optional<Vec3d> point_of(const Json& list) {
  if (!list.is_array() || list.size() != 3) return {};
  return point_of(list[0], list[1], list[2]);
}

/// Without the tags of HTML: what is left is shown as it stands.
std::string without_tags(const std::string& text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char next = i + 1 < text.size() ? text[i + 1] : ' ';
    const bool opens = text[i] == '<' && (std::isalpha(static_cast<unsigned char>(next)) || next == '/');
    const std::size_t end = opens ? text.find('>', i) : text.npos;
    if (end == text.npos)
      out += text[i];
    else
      i = end;
  }
  return out;
}

/// Collects the notes of a file that has another form than ours.
class Collector {
 public:
  explicit Collector(const std::string& file) : file_(file) {}

  void add(std::optional<Vec3d> position, Annotation note) {
    if (!position) {
      ++without_place_;
      return;
    }
    note.position = *position;
    if (note.texts.empty()) note.texts.push_back({kNoLanguage, "", ""});
    for (AnnotationText& t : note.texts) finish(t);
    if (all_.list.size() == kMaxAnnotations)
      throw InputError(file_, "", "at most " + std::to_string(kMaxAnnotations) + " notes", "more");
    all_.list.push_back(std::move(note));
  }
  /// The text of a language; a language that is no tag is not known.
  AnnotationText& text(Annotation& note, std::string language) {
    if (!is_language_tag(language)) language = kNoLanguage;
    for (AnnotationText& t : note.texts)
      if (t.language == language) return t;
    if (note.texts.size() == kMaxAnnotationLanguages) {
      ++lost_texts_;
      return spare_ = {};
    }
    return note.texts.emplace_back(AnnotationText{std::move(language), "", ""});
  }
  void add_image(Annotation& note, const std::string& url) {
    if (url.empty()) return;
    if (is_web_url(url) && url.size() <= kMaxAboutTextBytes && note.images.size() < kMaxAnnotationImages)
      note.images.push_back({url});
    else
      ++lost_images_;
  }
  Annotations release(Notes& notes) {
    if (all_.list.empty())
      throw InputError(file_, "",
                       "notes at points of the object, in texmesh's, Sketchfab's, Voyager's or W3C's form",
                       without_place_ ? std::to_string(without_place_) + " notes without a place" : "none");
    tell(notes, without_place_, "notes without a place");
    tell(notes, lost_images_, "images without an http or https URL, or beyond the eighth of a note");
    tell(notes, lost_texts_, "texts beyond 32 languages of a note");
    all_.frame = AnnotationFrame::kSource;
    return std::move(all_);
  }

 private:
  void finish(AnnotationText& t) {
    t.title = clean_about_text(t.title, kMaxAnnotationTitleBytes);
    t.text = clean_about_text(t.text, kMaxAnnotationTextBytes);
    if (t.title.empty()) t.title = clean_text(t.text, kShortTitleBytes);
    if (t.title == t.text) t.text.clear();
  }
  void tell(Notes& notes, std::size_t count, const char* what) {
    if (count > 0)
      add_warning(notes, "annotations", file_, std::to_string(count) + " " + what + " are left out");
  }

  const std::string& file_;
  Annotations all_;
  AnnotationText spare_;
  std::size_t without_place_ = 0, lost_images_ = 0, lost_texts_ = 0;
};

/// Markdown's pictures, ![what it shows](URL), become images.
std::string take_pictures(std::string text, Annotation& note, Collector& to) {
  for (std::size_t at = 0; (at = text.find("![", at)) != text.npos;) {
    const std::size_t middle = text.find("](", at), end = text.find(')', middle == text.npos ? at : middle);
    if (middle == text.npos || end == text.npos) break;
    const std::string url = text.substr(middle + 2, end - middle - 2);
    to.add_image(note, url.substr(0, url.find(' ')));
    text.erase(at, end + 1 - at);
  }
  return text;
}

/// [{"name", "content": {"raw"}, "position", "eye", "target"}, ...], z up.
void read_sketchfab(const Json& list, Collector& to) {
  const auto turned = [](const Json& json) -> std::optional<Vec3d> {
    const auto p = point_of(json);
    if (!p) return {};
    return Vec3d{p->x, p->z, -p->y};
  };
  for (const Json& item : list) {
    Annotation note;
    AnnotationText& text = to.text(note, kNoLanguage);
    text.title = text_member(item, "name") + text_member(item, "title");
    const Json& content = member(item, "content");
    text.text = take_pictures(content.is_string() ? content.get<std::string>() : text_member(content, "raw"),
                              note, to);
    const auto eye = turned(member(item, "eye")), target = turned(member(item, "target"));
    if (eye && target) note.camera = AnnotationCamera{*eye, *target, kDefaultFovDegrees};
    to.add(turned(member(item, "position")), std::move(note));
  }
}

/// Titles and texts of Voyager: "titles": {"EN": ...}, "leads", or "title", "lead".
void read_voyager_texts(const Json& item, Annotation& note, Collector& to) {
  for (const auto& [name, list, part] : {std::tuple("title", "titles", &AnnotationText::title),
                                         std::tuple("lead", "leads", &AnnotationText::text)}) {
    const Json& languages = member(item, list);
    for (const auto& [tag, value] : languages.items())
      if (value.is_string()) to.text(note, in_lower_case(tag)).*part = without_tags(value.get<std::string>());
    if (const std::string only = text_member(item, name); !only.empty() && languages.empty())
      to.text(note, kNoLanguage).*part = without_tags(only);
  }
}

/// Where Voyager puts a model into its scene. Notes are of the model, views of the scene.
class VoyagerPlace {
 public:
  VoyagerPlace(const Json& document, const Json& model) {
    const Json& scenes = member(document, "scenes");
    const double of_scene = metres_of(
                     text_member(scenes.is_array() && !scenes.empty() ? scenes[0] : Json(), "units")),
                 of_model = metres_of(text_member(model, "units"));
    if (of_scene > 0 && of_model > 0) scale_ = of_model / of_scene;
    shift_ = point_of(member(model, "translation")).value_or(Vec3d{});
    const Json& q = member(model, "rotation");
    if (!q.is_array() || q.size() != 4 || !q[3].is_number()) return;
    const auto axis = point_of(q[0], q[1], q[2]);
    const double w = q[3].get<double>(), square = axis ? dot(*axis, *axis) + w * w : 0;
    if (!(square > 1e-12 && square < 1e12)) return;
    axis_ = *axis * (1 / std::sqrt(square)), w_ = w / std::sqrt(square);
  }
  /// A point of the scene in the coordinates of the model's file.
  Vec3d in_model(Vec3d p) const {
    const Vec3d v = p - shift_, t = cross(axis_, v) * -2;  // turned back: by the conjugate
    return (v + t * w_ - cross(axis_, t)) * (1 / scale_);
  }

 private:
  static double metres_of(const std::string& unit) {
    static const std::map<std::string, double> kMetres{{"mm", .001},  {"cm", .01},     {"m", 1},
                                                       {"km", 1000},  {"in", .0254},   {"ft", .3048},
                                                       {"yd", .9144}, {"mi", 1609.344}};
    const auto at = kMetres.find(unit);
    return at == kMetres.end() ? 0 : at->second;
  }
  Vec3d shift_, axis_;
  double w_ = 1, scale_ = 1;
};

/// The views that a setup of Voyager has stored: values of "navigation/orbit" (degrees about x, y, z) and
/// "navigation/offset" in each state. The camera looks along its -z from where the offset leads it.
std::map<std::string, AnnotationCamera> voyager_views(const Json& setup) {
  std::map<std::string, AnnotationCamera> views;
  const Json& snapshots = member(setup, "snapshots");
  std::size_t orbit = 0, offset = 0, number = 0;
  for (const Json& target : member(snapshots, "targets")) {
    const std::string name = target.is_string() ? target.get<std::string>() : "";
    ++number;  // 1 is the first
    if (name.ends_with("navigation/orbit")) orbit = number;
    if (name.ends_with("navigation/offset")) offset = number;
  }
  for (const Json& state : member(snapshots, "states")) {
    const Json& values = member(state, "values");
    if (orbit == 0 || offset == 0 || !values.is_array() || values.size() < std::max(orbit, offset)) continue;
    const auto turn = point_of(values[orbit - 1]), away = point_of(values[offset - 1]);
    if (!turn || !away || !(away->z > 0)) continue;
    const auto turned = [&](Vec3d p) {
      for (int axis = 0; axis < 3; ++axis) {
        const double angle = std::fmod((*turn)[axis], 360) * (portable::kPi / 180), c = portable::cos(angle),
                     s = portable::sin(angle);
        const int i = (axis + 1) % 3, j = (axis + 2) % 3;
        const double x = p[i], y = p[j];
        p[i] = c * x - s * y, p[j] = s * x + c * y;
      }
      return p;
    };
    views[text_member(state, "id")] = {turned(*away), turned({away->x, away->y, 0}), kDefaultFovDegrees};
  }
  return views;
}

/// Notes of models, in each model's own coordinates, with their views; and stops of tours whose view no note
/// has, at what they look at.
void read_voyager(const Json& document, Collector& to) {
  const Json& setups = member(document, "setups");
  const Json& setup = setups.is_array() && !setups.empty() ? setups[0] : setups;
  std::map<std::string, AnnotationCamera> views = voyager_views(setup);
  const auto view = [&](const std::string& id, const VoyagerPlace& place) -> std::optional<AnnotationCamera> {
    const auto at = views.find(id);
    if (at == views.end()) return {};
    AnnotationCamera camera = at->second;
    for (Vec3d* p : {&camera.position, &camera.target}) {
      *p = place.in_model(*p);
      if (!(length(*p) <= kMaxAnnotationCoordinate)) return {};
    }
    return camera;
  };
  const Json& models = member(document, "models");
  std::set<std::string> seen;
  for (const Json& model : models) {
    const VoyagerPlace place(document, model);
    for (const Json& item : member(model, "annotations")) {
      Annotation note;
      read_voyager_texts(item, note, to);
      to.add_image(note, text_member(item, "imageUri"));
      if (const auto direction = point_of(member(item, "direction")); direction && length(*direction) > 0)
        note.normal = normalized(*direction);
      const std::string id = text_member(item, "viewId");
      note.camera = view(id, place);
      seen.insert(id);
      to.add(point_of(member(item, "position")), std::move(note));
    }
  }
  if (models.empty()) return;
  const VoyagerPlace place(document, models[0]);
  for (const Json& tour : member(setup, "tours"))
    for (const Json& step : member(tour, "steps")) {
      Annotation note;
      const std::string id = text_member(step, "id");
      note.camera = view(id, place);
      if (!note.camera || !seen.insert(id).second) continue;
      read_voyager_texts(step, note, to);
      to.add(note.camera->target, std::move(note));
    }
}

/// "POINT Z (1 2 3)".
std::optional<Vec3d> point_of_text(const std::string& text) {
  const std::size_t open = text.find('(');
  if (!text.starts_with("POINT") || open == text.npos) return {};
  Vec3d p;
  const char *at = text.data() + open + 1, *end = text.data() + text.size();
  for (int i = 0; i < 3; ++i) {
    while (at < end && *at == ' ') ++at;
    const auto [next, error] = std::from_chars(at, end, p[i]);
    if (error != std::errc() || !(std::abs(p[i]) <= kMaxAnnotationCoordinate)) return {};
    at = next;
  }
  return p;
}

/// A value, or each of a list of values.
void for_each_of(const Json& value, const auto& use) {
  if (value.is_array())
    for (const Json& one : value) use(one);
  else if (!value.is_null())
    use(value);
}

/// Of what a Web Annotation is about, the first place in space.
std::optional<Vec3d> place_of(const Json& target) {
  std::optional<Vec3d> place;
  for_each_of(target, [&](const Json& one) {
    for_each_of(member(one, "selector"), [&](const Json& selector) {
      if (!place) place = point_of(member(selector, "x"), member(selector, "y"), member(selector, "z"));
      if (!place) place = point_of_text(text_member(selector, "value"));
    });
  });
  return place;
}

void read_body(const Json& body, Annotation& note, Collector& to) {
  const std::string type = text_member(body, "type");
  if (type == "Image") {
    to.add_image(note, text_member(body, "id"));
  } else if (body.is_string() || body.contains("value")) {
    const Json& language = member(body, "language");
    const std::string tag = language.is_array() && !language.empty() && language[0].is_string()
                                ? language[0].get<std::string>()
                                : text_member(body, "language");
    std::string value = body.is_string() ? body.get<std::string>() : text_member(body, "value");
    if (text_member(body, "format") == "text/html") value = without_tags(value);
    AnnotationText& text = to.text(note, tag);
    text.text += (text.text.empty() ? "" : " ") + value;
  }
}

void read_web_annotation(const Json& item, Collector& to) {
  const std::string motivation = text_member(item, "motivation");
  const Json& motivations = member(item, "motivation");
  if (motivation == "painting" ||
      (motivations.is_array() && !motivations.empty() && motivations[0] == "painting"))
    return;  // IIIF: what the scene is made of
  Annotation note;
  for_each_of(member(item, "body"), [&](const Json& body) { read_body(body, note, to); });
  const Json& label = member(item, "label");
  if (label.is_string()) to.text(note, kNoLanguage).title = label.get<std::string>();
  if (label.is_object())
    for (const auto& [tag, values] : label.items())
      if (values.is_array() && !values.empty() && values[0].is_string())
        to.text(note, tag).title = values[0].get<std::string>();
  to.add(place_of(member(item, "target")), std::move(note));
}

/// Lists, pages and collections of Web Annotations, and what of IIIF holds such.
void read_web_annotations(const Json& json, Collector& to) {
  if (text_member(json, "type") == "Annotation") return read_web_annotation(json, to);
  if (json.is_array())
    for (const Json& one : json) read_web_annotations(one, to);
  for (const char* name : {"items", "annotations", "first"})
    if (const Json& inner = member(json, name); inner.is_structured()) read_web_annotations(inner, to);
}

bool is_own_form(const Json& json) {
  const Json& list = member(json, "annotations");
  return json.contains("frame") || (list.is_array() && !list.empty() && list[0].contains("texts"));
}

/// Sketchfab's list, bare or in an object.
const Json* sketchfab_list(const Json& json) {
  for (const Json* list : {&json, &member(json, "annotations"), &member(json, "results")})
    if (list->is_array() && !list->empty() && member((*list)[0], "position").is_array()) return list;
  return nullptr;
}

}  // namespace

Annotations read_source_annotations(std::span<const std::uint8_t> bytes, const std::string& file,
                                    Notes& notes) {
  if (bytes.size() > kMaxNotesFileBytes)
    throw InputError(file, "", "at most " + std::to_string(kMaxNotesFileBytes) + " bytes",
                     std::to_string(bytes.size()));
  Json json = parse_bounded_json(bytes, file);
  if (is_own_form(json)) {
    if (!json.contains("frame")) json["frame"] = enum_name(AnnotationFrame::kSource);
    try {
      return read_annotations(text_bytes(json.dump()), file);
    } catch (const FormatError& e) {
      throw InputError(e.file(), e.place(), e.expected(), e.found());
    }
  }
  Collector collector(file);
  if (const Json* list = sketchfab_list(json))
    read_sketchfab(*list, collector);
  else if (member(json, "models").is_array())
    read_voyager(json, collector);
  else
    read_web_annotations(json, collector);
  return collector.release(notes);
}

std::string read_notes_file(const std::string& path, Notes& notes) {
  return write_annotations(read_source_annotations(read_input_file(path, kMaxNotesFileBytes), path, notes));
}

}  // namespace texmesh
