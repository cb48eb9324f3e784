#pragma once

#include "pipeline/compile/options.h"

namespace texmesh {

// The artefacts of the graph: who makes or reads one goes by its handle.

/// The model file behind its import.
struct SourceModel {
  std::function<ImportedModel(const ImportOptions&, const RunContext&)> import;
};

/// What import hands on, apart from images and materials.
struct ImportedMesh {
  Mesh mesh;
  RangeGrid range;
  bool normals_by_specification = false;
  std::vector<UvSets> uv_sets;  // of the materials: no other change of theirs is one of the shapes
  static void archive(auto& s, auto& a) { a(s.mesh, s.range, s.normals_by_specification, s.uv_sets); }
};

// From outside the graph:
inline constexpr Artefact<SourceModel> kSource{"source"};
inline constexpr Artefact<std::string> kProvenance{"provenance"};  // JSON

inline constexpr Artefact<ImportedMesh> kImportedMesh{"import.mesh"};
inline constexpr Artefact<std::vector<Material>> kMaterials{"import.materials"};
inline constexpr Artefact<std::vector<Image>> kImages{"import.images"};
inline constexpr Artefact<About> kSourceAbout{"import.about"};
inline constexpr Artefact<ConditionedMesh> kConditionedMesh{"condition"};
// What is shown: the source's, or the atlas stage's, see stage_table().
inline constexpr Artefact<ConditionedMesh> kChartedMesh{"atlas.mesh"};
inline constexpr Artefact<std::vector<Material>> kChartedMaterials{"atlas.materials"};
inline constexpr Artefact<std::vector<Image>> kChartedImages{"atlas.images"};
inline constexpr Artefact<AtlasSample> kAtlasSample{"atlas_choice"};
inline constexpr Artefact<Skeleton> kSkeleton{"skeletonization"};
inline constexpr Artefact<ScaleMap> kScaleMap{"ssf"};
inline constexpr Artefact<NestedScales> kNestedScales{"simplification"};
inline constexpr Artefact<PerceptualValues> kPerceptualValues{"perceptual_values"};
inline constexpr Artefact<Fragments> kFragments{"fragmentation"};
inline constexpr Artefact<std::vector<Pixels>> kFilledPlanes{"fill"};
inline constexpr Artefact<Predictors> kPredictors{"zim"};
inline constexpr Artefact<Previews> kPreviews{"previews"};
inline constexpr Artefact<Ladder> kLadder{"ladder"};
inline constexpr Artefact<PackageTables> kTables{"lut.tables"};
inline constexpr Artefact<ThesisTables> kThesisTables{"lut.thesis"};
inline constexpr Artefact<ScaleFiles> kScaleFiles{"scales"};
inline constexpr Artefact<MeasuredQuality> kQuality{"quality"};
inline constexpr Artefact<GltfScales> kGltfScales{"gltf_scales"};
inline constexpr Artefact<Poster> kPoster{"poster"};
inline constexpr Artefact<Proxies> kProxies{"proxies"};
inline constexpr Artefact<Bytes> kPackage{"package"};

/// The whole graph with these options, which must be resolved (resolve_options), in an order in which every
/// input stands before its use. stage_table.cpp is the one place where the graph can be read. With atlas.mode
/// keep there is no stage of that name, and the later ones read what import and condition made.
std::vector<Stage> stage_table(const CompileOptions& options);

/// Looks at what is shown with the charts of these options, keep or rebuild, beside the source: each has a
/// name of its own. It stands in no graph of a package: whoever asks for atlas.mode auto compares what it
/// finds with keep and with rebuild.
Stage atlas_choice_stage(const CompileOptions& options);

/// The graph with default options: for those who ask for names, versions and inputs.
const std::vector<Stage>& default_stage_table();

/// What is known of a model once it is imported.
struct ModelSize {
  double triangles = 20e3, megapixels = 16, images = 2;  // of all images; a usual scan
};

/// Of each stage of stage_table(), about which share of the model's time it takes; together 1.
std::map<std::string, double> time_shares(const CompileOptions& options, const ModelSize& size);

/// The stages of stage_table() that `last` needs, directly or not, in the table's order, and `last` itself:
/// for commands that want to see what is in the middle of the graph.
std::vector<Stage> graph_towards(Stage last, const CompileOptions& options);

}  // namespace texmesh
