#pragma once
#include <map>
#include <string>
#include <vector>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "pipeline/import/import.h"

namespace texmesh::testing {

inline Bytes bytes_of(std::string_view text) { return {text.begin(), text.end()}; }

/// Files in memory; remembers what was asked for.
class MemoryResolver : public Resolver {
 public:
  std::map<std::string, Bytes> files;
  std::vector<std::string> asked;
  std::optional<Bytes> read(const std::string& uri, std::uint64_t max_bytes) override {
    asked.push_back(uri);
    const auto it = files.find(uri);
    if (it == files.end()) return std::nullopt;
    if (it->second.size() > max_bytes)
      throw InputError(uri, "", "at most " + std::to_string(max_bytes) + " bytes", "more");
    return it->second;
  }
};

/// The text of the error that `f` throws as InputError, "" when it throws none.
template <class F>
std::string input_error(F&& f) {
  try {
    f();
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

inline int count_notes(const Model& model, std::string_view code) {
  int n = 0;
  for (const Note& note : model.notes) n += note.code == code;
  return n;
}

}  // namespace texmesh::testing
