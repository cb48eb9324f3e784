#include <algorithm>
#include <tuple>

#include "format/container/layout.h"
#include "pipeline/inspect/verify/verify_checks.h"
#include "pipeline/io/text_table.h"
#include "stages/gltf/check_glb.h"

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
    if (!findings.require(uri == (named ? "../" + preview_path(number) : ""), "mesh-images", scale.glb.path,
                          place + "/uri", named ? "../" + preview_path(number) : "an image within the file",
                          uri.empty() ? "none" : uri))
      continue;
    if (uri.empty() && !alpha && !plane->preview.path.empty())
      findings.require_equal(to_hex(plane->preview.digest), to_hex(facts.image_digests[k]), "mesh-images",
                             scale.glb.path, place);
  }
}

/// Stored positions may lie a little outside of S_0's bounds.
void check_bounds(const Manifest& m, const GlbFacts& facts, const std::string& entry, Findings& findings) {
  const double slack = 0.01 * length(m.bounds_max - m.bounds_min) + 1e-30;
  for (int k = 0; k < 3 && facts.has_bounds; ++k)
    findings.require(
        facts.bounds_min[k] >= m.bounds_min[k] - slack && facts.bounds_max[k] <= m.bounds_max[k] + slack,
        "mesh-bounds", entry, std::string("axis ") + "xyz"[k],
        shortest(m.bounds_min[k], 7) + " .. " + shortest(m.bounds_max[k], 7),
        shortest(facts.bounds_min[k], 7) + " .. " + shortest(facts.bounds_max[k], 7));
}

}  // namespace

std::vector<Vec3d> check_mesh(const Manifest& m, const ManifestScale& scale,
                              const std::vector<TextureInfo>& textures, std::span<const std::uint8_t> glb,
                              Findings& findings) {
  const std::string& entry = scale.glb.path;
  const std::size_t before = findings.list().size();
  GlbFacts facts = check_glb(glb, entry, findings);
  if (findings.list().size() != before) return {};  // counts of a broken file say nothing
  findings.require_equal<std::uint64_t>(scale.triangles, facts.triangles, "mesh-counts", entry, "triangles");
  findings.require_equal<std::uint64_t>(scale.vertices, facts.vertices, "mesh-counts", entry, "vertices");
  check_bounds(m, facts, entry, findings);
  for (const TextureInfo& t : textures) {
    const std::string name = "texture/" + std::to_string(t.image);
    // A scale may have lost every triangle of a material; S_0 has them all.
    if (scale.scale == 0)
      findings.require(
          std::find(facts.image_names.begin(), facts.image_names.end(), name) != facts.image_names.end(),
          "mesh-images", entry, "/images", "an image named " + name, "none");
  }
  for (std::size_t k = 0; k < facts.image_names.size(); ++k)
    findings.require(std::any_of(textures.begin(), textures.end(),
                                 [&](const TextureInfo& t) {
                                   return facts.image_names[k] == "texture/" + std::to_string(t.image);
                                 }),
                     "mesh-images", entry, "/images/" + std::to_string(k) + "/name",
                     "texture/<image> of textures.json", facts.image_names[k]);
  check_previews_of(m, scale, textures, facts, findings);
  return std::move(facts.positions);
}

void check_proxy(const Manifest& m, const ManifestProxy& proxy, std::span<const std::uint8_t> glb,
                 Findings& findings) {
  const std::string& entry = proxy.glb.path;
  const std::size_t before = findings.list().size();
  const GlbFacts facts = check_glb(glb, entry, findings, GlbRules::kStandalone);
  if (findings.list().size() != before) return;  // counts of a broken file say nothing
  findings.require_equal<std::uint64_t>(proxy.triangles, facts.triangles, "mesh-counts", entry, "triangles");
  findings.require_equal<std::uint64_t>(proxy.vertices, facts.vertices, "mesh-counts", entry, "vertices");
  findings.require_equal<std::uint64_t>(proxy.texture_px, facts.largest_image_px, "mesh-images", entry,
                                        "longest side of its textures");
  findings.require(facts.codec != "draco", "mesh-codec", entry, "", "a mesh that needs no Draco",
                   facts.codec);
  check_bounds(m, facts, entry, findings);
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
  findings.add("mesh-nested", coarser.glb.path, "positions", "positions of " + finer.glb.path + " only",
               std::to_string(strangers.size()) + " others, " + shortest(p.x, 9) + " " + shortest(p.y, 9) +
                   " " + shortest(p.z, 9) + " for one");
}

}  // namespace texmesh
