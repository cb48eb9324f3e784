#pragma once
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "format/model/model.h"
#include "stages/base/run_context.h"
#include "stages/data/pixels.h"
#include "stages/measure/flip.h"
#include "stages/measure/render_view.h"

namespace texmesh {

/// What a model shows: its mesh, and the texels of its images by Image::name (colours, sRGB encoded).
struct ShownModel {
  const Mesh* mesh = nullptr;
  const std::vector<Material>* materials = nullptr;
  std::vector<std::string> image_names;  // by Material's image index
};

/// The views of a model with everything worked out that does not depend on texels: orthographic, directions
/// spread over the sphere, base colour x vertex colour x texture under a head-light plus emission.
/// Textures are filtered trilinearly. Normal and data maps do not show, unlike in the pictures of the
/// quality stage.
class ModelViews {
 public:
  /// `cameras` and `side_px` of all models that are to be compared must be the same.
  ModelViews(const ShownModel& model, const std::vector<ViewCamera>& cameras, std::uint32_t side_px,
             const RunContext& context);
  /// The pictures with these textures by image name; an image that is not there is white.
  std::vector<Picture> draw(const std::map<std::string, MipTexture>& textures,
                            const RunContext& context) const;

 private:
  struct Sample {
    std::uint32_t pixel = 0;
    std::int32_t image = -1;  // index into names_
    Vec2f uv;
    float area = 0;  // footprint, share of the image
    Vec3f factor;
    bool repeat_s = true, repeat_t = true;
  };
  struct View {
    std::vector<Sample> samples;
    std::vector<std::uint8_t> hits;
  };
  void add_view(const ViewBuffer& buffer, View& view) const;
  std::uint32_t side_px_ = 0;
  std::vector<std::string> names_;
  std::vector<View> views_;
};

/// Prefiltered, from sRGB encoded texels of 1, 3 or 4 channels (alpha is left out).
MipTexture mip_texture(const Pixels& pixels);

/// `count` cameras around a mesh's bounding sphere. Not those of the quality stage: `count` differs.
std::vector<ViewCamera> cameras_around(const Mesh& mesh, int count);

/// Mean FLIP over views, each weighted by its covered pixels alike.
class PictureMeter {
 public:
  PictureMeter(const std::vector<Picture>& reference, const RunContext& context);
  double difference(const std::vector<Picture>& test, const RunContext& context) const;

 private:
  std::vector<FlipPicture> reference_;
};

}  // namespace texmesh
