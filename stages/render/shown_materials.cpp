#include "stages/render/shown_materials.h"

#include <cstring>
#include <optional>

namespace texmesh {
namespace {

/// A texture that materials read: an image as colours or as plain numbers.
struct ImageUse {
  std::uint32_t image = 0;
  bool srgb = false;
  friend bool operator==(const ImageUse&, const ImageUse&) = default;
};

std::optional<std::size_t> plane_of(const Fragments& fragments, std::uint32_t image, bool alpha,
                                    std::uint32_t mip) {
  for (std::size_t p = 0; p < fragments.planes.size(); ++p) {
    const TexturePlane& plane = fragments.planes[p];
    if (plane.image == image && plane.mip == mip && (plane.role == TextureRole::kAlpha) == alpha) return p;
  }
  return std::nullopt;
}

/// Colours and alpha of one size.
struct PlanePair {
  std::size_t colours = 0;
  std::optional<std::size_t> alpha;
};

/// The coarsest size that has the side; one at which the alpha has a plane, too, where there is an alpha.
PlanePair planes_for(const Fragments& fragments, std::uint32_t image, std::size_t full,
                     std::uint32_t least_side_px) {
  const bool has_alpha = plane_of(fragments, image, true, 0).has_value();
  PlanePair best{full, plane_of(fragments, image, true, 0)};
  for (std::uint32_t mip = 1;; ++mip) {
    const auto colours = plane_of(fragments, image, false, mip);
    if (!colours) return best;
    const TexturePlane& plane = fragments.planes[*colours];
    if (std::max(plane.width_px, plane.height_px) < least_side_px) return best;
    const auto alpha = plane_of(fragments, image, true, mip);
    if (alpha.has_value() == has_alpha) best = {*colours, alpha};
  }
}

/// Writes a plane's texels into channels of the image, from channel `first` on.
void put_plane(const TexturePlane& plane, const Pixels& pixels, std::uint32_t first, std::uint32_t count,
               Pixels& image) {
  if (pixels.width_px < image.width_px || pixels.height_px < image.height_px ||
      pixels.data.size() != std::size_t{pixels.width_px} * pixels.height_px * pixels.channels)
    throw StageError("render", "pixels of image " + std::to_string(plane.image), "as large as their plane",
                     std::to_string(pixels.width_px) + " x " + std::to_string(pixels.height_px));
  for (std::uint32_t y = 0; y < image.height_px; ++y)
    for (std::uint32_t x = 0; x < image.width_px; ++x) {
      const std::uint8_t* from = pixels.at(x, y);
      std::uint8_t* to = image.data.data() + (std::size_t{y} * image.width_px + x) * image.channels + first;
      for (std::uint32_t c = 0; c < count; ++c) to[c] = from[pixels.channels >= 3 ? c : 0];
    }
}

RenderTexture texture_of(const Fragments& fragments, const std::vector<Pixels>& pixels, const ImageUse& use,
                         std::uint32_t least_side_px, const RunContext& context) {
  const std::size_t full = *plane_of(fragments, use.image, false, 0);
  const PlanePair pair = planes_for(fragments, use.image, full, least_side_px);
  const TexturePlane& plane = fragments.planes[pair.colours];
  const std::uint32_t colours = plane.channels >= 3 ? 3 : 1;
  Pixels image{plane.width_px, plane.height_px, colours + (pair.alpha ? 1 : 0), {}};
  image.data.resize(std::size_t{image.width_px} * image.height_px * image.channels);
  put_plane(plane, pixels.at(pair.colours), 0, colours, image);
  if (pair.alpha) put_plane(fragments.planes[*pair.alpha], pixels.at(*pair.alpha), colours, 1, image);
  return render_texture(std::move(image), use.srgb, 0, context);
}

}  // namespace

ShownMaterials shown_materials(const std::vector<Material>& materials, const Fragments& fragments,
                               const std::vector<Pixels>& pixels, const Mesh& mesh,
                               std::uint32_t least_side_px, const RunContext& context) {
  if (pixels.size() != fragments.planes.size())
    throw StageError("render", "planes of pixels", std::to_string(fragments.planes.size()),
                     std::to_string(pixels.size()));
  ShownMaterials out;
  std::vector<ImageUse> uses;
  const auto index_of = [&](const TextureRef& ref, TextureUse use) -> std::int32_t {
    const std::vector<Vec2f>& uv = ref.texcoord == 0 ? mesh.uv0 : mesh.uv1;
    const ImageUse wanted{static_cast<std::uint32_t>(ref.image), is_srgb(use)};
    if (ref.texcoord > 1 || uv.empty() || !plane_of(fragments, wanted.image, false, 0)) return -1;
    const auto found = std::find(uses.begin(), uses.end(), wanted);
    const auto index = static_cast<std::int32_t>(found - uses.begin());
    if (found == uses.end()) uses.push_back(wanted);
    return index;
  };
  for (const Material& m : materials) out.materials.push_back(render_material(m, index_of));
  // The picture is much smaller than textures are. Samplers without mips would show noise.
  for (RenderMaterial& m : out.materials)
    for (TextureSlot& slot : m.textures) slot.min_filter = MinFilter::kTrilinear;
  for (const ImageUse& use : uses)
    out.textures.push_back(texture_of(fragments, pixels, use, least_side_px, context));
  return out;
}

}  // namespace texmesh
