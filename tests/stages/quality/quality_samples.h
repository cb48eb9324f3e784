#pragma once
#include <gtest/gtest.h>
#include <algorithm>
#include <cmath>
#include "format/documents/manifest.h"
#include "format/rules/picture_prediction.h"
#include "stages/base/run_context.h"
#include "stages/image/decode_image.h"
#include "stages/image/png_writer.h"
#include "stages/ladder/ladder.h"
#include "stages/lut/lut.h"
#include "stages/previews/previews.h"
#include "stages/quality/quality.h"
#include "stages/zim/zim.h"
#include "tests/support/all_rungs.h"
#include "tests/support/meshes.h"

namespace texmesh::testing {

/// A mesh of one textured material, coarser scales by leaving out vertices of the grid (not nested by
/// collapses; the stage asks for triangles only), a texture of waves and grain, and a ladder made by the real
/// encoder.
struct Sample {
  NestedScales scales;
  PerceptualValues perceptual;
  std::vector<Material> materials{Material{}};
  std::vector<Image> images;
  Fragments fragments;
  std::vector<Pixels> pixels;
  Ladder ladder;
  Previews previews;
  PackageTables tables;
};

// The sheet of n x n quads seen only at every `step`-th row and column.
inline NestedScale every(int n, int step, int number) {
  NestedScale s;
  s.scale = number;
  auto at = [&](int i, int j) { return static_cast<std::uint32_t>(j * (n + 1) + i); };
  for (int j = 0; j < n; j += step)
    for (int i = 0; i < n; i += step) {
      s.triangles.push_back({at(i, j), at(i + step, j), at(i + step, j + step)});
      s.triangles.push_back({at(i, j), at(i + step, j + step), at(i, j + step)});
    }
  s.triangle_source.assign(s.triangles.size(), 0);
  return s;
}

/// The pixels without what pads them to whole fragments.
inline Image image_of(const TexturePlane& plane, const Pixels& pixels) {
  Pixels out{plane.width_px, plane.height_px, pixels.channels, {}};
  for (std::uint32_t y = 0; y < plane.height_px; ++y)
    out.data.insert(out.data.end(), pixels.at(0, y), pixels.at(plane.width_px - 1, y) + pixels.channels);
  return probe_image("texture.png", write_png(out), {});
}

/// What the stages before this one make of planes and pixels, whose images look the same.
inline void encode(Sample& s) {
  const RunContext context;
  s.images.clear();
  for (std::size_t p = 0; p < s.pixels.size(); ++p)
    s.images.push_back(image_of(s.fragments.planes[p], s.pixels[p]));
  s.previews = make_previews(s.fragments, s.pixels, {}, context);
  s.ladder = encode_ladder(s.fragments, s.pixels, s.previews, {}, testing::all_rungs(), context);
  s.tables = build_tables(s.fragments, s.pixels, predict_quality(s.fragments, s.pixels, {}, context),
                          s.ladder, s.previews, {}, context)
                 .tables;
}

inline Sample sample_sheet(bool textured) {
  Sample s;
  constexpr int kQuads = 32;
  s.scales.mesh = testing::sheet(kQuads, 0.2f);
  for (int k = 0; k < 4; ++k) s.scales.scales.push_back(every(kQuads, 1 << k, 3 * k));
  s.perceptual.kept = {1, 1, 0, 1};
  s.perceptual.object_height = 1;
  if (!textured) return s;

  TexturePlane plane;
  plane.width_px = plane.height_px = 256;
  plane.fragment_width_px = plane.fragment_height_px = 128;
  plane.columns = plane.rows = 2;
  plane.coverage.assign(256 * 256 / 8, 0xff);
  plane.covered_texels.assign(4, 128 * 128);
  plane.surface_fraction.assign(4, 0.25f);
  plane.features.assign(4, 1);
  plane.eta.assign(4, 0.5f);
  s.fragments.planes.push_back(plane);
  s.materials[0].base_colour_texture.image = 0;
  Pixels p{256, 256, 3, {}};
  testing::Random random{7};
  for (int y = 0; y < 256; ++y)
    for (int x = 0; x < 256; ++x)
      for (int c = 0; c < 3; ++c)
        p.data.push_back(
            static_cast<std::uint8_t>(90 + 60 * ((x / 8 + y / 12 + c) % 2) + 40 * random.uniform()));
  s.pixels.push_back(std::move(p));
  encode(s);
  return s;
}

inline MeasuredQuality measure_all(const Sample& s, const QualityOptions& options, int threads = 1) {
  RunContext context;
  context.threads = threads;
  return measure_quality(s.scales, s.perceptual, s.materials, s.images, s.fragments, s.pixels, s.ladder,
                         s.previews, s.tables, options, context);
}
/// Small, so that tests are quick.
inline QualityOptions small_options() {
  QualityOptions options;
  options.views = 3;
  options.large_views = 2;
  options.largest_px = 256;
  return options;
}
inline QualityTable measure(const Sample& s) { return measure_all(s, small_options()).table; }

}  // namespace texmesh::testing
