#pragma once

#include "format/documents/tables.h"
#include "stages/base/run_context.h"
#include "stages/data/conditioned_mesh.h"
#include "stages/data/fragments.h"
#include "stages/data/ladder.h"
#include "stages/data/pixels.h"
#include "stages/data/previews.h"

namespace texmesh {

/// Thesis 3.3.2, Fig. 3.9: the same bytes spent on one quality everywhere, or by what the fragments show.
struct AllocationStudyOptions {
  int quality = 11;      // of the uniform choice; the nearest rung is taken. Its bytes are everybody's budget
  double width = 40;     // dQ of (3.2); the thesis's own example asks for 50 at the eyes where others have 10
  int views = 6;         // directions from which the scores are taken
  int picture_view = 0;  // the one that is shown
  int size_px = 512;     // side of a view
};

struct StudiedChoice {
  std::string name;         // "source", "uniform", "variable (3.2)", "variable (log)", "rate-distortion"
  std::uint64_t bytes = 0;  // of the fragments' streams of all base-colour planes
  std::size_t fragments = 0, skipped = 0;
  // Of fragments that are not skipped:
  int lowest_quality = 0, highest_quality = 0;
  double mean_quality = 0;
  double surface_ssim = 1;          // 1 - surface-weighted (1 - SSIM), from the tables
  double ssim = 1, difference = 0;  // SSIM of luma, FLIP: of the lit views, means over pixels
  Pixels picture;                   // sRGB, size_px x size_px
};

/// Renders S_0 with each choice's textures. `tables`, `ladder`, `previews` and `pixels` are those of
/// `fragments`. Variable choices take the highest Q_i whose bytes fit the budget, Gamma = mean eta of scale
/// 0, and spend what is left on one rung more of the fragments with the highest eta, until nothing fits;
/// rate-distortion spends the budget over all base-colour planes at once and may skip fragments, which then
/// show the preview. Throws StageError when no base colour has a texture. Same result for any thread count.
std::vector<StudiedChoice> study_allocation(const ConditionedMesh& mesh,
                                            const std::vector<Material>& materials,
                                            const Fragments& fragments, const std::vector<Pixels>& pixels,
                                            const Ladder& ladder, const Previews& previews,
                                            const PackageTables& tables,
                                            const AllocationStudyOptions& options, const RunContext& context);

/// What these rungs, [plane][fragment], come to by the planes' tables: no name, and nothing rendered.
StudiedChoice described(const std::vector<const PlaneTables*>& tables,
                        const std::vector<std::vector<std::int16_t>>& rungs);

/// A preview as it stands for a plane of this size: bilinear, grey in each of several channels.
Pixels enlarged_preview(const Pixels& preview, std::uint32_t width_px, std::uint32_t height_px,
                        std::uint32_t channels);

/// The pictures of some choices of one study, from left to right.
Pixels side_by_side(const std::vector<const StudiedChoice*>& choices);

}  // namespace texmesh
