#pragma once
#include <functional>
#include <string>
#include <vector>

#include "format/base/bytes.h"
#include "format/documents/about.h"
#include "format/documents/tables.h"
#include "format/documents/thesis_tables.h"
#include "format/model/model.h"
#include "pipeline/graph/stage.h"
#include "pipeline/import/import.h"
#include "stages/data/conditioned_mesh.h"
#include "stages/data/fragments.h"
#include "stages/data/ladder.h"
#include "stages/data/nested_scales.h"
#include "stages/data/perceptual_values.h"
#include "stages/data/pixels.h"
#include "stages/data/previews.h"
#include "stages/data/proxies.h"
#include "stages/data/scale_map.h"

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
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.mesh, s.range, s.normals_by_specification, s.uv_sets);
  }
};

// From outside the graph:
inline constexpr Artefact<SourceModel> kSource{"source"};
inline constexpr Artefact<std::string> kProvenance{"provenance"};  // JSON

inline constexpr Artefact<ImportedMesh> kImportedMesh{"import.mesh"};
inline constexpr Artefact<std::vector<Material>> kMaterials{"import.materials"};
inline constexpr Artefact<std::vector<Image>> kImages{"import.images"};
inline constexpr Artefact<About> kSourceAbout{"import.about"};
inline constexpr Artefact<ConditionedMesh> kConditionedMesh{"condition"};
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
inline constexpr Artefact<Poster> kPoster{"poster"};
inline constexpr Artefact<Proxies> kProxies{"proxies"};
inline constexpr Artefact<Bytes> kPackage{"package"};

}  // namespace texmesh
