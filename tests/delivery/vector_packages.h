#pragma once
// What packages.json holds, for the policies that are known.
#include <cmath>

#include "delivery/cpp/client/delivery_plan.h"
#include "format/container/layout.h"
#include "format/rules/allocation.h"
#include "format/rules/size_curve.h"
#include "format/split/split_reader.h"
#include "format/split/split_stream.h"
#include "tests/delivery/vectors.h"
#include "tests/support/face_wedges.h"

namespace texmesh {

// ---- packages: what a client reads in those beside the vectors

inline std::string hex(const Sha256& digest) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string out;
  for (const std::uint8_t b : digest) out += {kDigits[b >> 4], kDigits[b & 15]};
  return out;
}
template <class T>
inline std::string digest_of(const std::vector<T>& values) {
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(values.data());
  return hex(sha256({bytes, values.size() * sizeof(T)}));
}

inline Json viewing(PackageReader& package) {
  const Manifest& m = package.manifest();
  Json rules = Json::object();
  const std::vector<double> sizes{1, 20, 64, 100, 150, 300, 500, 800, 1200, 2000, 4000, 1e5};
  for (const auto& [rule, name] : kRules) {
    const auto steps = step_function(m.scales, rule);
    Json shown = Json::array(), at = Json::array();
    for (const ManifestStep& s : steps) shown.push_back({s.up_to_px, s.scale});
    for (const double px : sizes) at.push_back({px, scale_at(steps, px)});
    rules[name] = {{"steps", shown}, {"displayed_px_scale", at}};
  }
  Json parts = Json::array();
  for (const VisiblePart& part : {VisiblePart{800, 1200, false}, VisiblePart{200, 700, true},
                                  VisiblePart{50, 250, true}, VisiblePart{0, 0, true}}) {
    Json scales = Json::object();
    for (const auto& [rule, name] : kRules) scales[name] = select_scale(m, 1200, part, rule);
    parts.push_back({{"part", {part.width_px, part.height_px, part.clipped}}, {"scale_of_1200_px", scales}});
  }
  const Camera camera;
  return {{"rules", rules},
          {"clips", parts},
          {"displayed_px_at_distance_3_heights",
           displayed_height_px(m.object_height, 3 * m.object_height, camera)}};
}

/// Sizes along knots between every two rungs, instead of the plane's own.
inline Json sizes_along_knots(PlaneTables t) {
  t.knot_quality.clear(), t.knot_position.clear();
  for (std::size_t r = 0; r + 1 < t.rung_count(); ++r)
    for (const int k : {1, 2})
      if (t.rung_quality[r] + k < t.rung_quality[r + 1]) {
        t.knot_quality.push_back(static_cast<std::uint8_t>(t.rung_quality[r] + k));
        t.knot_position.push_back(0.375f * static_cast<float>(k));
      }
  Json sizes = Json::array();
  for (const std::uint16_t f : t.order)
    for (const double quality : {3.0, 12.0, 33.0, 54.0, 77.5, 99.0})
      sizes.push_back({f, quality, interpolated_bytes(t, f, quality)});
  return {{"quality", t.knot_quality}, {"position", t.knot_position}, {"fragment_quality_bytes", sizes}};
}

/// Qualities where the tables go by VQP.
inline Json by_predictors(PlaneTables t) {
  t.allocation = kByVqp;
  for (std::size_t f = 0; f < t.fragment_count(); ++f)
    t.vqp.push_back(t.covered_texels[f] > 0 ? static_cast<float>(f * 7 % 11) / 16 : 0);
  t.density_weight = 0.25f;
  return {{"vqp", t.vqp},
          {"density_weight", t.density_weight},
          {"eta", eta_of(t, t.scale_count() - 1)},
          {"gamma", mean_eta(t, 0)},
          {"quality", quality_of(t, 0, mean_eta(t, 0))},
          {"rungs", rungs_of(t, 0, mean_eta(t, 0))}};
}

inline Json plane_tables(const PlaneTables& t, std::uint32_t plane) {
  Json scales = Json::array();
  for (const std::size_t row : {std::size_t{0}, t.scale_count() / 2, t.scale_count() - 1}) {
    Json gammas = Json::array();
    for (const double gamma : {0.0, mean_eta(t, row), 0.8}) {
      const auto rungs = rungs_of(t, row, gamma);
      gammas.push_back({{"gamma", gamma},
                        {"quality", quality_of(t, row, gamma)},
                        {"rungs", rungs},
                        {"bytes", sum_of(bytes_of(t, rungs))},
                        {"surface_dssim", surface_dssim(t, rungs)}});
    }
    scales.push_back({{"row", row}, {"eta", eta_of(t, row)}, {"gammas", gammas}});
  }
  Json sizes = Json::array();
  for (const std::uint16_t f : t.order)
    for (const double quality : {3.0, 33.0, 77.5, 99.0})
      sizes.push_back({f, quality, interpolated_bytes(t, f, quality)});
  Json rd = Json::array();
  for (const std::uint64_t budget : {500ull, 3000ull, 12000ull})
    rd.push_back({budget, allocate_rd(t, budget)});
  return {{"plane", plane},
          {"surface_weights", surface_weights(t)},
          {"scales", scales},
          {"fragment_quality_bytes", sizes},
          {"knots", sizes_along_knots(t)},
          {"by_predictors", by_predictors(t)},
          {"budget_rungs", rd}};
}

