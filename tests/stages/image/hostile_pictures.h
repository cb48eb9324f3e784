#pragma once
// EXRs and TIFFs that libFuzzer found, or that were made by hand where it cannot reach.
#include <cstdint>
#include <string_view>
#include <utility>
#include <vector>

#include "format/base/bytes.h"

namespace texmesh::testing {

/// An EXR with one attribute, which claims 1 GB: OpenEXR took the memory before it read.
inline Bytes exr_with_long_attribute(std::string_view type) {
  BytesOut out;
  out.u32(20000630), out.u32(2);
  out.text("a"), out.u8(0), out.text(type), out.u8(0);
  out.u32(1u << 30);
  out.text("b");
  return out.finish();
}

/// A list of channels that is longer than it claims. OpenEXR went by the list, and took what stands behind
/// for the length of another attribute.
inline Bytes exr_with_short_claim() {
  BytesOut out;
  out.u32(20000630), out.u32(2);
  out.text(std::string_view("channels\0chlist\0", 16)), out.u32(5);
  out.text(std::string_view("R\0", 2)), out.raw(Bytes(16, 1)), out.u8(0);
  out.text(std::string_view("b\0c\0", 4)), out.u32(1u << 30);
  return out.finish();
}

/// A whole EXR of one row, with a place for its pixels.
inline Bytes exr_of_one_row(std::uint32_t width, std::uint64_t pixels_at) {
  BytesOut out;
  out.u32(20000630), out.u32(2);
  out.text(std::string_view("channels\0chlist\0", 16)), out.u32(19),
      out.text(std::string_view("R\0\1\0\0\0\0\0\0\0", 10));
  for (const unsigned x : {1, 0, 0, 0, 1, 0, 0, 0, 0}) out.u8(x);
  out.text(std::string_view("compression\0compression\0", 24)), out.u32(1), out.u8(3);
  for (const char* window : {"dataWindow", "displayWindow"}) {
    out.text(window), out.u8(0), out.text(std::string_view("box2i\0", 6)), out.u32(16);
    for (const unsigned x : {0u, 0u, width - 1, 0u}) out.u32(x);
  }
  out.text(std::string_view("lineOrder\0lineOrder\0", 20)), out.u32(1), out.u8(0);
  out.text(std::string_view("pixelAspectRatio\0float\0", 23)), out.u32(4), out.f32(1);
  out.text(std::string_view("screenWindowCenter\0v2f\0", 23)), out.u32(8), out.f32(0), out.f32(0);
  out.text(std::string_view("screenWindowWidth\0float\0", 24)), out.u32(4), out.f32(1), out.u8(0);
  out.u64(pixels_at), out.raw(Bytes(64, 0));
  return out.finish();
}

/// A TIFF of fields with one short number each, and some data.
inline Bytes tiff_of(std::vector<std::pair<unsigned, unsigned>> fields, std::size_t data_bytes) {
  BytesOut out;
  out.text("II"), out.u16(42), out.u32(8), out.u16(static_cast<std::uint16_t>(fields.size()));
  for (const auto& [tag, value] : fields) out.u16(tag), out.u16(3), out.u32(1), out.u32(value);
  out.u32(0);
  out.raw(Bytes(data_bytes, 0x55));
  return out.finish();
}

/// A TIFF of 65,024 rows of seven texels, all from one strip: reading 64 rows at a time cost 30 s under asan.
inline Bytes tiff_of_short_rows() {
  return tiff_of({{256, 7}, {257, 65024}, {262, 1}, {273, 100}, {277, 1}, {278, 65024}, {279, 8129}}, 65124);
}

/// A small picture in a tile of 4 GB, which OpenImageIO took.
inline Bytes tiff_of_large_tile() {
  return tiff_of({{256, 8},
                  {257, 48},
                  {258, 8},
                  {259, 8},
                  {262, 1},
                  {277, 1},
                  {322, 65520},
                  {323, 65520},
                  {324, 150},
                  {325, 50}},
                 100);
}

/// Five rows in a strip of 1.8 GB, which OpenImageIO took.
inline Bytes tiff_of_long_strip() {
  return tiff_of(
      {{256, 27000}, {257, 5}, {258, 8}, {259, 8}, {262, 1}, {273, 150}, {277, 1}, {278, 65312}, {279, 50}},
      100);
}

/// What each of them did stands above, or beside it.
inline std::vector<Bytes> hostile_exrs() {
  return {exr_with_long_attribute("str"), exr_with_long_attribute(""), exr_with_short_claim(),
          exr_of_one_row(1u << 30, 400),  // OpenEXR took memory for its rows before anybody saw the size
          exr_of_one_row(250'000, 400),   // OpenImageIO took 256 MB for 256 rows of this
          exr_of_one_row(4, ~0ull)};      // OpenImageIO read in front of the file
}
inline std::vector<Bytes> hostile_tiffs() {
  return {tiff_of_short_rows(), tiff_of_large_tile(), tiff_of_long_strip()};
}

}  // namespace texmesh::testing
