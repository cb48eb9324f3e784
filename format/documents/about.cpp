#include "format/documents/about.h"

#include <algorithm>

#include "format/base/text_bytes.h"
#include "format/container/layout.h"
#include "format/documents/json_members.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

const std::string kAboutFile = kAboutPath;
constexpr double kLeastMetresPerUnit = 1e-12;

/// A field that is one text, and the most bytes of it.
struct TextField {
  const char* name;
  std::string About::*member;
  std::size_t max_bytes;
  bool is_url;
};
constexpr TextField kTextFields[] = {
    {"title", &About::title, kMaxAboutTitleBytes, false},
    {"description", &About::description, kMaxAboutDescriptionBytes, false},
    {"creator", &About::creator, kMaxAboutTextBytes, false},
    {"attribution", &About::attribution, kMaxAboutTextBytes, false},
    {"licence", &About::licence, kMaxAboutTextBytes, false},
    {"licenceUrl", &About::licence_url, kMaxAboutTextBytes, true},
    {"sourceUrl", &About::source_url, kMaxAboutTextBytes, true},
    {"capture", &About::capture, kMaxAboutTextBytes, false},
};

void text_member(auto& v, const char* name, auto& text, std::size_t max_bytes) {
  v.text(name, text, max_bytes);
  v.check(name, !text.empty(), "a text", "an empty one");
}

void list_member(auto& v, const char* list, auto& items, const char* name, const char* text) {
  if (!v.has(list, !items.empty())) return;
  v.list(list, items, 1, kMaxAboutList, [&](auto& inner, auto& item, std::size_t) {
    text_member(inner, name, item.name, kMaxAboutNameBytes);
    text_member(inner, text, item.text, kMaxAboutValueBytes);
  });
}

void coordinate_members(auto& v, auto& about) {
  if (v.has("unit", about.metres_per_unit > 0))
    v.object("unit", [&](auto& unit) {
      text_member(unit, "name", about.unit, kMaxUnitNameBytes);
      unit.number("metres", about.metres_per_unit, kLeastMetresPerUnit, kMaxMetresPerUnit);
    });
  if (v.has("upAxis", !about.up_axis.empty())) {
    v.text("upAxis", about.up_axis, 60);
    v.check("upAxis", about.up_axis == "x" || about.up_axis == "y" || about.up_axis == "z", "x, y or z",
            about.up_axis);
  }
  if (!v.has("coordinateReference", !about.crs.empty() || about.epsg > 0)) return;
  v.object("coordinateReference", [&](auto& reference) {
    const bool text = reference.has("text", !about.crs.empty()), epsg = reference.has("epsg", about.epsg > 0);
    v.check("coordinateReference", text || epsg, "text or epsg", "neither");
    if (text) text_member(reference, "text", about.crs, kMaxAboutTextBytes);
    if (epsg) reference.integer("epsg", about.epsg, 1, kMaxEpsgCode);
  });
}

/// All but source and extras, which may be any JSON.
void about_members(auto& v, auto& about) {
  for (const TextField& f : kTextFields) {
    auto& text = about.*f.member;
    if (!v.has(f.name, !text.empty())) continue;
    text_member(v, f.name, text, f.max_bytes);
    if (f.is_url) v.by("B02").check(f.name, is_web_url(text), "an http or https URL", text);
  }
  list_member(v, "identifiers", about.identifiers, "scheme", "value");
  list_member(v, "dates", about.dates, "event", "text");
  coordinate_members(v, about);
}

std::string verbatim(const nlohmann::json& document, const JsonAt& at, const char* name,
                     std::size_t max_bytes) {
  const auto it = document.find(name);
  if (it == document.end()) return "";
  std::string text = dump_json(*it, kAboutFile);
  if (text.size() > max_bytes)
    at[name].fail("at most " + std::to_string(max_bytes) + " bytes", std::to_string(text.size()));
  return text;
}

}  // namespace

