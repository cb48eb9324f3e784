#include "stages/image/decode_png.h"

#include <png.h>

#include <algorithm>
#include <csetjmp>
#include <cstring>
#include <vector>

#include "format/base/bytes.h"
#include "format/base/errors.h"

namespace texmesh {
namespace {

// libpng leaves by longjmp: functions that call it own nothing with a destructor, everything lives here.
struct PngDecoder {
  std::span<const std::uint8_t> bytes;
  std::size_t at = 0;
  png_structp png = nullptr;
  png_infop info = nullptr;
  std::jmp_buf escape;
  char message[200] = "";

  explicit PngDecoder(std::span<const std::uint8_t> b) : bytes(b) {}
  PngDecoder(const PngDecoder&) = delete;
  PngDecoder& operator=(const PngDecoder&) = delete;
  ~PngDecoder() { png_destroy_read_struct(&png, &info, nullptr); }
};

[[noreturn]] void on_error(png_structp png, png_const_charp text) {
  auto* decoder = static_cast<PngDecoder*>(png_get_error_ptr(png));
  std::strncpy(decoder->message, text, sizeof decoder->message - 1);
  std::longjmp(decoder->escape, 1);
}

void on_warning(png_structp, png_const_charp) {}  // odd ancillary chunks: every viewer shows such files

void read_bytes(png_structp png, png_bytep to, std::size_t count) {
  auto* decoder = static_cast<PngDecoder*>(png_get_io_ptr(png));
  if (count > decoder->bytes.size() - decoder->at) png_error(png, "the file ends here");
  std::memcpy(to, decoder->bytes.data() + decoder->at, count);
  decoder->at += count;
}

/// libpng takes the memory that a chunk in front of the pixels claims before it reads it.
bool chunks_fit(ByteSpan png) {
  for (std::size_t at = 8; at + 8 <= png.size();) {
    std::size_t bytes = 0;
    for (std::size_t k = 0; k < 4; ++k) bytes = bytes << 8 | png[at + k];
    if (std::memcmp(png.data() + at + 4, "IDAT", 4) == 0) return true;
    if (bytes > png.size() - at - 8) return false;
    at += 12 + bytes;
  }
  return true;
}

bool open_png(PngDecoder& d) {
  d.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &d, on_error, on_warning);
  if (d.png) d.info = png_create_info_struct(d.png);
  if (!d.info) {
    std::strcpy(d.message, "no memory for libpng");
    return false;
  }
  if (setjmp(d.escape)) return false;
  if (!chunks_fit(d.bytes)) png_error(d.png, "the file ends here");
  png_set_read_fn(d.png, &d, read_bytes);
  // The limits of this library are its caller's; of libpng's own only that of a side would ever be met first.
  png_set_user_limits(d.png, 0x7fffffff, 0x7fffffff);
  constexpr std::size_t kMostUnpacked = 16 << 20;  // of a profile
  png_set_chunk_malloc_max(d.png, std::max(d.bytes.size(), kMostUnpacked));
  png_set_keep_unknown_chunks(d.png, PNG_HANDLE_CHUNK_NEVER, nullptr, 0);
  png_read_info(d.png, d.info);
  png_set_expand(d.png);  // palettes, bits below 8, transparent colours
  if (png_get_bit_depth(d.png, d.info) == 16) png_set_swap(d.png);
  return true;
}

bool start_png(PngDecoder& d) {
  if (setjmp(d.escape)) return false;
  png_set_interlace_handling(d.png);
  png_read_update_info(d.png, d.info);
  return true;
}

bool next_png_row(PngDecoder& d, std::uint8_t* row) {
  if (setjmp(d.escape)) return false;
  png_read_row(d.png, row, nullptr);
  return true;
}

bool finish_png(PngDecoder& d) {
  if (setjmp(d.escape)) return false;
  png_read_end(d.png, nullptr);
  return true;
}

PngHeader png_header_of(const PngDecoder& d) {
  PngHeader h;
  h.width_px = png_get_image_width(d.png, d.info);
  h.height_px = png_get_image_height(d.png, d.info);
  const int type = png_get_color_type(d.png, d.info);
  h.channels = type & PNG_COLOR_MASK_COLOR ? 3 : 1;
  if ((type & PNG_COLOR_MASK_ALPHA) || png_get_valid(d.png, d.info, PNG_INFO_tRNS)) ++h.channels;
  h.bits = png_get_bit_depth(d.png, d.info) == 16 ? 16 : 8;
  h.interlaced = png_get_interlace_type(d.png, d.info) != PNG_INTERLACE_NONE;
  return h;
}

[[noreturn]] void fail_png(const std::string& name, const std::string& place, const PngDecoder& d) {
  throw InputError(name, place, "a PNG that decodes", d.message);
}

std::string row_place(std::uint32_t row, std::uint32_t height) {
  return "row " + std::to_string(row) + " of " + std::to_string(height);
}

/// Deflate shrinks at most 1032-fold. A header that claims more lies about the size, and is refused before
/// memory is taken.
void check_plausible_png(const std::string& name, const PngDecoder& d, const PngHeader& h) {
  const std::uint64_t row_bits =
      std::uint64_t{h.width_px} * png_get_channels(d.png, d.info) * png_get_bit_depth(d.png, d.info);
  if ((row_bits + 7) / 8 * h.height_px / 1032 <= d.bytes.size()) return;
  throw InputError(name, "image header",
                   "a size that its " + std::to_string(d.bytes.size()) + " bytes can hold",
                   std::to_string(h.width_px) + " x " + std::to_string(h.height_px));
}

void decode_png_rows(const std::string& name, PngDecoder& d, const PngHeader& h, std::size_t row_bytes,
                     const std::function<void(const std::uint8_t*)>& row) {
  std::vector<std::uint8_t> buffer(row_bytes);
  for (std::uint32_t y = 0; y < h.height_px; ++y) {
    if (!next_png_row(d, buffer.data())) fail_png(name, row_place(y, h.height_px), d);
    row(buffer.data());
  }
}

/// Seven passes, each over a part of the texels: only the last leaves whole rows.
void decode_interlaced(const std::string& name, PngDecoder& d, const PngHeader& h, std::size_t row_bytes,
                       const std::function<void(const std::uint8_t*)>& row) {
  constexpr int kPasses = 7;
  std::vector<std::uint8_t> buffer(row_bytes * h.height_px);
  for (int pass = 0; pass < kPasses; ++pass)
    for (std::uint32_t y = 0; y < h.height_px; ++y)
      if (!next_png_row(d, buffer.data() + row_bytes * y))
        fail_png(name, "pass " + std::to_string(pass + 1) + ", " + row_place(y, h.height_px), d);
  for (std::uint32_t y = 0; y < h.height_px; ++y) row(buffer.data() + row_bytes * y);
}

}  // namespace

PngHeader read_png_header(const std::string& name, std::span<const std::uint8_t> bytes) {
  PngDecoder d(bytes);
  if (!open_png(d)) fail_png(name, "PNG header", d);
  return png_header_of(d);
}

void decode_png(const std::string& name, std::span<const std::uint8_t> bytes,
                const std::function<void(const std::uint8_t* samples)>& row) {
  PngDecoder d(bytes);
  if (!open_png(d)) fail_png(name, "PNG header", d);
  const PngHeader h = png_header_of(d);
  check_plausible_png(name, d, h);
  if (!start_png(d)) fail_png(name, "PNG header", d);
  const std::size_t row_bytes = png_get_rowbytes(d.png, d.info);
  if (row_bytes != std::size_t{h.width_px} * h.channels * (h.bits / 8))
    throw InputError(name, "PNG header", "rows of its size", std::to_string(row_bytes) + " bytes");
  if (h.interlaced)
    decode_interlaced(name, d, h, row_bytes, row);
  else
    decode_png_rows(name, d, h, row_bytes, row);
  if (!finish_png(d)) fail_png(name, "end of the PNG", d);
}

}  // namespace texmesh
