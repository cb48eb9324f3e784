// texmesh-lab study quality: variable texture quality against one for all, within the same bytes.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "lab/cli/commands.h"
#include "lab/study/allocation_study.h"
#include "pipeline/cache/disk_store.h"
#include "pipeline/compile/compile_model.h"
#include "pipeline/compile/stage_table.h"
#include "pipeline/graph/stage.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/table.h"
#include "stages/image/png_writer.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

struct QualityArguments {
  std::string model, output;
  CacheChoice cache;
  AllocationStudyOptions options;
  int jobs = 0;
  bool json = false;
};

using Choices = std::vector<StudiedChoice>;

/// Runs the graph as far as the tables, through compile's cache, and the study behind it.
Choices study_model(const QualityArguments& args) {
  const auto study = [&args](const ConditionedMesh& mesh, const std::vector<Material>& materials,
                             const Fragments& fragments, const std::vector<Pixels>& planes,
                             const Ladder& ladder, const Previews& previews, const PackageTables& tables,
                             const RunContext& context) {
    return study_allocation(mesh, materials, fragments, planes, ladder, previews, tables, args.options,
                            context);
  };
  constexpr Artefact<Choices> kStudy{"study"};
  Stage stage =
      make_stage({kStudy.name, 1, "fragments, rungs -> what choices of rungs look like"},
                 inputs(kConditionedMesh, kMaterials, kFragments, kFilledPlanes, kLadder, kPreviews, kTables),
                 derived(kStudy), options(), {}, study);
  CompileRequest request;
  request.input = args.model;
  request.options.ladder.prune = false;  // qualities to choose from, also those that no load would take
  Notes notes;
  return *run_towards(request, std::move(stage), kStudy, *store_of(args.cache), context_of(args.jobs), {},
                      notes);
}

/// Uniform and what is compared with it, side by side, the source last.
std::vector<std::uint8_t> picture_of(const Choices& choices) {
  std::vector<const StudiedChoice*> shown;
  for (std::size_t k = 1; k < choices.size(); ++k) shown.push_back(&choices[k]);
  shown.push_back(&choices[0]);
  return write_png(side_by_side(shown));
}

Table quality_table(const Choices& choices) {
  Table table{"",
              {Column::text("choice", "choice"),
               {"kB", kKilobytes, "bytes"},
               {"of budget %", percent_form()},
               {"fragments", 0, "fragments"},
               {"skipped", 0, "skipped"},
               {"lowest q", 0, "lowest_quality"},
               {"highest q", 0, "highest_quality"},
               {"surface SSIM", 4, "surface_ssim"},
               {"rendered SSIM", 4, "rendered_ssim"},
               {"rendered difference", 4, "rendered_difference"}}};
  const double budget = choices.size() > 1 ? static_cast<double>(choices[1].bytes) : 0;  // uniform's
  for (const StudiedChoice& c : choices)
    if (c.fragments > 0)
      table.row({c.name, c.bytes, static_cast<double>(c.bytes) / std::max(budget, 1.0), c.fragments,
                 c.skipped, c.lowest_quality, c.highest_quality, c.surface_ssim, c.ssim, c.difference});
  return table;
}

int study_quality_of(const QualityArguments& args) {
  if (!args.output.empty() && !args.output.ends_with(".png"))
    throw UsageError("study quality: --output", "", "x.png", args.output);
  if (args.options.picture_view >= args.options.views)
    throw UsageError("study quality: --view", "", "a number below --views",
                     std::to_string(args.options.picture_view));
  if (!args.output.empty()) check_output_file(args.output);
  const Choices choices = study_model(args);
  if (!args.output.empty()) write_output_file(args.output, picture_of(choices));
  const Table table = quality_table(choices);
  std::cout << (args.json ? Json{{"quality", table.json()}}.dump() + "\n" : table.text());
  return kExitOk;
}

}  // namespace

void add_quality_study(Command& study) {
  auto [c, args] =
      study.add("quality",
                "Is variable texture quality better than one for all, within the same bytes? Rendered "
                "and scored (Fig. 3.9)",
                study_quality_of);
  AllocationStudyOptions& options = args.options;
  c.option("MODEL", args.model, "A textured model; runs the stages that are needed, through the cache")
      .required();
  c.option("-o,--output", args.output,
           "Pictures side by side: uniform, variable (3.2), variable (log), rate-distortion, source", "PNG");
  c.option("--quality", options.quality, "Quality of the uniform choice, whose bytes are the budget")
      .integer_in(1, 100)
      .shows_default();
  c.option("--width", options.width, "dQ of equation 3.2: how far feature density moves the quality")
      .number_in(0.0, 100.0)
      .shows_default();
  c.option("--views", options.views, "Directions from which the scores are taken")
      .integer_in(1, 64)
      .shows_default();
  c.option("--view", options.picture_view, "The direction that the picture shows, from 0")
      .integer_in(0, 63)
      .shows_default();
  c.option("--size", options.size_px, "Side of a view, px").integer_in(32, 4096).shows_default();
  add_jobs_option(c, args.jobs);
  add_cache_options(c, args.cache);
  c.flag("--json", args.json, "Print one JSON object");
  c.examples(
      "  texmesh-lab study quality turtle.glb -o turtle.png\n"
      "  texmesh-lab study quality bust.obj --quality 30 --views 12 --json");
  c.notes(
      "variable (3.2) and (log): quality by feature density eta, around the highest Q_i whose bytes fit; the "
      "rest goes to one rung more where eta is highest. \"of budget %\" is what whole rungs come to.\n"
      "rate-distortion: bytes where they save most surface-weighted (1 - SSIM). Fragments may be skipped; a "
      "skipped fragment shows the preview.\n"
      "Surface SSIM is that of the tables. Rendered SSIM and difference (FLIP-like) compare S_0 with these "
      "textures with S_0 and the source's.\n"
      "Exit code: 0, 1 when the model cannot be compiled, 2 usage, 3 internal error.");
}

}  // namespace texmesh