std::string write_about(const About& about) {
  std::string json;
  try {
    Json document = Json::object();
    MemberWriter to(document);
    about_members(to, about);
    if (!about.source.empty()) document["source"] = Json::parse(about.source);
    if (!about.extras.empty()) document["extras"] = Json::parse(about.extras);
    json = dump_json(document, kAboutFile);
  } catch (const Json::parse_error&) {
    throw FormatError(kAboutFile, "/source", "JSON", "something else");
  }
  read_about(text_bytes(json));
  return json;
}

About read_about(std::span<const std::uint8_t> json) {
  const nlohmann::json document = parse_json(json, kAboutFile, kMaxAboutBytes);
  const JsonAt at = JsonAt(document, kAboutFile).by("B01");
  About about;
  const MemberReader from(at);
  about_members(from, about);
  if (at.has("source") && !document["source"].is_object()) at["source"].fail("an object", "another type");
  about.source = verbatim(document, at, "source", kMaxAboutSourceBytes);
  about.extras = verbatim(document, at, "extras", kMaxAboutExtrasBytes);
  return about;
}

About merge_about(About under, const About& over) {
  if (!over.licence.empty()) under.licence_url.clear();
  if (!over.creator.empty() && over.creator != under.creator)
    std::erase_if(under.identifiers, [](const NamedText& i) { return i.name == kCreatorScheme; });
  for (const TextField& f : kTextFields)
    if (!(over.*f.member).empty()) under.*f.member = over.*f.member;
  if (!over.identifiers.empty()) under.identifiers = over.identifiers;
  if (!over.dates.empty()) under.dates = over.dates;
  if (over.metres_per_unit > 0) under.unit = over.unit, under.metres_per_unit = over.metres_per_unit;
  if (!over.up_axis.empty()) under.up_axis = over.up_axis;
  if (!over.crs.empty() || over.epsg > 0) under.crs = over.crs, under.epsg = over.epsg;
  if (!over.source.empty()) under.source = over.source;
  if (!over.extras.empty()) under.extras = over.extras;
  return under;
}

std::string creator_url(const About& about) {
  for (const NamedText& i : about.identifiers)
    if (i.name == kCreatorScheme && is_web_url(i.text)) return i.text;
  return "";
}

bool is_web_url(const std::string& text) {
  const std::size_t scheme = text.starts_with("https://") ? 8 : text.starts_with("http://") ? 7 : 0;
  if (scheme == 0 || text.size() == scheme || text[scheme] == '/') return false;
  return std::ranges::none_of(text, [](char c) {
    return (c >= 0 && c <= ' ') || c == 0x7f ||
           std::string_view("\"<>\\^`{|}").find(c) != std::string_view::npos;
  });
}

std::string copyright_line(const About& about) {
  std::string line = about.attribution.empty() ? about.creator : about.attribution;
  if (about.licence.empty() || line.find(about.licence) != std::string::npos) return line;
  return line + (line.empty() ? "" : ". ") + "Licence: " + about.licence;
}

std::vector<NamedText> about_lines(const About& about) {
  std::vector<NamedText> lines;
  const auto add = [&](const char* name, std::string text) {
    if (!text.empty()) lines.push_back({name, std::move(text)});
  };
  const auto add_list = [&](const char* name, const std::vector<NamedText>& list) {
    for (const NamedText& item : list) add(name, item.name + ": " + item.text);
  };
  add("title", about.title);
  add("description", about.description);
  add("creator", about.creator);
  add("attribution", about.attribution);
  add("licence", about.licence);
  if (about.licence_url != about.licence) add("licence at", about.licence_url);
  add("source", about.source_url);
  add_list("identifier", about.identifiers);
  add("capture", about.capture);
  add_list("date", about.dates);
  if (about.metres_per_unit > 0) add("unit", about.unit + ", " + shortest_text(about.metres_per_unit) + " m");
  add("up axis", about.up_axis);
  add("coordinate reference",
      about.epsg == 0 ? about.crs
                      : "EPSG:" + std::to_string(about.epsg) + (about.crs.empty() ? "" : ", " + about.crs));
  return lines;
}

}  // namespace texmesh
