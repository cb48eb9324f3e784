// libFuzzer entry of the OBJ and MTL readers: any bytes give a model or an InputError. The bytes up to the
// first NUL are the OBJ, the rest is every MTL it asks for. Replayed over generated inputs by
// tests/pipeline/import/import_text_fuzz_test.cpp; for a real run build this file, pipeline/import and what
// it needs with clang++ -fsanitize=fuzzer,address,undefined.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "format/base/errors.h"
#include "pipeline/import/import.h"

namespace {

class OneLibrary : public texmesh::Resolver {
 public:
  std::vector<std::uint8_t> mtl;
  std::optional<std::vector<std::uint8_t>> read(const std::string& name, std::uint64_t) override {
    if (name.ends_with(".mtl")) return mtl;
    return std::nullopt;
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::uint8_t* end = std::find(data, data + size, 0);
  OneLibrary resolver;
  if (end != data + size) resolver.mtl.assign(end + 1, data + size);
  texmesh::ImportOptions options;
  options.max_vertices = options.max_triangles = 100'000;
  try {
    texmesh::import_obj("fuzz", {data, static_cast<std::size_t>(end - data)}, resolver, options, {});
  } catch (const texmesh::InputError&) {
  }
  return 0;
}
