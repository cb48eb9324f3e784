#pragma once
// Uncompressed TIFFs made by hand.
#include <algorithm>
#include <cstdint>

#include "format/base/bytes.h"

namespace texmesh::testing {

/// An uncompressed little-endian TIFF with its directory before the pixels, in strips of eight rows.
inline Bytes make_tiff(std::uint32_t width, std::uint32_t height, std::uint32_t channels, std::uint32_t bits,
                       std::uint32_t photometric, const Bytes& samples) {
  constexpr std::uint32_t kRows = 8, kShort = 3, kLong = 4;
  const std::uint32_t strips = (height + kRows - 1) / kRows, row = width * channels * bits / 8;
  Bytes out{'I', 'I', 42, 0, 8, 0, 0, 0};
  const auto put = [&out](std::uint32_t value, int bytes) {
    for (int i = 0; i < bytes; ++i) out.push_back(static_cast<std::uint8_t>(value >> 8 * i));
  };
  constexpr std::uint32_t kEntries = 10;
  const std::uint32_t bits_at = 8 + 2 + 12 * kEntries + 4, offsets_at = bits_at + 2 * channels,
                      counts_at = offsets_at + 4 * strips, pixels_at = counts_at + 4 * strips;
  const auto entry = [&](std::uint32_t tag, std::uint32_t type, std::uint32_t count, std::uint32_t value) {
    put(tag, 2), put(type, 2), put(count, 4), put(value, 4);
  };
  put(kEntries, 2);
  entry(256, kLong, 1, width), entry(257, kLong, 1, height);
  entry(258, kShort, channels, channels > 2 ? bits_at : bits * 0x10001);
  entry(259, kShort, 1, 1), entry(262, kShort, 1, photometric);
  entry(273, kLong, strips, strips > 1 ? offsets_at : pixels_at), entry(277, kShort, 1, channels);
  entry(278, kLong, 1, kRows), entry(279, kLong, strips, strips > 1 ? counts_at : row * height);
  entry(284, kShort, 1, 1);
  put(0, 4);
  for (std::uint32_t c = 0; c < channels; ++c) put(bits, 2);
  for (std::uint32_t s = 0; s < strips; ++s) put(pixels_at + s * kRows * row, 4);
  for (std::uint32_t s = 0; s < strips; ++s) put(row * std::min(kRows, height - s * kRows), 4);
  out.insert(out.end(), samples.begin(), samples.end());
  return out;
}

}  // namespace texmesh::testing
