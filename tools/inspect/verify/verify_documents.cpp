// The documents of a package against each other (manifest, index, about.json, quality.bin, provenance.json,
// thesis.bin), and against what the package shows of the surface: GLBs of scales and proxies, vertex splits.
#include <nlohmann/json.hpp>
#include <tuple>

#include "format/base/json_fields.h"
#include "format/rules/allocation.h"
#include "format/split/split_reader.h"
#include "pipeline/io/table.h"
#include "stages/data/ladder.h"
#include "stages/gltf/check_glb.h"
#include "stages/gltf/glb_container.h"
#include "stages/jpeg/jpeg.h"
#include "tools/inspect/provenance.h"
#include "tools/inspect/verify/verify_checks.h"

namespace texmesh {
namespace {

std::string at(const char* array, std::size_t i, const char* member = "") {
  return std::string("/") + array + "/" + std::to_string(i) + member;
}

bool near(double a, double b, double relative) {
  return std::fabs(a - b) <= relative * std::max(std::fabs(a), std::fabs(b));
}

std::string number(double v) { return shortest(v, 9); }

void require_six_digits(double value, const std::string& field, Findings& findings) {
  findings.require(six_digits(value) == value, {"manifest", "M07"}, kManifestPath, field,
                   "at most six significant digits", shortest(value, 17));
}

void check_scales(const Manifest& m, Findings& findings) {
  for (std::size_t k = 0; k < m.scales.size(); ++k) {
    // No rule about triangles: on a coarse grid a scale may show more of them than the next finer one.
    const ManifestScale& s = m.scales[k];
    findings.require(s.error_rms <= s.error_max, {"scale", "M12"}, kManifestPath, at("scales/errorRms", k),
                     "at most errorMax, " + number(s.error_max), number(s.error_rms));
    if (k == 0)
      for (const double zero : {s.error_max, s.error_rms, s.p95, s.p99})
        findings.require(zero == 0, {"scale", "M12"}, kManifestPath, at("scales", k), "0 for S_0",
                         number(zero));
    for (const double v : {s.error_max, s.error_rms, s.p95, s.p99, s.display_px_jnd, s.display_px_error,
                           s.display_px_edge, s.display_px_flip})
      require_six_digits(v, at("scales", k), findings);
  }
}

/// The default rule shows what lit pictures cannot tell from S_0.
void check_steps(const Manifest& m, Findings& findings) {
  for (std::size_t k = 0; k < m.steps.size(); ++k) {
    const ManifestStep& step = m.steps[k];
    require_six_digits(step.up_to_px, at("steps", k), findings);
    for (const ManifestScale& s : m.scales) {
      if (s.scale != step.scale) continue;
      findings.require(step.up_to_px <= s.display_px_flip * (1 + 1e-5), {"step", "M22"}, kManifestPath,
                       at("steps", k, "/0"),
                       "at most " + number(s.display_px_flip) + ", up to which S_" + std::to_string(s.scale) +
                           " is enough",
                       number(step.up_to_px));
      for (const ManifestScale& coarser : m.scales)
        findings.require(
            coarser.scale <= s.scale || coarser.display_px_flip < s.display_px_flip, {"step", "M22"},
            kManifestPath, at("steps", k, "/1"),
            "no step, as S_" + std::to_string(coarser.scale) + " is enough up to the same height",
            "S_" + std::to_string(s.scale));
    }
  }
}

/// Of a scale that is stored everything follows from tables.bin.
void check_gamma_table(const Manifest& m, const PlaneTables& t, const PlaneThesis& thesis,
                       const std::string& place, Findings& findings) {
  for (std::size_t row = 0; row < m.scales.size(); ++row) {
    const auto s = static_cast<std::size_t>(m.scales[row].scale);
    const std::string scale = std::to_string(s);
    if (!findings.require(s < thesis.quality.size(), {"thesis", "R16"}, kThesisPath, place + "scale " + scale,
                          "Q_i and D_i", "none"))
      return;
    findings.require_equal(t.quality[row], thesis.quality[s], {"thesis", "O06"}, kThesisPath,
                           place + "Q_" + scale);
    for (std::size_t g = 0; g < kGammaSteps; ++g) {
      const double gamma = static_cast<double>(g) / (kGammaSteps - 1);
      findings.require_equal(bytes_asked_for(t, row, gamma), thesis.total_bytes[s * kGammaSteps + g],
                             {"thesis", "O06"}, kThesisPath,
                             place + "D_" + scale + "(" + fixed(gamma, 2) + ")");
    }
  }
}

/// Scales that are stored stand in the table with the p95 of the manifest, whose figures have six digits.
void check_perceptual(const Manifest& m, const PerceptualTable& table, Findings& findings) {
  for (const ManifestScale& s : m.scales) {
    const auto at = std::ranges::find(table.scale, s.scale);
    const std::string scale = "scale " + std::to_string(s.scale);
    if (!findings.require(at != table.scale.end(), {"thesis", "R16"}, kThesisPath, "perceptual table", scale,
                          "none"))
      return;
    const auto row = static_cast<std::size_t>(at - table.scale.begin());
    if (row == 0) continue;
    const auto p95 = static_cast<double>(table.p95[pair_index(table.scale.size(), 0, row)]);
    findings.require(std::abs(p95 - s.p95) <= 1e-5 * s.p95, {"thesis", "O06"}, kThesisPath, scale + ", p95",
                     s.p95, p95);
  }
}

}  // namespace

void check_manifest(const Manifest& m, Findings& findings) {
  const Vec3d size = m.bounds_max - m.bounds_min;
  const double extent = std::max({size.x, size.y, size.z});
  findings.require(near(m.object_height, extent, 1e-5), {"manifest", "M04"}, kManifestPath, "/objectHeight",
                   number(extent) + ", the largest extent of the bounds", number(m.object_height));
  require_six_digits(m.surface_area, "/surfaceArea", findings);
  check_scales(m, findings);
  check_steps(m, findings);
}

void check_about(const Manifest& m, const About& about, Findings& findings) {
  findings.require_equal(about.title, m.title, {"about", "B03"}, kManifestPath, "/title");
}

/// Switch sizes are heights that were rendered.
static void check_switch_sizes(const Manifest& m, const QualityTable& q, Findings& findings) {
  constexpr double kDigits = 1e-5;  // six are written
  const double largest = q.sizes_px.back();
  for (std::size_t k = 1; k < m.scales.size(); ++k) {
    const double px = m.scales[k].display_px_flip;
    findings.require(px == 0 || (px >= kLeastSwitchPx * (1 - kDigits) && px <= largest * (1 + kDigits)),
                     {"scale", "M13"}, kManifestPath, at("scales/displayPxFlip", k),
                     "0, or " + number(kLeastSwitchPx) + " to " + number(largest), number(px));
  }
  findings.require(m.scales[0].display_px_flip == kAnyDisplayPx, {"scale", "M12"}, kManifestPath,
                   "/scales/displayPxFlip/0", number(kAnyDisplayPx), number(m.scales[0].display_px_flip));
}

static void check_geometry(const QualityTable& q, Findings& findings) {
  for (std::size_t i = 0; i < q.geometry.size(); ++i)
    for (const auto* list : {&q.geometry[i].flip, &q.geometry[i].flip_p95, &q.geometry[i].dssim})
      findings.require((*list)[0] == 0, {"quality", "Q02"}, kQualityPath, at("geometry", i),
                       "no loss of S_0, which is what is compared with",
                       number(static_cast<double>((*list)[0])));
}

void check_quality(const Manifest& m, const std::vector<TextureInfo>& textures, const QualityTable& q,
                   Findings& findings) {
  check_scales_and_groups(m, textures, q, findings);
  check_geometry(q, findings);
  check_switch_sizes(m, q, findings);
}

/// Which option has the rungs of a plane.
static std::string rungs_option(const TextureInfo& texture) {
  if (texture.colour_space == "srgb") return "rungs";
  if (texture.role == "normal") return "normal_rungs";
  return texture.role == "alpha" ? "alpha_rungs" : "data_rungs";
}

void check_provenance(const Manifest& m, const std::vector<TextureInfo>& textures, const Provenance& p,
                      Findings& findings) {
  findings.require(p.format.major == m.major && p.format.minor == m.minor, {"provenance", "O03"},
                   kProvenancePath, "/format",
                   std::to_string(m.major) + "." + std::to_string(m.minor) + ", as the manifest",
                   p.format.text());
  const auto option = [&](const char* stage, const char* name) {
    const auto section = p.options->find(stage);
    if (section == p.options->end() || !section->contains(name)) return nlohmann::ordered_json();
    return (*section)[name];
  };
  const auto title = option("package", "title");
  if (title.is_string() && title != "" && title != m.title)
    findings.add({"provenance", "O03"}, kProvenancePath, "/options/package/title",
                 m.title + ", as the manifest", title.get<std::string>());
  const auto jnd = option("perceptual_values", "jnd");
  if (jnd.is_number() && jnd.get<double>() != m.jnd)
    findings.add({"provenance", "O03"}, kProvenancePath, "/options/perceptual_values/jnd",
                 number(m.jnd) + ", as the manifest", jnd.dump());
  for (std::size_t k = 0; k < textures.size(); ++k) {
    const std::string name = rungs_option(textures[k]);
    const auto rungs = option("ladder", name.c_str());
    if (!rungs.is_array() || codec_traits(textures[k].codec).incremental) continue;
    if (textures[k].source_rung) continue;  // its qualities follow from the source
    for (const int q : textures[k].rung_quality) {
      if (q == 100 && textures[k].mip == 0) continue;  // stands for a source without loss
      findings.require(std::find(rungs.begin(), rungs.end(), q) != rungs.end(), {"provenance", "O03"},
                       kProvenancePath, "/options/ladder/" + name,
                       "rung " + std::to_string(q) + " of plane " + std::to_string(k), rungs.dump());
    }
  }
}

void check_thesis(const Manifest& m, const PackageTables& tables, const ThesisTables& thesis,
                  Findings& findings) {
  if (!thesis.perceptual.empty()) check_perceptual(m, thesis.perceptual, findings);
  for (std::size_t p = 0; p < thesis.planes.size(); ++p) {
    const PlaneThesis& plane = thesis.planes[p];
    const std::string place = "plane " + std::to_string(p) + ", ";
    if (!findings.require(p < tables.planes.size(), {"thesis", "R16"}, kThesisPath, place,
                          "a plane of the package", "none"))
      return;
    const PlaneTables& t = tables.planes[p];
    if (!plane.z.empty())
      findings.require_equal(t.fragment_count(), plane.z.size(), {"thesis", "R16"}, kThesisPath,
                             place + "fragments");
    if (!plane.models.empty())
      findings.require_equal(t.fragment_count(), plane.models.size(), {"thesis", "R16"}, kThesisPath,
                             place + "size models");
    if (!plane.quality.empty() && t.scale_count() == m.scales.size())
      check_gamma_table(m, t, plane, place, findings);
  }
}

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
  findings.require_equal(last.offset + last.bytes(), bytes.size(), {"split-stream", "S08"}, kSplitStreamPath,
                         "end of the last block");
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
  findings.require_equal(scale.triangles, facts.triangles, {"mesh-counts", "G02"}, entry, "triangles");
  findings.require_equal(scale.vertices, facts.vertices, {"mesh-counts", "G02"}, entry, "vertices");
  check_bounds(m, facts, entry, "G02", findings);
  if (textures) {
    check_image_names(scale, *textures, facts, findings);
    check_previews_of(m, scale, *textures, facts, findings);
  }
  return std::move(facts.positions);
}

