#pragma once
#include <concepts>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <type_traits>

#include "format/base/bytes.h"
#include "format/base/fields.h"
#include "format/base/note.h"
#include "format/base/sha256.h"

namespace texmesh {

using Json = nlohmann::ordered_json;

// One description of a record gives its JSON both ways and its JSON Schema. A struct lists its members once,
// as options do (format/base/fields.h), in the order that its JSON has:
//
//   struct Report {
//     std::string file, place;
//     std::uint64_t bytes = 0;
//     std::optional<Shard> shard;
//     static void fields(auto& s, auto&& v) {
//       v("version", Constant{1}, "");
//       v("file", s.file, "as the run names the file");
//       v("place", s.place, kMayMiss, "JSON pointer");
//       v("bytes", s.bytes, "of the file");
//       v("shard", s.shard, "");
//     }
//   };
//
// A member is a bool, a number, a text, an enum that has EnumNames, a Sha256 (64 hexadecimal digits), a Json
// (any value), another record, or a vector, a map by text, or an optional of these. A struct of a lower layer
// has its description in RecordFields. Behind the member stands nothing, a Range or a FieldRule; then what
// the schema says.

/// A member of documents that are written alone: null where it is empty.
template <class T>
struct OrNull {
  std::optional<T> value;
};

/// A member that every document of this kind has with the same value.
struct Constant {
  Constant(int value) : number(value) {}
  Constant(const char* value) : text(value) {}
  int number = 0;
  const char* text = nullptr;
};

/// What a member may hold beyond its type.
struct FieldRule {
  std::optional<Range> range = {};  // of numbers, of the elements of lists, of the bytes of a text
  std::optional<Range> count = {};  // of elements of a list
  const char* words = nullptr;      // "input|format": one of these texts
  const char* pattern = nullptr;    // regular expression of a text; the schema alone says it
  bool may_miss = false;            // left out where it is empty or zero, which it is where it is missing
  bool names_file = false;          // bytes, which to_wire() makes UTF-8
};
inline constexpr FieldRule kMayMiss{.may_miss = true};
inline constexpr FieldRule kNotEmpty{.range = Range{1, std::numeric_limits<double>::infinity()}};
inline constexpr FieldRule kNamesFile{.names_file = true};
inline constexpr FieldRule kSeconds{.range = Range{0, 1e9}};

/// Specialise with `fields` for a type that cannot have it.
template <class T>
struct RecordFields {
  static void fields(auto& s, auto&& v) { T::fields(s, v); }
};

template <>
struct EnumNames<Severity> {
  static constexpr std::array<std::string_view, 2> names{"info", "warning"};
};
template <>
struct RecordFields<Note> {
  static void fields(auto& s, auto&& v) {
    v("severity", s.severity, "");
    v("code", s.code, FieldRule{.pattern = "^[a-z0-9-]+$"}, "");
    v("place", s.place, "");
    v("text", s.text, "");
  }
};

/// Where a value stands in a document that is read.
struct RecordPlace {
  const std::string& file;
  const RecordPlace* parent = nullptr;
  std::string_view name = {};
  std::size_t index = 0;        // of an element, which has no name
  bool refuses_others = false;  // members that no description names
  std::string pointer() const;  // JSON pointer; "" of the document
  /// Throws InputError.
  [[noreturn]] void fail(const std::string& expected, const Json& found) const;
};

template <class T>
struct IsList : std::false_type {};
template <class T>
struct IsList<std::vector<T>> : std::true_type {};
template <class T, std::size_t N>
struct IsList<std::array<T, N>> : std::true_type {};
template <class T>
struct IsOrNull : std::false_type {};
template <class T>
struct IsOrNull<OrNull<T>> : std::true_type {};
template <class T>
struct IsMap : std::false_type {};
template <class T>
struct IsMap<std::map<std::string, T>> : std::true_type {};
template <class T>
struct IsShared : std::false_type {};
template <class T>
struct IsShared<std::shared_ptr<const T>> : std::true_type {};
template <class T>
struct IsOptional : std::false_type {};
template <class T>
struct IsOptional<std::optional<T>> : std::true_type {};

/// Empty or zero.
template <class T>
bool is_missing(const T& value) {
  if constexpr (IsList<T>::value || IsMap<T>::value)
    return value.empty();
  else if constexpr (IsOptional<T>::value)
    return !value;
  else if constexpr (requires { value == T{}; })
    return value == T{};
  else
    return false;
}

Json& member_of(Json& object, std::string_view name);  // makes it
Json& appended(Json& list);
void make_json_list(Json& to);
void make_json_object(Json& to);
void put_json(Json& to, bool value);
void put_json(Json& to, std::int64_t value);
void put_json(Json& to, std::uint64_t value);
void put_json(Json& to, double value);
void put_json(Json& to, std::string_view value, const FieldRule& rule);
void put_json(Json& to, const Json& value);
void put_json(Json& to, const Constant& value);

/// The member, or null where it is missing and may be; fails where `object` is none.
const Json* find_member(const Json& object, const char* name, bool may_miss, const RecordPlace& at);
void get_json(const Json& from, bool& value, const RecordPlace& at);
std::int64_t get_signed(const Json& from, double least, double most, const FieldRule& rule,
                        const RecordPlace& at);
std::uint64_t get_unsigned(const Json& from, double most, const FieldRule& rule, const RecordPlace& at);
void get_json(const Json& from, double& value, const FieldRule& rule, const RecordPlace& at);
void get_json(const Json& from, std::string& value, const FieldRule& rule, const RecordPlace& at);
void get_json(const Json& from, Sha256& value, const RecordPlace& at);
void get_json(const Json& from, Json& value);
std::size_t get_enum(const Json& from, std::span<const std::string_view> names, const RecordPlace& at);
void check_constant(const Json& from, const Constant& value, const RecordPlace& at);
void check_names(const Json& object, const std::vector<const char*>& known, const RecordPlace& at);
std::size_t size_of_list(const Json& from, const FieldRule& rule, const RecordPlace& at);
const Json& element_of(const Json& list, std::size_t index);
void for_members(const Json& object, const RecordPlace& at,
                 const std::function<void(const std::string& name, const Json& value)>& use);

void schema_of_bool(Json& to);
void schema_of_integer(Json& to, bool is_signed, const FieldRule& rule);
void schema_of_number(Json& to, const FieldRule& rule);
void schema_of_text(Json& to, const FieldRule& rule);
void schema_of_digest(Json& to);
void schema_of_enum(Json& to, std::span<const std::string_view> names);
void schema_of_constant(Json& to, const Constant& value);
Json& schema_of_list(Json& to, const FieldRule& rule);  // the elements' schema
Json& schema_of_map(Json& to);                          // the members' schema
Json& schema_or_null(Json& to);                         // the schema of what is not null
void begin_object_schema(Json& to);
Json& schema_of_member(Json& object, const char* name, bool may_miss);
void describe_schema(Json& member, const char* text);

/// Calls `visit(name, value, rule, text)` for each member, whatever its description leaves out.
template <class Visit>
class FieldVisitor {
 public:
  explicit FieldVisitor(Visit visit) : visit_(std::move(visit)) {}
  template <class T>
  void operator()(const char* name, T&& value, const char* text) {
    visit_(name, value, FieldRule{}, text);
  }
  template <class T>
  void operator()(const char* name, T&& value, Range range, const char* text) {
    visit_(name, value, FieldRule{.range = range}, text);
  }
  template <class T>
  void operator()(const char* name, T&& value, const FieldRule& rule, const char* text) {
    visit_(name, value, rule, text);
  }

