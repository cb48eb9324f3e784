#pragma once

#include "tools/render/rendered_model.h"

namespace texmesh {

/// Which textures of a package.
enum class PackageTextures : std::uint8_t {
  kRung,     // put together from their fragments at one rung
  kPreview,  // the small JPEGs of the first picture
  kSource    // the source images where the package keeps them, else the best rung
};

/// What of a package is shown.
struct PackageChoice {
  int scale = 0;
  PackageTextures textures = PackageTextures::kRung;
  std::uint32_t rung = kBestRung;  // with kRung; planes with fewer rungs show their best
};

/// A scale of a package with whole textures, for the renderer. `bounds` are those of S_0 for every scale, so
/// that a camera sees all scales alike. InputError for a scale or rung that is not there; FormatError when
/// the package is damaged. Same result for any thread count.
/// `texture_images` count the images of textures.json.
RenderedModel package_model(PackageReader& package, const PackageChoice& choice, const RunContext& context);

/// Mesh and materials of a scale; `textures` stays empty, `bounds` are its own. Else as package_model().
RenderedModel bare_scale(PackageReader& package, int scale, const RunContext& context);

/// Another scale for the textures of `textured`, a package_model() or bare_scale() of another: its materials
/// count these, and its own list of textures stays empty. A texture that `textured` does not have is not
/// shown. Bounds and errors as package_model().
RenderedModel package_scale(PackageReader& package, int scale, const RenderedModel& textured,
                            const RunContext& context);

/// A proxy, which has textures of its own. `bounds` are the proxy's. InputError for a proxy that is not
/// there; FormatError when the package is damaged. Same result for any thread count.
RenderedModel package_proxy(PackageReader& package, std::uint32_t proxy, const RunContext& context);

}  // namespace texmesh
