#include "stages/jpeg/jpeg.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>

#include <jpeglib.h>

#include "format/base/errors.h"
#include "tests/support/made_texture.h"

namespace texmesh::jpeg_test {

using testing::made_texture;

TEST(Jpeg, RefusesWhatIsNoImageOrTooLarge) {
  const Pixels image = made_texture(32);
  auto bytes = encode_jpeg(image, 50, Subsampling::k420);
  EXPECT_NO_THROW(decode_jpeg(bytes, 32 * 32));
  EXPECT_THROW(decode_jpeg(bytes, 32 * 32 - 1), FormatError);
  bytes.push_back(0);
  EXPECT_THROW(decode_jpeg(bytes, 1 << 20), FormatError);
  bytes.pop_back();
  // No flipped byte may crash, and what decodes has the size that was asked for.
  for (std::size_t n = 0; n < bytes.size(); ++n) {
    auto damaged = bytes;
    damaged[n] ^= static_cast<std::uint8_t>(1 + n % 255);
    try {
      const Pixels got = decode_jpeg(damaged, 1 << 16);
      EXPECT_EQ(got.data.size(), std::size_t{got.width_px} * got.height_px * got.channels);
    } catch (const FormatError&) {
    }
  }
  EXPECT_THROW(encode_jpeg(Pixels{2, 2, 2, std::vector<std::uint8_t>(8)}, 50, Subsampling::k420), StageError);
  EXPECT_THROW(encode_jpeg(Pixels{0, 0, 3, {}}, 50, Subsampling::k420), StageError);
  EXPECT_THROW(encode_jpeg(Pixels{2, 2, 3, {}}, 50, Subsampling::k420), StageError);
}

enum class Coding { kBaseline, kProgressive, kManyScans, kArithmetic, kCmyk };

/// Files that our own encoder never writes.
std::vector<std::uint8_t> foreign_jpeg(const Pixels& pixels, Coding coding) {
  jpeg_compress_struct info;
  jpeg_error_mgr errors;
  info.err = jpeg_std_error(&errors);
  jpeg_create_compress(&info);
  unsigned char* data = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&info, &data, &size);
  info.image_width = pixels.width_px;
  info.image_height = pixels.height_px;
  info.input_components = static_cast<int>(pixels.channels);
  info.in_color_space = coding == Coding::kCmyk ? JCS_CMYK : JCS_RGB;
  jpeg_set_defaults(&info);
  jpeg_set_quality(&info, 70, TRUE);
  std::vector<jpeg_scan_info> scans;
  if (coding == Coding::kProgressive) jpeg_simple_progression(&info);
  if (coding == Coding::kArithmetic) info.arith_code = TRUE;
  if (coding == Coding::kManyScans) {
    scans.push_back({3, {0, 1, 2}, 0, 0, 0, 0});
    for (int component = 0; component < 3; ++component)
      for (int k = 1; k < 64; ++k) scans.push_back({1, {component}, k, k, 0, 0});
    info.scan_info = scans.data();
    info.num_scans = static_cast<int>(scans.size());
  }
  jpeg_start_compress(&info, TRUE);
  while (info.next_scanline < info.image_height) {
    JSAMPROW row = const_cast<JSAMPROW>(pixels.at(0, info.next_scanline));
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  jpeg_destroy_compress(&info);
  const std::vector<std::uint8_t> out(data, data + size);
  std::free(data);
  return out;
}

TEST(Jpeg, ReadsBaselineAndProgressiveAndRefusesOtherKinds) {
  const Pixels image = made_texture(64);
  const Pixels baseline = decode_jpeg(foreign_jpeg(image, Coding::kBaseline), 1 << 16);
  EXPECT_TRUE(decode_jpeg(foreign_jpeg(image, Coding::kProgressive), 1 << 16).data == baseline.data);
  EXPECT_THROW(decode_jpeg(foreign_jpeg(image, Coding::kManyScans), 1 << 16), FormatError);
  EXPECT_THROW(decode_jpeg(foreign_jpeg(image, Coding::kArithmetic), 1 << 16), FormatError);
  const Pixels four{8, 8, 4, std::vector<std::uint8_t>(256, 9)};
  EXPECT_THROW(decode_jpeg(foreign_jpeg(four, Coding::kCmyk), 1 << 16), FormatError);
}

TEST(Jpeg, LumaIsTheGreyOfTheColours) {
  const Pixels image = made_texture(64);
  const auto bytes = encode_jpeg(image, 90, Subsampling::k420);
  const Pixels colour = decode_jpeg(bytes, 1 << 16), luma = decode_jpeg_luma(bytes, 1 << 16);
  ASSERT_EQ(luma.channels, 1u);
  for (std::size_t k = 0; k < luma.data.size(); ++k) {
    const double y =
        0.299 * colour.data[3 * k] + 0.587 * colour.data[3 * k + 1] + 0.114 * colour.data[3 * k + 2];
    EXPECT_NEAR(luma.data[k], y, 2.5);  // colours were rounded, and clipped where out of range
  }
}

}  // namespace texmesh::jpeg_test
