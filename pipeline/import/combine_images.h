#pragma once
#include <cstdint>
#include <functional>
#include <string>

#include "format/model/model.h"
#include "stages/image/decode_image.h"

namespace texmesh {

// What a source keeps in two images and a glTF material wants in the channels of one. The larger size of two
// counts; the other image is sampled at the nearest texel. All add a PNG to model.images, where no equal one
// stands yet, and return its index. Throw InputError when an image does not decode.

struct CombinedImage {
  std::int32_t index = -1;  // of Model::images; -1 = one white texel
  FloatEncoding encoding = FloatEncoding::kAsIs;
};
struct ImageTexel {
  const std::uint8_t* channel = nullptr;
  std::uint32_t channels = 0;  // 1 grey, 2 grey + alpha, 3 RGB, 4 RGBA
};
/// `texel` writes `channels` bytes from those of both images at one place.
std::int32_t combine_images(
    Model& model, CombinedImage a, CombinedImage b, std::uint32_t channels,
    const std::function<void(const ImageTexel& a, const ImageTexel& b, std::uint8_t* to)>& texel);

/// `colour` with the first channel of `alpha` (its alpha where it has one that is used) as its alpha.
std::int32_t combine_alpha(Model& model, std::int32_t colour, std::int32_t alpha);

/// Roughness in green, metallic in blue, as glTF has them; -1 = 1 everywhere.
std::int32_t combine_roughness_metallic(Model& model, std::int32_t roughness, std::int32_t metallic);

}  // namespace texmesh
