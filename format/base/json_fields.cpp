#include "format/base/json_fields.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "format/base/bounded_json.h"
#include "format/base/errors.h"
#include "format/base/text_bytes.h"

namespace texmesh {

// Texts and JSON that strangers wrote, made fit to be shown (clean_text), bounded before they are parsed
// (bounded_json.h), and read field by field (json_fields.h).

std::string clean_text(const std::string& text, std::size_t max_bytes) {
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    const auto at = [&](std::size_t k) {
      return i + k < text.size() ? static_cast<std::uint8_t>(text[i + k]) : 0u;
    };
    const unsigned c = at(0);
    const std::size_t length = c < 0x80                ? 1
                               : c >= 0xc2 && c < 0xe0 ? 2
                               : c >= 0xe0 && c < 0xf0 ? 3
                               : c >= 0xf0 && c < 0xf5 ? 4
                                                       : 0;
    bool good = length > 0 && (c >= 0x20 && c != 0x7f);
    for (std::size_t k = 1; k < length; ++k) good = good && (at(k) & 0xc0) == 0x80;
    // Overlong forms, surrogates and numbers past U+10FFFF show in the second byte.
    good = good && !(c == 0xe0 && at(1) < 0xa0) && !(c == 0xed && at(1) > 0x9f) &&
           !(c == 0xf0 && at(1) < 0x90) && !(c == 0xf4 && at(1) > 0x8f);
    const std::string part = good ? text.substr(i, length) : "?";
    if (out.size() + part.size() > max_bytes) break;
    out += part;
    i += good ? length : 1;
  }
  return out;
}

JsonShape scan_json_shape(std::span<const std::uint8_t> json, int max_depth) {
  JsonShape shape;
  int depth = 0;
  bool quoted = false;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const std::uint8_t c = json[i];
    if (quoted) {
      if (c == '\\') ++i;
      quoted = c != '"';
    } else if (c == '"') {
      quoted = true;
    } else if (c == '{' || c == '[') {
      ++shape.values;
      if (++depth > max_depth) {
        shape.too_deep = i;
        return shape;
      }
    } else if (c == '}' || c == ']') {
      --depth;
    } else if (c == ',') {
      ++shape.values;
    }
  }
  return shape;
}

/// "line 3, column 7" of the byte that counts from 1.
static std::string line_and_column(std::span<const std::uint8_t> text, std::size_t byte) {
  const auto before = text.first(std::min(byte > 0 ? byte - 1 : 0, text.size()));
  const auto line = std::ranges::count(before, '\n') + 1;
  const auto column = std::ranges::find(before.rbegin(), before.rend(), '\n') - before.rbegin() + 1;
  return "line " + std::to_string(line) + ", column " + std::to_string(column);
}

nlohmann::ordered_json parse_bounded_json(std::span<const std::uint8_t> bytes, const std::string& document,
                                          int max_depth, std::uint64_t* values) {
  using Json = nlohmann::ordered_json;
  const JsonShape shape = scan_json_shape(bytes, max_depth);
  if (values) *values = shape.values;
  if (shape.too_deep)
    throw FormatError(document, "", "JSON at most " + std::to_string(max_depth) + " levels deep", "more");
  try {
    return Json::parse(bytes.begin(), bytes.end());
  } catch (const nlohmann::json::parse_error& e) {
    throw FormatError(document, line_and_column(bytes, e.byte), "JSON", "a syntax error");
  } catch (const nlohmann::json::out_of_range&) {
    throw FormatError(document, "", "JSON numbers that fit a double", "a larger one");
  }
}

namespace {

using Json = nlohmann::json;

void check_depth(std::span<const std::uint8_t> bytes, const std::string& file) {
  if (const auto byte = scan_json_shape(bytes, kMaxJsonDepth).too_deep)
    throw RuleError("J10", file, "byte " + std::to_string(*byte),
                    "at most " + std::to_string(kMaxJsonDepth) + " levels", "more");
}

/// At most 40 printable ASCII characters of a value, for an error message.
std::string excerpt(const Json& value) {
  std::string s = value.dump(-1, ' ', true, Json::error_handler_t::replace).substr(0, 40);
  std::ranges::replace_if(
      s, [](char c) { return c < ' ' || c > '~'; }, '?');
  return s;
}

/// Builds the document and notices names that an object has twice. (A parser callback would see them too, but
/// with one nlohmann's parser goes over an array's elements again after each: hours for a hostile 16 MB.)
class NameWatcher : public nlohmann::detail::json_sax_dom_parser<Json> {
 public:
  using Base = nlohmann::detail::json_sax_dom_parser<Json>;
  explicit NameWatcher(Json& document) : Base(document, true) {}

  bool start_object(std::size_t size) {
    names_.emplace_back();
    return Base::start_object(size);
  }
  bool key(std::string& name) {
    if (!names_.back().insert(name).second && !repeated) repeated = name;
    return Base::key(name);
  }
  bool end_object() {
    names_.pop_back();
    return Base::end_object();
  }

  std::optional<std::string> repeated;  // the first one

