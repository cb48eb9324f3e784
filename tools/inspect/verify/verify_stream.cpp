#include <algorithm>

#include "format/container/layout.h"
#include "format/split/split_reader.h"
#include "format/split/split_stream.h"
#include "tools/inspect/verify/verify_checks.h"

namespace texmesh {
namespace {

void check_head(const Manifest& m, std::span<const std::uint8_t> bytes, const SplitStreamHead& head,
                Findings& findings) {
  if (!findings.require(m.stream.has_value(), {"reference", "E03"}, kManifestPath, "/stream",
                        std::string("where ") + kSplitStreamPath + " stands", "nothing"))
    return;
  if (findings.require_equal(head.bytes, m.stream->head_bytes, {"reference", "S08"}, kManifestPath,
                             "/stream/headBytes"))
    findings.require_equal(to_hex(sha256(bytes.first(static_cast<std::size_t>(head.bytes)))),
                           to_hex(m.stream->head_digest), {"reference", "R02"}, kManifestPath,
                           "/stream/headSha256");
  const SplitBlock& last = head.blocks.back();
  findings.require_equal<std::uint64_t>(last.offset + last.bytes(), bytes.size(), {"split-stream", "S08"},
                                        kSplitStreamPath, "end of the last block");
}

void check_scale(const ManifestScale& scale, const SplitScale& s, std::span<const std::uint8_t> stream,
                 std::uint64_t prefix_bytes, Findings& findings) {
  const std::string place = "scale " + std::to_string(s.scale);
  findings.require_equal(scale.triangles, s.triangles, {"split-stream", "S21"}, kSplitStreamPath,
                         place + ", triangles");
  if (scale.has_glb()) return;
  findings.require_equal(scale.vertices, s.wedges, {"split-stream", "M16"}, kSplitStreamPath,
                         place + ", vertices");
  if (!findings.require_equal(scale.glb.bytes, prefix_bytes, {"reference", "M20"}, kManifestPath,
                              place + ", bytes of its prefix"))
    return;
  const Sha256 digest = sha256(stream.first(static_cast<std::size_t>(prefix_bytes)));
  findings.require_equal(to_hex(scale.glb.digest), to_hex(digest), {"reference", "M17"}, kManifestPath,
                         place + ", sha256 of its prefix");
}

}  // namespace

void check_split_stream(const Manifest& m, std::span<const std::uint8_t> bytes, const MeshShare& share,
                        const RunContext& context, Findings& findings) {
  const SplitStreamHead head = read_split_head(bytes);
  check_head(m, bytes, head, findings);
  for (const SplitGroup& g : head.groups)
    findings.require(!share.known || g.material < std::max<std::size_t>(share.material_count, 1),
                     {"split-stream", "S23"}, kSplitStreamPath, "groups",
                     "a material of the GLBs, of " + std::to_string(share.material_count),
                     std::to_string(g.material));
  // The manifest's counts bound nothing here: on a coarse grid most faces of a stream may show nothing, and
  // the files have none of them. What the reader makes is bounded by the bytes of the blocks.
  SplitStreamReader reader(head);
  for (std::size_t k = 0; k < head.scales.size(); ++k) {
    context.check_cancelled();
    reader.read_to_scale(k, bytes);
    const SplitScale& s = head.scales[k];
    const std::string place = "scale " + std::to_string(s.scale);
    const auto scale = std::ranges::find(m.scales, s.scale, &ManifestScale::scale);
    if (findings.require(scale != m.scales.end(), {"split-stream", "S21"}, kSplitStreamPath, place,
                         "a scale of the manifest", "none"))
      check_scale(*scale, s, bytes, split_prefix_bytes(head, s.scale), findings);
  }
}

}  // namespace texmesh
