#include "pipeline/io/record.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "format/base/bounded_json.h"
#include "pipeline/io/names/closest_word.h"
#include "pipeline/io/uri.h"

namespace texmesh {
namespace {

/// Of a document that is shown in a message.
constexpr std::size_t kMostShownBytes = 80;

/// Whole numbers without ".0".
std::string number_text(double value) {
  const std::string text = Json(value).dump();
  return text.ends_with(".0") ? text.substr(0, text.size() - 2) : text;
}

std::string range_text(const char* kind, const Range& r) {
  return std::string(kind) + " in " + number_text(r.lo) + " .. " + number_text(r.hi);
}

std::vector<std::string> words_in(const char* words) {
  std::vector<std::string> list(1);
  for (const char* c = words; *c != '\0'; ++c)
    if (*c == '|')
      list.emplace_back();
    else
      list.back() += *c;
  return list;
}

std::string shown_json(const Json& found) {
  return found.dump(-1, ' ', false, Json::error_handler_t::replace).substr(0, kMostShownBytes);
}

template <class Words>
[[noreturn]] void fail_choice(const Words& words, const Json& found, const RecordPlace& at) {
  std::string text;
  for (const auto& word : words) text += (text.empty() ? "one of " : ", ") + std::string(word);
  throw InputError(
      at.file, at.pointer(), text,
      shown_json(found) + (found.is_string() ? meant_instead(found.get<std::string>(), words) : ""));
}

/// Bounds are numbers of the schema's own type: 1, not 1.0.
Json bound(double value, bool is_integer) {
  return is_integer ? Json(static_cast<std::int64_t>(value)) : Json(value);
}

}  // namespace

std::string RecordPlace::pointer() const {
  if (!parent) return std::string(name);
  return parent->pointer() + "/" + (name.data() ? std::string(name) : std::to_string(index));
}

void RecordPlace::fail(const std::string& expected, const Json& found) const {
  throw InputError(file, pointer(), expected, shown_json(found));
}

Json& member_of(Json& object, std::string_view name) { return object[std::string(name)]; }
Json& appended(Json& list) { return list.emplace_back(); }
void make_json_list(Json& to) { to = Json::array(); }
void make_json_object(Json& to) {
  if (!to.is_object()) to = Json::object();
}
void put_json(Json& to, bool value) { to = value; }
void put_json(Json& to, std::int64_t value) { to = value; }
void put_json(Json& to, std::uint64_t value) { to = value; }
void put_json(Json& to, double value) { to = value; }
void put_json(Json& to, std::string_view value, const FieldRule& rule) {
  to = rule.names_file ? to_wire(value) : std::string(value);
}
void put_json(Json& to, const Json& value) { to = value; }
void put_json(Json& to, const Constant& value) { to = value.text ? Json(value.text) : Json(value.number); }

const Json* find_member(const Json& object, const char* name, bool may_miss, const RecordPlace& at) {
  if (!object.is_object()) at.fail("an object", object);
  const auto found = object.find(name);
  if (found != object.end()) return &*found;
  if (!may_miss) throw InputError(at.file, at.pointer() + "/" + name, "a value", "nothing");
  return nullptr;
}

void get_json(const Json& from, bool& value, const RecordPlace& at) {
  if (!from.is_boolean()) at.fail("true or false", from);
  value = from.get<bool>();
}

std::int64_t get_signed(const Json& from, double least, double most, const FieldRule& rule,
                        const RecordPlace& at) {
  const Range range = rule.range.value_or(Range{least, most});
  const double value = from.is_number_integer() ? from.get<double>() : std::nan("");
  if (!(value >= std::max(range.lo, least) && value <= std::min(range.hi, most)))
    at.fail(rule.range ? range_text("an integer", range) : "a whole number", from);
  return from.get<std::int64_t>();
}

std::uint64_t get_unsigned(const Json& from, double most, const FieldRule& rule, const RecordPlace& at) {
  const Range range = rule.range.value_or(Range{0, most});
  const double value = from.is_number_unsigned() ? from.get<double>() : std::nan("");
  if (!(value >= range.lo && value <= std::min(range.hi, most)))
    at.fail(rule.range ? range_text("an integer", range) : "a whole number from 0", from);
  return from.get<std::uint64_t>();
}

void get_json(const Json& from, double& value, const FieldRule& rule, const RecordPlace& at) {
  if (!from.is_number()) at.fail("a number", from);
  value = from.get<double>();
  if (rule.range && !(value >= rule.range->lo && value <= rule.range->hi))
    at.fail(range_text("a number", *rule.range), from);
}

void get_json(const Json& from, std::string& value, const FieldRule& rule, const RecordPlace& at) {
  const std::string* const text = from.get_ptr<const std::string*>();
  const Range bytes = rule.range.value_or(Range{0, std::numeric_limits<double>::infinity()});
  if (!text || static_cast<double>(text->size()) > bytes.hi)
    at.fail(std::isinf(bytes.hi) ? "a text" : fmt::format("a text of at most {} bytes", bytes.hi), from);
  if (static_cast<double>(text->size()) < bytes.lo)
    at.fail(fmt::format("a text of at least {} bytes", bytes.lo), from);
  value = from.get<std::string>();
  if (rule.names_file) value = from_wire(value);
  if (!rule.words) return;
  const std::vector<std::string> words = words_in(rule.words);
  if (std::find(words.begin(), words.end(), value) == words.end()) fail_choice(words, from, at);
}

void get_json(const Json& from, Sha256& value, const RecordPlace& at) {
  if (!from.is_string() || !from_hex(from.get<std::string>(), value)) at.fail("64 hexadecimal digits", from);
}

void get_json(const Json& from, Json& value) { value = from; }

std::size_t get_enum(const Json& from, std::span<const std::string_view> names, const RecordPlace& at) {
  const std::string* const text = from.get_ptr<const std::string*>();
  const auto found = text ? std::find(names.begin(), names.end(), *text) : names.end();
  if (found == names.end()) fail_choice(names, from, at);
  return static_cast<std::size_t>(found - names.begin());
}

void check_constant(const Json& from, const Constant& value, const RecordPlace& at) {
  Json expected;
  put_json(expected, value);
  if (from != expected) at.fail(value.text ? value.text : expected.dump(), from);
}

void check_names(const Json& object, const std::vector<const char*>& known, const RecordPlace& at) {
  for (const auto& [name, value] : object.items())
    if (std::find(known.begin(), known.end(), name) == known.end())
      throw InputError(at.file, at.pointer() + "/" + name, "a known field",
                       "\"" + name.substr(0, 60) + "\"" + meant_instead(name, known));
}

std::size_t size_of_list(const Json& from, const FieldRule& rule, const RecordPlace& at) {
  const Range count = rule.count.value_or(Range{0, 1e9});
  if (!from.is_array() || static_cast<double>(from.size()) < count.lo ||
      static_cast<double>(from.size()) > count.hi)
    at.fail(rule.count ? fmt::format("a list of {} to {} values", count.lo, count.hi) : "a list", from);
  return from.size();
}

const Json& element_of(const Json& list, std::size_t index) { return list[index]; }

void for_members(const Json& object, const RecordPlace& at,
                 const std::function<void(const std::string& name, const Json& value)>& use) {
  if (!object.is_object()) at.fail("an object", object);
  for (const auto& [name, value] : object.items()) use(name, value);
}

void schema_of_bool(Json& to) { to["type"] = "boolean"; }

void schema_of_integer(Json& to, bool is_signed, const FieldRule& rule) {
  to["type"] = "integer";
  if (rule.range || !is_signed) to["minimum"] = bound(rule.range ? rule.range->lo : 0, true);
  if (rule.range) to["maximum"] = bound(rule.range->hi, true);
}

void schema_of_number(Json& to, const FieldRule& rule) {
  to["type"] = "number";
  if (!rule.range) return;
  to["minimum"] = rule.range->lo;
  to["maximum"] = rule.range->hi;
}

void schema_of_text(Json& to, const FieldRule& rule) {
  if (rule.words) {
    to["enum"] = words_in(rule.words);
    return;
  }
  to["type"] = "string";
  if (rule.range && rule.range->lo > 0) to["minLength"] = bound(rule.range->lo, true);
  if (rule.range && !std::isinf(rule.range->hi)) to["maxLength"] = bound(rule.range->hi, true);
  if (rule.pattern) to["pattern"] = rule.pattern;
}

void schema_of_digest(Json& to) {
  to["type"] = "string";
  to["pattern"] = "^[0-9a-f]{64}$";
}

void schema_of_enum(Json& to, std::span<const std::string_view> names) {
  to["enum"] = std::vector<std::string>(names.begin(), names.end());
}

void schema_of_constant(Json& to, const Constant& value) { put_json(to["const"], value); }

Json& schema_of_list(Json& to, const FieldRule& rule) {
  to["type"] = "array";
  if (rule.count) {
    to["minItems"] = bound(rule.count->lo, true);
    to["maxItems"] = bound(rule.count->hi, true);
  }
  return to["items"];
}

Json& schema_of_map(Json& to) {
  to["type"] = "object";
  return to["additionalProperties"];
}

Json& schema_or_null(Json& to) {
  to["anyOf"] = Json::array({{{"type", "null"}}, Json()});
  return to["anyOf"][1];
}

void begin_object_schema(Json& to) {
  to["type"] = "object";
  to["required"] = Json::array();
  to["additionalProperties"] = false;
  to["properties"] = Json::object();
}

Json& schema_of_member(Json& object, const char* name, bool may_miss) {
  if (!may_miss) object["required"].push_back(name);
  return object["properties"][name];
}

void describe_schema(Json& member, const char* text) {
  if (*text != '\0') member["description"] = text;
}

Json parse_document(ByteSpan json, std::size_t most_bytes, int most_depth, const std::string& file) {
  if (json.size() > most_bytes)
    throw InputError(file, "", fmt::format("at most {} bytes of JSON", most_bytes),
                     std::to_string(json.size()));
  try {
    std::uint64_t values = 0;
    Json document = parse_bounded_json(json, file, most_depth, &values);
    if (values_in(document) != values)
      throw InputError(file, "", "every name of an object once",
                       "\"" + repeated_name(json).value_or("") + "\" twice");
    return document;
  } catch (const FormatError& e) {
    throw InputError(file, e.place(), e.expected(), e.found());
  }
}

std::string json_line(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

std::string json_line_of(const std::function<void(Json& to)>& put) {
  Json json;
  put(json);
  return json_line(json);
}

DocumentSchema document_schema(const std::string& name, const std::string& title,
                               const std::string& description, const Json& body) {
  Json schema{
      {"$schema", "http://json-schema.org/draft-07/schema#"}, {"title", title}, {"description", description}};
  schema.update(body);
  return {name, schema.dump(2) + "\n"};
}

}  // namespace texmesh