 private:
  std::vector<std::set<std::string>> names_;
};

/// A larger whole number would be another one in a reader that has binary64 alone. (The parser's limit of
/// levels bounds this function's.)
void check_integers(const Json& json, const std::string& file) {
  if (json.is_structured())
    for (const Json& member : json) check_integers(member, file);
  const bool large = json.is_number_unsigned()  ? json.get<std::uint64_t>() > kMaxJsonInteger
                     : json.is_number_integer() ? json.get<std::int64_t>() < -std::int64_t{kMaxJsonInteger}
                                                : false;
  if (large) throw RuleError("J02", file, "", "whole numbers up to 2^53", excerpt(json));
}

}  // namespace

Json parse_json(std::span<const std::uint8_t> bytes, const std::string& file, std::uint64_t max_bytes) {
  if (bytes.size() > max_bytes)
    throw RuleError("L09", file, "", "at most " + std::to_string(max_bytes) + " bytes",
                    std::to_string(bytes.size()));
  check_depth(bytes, file);
  Json json;
  NameWatcher watcher(json);
  try {
    Json::sax_parse(bytes.begin(), bytes.end(), &watcher);
  } catch (const Json::parse_error& e) {
    throw RuleError("J01", file, "byte " + std::to_string(e.byte), "JSON", "a syntax error");
  } catch (const Json::exception&) {
    throw RuleError("J02", file, "", "JSON with numbers in range", "another number");
  }
  if (watcher.repeated)
    throw RuleError("J10", file, "", "every name once", excerpt(*watcher.repeated) + " twice");
  if (!json.is_object()) throw RuleError("J01", file, "/", "an object", json.type_name());
  check_integers(json, file);
  return json;
}

std::optional<std::string> repeated_name(std::span<const std::uint8_t> json) {
  Json document;
  NameWatcher watcher(document);
  Json::sax_parse(json.begin(), json.end(), &watcher);
  return watcher.repeated;
}

std::string dump_json(const nlohmann::ordered_json& json, const std::string& file) {
  try {
    return json.dump();
  } catch (const nlohmann::ordered_json::exception&) {
    throw FormatError(file, "", "texts in UTF-8", "other bytes");
  }
}

std::string shortest_text(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

double shortest_double(float value) {
  if (!std::isfinite(value)) return value;
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  double d = 0;
  std::from_chars(text, end, d);
  return d;
}

double six_digits(double value) {
  if (!std::isfinite(value)) return value;
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value, std::chars_format::scientific, 5).ptr;
  double d = 0;
  std::from_chars(text, end, d);
  return d;
}

void JsonAt::fail(const std::string& expected, const std::string& found) const {
  throw RuleError(rule_, file_, pointer_.empty() ? "/" : pointer_, expected, found);
}
void JsonAt::fail_type(const char* expected) const { fail(expected, excerpt(value_)); }

JsonAt JsonAt::by(const char* rule) const {
  JsonAt at = *this;
  at.rule_ = rule;
  return at;
}

bool JsonAt::has(std::string_view name) const { return value_.is_object() && value_.contains(name); }

JsonAt JsonAt::operator[](std::string_view name) const {
  if (!value_.is_object()) fail_type("an object");
  const auto it = value_.find(name);
  if (it == value_.end())
    JsonAt(value_, file_, pointer_ + "/" + std::string(name)).fail("a value", "nothing");
  return JsonAt(*it, file_, pointer_ + "/" + std::string(name)).by(rule_);
}

JsonAt JsonAt::operator[](std::size_t index) const {
  return JsonAt(value_.at(index), file_, pointer_ + "/" + std::to_string(index)).by(rule_);
}

std::size_t JsonAt::array(std::size_t min_size, std::size_t max_size) const {
  if (!value_.is_array()) fail_type("an array");
  if (value_.size() < min_size || value_.size() > max_size)
    fail(min_size == max_size ? std::to_string(min_size) + " elements"
                              : std::to_string(min_size) + " to " + std::to_string(max_size) + " elements",
         std::to_string(value_.size()));
  return value_.size();
}

std::uint64_t JsonAt::integer(std::uint64_t lo, std::uint64_t hi) const {
  if (!value_.is_number_unsigned()) fail_type("a whole number >= 0");
  const auto v = value_.get<std::uint64_t>();
  if (v < lo || v > hi) fail(std::to_string(lo) + " to " + std::to_string(hi), std::to_string(v));
  return v;
}

double JsonAt::number(double lo, double hi) const {
  if (!value_.is_number()) fail_type("a number");
  const auto v = value_.get<double>();
  if (!(v >= lo && v <= hi)) fail(shortest_text(lo) + " to " + shortest_text(hi), shortest_text(v));
  return v;
}

bool JsonAt::boolean() const {
  if (!value_.is_boolean()) fail_type("true or false");
  return value_.get<bool>();
}

std::string JsonAt::text(std::size_t max_bytes) const {
  if (!value_.is_string()) fail_type("a text");
  const auto& v = value_.get_ref<const std::string&>();
  if (v.size() > max_bytes) fail("at most " + std::to_string(max_bytes) + " bytes", std::to_string(v.size()));
  if (std::ranges::any_of(v, [](char c) { return (c >= 0 && c < ' ') || c == 0x7f; }))
    by("J03").fail("no control characters", excerpt(value_));
  return v;
}

Sha256 JsonAt::digest() const {
  if (!value_.is_string()) by("J07").fail_type("a SHA-256");
  Sha256 digest{};
  if (!from_hex(value_.get_ref<const std::string&>(), digest))
    by("J07").fail_type("64 lower-case hexadecimal digits");
  return digest;
}

}  // namespace texmesh
