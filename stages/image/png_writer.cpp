#include "stages/image/png_writer.h"

#include <png.h>
#include <zlib.h>

#include <algorithm>
#include <csetjmp>
#include <cstdlib>

#include "format/base/bytes.h"

namespace texmesh {
namespace {

void put_u32(std::vector<std::uint8_t>& out, std::uint32_t x) {
  for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<std::uint8_t>(x >> shift));
}

void put_chunk(std::vector<std::uint8_t>& out, std::string_view type, const std::vector<std::uint8_t>& data) {
  put_u32(out, static_cast<std::uint32_t>(data.size()));
  const std::size_t begin = out.size();
  out.insert(out.end(), type.begin(), type.end());
  out.insert(out.end(), data.begin(), data.end());
  put_u32(out,
          static_cast<std::uint32_t>(crc32(0, out.data() + begin, static_cast<uInt>(out.size() - begin))));
}

int paeth(int left, int up, int corner) {
  const int p = left + up - corner, a = std::abs(p - left), b = std::abs(p - up), c = std::abs(p - corner);
  return a <= b && a <= c ? left : b <= c ? up : corner;
}

std::vector<std::uint8_t> filter_row(const Pixels& image, std::uint32_t y, int filter) {
  const std::size_t step = image.channels, n = image.width_px * step;
  const std::uint8_t* row = image.data.data() + y * n;
  const std::uint8_t* above = y > 0 ? row - n : nullptr;
  std::vector<std::uint8_t> out(n + 1);
  out[0] = static_cast<std::uint8_t>(filter);
  for (std::size_t i = 0; i < n; ++i) {
    const int left = i >= step ? row[i - step] : 0, up = above ? above[i] : 0;
    const int corner = above && i >= step ? above[i - step] : 0;
    const int guess[5] = {0, left, up, (left + up) / 2, paeth(left, up, corner)};
    out[i + 1] = static_cast<std::uint8_t>(row[i] - guess[filter]);
  }
  return out;
}

long cost(const std::vector<std::uint8_t>& row) {
  long sum = 0;
  for (std::size_t i = 1; i < row.size(); ++i)
    sum += std::abs(static_cast<int>(static_cast<std::int8_t>(row[i])));
  return sum;
}

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

std::vector<std::uint8_t> write_png(const Pixels& image, const PngOptions& options) {
  const std::uint32_t channels = image.channels;
  if (image.width_px == 0 || image.height_px == 0 || (channels != 1 && channels != 3 && channels != 4))
    throw StageError("png", "image", "1, 3 or 4 channels and at least one pixel",
                     std::to_string(channels) + " channels");
  std::vector<std::uint8_t> rows;
  for (std::uint32_t y = 0; y < image.height_px; ++y) {
    std::vector<std::uint8_t> best = filter_row(image, y, 0);
    for (int filter = 1; filter < 5; ++filter) {
      std::vector<std::uint8_t> row = filter_row(image, y, filter);
      if (cost(row) < cost(best)) best = std::move(row);
    }
    rows.insert(rows.end(), best.begin(), best.end());
  }
  uLongf size = compressBound(static_cast<uLong>(rows.size()));
  std::vector<std::uint8_t> packed(size);
  if (compress2(packed.data(), &size, rows.data(), static_cast<uLong>(rows.size()), options.level) != Z_OK)
    throw StageError("png", "deflate", "a compressed stream", "an error");
  packed.resize(size);
  std::vector<std::uint8_t> header;
  put_u32(header, image.width_px);
  put_u32(header, image.height_px);
  header.insert(header.end(), {8,
                               static_cast<std::uint8_t>(channels == 1   ? 0
                                                         : channels == 3 ? 2
                                                                         : 6),
                               0, 0, 0});
  std::vector<std::uint8_t> out{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  put_chunk(out, "IHDR", header);
  if (options.linear) put_chunk(out, "gAMA", {0, 1, 0x86, 0xa0});  // 100,000 / 100,000
  put_chunk(out, "IDAT", packed);
  put_chunk(out, "IEND", {});
  return out;
}

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
