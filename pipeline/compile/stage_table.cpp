#include "pipeline/compile/stage_table.h"

#include <algorithm>

#include "format/base/no_index.h"
#include "stages/fill/fill.h"
#include "stages/image/decode_image.h"
#include "stages/previews/previews.h"

namespace texmesh {
namespace {

using Images = std::vector<Image>;
using Materials = std::vector<Material>;
using Planes = std::vector<Pixels>;
using PackageBytes = std::vector<std::uint8_t>;

template <class T>
StageOutputs with_notes(T value) {
  Notes notes = value.notes;
  return {{object(std::move(value))}, std::move(notes)};
}
template <class T>
StageOutputs plain(T value) {
  return {{object(std::move(value))}, {}};
}

StageOutputs run_import(const StageInputs& in) {
  ImportedModel m = in.get<Source>("source").import(in.context);
  Notes notes = std::move(m.model.notes);
  return {{object(ImportedMesh{std::move(m.model.mesh), std::move(m.model.range), m.normals_by_specification,
                               uv_sets_of(m.model.materials)}),
           object(std::move(m.model.materials)), object(std::move(m.model.images))},
          std::move(notes)};
}

StageOutputs run_condition(const StageInputs& in) {
  const auto& m = in.get<ImportedMesh>("import.mesh");
  ConditionedMesh mesh = condition_mesh(m.mesh, m.normals_by_specification, in.options.condition, in.context);
  mesh.uv_sets = m.uv_sets;
  return with_notes(std::move(mesh));
}

StageOutputs run_skeletonization(const StageInputs& in) {
  return with_notes(
      skeletonize(in.get<ConditionedMesh>("condition"), in.options.skeletonization, in.context));
}

/// Range scans are filtered on their own grid; condition's map says which conditioned position a sample
/// became.
StageOutputs run_ssf(const StageInputs& in) {
  const auto& conditioned = in.get<ConditionedMesh>("condition");
  const RangeGrid& range = in.get<ImportedMesh>("import.mesh").range;
  if (range.columns == 0) return with_notes(filter_scale_space(conditioned, in.options.ssf, in.context));
  std::vector<std::uint32_t> conditioned_position(in.get<ImportedMesh>("import.mesh").mesh.positions.size(),
                                                  kNoIndex);
  for (std::size_t i = conditioned.position_source.size(); i-- > 0;)
    conditioned_position.at(conditioned.position_source[i]) = static_cast<std::uint32_t>(i);
  RangeGrid grid = range;
  for (std::uint32_t& p : grid.position)
    if (p != kNoIndex) p = conditioned_position.at(p);
  return with_notes(filter_range_scan(grid, conditioned.mesh.positions.size(), in.options.ssf, in.context));
}

StageOutputs run_simplification(const StageInputs& in) {
  return with_notes(simplify(in.get<ConditionedMesh>("condition"), in.get<ScaleMap>("ssf"),
                             in.options.simplification, in.context));
}

StageOutputs run_perceptual_values(const StageInputs& in) {
  return plain(measure_perceptual_values(in.get<NestedScales>("simplification"),
                                         in.get<Skeleton>("skeletonization"), in.options.perceptual_values,
                                         in.context));
}

/// Progressive files need fragments of 256 px; who sets another least side has it, and is warned.
FragmentationOptions fragmentation_options(const CompileOptions& options) {
  FragmentationOptions out = options.fragmentation;
  if (options.ladder.mode == LadderMode::kProgressive &&
      out.min_fragment_px == FragmentationOptions{}.min_fragment_px)
    out.min_fragment_px = static_cast<int>(kLeastProgressiveSide);
  return out;
}

StageOutputs run_fragmentation(const StageInputs& in) {
  return with_notes(fragment_textures(in.get<ConditionedMesh>("condition"),
                                      in.get<Materials>("import.materials"), in.get<Images>("import.images"),
                                      in.get<ScaleMap>("ssf"), fragmentation_options(in.options),
                                      in.context));
}

/// With --fill none the source's own texels stay, whatever they cost.
LadderOptions ladder_options(const StageInputs& in) {
  LadderOptions out = in.options.ladder;
  if (in.options.fragmentation.fill == Fill::kNone) out.uncovered = Uncovered::kKept;
  return out;
}

StageOutputs run_fill(const StageInputs& in) {
  const LadderOptions ladder = ladder_options(in);
  const bool encoder_knows = ladder.mode == LadderMode::kJpeg && ladder.uncovered == Uncovered::kFree;
  return plain(fill_planes(in.get<Fragments>("fragmentation"), in.get<Images>("import.images"),
                           in.options.fragmentation.fill, in.context,
                           encoder_knows ? PartBlocks::kSmooth : PartBlocks::kSparse));
}

StageOutputs run_zim(const StageInputs& in) {
  return plain(predict_quality(in.get<Fragments>("fragmentation"), in.get<Planes>("fill"), in.options.zim,
                               in.context));
}

StageOutputs run_previews(const StageInputs& in) {
  const LadderOptions& ladder = in.options.ladder;
  return plain(make_previews(in.get<Fragments>("fragmentation"), in.get<Planes>("fill"),
                             {ladder.preview_quality, ladder.subsampling}, in.context));
}

StageOutputs run_ladder(const StageInputs& in) {
  return with_notes(encode_ladder(in.get<Fragments>("fragmentation"), in.get<Planes>("fill"),
                                  in.get<Previews>("previews"), in.get<Images>("import.images"),
                                  ladder_options(in), in.context));
}

StageOutputs run_lut(const StageInputs& in) {
  return plain(build_tables(in.get<Fragments>("fragmentation"), in.get<Planes>("fill"),
                            in.get<Predictors>("zim"), in.get<Ladder>("ladder"), in.get<Previews>("previews"),
                            in.options.lut, in.context));
}

StageOutputs run_scales(const StageInputs& in) {
  return with_notes(write_scales(
      in.get<NestedScales>("simplification"), in.get<PerceptualValues>("perceptual_values"),
      in.get<Materials>("import.materials"), in.get<Images>("import.images"),
      in.get<Fragments>("fragmentation"), in.get<Previews>("previews"), in.options.scales, in.context));
}

StageOutputs run_quality(const StageInputs& in) {
  MeasuredQuality measured =
      measure_quality(in.get<NestedScales>("simplification"), in.get<PerceptualValues>("perceptual_values"),
                      in.get<Materials>("import.materials"), in.get<Fragments>("fragmentation"),
                      in.get<Planes>("fill"), in.get<Ladder>("ladder"), in.options.quality, in.context);
  return {{object(std::move(measured.table))}, std::move(measured.notes)};
}

StageOutputs run_package(const StageInputs& in) {
  return plain(assemble_package(
      in.get<NestedScales>("simplification"), in.get<PerceptualValues>("perceptual_values"),
      in.get<Images>("import.images"), in.get<Fragments>("fragmentation"), in.get<Ladder>("ladder"),
      in.get<Previews>("previews"), in.get<PackageTables>("lut"), in.get<ScaleFiles>("scales"),
      in.get<QualityTable>("quality"), in.options.perceptual_values.jnd, in.get<std::string>("provenance"),
      in.options.package, in.context));
}

Artefact derived(std::string name) { return {std::move(name), nullptr, nullptr}; }

std::vector<Stage> make_table() {
  return {
      {"import",
       kImportVersion,
       "file -> mesh, materials, images",
       {"source"},
       {artefact<ImportedMesh>("import.mesh"), artefact<Materials>("import.materials"),
        artefact<Images>("import.images")},
       {"import"},
       {"draco", "libpng", "meshoptimizer", "openimageio", "tinygltf"},
       true,
       run_import},
      {"condition",
       kConditionVersion,
       "mesh -> 2-manifold mesh: weld, drop degenerates, split, components",
       {"import.mesh"},
       {artefact<ConditionedMesh>("condition")},
       {"condition"},
       {},
       true,
       run_condition},
      {"skeletonization",
       kSkeletonizationVersion,
       "mesh -> curve skeleton, R(v)",
       {"condition"},
       {artefact<Skeleton>("skeletonization")},
       {"skeletonization"},
       {"cgal", "meshoptimizer"},
       true,
       run_skeletonization},
      {"ssf",
       kSsfVersion,
       "mesh -> scale map: the highest scale at which a vertex is a feature",
       {"import.mesh", "condition"},
       {artefact<ScaleMap>("ssf")},
       {"ssf"},
       {},
       true,
       run_ssf},
      {"simplification",
       kSimplificationVersion,
       "mesh, scale map -> collapse sequence, nested scales",
       {"condition", "ssf"},
       {artefact<NestedScales>("simplification")},
       {"simplification"},
       {},
       true,
       run_simplification},
      {"perceptual_values",
       kPerceptualValuesVersion,
       "scales, R -> perceptual values, major scales, step function",
       {"simplification", "skeletonization"},
       {artefact<PerceptualValues>("perceptual_values")},
       {"perceptual_values"},
       {},
       true,
       run_perceptual_values},
      {"fragmentation",
       kFragmentationVersion,
       "images, mesh -> grids, coverage, feature counts, eta",
       {"condition", "import.materials", "import.images", "ssf"},
       {artefact<Fragments>("fragmentation")},
       {"fragmentation", "ladder.mode"},
       {"openimageio"},
       true,
       run_fragmentation},
      {"fill",
       kFragmentationVersion * 100 + kDecodeImageVersion,
       "images, coverage -> filled texels (derived, never stored)",
       {"fragmentation", "import.images"},
       {derived("fill")},
       {"fragmentation.fill", "ladder.mode", "ladder.uncovered"},
       {"libjpeg-turbo", "libpng", "openimageio"},
       false,
       run_fill},
      {"zim",
       kZimVersion,
       "fragments -> predictors Z, I, M, VQP",
       {"fragmentation", "fill"},
       {artefact<Predictors>("zim")},
       {"zim"},
       {},
       true,
       run_zim},
      {"previews",
       kPreviewsVersion,
       "fragments -> a small JPEG of every texture",
       {"fragmentation", "fill"},
       {artefact<Previews>("previews")},
       {"ladder.preview_quality", "ladder.subsampling"},
       {"libjpeg-turbo"},
       true,
       run_previews},
      {"ladder",
       kLadderVersion,
       "fragments, previews -> rungs of streams in the chosen codec",
       {"fragmentation", "fill", "previews", "import.images"},
       {artefact<Ladder>("ladder")},
       {"ladder", "fragmentation.fill"},
       {"libjpeg-turbo", "libwebp"},
       true,
       run_ladder},
      {"lut",
       kLutVersion,
       "fragments, predictors, ladder, previews -> quality and size tables",
       {"fragmentation", "fill", "zim", "ladder", "previews"},
       {artefact<PackageTables>("lut")},
       {"lut"},
       {"libjpeg-turbo", "libwebp"},
       true,
       run_lut},
      {"scales",
       kScalesVersion,
       "kept scales -> standalone GLB files",
       {"simplification", "perceptual_values", "import.materials", "import.images", "fragmentation",
        "previews"},
       {artefact<ScaleFiles>("scales")},
       {"scales"},
       {"draco", "libjpeg-turbo", "meshoptimizer", "zlib"},
       true,
       run_scales},
      {"quality",
       kQualityVersion,
       "scales x rungs -> measured quality of rendered samples",
       {"simplification", "perceptual_values", "import.materials", "fragmentation", "fill", "ladder"},
       {artefact<QualityTable>("quality")},
       {"quality"},
       {"libjpeg-turbo", "libwebp"},
       true,
       run_quality},
      {"package",
       kPackageVersion,
       "everything -> the container",
       {"simplification", "perceptual_values", "import.images", "fragmentation", "ladder", "previews", "lut",
        "scales", "quality", "provenance"},
       {artefact<PackageBytes>("package")},
       {"package", "perceptual_values.jnd"},
       {},
       true,
       run_package},
  };
}

bool makes(const Stage& stage, const std::string& artefact) {
  return std::any_of(stage.outputs.begin(), stage.outputs.end(),
                     [&](const Artefact& a) { return a.name == artefact; });
}

}  // namespace

const std::vector<Stage>& stage_table() {
  static const std::vector<Stage> table = make_table();
  return table;
}

std::vector<Stage> graph_towards(Stage last) {
  const std::vector<Stage>& table = stage_table();
  std::vector<std::string> needed = last.inputs;
  std::vector<bool> taken(table.size(), false);
  for (std::size_t i = table.size(); i-- > 0;) {  // an input stands before its use
    taken[i] = std::any_of(needed.begin(), needed.end(),
                           [&](const std::string& artefact) { return makes(table[i], artefact); });
    if (taken[i]) needed.insert(needed.end(), table[i].inputs.begin(), table[i].inputs.end());
  }
  std::vector<Stage> graph;
  for (std::size_t i = 0; i < table.size(); ++i)
    if (taken[i]) graph.push_back(table[i]);
  graph.push_back(std::move(last));
  return graph;
}

}  // namespace texmesh
