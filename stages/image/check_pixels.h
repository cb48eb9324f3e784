#pragma once
// Inside stages only.

#include "format/base/errors.h"
#include "stages/data/fragments.h"
#include "stages/data/pixels.h"

namespace texmesh {

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
