#pragma once

#include "format/documents/annotations.h"
#include "format/documents/tables.h"
#include "format/documents/thesis_tables.h"
#include "stages/data/fragments.h"
#include "stages/data/gltf_scales.h"
#include "stages/data/ladder.h"
#include "stages/data/nested_scales.h"
#include "stages/data/perceptual_values.h"
#include "stages/data/previews.h"
#include "stages/data/proxies.h"
#include "stages/data/stage.h"

namespace texmesh {

inline constexpr int kPackageVersion = 7;

struct PackageOptions {
  std::string title, meta, annotations;
  static void fields(auto& s, auto&& v) {
    v("title", s.title, "shown by viewers, before any other title");
    v("meta", s.meta, Range{0, static_cast<double>(kMaxAboutBytes)}, ProfileOnly{},
      "about.json without what the source says, as one text; --meta FILE sets it");
    v("annotations", s.annotations, Range{0, static_cast<double>(kMaxAnnotationsBytes)}, ProfileOnly{},
      "notes at points of the object, as one text of annotations.json; --annotations FILE sets it");
  }
};

/// Describes the model in a manifest, packs every rung's fragments by importance, and lays out the container
/// (format/documents/package_writer.h). Throws StageError when the stages' results do not belong together,
/// FormatError when the title or a value breaks a rule of the format. `tables` and `thesis` have a row for
/// every scale of the chain; the perceptual table of thesis.bin is made here. A pure function of its inputs:
/// nothing runs in parallel here. `source` is what the source says about itself: about.json is that with
/// options.meta and options.title over it. asset.copyright of the scales' files is the source's own, so that
/// they stay as they are when options.meta changes. options.annotations are those of the package, placed.
/// `provenance_json` is made by the pipeline (options, input digests, stage versions; no dates, hosts or
/// paths).
std::vector<std::uint8_t> assemble_package(
    const NestedScales& scales, const PerceptualValues& perceptual, const std::vector<Image>& images,
    const Fragments& fragments, const Ladder& ladder, const Previews& previews, const PackageTables& tables,
    const ThesisTables& thesis, const ScaleFiles& files, const GltfScales& gltf,
    const MeasuredQuality& quality, const Poster& poster, const Proxies& proxies, const About& source,
    double jnd, const std::string& provenance_json, const PackageOptions& options, const RunContext& context);

}  // namespace texmesh
