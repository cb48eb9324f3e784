#include "tests/fuzz/fuzz_target.h"

#include <cstdio>
#include <cstdlib>

namespace texmesh::fuzz {

const std::vector<Target>& targets() {
  static const std::vector<Target> list = [] {
    std::vector<Target> l;
#ifdef TEXMESH_FUZZ_ROOM  // libFuzzer looks at the counters of all that is linked after each run
    TEXMESH_FUZZ_ROOM(l);
#else
    add_format_targets(l);
    add_gltf_targets(l);
    add_parts_targets(l);
    add_scan_targets(l);
    add_image_targets(l);
    add_batch_targets(l);
    add_http_targets(l);
#endif
    return l;
  }();
  return list;
}

const Target* find_target(const std::string& name) {
  for (const Target& t : targets())
    if (t.name == name) return &t;
  return nullptr;
}

void require(bool good, const char* what) {
  if (good) return;
  std::fprintf(stderr, "fuzz: %s\n", what);
  std::abort();
}

bool refused(const std::exception& why) {
  static const bool say = std::getenv("TEXMESH_FUZZ_SAY") != nullptr;
  if (say) std::fprintf(stderr, "refused: %s\n", why.what());
  return false;
}

}  // namespace texmesh::fuzz
