#pragma once
#include <cstdint>
#include <string>

#include "format/model/model.h"

namespace texmesh {

// OBJ keeps in several grey images what a glTF material wants in the channels of one. The larger size of two
// counts; the other image is sampled at the nearest texel. Both add a PNG to model.images and return its
// index. Throw InputError when an image does not decode.

/// `colour` with the first channel of `alpha` (its alpha where it has one that is used) as its alpha.
std::int32_t combine_alpha(Model& model, std::int32_t colour, std::int32_t alpha);

/// Roughness in green, metallic in blue, as glTF has them; -1 = 1 everywhere.
std::int32_t combine_roughness_metallic(Model& model, std::int32_t roughness, std::int32_t metallic);

}  // namespace texmesh
