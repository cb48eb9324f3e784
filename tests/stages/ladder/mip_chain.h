#pragma once
// What tests of the choice of rungs share: a texture, its mip and their ladder.
#include <cstdint>
#include <vector>

#include "stages/base/run_context.h"
#include "stages/image/resize.h"
#include "stages/ladder/choose_rungs.h"
#include "stages/ladder/ladder.h"
#include "stages/previews/previews.h"
#include "tests/support/meshes.h"

namespace texmesh::testing {

/// A full-size plane of 512 x 384 px and its mip, in fragments of 64 px.
struct Chain {
  Fragments fragments;
  std::vector<Pixels> pixels;
  Previews previews() const { return make_previews(fragments, pixels, {}, RunContext{}); }
};

inline Pixels shades(std::uint32_t width, std::uint32_t height, bool noise) {
  Pixels out{width, height, 3, {}};
  Random random{7};
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; ++x)
      for (std::uint32_t c = 0; c < 3; ++c)
        out.data.push_back(static_cast<std::uint8_t>(
            noise ? random.next() & 255 : (x * (c + 1) / 5 + y / 3 + ((x / 64 + y / 48) % 2) * 40) & 255));
  return out;
}

inline TexturePlane plane_of(const Pixels& pixels) {
  TexturePlane plane;
  plane.width_px = pixels.width_px;
  plane.height_px = pixels.height_px;
  plane.fragment_width_px = plane.fragment_height_px = 64;
  plane.columns = pixels.width_px / 64;
  plane.rows = pixels.height_px / 64;
  plane.coverage.assign(std::size_t{pixels.width_px} / 8 * pixels.height_px, 0xff);
  plane.covered_texels.assign(plane.fragment_count(), 64 * 64);
  plane.surface_fraction.assign(plane.fragment_count(), 1.0f / static_cast<float>(plane.fragment_count()));
  return plane;
}

inline Chain make_chain(bool noise, bool with_mip = true) {
  Chain out;
  out.pixels.push_back(shades(512, 384, noise));
  out.fragments.planes.push_back(plane_of(out.pixels[0]));
  if (!with_mip) return out;
  out.pixels.push_back(halved(out.pixels[0], 512, 384, Averaging::kLight));
  out.fragments.planes.push_back(plane_of(out.pixels[1]));
  out.fragments.planes[1].mip = 1;
  return out;
}

inline Ladder encode(const Chain& chain, bool prune, int threads = 1, LadderMode mode = LadderMode::kJpeg) {
  LadderOptions options;
  options.mode = mode;
  options.prune = prune;
  options.normal_rungs = options.rungs;  // as low as those of colours
  RunContext context;
  context.threads = threads;
  return encode_ladder(chain.fragments, chain.pixels, chain.previews(), {}, options, context);
}

inline TextureRungs rungs_of(const Chain& chain, const Ladder& ladder) {
  return measure_rungs(chain.fragments, chain.pixels, ladder.planes, 0, chain.previews().planes[0].file,
                       RunContext{});
}

}  // namespace texmesh::testing
