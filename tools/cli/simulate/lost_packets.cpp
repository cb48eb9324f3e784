#include "tools/cli/simulate/lost_packets.h"

#include <fmt/format.h>
#include <algorithm>
#include <nlohmann/json.hpp>

#include "delivery/cpp/simulate/packet_loss.h"
#include "format/container/layout.h"
#include "pipeline/io/table.h"
#include "stages/condition/condition.h"
#include "stages/image/png_writer.h"
#include "tools/render/picture_sheet.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

/// The stream of a package up to a scale.
struct ScaleStream {
  SplitStreamHead head;
  Bytes bytes;
  std::size_t index = 0;
  LossyMesh decode(const PacketLoss& loss, SplitFill fill) const {
    return mesh_with_losses(head, bytes, index,
                            loss.loss > 0 ? lost_position_parts(head, loss) : std::vector<bool>{}, fill);
  }
};

ScaleStream stream_to(PackageReader& package, int scale) {
  ScaleStream s{package.split_stream_head(), package.entry(kSplitStreamPath), 0};
  const auto it = std::ranges::find(s.head.scales, scale, &SplitScale::scale);
  if (it == s.head.scales.end())
    throw InputError("--scale", "", "a scale that the vertex splits pass", std::to_string(scale));
  s.index = static_cast<std::size_t>(it - s.head.scales.begin());
  return s;
}

Mesh clay(const SplitStreamHead& head, const SplitMesh& from) {
  Mesh mesh;
  for (const SplitMesh::Point& p : from.points())
    mesh.positions.push_back(
        {head.position.value(p[0], 0), head.position.value(p[1], 1), head.position.value(p[2], 2)});
  for (std::uint32_t p = 0; p < mesh.positions.size(); ++p) mesh.wedge_position.push_back(p);
  for (const std::uint32_t f : from.visible_faces())
    mesh.triangles.push_back({from.point_at(f, 0), from.point_at(f, 1), from.point_at(f, 2)});
  mesh.triangle_material.assign(mesh.triangles.size(), 0);
  mesh.triangle_part.assign(mesh.triangles.size(), 0);
  mesh.part_names = {"object"};
  return mesh;
}

}  // namespace

LostPacketsTable lost_packets(PackageReader& package, const DeliveryPlan& plan, const FragmentList& list,
                              const DeliveryRequest& request, double loss, std::uint64_t seed) {
  if (plan.proxy)
    throw InputError("--no-repeat", "", "a scale (--scale), whose mesh is a stream of vertex splits",
                     "a proxy");
  const ScaleStream stream = stream_to(package, plan.scale);
  const SplitMesh whole = stream.decode({}, SplitFill::kNeighbours).mesh;
  LostPacketsTable table;
  table.points = whole.points().size();
  table.fragments = static_cast<std::size_t>(
      std::ranges::count_if(plan.textures.rungs, [](std::int32_t rung) { return rung >= 0; }));
  for (const double factor : {0.0, 0.5, 1.0, 2.0}) {
    LostPacketsRow row;
    row.loss = std::min(1.0, factor * loss);
    const PacketLoss packets{.loss = row.loss, .seed = seed};
    const LossyMesh texture = stream.decode(packets, SplitFill::kTexture);
    row.lost_points = texture.lost_points.size();
    row.neighbours_rms = point_errors(whole, stream.decode(packets, SplitFill::kNeighbours)).rms;
    const PointErrors errors = point_errors(whole, texture);
    row.texture_rms = errors.rms;
    row.texture_p95 = errors.p95;
    const std::vector<std::int32_t> rungs =
        row.loss > 0 ? rungs_after_loss(list.offers, plan.textures.rungs, packets) : plan.textures.rungs;
    row.lost_fragments = table.fragments - static_cast<std::size_t>(std::ranges::count_if(
                                               rungs, [](std::int32_t rung) { return rung >= 0; }));
    row.flip = picture_flip(package.quality(), request.displayed_px, plan.scale, losses_of(list, rungs));
    table.rows.push_back(row);
  }
  return table;
}

std::string lost_packets_text(const LostPacketsTable& t) {
  Table table;
  for (const char* h : {"packets lost [%]", "lost points", "neighbours: rms [edges]", "texture: rms [edges]",
                        "p95 [edges]", "lost fragments", "FLIP"})
    table.column(h);
  for (const LostPacketsRow& r : t.rows)
    table.row({fixed(100 * r.loss, 1), grouped(r.lost_points), fixed(r.neighbours_rms, 3),
               fixed(r.texture_rms, 3), fixed(r.texture_p95, 3), grouped(r.lost_fragments),
               fixed(r.flip, 4)});
  return fmt::format(
      "lost packets are not sent again, as over UDP; HTTP loses none. Of {} points and {} fragments:\n{}"
      "lost points stand where their texture coordinates lie among their neighbours' (chapter 10), or at the "
      "mean of these;\nlost fragments show their preview. FLIP is predicted of the textures; it does not see "
      "the points\n",
      grouped(t.points), grouped(t.fragments), table.text());
}

std::string lost_packets_json(const LostPacketsTable& t) {
  Json rows = Json::array();
  for (const LostPacketsRow& r : t.rows)
    rows.push_back({{"loss", r.loss},
                    {"lost_points", r.lost_points},
                    {"neighbours_rms_edges", r.neighbours_rms},
                    {"texture_rms_edges", r.texture_rms},
                    {"texture_p95_edges", r.texture_p95},
                    {"lost_fragments", r.lost_fragments},
                    {"flip", r.flip}});
  return Json{{"version", 1}, {"points", t.points}, {"fragments", t.fragments}, {"rows", rows}}.dump() + '\n';
}

std::string lost_packets_csv(const LostPacketsTable& t) {
  std::string csv =
      "loss,lost_points,neighbours_rms_edges,texture_rms_edges,texture_p95_edges,lost_fragments,flip\n";
  for (const LostPacketsRow& r : t.rows)
    csv += fmt::format("{},{},{:.6g},{:.6g},{:.6g},{},{:.6g}\n", r.loss, r.lost_points, r.neighbours_rms,
                       r.texture_rms, r.texture_p95, r.lost_fragments, r.flip);
  return csv;
}

std::vector<std::uint8_t> lost_packets_picture(PackageReader& package, int scale, double loss,
                                               std::uint64_t seed) {
  constexpr std::uint32_t kSide_px = 512;
  const RunContext context;
  const ScaleStream stream = stream_to(package, scale);
  const RenderEnvironment light = environment_of(RenderLight::kStudio, context);
  Material material;
  material.base_colour = {0.6f, 0.6f, 0.6f, 1};
  material.metallic = 0;
  material.roughness = 0.6f;
  material.double_sided = true;
  Pixels out{3 * kSide_px, kSide_px, 3, std::vector<std::uint8_t>(std::size_t{9} * kSide_px * kSide_px)};
  BoundingSphere bounds;
  for (std::uint32_t k = 0; k < 3; ++k) {
    const LossyMesh lossy = stream.decode({.loss = k == 0 ? 0 : loss, .seed = seed},
                                          k == 1 ? SplitFill::kNeighbours : SplitFill::kTexture);
    Mesh mesh = condition_mesh(clay(stream.head, lossy.mesh), false, {}, context).mesh;
    RenderedModel model = untextured_model(std::move(mesh), {material});
    if (k == 0) bounds = model.bounds;
    model.bounds = bounds;  // one camera for all
    const Pixels view = render_sheet(model, light, 1, kSide_px, context).pixels;
    paste(view, k * kSide_px, 0, out);
  }
  return write_png(out);
}

}  // namespace texmesh
