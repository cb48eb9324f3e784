#pragma once
#include <cstdint>
#include <string>
#include <vector>

namespace texmesh {

enum class Severity : std::uint8_t { kInfo = 0, kWarning = 1 };

/// Something a user should know about a model that compiled all the same. Notes travel inside stage
/// results, so a result that comes from the cache says the same as one that was computed. `--strict`
/// makes warnings errors.
struct Note {
  Severity severity = Severity::kInfo;
  std::string code;   // stable, kebab-case: "missing-texture", "non-finite-position"
  std::string place;  // where in the input, "" when it is the whole
  std::string text;   // one sentence without a final full stop

  friend bool operator==(const Note&, const Note&) = default;
  static void archive(auto& s, auto& a) { a(s.severity, s.code, s.place, s.text); }
};
using Notes = std::vector<Note>;

inline void add_warning(Notes& notes, std::string code, std::string place, std::string text) {
  notes.push_back({Severity::kWarning, std::move(code), std::move(place), std::move(text)});
}
inline void add_info(Notes& notes, std::string code, std::string place, std::string text) {
  notes.push_back({Severity::kInfo, std::move(code), std::move(place), std::move(text)});
}

}  // namespace texmesh
