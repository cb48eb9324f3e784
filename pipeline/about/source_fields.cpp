#include "pipeline/about/source_fields.h"

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>

#include "format/base/clean_text.h"
#include "pipeline/about/licence.h"

namespace texmesh {
namespace {

constexpr std::size_t kObjHeadBytes = 64 * 1024;

struct Unit {
  const char* name;
  double metres;
};
constexpr Unit kUnits[] = {
    {"m", 1},
    {"metre", 1},
    {"meter", 1},
    {"metres", 1},
    {"meters", 1},
    {"mm", 1e-3},
    {"millimetre", 1e-3},
    {"millimeter", 1e-3},
    {"millimetres", 1e-3},
    {"millimeters", 1e-3},
    {"cm", 1e-2},
    {"centimetre", 1e-2},
    {"centimeter", 1e-2},
    {"centimetres", 1e-2},
    {"centimeters", 1e-2},
    {"dm", 1e-1},
    {"km", 1e3},
    {"um", 1e-6},
    {"micrometre", 1e-6},
    {"micrometer", 1e-6},
    {"in", 0.0254},
    {"inch", 0.0254},
    {"inches", 0.0254},
    {"ft", 0.3048},
    {"foot", 0.3048},
    {"feet", 0.3048},
    {"yd", 0.9144},
    {"yard", 0.9144},
    {"yards", 0.9144},
};

void note_value(Notes& notes, const std::string& place, std::string_view name, const std::string& expected,
                const std::string& found) {
  add_info(notes, "about-value", place,
           "expected " + expected + " as " + std::string(name) + ", found \"" + clean_text(found, 80) +
               "\"; it is left out");
}

std::string canonical_name(std::string_view name) {
  std::string out = clean_about_text(std::string(name), kMaxAboutNameBytes);
  for (char& c : out) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    if (c == '_' || c == '-') c = ' ';
  }
  return out;
}

void add_to_list(std::vector<NamedText>& list, const std::string& name, const std::string& value) {
  const NamedText item{name, clean_about_text(value, kMaxAboutValueBytes)};
  if (!item.text.empty() && list.size() < kMaxAboutList && std::ranges::find(list, item) == list.end())
    list.push_back(item);
}

void set_epsg(About& about, const std::string& value, const std::string& place, Notes& notes) {
  std::string_view digits = value;
  if (canonical_name(digits.substr(0, 5)) == "epsg:") digits.remove_prefix(5);
  std::uint32_t code = 0;
  const auto end = std::from_chars(digits.data(), digits.data() + digits.size(), code);
  if (end.ec == std::errc() && end.ptr == digits.data() + digits.size() && is_epsg_code(code))
    about.epsg = code;
  else
    note_value(notes, place, "epsg", "a code that EPSG has given to a coordinate reference system", value);
}

/// "EPSG:25832", or words.
void set_crs(About& about, const std::string& value, const std::string& place, Notes& notes) {
  if (canonical_name(value.substr(0, 5)) == "epsg:")
    set_epsg(about, value, place, notes);
  else
    about.crs = clean_about_text(value, kMaxAboutTextBytes);
}

void set_up(About& about, const std::string& value, const std::string& place, Notes& notes) {
  std::string axis = canonical_name(value);
  if (axis.starts_with("+")) axis.erase(0, 1);
  if (axis == "x" || axis == "y" || axis == "z")
    about.up_axis = axis;
  else
    note_value(notes, place, "up", "x, y or z", value);
}

void set_url(std::string& member, const std::string& value, std::string_view name, const std::string& place,
             Notes& notes) {
  if (value.size() <= kMaxAboutTextBytes && is_web_url(value))
    member = value;
  else
    note_value(notes, place, name, "an http or https URL", value);
}

/// The fields that are one text, or a list that a value is added to. False for other names.
bool set_words(About& about, const std::string& name, const std::string& value) {
  if (name == "title")
    about.title = clean_about_text(value, kMaxAboutTitleBytes);
  else if (name == "description")
    about.description = clean_about_text(value, kMaxAboutDescriptionBytes);
  else if (name == "creator" || name == "author")
    about.creator = clean_about_text(value, kMaxAboutTextBytes);
  else if (name == "attribution" || name == "credit" || name == "copyright")
    about.attribution = clean_about_text(value, kMaxAboutTextBytes);
  else if (name == "capture" || name == "capture method")
    about.capture = clean_about_text(value, kMaxAboutTextBytes);
  else if (name == "identifier" || name == "doi")
    add_to_list(about.identifiers, name, value);
  else if (name == "date" || name == "created")
    add_to_list(about.dates, name, value);
  else
    return false;
  return true;
}

}  // namespace

