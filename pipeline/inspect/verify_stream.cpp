#include <algorithm>

#include "format/layout.h"
#include "format/split_stream.h"
#include "pipeline/inspect/verify_checks.h"

namespace texmesh {
namespace {

void check_head(const Manifest& m, std::span<const std::uint8_t> bytes, const SplitStreamHead& head,
                Findings& findings) {
  if (!findings.require(m.stream.has_value(), "reference", kManifestPath, "/stream",
                        std::string("where ") + kSplitStreamPath + " stands", "nothing"))
    return;
  if (findings.require_equal(head.bytes, m.stream->head_bytes, "reference", kManifestPath,
                             "/stream/headBytes"))
    findings.require_equal(to_hex(sha256(bytes.first(static_cast<std::size_t>(head.bytes)))),
                           to_hex(m.stream->head_digest), "reference", kManifestPath, "/stream/headSha256");
  const SplitBlock& last = head.blocks.back();
  findings.require_equal<std::uint64_t>(last.offset + last.bytes(), bytes.size(), "split-stream",
                                        kSplitStreamPath, "end of the last block");
}

}  // namespace

void check_split_stream(const Manifest& m, std::span<const std::uint8_t> bytes, const RunContext& context,
                        Findings& findings) {
  const SplitStreamHead head = read_split_head(bytes);
  check_head(m, bytes, head, findings);
  // A point has a vertex in S_0's file, unless all of its triangles show nothing on the grid.
  const std::uint64_t points = 4ull * m.scales.front().vertices + 4096;
  const std::uint64_t faces = 4ull * m.scales.front().triangles + 4096;
  SplitStreamReader reader(head,
                           {static_cast<std::uint32_t>(std::min<std::uint64_t>(points, SplitLimits{}.points)),
                            static_cast<std::uint32_t>(std::min<std::uint64_t>(faces, SplitLimits{}.faces))});
  for (std::size_t k = 0; k < head.scales.size(); ++k) {
    context.check_cancelled();
    reader.read_to_scale(k, bytes);
    const SplitScale& s = head.scales[k];
    const std::string place = "scale " + std::to_string(s.scale);
    const auto scale = std::ranges::find(m.scales, s.scale, &ManifestScale::scale);
    if (findings.require(scale != m.scales.end(), "split-stream", kSplitStreamPath, place,
                         "a scale of the manifest", "none"))
      findings.require_equal(scale->triangles, s.triangles, "split-stream", kSplitStreamPath,
                             place + ", triangles");
  }
}

}  // namespace texmesh
