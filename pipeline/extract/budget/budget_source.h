#pragma once
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/extract/budget/picture_meter.h"
#include "pipeline/extract/glb/draco_recode.h"
#include "pipeline/extract/glb/extracted.h"
#include "pipeline/extract/glb/scale_model.h"
#include "pipeline/extract/glb/texture_source.h"

namespace texmesh {

using ImageTextures = std::map<std::string, MipTexture>;  // by image_name()

/// What all files of one search have in common: the package's best in pictures, which they are compared with,
/// and its textures. For .cpp files of this folder.
struct BudgetSource {
  BudgetSource(PackageReader& package, const ExtractRequest& request, const RunContext& context);

  /// FLIP between the best and a model with these textures.
  double difference(const ModelViews& views, const ImageTextures& with) const {
    return meter->difference(views.draw(with, context), context);
  }
  const PackageImage& image(std::size_t index) const { return textures.images()[index]; }

  PackageReader& package;
  ExtractRequest request;
  RunContext context;
  double display_px = 0;
  std::uint32_t side_px = 0;               // of the pictures
  TextureSource textures;                  // of the package's best rungs
  std::vector<std::size_t> colours, data;  // indices into textures.images()
  Model source;                            // S_0
  double extent = 1;                       // longest side of its box
  NormalSamples light;                     // of S_0, which coarser scales are lit as
  std::vector<ViewCamera> cameras;
  ImageTextures best_textures;
  double covered_px = 0;  // of a picture, on average
  std::unique_ptr<PictureMeter> meter;
};

ShownModel shown(const Model& model);

/// A side of a texture made smaller. Of 128 px and more a multiple of 16, so that viewers can halve it
/// several times: smaller copies of odd sizes lie beside their place.
std::uint32_t side_of(std::uint32_t full, double share);

MipTexture decoded_texture(const std::vector<std::uint8_t>& file);

}  // namespace texmesh
