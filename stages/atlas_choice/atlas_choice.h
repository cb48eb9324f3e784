#pragma once
#include <array>

#include "stages/data/conditioned_mesh.h"
#include "stages/data/nested_scales.h"
#include "stages/data/proxies.h"
#include "stages/data/stage.h"

namespace texmesh {

inline constexpr int kAtlasChoiceVersion = 1;
inline constexpr const char* kChosenAtlasNote = "atlas-chosen";

/// Scans of fewer charts gain nothing that pays for the source's coefficients: they keep theirs unseen.
inline constexpr std::size_t kFewCharts = 500;

/// Bytes of ordinary loads.
inline constexpr std::array<std::uint64_t, 4> kSampledBytes{200'000, 300'000, 500'000, 1'000'000};

/// How a model with certain charts looks for these bytes.
struct AtlasSample {
  std::string good;  // why the source's charts stay without a look at pictures; empty: they were looked at
  std::uint64_t charts = 0;
  std::vector<double> flip;        // by kSampledBytes
  std::vector<double> proxy_flip;  // of the best proxy that fits, 1 = none
  static void archive(auto& s, auto& a) { a(s.good, s.charts, s.flip, s.proxy_flip); }
};

/// Compares nested scales, and their images coded as JPEGs, with the source in lit pictures 512 px high of
/// two views (stages/render in the studio's light). Flip is that of the scale and the mip which look best
/// together for the bytes, where mean FLIP of shape and of texels add up by a power. Bytes of meshes, and of
/// what plans fetch besides, are estimated. Few charts, and what has no texture, are good without pictures.
/// Same bytes for any thread count. InputError for an image that does not decode.
AtlasSample sample_atlas(const ConditionedMesh& source, const std::vector<Material>& source_materials,
                         const std::vector<Image>& source_images, const NestedScales& scales,
                         const std::vector<Material>& materials, const std::vector<Image>& images,
                         const RunContext& context);

/// The same with proxies, which plans show where they look better.
AtlasSample with_proxies(AtlasSample sample, const Proxies& proxies);

/// Whether new charts are worth the source's coefficients that they cost, and why: for a note.
struct AtlasChoice {
  bool rebuild = false;
  std::string why;
};
AtlasChoice choose_atlas(const AtlasSample& kept, const AtlasSample& rebuilt);

}  // namespace texmesh
