#include "stages/image/png_writer.h"

#include <zlib.h>

#include <cstdlib>
#include <string_view>

#include "format/base/errors.h"

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

}  // namespace texmesh
