#include "stages/previews/previews.h"

#include "stages/base/parallel.h"
#include "stages/image/pixel_window.h"
#include "stages/image/resize.h"
#include "stages/jpeg/jpeg.h"

namespace texmesh {
namespace {

constexpr std::size_t kPreviewLimitBytes = 16 * 1024;

PlanePreview make_preview(const TexturePlane& plane, const Pixels& pixels, const PreviewOptions& options,
                          const RunContext& context) {
  const Subsampling subsampling = is_colour(plane.role) ? options.subsampling : Subsampling::k444;
  const Averaging kind = averaging_of(plane.role, plane.channels);
  const auto encode = [&](const Pixels& small) {
    return PlanePreview{encode_jpeg(small, options.quality, subsampling), small.width_px, small.height_px};
  };
  const Pixels eighth = eighth_of(pixels, plane.width_px, plane.height_px, kind, context);
  PlanePreview preview = encode(eighth);
  if (preview.file.size() < kPreviewLimitBytes) return preview;
  return encode(halved(eighth, eighth.width_px, eighth.height_px, kind));
}

}  // namespace

Previews make_previews(const Fragments& fragments, const std::vector<Pixels>& pixels,
                       const PreviewOptions& options, const RunContext& context) {
  check_pixels("previews", fragments, pixels);
  RunContext inner = context;
  inner.progress = nullptr;
  Previews previews;
  previews.planes.resize(fragments.planes.size());
  parallel_each(context, fragments.planes.size(), 1, [&](std::size_t p) {
    if (fragments.planes[p].mip == 0)
      previews.planes[p] = make_preview(fragments.planes[p], pixels[p], options, inner);
  });
  context.report(1);
  return previews;
}

}  // namespace texmesh
