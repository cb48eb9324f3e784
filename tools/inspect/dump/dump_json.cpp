#include <algorithm>

#include <nlohmann/json.hpp>

#include "format/container/layout.h"
#include "format/documents/tables.h"
#include "format/rules/allocation.h"
#include "format/rules/viewing.h"
#include "tools/inspect/atlas/atlas_report.h"
#include "tools/inspect/dump/dump.h"
#include "tools/inspect/dump/dump_perceptual.h"
#include "tools/inspect/dump/package_figures.h"
#include "tools/inspect/provenance.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

Json vector_json(const Vec3d& v) { return Json{v.x, v.y, v.z}; }

std::uint64_t package_bytes(PackageReader& p) {
  std::uint64_t bytes = 0;
  for (const KindBytes& k : bytes_by_kind(p.manifest(), p.store().read_manifest().size(), p.index()))
    bytes += k.bytes;
  return bytes;
}

/// Every step function, with the viewing distance in object heights at which a step begins (null = 0,
/// at any distance).
Json steps_json(const std::vector<ManifestStep>& steps) {
  Json list = Json::array();
  for (const ManifestStep& s : steps) {
    const bool any = s.up_to_px >= kAnyDisplayPx;
    list.push_back({{"up_to_px", s.up_to_px},
                    {"scale", s.scale},
                    {"from_distance", any ? Json() : Json(viewing_distance(1, s.up_to_px, {}))}});
  }
  return list;
}

Json stream_json(PackageReader& p) {
  Json stream = Json::array();
  if (p.manifest().stream)
    for (const StreamFigures& f : stream_figures(p.split_stream_head()))
      stream.push_back({{"scale", f.scale},
                        {"triangles", f.triangles},
                        {"points", f.points},
                        {"blocks", f.blocks},
                        {"bytes", f.bytes},
                        {"connectivity", f.connectivity},
                        {"positions", f.positions},
                        {"uv", f.uv},
                        {"others", f.others}});
  return stream;
}

Json proxies_json(const Manifest& m) {
  Json list = Json::array();
  for (const ManifestProxy& p : m.proxies) {
    Json losses = Json::array();
    for (std::size_t k = 0; k < p.flip.size(); ++k)
      losses.push_back(
          {{"display_px", m.proxy_sizes_px[k]}, {"flip", p.flip[k]}, {"flip_p95", p.flip_p95[k]}});
    list.push_back({{"path", p.glb.path},
                    {"bytes", p.glb.bytes},
                    {"triangles", p.triangles},
                    {"vertices", p.vertices},
                    {"texture_px", p.texture_px},
                    {"losses", losses}});
  }
  return list;
}

Json poster_json(const Manifest& m) {
  if (!m.poster) return nullptr;
  return {{"width_px", m.poster->width_px}, {"height_px", m.poster->height_px}, {"bytes", m.poster->bytes}};
}

Json summary_json(PackageReader& p) {
  const Manifest& m = p.manifest();
  Json kinds = Json::array(), textures = Json::array();
  for (const KindBytes& k : bytes_by_kind(m, p.store().read_manifest().size(), p.index()))
    kinds.push_back({{"kind", k.kind}, {"entries", k.entries}, {"bytes", k.bytes}});
  for (std::size_t k = 0; k < p.textures().size(); ++k) {
    const TextureInfo& t = p.textures()[k];
    textures.push_back({{"plane", k},
                        {"image", t.image},
                        {"mip", t.mip},
                        {"base", t.mip > 0 ? t.base : k},
                        {"name", t.name},
                        {"role", t.role},
                        {"width_px", t.width_px},
                        {"height_px", t.height_px},
                        {"channels", t.channels},
                        {"fragments", stored_fragments(p.tables().planes[k])},
                        {"rungs", t.rungs.size()}});
    if (t.source_rung) textures.back()["source_rung"] = true;
    if (!t.source_extension.empty()) textures.back()["source"] = t.source.path;
  }
  const Provenance provenance = read_provenance(p.entry(p.manifest().provenance));
  return {{"package",
           {{"id", to_hex(p.id())},
            {"version", {{"major", m.major}, {"minor", m.minor}}},
            {"title", m.title},
            {"tool", provenance.tool},
            {"entries", p.index().size() + 2},
            {"entry_bytes", package_bytes(p)}}},
          {"object",
           {{"origin", vector_json(m.origin)},
            {"bounds_min", vector_json(m.bounds_min)},
            {"bounds_max", vector_json(m.bounds_max)},
            {"height", m.object_height},
            {"surface_area", m.surface_area},
            {"jnd", m.jnd}}},
          {"steps", steps_json(m.steps)},
          {"step_rules",
           {{"jnd", steps_json(step_function(m.scales, StepRule::kJnd))},
            {"error", steps_json(step_function(m.scales, StepRule::kError))},
            {"edge", steps_json(step_function(m.scales, StepRule::kEdge))}}},
          {"camera", {{"fov_degrees", Camera{}.fov_degrees}, {"viewport_px", Camera{}.viewport_px}}},
          {"stream", stream_json(p)},
          {"proxies", proxies_json(m)},
          {"poster", poster_json(m)},
          {"textures", textures},
          {"bytes", kinds},
          {"start",
           {{"bytes", start_bytes(m)},
            {"shows", first_picture(m).path},
            {"in_one_request", start_bytes(m) <= kStartBytes}}}};
}

