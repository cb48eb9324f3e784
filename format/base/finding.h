#pragma once
#include <string>
#include <utility>
#include <vector>

#include "format/base/errors.h"

namespace texmesh {

/// One thing about a package that is not as its format says. `check` names the rule (stable, kebab-case),
/// `entry` the path inside the package ("" = the package as a whole), `field` the place in the entry: a JSON
/// pointer, an array element, a byte offset.
struct Finding {
  std::string check, entry, field, expected, found;
  friend bool operator==(const Finding&, const Finding&) = default;
};

/// `mesh/s09.glb: /accessors/3/count: expected 12, found 13 [glb-accessor]`
std::string to_string(const Finding& finding);

/// Collects findings; every method returns whether the rule holds, so that a check can stop where going
/// on is pointless.
class Findings {
 public:
  void add(std::string check, std::string entry, std::string field, std::string expected, std::string found) {
    list_.push_back(
        {std::move(check), std::move(entry), std::move(field), std::move(expected), std::move(found)});
  }
  void add(const std::string& check, const std::string& entry, const Error& error) {
    add(check, entry, error.place(), error.expected(), error.found());
  }
  void append(Findings other) {
    for (Finding& f : other.list_) list_.push_back(std::move(f));
  }
  bool require(bool holds, const char* check, const std::string& entry, const std::string& field,
               const std::string& expected, const std::string& found) {
    if (!holds) add(check, entry, field, expected, found);
    return holds;
  }
  template <class T>
  bool require_equal(const T& expected, const T& found, const char* check, const std::string& entry,
                     const std::string& field) {
    if (expected == found) return true;
    if constexpr (std::is_same_v<T, std::string>) {
      add(check, entry, field, expected, found);
    } else {
      add(check, entry, field, std::to_string(expected), std::to_string(found));
    }
    return false;
  }
  bool empty() const { return list_.empty(); }
  const std::vector<Finding>& list() const { return list_; }
  /// The findings; none are left afterwards.
  std::vector<Finding> release() { return std::move(list_); }

 private:
  std::vector<Finding> list_;
};

}  // namespace texmesh
