#pragma once
#include "format/model/model.h"
#include "tools/extract/usdz/crate_writer.h"

namespace texmesh {

/// A material of a layer: a UsdPreviewSurface with its textures.
struct PreviewSurface {
  CrateWriter::Node material = 0;
  /// Texture coordinates that its textures read: the set and its transform; the k-th is the primvar
  /// texcoord_name(k), with v upwards.
  std::vector<std::pair<std::uint8_t, UvTransform>> texcoords;
  bool colours = false;  // it reads displayColor
};

/// "st", "st1", ...
std::string texcoord_name(std::size_t k);

/// Why a UsdPreviewSurface cannot say a material; "" where it can.
std::string unsaid_by_preview_surface(const Material& material);

/// Adds a material that has nothing unsaid. `paths`: of images, by number. `colours`: of vertices; they stand
/// for the base colour's texture.
PreviewSurface add_preview_surface(CrateWriter& crate, CrateWriter::Node scope, const std::string& name,
                                   const Material& material, bool colours,
                                   const std::vector<std::string>& paths);

}  // namespace texmesh
