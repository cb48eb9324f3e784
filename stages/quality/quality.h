#pragma once
#include "format/base/note.h"
#include "format/documents/quality_table.h"
#include "stages/data/fragments.h"
#include "stages/data/ladder.h"
#include "stages/data/nested_scales.h"
#include "stages/data/perceptual_values.h"
#include "stages/data/pixels.h"
#include "stages/data/stage.h"

namespace texmesh {

inline constexpr int kQualityVersion = 4;

struct QualityOptions {
  int views = 4;
  int size_px = 192;
  int rung_samples = 4;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("views", s.views, Range{1, 64},
      "directions from which every sample is rendered, spread over the sphere");
    v("size_px", s.size_px, Range{32, 1024}, "side of a rendered view");
    v("rung_samples", s.rung_samples, Range{1, 16}, "rungs that are rendered, spread over the ladder");
  }
};

/// What was measured, and what of the object its pictures do not show.
struct MeasuredQuality {
  QualityTable table;
  Notes notes;
};

/// Renders kept scales x sampled rungs from fixed views with the reference renderer (stages/render), in the
/// studio's light. Compares each picture with that of S_0 and the source's texels, over the pixels that
/// either covers: SSIM of luma (stages/measure/image_compare.h), and FLIP as published
/// (stages/measure/flip.h).
/// - Pictures: perspective, 4 x 4 samples a pixel; the object's bounding sphere fills 0.96 of the side. All
///   maps of the material show that the renderer knows: base colour with alpha, metallic-roughness, normal,
///   occlusion, emission; all of them read with mips, whatever the sampler says.
/// - Where S_0 covers next to nothing of the pictures (a scan and a stray triangle a thousand times its size
///   away), they show the place in which nearly all positions lie, and a warning says what they leave out.
/// - Rungs: `rung_samples` of one plane's ladder, first and last among them, rising; all other planes have
///   the rung whose quality is nearest. The plane is the first that shows, colours before normals before
///   other numbers. Where none shows it is the first of all, and the columns are equal. A model without
///   planes gets one column (rung quality 100).
/// - What shows in no picture at all (a thread thinner than a sample, specks, an alpha of 0 everywhere) has
///   no measured difference: values of 1 and 0, and a warning.
/// StageError when S_0 has no extent. Same bytes for any thread count and machine.
///
/// The pictures are rasterised, not ray-cast by Embree: Embree's kernels take reciprocals by rcpps, whose
/// last bits differ between makers of processors on every instruction set, and a hierarchy per scale costs
/// more than one pass over its triangles.
MeasuredQuality measure_quality(const NestedScales& scales, const PerceptualValues& perceptual,
                                const std::vector<Material>& materials, const Fragments& fragments,
                                const std::vector<Pixels>& pixels, const Ladder& ladder,
                                const QualityOptions& options, const RunContext& context);

}  // namespace texmesh
