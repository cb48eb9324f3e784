#include "format/documents/about.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "format/base/json_fields.h"
#include "format/base/text_bytes.h"
#include "format/container/layout.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

const std::string kAboutFile = kAboutPath;
constexpr double kLeastMetresPerUnit = 1e-12;
constexpr const char* kIdentifierNames[2] = {"scheme", "value"};
constexpr const char* kDateNames[2] = {"event", "text"};

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

Json list_json(const std::vector<NamedText>& list, const char* const names[2]) {
  Json json = Json::array();
  for (const NamedText& item : list) json.push_back({{names[0], item.name}, {names[1], item.text}});
  return json;
}

Json about_json(const About& about) {
  Json j = Json::object();
  for (const TextField& f : kTextFields)
    if (!(about.*f.member).empty()) j[f.name] = about.*f.member;
  if (!about.identifiers.empty()) j["identifiers"] = list_json(about.identifiers, kIdentifierNames);
  if (!about.dates.empty()) j["dates"] = list_json(about.dates, kDateNames);
  if (about.metres_per_unit > 0) j["unit"] = {{"name", about.unit}, {"metres", about.metres_per_unit}};
  if (!about.up_axis.empty()) j["upAxis"] = about.up_axis;
  if (!about.crs.empty()) j["coordinateReference"]["text"] = about.crs;
  if (about.epsg > 0) j["coordinateReference"]["epsg"] = about.epsg;
  if (!about.source.empty()) j["source"] = Json::parse(about.source);
  if (!about.extras.empty()) j["extras"] = Json::parse(about.extras);
  return j;
}

std::string read_text(const JsonAt& at, std::size_t max_bytes) {
  std::string text = at.text(max_bytes);
  if (text.empty()) at.fail("a text", "an empty one");
  return text;
}

std::vector<NamedText> read_list(const JsonAt& at, const char* const names[2]) {
  std::vector<NamedText> list;
  for (std::size_t i = 0, n = at.array(1, kMaxAboutList); i < n; ++i)
    list.push_back(
        {read_text(at[i][names[0]], kMaxAboutNameBytes), read_text(at[i][names[1]], kMaxAboutValueBytes)});
  return list;
}

void read_coordinates(const JsonAt& at, About& about) {
  if (at.has("unit")) {
    about.unit = read_text(at["unit"]["name"], kMaxUnitNameBytes);
    about.metres_per_unit = at["unit"]["metres"].number(kLeastMetresPerUnit, kMaxMetresPerUnit);
  }
  if (at.has("upAxis")) {
    about.up_axis = at["upAxis"].text(60);
    if (about.up_axis != "x" && about.up_axis != "y" && about.up_axis != "z")
      at["upAxis"].fail("x, y or z", about.up_axis);
  }
  if (!at.has("coordinateReference")) return;
  const JsonAt crs = at["coordinateReference"];
  if (!crs.has("text") && !crs.has("epsg")) crs.fail("text or epsg", "neither");
  if (crs.has("text")) about.crs = read_text(crs["text"], kMaxAboutTextBytes);
  if (crs.has("epsg")) about.epsg = static_cast<std::uint32_t>(crs["epsg"].integer(1, kMaxEpsgCode));
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
    json = dump_json(about_json(about), kAboutFile);
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
  for (const TextField& f : kTextFields) {
    if (!at.has(f.name)) continue;
    about.*f.member = read_text(at[f.name], f.max_bytes);
    if (f.is_url && !is_web_url(about.*f.member))
      at[f.name].by("B02").fail("an http or https URL", about.*f.member);
  }
  if (at.has("identifiers")) about.identifiers = read_list(at["identifiers"], kIdentifierNames);
  if (at.has("dates")) about.dates = read_list(at["dates"], kDateNames);
  read_coordinates(at, about);
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
