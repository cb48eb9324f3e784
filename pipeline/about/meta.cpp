#include "pipeline/about/meta.h"

#include <algorithm>
#include <initializer_list>
#include <nlohmann/json.hpp>

#include "format/base/bounded_json.h"
#include "format/base/errors.h"
#include "format/base/text_bytes.h"
#include "pipeline/about/source_fields.h"

namespace texmesh {
namespace {

using Ordered = nlohmann::ordered_json;

class MetaReader {
 public:
  MetaReader(const std::string& file, const std::string& place) : file_(file), place_(place) {}

  std::string read(Ordered json) const {
    check_names(
        json, "",
        {"$schema", "title", "description", "creator", "attribution", "licence", "licenceUrl", "sourceUrl",
         "identifiers", "capture", "dates", "unit", "upAxis", "coordinateReference", "extras"});
    json.erase("$schema");
    check_nested(json);
    replace_unit(json);
    check_licence(json);
    check_epsg(json);
    const std::string text = json.dump(-1, ' ', false, Ordered::error_handler_t::replace);
    return json.empty() ? "" : write_about(read_about(text_bytes(text)));
  }

  [[noreturn]] void fail(const std::string& at, const std::string& expected, const std::string& found) const {
    throw InputError(file_, place_ + at, expected, found.substr(0, 120));
  }

 private:
  void check_names(const Ordered& object, const std::string& at,
                   std::initializer_list<std::string_view> known) const {
    if (!object.is_object()) fail(at, "an object", object.type_name());
    for (const auto& [name, value] : object.items())
      if (std::find(known.begin(), known.end(), name) == known.end())
        fail(at + "/" + name, "a known field", "\"" + name + "\"");
  }

  void check_list(const Ordered& json, const char* name, const char* kind, const char* text) const {
    if (!json.contains(name) || !json[name].is_array()) return;  // read_about says what is wrong
    for (std::size_t i = 0; i < json[name].size(); ++i)
      check_names(json[name][i], "/" + std::string(name) + "/" + std::to_string(i), {kind, text});
  }

  void check_nested(const Ordered& json) const {
    check_list(json, "identifiers", "scheme", "value");
    check_list(json, "dates", "event", "text");
    if (json.contains("unit") && !json["unit"].is_string())
      check_names(json["unit"], "/unit", {"name", "metres"});
    if (json.contains("coordinateReference"))
      check_names(json["coordinateReference"], "/coordinateReference", {"text", "epsg"});
  }

  /// "mm" stands for {"name": "mm", "metres": 0.001}.
  void replace_unit(Ordered& json) const {
    if (!json.contains("unit") || !json["unit"].is_string()) return;
    About unit;
    if (!find_unit(json["unit"].get<std::string>(), unit))
      fail("/unit", "m, mm, cm, dm, km, um, in, ft, yd or {\"name\",\"metres\"}", json["unit"].dump());
    json["unit"] = {{"name", unit.unit}, {"metres", unit.metres_per_unit}};
  }

  void check_licence(Ordered& json) const {
    if (!json.contains("licence") || !json["licence"].is_string()) return;
    const Licence licence = read_licence(json["licence"].get<std::string>());
    if (licence.kind == Licence::Kind::kOther)
      fail("/licence", "an SPDX licence expression or an http or https URL",
           licence.wrong.empty() || licence.wrong == licence.text
               ? "\"" + licence.text + "\""
               : "\"" + licence.wrong + "\" in \"" + licence.text + "\"");
    json["licence"] = licence.text;
    if (!json.contains("licenceUrl") && !licence.url.empty()) json["licenceUrl"] = licence.url;
  }

  void check_epsg(const Ordered& json) const {
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

}  // namespace

std::string read_meta(const std::string& json, const std::string& file, const std::string& place) {
  if (json.size() > kMaxAboutBytes)
    throw InputError(file, place, "at most " + std::to_string(kMaxAboutBytes) + " bytes",
                     std::to_string(json.size()) + " bytes");
  try {
    return MetaReader(file, place).read(parse_bounded_json(text_bytes(json), file));
  } catch (const FormatError& e) {
    const bool is_pointer = e.place().starts_with("/");  // otherwise a byte of the file
    throw InputError(file, is_pointer ? place + (e.place() == "/" ? "" : e.place()) : e.place(), e.expected(),
                     e.found());
  }
}

std::string merge_meta(const std::string& under, const std::string& over) {
  const auto about_of = [](const std::string& meta) {
    const std::string canonical = meta.empty() ? "" : read_meta(meta, "package.meta");
    return canonical.empty() ? About() : read_about(text_bytes(canonical));
  };
  const About merged = merge_about(about_of(under), about_of(over));
  return merged == About() ? "" : write_about(merged);
}

std::string up_axis_of_meta(const std::string& meta) {
  const std::string canonical = meta.empty() ? "" : read_meta(meta, "package.meta");
  return canonical.empty() ? "" : read_about(text_bytes(canonical)).up_axis;
}

}  // namespace texmesh
