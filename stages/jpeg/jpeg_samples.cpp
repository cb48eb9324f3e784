#include "stages/jpeg/jpeg_samples.h"

#include <cstdint>

namespace texmesh {

void jpeg_samples(const PixelWindow& image, const JpegKind& kind, std::size_t component,
                  std::vector<float>& out) {
  constexpr int kWeights[3][3] = {{19595, 38470, 7471}, {-11059, -21709, 32768}, {32768, -27439, -5329}};
  constexpr int kOffset[3] = {32768 - (128 << 16), 32767, 32767};
  out.resize(std::size_t{image.width_px} * image.height_px);
  const int *m = kWeights[component], offset = kOffset[component];
  float* to = out.data();
  for (std::uint32_t y = 0; y < image.height_px; ++y) {
    const std::uint8_t* p = image.data + y * image.stride_bytes;
    if (kind.channels == 1 || kind.rgb)
      for (std::uint32_t x = 0; x < image.width_px; ++x, p += kind.channels)
        *to++ = static_cast<float>(p[component] - 128);
    else
      for (std::uint32_t x = 0; x < image.width_px; ++x, p += 3)
        *to++ = static_cast<float>((m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + offset) >> 16);
  }
}

}  // namespace texmesh
