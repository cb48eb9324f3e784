#pragma once
#include <vector>

#include "format/model/model.h"
#include "stages/data/fragments.h"
#include "stages/data/previews.h"

namespace texmesh {
class GlbWriter;

/// One preview image of a GLB, made once for all scales.
struct PreviewImage {
  std::uint32_t image = 0;  // source image: named "texture/<image>"
  std::uint32_t plane = 0;  // whose preview it is, preview/PPP.jpg; a PNG is no entry
  const char* mime_type = "";
  std::vector<std::uint8_t> bytes;
};

/// Per source image that has planes: the colour plane's preview, or a PNG with alpha where an alpha plane
/// stands beside it.
std::vector<PreviewImage> preview_images(const Fragments& fragments, const Previews& previews);

/// kEmbedded: within the file. kRelative: previews by their place in the package's tree, ../preview/PPP.jpg;
/// what is no entry of the package is embedded.
enum class PreviewForm : std::uint8_t { kEmbedded, kRelative };

/// Materials, textures, samplers and images of the document. Textures whose texture coordinates or previews
/// do not exist are left out. Factors are clipped to the ranges of glTF.
void write_materials(GlbWriter& writer, const std::vector<Material>& materials,
                     const std::vector<PreviewImage>& previews, PreviewForm form, bool has_uv0, bool has_uv1);

}  // namespace texmesh
