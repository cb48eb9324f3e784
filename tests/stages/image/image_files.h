#pragma once
// Image files made by hand, for the tests of the decoders.
#include <gtest/gtest.h>
#include <webp/encode.h>

#include <algorithm>
#include <cstdlib>
#include <string>
#include <utility>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "stages/image/decode_image.h"
#include "tests/support/images.h"

namespace texmesh::testing {

inline Image probe(Bytes bytes) { return probe_image("test image", std::move(bytes), {}); }

// The error of `f`, or "" when there is none.
template <class F>
inline std::string error_of(F&& f) {
  try {
    f();
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

inline int largest_difference(const Bytes& a, const Bytes& b) {
  int d = a.size() == b.size() ? 0 : 999;
  for (std::size_t i = 0; i < a.size() && i < b.size(); ++i) d = std::max(d, std::abs(a[i] - b[i]));
  return d;
}

inline void put32(Bytes& bytes, std::size_t at, std::uint32_t big_endian) {
  for (int i = 0; i < 4; ++i)
    bytes[at + static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(big_endian >> (24 - 8 * i));
}

inline std::uint32_t crc32_of(const std::uint8_t* p, std::size_t n) {
  std::uint32_t c = ~0u;
  for (std::size_t i = 0; i < n; ++i) {
    c ^= p[i];
    for (int k = 0; k < 8; ++k) c = c >> 1 ^ (c & 1 ? 0xedb88320u : 0);
  }
  return ~c;
}

// Lossless, with the colours of transparent texels kept.
inline Bytes webp_bytes(int width, int height, int channels, const Bytes& samples) {
  WebPConfig config;
  WebPPicture picture;
  WebPMemoryWriter memory;
  WebPMemoryWriterInit(&memory);
  EXPECT_TRUE(WebPConfigInit(&config) && WebPPictureInit(&picture));
  config.lossless = config.exact = 1;
  picture.use_argb = 1;
  picture.width = width;
  picture.height = height;
  picture.writer = WebPMemoryWrite;
  picture.custom_ptr = &memory;
  EXPECT_TRUE((channels == 4 ? WebPPictureImportRGBA : WebPPictureImportRGB)(&picture, samples.data(),
                                                                             width * channels));
  EXPECT_TRUE(WebPEncode(&config, &picture));
  const Bytes bytes(memory.mem, memory.mem + memory.size);
  WebPPictureFree(&picture);
  WebPMemoryWriterClear(&memory);
  return bytes;
}

// A PNG whose header claims another size, with a right checksum.
inline Bytes png_claiming(std::uint32_t width, std::uint32_t height) {
  Bytes png = png_bytes(8, 8, 3);
  put32(png, 16, width);
  put32(png, 20, height);
  put32(png, 29, crc32_of(png.data() + 12, 17));
  return png;
}

}  // namespace texmesh::testing
