#pragma once

#include "format/model/model.h"
#include "stages/base/run_context.h"
#include "stages/image/decode_image.h"

namespace texmesh {

// What a source keeps in two images and a glTF material wants in the channels of one. The larger size of two
// counts; the other image is sampled at the nearest texel. All add a PNG to model.images, where no equal one
// stands yet, and return its index. Throw InputError when an image does not decode.

/// `colour` with the first channel of `alpha` (its alpha where it has one that is used) as its alpha.
std::int32_t combine_alpha(Model& model, std::int32_t colour, std::int32_t alpha);

/// Roughness in green, metallic in blue, as glTF has them; -1 = 1 everywhere.
std::int32_t combine_roughness_metallic(Model& model, std::int32_t roughness, std::int32_t metallic);

/// A point of the specular-glossiness model (KHR_materials_pbrSpecularGlossiness); linear light, 0..1.
struct SpecularGlossiness {
  Vec3f diffuse{1, 1, 1}, specular{1, 1, 1};
  float glossiness = 1;
};

/// The same point of the metallic-roughness model; linear light, 0..1.
struct MetallicRoughness {
  Vec3f base_colour;
  float metallic = 0, roughness = 0;
};

/// The metal and the colour whose diffuse and specular parts come nearest to the given ones, with 0.04 as
/// what dielectrics reflect. The equation is that of Khronos' own examples of the two models. A dielectric
/// that reflects more than 0.04, or in colours, has no equal.
MetallicRoughness metallic_roughness_of(const SpecularGlossiness& point);

/// Textures of the model, by texel in place of `material`'s factors; -1 = none.
struct SpecularGlossinessImages {
  std::int32_t diffuse = -1;   // sRGB, alpha
  std::int32_t specular = -1;  // sRGB specular, alpha = glossiness
};
/// Images of the metallic-roughness model, added to model.images; the factors are multiplied in.
struct MetallicRoughnessImages {
  std::int32_t base_colour = -1, metallic_roughness = -1;
};
/// At least one image must be there. The larger size of two counts; the other image is sampled at the nearest
/// texel. InputError when one does not decode.
MetallicRoughnessImages convert_specular_glossiness(Model& model, const SpecularGlossinessImages& images,
                                                    const SpecularGlossiness& factors);
/// Mean of the texels that triangles of `material` show, times the factors: what stands for a texture that
/// lies elsewhere than the diffuse one. InputError when the image does not decode.
SpecularGlossiness mean_of_specular(const Model& model, const TextureRef& texture, std::size_t material,
                                    const SpecularGlossiness& factors, const RunContext& context);

/// For formats whose materials say nothing of alpha modes (OBJ, PLY, range scans): an opaque material whose
/// base colour has an alpha channel becomes cut-out or blended where texels that its triangles show are not
/// opaque; what no triangle shows decides nothing. A picture that would hide all of it leaves it opaque, with
/// a warning. After finish_model().
void judge_alpha(Model& model, const RunContext& context);

/// `materials`: those whose normal texture is what an MTL calls a bump map, which may be either. Where the
/// texels that triangles show are no normals, the texture is a height map and is left out, with a note.
/// Before finish_model(), which drops pictures that nothing uses.
void judge_bump_maps(Model& model, const std::vector<std::size_t>& materials, const RunContext& context);

}  // namespace texmesh