inline Json planes_json(const std::vector<PlaneChoice>& planes) {
  Json shown = Json::array();
  for (const PlaneChoice& p : planes) shown.push_back({p.base, p.plane});
  return shown;
}

inline Json budgets(PackageReader& package, const ListOptions& options) {
  TextureLoss loss(package, options.displayed_px);
  Json out = Json::array();
  for (const std::uint64_t bytes : {0ull, 1500ull, 6000ull, 20000ull, 1000000ull}) {
    const TextureBudget b = texture_for_budget(loss, options, bytes);
    out.push_back({{"budget_bytes", bytes},
                   {"planes", planes_json(b.planes)},
                   {"group_weights", b.list.group_weights},
                   {"rungs", b.rungs},
                   {"bytes", b.bytes},
                   {"losses", b.losses},
                   {"texture_flip", texture_flip(package.quality(), b.losses)},
                   {"flip", b.flip}});
  }
  return out;
}

/// What single losses look like at a displayed height.
inline Json curves(const QualityTable& table, double displayed_px) {
  Json groups = Json::array(), scales = Json::array();
  for (const PlaneGroup group : {PlaneGroup::kColour, PlaneGroup::kNormal, PlaneGroup::kData}) {
    const GroupCurve curve(table, group, displayed_px);
    Json coded = Json::array(), mips = Json::array();
    for (const double dssim : {0.0, 1e-5, 0.001, 0.01, 0.07, 0.4, 1.9})
      for (const double growth : {0.0, -0.5, 1.25})
        coded.push_back({dssim, growth, curve.coded(dssim, {growth, growth / 2})});
    for (const double growth : {-2.5, -0.5, 0.0, 0.25, 1.0, 2.5, 7.0})
      for (const std::uint32_t mip : {0u, 1u, 3u})
        mips.push_back({growth, mip, curve.halved({growth, growth / 2}, mip)});
    groups.push_back({{"group", enum_name(group)}, {"dssim_growth_flip", coded}, {"growth_mip_flip", mips}});
  }
  for (const double scale : {0.0, 1.5, 4.0, 30.0})
    scales.push_back({scale, geometry_flip(table, displayed_px, scale)});
  return {{"groups", groups}, {"scale_flip", scales}};
}

inline Json lists(PackageReader& package) {
  Json out = Json::array();
  for (const double px : {40.0, 200.0, 1000.0, 3000.0}) {
    const auto planes = planes_for_display(package, px);
    ListOptions o;
    o.scale = select_scale(package.manifest(), px);
    o.displayed_px = px;
    o.group_weights = {1, 0.5, 0.75};
    const FragmentList list = fragment_list(package, planes, o);
    Json fragments = Json::array();
    for (const ListedFragment& f : list.fragments) fragments.push_back({f.plane, f.fragment});
    const Json weights = o.group_weights;
    o.group_weights = {1, 1, 1};
    out.push_back({{"displayed_px", px},
                   {"scale", o.scale},
                   {"curves", curves(package.quality(), px)},
                   {"planes", planes_json(planes)},
                   {"group_weights", weights},
                   {"fragments", fragments},
                   {"offers", offers_json(list.offers)},
                   {"preview_loss", list.preview_loss},
                   {"budgets", budgets(package, o)}});
  }
  return out;
}

inline Json plan_json(PackageReader& package, const char* policy, const DeliveryRequest& r) {
  const DeliveryPlan p = plan_delivery(package, r);
  return {{"policy", policy},
          {"proxy", p.proxy ? Json(*p.proxy) : Json(nullptr)},
          {"step", p.step ? Json{*p.step, p.step_s} : Json(nullptr)},
          {"displayed_px", r.displayed_px},
          {"bytes_s", r.network.link.bytes_s.front()},
          {"rtt_s", r.network.rtt_s},
          {"time_limit_s", r.time_limit_s},
          {"memory_bytes", std::isfinite(r.memory_bytes) ? Json(r.memory_bytes) : Json(nullptr)},
          {"wanted_scale", wanted_scale(package, r)},
          {"scale", p.scale},
          {"planes", planes_json(p.planes)},
          {"rungs", p.textures.rungs},
          {"times_s", {p.first_picture_s, p.mesh_s, p.complete_s}},
          {"bytes", p.bytes()},
          {"gpu_bytes", {p.gpu.mesh, p.gpu.textures}},
          {"texture_flip", p.texture_flip},
          {"flip", p.flip}};
}

