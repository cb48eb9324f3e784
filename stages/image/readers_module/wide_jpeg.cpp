
#include <algorithm>

#include "stages/image/jpeg_segments.h"
#include "stages/image/readers_module/readers.h"

namespace texmesh {

std::optional<WideJpegHeader> read_wide_jpeg_header(const std::string& name, ByteSpan bytes) {
  constexpr std::size_t kFrameBytes = 6;  // precision, height, width, components: T.81, B.2.2
  std::optional<WideJpegHeader> out;
  for_each_jpeg_segment(bytes, [&](std::uint8_t marker, ByteSpan frame) {
    if (!is_jpeg_frame(marker) || frame.size() < kFrameBytes || frame[0] <= 8 || frame[0] > 16 || out) return;
    const auto side = [&](std::size_t at) { return std::uint32_t{frame[at]} << 8 | frame[at + 1]; };
    out = WideJpegHeader{side(3), side(1), frame[5], frame[0]};
  });
  if (out && out->channels != 1 && out->channels != 3)
    throw InputError(name, "JPEG header", "1 or 3 components of " + std::to_string(out->bits) + " bits",
                     std::to_string(out->channels));
  return out;
}

std::vector<std::uint16_t> decode_wide_jpeg(const Image& image) {
  const std::optional<WideJpegHeader> header = read_wide_jpeg_header(image.name, image.bytes);
  if (!header || header->width_px != image.width_px || header->height_px != image.height_px ||
      header->channels != image.channels)
    throw InputError(image.name, "JPEG header", "the size that import had found", "another one");
  // A code of one bit for a block's DC: no Huffman-coded JPEG, progressive ones either, shrinks 64 samples
  // further.
  constexpr std::uint64_t kMostSamplesPerByte = 64 * 8;
  if (std::uint64_t{image.width_px} * image.height_px / kMostSamplesPerByte > image.bytes.size())
    throw InputError(image.name, "JPEG header",
                     "a size that its " + std::to_string(image.bytes.size()) + " bytes can hold",
                     std::to_string(image.width_px) + " x " + std::to_string(image.height_px));
  std::vector<std::uint16_t> samples = module_readers(image.name, "JPEGs of more than 8 bits", "libdcmtk17")
                                           .decode_wide_jpeg(image.name, image.bytes, *header);
  const std::uint32_t most = (1u << header->bits) - 1;
  for (std::uint16_t& sample : samples)
    sample = static_cast<std::uint16_t>((std::min<std::uint32_t>(sample, most) * 65535u + most / 2) / most);
  return samples;
}

}  // namespace texmesh
