// Inputs that were found by libFuzzer, or made by hand where the target cannot reach: what they did stands
// beside them.
#include <map>

#include "tests/fuzz/fuzz_target.h"

namespace texmesh::fuzz {
namespace {

/// An EXR with one attribute, which claims 1 GB: OpenEXR took the memory before it read.
Bytes exr_with_long_attribute(std::string_view type) {
  BytesOut out;
  out.u32(20000630), out.u32(2);
  out.text("a"), out.u8(0), out.text(type), out.u8(0);
  out.u32(1u << 30);
  out.text("b");
  return out.finish();
}

}  // namespace

std::vector<Bytes> regressions(const std::string& target) {
  static const std::map<std::string, std::vector<Bytes>> found{
      {"exr", {exr_with_long_attribute("str"), exr_with_long_attribute("")}}};
  const auto it = found.find(target);
  return it == found.end() ? std::vector<Bytes>{} : it->second;
}

}  // namespace texmesh::fuzz
