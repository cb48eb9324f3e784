#pragma once

#include "delivery/cpp/client/delivery_plan.h"
#include "stages/measure/flip.h"
#include "stages/render/shade.h"
#include "tools/render/rendered_model.h"

namespace texmesh {

/// What a client shows of a package: a scale, and a plane for each texture, with the rung of every fragment
/// row by row; -1 = as the preview shows it. Or a proxy, instead of all that.
struct ShownPlane {
  PlaneChoice choice;
  std::vector<std::int32_t> rungs;
};
struct ShownPackage {
  int scale = 0;
  std::vector<ShownPlane> planes;
  std::optional<std::uint32_t> proxy = {};
};
/// `list` is the one that the plan is about.
ShownPackage shown_by(PackageReader& package, const DeliveryPlan& plan, const FragmentList& list);

/// Mean FLIP of lit pictures against S_0 with the source's texels, over all covered pixels of all views.
struct RenderedFlip {
  double whole = 0;
  double geometry = 0;  // of the scale with the source's texels; 0 for a proxy, and for a rebuilt atlas
  double textures = 0;  // of S_0 with the textures that are shown; for a proxy the same as `whole`
};

/// A plane as a client shows it: each fragment at its rung, row by row; -1, and what is not stored = as the
/// preview of the full-size plane `base`, scaled up bilinearly. Errors as read_plane(), but for its size;
/// std::invalid_argument for another number of rungs. Same result for any thread count.
Pixels read_shown_plane(PackageReader& package, std::uint32_t base, std::uint32_t plane,
                        std::span<const std::int32_t> rungs, const RunContext& context);

/// Renders what clients would show of a package, and compares it with the source: the truth that quality.json
/// predicts. Same result for any thread count.
class PlanPictures {
 public:
  /// `source`: the model file that the package was made from, for its texels; "" = the package's best rungs
  /// stand for the source. Where the package has an atlas of its own the model itself stands for it.
  /// `views` >= 1 from directions spread over the sphere. InputError where the source has other images.
  PlanPictures(PackageReader& package, const std::string& source, int views, const RunContext& context);
  /// At exactly that displayed height of the object, px. InputError for a proxy that is not there.
  RenderedFlip measure(const ShownPackage& shown, double displayed_px);

 private:
  struct Place {
    RenderCamera camera;
    std::uint32_t side_px = 0;
  };
  struct Reference {
    Place place;
    Visibility seen;
    FlipPicture flip;
  };
  Place place(int view, double displayed_px) const;
  const RenderedModel& scale(int scale);
  std::vector<RenderTexture> textures_of(const ShownPackage& shown);
  RenderedFlip measure_proxy(std::uint32_t proxy, double displayed_px);
  const std::vector<Reference>& references(double displayed_px);

  PackageReader& package_;
  int views_;
  RunContext context_;
  RenderEnvironment environment_;
  RenderedModel finest_;
  std::vector<RenderTexture> source_;    // as S_0 counts textures
  std::optional<RenderedModel> model_;   // the source of a package with an atlas of its own
  std::map<int, RenderedModel> scales_;  // but S_0, with its textures
  double referenced_px_ = 0;
  std::vector<Reference> references_;  // of that height
};

}  // namespace texmesh
