#include "pipeline/compile/option_json.h"

#include <nlohmann/json.hpp>

#include "format/base/errors.h"
#include "pipeline/graph/option_text.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

template <class... F>
struct Overload : F... {
  using F::operator()...;
};
template <class... F>
Overload(F...) -> Overload<F...>;

std::string joined(std::span<const std::string_view> names) {
  std::string s;
  for (std::string_view n : names) s += (s.empty() ? "" : ", ") + std::string(n);
  return s;
}

std::string range_text(const Range& r, const char* kind) {
  return std::string(kind) + " in " + option_text(r.lo) + " .. " + option_text(r.hi);
}

/// Of a text without a Range.
constexpr int kMostTextBytes = 200;

int most_text_bytes(const OptionField& field) {
  return field.range ? static_cast<int>(field.range->hi) : kMostTextBytes;
}

/// Reads JSON values into fields and says what was wrong where.
class FieldReader {
 public:
  FieldReader(std::string file, std::string place) : file_(std::move(file)), place_(std::move(place)) {}

  void read(OptionField& field, const Json& json) const {
    std::visit(
        Overload{
            [&](bool* v) { *v = json.is_boolean() ? json.get<bool>() : fail<bool>("true or false", json); },
            [&](int* v) { *v = static_cast<int>(integer(json, *field.range)); },
            [&](double* v) { *v = number(json, *field.range); },
            [&](std::string* v) {
              const auto most = static_cast<std::size_t>(most_text_bytes(field));
              if (!json.is_string() || json.get_ref<const std::string&>().size() > most)
                fail<int>("a text of at most " + std::to_string(most) + " bytes", json);
              *v = json.get<std::string>();
            },
            [&](std::vector<int>* v) {
              *v = list<int>(json, [&](const Json& x) { return static_cast<int>(integer(x, *field.range)); });
            },
            [&](std::vector<double>* v) {
              *v = list<double>(json, [&](const Json& x) { return number(x, *field.range); });
            },
            [&](EnumField& e) { enumerator(e, json); },
        },
        field.value);
  }

 private:
  template <class T>
  T fail(std::string expected, const Json& found) const {
    throw InputError(file_, place_, std::move(expected), found.dump().substr(0, 80));
  }
  double number(const Json& json, const Range& range) const {
    if (!json.is_number() || !(json.get<double>() >= range.lo && json.get<double>() <= range.hi))
      return fail<double>(range_text(range, "a number"), json);
    return json.get<double>();
  }
  double integer(const Json& json, const Range& range) const {
    if (!json.is_number_integer() || !(json.get<double>() >= range.lo && json.get<double>() <= range.hi))
      return fail<double>(range_text(range, "an integer"), json);
    return json.get<double>();
  }
  template <class T, class F>
  std::vector<T> list(const Json& json, F&& element) const {
    if (!json.is_array() || json.empty() || json.size() > 64)
      return fail<std::vector<T>>("a list of 1 to 64 numbers", json);
    std::vector<T> v;
    for (const Json& x : json) v.push_back(element(x));
    return v;
  }
  void enumerator(EnumField& e, const Json& json) const {
    if (json.is_string())
      for (std::size_t i = 0; i < e.names.size(); ++i)
        if (e.names[i] == json.get_ref<const std::string&>()) return e.set(i);
    fail<int>("one of " + joined(e.names), json);
  }
  std::string file_, place_;
};

}  // namespace

Json option_json(const OptionField& f) {
  return std::visit(Overload{[](const EnumField& e) { return Json(e.names[e.get()]); },
                             [](const auto* value) { return Json(*value); }},
                    f.value);
}

void set_option_json(OptionField& field, const Json& json, const std::string& file,
                     const std::string& place) {
  FieldReader(file, place).read(field, json);
  field.set_by_user->insert(field.path());
}

Json option_schema(const OptionField& f) {
  Json s = Json::object();
  auto numeric = [&](const char* type) {
    Json n{{"type", type}};
    auto bound = [type](double v) {
      return type == std::string("integer") ? Json(static_cast<std::int64_t>(v)) : Json(v);
    };
    n["minimum"] = bound(f.range->lo);
    n["maximum"] = bound(f.range->hi);
    return n;
  };
  auto list_of = [&](const char* type) {
    return Json{{"type", "array"}, {"minItems", 1}, {"maxItems", 64}, {"items", numeric(type)}};
  };
  std::visit(Overload{
                 [&](const bool*) { s["type"] = "boolean"; },
                 [&](const int*) { s = numeric("integer"); },
                 [&](const double*) { s = numeric("number"); },
                 [&](const std::string*) {
                   s = Json{{"type", "string"}, {"maxLength", most_text_bytes(f)}};
                 },
                 [&](const std::vector<int>*) { s = list_of("integer"); },
                 [&](const std::vector<double>*) { s = list_of("number"); },
                 [&](const EnumField& e) {
                   s = Json{{"enum", Json(std::vector<std::string>(e.names.begin(), e.names.end()))}};
                 },
             },
             f.value);
  s["description"] = f.help;
  s["default"] = option_json(f);
  return s;
}

}  // namespace texmesh