Json scales_json(PackageReader& p) {
  Json list = Json::array();
  for (const ManifestScale& s : p.manifest().scales)
    list.push_back({{"scale", s.scale},
                    {"triangles", s.triangles},
                    {"vertices", s.vertices},
                    {"bytes", s.glb.bytes},
                    {"major", s.major},
                    {"error_max", s.error_max},
                    {"error_rms", s.error_rms},
                    {"p95", s.p95},
                    {"p99", s.p99},
                    {"display_px_jnd", s.display_px_jnd},
                    {"display_px_error", s.display_px_error},
                    {"display_px_edge", s.display_px_edge},
                    {"display_px_flip", s.display_px_flip},
                    {"floor", s.floor},
                    {"path", s.glb.path}});
  return {{"scales", list}};
}

Json fragment_json(const PlaneTables& t, const PlaneThesis* thesis, std::size_t i,
                   const std::vector<float>& eta) {
  Json bytes = Json::array(), features = Json::array();
  for (std::size_t r = 0; r < t.rung_count(); ++r) bytes.push_back(t.size_bytes[r * t.fragment_count() + i]);
  for (std::size_t row = 0; row < t.scale_count(); ++row)
    features.push_back(t.features[row * t.fragment_count() + i]);
  Json j{{"fragment", i},
         {"column", i % t.columns},
         {"row", i / t.columns},
         {"covered_texels", t.covered_texels[i]},
         {"surface_fraction", t.surface_fraction[i]},
         {"eta", eta[i]},
         {"features", features},
         {"bytes", bytes}};
  if (thesis && i < thesis->vqp.size())
    j.update(Json{{"vqp", thesis->vqp[i]},
                  {"z", thesis->z[i]},
                  {"i", thesis->i[i]},
                  {"zeta", thesis->zeta[i]},
                  {"m", thesis->m[i]}});
  if (thesis && i < thesis->models.size()) {
    const SizeModel& model = thesis->models[i];
    if (model != SizeModel{})
      j["size_model"] = {{"a", model.a}, {"b", model.b}, {"correlation", model.correlation}};
  }
  return j;
}

Json fragments_json(PackageReader& p) {
  Json planes = Json::array();
  for (std::size_t k = 0; k < p.textures().size(); ++k) {
    const TextureInfo& info = p.textures()[k];
    const PlaneTables& t = p.tables().planes[k];
    const std::vector<float> eta = eta_of(t, 0);
    Json fragments = Json::array();
    for (const std::uint16_t i : t.order) fragments.push_back(fragment_json(t, p.plane_thesis(k), i, eta));
    planes.push_back({{"plane", k},
                      {"columns", info.columns},
                      {"rows", info.rows},
                      {"fragment_width_px", info.fragment_width_px},
                      {"fragment_height_px", info.fragment_height_px},
                      {"grid_reason", info.grid_reason},
                      {"rung_quality", info.rung_quality},
                      {"fragments", fragments}});
  }
  return {{"fragments", planes}};
}

Json ladder_json(PackageReader& p) {
  Json planes = Json::array();
  for (std::size_t k = 0; k < p.textures().size(); ++k) {
    const TextureInfo& info = p.textures()[k];
    const auto figures = rung_figures(p.tables().planes[k]);
    Json rungs = Json::array();
    for (std::size_t r = 0; r < figures.size(); ++r)
      rungs.push_back({{"rung", r},
                       {"quality", figures[r].quality},
                       {"bytes", figures[r].bytes},
                       {"table_bytes", figures[r].table_bytes},
                       {"mse", figures[r].mse},
                       {"ssim", figures[r].ssim},
                       {"surface_ssim", figures[r].surface_ssim},
                       {"path", info.rungs[r].path}});
    planes.push_back({{"plane", k},
                      {"codec", codec_traits(info.codec).id},
                      {"preview_width_px", info.preview_width_px},
                      {"preview_height_px", info.preview_height_px},
                      {"preview_bytes", info.preview.bytes},
                      {"rungs", rungs}});
  }
  return {{"ladder", planes}};
}

