#pragma once
#include <cstdint>
#include <map>
#include <vector>

#include "format/base/box.h"
#include "format/model/model.h"
#include "stages/base/run_context.h"
#include "stages/measure/flip.h"
#include "stages/render/shade.h"

namespace texmesh {

/// A mesh with materials whose slots count one list of textures, that of all meshes that are compared.
struct LitMesh {
  Mesh mesh;
  std::vector<RenderMaterial> materials;
  std::size_t texture_count = 0;
};

/// A square picture that is taken of every mesh.
struct LitCamera {
  RenderCamera camera;
  std::uint32_t side_px = 0;
};

/// `count` directions spread evenly over the sphere around `bounds`, as texmesh render has them.
std::vector<LitCamera> cameras_around(const BoundingSphere& bounds, int count, std::uint32_t side_px);

/// What cameras see of a mesh, worked out once for any number of textures.
class LitViews {
 public:
  /// `mesh` must stay where it is.
  LitViews(const LitMesh& mesh, const std::vector<LitCamera>& cameras, const RunContext& context);
  std::size_t count() const { return views_.size(); }
  std::uint64_t covered_px(std::size_t view) const;
  const Visibility& visibility(std::size_t view) const { return views_[view]; }
  const LitMesh& mesh() const { return *mesh_; }
  Picture picture(std::size_t view, const std::vector<RenderTexture>& textures,
                  const RenderEnvironment& environment, const RunContext& context) const;
  /// One per list of materials, which differ from the mesh's in the textures of their slots alone.
  PictureVariants pictures(std::size_t view, const std::vector<const std::vector<RenderMaterial>*>& materials,
                           const std::vector<RenderTexture>& textures, const RenderEnvironment& environment,
                           const RunContext& context) const;

 private:
  const LitMesh* mesh_;
  std::vector<Visibility> views_;
};

/// Parts of the pictures as they were taken, `per_view` of each view: squares of `side_px` around pixels that
/// show the mesh, spread over all that do. Their pixels are as large as those of the pictures.
std::vector<LitCamera> windows_of(const LitViews& views, int per_view, std::uint32_t side_px);

/// Textures that stand for others, by the place of those in the list.
using OtherTextures = std::map<std::size_t, RenderTexture>;

/// Mean FLIP between lit pictures (stages/render, the studio's light) over the pixels that show the object;
/// all pictures count by the pixels that the reference covers there.
class LitMeter {
 public:
  /// The pictures of `views` with these textures are the reference. `environment` must outlive the meter.
  LitMeter(const LitViews& views, const std::vector<RenderTexture>& textures,
           const RenderEnvironment& environment, const RunContext& context);
  /// 0 = equal. `views` are of the same cameras. Same bits for any number of threads.
  double difference(const LitViews& views, const std::vector<RenderTexture>& textures,
                    const RunContext& context) const;
  /// The same of each of several changes of the textures, all pictures of a view at once.
  std::vector<double> differences(const LitViews& views, const std::vector<RenderTexture>& textures,
                                  std::vector<OtherTextures>&& changes, const RunContext& context) const;

 private:
  const RenderEnvironment& environment_;
  std::vector<FlipPicture> reference_;
  std::vector<double> weights_;  // sum 1, or nothing is seen
};

}  // namespace texmesh
