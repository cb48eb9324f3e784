// libFuzzer entry of the glTF reader: any bytes give a model or an InputError. Replayed over generated inputs
// by tests/pipeline/import/gltf/import_gltf_fuzz_test.cpp; for a real run build this file, pipeline/import
// and what it needs with clang++ -fsanitize=fuzzer,address,undefined.
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/import/import.h"

namespace {

/// Every name is there, with the same few bytes: enough for a buffer, and no image.
class OneFileResolver : public texmesh::Resolver {
 public:
  std::optional<std::vector<std::uint8_t>> read(const std::string&, std::uint64_t) override {
    return std::vector<std::uint8_t>(64, 0);
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  OneFileResolver resolver;
  texmesh::ImportOptions options;
  options.max_vertices = 100'000;
  options.max_triangles = 100'000;
  options.max_file_bytes = 1e6;
  try {
    texmesh::import_gltf("fuzz", {data, size}, resolver, options, {});
  } catch (const texmesh::InputError&) {
  }
  return 0;
}