bool check_gltf_scale(const Manifest& m, const std::vector<EntryRef>& index,
                      const std::vector<TextureInfo>& textures, const EntryRef& entry,
                      std::span<const std::uint8_t> glb, Findings& findings) {
  const auto number = static_cast<int>(parse_entry_path(entry.path).number);
  const auto scale = std::ranges::find(m.scales, number, &ManifestScale::scale);
  if (!findings.require(scale != m.scales.end() && !scale->has_glb(), {"gltf", "H03"}, entry.path, "",
                        "a scale that the stream alone has", "another"))
    return false;
  const std::size_t before = findings.list().size();
  const GlbFacts facts = check_glb(glb, entry.path, findings);
  findings.name_rule(before, "G01");
  if (findings.list().size() != before) return false;
  findings.require(facts.triangles <= scale->triangles, {"gltf", "H03"}, entry.path, "triangles",
                   "at most " + std::to_string(scale->triangles), facts.triangles);
  check_bounds(m, facts, entry.path, "G02", findings);
  ManifestScale named = *scale;
  named.glb = entry;
  check_image_names(named, textures, facts, findings);
  for (std::size_t k = 0; k < facts.image_uris.size(); ++k) {
    const std::string& uri = facts.image_uris[k];
    if (uri.empty()) continue;
    const std::string path = uri.starts_with("../") ? uri.substr(3) : "gltf/" + uri;
    const std::uint32_t plane = parse_entry_path(path).number;
    findings.require(std::ranges::find(index, path, &EntryRef::path) != index.end() &&
                         plane < textures.size() &&
                         facts.image_names[k] == "texture/" + std::to_string(textures[plane].image),
                     {"gltf", "H04"}, entry.path, "/images/" + std::to_string(k) + "/uri",
                     "a picture of " + facts.image_names[k] + " in the package", uri);
  }
  return true;
}

