#pragma once
#include "format/base/errors.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/reader_limits.h"
#include "tests/support/gltf_builder.h"

namespace texmesh::fuzz {

/// Names end in what the file holds.
class FewFiles : public Resolver {
 public:
  std::optional<Bytes> read(const std::string& name, std::uint64_t) override {
    if (name.ends_with(".png")) return texmesh::testing::png();
    if (name.ends_with(".bin")) return Bytes(256, 0);
    return std::nullopt;
  }
};

inline bool import_as_gltf(ByteSpan input) {
  FewFiles files;
  try {
    import_gltf("fuzz", input, files, reader_limits(), {});
    return true;
  } catch (const InputError& e) {
    return refused(e);
  }
}

}  // namespace texmesh::fuzz
