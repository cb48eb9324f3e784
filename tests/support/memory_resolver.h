#pragma once
#include <string>
#include <vector>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "pipeline/import/import.h"
#include "pipeline/io/resolver.h"

namespace texmesh::testing {

inline Bytes bytes_of(std::string_view text) { return {text.begin(), text.end()}; }

/// Files in memory; remembers what was asked for.
class MemoryResolver : public MemoryFiles {
 public:
  std::vector<std::string> asked;
  std::optional<Bytes> read(const std::string& uri, std::uint64_t max_bytes) override {
    asked.push_back(uri);
    return MemoryFiles::read(uri, max_bytes);
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