void check_gltf_image(const std::vector<TextureInfo>& textures, const std::string& entry,
                      std::span<const std::uint8_t> jpeg, Findings& findings) {
  const EntryName name = parse_entry_path(entry);
  if (!findings.require(
          name.number < textures.size() && name.rung < textures[name.number].rung_quality.size(),
          {"gltf", "H04"}, entry, "", "a plane and a rung of textures.json", "none"))
    return;
  const TextureInfo& t = textures[name.number];
  const Pixels p = decode_jpeg(jpeg, std::uint64_t{t.width_px} * t.height_px);
  const auto shape = [](std::uint32_t width, std::uint32_t height, std::uint32_t channels) {
    return std::to_string(width) + " x " + std::to_string(height) + " x " + std::to_string(channels);
  };
  findings.require_equal(shape(t.width_px, t.height_px, t.channels),
                         shape(p.width_px, p.height_px, p.channels), {"gltf", "H04"}, entry, "shape");
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
  const nlohmann::ordered_json json = read_glb(glb, entry).root;
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
  findings.require_equal(proxy.triangles, facts.triangles, {"mesh-counts", "G14"}, entry, "triangles");
  findings.require_equal(proxy.vertices, facts.vertices, {"mesh-counts", "G14"}, entry, "vertices");
  findings.require_equal(proxy.texture_px, facts.largest_image_px, {"mesh-images", "G14"}, entry,
                         "longest side of its textures");
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
                     "a material of the GLBs, of " + std::to_string(share.material_count), g.material);
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
