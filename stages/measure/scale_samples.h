#pragma once
// Inside stages only: samples of a coarser image as a client scales them up.
#include <cstdint>
#include <vector>

#include "stages/data/fragments.h"
#include "stages/measure/fragment_meter.h"

namespace texmesh {

/// Where a texel lies between two texels of a coarser image, along one axis.
struct BilinearPlace {
  std::uint32_t first, second, part;  // `part` of 256 of the way from first to second
};

/// The places of `count` texels from `first` on. The axis has `size` texels, the coarser image's
/// `coarse_size`. Texels beyond the axis lie where its last texel does.
std::vector<BilinearPlace> bilinear_places(std::uint32_t first, std::uint32_t count, std::uint32_t size,
                                           std::uint32_t coarse_size);

/// The samples of a rectangle of an image.
struct SamplePatch {
  TexelRectangle rectangle;
  Samples samples;
};

/// Samples of across.size() x down.size() texels, bilinear between those of `patch`, which holds every texel
/// that the places name.
Samples scaled_up(const SamplePatch& patch, const std::vector<BilinearPlace>& across,
                  const std::vector<BilinearPlace>& down);

/// What the plane's distortion is measured on, of its whole preview. `file` is a complete JPEG; FormatError
/// when it is damaged or has more than 2^26 pixels.
SamplePatch preview_samples(const TexturePlane& plane, const std::vector<std::uint8_t>& file);

/// A rectangle of the plane as its preview shows it.
Samples show_preview(const TexturePlane& plane, const SamplePatch& preview, const TexelRectangle& rectangle);

}  // namespace texmesh
