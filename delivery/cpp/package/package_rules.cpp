#include "delivery/cpp/package/package_rules.h"

#include <numeric>
#include <set>

namespace texmesh {
namespace {

std::string words_of(const EntryRef& e) {
  return std::to_string(e.bytes) + " bytes at " + std::to_string(e.offset) + ", " +
         to_hex(e.digest).substr(0, 16) + "...";
}

}  // namespace

std::string plane_field(std::size_t plane, const std::string& member) {
  return "plane " + std::to_string(plane) + ", " + member;
}

void check_references(const Manifest& m, const std::vector<EntryRef>& index, Findings& findings) {
  const auto check_at = [&](const std::string& path, const std::string& field, const std::string& words,
                            auto&& is_that) {
    const auto it = std::ranges::find(index, path, &EntryRef::path);
    if (it == index.end())
      findings.add({"reference", "R03"}, kManifestPath, field, "an entry " + path, "none in the index");
    else
      findings.require(is_that(*it), {"reference", "R03"}, kManifestPath, field,
                       words_of(*it) + " as in the index", words);
  };
  const auto check = [&](const EntryRef& ref, const std::string& field) {
    check_at(ref.path, field, words_of(ref), [&](const EntryRef& e) { return e == ref; });
  };
  check(m.tables, "/tables");
  check(m.textures, "/textures");
  check(m.quality, "/quality");
  check(m.provenance, "/provenance");
  check(m.about, "/about");
  if (const auto& stream = m.stream)
    check_at(kSplitStreamPath, "/stream",
             std::to_string(stream->bytes) + " bytes at " + std::to_string(stream->offset),
             [&](const EntryRef& e) { return e.offset == stream->offset && e.bytes == stream->bytes; });
  if (m.thesis) check(*m.thesis, "/thesis");
  if (m.poster) check(*m.poster, "/poster");
  if (m.annotations) check(*m.annotations, "/annotations");
  for (std::size_t k = 0; k < m.proxies.size(); ++k)
    check(m.proxies[k].glb, "/proxies/offset/" + std::to_string(k));
  for (std::size_t k = 0; k < m.scales.size(); ++k)
    if (m.scales[k].has_glb()) check(m.scales[k].glb, "/scales/offset/" + std::to_string(k));
}

void check_textures(const Manifest& m, const std::vector<TextureInfo>& textures, Findings& findings) {
  findings.require_equal(m.plane_count, textures.size(), {"textures", "R04"}, kTexturesPath, "");
  for (const TextureInfo& info : textures) {
    const CodecTraits& codec = codec_traits(info.codec);
    findings.require(
        codec.required_feature.empty() || std::ranges::count(m.required_features, codec.required_feature) > 0,
        {"textures", "R05"}, kManifestPath, "/requiredFeatures", std::string(codec.required_feature),
        "codec " + std::string(codec.id) + " without it");
  }
}

void check_tables(const Manifest& m, const std::vector<TextureInfo>& textures, const PackageTables& tables,
                  Findings& findings) {
  findings.require_equal(m.plane_count, tables.planes.size(), {"tables", "R04"}, kTablesPath, "planes");
  for (std::size_t k = 0; k < std::min(textures.size(), tables.planes.size()); ++k) {
    const TextureInfo& info = textures[k];
    const PlaneTables& t = tables.planes[k];
    findings.require(info.columns == t.columns && info.rows == t.rows, {"tables-grid", "R08"}, kTablesPath,
                     plane_field(k, "grid"), std::to_string(info.columns) + " x " + std::to_string(info.rows),
                     std::to_string(t.columns) + " x " + std::to_string(t.rows));
    findings.require_equal(m.scales.size(), t.scale_count(), {"tables-scales", "R11"}, kTablesPath,
                           plane_field(k, "scales"));
    findings.require(std::ranges::equal(info.rung_quality, t.rung_quality) &&
                         info.rungs.size() == info.rung_quality.size(),
                     {"tables-rungs", "R09"}, kTablesPath, plane_field(k, "rungs"),
                     std::to_string(info.rung_quality.size()) + " rungs of the qualities in textures.json",
                     std::to_string(t.rung_quality.size()) + " rungs");
    const CodecTraits& codec = codec_traits(info.codec);
    findings.require(codec.incremental == t.incremental, {"tables-codec", "R10"}, kTablesPath,
                     plane_field(k, "incremental"),
                     codec.incremental ? "set, for codec " + std::string(codec.id) : "not set",
                     "the opposite");
    const auto sum = [](auto begin, auto end) { return std::accumulate(begin, end, std::uint64_t{0}); };
    findings.require_equal(sum(t.table_bytes.begin(), t.table_bytes.end()), info.tables.bytes,
                           {"tables-size", "R12"}, info.tables.path, "bytes");
    auto sizes = t.size_bytes.begin();
    for (std::size_t r = 0; r < std::min(info.rungs.size(), t.rung_count()); ++r) {
      const auto begin = std::exchange(sizes, sizes + static_cast<std::ptrdiff_t>(t.fragment_count()));
      findings.require_equal(sum(begin, sizes), info.rungs[r].bytes, {"tables-size", "R13"},
                             info.rungs[r].path, "bytes");
    }
  }
}

void check_scales_and_groups(const Manifest& m, const std::vector<TextureInfo>& textures,
                             const QualityTable& q, Findings& findings) {
  std::vector<int> kept;
  for (const ManifestScale& s : m.scales) kept.push_back(s.scale);
  findings.require(q.scales == kept, {"quality", "R14"}, kQualityPath, "/scales", "the scales of the package",
                   std::to_string(q.scales.size()) + " others or in another order");
  std::set<PlaneGroup> groups;
  for (const TextureInfo& t : textures) groups.insert(group_of(t.role));
  std::set<PlaneGroup> found;
  for (const GroupLosses& group : q.groups) found.insert(group.group);
  findings.require(groups == found, {"quality", "R15"}, kQualityPath, "/groups",
                   "the groups that the planes have",
                   std::to_string(found.size()) + " of " + std::to_string(groups.size()) + ", or others");
}

}  // namespace texmesh