 private:
  Visit visit_;
};

/// Puts a value into `to`. Nobody who calls needs json.hpp.
template <class T>
void put_value(Json& to, const T& value, const FieldRule& rule = {});

/// Puts the members of a record into `to`, but for the list called `left_out`.
template <class T>
void put_members(Json& to, const T& record, std::string_view left_out = "") {
  make_json_object(to);
  RecordFields<T>::fields(
      record, FieldVisitor([&](const char* name, const auto& x, const FieldRule& rule, const char*) {
        using X = std::remove_cvref_t<decltype(x)>;
        if (name == left_out) return;
        if constexpr (!std::is_same_v<X, Constant>)
          if ((rule.may_miss || IsOptional<X>::value) && is_missing(x)) return;
        put_value(member_of(to, name), x, rule);
      }));
}

template <class T>
void put_value(Json& to, const T& value, const FieldRule& rule) {
  if constexpr (std::is_same_v<T, bool> || std::is_same_v<T, double> || std::is_same_v<T, Json> ||
                std::is_same_v<T, Constant>) {
    put_json(to, value);
  } else if constexpr (std::is_enum_v<T>) {
    put_json(to, enum_name(value), rule);
  } else if constexpr (std::signed_integral<T>) {
    put_json(to, static_cast<std::int64_t>(value));
  } else if constexpr (std::unsigned_integral<T>) {
    put_json(to, static_cast<std::uint64_t>(value));
  } else if constexpr (std::is_convertible_v<const T&, std::string_view>) {
    put_json(to, std::string_view(value), rule);
  } else if constexpr (std::is_same_v<T, Sha256>) {
    put_json(to, std::string_view(to_hex(value)), rule);
  } else if constexpr (IsOptional<T>::value) {
    if (value) put_value(to, *value, rule);
  } else if constexpr (IsOrNull<T>::value) {
    if (value.value) put_value(to, *value.value, rule);
  } else if constexpr (IsShared<T>::value) {
    put_value(to, *value, rule);
  } else if constexpr (IsList<T>::value) {
    make_json_list(to);
    for (const auto& x : value) put_value(appended(to), x, rule);
  } else if constexpr (IsMap<T>::value) {
    make_json_object(to);
    for (const auto& [name, x] : value) put_value(member_of(to, name), x, rule);
  } else {
    put_members(to, value);
  }
}

/// Reads a value. InputError {file, JSON pointer, expected, found} for what the description does not allow.
template <class T>
void get_value(const Json& from, T& value, const FieldRule& rule, const RecordPlace& at) {
  if constexpr (std::is_same_v<T, bool> || std::is_same_v<T, Sha256>) {
    get_json(from, value, at);
  } else if constexpr (std::is_same_v<T, Json>) {
    get_json(from, value);
  } else if constexpr (std::is_same_v<T, double> || std::is_same_v<T, std::string>) {
    get_json(from, value, rule, at);
  } else if constexpr (std::is_enum_v<T>) {
    value = static_cast<T>(get_enum(from, EnumNames<T>::names, at));
  } else if constexpr (std::signed_integral<T>) {
    using Limits = std::numeric_limits<T>;
    value = static_cast<T>(
        get_signed(from, static_cast<double>(Limits::min()), static_cast<double>(Limits::max()), rule, at));
  } else if constexpr (std::unsigned_integral<T>) {
    value = static_cast<T>(get_unsigned(from, static_cast<double>(std::numeric_limits<T>::max()), rule, at));
  } else if constexpr (IsOptional<T>::value) {
    get_value(from, value.emplace(), rule, at);
  } else if constexpr (IsShared<T>::value) {
    std::remove_const_t<typename T::element_type> own;
    get_value(from, own, rule, at);
    value = std::make_shared<const decltype(own)>(std::move(own));
  } else if constexpr (IsList<T>::value) {
    const std::size_t count = size_of_list(from, rule, at);
    value.clear();
    value.reserve(count);
    for (std::size_t i = 0; i < count; ++i)
      get_value(element_of(from, i), value.emplace_back(), rule, {at.file, &at, {}, i, at.refuses_others});
  } else if constexpr (IsMap<T>::value) {
    value.clear();
    for_members(from, at, [&](const std::string& name, const Json& x) {
      get_value(x, value[name], rule, {at.file, &at, name, 0, at.refuses_others});
    });
  } else {
    std::vector<const char*> known;
    const auto read = [&](const char* name, auto& x, const FieldRule& r, const char*) {
      using X = std::remove_cvref_t<decltype(x)>;
      const Json* const found = find_member(from, name, r.may_miss || IsOptional<X>::value, at);
      const RecordPlace place{at.file, &at, name, 0, at.refuses_others};
      if (at.refuses_others) known.push_back(name);
      if constexpr (std::is_same_v<X, Constant>) {
        check_constant(*found, x, place);
      } else if (found) {
        get_value(*found, x, r, place);
      } else {
        x = X{};
      }
    };
    RecordFields<T>::fields(value, FieldVisitor(read));
    if (at.refuses_others) check_names(from, known, at);
  }
}

/// The JSON Schema of a value of this type.
template <class T>
void put_schema(Json& to, const FieldRule& rule = {}) {
  if constexpr (std::is_same_v<T, bool>) {
    schema_of_bool(to);
  } else if constexpr (std::is_same_v<T, Json>) {
    make_json_object(to);
  } else if constexpr (std::is_enum_v<T>) {
    schema_of_enum(to, EnumNames<T>::names);
  } else if constexpr (std::integral<T>) {
    schema_of_integer(to, std::signed_integral<T>, rule);
  } else if constexpr (std::is_same_v<T, double>) {
    schema_of_number(to, rule);
  } else if constexpr (std::is_same_v<T, std::string>) {
    schema_of_text(to, rule);
  } else if constexpr (std::is_same_v<T, Sha256>) {
    schema_of_digest(to);
  } else if constexpr (IsOptional<T>::value) {
    put_schema<typename T::value_type>(to, rule);
  } else if constexpr (IsOrNull<T>::value) {
    put_schema<typename decltype(T::value)::value_type>(schema_or_null(to), rule);
  } else if constexpr (IsList<T>::value) {
    put_schema<typename T::value_type>(schema_of_list(to, rule), rule);
  } else if constexpr (IsMap<T>::value) {
    put_schema<typename T::mapped_type>(schema_of_map(to), rule);
  } else {
    begin_object_schema(to);
    const T none{};
    RecordFields<T>::fields(
        none, FieldVisitor([&to](const char* name, const auto& x, const FieldRule& r, const char* text) {
          using X = std::remove_cvref_t<decltype(x)>;
          Json& member = schema_of_member(to, name, r.may_miss || IsOptional<X>::value);
          if constexpr (std::is_same_v<X, Constant>)
            schema_of_constant(member, x);
          else
            put_schema<X>(member, r);
          describe_schema(member, text);
        }));
  }
}

/// The record's JSON. Who calls includes json.hpp; `J` lets the others do without.
template <class T, class J = Json>
J to_json(const T& record) {
  J json;
  put_value(json, record);
  return json;
}

/// As one line; what is no UTF-8 becomes U+FFFD.
std::string json_line(const Json& json);
std::string json_line_of(const std::function<void(Json& to)>& put);
template <class T>
std::string to_json_line(const T& record) {
  return json_line_of([&](Json& to) { put_value(to, record); });
}

/// The record's JSON with its member `list` behind the others, an element a line: a million of them are never
/// one JSON document in memory.
template <class T, class Item>
std::string to_json_with_lines(const T& record, const char* list, const std::vector<Item>& items) {
  std::string out = json_line_of([&](Json& to) { put_members(to, record, list); });
  out.back() = ',';
  out += std::string("\n\"") + list + "\":[";
  const char* before = "\n";
  for (const Item& item : items) {
    out += before + to_json_line(item);
    before = ",\n";
  }
  return out + "\n]}\n";
}

/// JSON from outside. InputError {file, byte, expected, found} for more than `most_bytes` of it, for what
/// nests deeper than `most_depth`, for a name that an object has twice, and for what is no JSON.
Json parse_document(ByteSpan json, std::size_t most_bytes, int most_depth, const std::string& file);

/// A record of JSON from outside. InputError {file, JSON pointer, expected, found}; `refuse_others`: also for
/// members that the description does not name.
template <class T>
T from_json(const Json& json, const std::string& file, bool refuse_others = false) {
  T record;
  get_value(json, record, {}, RecordPlace{file, nullptr, {}, 0, refuse_others});
  return record;
}

template <class T, class J = Json>
J schema_of() {
  J schema;
  put_schema<T>(schema);
  return schema;
}

/// A document that users or programs read or write, and its schema: schemas/NAME.schema.json holds this text.
struct DocumentSchema {
  std::string name, text;
};
/// `body`: what schema_of() gives, or another schema; title and description stand before it.
DocumentSchema document_schema(const std::string& name, const std::string& title,
                               const std::string& description, const Json& body);

}  // namespace texmesh
