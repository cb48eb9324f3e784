#pragma once
#include "format/model/model.h"
#include "stages/base/run_context.h"

namespace texmesh {

/// For formats whose materials say nothing of alpha modes (OBJ, PLY, range scans): an opaque material whose
/// base colour has an alpha channel becomes cut-out or blended where texels that its triangles show are not
/// opaque; what no triangle shows decides nothing. A picture that would hide all of it leaves it opaque, with
/// a warning. After finish_model().
void judge_alpha(Model& model, const RunContext& context);

/// `materials`: those whose normal texture is what an MTL calls a bump map, which may be either. Where the
/// texels that triangles show are no normals, the texture is a height map and is left out, with a note.
/// Before finish_model(), which drops pictures that nothing uses.
void judge_bump_maps(Model& model, const std::vector<std::size_t>& materials, const RunContext& context);

/// Which texels of a picture of this size triangles of the material show, row by row. All of them where none
/// can be told: no triangle shows one, or the mesh has no such coordinates.
std::vector<bool> seen_texels(const Model& model, std::size_t material, const TextureRef& texture,
                              std::uint32_t width_px, std::uint32_t height_px, const RunContext& context);

}  // namespace texmesh
