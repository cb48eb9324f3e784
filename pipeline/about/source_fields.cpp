#include "pipeline/about/source_fields.h"

#include <nlohmann/json.hpp>

#include "format/base/text_bytes.h"
#include "pipeline/about/code_tables.h"
#include "pipeline/io/names/closest_word.h"
#include "pipeline/io/record.h"
#include "pipeline/io/uri.h"

namespace texmesh {
namespace {

constexpr int kMaxBrackets = 16;
constexpr const char* kListedLicences = "https://spdx.org/licenses/";

bool letters_before(std::string_view a, std::string_view b) {
  return std::ranges::lexicographical_compare(a, b, {}, lower_letter, lower_letter);
}

/// The list's own spelling.
std::optional<std::string_view> find_name(std::span<const std::string_view> names, std::string_view name) {
  const auto it = std::ranges::lower_bound(names, name, letters_before);
  if (it == names.end() || letters_before(name, *it)) return std::nullopt;
  return *it;
}

bool is_word(std::string_view text) {
  return !text.empty() && std::ranges::all_of(text, [](char c) {
    return (lower_letter(c) >= 'a' && lower_letter(c) <= 'z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '.';
  });
}

/// A recursive descent over one expression; writes it anew with the list's spellings.
class SpdxExpression {
 public:
  explicit SpdxExpression(std::string_view text) : rest_(text) { advance(); }

  bool read() { return read_or(0) && token_.empty(); }
  const std::string& spelled() const { return out_; }
  bool is_single() const { return words_ == 1; }
  /// Where reading has stopped.
  std::string wrong() const { return std::string(token_); }

 private:
  void advance() {
    while (!rest_.empty() && rest_.front() == ' ') rest_.remove_prefix(1);
    std::size_t n = 0;
    while (n < rest_.size() && rest_[n] != ' ' && rest_[n] != '(' && rest_[n] != ')') ++n;
    token_ = rest_.substr(0, n == 0 && !rest_.empty() ? 1 : n);
    rest_.remove_prefix(token_.size());
  }
  /// AND, OR and WITH are spelled in capitals or in small letters.
  bool take(std::string_view word) {
    if (!std::ranges::equal(token_, word, {}, lower_letter, lower_letter)) return false;
    advance();
    return true;
  }
  bool read_or(int depth) {
    if (!read_and(depth)) return false;
    while (take("or")) {
      out_ += " OR ";
      if (!read_and(depth)) return false;
    }
    return true;
  }
  bool read_and(int depth) {
    if (!read_term(depth)) return false;
    while (take("and")) {
      out_ += " AND ";
      if (!read_term(depth)) return false;
    }
    return true;
  }
  bool read_term(int depth) {
    if (token_ == "(") {
      if (depth == kMaxBrackets) return false;
      advance();
      out_ += '(';
      if (!read_or(depth + 1) || token_ != ")") return false;
      out_ += ')';
      advance();
      return true;
    }
    return read_licence_name() && read_exception();
  }
  bool read_licence_name() {
    ++words_;
    std::string_view name = token_;
    if (const auto colon = name.find(':');
        name.starts_with("DocumentRef-") && colon != std::string_view::npos) {
      if (!is_word(name.substr(12, colon - 12)) || !name.substr(colon + 1).starts_with("LicenseRef-"))
        return false;
      name.remove_prefix(colon + 1);
    }
    if (name.starts_with("LicenseRef-")) {
      if (!is_word(name.substr(11))) return false;
      words_ += 2;  // such a licence is in no list: it has no page there
      out_ += token_;
    } else {
      const bool or_later = name.ends_with("+");
      auto listed = find_name({kSpdxLicences, kSpdxLicenceCount}, name);
      if (!listed && or_later)
        listed = find_name({kSpdxLicences, kSpdxLicenceCount}, name.substr(0, name.size() - 1));
      if (!listed) return false;
      out_ += *listed;
      if (or_later && !listed->ends_with("+")) out_ += '+', ++words_;
    }
    advance();
    return true;
  }
  bool read_exception() {
    if (!take("with")) return true;
    ++words_;
    const auto listed = find_name({kSpdxExceptions, kSpdxExceptionCount}, token_);
    if (!listed) return false;
    out_ += " WITH ";
    out_ += *listed;
    advance();
    return true;
  }

  std::string_view rest_, token_;
  std::string out_;
  int words_ = 0;
};

std::string_view without_blanks(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  return text;
}

constexpr std::size_t kObjHeadBytes = 64 * 1024;

struct Unit {
  double metres;
  std::string_view names;  // each between blanks
};
constexpr Unit kUnits[] = {{1, " m metre meter metres meters "},
                           {1e-3, " mm millimetre millimeter millimetres millimeters "},
                           {1e-2, " cm centimetre centimeter centimetres centimeters "},
                           {1e-1, " dm "},
                           {1e3, " km "},
                           {1e-6, " um µm micrometre micrometer "},
                           {0.0254, " in inch inches "},
                           {0.3048, " ft foot feet "},
                           {0.9144, " yd yard yards "}};

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

/// "; did you mean ...?" by words for a licence: "Creative Commons Attribution 4.0 International" is
/// CC-BY-4.0, "CC BY-SA" the last of its versions, "GPLv3" GPL-3.0.
std::string licence_meant(const std::string& text) {
  static constexpr std::pair<std::string_view, std::string_view> kWords[] = {{"creative commons", "cc"},
                                                                             {"attribution", "by"},
                                                                             {"non commercial", "nc"},
                                                                             {"noncommercial", "nc"},
                                                                             {"share alike", "sa"},
                                                                             {"sharealike", "sa"},
                                                                             {"no derivatives", "nd"},
                                                                             {"noderivatives", "nd"},
                                                                             {"noderivs", "nd"},
                                                                             {"international", ""},
                                                                             {"unported", ""},
                                                                             {"license", ""},
                                                                             {"licence", ""},
                                                                             {"version", ""},
                                                                             {"public domain", ""}};
  std::string name = canonical_name(text);
  for (const auto& [word, letters] : kWords)
    if (const std::size_t at = name.find(word); at != name.npos) name.replace(at, word.size(), letters);
  for (std::size_t at = 0; at + 1 < name.size(); ++at)
    if (name[at] == 'v' && name[at + 1] >= '0' && name[at + 1] <= '9') name[at] = ' ';
  for (std::size_t at; (at = name.find("  ")) != name.npos;) name.erase(at, 1);
  name = canonical_name(name);
  if ((name + " ").starts_with("by ")) name = "cc " + name;
  const std::span licences(kSpdxLicences, kSpdxLicenceCount);
  for (std::size_t k = name.empty() ? 0 : licences.size(); k-- > 0;) {
    const std::string listed = canonical_name(licences[k]);
    if (listed.starts_with(name) && listed.find_first_not_of(" .0123456789", name.size()) == listed.npos)
      return "; did you mean " + std::string(licences[k]) + "?";
  }
  return meant_instead(text, licences);
}

void set_epsg(About& about, const std::string& value, const std::string& place, Notes& notes) {
  std::string_view digits = value;
  if (canonical_name(digits.substr(0, 5)) == "epsg:") digits.remove_prefix(5);
  if (const auto code = whole_number<std::uint32_t>(digits); code && is_epsg_code(*code))
    about.epsg = *code;
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

void set_creator(About& about, const std::string& value) {
  about.creator = clean_about_text(value, kMaxAboutTextBytes);
  std::erase_if(about.identifiers, [](const NamedText& i) { return i.name == kCreatorScheme; });
  const std::size_t open = about.creator.rfind(" (");
  if (open == std::string::npos || open == 0 || !about.creator.ends_with(')')) return;
  const std::string url = about.creator.substr(open + 2, about.creator.size() - open - 3);
  if (!is_web_url(url) || url.size() > kMaxAboutValueBytes) return;
  add_about_value(about.identifiers, kCreatorScheme, url);
  about.creator.resize(open);
}

/// The fields that are one text, or a list that a value is added to. False for other names.
bool set_words(About& about, const std::string& name, const std::string& value) {
  if (name == "title")
    about.title = clean_about_text(value, kMaxAboutTitleBytes);
  else if (name == "description")
    about.description = clean_about_text(value, kMaxAboutDescriptionBytes);
  else if (name == "creator" || name == "author")
    set_creator(about, value);
  else if (name == "attribution" || name == "credit" || name == "copyright")
    about.attribution = clean_about_text(value, kMaxAboutTextBytes);
  else if (name == "capture" || name == "capture method")
    about.capture = clean_about_text(value, kMaxAboutTextBytes);
  else if (name == "identifier" || name == "doi")
    add_about_value(about.identifiers, name, value);
  else if (name == "date" || name == "created")
    add_about_value(about.dates, name, value);
  else
    return false;
  return true;
}

class MetaReader {
 public:
  MetaReader(const std::string& file, const std::string& place) : file_(file), place_(place) {}

  std::string read(Json json) const {
    check_names(
        json, "",
        {"$schema", "title", "description", "creator", "attribution", "licence", "licenceUrl", "sourceUrl",
         "identifiers", "capture", "dates", "unit", "upAxis", "coordinateReference", "extras"});
    json.erase("$schema");
    check_nested(json);
    if (json.contains("upAxis") && json["upAxis"].is_string()) json["upAxis"] = in_lower_case(json["upAxis"]);
    replace_unit(json);
    check_licence(json);
    check_epsg(json);
    const std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
    return json.empty() ? "" : write_about(read_about(text_bytes(text)));
  }

  [[noreturn]] void fail(const std::string& at, const std::string& expected, const std::string& found) const {
    throw InputError(file_, place_ + at, expected, found.substr(0, 120));
  }

 private:
  void check_names(const Json& object, const std::string& at,
                   std::initializer_list<const char*> known) const {
    if (!object.is_object()) fail(at, "an object", object.type_name());
    texmesh::check_names(object, known, RecordPlace{file_, nullptr, place_ + at});
  }

  void check_list(const Json& json, const char* name, const char* kind, const char* text) const {
    if (!json.contains(name) || !json[name].is_array()) return;  // read_about says what is wrong
    for (std::size_t i = 0; i < json[name].size(); ++i)
      check_names(json[name][i], "/" + std::string(name) + "/" + std::to_string(i), {kind, text});
  }

  void check_nested(const Json& json) const {
    check_list(json, "identifiers", "scheme", "value");
    check_list(json, "dates", "event", "text");
    if (json.contains("unit") && !json["unit"].is_string())
      check_names(json["unit"], "/unit", {"name", "metres"});
    if (json.contains("coordinateReference"))
      check_names(json["coordinateReference"], "/coordinateReference", {"text", "epsg"});
  }

  /// "mm" stands for {"name": "mm", "metres": 0.001}.
  void replace_unit(Json& json) const {
    if (!json.contains("unit") || !json["unit"].is_string()) return;
    About unit;
    if (!find_unit(json["unit"].get<std::string>(), unit))
      fail("/unit", "m, mm, cm, dm, km, um, in, ft, yd or {\"name\",\"metres\"}", json["unit"].dump());
    json["unit"] = {{"name", unit.unit}, {"metres", unit.metres_per_unit}};
  }

  void check_licence(Json& json) const {
    if (!json.contains("licence") || !json["licence"].is_string()) return;
    const Licence licence = read_licence(json["licence"].get<std::string>());
    if (licence.kind == Licence::Kind::kOther)
      fail("/licence", "an SPDX licence (LicenseRef-NAME for terms of your own) or an http or https URL",
           (licence.wrong.empty() || licence.wrong == licence.text
                ? "\"" + licence.text + "\""
                : "\"" + licence.wrong + "\" in \"" + licence.text + "\"") +
               licence_meant(licence.text));
    json["licence"] = licence.text;
    if (!json.contains("licenceUrl") && !licence.url.empty()) json["licenceUrl"] = licence.url;
  }

  void check_epsg(const Json& json) const {
    if (!json.contains("coordinateReference")) return;
    const auto epsg = json["coordinateReference"].find("epsg");
    if (epsg == json["coordinateReference"].end() || !epsg->is_number_unsigned()) return;
    if (!is_epsg_code(epsg->get<std::uint64_t>()))
      fail("/coordinateReference/epsg", "a code that EPSG has given to a coordinate reference system",
           epsg->dump());
  }

  const std::string& file_;
  const std::string& place_;
};

About about_of_meta(const std::string& meta) {
  const std::string canonical = meta.empty() ? "" : read_meta(meta, "package.meta");
  return canonical.empty() ? About() : read_about(text_bytes(canonical));
}

}  // namespace

Licence read_licence(const std::string& given) {
  const std::string text(without_blanks(given));
  Licence licence{Licence::Kind::kOther, text, "", ""};
  if (is_web_url(text)) return {Licence::Kind::kUrl, text, text, ""};
  if (const auto bracket = text.find(" (http"); bracket != std::string::npos && text.ends_with(")")) {
    const std::string url = text.substr(bracket + 2, text.size() - bracket - 3);
    Licence named = read_licence(text.substr(0, bracket));
    if (named.kind == Licence::Kind::kSpdx && is_web_url(url)) {
      named.url = url;
      return named;
    }
  }
  SpdxExpression expression(text);
  if (!expression.read()) {
    licence.wrong = expression.wrong();
    return licence;
  }
  licence.kind = Licence::Kind::kSpdx;
  licence.text = expression.spelled();
  if (expression.is_single()) licence.url = kListedLicences + licence.text + ".html";
  return licence;
}

bool is_epsg_code(std::uint64_t code) {
  const std::span<const EpsgRun> runs(kEpsgRuns, kEpsgRunCount);
  const auto after = std::ranges::upper_bound(runs, code, {}, &EpsgRun::first);
  return after != runs.begin() && code <= std::prev(after)->last;
}

std::string clean_about_text(const std::string& text, std::size_t max_bytes) {
  std::string line = text;
  std::ranges::replace_if(
      line, [](char c) { return c == '\t' || c == '\n' || c == '\r'; }, ' ');
  line.erase(0, line.find_first_not_of(' '));
  line = clean_text(line, max_bytes);
  line.erase(line.find_last_not_of(' ') + 1);
  return line;
}

void add_about_value(std::vector<NamedText>& list, const std::string& name, const std::string& value) {
  const NamedText item{name, clean_about_text(value, kMaxAboutValueBytes)};
  if (!item.text.empty() && list.size() < kMaxAboutList && std::ranges::find(list, item) == list.end())
    list.push_back(item);
}

bool find_unit(const std::string& name, About& about) {
  const std::string wanted = canonical_name(name);
  if (wanted.empty() || wanted.find(' ') != wanted.npos) return false;
  for (const Unit& unit : kUnits)
    if (unit.names.find(" " + wanted + " ") != unit.names.npos) {
      about.unit = wanted;
      about.metres_per_unit = unit.metres;
      return true;
    }
  return false;
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
  Json source{{"format", format}}, used = Json::array();
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

std::string read_meta(const std::string& json, const std::string& file, const std::string& place) {
  Json document = parse_document(text_bytes(json), kMaxAboutBytes, 64, file);
  try {
    return MetaReader(file, place).read(std::move(document));
  } catch (const FormatError& e) {
    throw InputError(file, place + (e.place() == "/" ? "" : e.place()), e.expected(), e.found());
  }
}

std::string merge_meta(const std::string& under, const std::string& over) {
  const About merged = merge_about(about_of_meta(under), about_of_meta(over));
  return merged == About() ? "" : write_about(merged);
}

std::string up_axis_of_meta(const std::string& meta) { return about_of_meta(meta).up_axis; }

}  // namespace texmesh
