#include "tools/inspect/dump/package_figures.h"

#include <algorithm>

#include "format/rules/allocation.h"

namespace texmesh {
namespace {

struct Kind {
  const char* name;
  std::vector<EntryKind> kinds;
};

const std::array<Kind, 11>& kinds() {
  static const std::array<Kind, 11> list{
      {{"manifest and index", {EntryKind::kManifest, EntryKind::kIndex}},
       {"tables", {EntryKind::kTables, EntryKind::kTextures, EntryKind::kQuality}},
       {"meshes", {EntryKind::kMesh}},
       {"proxies", {EntryKind::kProxy}},
       {"vertex-split stream", {EntryKind::kSplitStream}},
       {"previews", {EntryKind::kPreview}},
       {"poster", {EntryKind::kPoster}},
       {"textures", {EntryKind::kTableStreams, EntryKind::kRung}},
       {"source images", {EntryKind::kSource}},
       {"the thesis's tables", {EntryKind::kThesis}},
       {"about, provenance and others",
        {EntryKind::kAbout, EntryKind::kProvenance, EntryKind::kOther, EntryKind::kContentCredential}}}};
  return list;
}

}  // namespace

std::vector<KindBytes> bytes_by_kind(const Manifest& manifest, std::uint64_t manifest_bytes,
                                     const std::vector<EntryRef>& index) {
  std::vector<KindBytes> sums;
  for (const Kind& kind : kinds()) sums.push_back({kind.name, 0, 0});
  const auto add = [&](const std::string& path, std::uint64_t bytes) {
    const EntryKind found = parse_entry_path(path).kind;
    for (std::size_t k = 0; k < sums.size(); ++k) {
      const auto& members = kinds()[k].kinds;
      if (std::find(members.begin(), members.end(), found) == members.end()) continue;
      ++sums[k].entries;
      sums[k].bytes += bytes;
    }
  };
  add(kManifestPath, manifest_bytes);
  add(kIndexPath, manifest.index.bytes);
  for (const EntryRef& e : index) add(e.path, e.bytes);
  std::erase_if(sums, [](const KindBytes& k) { return k.entries == 0; });
  return sums;
}

std::vector<StreamFigures> stream_figures(const SplitStreamHead& head) {
  std::vector<StreamFigures> scales;
  StreamFigures sum;
  sum.bytes = head.bytes;
  for (const SplitScale& s : head.scales) {
    for (; sum.blocks < s.blocks; ++sum.blocks) {
      const SplitBlock& b = head.blocks[sum.blocks];
      sum.bytes += b.bytes();
      sum.connectivity += b.parts[0];
      sum.positions += b.parts[1];
      for (std::size_t k = 0; k < head.attributes.size(); ++k)
        (head.attributes[k].kind <= SplitKind::kUv1 ? sum.uv : sum.others) += b.parts[k + 2];
    }
    sum.scale = s.scale, sum.points = s.points, sum.triangles = s.triangles;
    scales.push_back(sum);
  }
  return scales;
}

std::vector<RungFigures> rung_figures(const PlaneTables& t) {
  std::vector<RungFigures> rungs;
  const std::size_t fragments = t.fragment_count();
  for (std::size_t r = 0; r < t.rung_count(); ++r) {
    RungFigures f{t.rung_quality[r], 0, t.table_bytes[r], 0, 0};
    double texels = 0, dssim = 0;
    for (const std::uint16_t i : t.order) {
      const double weight = t.covered_texels[i];
      f.bytes += t.size_bytes[r * fragments + i];
      f.mse += weight * static_cast<double>(t.mse[r * fragments + i]);
      dssim += weight * static_cast<double>(t.dssim[r * fragments + i]);
      texels += weight;
    }
    if (texels > 0) f.mse /= texels, dssim /= texels;
    f.ssim = 1 - dssim;
    std::vector<std::int16_t> all(fragments, kSkipped);
    for (const std::uint16_t i : t.order) all[i] = static_cast<std::int16_t>(r);
    f.surface_ssim = 1 - surface_dssim(t, all);
    rungs.push_back(f);
  }
  return rungs;
}

std::uint64_t stored_fragments(const PlaneTables& tables) { return tables.order.size(); }

AllocationFigures allocation_figures(const PlaneTables& t, std::size_t row, std::optional<double> gamma) {
  AllocationFigures f;
  f.gamma = gamma ? *gamma : mean_eta(t, row);
  f.fragment_quality = quality_of(t, row, f.gamma);
  f.fragment_rung = rungs_of(t, row, f.gamma);
  f.fragment_bytes = bytes_of(t, f.fragment_rung);
  f.bytes = sum_of(f.fragment_bytes);
  if (t.order.empty()) return f;
  f.quality_min = 1e9;
  for (const std::uint16_t i : t.order) {
    if (t.allocation == 2)  // what was bought, not what was asked for
      f.fragment_quality[i] =
          f.fragment_rung[i] == kSkipped ? 0 : t.rung_quality[static_cast<std::size_t>(f.fragment_rung[i])];
    const double q = static_cast<double>(f.fragment_quality[i]);
    f.quality_min = std::min(f.quality_min, q);
    f.quality_max = std::max(f.quality_max, q);
    f.quality_mean += q;
  }
  f.quality_mean /= static_cast<double>(t.order.size());
  return f;
}

std::string allocation_name(const PlaneTables& t) {
  return t.allocation == 0 ? "thesis" : t.allocation == 1 ? "log" : t.allocation == 2 ? "rd" : "vqp";
}

}  // namespace texmesh
