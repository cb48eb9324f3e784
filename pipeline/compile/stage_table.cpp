#include "pipeline/compile/stage_table.h"

#include "pipeline/import/up_axis.h"
#include "pipeline/io/program.h"
#include "stages/fill/fill.h"
#include "stages/geometry/mesh_topology.h"
#include "stages/previews/previews.h"

namespace texmesh {
namespace {

using Images = std::vector<Image>;
using Materials = std::vector<Material>;
using Planes = std::vector<Pixels>;

// Adapters, where a stage's function does not take its inputs and options as the graph gives them.

Results<ImportedMesh, Materials, Images, About> import_source(const SourceModel& source,
                                                              const ImportOptions& options,
                                                              const RunContext& context) {
  ImportedModel m = source.import(options, context);
  ImportedMesh mesh{std::move(m.model.mesh), std::move(m.model.range), m.normals_by_specification,
                    uv_sets_of(m.model.materials)};
  return {{std::move(mesh), std::move(m.model.materials), std::move(m.model.images), std::move(m.about)},
          std::move(m.model.notes)};
}

ConditionedMesh condition_import(const ImportedMesh& import, const ConditionOptions& options,
                                 const RunContext& context) {
  ConditionedMesh mesh = condition_mesh(import.mesh, import.normals_by_specification, options, context);
  mesh.uv_sets = import.uv_sets;
  return mesh;
}

/// Range scans are filtered on their own grid.
ScaleMap filter_scales(const ImportedMesh& import, const ConditionedMesh& mesh, const SsfOptions& options,
                       const RunContext& context) {
  if (import.range.columns == 0) return filter_scale_space(mesh, options, context);
  const RangeGrid grid = grid_on_conditioned(import.range, import.mesh.positions.size(), mesh);
  return filter_range_scan(grid, mesh.mesh.positions.size(), options, context);
}

/// R(v) in curvature's place.
ScaleMap filter_radius(const ImportedMesh& import, const ConditionedMesh& mesh, const Skeleton& skeleton,
                       const SsfOptions& options, const RunContext& context) {
  if (import.range.columns > 0) return filter_scales(import, mesh, options, context);
  return filter_skeleton_distance(mesh, skeleton, options, context);
}

Planes fill_fragments(const Fragments& fragments, const Images& images, Fill fill, LadderMode mode,
                      Uncovered uncovered, const RunContext& context) {
  const PartBlocks part =
      encoder_frees_uncovered(mode, uncovered) ? PartBlocks::kSmooth : PartBlocks::kSparse;
  return fill_planes(fragments, images, fill, context, part);
}

Previews preview_fragments(const Fragments& fragments, const Planes& planes, int quality,
                           Subsampling subsampling, const RunContext& context) {
  return make_previews(fragments, planes, {quality, subsampling}, context);
}

Results<PackageTables, ThesisTables> measure_fragments(const Fragments& fragments, const Planes& planes,
                                                       const Predictors& predictors, const Ladder& ladder,
                                                       const Previews& previews, const LutOptions& options,
                                                       const RunContext& context) {
  LutTables made = build_tables(fragments, planes, predictors, ladder, previews, options, context);
  return {{std::move(made.tables), std::move(made.thesis)}, {}};
}

Results<Bytes> package_all(const NestedScales& scales, const PerceptualValues& perceptual,
                           const Images& images, const Fragments& fragments, const Ladder& ladder,
                           const Previews& previews, const PackageTables& tables, const ThesisTables& thesis,
                           const ScaleFiles& files, const GltfScales& gltf, const MeasuredQuality& quality,
                           const Poster& poster, const Proxies& proxies, const About& source,
                           const std::string& provenance, const PackageOptions& options, double jnd,
                           UpAxis up, const RunContext& context) {
  Notes notes;
  PackageOptions placed = options;
  placed.annotations = placed_annotations(options.annotations, source, up, scales.mesh.origin,
                                          to_double(bounding_box(scales.mesh.positions)), notes);
  return {assemble_package(scales, perceptual, images, fragments, ladder, previews, tables, thesis, files,
                           gltf, quality, poster, proxies, source, jnd, provenance, placed, context),
          std::move(notes)};
}

std::vector<StageLibrary> libraries(std::initializer_list<const char*> names) {
  std::vector<StageLibrary> all;
  for (const char* name : names) all.push_back({name, library_versions().at(name)});
  return all;
}

/// Those that decode images and fragments of every kind.
constexpr std::initializer_list<const char*> kImageLibraries{"libavif", "libjpeg-turbo", "libpng", "libwebp",
                                                             "openimageio"};

/// make_stage() for a plain function, which has no state of its own: options that are not declared cannot
/// reach it.
template <class Read, class Made, class Declared, class Result, class... Parameter>
Stage stage(StageTitle title, Read read, Made made, Declared declared,
            std::initializer_list<const char*> used_libraries, Result (*function)(Parameter...)) {
  return make_stage(std::move(title), read, made, std::move(declared), libraries(used_libraries), function);
}

/// Waits for the skeleton only where R(v) is the signal.
Stage scale_space_stage(const CompileOptions& o) {
  const StageTitle title{"ssf", kSsfVersion,
                         "mesh -> scale map: the highest scale at which a vertex is a feature"};
  if (o.ssf.signal == ScaleSignal::kRadius)
    return stage(title, inputs(kImportedMesh, kConditionedMesh, kSkeleton), outputs(kScaleMap),
                 read_of(o, o.ssf), {}, filter_radius);
  return stage(title, inputs(kImportedMesh, kConditionedMesh), outputs(kScaleMap), read_of(o, o.ssf), {},
               filter_scales);
}

/// What the stages after the atlas read.
struct Shown {
  Artefact<ConditionedMesh> mesh = kConditionedMesh;
  Artefact<Materials> materials = kMaterials;
  Artefact<Images> images = kImages;
};
Shown shown_with(const CompileOptions& o) {
  if (o.atlas.mode == AtlasMode::kKeep) return {};
  return {kChartedMesh, kChartedMaterials, kChartedImages};
}

Results<ConditionedMesh, Materials, Images> chart_import(const ConditionedMesh& mesh,
                                                         const Materials& materials, const Images& images,
                                                         const AtlasOptions& options,
                                                         const RunContext& context) {
  ChartedModel m = chart_model(mesh, materials, images, options, context);
  return {{std::move(m.mesh), std::move(m.materials), std::move(m.images)}, std::move(m.notes)};
}

Stage atlas_stage(const CompileOptions& o) {
  return stage({"atlas", kAtlasVersion, "mesh, images -> few large charts with the source's texels"},
               inputs(kConditionedMesh, kMaterials, kImages),
               outputs(kChartedMesh, kChartedMaterials, kChartedImages), read_of(o, o.atlas), kImageLibraries,
               chart_import);
}

AtlasSample sample_source(const ConditionedMesh& mesh, const Materials& materials, const Images& images,
                          const NestedScales& scales, const Proxies& proxies, const RunContext& context) {
  return with_proxies(sample_atlas(mesh, materials, images, scales, materials, images, context), proxies);
}

/// The stages with that of the atlas behind condition, unless the source's is kept.
std::vector<Stage> with_atlas(std::vector<Stage> table, const CompileOptions& o) {
  if (o.atlas.mode != AtlasMode::kKeep)
    table.insert(std::ranges::find(table, "skeletonization", &Stage::name), atlas_stage(o));
  return table;
}

Stage scales_stage(const CompileOptions& o) {
  const Shown shown = shown_with(o);
  return stage({"scales", kScalesVersion, "kept scales -> GLB files, vertex splits"},
               inputs(kNestedScales, kPerceptualValues, shown.materials, shown.images, kFragments, kPreviews),
               outputs(kScaleFiles), read_of(o, o.scales),
               {"draco", "libjpeg-turbo", "meshoptimizer", "zlib"}, write_scales);
}

Stage gltf_scales_stage(const CompileOptions& o) {
  const Shown shown = shown_with(o);
  return stage({"gltf_scales", kGltfScalesVersion, "scales of the step function -> GLBs for viewers of glTF"},
               inputs(kNestedScales, kPerceptualValues, shown.materials, shown.images, kFragments,
                      kFilledPlanes, kPreviews, kTables, kScaleFiles, kQuality),
               outputs(kGltfScales), read_of(o, o.scales),
               {"draco", "libjpeg-turbo", "meshoptimizer", "zlib"}, write_gltf_scales);
}

Stage package_stage(const CompileOptions& o) {
  return stage(
      {"package", kPackageVersion, "everything -> the container"},
      inputs(kNestedScales, kPerceptualValues, shown_with(o).images, kFragments, kLadder, kPreviews, kTables,
             kThesisTables, kScaleFiles, kGltfScales, kQuality, kPoster, kProxies, kSourceAbout, kProvenance),
      outputs(kPackage), read_of(o, o.package, o.perceptual_values.jnd, o.import.up), {}, package_all);
}

}  // namespace

std::vector<Stage> stage_table(const CompileOptions& o) {
  const Shown shown = shown_with(o);
  std::vector<Stage> table{
      stage({"import", kImportVersion, "file -> mesh, materials, images, what it says of itself"},
            inputs(kSource), outputs(kImportedMesh, kMaterials, kImages, kSourceAbout), read_of(o, o.import),
            {"draco", "libpng", "libzstd", "meshoptimizer", "openimageio", "tinygltf", "zlib"},
            import_source),
      stage({"condition", kConditionVersion,
             "mesh -> 2-manifold mesh: weld, drop degenerates, split, components"},
            inputs(kImportedMesh), outputs(kConditionedMesh), read_of(o, o.condition), {}, condition_import),
      stage({"skeletonization", kSkeletonizationVersion, "mesh -> curve skeleton, R(v)"},
            inputs(kConditionedMesh), outputs(kSkeleton), read_of(o, o.skeletonization),
            {"cgal", "meshoptimizer"}, skeletonize),
      scale_space_stage(o),
      stage({"simplification", kSimplificationVersion, "mesh, scale map -> collapse sequence, nested scales"},
            inputs(shown.mesh, kScaleMap), outputs(kNestedScales), read_of(o, o.simplification), {},
            simplify),
      stage({"perceptual_values", kPerceptualValuesVersion,
             "scales, R -> perceptual values, major scales, step function"},
            inputs(kNestedScales, kSkeleton), outputs(kPerceptualValues), read_of(o, o.perceptual_values), {},
            measure_perceptual_values),
      stage({"fragmentation", kFragmentationVersion, "images, mesh -> grids, coverage, feature counts, eta"},
            inputs(shown.mesh, shown.materials, shown.images, kScaleMap), outputs(kFragments),
            read_of(o, o.fragmentation), {"openimageio"}, fragment_textures),
      stage({"fill", kFillVersion, "images, coverage -> filled texels (derived, never stored)"},
            inputs(kFragments, shown.images), derived(kFilledPlanes),
            read_of(o, o.fragmentation.fill, o.ladder.mode, o.ladder.uncovered),
            {"libjpeg-turbo", "libpng", "openimageio"}, fill_fragments),
      stage({"zim", kZimVersion, "fragments -> predictors Z, I, M, VQP"},  //
            inputs(kFragments, kFilledPlanes), outputs(kPredictors), read_of(o, o.zim), {}, predict_quality),
      stage({"previews", kPreviewsVersion, "fragments -> a small JPEG of every texture"},
            inputs(kFragments, kFilledPlanes), outputs(kPreviews),
            read_of(o, o.ladder.preview_quality, o.ladder.subsampling), {"libjpeg-turbo"}, preview_fragments),
      stage({"ladder", kLadderVersion, "fragments, previews -> rungs of streams in the chosen codec"},
            inputs(kFragments, kFilledPlanes, kPreviews, shown.images), outputs(kLadder),
            read_of(o, o.ladder), {"libjpeg-turbo", "libwebp"}, encode_ladder),
      stage({"lut", kLutVersion, "fragments, predictors, ladder, previews -> quality and size tables"},
            inputs(kFragments, kFilledPlanes, kPredictors, kLadder, kPreviews),
            outputs(kTables, kThesisTables), read_of(o, o.lut), {"libjpeg-turbo", "libwebp"},
            measure_fragments),
      scales_stage(o),
      stage({"quality", kQualityVersion, "scales, rungs -> losses of lit pictures, switch sizes"},
            inputs(kNestedScales, kPerceptualValues, shown.materials, shown.images, kFragments, kFilledPlanes,
                   kLadder, kPreviews, kTables),
            outputs(kQuality), read_of(o, o.quality), kImageLibraries, measure_quality),
      gltf_scales_stage(o),
      stage({"poster", kPosterVersion, "S_0 with the source's texels -> a picture of the object"},
            inputs(kNestedScales, shown.materials, kFragments, kFilledPlanes), outputs(kPoster),
            read_of(o, o.poster), {"libjpeg-turbo"}, make_poster),
      stage({"proxies", kProxiesVersion, "S_0 and scales -> the whole object in small GLBs"},
            inputs(kNestedScales, shown.materials, shown.images, kFragments, kFilledPlanes),
            outputs(kProxies), read_of(o, o.proxies), {"draco", "libjpeg-turbo", "libwebp", "meshoptimizer"},
            make_proxies),
      package_stage(o),
  };
  return with_atlas(std::move(table), o);
}

Stage atlas_choice_stage(const CompileOptions& o) {
  const bool keeps = o.atlas.mode == AtlasMode::kKeep;
  const StageTitle title{keeps ? "atlas_choice" : "atlas_choice_rebuilt", kAtlasChoiceVersion,
                         "source, nested scales -> lit pictures for the bytes of loads"};
  if (keeps)
    return stage(title, inputs(kConditionedMesh, kMaterials, kImages, kNestedScales, kProxies),
                 outputs(kAtlasSample), Options<>{}, kImageLibraries, sample_source);
  return stage(
      title, inputs(kConditionedMesh, kMaterials, kImages, kNestedScales, kChartedMaterials, kChartedImages),
      outputs(kAtlasSample), Options<>{}, kImageLibraries, sample_atlas);
}

namespace {

/// Seconds, about: they only shape the progress bar and the estimate of the time left. Of ten scans (4,000 to
/// 150,000 triangles) on a quiet machine.
struct StageTime {
  double fixed = 0, per_100k_triangles = 0, per_10_megapixels = 0, per_image = 0;
  double many_triangles = 0;  // more where there are 40,000
};

const std::map<std::string, StageTime>& stage_times() {
  static const std::map<std::string, StageTime> times{
      {"import", {.01, .02}},
      {"condition", {.01, .12}},
      {"atlas", {.2, 4, 1}},
      {"skeletonization", {1.3}},
      {"ssf", {.01, .62}},
      {"simplification", {.01, .95}},
      {"perceptual_values", {.07, .38}},
      {"fragmentation", {.01, .12, .02}},
      {"fill", {.01, 0, .37}},
      {"zim", {.01, 0, .11}},
      {"previews", {.01, 0, .02}},
      {"ladder", {.01, .26, .51, .1}},
      {"lut", {.01, 0, .27}},
      {"scales", {.01, .5}},
      {"quality", {2.3, .76, 1.2, .44}},
      {"gltf_scales", {.01, .26}},
      {"poster", {.16}},
      {"proxies", {.4, 0, .2, .3, 8.9}},
      {"package", {.01, .06, .02}},
  };
  return times;
}

}  // namespace

std::map<std::string, double> time_shares(const CompileOptions& options, const ModelSize& m) {
  std::map<std::string, double> shares;
  double all = 0;
  for (const Stage& stage : stage_table(options)) {
    const bool is_off = stage.name == "proxies" && options.proxies.mode == ProxyMode::kNone;
    const StageTime t = is_off ? StageTime{.01} : stage_times().at(stage.name);
    all += shares[stage.name] = t.fixed + t.per_100k_triangles * m.triangles / 1e5 +
                                t.per_10_megapixels * m.megapixels / 10 + t.per_image * m.images +
                                (m.triangles < 40e3 ? 0 : t.many_triangles);
  }
  for (auto& [stage, share] : shares) share /= all;
  return shares;
}

const std::vector<Stage>& default_stage_table() {
  static const std::vector<Stage> table = stage_table(CompileOptions{});
  return table;
}

std::vector<Stage> graph_towards(Stage last, const CompileOptions& options) {
  std::vector<Stage> table = stage_table(options);
  std::vector<ArtefactName> needed = last.inputs;
  const auto is_needed = [&](const StageOutput& output) {
    return std::any_of(needed.begin(), needed.end(),
                       [&](const ArtefactName& name) { return name.name == output.name; });
  };
  std::vector<Stage> graph{std::move(last)};
  for (auto s = table.rbegin(); s != table.rend(); ++s) {  // an input stands before its use
    if (std::none_of(s->outputs.begin(), s->outputs.end(), is_needed)) continue;
    needed.insert(needed.end(), s->inputs.begin(), s->inputs.end());
    graph.push_back(std::move(*s));
  }
  std::reverse(graph.begin(), graph.end());
  return graph;
}

}  // namespace texmesh
