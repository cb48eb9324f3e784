#pragma once
#include <vector>

#include "format/base/errors.h"

namespace texmesh {

/// One thing about a package that is not as its format says. `check` names what was looked at (stable,
/// kebab-case), `rule` the rule of format/SPEC.md that is broken ("" = none), `entry` the path inside the
/// package ("" = the package as a whole), `field` the place in the entry: a JSON pointer, an array element, a
/// byte offset.
struct Finding {
  std::string check, rule, entry, field, expected, found;
  friend bool operator==(const Finding&, const Finding&) = default;
};

/// `mesh/s09.glb: /accessors/3/count: expected 12, found 13 [glb-accessor] [G01]`
inline std::string to_string(const Finding& f) {
  std::string s = f.entry;
  const auto add = [&s](const char* separator, const std::string& text) {
    if (text.empty()) return;
    if (!s.empty()) s += separator;
    s += text;
  };
  add(": ", f.field);
  add(": expected ", f.expected);
  add(f.expected.empty() ? ": found " : ", found ", f.found);
  s += " [" + f.check + "]";
  return f.rule.empty() ? s : s + " [" + f.rule + "]";
}

/// What was looked at, and the rule that it breaks where it is not right.
struct Check {
  Check(const char* name_, const char* rule_ = "") : name(name_), rule(rule_) {}
  std::string name, rule;
};

/// What a finding tells: a text or a number.
struct Told {
  Told(const char* words) : text(words) {}
  Told(std::string words) : text(std::move(words)) {}
  template <class T>
  requires std::is_arithmetic_v<T> Told(T number) : text(std::to_string(number)) {}
  std::string text;
};

/// Collects findings; every method returns whether the rule holds, so that a check can stop where going
/// on is pointless.
class Findings {
 public:
  void add(Check check, std::string entry, std::string field, std::string expected, std::string found) {
    list_.push_back({std::move(check.name), std::move(check.rule), std::move(entry), std::move(field),
                     std::move(expected), std::move(found)});
  }
  /// The error's rule counts before the check's.
  void add(const Check& check, const std::string& entry, const Error& error) {
    const std::string rule = rule_of(error);
    add({check.name.c_str(), rule.empty() ? check.rule.c_str() : rule.c_str()}, entry, error.place(),
        error.expected(), error.found());
  }
  /// Findings from `begin` on that name no rule are breaches of this one.
  void name_rule(std::size_t begin, const char* rule) {
    for (std::size_t k = begin; k < list_.size(); ++k)
      if (list_[k].rule.empty()) list_[k].rule = rule;
  }
  void append(Findings other) {
    for (Finding& f : other.list_) list_.push_back(std::move(f));
  }
  bool require(bool holds, const Check& check, const std::string& entry, const std::string& field,
               const Told& expected, const Told& found) {
    if (!holds) add(check, entry, field, expected.text, found.text);
    return holds;
  }
  bool require_equal(const auto& expected, const auto& found, const Check& check, const std::string& entry,
                     const std::string& field) {
    return expected == found || require(false, check, entry, field, expected, found);
  }
  bool empty() const { return list_.empty(); }
  const std::vector<Finding>& list() const { return list_; }
  /// The findings; none are left afterwards.
  std::vector<Finding> release() { return std::move(list_); }

 private:
  std::vector<Finding> list_;
};

}  // namespace texmesh
