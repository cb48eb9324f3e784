#include "stages/jpeg/jpeg.h"

#include <string>
#include <utility>

#include "format/base/errors.h"
#include "stages/jpeg/jpeg_coder.h"
#include "stages/jpeg/jpeg_guard.h"

namespace texmesh {
namespace {

// libjpeg decodes a progressive file scan by scan over all its coefficients; a hostile one has thousands of
// empty scans. Encoders write about ten.
constexpr int kMaxScans = 100;

[[noreturn]] void fail(std::string expected, std::string found) {
  throw FormatError("JPEG", "", std::move(expected), std::move(found));
}

struct Decoder {
  jpeg_decompress_struct info{};
  JpegErrors errors;
  jpeg_progress_mgr progress{};

  Decoder() {
    info.err = &errors.base;
    progress.progress_monitor = [](j_common_ptr common) {
      auto* self = reinterpret_cast<j_decompress_ptr>(common);
      if (self->input_scan_number > kMaxScans) {
        self->err->msg_code = 0;
        self->err->error_exit(common);
      }
    };
    if (!jpeg_guarded(errors, [this] { jpeg_create_decompress(&info); })) fail("a decoder", errors.message);
    info.progress = &progress;
  }
  ~Decoder() { jpeg_destroy_decompress(&info); }
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;

  void check(bool ok) const {
    if (ok) return;
    if (info.input_scan_number > kMaxScans) fail("at most " + std::to_string(kMaxScans) + " scans", "more");
    fail("an image that decodes without a warning", errors.message);
  }
};

void check_header(const jpeg_decompress_struct& info, std::uint64_t max_pixels) {
  const std::uint64_t pixels = std::uint64_t{info.image_width} * info.image_height;
  if (pixels > max_pixels)
    fail("at most " + std::to_string(max_pixels) + " pixels",
         std::to_string(info.image_width) + " x " + std::to_string(info.image_height));
  if (info.arith_code) fail("Huffman coding", "arithmetic coding");
  if (info.num_components != 1 && info.num_components != 3)
    fail("1 or 3 channels", std::to_string(info.num_components));
}

Pixels decode(std::span<const std::uint8_t> bytes, std::uint64_t max_pixels, bool luma_only) {
  if (bytes.empty()) fail("SOI", "no bytes");
  Decoder decoder;
  jpeg_decompress_struct& info = decoder.info;
  decoder.check(jpeg_guarded(decoder.errors, [&] {
    jpeg_mem_src(&info, bytes.data(), static_cast<unsigned long>(bytes.size()));
    jpeg_read_header(&info, TRUE);
  }));
  check_header(info, max_pixels);
  const bool has_luma = info.num_components == 1 || info.jpeg_color_space == JCS_YCbCr;
  const bool grey = info.num_components == 1 || (luma_only && has_luma);
  Pixels out;
  out.width_px = info.image_width;
  out.height_px = info.image_height;
  out.channels = grey ? 1 : 3;
  const std::size_t stride = std::size_t{out.width_px} * out.channels;
  out.data.resize(stride * out.height_px);
  decoder.check(jpeg_guarded(decoder.errors, [&] {
    info.out_color_space = grey ? JCS_GRAYSCALE : JCS_RGB;
    info.dct_method = JDCT_ISLOW;
    info.do_fancy_upsampling = TRUE;
    jpeg_start_decompress(&info);
    while (info.output_scanline < info.output_height) {
      JSAMPROW rows[16];
      JDIMENSION count = 0;
      while (count < 16 && info.output_scanline + count < info.output_height) {
        rows[count] = out.data.data() + (std::size_t{info.output_scanline} + count) * stride;
        ++count;
      }
      jpeg_read_scanlines(&info, rows, count);
    }
    jpeg_finish_decompress(&info);
  }));
  if (info.src->bytes_in_buffer != 0)
    fail("EOI at the end", std::to_string(info.src->bytes_in_buffer) + " bytes after it");
  return luma_only && !grey ? luma_of(out) : out;
}

}  // namespace

Pixels decode_jpeg(std::span<const std::uint8_t> bytes, std::uint64_t max_pixels) {
  return decode(bytes, max_pixels, false);
}

Pixels decode_jpeg_luma(std::span<const std::uint8_t> bytes, std::uint64_t max_pixels) {
  return decode(bytes, max_pixels, true);
}

Pixels luma_of(const Pixels& pixels) {
  if (pixels.channels == 1) return pixels;
  Pixels out{pixels.width_px, pixels.height_px, 1, {}};
  out.data.resize(std::size_t{out.width_px} * out.height_px);
  const std::uint8_t* from = pixels.data.data();
  for (std::uint8_t& to : out.data) {  // 0.299, 0.587, 0.114 in 16 bits
    to = static_cast<std::uint8_t>((19595u * from[0] + 38470u * from[1] + 7471u * from[2] + 32768u) >> 16);
    from += pixels.channels;
  }
  return out;
}

std::vector<std::uint8_t> encode_jpeg(const Pixels& pixels, int quality, Subsampling subsampling) {
  const std::size_t stride = std::size_t{pixels.width_px} * pixels.channels;
  if (pixels.data.size() != stride * pixels.height_px)
    throw StageError("jpeg", "pixels", std::to_string(stride * pixels.height_px) + " bytes",
                     std::to_string(pixels.data.size()));
  JpegCoder coder({pixels.channels, quality, subsampling});
  return coder.complete({pixels.data.data(), stride, pixels.width_px, pixels.height_px});
}

}  // namespace texmesh
