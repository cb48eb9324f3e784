#include "tests/fuzz/fuzz_target.h"

namespace texmesh::fuzz {

std::vector<Bytes> regressions(const std::string&) { return {}; }

}  // namespace texmesh::fuzz
