#include "pipeline/extract/budget/budget_source.h"

#include <algorithm>
#include <cmath>

#include "format/base/box.h"
#include "format/base/bytes.h"
#include "format/container/layout.h"
#include "pipeline/extract/glb/standalone_glb.h"
#include "stages/image/decode_image.h"

namespace texmesh {
namespace {

constexpr int kViews = 5;
constexpr double kBudgetDisplayPx = 512;
constexpr double kReferenceTexels = 8e6;  // of all colours together: finer ones cost memory and show nothing
constexpr double kTexelsPerByte = 40;     // more texels than that are never worth a byte
constexpr std::uint32_t kLeastSide = 4;
constexpr double kWholeBlocks = 16;

double longest_side(const Mesh& mesh) {
  const double side = to_double(bounding_box(mesh.positions)).longest_side();
  return side > 0 ? side : 1;
}

}  // namespace

BudgetSource::BudgetSource(PackageReader& from, const ExtractRequest& wishes, const RunContext& run)
    : package(from),
      request(wishes),
      context(run),
      display_px(wishes.display_px > 0 ? wishes.display_px : kBudgetDisplayPx),
      side_px(static_cast<std::uint32_t>(std::clamp(display_px, 64.0, 768.0))),
      textures(from, std::max(kTexelsPerByte * static_cast<double>(wishes.bytes), 65536.0), run) {
  context.progress = nullptr;
  for (std::size_t i = 0; i < textures.images().size(); ++i)
    (textures.images()[i].colours ? colours : data).push_back(i);
  source = read_model({package.scale_glb(0), mesh_path(0)}, mesh_path(0), context);
  light = normal_samples(source.mesh);
  cameras = cameras_around(source.mesh, kViews);
  extent = longest_side(source.mesh);
  double texels = 0;
  for (const std::size_t i : colours) texels += static_cast<double>(image(i).width_px) * image(i).height_px;
  double share = 1;  // halves, not sharpened: exactly the source's own smaller copies
  while (texels * share * share > kReferenceTexels) share /= 2;
  for (const std::size_t i : colours)
    best_textures[image_name(image(i).image)] = mip_texture(
        textures.texels(i, side_of(image(i).width_px, share), side_of(image(i).height_px, share), {}, 0));
  const ModelViews views(shown(source), cameras, side_px, context);
  const std::vector<Picture> pictures = views.draw(best_textures, context);
  for (const Picture& p : pictures)
    covered_px += static_cast<double>(std::count(p.covered.begin(), p.covered.end(), 1)) / kViews;
  meter = std::make_unique<PictureMeter>(pictures, context);
}

ShownModel shown(const Model& model) {
  ShownModel out{&model.mesh, &model.materials, {}};
  for (const Image& i : model.images) out.image_names.push_back(i.name);
  return out;
}

std::uint32_t side_of(std::uint32_t full, double share) {
  double side = std::floor(static_cast<double>(full) * share + 0.5);
  if (side >= 8 * kWholeBlocks && side < full) side = std::floor(side / kWholeBlocks + 0.5) * kWholeBlocks;
  return static_cast<std::uint32_t>(
      std::clamp(side, std::min<double>(kLeastSide, full), static_cast<double>(full)));
}

MipTexture decoded_texture(const Bytes& file) {
  return mip_texture(decode_image(probe_image("texture", file, {})));
}

}  // namespace texmesh
