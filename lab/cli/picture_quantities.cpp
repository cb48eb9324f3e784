// texmesh-lab picture: what stages of the method computed.
#include <fmt/format.h>

#include "format/container/layout.h"
#include "lab/cli/commands.h"
#include "pipeline/compile/stage_table.h"
#include "pipeline/io/table.h"
#include "stages/data/nested_scales.h"
#include "stages/data/scale_map.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/painting.h"

namespace texmesh {
namespace {

double rank(std::vector<double> values, double fraction) {
  if (values.empty()) return 0;
  const auto at = static_cast<std::ptrdiff_t>(fraction * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

/// R's remarks: how the skeleton came about, in the notes' own words.
void add_remarks(const Notes& notes, ColourLegend& legend) {
  for (const Note& n : notes) legend.remarks.push_back(n.code + ": " + n.text);
}

constexpr PaintedQuantity kLaboratoryQuantities[] = {
    {"skeleton", [] { return painting_stage(inputs(kConditionedMesh, kSkeleton), paint_skeleton); }, nullptr},
    {"R", [] { return painting_stage(inputs(kConditionedMesh, kSkeleton), paint_radius); }, nullptr},
    {"perceptual", [] { return painting_stage(inputs(kNestedScales, kSkeleton), paint_perceptual); },
     nullptr},
    {"collapse-error", [] { return painting_stage(inputs(kNestedScales), paint_collapse_error); }, nullptr}};

}  // namespace

PaintedModel paint_radius(const ConditionedMesh& mesh, const Skeleton& skeleton) {
  const std::vector<double> value(skeleton.radius.begin(), skeleton.radius.end());
  ColourLegend legend{"R: distance to the skeleton with its floor, as perceptual values divide by it",
                      "object units"};
  legend.lo = rank(value, 0.01), legend.hi = rank(value, 0.99);
  legend.remarks.push_back("colours run from the 1st to the 99th percentile; median " +
                           shortest(rank(value, 0.5)));
  std::size_t floored = 0;
  for (std::size_t p = 0; p < value.size(); ++p) floored += skeleton.radius[p] > skeleton.distance.at(p);
  legend.remarks.push_back(share_text(static_cast<double>(floored), static_cast<double>(value.size())) +
                           " of the vertices have the floor");
  add_remarks(skeleton.notes, legend);
  return paint_values(mesh.mesh, value, std::move(legend), "skeleton");
}

PaintedModel paint_skeleton(const ConditionedMesh& mesh, const Skeleton& skeleton) {
  PaintedModel view =
      paint_values(mesh.mesh, std::vector<double>(mesh.mesh.positions.size(), 0), {}, "skeleton");
  for (Vec4f& c : view.mesh.colours) c = {0.55f, 0.55f, 0.55f, 0.35f};
  view.translucent = true;
  view.nodes = skeleton.nodes;
  view.lines = skeleton.segments;
  view.legend = {"curve skeleton: red lines through the translucent surface"};
  view.legend.coloured = false;
  view.legend.remarks.push_back(
      fmt::format("{} nodes, {} segments", skeleton.nodes.size(), skeleton.segments.size()));
  add_remarks(skeleton.notes, view.legend);
  return view;
}

PaintedModel paint_perceptual(const NestedScales& scales, const Skeleton& skeleton) {
  std::vector<double> value(scales.mesh.positions.size(), 0);
  for (const Collapse& c : scales.collapses)
    value.at(c.from) = std::abs(double{skeleton.distance.at(c.from)} - skeleton.distance.at(c.to)) /
                       double{skeleton.radius.at(c.to)};
  ColourLegend legend{"perceptual: |R_R - R_C| / R_C of the collapse that removed a vertex (7.2)"};
  legend.hi = std::max(rank(value, 0.99), 1e-6);
  legend.remarks.push_back("colours end at the 99th percentile; vertices that are left have 0");
  return paint_values(scales.mesh, value, std::move(legend), "collapses");
}

PaintedModel paint_collapse_error(const NestedScales& scales) {
  const Mesh& mesh = scales.mesh;
  constexpr double kNever = -1;
  std::vector<double> value(mesh.positions.size(), kNever), removed;
  for (const Collapse& c : scales.collapses) {
    value.at(c.from) = static_cast<double>(c.error);
    if (c.error > 0) removed.push_back(value[c.from]);
  }
  const double hi = removed.empty() ? 1 : *std::max_element(removed.begin(), removed.end());
  const double lo = removed.empty() ? hi : std::max(rank(removed, 0.01), hi * 1e-6);
  ColourLegend legend{"collapse error: quadric error at which a vertex was removed", "object units"};
  legend.lo = std::min(lo, hi), legend.hi = hi, legend.logarithmic = true;
  std::size_t kept = 0;
  for (double& v : value) {
    kept += v == kNever;
    v = v == kNever ? hi : std::max(v, legend.lo);
  }
  legend.remarks.push_back(fmt::format(
      "{} collapses; {} of the vertices are left in the coarsest scale and have the highest colour",
      scales.collapses.size(), share_text(static_cast<double>(kept), static_cast<double>(value.size()))));
  for (const NestedScale& s : scales.scales)
    if (!s.floor_reason.empty()) {
      legend.remarks.push_back(fmt::format("S_{}: {}", s.scale, s.floor_reason));
      break;
    }
  return paint_values(mesh, value, std::move(legend), "collapses");
}

void add_picture_command(Command& app) {
  auto args = std::make_shared<Painting>();
  Command c = app.add("picture", "Picture what a stage of the method computed, with a legend of its colours");
  c.option("INPUT", args->input, "A model; the stages that are needed run, through the cache").required();
  c.option(
       "--what", args->what,
       "skeleton: the curve skeleton inside the shape. R: the distance to the skeleton, which errors are "
       "measured against. collapse-error: at which error a vertex was removed. perceptual: the perceptual value of that collapse",
       "QUANTITY")
      .required()
      .one_of_explained({"skeleton", "R", "collapse-error", "perceptual"});
  c.option("-o,--output", args->output,
           "x.glb to turn in any viewer, x.png for two views side by side, x.csv or x.ply for the values",
           "FILE")
      .required();
  c.option("--size", args->size_px, "Side of one view of a PNG, px").integer_in(64, 4096).shows_default();
  add_painting_options(c, *args);
  add_jobs_option(c, args->jobs);
  c.flag("--json", args->json, "Print the legend as one JSON object");
  c.examples(
      "  texmesh-lab picture turtle.glb --what R -o turtle.png\n"
      "  texmesh-lab picture turtle.glb --what skeleton -o turtle.glb --set skeletonization.alpha_divisor=120");
  c.notes(
      "Colours run from dark violet (low) over teal to yellow (high); the legend on standard output gives their "
      "values. A GLB holds the colours as vertex colours and the skeleton as lines.\n"
      "Exit code: 0, 1 when the input cannot be shown, 2 usage, 3 internal error.");
  c.on_run([args] { return run_painting(*args, kLaboratoryQuantities); });
}

}  // namespace texmesh
