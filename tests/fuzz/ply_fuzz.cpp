// libFuzzer entry of the PLY reader: any bytes give a model or an InputError. Replayed over generated inputs
// by tests/pipeline/import/import_text_fuzz_test.cpp; for a real run build this file, pipeline/import and
// what it needs with clang++ -fsanitize=fuzzer,address,undefined.
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "format/base/errors.h"
#include "pipeline/import/import.h"

namespace {

class NoFiles : public texmesh::Resolver {
 public:
  std::optional<std::vector<std::uint8_t>> read(const std::string&, std::uint64_t) override {
    return std::nullopt;
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  NoFiles resolver;
  texmesh::ImportOptions options;
  options.max_vertices = options.max_triangles = 100'000;
  try {
    texmesh::import_ply("fuzz", {data, size}, resolver, options, {});
  } catch (const texmesh::InputError&) {
  }
  return 0;
}
