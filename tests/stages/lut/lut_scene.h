#pragma once
#include <cstdint>
#include <vector>

#include "stages/base/run_context.h"
#include "stages/ladder/ladder.h"
#include "stages/lut/lut.h"
#include "stages/previews/previews.h"
#include "stages/zim/zim.h"
#include "tests/support/all_rungs.h"
#include "tests/support/meshes.h"

namespace texmesh::testing {

/// Two planes whose fragments are covered in part, and what the stages before the tables make of them.
struct Scene {
  Fragments fragments;
  std::vector<Pixels> pixels;
  Predictors predictors;
  Ladder ladder;
  Previews previews;
};

inline TexturePlane plane_of(std::uint32_t columns, std::uint32_t rows, std::uint32_t channels) {
  TexturePlane p;
  p.channels = channels;
  p.columns = columns;
  p.rows = rows;
  p.fragment_width_px = 32;
  p.fragment_height_px = 48;
  p.width_px = columns * 32 - 5;
  p.height_px = rows * 48 - 7;
  p.coverage.assign((std::size_t{p.width_px} + 7) / 8 * p.height_px, 0);
  p.covered_texels.assign(p.fragment_count(), 0);
  for (std::uint32_t y = 0; y < p.height_px; ++y)
    for (std::uint32_t x = 0; x < p.width_px; ++x) {
      if (x / 32 == 1 || (x + y) % 11 == 0) continue;  // a column of empty fragments, and holes elsewhere
      p.coverage[(std::size_t{p.width_px} + 7) / 8 * y + x / 8] |= static_cast<std::uint8_t>(0x80 >> x % 8);
      ++p.covered_texels[y / 48 * columns + x / 32];
    }
  for (std::size_t f = 0; f < p.fragment_count(); ++f) {
    p.surface_fraction.push_back(p.covered_texels[f] ? 0.01f * static_cast<float>(f % 3 + 1) : 0);
    p.features.push_back(static_cast<std::uint32_t>(f * 7 % 5));
  }
  p.features.resize(3 * p.fragment_count());
  const float most = 4;
  for (std::uint32_t f : p.features) p.eta.push_back(static_cast<float>(f) / most);
  return p;
}

inline Scene make_scene(LadderOptions ladder_options = testing::all_rungs()) {
  Scene s;
  s.fragments.scales = 2;
  s.fragments.planes = {plane_of(4, 3, 3), plane_of(2, 1, 1)};
  Random random{12};
  for (const TexturePlane& p : s.fragments.planes) {
    Pixels pixels{p.columns * 32, p.rows * 48, p.channels, {}};
    for (std::size_t k = 0; k < std::size_t{pixels.width_px} * pixels.height_px * p.channels; ++k)
      pixels.data.push_back(static_cast<std::uint8_t>(80 + k / 7 % 90 + random.next() % 30));
    s.pixels.push_back(pixels);
  }
  s.predictors = predict_quality(s.fragments, s.pixels, {}, {});
  s.ladder = encode_ladder(s.fragments, s.pixels, {}, {}, ladder_options, {});
  s.previews = make_previews(s.fragments, s.pixels, {}, {});
  return s;
}

inline LutTables build_all(const Scene& s, const LutOptions& options = {}, int threads = 1) {
  RunContext context;
  context.threads = threads;
  return build_tables(s.fragments, s.pixels, s.predictors, s.ladder, s.previews, options, context);
}
inline PackageTables build(const Scene& s, const LutOptions& options = {}) {
  return build_all(s, options).tables;
}
inline PlaneThesis thesis_of(const Scene& s, const LutOptions& options = {}, std::size_t plane = 0) {
  return build_all(s, options).thesis.planes[plane];
}

}  // namespace texmesh::testing
