#pragma once
// Inside the room only: one description of a document's members writes them and reads them.
//
// A description calls a visitor, MemberWriter or MemberReader, once for each member, in the order of the
// document. Ranges and rules are those that a reader checks. A writer puts every value down as it is: what
// it has written is read again.
#include <nlohmann/json.hpp>
#include <type_traits>

#include "format/base/json_fields.h"
#include "format/base/vec.h"

namespace texmesh {

class MemberWriter {
 public:
  using Json = nlohmann::ordered_json;
  /// `columns`: every member is a list, to which a value is added.
  explicit MemberWriter(Json& to, bool columns = false) : to_(to), columns_(columns) {}
  MemberWriter& by(const char*) { return *this; }

  void integer(const char* name, std::integral auto value, std::uint64_t, std::uint64_t = 0) {
    slot(name) = value;
  }
  void number(const char* name, double value, double, double) { slot(name) = value; }
  void number(const char* name, float value, double, double) { slot(name) = shortest_double(value); }
  void measured(const char* name, double value, double, double) { slot(name) = six_digits(value); }
  void boolean(const char* name, bool value) { slot(name) = value; }
  void text(const char* name, const std::string& value, std::size_t) { slot(name) = value; }
  void digest(const char* name, const Sha256& value) { slot(name) = to_hex(value); }
  void named(const char* name, auto value, auto&& name_of, auto&&, const char*) {
    slot(name) = name_of(value);
  }
  void vector(const char* name, Vec3d v, double) { slot(name) = Json::array({v.x, v.y, v.z}); }
  template <class T>
  void rising(const char* name, const std::vector<T>& values, std::size_t, double, double) {
    if constexpr (std::is_same_v<T, float>)
      numbers(name, values, 0, 0, 0);
    else
      slot(name) = values;
  }
  void measured(const char* name, const std::vector<double>& values, std::size_t, std::size_t, double) {
    Json& list = slot(name) = Json::array();
    for (const double v : values) list.push_back(six_digits(v));
  }
  void numbers(const char* name, const std::vector<float>& values, std::size_t, std::size_t, double) {
    Json& list = slot(name) = Json::array();
    for (const float v : values) list.push_back(shortest_double(v));
  }
  bool has(const char*, bool there) const { return there; }
  void object(const char* name, auto&& describe) {
    MemberWriter inner(slot(name));
    describe(inner);
  }
  void list(const char* name, const auto& values, std::size_t, std::size_t, auto&& describe) {
    Json& list = slot(name) = Json::array();
    for (std::size_t i = 0; i < values.size(); ++i) {
      MemberWriter inner(list.emplace_back());
      describe(inner, values[i], i);
    }
  }
  /// One list per member: as objects, forty scales would spend half of a manifest on names.
  void rows(const char*, const auto& values, std::size_t, std::size_t, auto&& describe) {
    MemberWriter inner(to_, true);
    for (std::size_t i = 0; i < values.size(); ++i) describe(inner, values[i], i);
  }
  void check(const char*, bool, const auto&, const auto&) {}

 private:
  Json& slot(const char* name) { return columns_ ? to_[name].emplace_back() : to_[name]; }
  Json& to_;
  bool columns_;
};

class MemberReader {
 public:
  explicit MemberReader(JsonAt at) : at_(std::move(at)) {}
  /// The same members; a value that is wrong breaks `rule`.
  MemberReader by(const char* rule) const {
    MemberReader out = *this;
    out.rule_ = rule;
    return out;
  }

  template <std::integral T>
  void integer(const char* name, T& value, std::uint64_t lo, std::uint64_t hi = kMaxJsonInteger) const {
    value = static_cast<T>(at(name).integer(lo, hi));
  }
  template <std::floating_point T>
  void number(const char* name, T& value, double lo, double hi) const {
    value = static_cast<T>(at(name).number(lo, hi));
  }
  void measured(const char* name, double& value, double lo, double hi) const { number(name, value, lo, hi); }
  void boolean(const char* name, bool& value) const { value = at(name).boolean(); }
  void text(const char* name, std::string& value, std::size_t max_bytes) const {
    value = at(name).text(max_bytes);
  }
  void digest(const char* name, Sha256& value) const { value = at(name).digest(); }
  /// `of_name(text)`: the value, or nothing where no value has that name.
  void named(const char* name, auto& value, auto&&, auto&& of_name, const char* expected) const {
    const std::string found = at(name).text(100);
    const auto known = of_name(found);
    if (!known) at(name).fail(expected, found);
    value = *known;
  }
  void vector(const char* name, Vec3d& v, double most) const {
    const JsonAt list = at(name);
    list.array(3, 3);
    v = {list[0].number(-most, most), list[1].number(-most, most), list[2].number(-most, most)};
  }
  template <class T>
  void rising(const char* name, std::vector<T>& values, std::size_t most, double lo, double hi) const {
    const JsonAt list = at(name);
    for (std::size_t i = 0, n = list.array(1, most); i < n; ++i) {
      if constexpr (std::is_integral_v<T>)
        values.push_back(
            static_cast<T>(list[i].integer(static_cast<std::uint64_t>(lo), static_cast<std::uint64_t>(hi))));
      else
        values.push_back(static_cast<T>(list[i].number(lo, hi)));
      if (i > 0 && values[i] <= values[i - 1]) list[i].fail("a rising number", std::to_string(values[i]));
    }
  }
  template <class T>
  void numbers(const char* name, std::vector<T>& values, std::size_t fewest, std::size_t most,
               double hi) const {
    const JsonAt list = at(name);
    for (std::size_t i = 0, n = list.array(fewest, most); i < n; ++i)
      values.push_back(static_cast<T>(list[i].number(0, hi)));
  }
  void measured(const char* name, std::vector<double>& values, std::size_t fewest, std::size_t most,
                double hi) const {
    numbers(name, values, fewest, most, hi);
  }
  /// Whether the member is there; a writer asks whether it shall be.
  bool has(const char* name, bool) const { return at_.has(name); }
  void object(const char* name, auto&& describe) const {
    MemberReader inner(at(name));
    describe(inner);
  }
  void list(const char* name, auto& values, std::size_t fewest, std::size_t most, auto&& describe) const {
    const JsonAt list = at(name);
    for (std::size_t i = 0, n = list.array(fewest, most); i < n; ++i) {
      MemberReader inner(list[i]);
      describe(inner, values.emplace_back(), i);
    }
  }
  /// `first` says how many rows there are.
  void rows(const char* first, auto& values, std::size_t fewest, std::size_t most, auto&& describe) const {
    MemberReader inner(at_);
    inner.rows_ = at_[first].array(fewest, most);
    inner.columns_rule_ = rule_;
    for (inner.row_ = 0; inner.row_ < inner.rows_; ++inner.row_)
      describe(inner, values.emplace_back(), inner.row_);
  }
  void check(const char* name, bool holds, const std::string& expected, const std::string& found) const {
    if (!holds) at(name).fail(expected, found);
  }

 private:
  JsonAt at(const char* name) const {
    const JsonAt value = at_[name];
    if (rows_ == 0) return rule_ ? value.by(rule_) : value;
    (columns_rule_ ? value.by(columns_rule_) : value).array(rows_, rows_);
    return rule_ ? value[row_].by(rule_) : value[row_];
  }
  JsonAt at_;
  const char* rule_ = nullptr;
  const char* columns_rule_ = nullptr;
  std::size_t rows_ = 0, row_ = 0;
};

}  // namespace texmesh
