#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "format/base/no_index.h"
#include "format/base/rule_error.h"
#include "format/split/split_mesh.h"

namespace texmesh {

inline constexpr const char* kSplitStreamName = "mesh/stream.bin";

[[noreturn]] inline void fail_split_stream(const char* rule, const std::string& place,
                                           const std::string& expected, const std::string& found) {
  throw RuleError(rule, kSplitStreamName, place, expected, found);
}
[[noreturn]] inline void fail_split_stream(const char* rule, const std::string& expected,
                                           const std::string& found) {
  fail_split_stream(rule, "", expected, found);
}

/// Bounds the codec's steps by the size of the mesh. Otherwise a few bytes could ask many points, or go round
/// a point of huge degree many times.
class SplitStepLimit {
 public:
  explicit SplitStepLimit(const SplitMesh& mesh) : mesh_(mesh) {}
  /// FormatError when the stream needed too many steps.
  void add(std::uint64_t steps) {
    steps_ += steps;
    if (steps_ > (std::uint64_t{1} << 20) + 256 * (mesh_.points().size() + mesh_.face_count()))
      fail_split_stream("S20", "splits that are found in reasonable time",
                        "more steps than 256 per point and face");
  }

 private:
  const SplitMesh& mesh_;
  std::uint64_t steps_ = 0;
};

/// The split or the patch's edge that the codec works at.
struct SplitSite {
  std::uint32_t parent = kNoIndex, child = kNoIndex;  // none in a patch
  std::vector<SplitMesh::Corner> corners;             // of the point looked at, sorted into fans
  std::vector<SplitMesh::Fan> fans;
  std::vector<std::uint32_t> child_wedges;  // in the order in which they were made
};

}  // namespace texmesh
