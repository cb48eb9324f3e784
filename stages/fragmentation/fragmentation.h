#pragma once

#include "stages/data/conditioned_mesh.h"
#include "stages/data/fragments.h"
#include "stages/data/scale_map.h"
#include "stages/data/stage.h"

namespace texmesh {

inline constexpr int kFragmentationVersion = 7;

struct FragmentationOptions {
  int max_fragments = 256;
  int min_fragment_px = 128;
  Fill fill = Fill::kPushPull;
  bool mips = true;
  static void fields(auto& s, auto&& v) {
    v("max_fragments", s.max_fragments, Range{1, 256}, "most fragments of one texture");
    v("min_fragment_px", s.min_fragment_px, Range{16, 4096},
      "least side of a fragment, where the image allows; 256 instead of the default with ladder.mode "
      "progressive");
    v("fill", s.fill,
      "push-pull = smooth colours where no chart covers the texture; none = the source's texels");
    v("mips", s.mips, "smaller copies of every texture, half by half, for small displays");
  }
};

/// Cuts the images that materials use into planes and fragments (thesis 3.2).
/// - Planes: an image used for several things gives one plane. The role that comes first in TextureRole wins,
///   with a note.
/// - Mips: halves down to, and without, the size of the preview. These are 1/2 and 1/4, and 1/8 where that
///   has more than 32768 texels (the preview may be 1/16 then), each while its longer side has at least 128
///   texels. Below that all of a mip's finest rung is no more than its tables.
/// - Grid: at most max_fragments fragments. Their sides are multiples of 16, and at least min_fragment_px
///   where the image allows.
/// - Coverage: the texels that bilinear sampling of the triangles can touch, conservatively, after the
///   texture's transform and wrap modes. Triangles whose UVs are absent or not finite cover nothing; a note
///   says so.
/// - Surface: each triangle's area in space, spread over fragments by its area on the texture.
/// - Features f_i: positions with ScaleMap::crossing >= i, twins as one, counted once in every fragment in
///   which a corner lies. A corner on the border between two fragments lies where its triangle does.
/// - eta_i (3.1): 0 everywhere at a scale where all covered fragments have the same count.
/// StageError when the scale map or a triangle's material does not fit. Same result for any thread count.
Fragments fragment_textures(const ConditionedMesh& mesh, const std::vector<Material>& materials,
                            const std::vector<Image>& images, const ScaleMap& scale_map,
                            const FragmentationOptions& options, const RunContext& context);

}  // namespace texmesh