Json allocation_json(const PlaneTables& t, int scale, std::size_t row, std::optional<double> gamma) {
  const AllocationFigures f = allocation_figures(t, row, gamma);
  Json q = Json::array(), rungs = Json::array(), bytes = Json::array(), total = Json::array();
  for (std::size_t i = 0; i < t.fragment_count(); ++i) {
    const bool stored = f.fragment_rung[i] != kSkipped;
    q.push_back(stored ? Json(f.fragment_quality[i]) : Json());
    rungs.push_back(stored ? Json(f.fragment_rung[i]) : Json());
    bytes.push_back(stored ? Json(f.fragment_bytes[i]) : Json());
  }
  for (std::size_t g = 0; g < kGammaSteps; ++g)
    total.push_back(bytes_asked_for(t, row, static_cast<double>(g) / (kGammaSteps - 1)));
  return {{"scale", scale},         {"quality", t.quality[row]},
          {"gamma", f.gamma},       {"bytes_at_gamma", f.bytes},
          {"total_bytes", total},   {"fragment_quality", q},
          {"fragment_rung", rungs}, {"fragment_bytes", bytes}};
}

/// D_i(Gamma) of all scales of the chain.
Json thesis_json(const PlaneThesis& thesis) {
  Json scales = Json::array();
  for (std::size_t s = 0; s < thesis.quality.size(); ++s) {
    const auto begin = thesis.total_bytes.begin() + static_cast<std::ptrdiff_t>(s * kGammaSteps);
    scales.push_back({{"scale", s},
                      {"quality", thesis.quality[s]},
                      {"total_bytes",
                       std::vector<std::uint64_t>(begin, begin + static_cast<std::ptrdiff_t>(kGammaSteps))}});
  }
  return {{"chain", scales}};
}

Json tables_json(PackageReader& p, std::optional<double> gamma) {
  Json planes = Json::array();
  for (std::size_t k = 0; k < p.textures().size(); ++k) {
    const PlaneTables& t = p.tables().planes[k];
    Json scales = Json::array();
    for (std::size_t row = 0; row < t.scale_count(); ++row)
      scales.push_back(allocation_json(t, p.manifest().scales[row].scale, row, gamma));
    planes.push_back({{"plane", k},
                      {"allocation", allocation_name(t)},
                      {"quality_width", t.quality_width},
                      {"log_width", t.log_width},
                      {"quality_min", t.quality_min},
                      {"quality_max", t.quality_max},
                      {"scales", scales}});
    if (const PlaneThesis* thesis = p.plane_thesis(k)) planes.back()["thesis"] = thesis_json(*thesis);
  }
  return {{"tables", planes}, {"measured_quality", Json::parse(write_quality(p.quality()))}};
}

Json entry_json(const std::string& path, std::uint64_t offset, std::uint64_t bytes,
                const std::string& digest) {
  return {{"path", path}, {"offset", offset}, {"bytes", bytes}, {"sha256", digest}};
}

Json entries_json(PackageReader& p) {
  Json list = Json::array();
  for (const ContainerEntry& e : p.store().list())
    if (e.path == kManifestPath) list.push_back(entry_json(e.path, e.offset, e.bytes, to_hex(p.id())));
  std::vector<EntryRef> entries = p.index();
  const EntryRef& index = p.manifest().index;
  entries.insert(std::ranges::upper_bound(entries, index.offset, {}, &EntryRef::offset), index);
  for (const EntryRef& e : entries) list.push_back(entry_json(e.path, e.offset, e.bytes, to_hex(e.digest)));
  return {{"entries", list}};
}

Json about_json(PackageReader& p) {
  const auto bytes = p.entry(p.manifest().about);
  read_about(bytes);
  return {{"about", Json::parse(bytes.begin(), bytes.end())}};
}

Json provenance_json(PackageReader& p) {
  const auto bytes = p.entry(p.manifest().provenance);
  read_provenance(bytes);  // refuse what verify would refuse
  return {{"provenance", Json::parse(bytes.begin(), bytes.end())}};
}

Json part_json(PackageReader& p, DumpPart part, std::optional<double> gamma) {
  switch (part) {
    case DumpPart::kSummary:
      return summary_json(p);
    case DumpPart::kScales:
      return scales_json(p);
    case DumpPart::kFragments:
      return fragments_json(p);
    case DumpPart::kLadder:
      return ladder_json(p);
    case DumpPart::kTables:
      return tables_json(p, gamma);
    case DumpPart::kPerceptual:
      return perceptual_json(p);
    case DumpPart::kAtlas:
      return {{"atlas", atlas_json(diagnose_atlases(atlas_subject(p, {}), {}))}};
    case DumpPart::kEntries:
      return entries_json(p);
    case DumpPart::kAbout:
      return about_json(p);
    default:
      return provenance_json(p);
  }
}

}  // namespace

Json dump_json(PackageReader& package, DumpPart part, std::optional<double> gamma) {
  if (part != DumpPart::kAll) return part_json(package, part, gamma);
  Json all = Json::object();
  for (std::size_t k = 0; k + 1 < kDumpParts.size(); ++k)
    all.update(part_json(package, static_cast<DumpPart>(k), gamma));
  return all;
}

}  // namespace texmesh
