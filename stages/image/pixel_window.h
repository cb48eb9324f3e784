#pragma once
#include "format/base/errors.h"
#include "stages/data/fragments.h"
#include "stages/data/pixels.h"

namespace texmesh {

/// Which texels of a window into an image are covered; with an empty mask all are.
struct CoverageWindow {
  CoverageMask mask;                      // of the image: what lies beyond it is not covered
  std::uint32_t left_px = 0, top_px = 0;  // where the window lies in the image, with a mask or without
  /// Whether the texel at (x, y) of the window is covered; only for a mask that is not empty.
  bool covered(std::uint32_t x, std::uint32_t y) const {
    const std::uint32_t u = left_px + x, v = top_px + y;
    return u < mask.width_px && v < mask.height_px && mask.covered(u, v);
  }
};

/// A rectangle of interleaved 8-bit pixels within a larger image.
struct PixelWindow {
  const std::uint8_t* data = nullptr;
  std::size_t stride_bytes = 0;
  std::uint32_t width_px = 0, height_px = 0;
  CoverageWindow coverage{};
};

/// A copy of a part, which lies within the pixels.
inline Pixels cut(const Pixels& pixels, const TexelRectangle& r) {
  Pixels out{r.width_px, r.height_px, pixels.channels, {}};
  for (std::uint32_t y = r.top_px; y < r.bottom_px(); ++y) {
    const std::uint8_t* row = pixels.at(r.left_px, y);
    out.data.insert(out.data.end(), row, row + std::size_t{r.width_px} * pixels.channels);
  }
  return out;
}

/// StageError of `stage` unless every plane has pixels of its channels and of the size of all its fragments,
/// which is what fill_planes() returns.
inline void check_pixels(const char* stage, const Fragments& fragments, const std::vector<Pixels>& pixels) {
  if (pixels.size() != fragments.planes.size())
    throw StageError(stage, "pixels", std::to_string(fragments.planes.size()) + " planes",
                     std::to_string(pixels.size()));
  for (std::size_t p = 0; p < pixels.size(); ++p) {
    const TexturePlane& plane = fragments.planes[p];
    const Pixels& of_plane = pixels[p];
    const std::uint64_t width = std::uint64_t{plane.columns} * plane.fragment_width_px;
    const std::uint64_t height = std::uint64_t{plane.rows} * plane.fragment_height_px;
    const auto size_text = [](std::uint64_t w, std::uint64_t h, std::uint32_t channels) {
      return std::to_string(w) + " x " + std::to_string(h) + " px, " + std::to_string(channels) + " channels";
    };
    if (of_plane.width_px != width || of_plane.height_px != height || of_plane.channels != plane.channels ||
        of_plane.data.size() != width * height * plane.channels)
      throw StageError(stage, "plane " + std::to_string(p) + ": pixels",
                       size_text(width, height, plane.channels),
                       size_text(of_plane.width_px, of_plane.height_px, of_plane.channels) + ", " +
                           std::to_string(of_plane.data.size()) + " bytes");
  }
}

}  // namespace texmesh
