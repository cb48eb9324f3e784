#pragma once
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

namespace texmesh::testing {

/// Encodes `samples` (rows top first, interleaved) with OpenImageIO's writer `writer` ("png", "jpeg", "tiff",
/// "webp", "openexr"). `type` is the type of the samples and of the file.
template <class T>
std::vector<std::uint8_t> encode_image(const std::string& writer, int width, int height, int channels,
                                       const std::vector<T>& samples, OIIO::TypeDesc type,
                                       const OIIO::ImageSpec& attributes = {}) {
  OIIO::ImageSpec spec(width, height, channels, type);
  spec.extra_attribs = attributes.extra_attribs;
  std::vector<unsigned char> bytes;
  OIIO::Filesystem::IOVecOutput memory(bytes);
  auto output = OIIO::ImageOutput::create(writer);
  if (!output || !output->supports("ioproxy")) throw std::runtime_error(writer + ": no writer to memory");
  output->set_ioproxy(&memory);
  if (!output->open(writer, spec) || !output->write_image(type, samples.data()) || !output->close())
    throw std::runtime_error(writer + ": " + output->geterror());
  return {bytes.begin(), bytes.end()};
}

/// A smooth picture with some detail, deterministic.
inline std::vector<std::uint8_t> test_picture(int width, int height, int channels) {
  std::vector<std::uint8_t> samples;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < channels; ++c)
        samples.push_back(static_cast<std::uint8_t>((x * 3 + y * 5 * (c + 1) + (x * y >> 4)) & 255));
  return samples;
}

inline std::vector<std::uint8_t> png_bytes(int width, int height, int channels) {
  return encode_image("png", width, height, channels, test_picture(width, height, channels),
                      OIIO::TypeDesc::UINT8);
}
inline std::vector<std::uint8_t> jpeg_bytes(int width, int height, int channels) {
  return encode_image("jpeg", width, height, channels, test_picture(width, height, channels),
                      OIIO::TypeDesc::UINT8);
}

}  // namespace texmesh::testing
