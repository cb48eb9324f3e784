#pragma once
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>
#include <string>
#include <vector>

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
// jpeglib.h needs size_t and FILE.
#include <jpeglib.h>

namespace texmesh::testing {

/// Encodes `samples` (rows top first, interleaved) with OpenImageIO's writer `writer` ("png", "jpeg", "tiff",
/// "webp", "openexr", "bmp", "targa", "gif", "jpeg2000", "hdr"). `type` is the type of the samples and of the
/// file.
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
  // The name says which of its kinds a writer takes. (JP2: of 64 x 64 texels or more.)
  const std::string name = writer == "jpeg2000" ? "x.jp2" : writer;
  if (!output->open(name, spec) || !output->write_image(type, samples.data()) || !output->close())
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

/// One colour, as inks; `adobe` with Adobe's marker, which says that 255 - ink is stored.
inline std::vector<std::uint8_t> cmyk_jpeg(unsigned width, unsigned height,
                                           const std::array<std::uint8_t, 4>& inks, bool adobe) {
  jpeg_compress_struct info{};
  jpeg_error_mgr errors{};
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* memory = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&info, &memory, &size);
  info.image_width = width, info.image_height = height;
  info.input_components = 4, info.in_color_space = JCS_CMYK;
  jpeg_set_defaults(&info);
  jpeg_set_quality(&info, 100, TRUE);
  info.write_Adobe_marker = adobe;
  jpeg_start_compress(&info, TRUE);
  std::vector<std::uint8_t> row;
  for (unsigned x = 0; x < width; ++x)
    for (const std::uint8_t ink : inks) row.push_back(adobe ? static_cast<std::uint8_t>(255 - ink) : ink);
  JSAMPROW rows[1] = {row.data()};
  for (unsigned y = 0; y < height; ++y) jpeg_write_scanlines(&info, rows, 1);
  jpeg_finish_compress(&info);
  jpeg_destroy_compress(&info);
  std::vector<std::uint8_t> bytes(memory, memory + size);
  std::free(memory);
  return bytes;
}

}  // namespace texmesh::testing
