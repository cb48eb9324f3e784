#pragma once
// Khronos KTX 2.0 files made by code.
#include <zstd.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "format/base/bytes.h"

namespace texmesh::testing {

/// What a file is made of; what is wrong in it is written as it is.
struct Ktx2Parts {
  std::uint32_t vk_format = 43, width = 1, height = 1, depth = 0, layers = 0, faces = 1;
  bool zstd = false;
  std::uint32_t scheme = 0;  // said in the header where it is not that of `zstd`
  std::uint8_t model = 1, primaries = 1, transfer = 2, flags = 0;
  std::vector<std::pair<std::string, std::string>> keys;
  std::vector<Bytes> levels;  // texels, the largest level first
};

/// Levels stand last, the smallest first, as the specification wants them.
inline Bytes ktx2_bytes(const Ktx2Parts& parts) {
  BytesOut keys;
  for (const auto& [key, value] : parts.keys) {
    const std::size_t size = key.size() + value.size() + 2;
    keys.u32(size), keys.text(key), keys.u8(0), keys.text(value), keys.u8(0);
    for (std::size_t at = size; at % 4; ++at) keys.u8(0);
  }
  const Bytes key_values = keys.finish();
  const std::size_t channels = parts.vk_format < 16   ? 1
                               : parts.vk_format < 23 ? 2
                               : parts.vk_format < 37 ? 3
                                                      : 4;
  const std::size_t block = 24 + 16 * channels;
  const std::size_t descriptor_at = 80 + 24 * parts.levels.size(), values_at = descriptor_at + 4 + block;
  std::vector<Bytes> stored;
  for (const Bytes& level : parts.levels) {
    stored.push_back(level);
    if (!parts.zstd) continue;
    stored.back().resize(ZSTD_compressBound(level.size()));
    stored.back().resize(
        ZSTD_compress(stored.back().data(), stored.back().size(), level.data(), level.size(), 3));
  }
  std::vector<std::size_t> at(stored.size());
  std::size_t end = values_at + key_values.size();
  for (std::size_t k = stored.size(); k-- > 0; end += stored[k].size()) at[k] = end;

  BytesOut out;
  out.text(std::string_view("\xabKTX 20\xbb\r\n\x1a\n", 12));
  for (const std::uint32_t x :
       {parts.vk_format, 1u, parts.width, parts.height, parts.depth, parts.layers, parts.faces})
    out.u32(x);
  out.u32(stored.size()), out.u32(parts.scheme ? parts.scheme : parts.zstd ? 2 : 0);
  out.u32(descriptor_at), out.u32(4 + block);
  out.u32(key_values.empty() ? 0 : values_at), out.u32(key_values.size());
  out.u64(0), out.u64(0);
  for (std::size_t k = 0; k < stored.size(); ++k)
    out.u64(at[k]), out.u64(stored[k].size()), out.u64(parts.levels[k].size());
  out.u32(4 + block), out.u32(0), out.u16(2), out.u16(block);
  out.u8(parts.model), out.u8(parts.primaries), out.u8(parts.transfer), out.u8(parts.flags);
  out.u32(0), out.u8(channels), out.raw(Bytes(7, 0));  // blocks of one texel
  for (std::size_t c = 0; c < channels; ++c)
    out.u16(8 * c), out.u8(7), out.u8(c == 3 ? 15 : c), out.u32(0), out.u32(0), out.u32(255);
  out.raw(key_values);
  for (std::size_t k = stored.size(); k-- > 0;) out.raw(stored[k]);
  return out.finish();
}

/// One level of these texels, as SRGB or UNORM.
inline Ktx2Parts ktx2_parts(std::uint32_t width, std::uint32_t height, int channels, const Bytes& texels,
                            bool srgb = true) {
  constexpr std::uint32_t kUnorm[] = {9, 16, 23, 37}, kSrgb[] = {15, 22, 29, 43};
  Ktx2Parts parts;
  parts.vk_format = (srgb ? kSrgb : kUnorm)[channels - 1];
  parts.width = width, parts.height = height;
  parts.transfer = srgb ? 2 : 1;
  parts.levels = {texels};
  return parts;
}

}  // namespace texmesh::testing
