// What a package shows of the surface: GLBs of scales and proxies, and the stream of vertex splits.
#include <algorithm>
#include <nlohmann/json.hpp>
#include <tuple>

#include "format/split/split_reader.h"
#include "pipeline/io/table.h"
#include "stages/gltf/check_glb.h"
#include "tools/inspect/verify/verify_checks.h"

namespace texmesh {
namespace {

/// The coarsest scale has the previews within it, others name them; a picture with alpha is no preview.
void check_previews_of(const Manifest& m, const ManifestScale& scale,
                       const std::vector<TextureInfo>& textures, const GlbFacts& facts, Findings& findings) {
  const bool coarsest = scale.scale == m.scales.back().scale;
  for (std::size_t k = 0; k < facts.image_names.size(); ++k) {
    const auto plane = std::ranges::find_if(textures, [&](const TextureInfo& t) {
      return t.role != "alpha" && t.mip == 0 && facts.image_names[k] == "texture/" + std::to_string(t.image);
    });
    if (plane == textures.end()) continue;  // has its finding
    const auto number = static_cast<std::uint32_t>(plane - textures.begin());
    const bool alpha = std::ranges::any_of(
        textures, [&](const TextureInfo& t) { return t.role == "alpha" && t.image == plane->image; });
    const std::string place = "/images/" + std::to_string(k), &uri = facts.image_uris[k];
    const bool named = !coarsest && !alpha;
    if (!findings.require(uri == (named ? "../" + preview_path(number) : ""),
                          {"mesh-images", coarsest || alpha ? "G05" : "G06"}, scale.glb.path, place + "/uri",
                          named ? "../" + preview_path(number) : "an image within the file",
                          uri.empty() ? "none" : uri))
      continue;
    if (uri.empty() && !alpha && !plane->preview.path.empty())
      findings.require_equal(to_hex(plane->preview.digest), to_hex(facts.image_digests[k]),
                             {"mesh-images", "G05"}, scale.glb.path, place);
  }
}

void check_image_names(const ManifestScale& scale, const std::vector<TextureInfo>& textures,
                       const GlbFacts& facts, Findings& findings) {
  for (const TextureInfo& t : textures) {
    const std::string name = "texture/" + std::to_string(t.image);
    // A scale may have lost every triangle of a material; S_0 has them all.
    if (scale.scale == 0)
      findings.require(
          std::find(facts.image_names.begin(), facts.image_names.end(), name) != facts.image_names.end(),
          {"mesh-images", "G04"}, scale.glb.path, "/images", "an image named " + name, "none");
  }
  for (std::size_t k = 0; k < facts.image_names.size(); ++k)
    findings.require(std::any_of(textures.begin(), textures.end(),
                                 [&](const TextureInfo& t) {
                                   return facts.image_names[k] == "texture/" + std::to_string(t.image);
                                 }),
                     {"mesh-images", "G04"}, scale.glb.path, "/images/" + std::to_string(k) + "/name",
                     "texture/<image> of textures.json", facts.image_names[k]);
}

/// Stored positions may lie a little outside of S_0's bounds.
void check_bounds(const Manifest& m, const GlbFacts& facts, const std::string& entry, const char* rule,
                  Findings& findings) {
  const double slack = 0.01 * length(m.bounds_max - m.bounds_min) + 1e-30;
  for (int k = 0; k < 3 && facts.has_bounds; ++k)
    findings.require(
        facts.bounds_min[k] >= m.bounds_min[k] - slack && facts.bounds_max[k] <= m.bounds_max[k] + slack,
        {"mesh-bounds", rule}, entry, std::string("axis ") + "xyz"[k],
        shortest(m.bounds_min[k], 7) + " .. " + shortest(m.bounds_max[k], 7),
        shortest(facts.bounds_min[k], 7) + " .. " + shortest(facts.bounds_max[k], 7));
}

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

std::vector<Vec3d> check_mesh(const Manifest& m, const ManifestScale& scale,
                              const std::optional<std::vector<TextureInfo>>& textures,
                              std::span<const std::uint8_t> glb, Findings& findings) {
  const std::string& entry = scale.glb.path;
  const std::size_t before = findings.list().size();
  GlbFacts facts = check_glb(glb, entry, findings);
  findings.name_rule(before, "G01");
  if (findings.list().size() != before) return {};  // counts of a broken file say nothing
  findings.require_equal<std::uint64_t>(scale.triangles, facts.triangles, {"mesh-counts", "G02"}, entry,
                                        "triangles");
  findings.require_equal<std::uint64_t>(scale.vertices, facts.vertices, {"mesh-counts", "G02"}, entry,
                                        "vertices");
  check_bounds(m, facts, entry, "G02", findings);
  if (textures) {
    check_image_names(scale, *textures, facts, findings);
    check_previews_of(m, scale, *textures, facts, findings);
  }
  return std::move(facts.positions);
}

/// Where a mesh lists names of parts, feature ids of all its primitives count them.
bool counts_part_names(const nlohmann::ordered_json& mesh) {
  static const nlohmann::ordered_json::json_pointer kNames("/extras/partNames"),
      kCount("/extensions/EXT_mesh_features/featureIds/0/featureCount");
  if (!mesh.contains(kNames)) return true;
  const std::size_t names = mesh.at(kNames).size();
  return std::ranges::all_of(mesh.at("primitives"), [&](const auto& primitive) {
    return primitive.contains(kCount) && primitive.at(kCount) == names;
  });
}

void check_shared(const std::string& entry, std::span<const std::uint8_t> glb, MeshShare& share,
                  Findings& findings) {
  const std::size_t bytes = glb[12] | glb[13] << 8 | glb[14] << 16 | std::size_t{glb[15]} << 24;
  const auto json =
      nlohmann::ordered_json::parse(glb.begin() + 20, glb.begin() + 20 + static_cast<std::ptrdiff_t>(bytes));
  const auto array = [&](const char* key) {
    return json.contains(key) ? json[key] : nlohmann::ordered_json::array();
  };
  MeshShare here{"", "", array("materials").size(), true};
  for (const char* key : {"materials", "textures", "samplers"}) here.materials += array(key).dump() + "\n";
  for (const auto& node : array("nodes")) here.names += node.value("name", std::string()) + "\n";
  if (!share.known) share = here;
  findings.require(here.materials == share.materials, {"mesh-materials", "G07"}, entry, "/materials",
                   "materials, textures and samplers of the other files", "others");
  findings.require(here.names == share.names, {"mesh-nodes", "G09"}, entry, "/nodes",
                   "nodes with the names of the other files", "others");
  for (const auto& mesh : array("meshes"))
    findings.require(counts_part_names(mesh), {"mesh-nodes", "G10"}, entry, "/meshes",
                     "feature ids in every primitive, as many as part names", "others");
}

void check_proxy(const Manifest& m, const ManifestProxy& proxy, std::span<const std::uint8_t> glb,
                 Findings& findings) {
  const std::string& entry = proxy.glb.path;
  const std::size_t before = findings.list().size();
  const GlbFacts facts = check_glb(glb, entry, findings, GlbRules::kStandalone);
  findings.name_rule(before, "G13");
  if (findings.list().size() != before) return;  // counts of a broken file say nothing
  findings.require_equal<std::uint64_t>(proxy.triangles, facts.triangles, {"mesh-counts", "G14"}, entry,
                                        "triangles");
  findings.require_equal<std::uint64_t>(proxy.vertices, facts.vertices, {"mesh-counts", "G14"}, entry,
                                        "vertices");
  findings.require_equal<std::uint64_t>(proxy.texture_px, facts.largest_image_px, {"mesh-images", "G14"},
                                        entry, "longest side of its textures");
  findings.require(facts.codec != "draco" || &proxy != &m.proxies.front(), {"mesh-codec", "G15"}, entry, "",
                   "a mesh that needs no Draco", facts.codec);
  check_bounds(m, facts, entry, "G14", findings);
}

void check_nested(const ManifestScale& finer, const std::vector<Vec3d>& finer_positions,
                  const ManifestScale& coarser, const std::vector<Vec3d>& coarser_positions,
                  Findings& findings) {
  if (finer_positions.empty() || coarser_positions.empty()) return;
  const auto before = [](const Vec3d& p, const Vec3d& q) {
    return std::tie(p.x, p.y, p.z) < std::tie(q.x, q.y, q.z);
  };
  std::vector<Vec3d> strangers;
  std::set_difference(coarser_positions.begin(), coarser_positions.end(), finer_positions.begin(),
                      finer_positions.end(), std::back_inserter(strangers), before);
  if (strangers.empty()) return;
  const Vec3d& p = strangers.front();
  findings.add({"mesh-nested", "G03"}, coarser.glb.path, "positions",
               "positions of " + finer.glb.path + " only",
               std::to_string(strangers.size()) + " others, " + shortest(p.x, 9) + " " + shortest(p.y, 9) +
                   " " + shortest(p.z, 9) + " for one");
}

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