/// What is chosen over links that are fast, slow and too slow, and within little memory, by policies that are
/// known.
inline Json plans(PackageReader& package, const KnowsPolicy& knows) {
  Json out = Json::array();
  const auto add = [&](const std::string& policy, DeliveryRequest r) {
    VectorOptions o{policy, policy == "thesis" ? "beta0" : "credit"};
    o.htc = r.htc;
    if (!knows(o)) return;
    r.htc = o.htc;
    out.push_back(plan_json(package, policy.c_str(), r));
  };
  for (const auto& [memory_bytes, px] :
       {std::pair{5e4, 1000.0}, {3e5, 1000.0}, {2e6, 1000.0}, {3e5, 60.0}, {3e5, 400.0}}) {
    DeliveryRequest r;
    r.displayed_px = px;
    r.time_limit_s = 4;
    r.network.link = BandwidthTrace::constant(3e5);
    r.network.rtt_s = 0.01;
    r.memory_bytes = memory_bytes;
    add("guard", r);
  }
  for (const std::string& policy : kPolicies)
    for (const double px : {60.0, 400.0, 1500.0})
      for (const double bytes_s : {4e3, 2e4, 3e5})
        for (const double limit_s : {1.0, 4.0}) {
          DeliveryRequest r;
          r.displayed_px = px;
          r.time_limit_s = limit_s;
          if (policy == "thesis") r = as_printed(r);
          r.network.link = BandwidthTrace::constant(bytes_s);
          r.network.rtt_s = bytes_s > 1e5 ? 0.01 : 0.05;
          add(policy, r);
        }
  return out;
}

inline Json fragments(PackageReader& package) {
  Json out = Json::array();
  for (std::uint32_t plane = 0; plane < package.textures().size(); ++plane) {
    const TextureInfo& texture = package.textures()[plane];
    for (std::uint32_t rung = 0; rung < texture.rungs.size(); rung += 3)
      for (const std::uint16_t f : package.tables().planes[plane].order) {
        const ByteRange r = package.fragment_range(plane, rung, f);
        out.push_back({plane, rung, f, texture.rungs[rung].path, texture.rungs[rung].offset + r.offset,
                       r.bytes, hex(sha256(package.complete_fragment(plane, rung, f)))});
      }
  }
  return out;
}

inline Json split_stream(PackageReader& package) {
  SplitStreamReader reader(package.split_stream_head());
  const auto stream = package.entry(kSplitStreamPath);
  Json out = Json::array();
  for (std::size_t i = 0; i < reader.head().scales.size(); ++i) {
    reader.read_to_scale(i, stream);
    const SplitMesh& mesh = reader.mesh();
    Json attributes = Json::array();
    for (std::size_t k = 0; k < mesh.attributes(); ++k) attributes.push_back(digest_of(mesh.values(k)));
    out.push_back({{"scale", reader.head().scales[i].scale},
                   {"points", mesh.points().size()},
                   {"wedges", mesh.wedge_point().size()},
                   {"faces", mesh.face_count()},
                   {"visible_faces", mesh.visible_faces().size()},
                   {"points_sha256", digest_of(mesh.points())},
                   {"wedge_points_sha256", digest_of(mesh.wedge_point())},
                   {"faces_sha256", digest_of(testing::face_wedges(mesh))},
                   {"groups_sha256", digest_of(mesh.face_group())},
                   {"values_sha256", attributes}});
  }
  return out;
}

inline Json packages(const KnowsPolicy& knows) {
  Json cases = Json::array();
  const char* name = "v2.0-scan";
  const std::string path = std::string("tests/golden/") + name + ".texmesh";
  PackageReader package(open_store(kRoot + "/" + path));
  Json planes = Json::array();
  for (std::uint32_t p = 0; p < package.tables().planes.size(); ++p)
    planes.push_back(plane_tables(package.tables().planes[p], p));
  Json entries = Json::array();
  for (const EntryRef& e : package.index()) entries.push_back({e.path, e.offset, e.bytes, hex(e.digest)});
  cases.push_back({{"name", name},
                   {"file", path},
                   {"id", hex(package.id())},
                   {"entry_path_offset_bytes_sha256", entries},
                   {"viewing", viewing(package)},
                   {"tables", planes},
                   {"lists", lists(package)},
                   {"plans", plans(package, knows)},
                   {"fragment_plane_rung_index_path_offset_bytes_sha256", fragments(package)}});
  cases.back()["split_stream"] = split_stream(package);
  return cases;
}

}  // namespace texmesh