std::string clean_about_text(const std::string& text, std::size_t max_bytes) {
  std::string line = text;
  std::ranges::replace_if(
      line, [](char c) { return c == '\t' || c == '\n' || c == '\r'; }, ' ');
  line.erase(0, line.find_first_not_of(' '));
  line = clean_text(line, max_bytes);
  line.erase(line.find_last_not_of(' ') + 1);
  return line;
}

bool find_unit(const std::string& name, About& about) {
  const std::string wanted = canonical_name(name);
  const auto unit = std::ranges::find_if(kUnits, [&](const Unit& u) { return wanted == u.name; });
  if (unit == std::end(kUnits)) return false;
  about.unit = unit->name;
  about.metres_per_unit = unit->metres;
  return true;
}

void set_source_licence(About& about, const std::string& text, const std::string& place, Notes& notes) {
  const std::string clean = clean_about_text(text, kMaxAboutTextBytes);
  if (clean.empty()) return;
  const Licence licence = read_licence(clean);
  about.licence = licence.text;
  about.licence_url = licence.url;
  if (licence.kind == Licence::Kind::kOther)
    add_info(
        notes, "unknown-licence", place,
        "the licence \"" + clean_text(clean, 80) + "\" is neither of SPDX nor a URL; it is kept as text");
}

bool set_source_field(About& about, std::string_view given_name, const std::string& value,
                      const std::string& place, Notes& notes) {
  const std::string name = canonical_name(given_name), clean = clean_about_text(value, kMaxAboutTextBytes);
  if (name == "licence" || name == "license")
    set_source_licence(about, clean, place, notes);
  else if (name == "source" || name == "source url")
    set_url(about.source_url, clean, name, place, notes);
  else if (name == "up" || name == "up axis")
    set_up(about, clean, place, notes);
  else if (name == "crs" || name == "coordinate reference")
    set_crs(about, clean, place, notes);
  else if (name == "epsg")
    set_epsg(about, clean, place, notes);
  else if (name != "unit" && name != "units")
    return set_words(about, name, value);
  else if (!find_unit(clean, about))
    note_value(notes, place, name, "a unit of length", value);
  return true;
}

About about_from_comments(std::span<const std::string> comments, const std::string& format, Notes& notes) {
  About about;
  nlohmann::ordered_json source{{"format", format}}, used = nlohmann::ordered_json::array();
  for (const std::string& comment : comments) {
    const auto colon = comment.find(':');
    if (colon == std::string::npos || colon > kMaxAboutNameBytes || used.size() == kMaxAboutList) continue;
    if (set_source_field(about, std::string_view(comment).substr(0, colon), comment.substr(colon + 1),
                         "comment", notes))
      used.push_back(clean_about_text(comment, kMaxAboutTextBytes / 2));
  }
  if (!used.empty()) source["comments"] = used;
  about.source = source.dump();
  return about;
}

std::vector<std::string> obj_comments(std::string_view text) {
  std::vector<std::string> comments;
  text = text.substr(0, kObjHeadBytes);
  while (!text.empty()) {
    const std::size_t end = std::min(text.find_first_of("\r\n"), text.size());
    if (text.front() == '#') comments.emplace_back(text.substr(1, end - 1));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return comments;
}

}  // namespace texmesh
