// Inputs that were found by libFuzzer, or made by hand where the target cannot reach: what they did stands
// beside them.
#include <map>

#include "format/base/sha256.h"
#include "tests/fuzz/fuzz_target.h"

namespace texmesh::fuzz {
namespace {

/// An EXR with one attribute, which claims 1 GB: OpenEXR took the memory before it read.
Bytes exr_with_long_attribute(std::string_view type) {
  BytesOut out;
  out.u32(20000630), out.u32(2);
  out.text("a"), out.u8(0), out.text(type), out.u8(0);
  out.u32(1u << 30);
  out.text("b");
  return out.finish();
}

/// A list of channels that is longer than it claims. OpenEXR went by the list, and took what stands behind
/// for the length of another attribute.
Bytes exr_with_short_claim() {
  BytesOut out;
  out.u32(20000630), out.u32(2);
  out.text(std::string_view("channels\0chlist\0", 16)), out.u32(5);
  out.text(std::string_view("R\0", 2)), out.raw(Bytes(16, 1)), out.u8(0);
  out.text(std::string_view("b\0c\0", 4)), out.u32(1u << 30);
  return out.finish();
}

/// A whole EXR of one row, with a place for its pixels.
Bytes exr_of_one_row(std::uint32_t width, std::uint64_t pixels_at) {
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
Bytes tiff_of(std::vector<std::pair<unsigned, unsigned>> fields, std::size_t data_bytes) {
  BytesOut out;
  out.text("II"), out.u16(42), out.u32(8), out.u16(static_cast<std::uint16_t>(fields.size()));
  for (const auto& [tag, value] : fields) out.u16(tag), out.u16(3), out.u32(1), out.u32(value);
  out.u32(0);
  out.raw(Bytes(data_bytes, 0x55));
  return out.finish();
}

/// A TIFF of 65,024 rows of seven texels, all from one strip: reading 64 rows at a time cost 30 s under asan.
Bytes tiff_of_short_rows() {
  return tiff_of({{256, 7}, {257, 65024}, {262, 1}, {273, 100}, {277, 1}, {278, 65024}, {279, 8129}}, 65124);
}

/// A small picture in a tile of 4 GB, which OpenImageIO took.
Bytes tiff_of_large_tile() {
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
Bytes tiff_of_long_strip() {
  return tiff_of(
      {{256, 27000}, {257, 5}, {258, 8}, {259, 8}, {262, 1}, {273, 150}, {277, 1}, {278, 65312}, {279, 50}},
      100);
}

/// A PNG with a chunk of text that claims 1 GB: libpng took the memory before it read.
Bytes png_with_long_chunk() {
  BytesOut out;
  out.text("\x89PNG\r\n\x1a\n");
  out.text(std::string_view("\0\0\0\x0dIHDR\0\0\0\x01\0\0\0\x01\x08\x02\0\0\0\x90\x77\x53\xde", 25));
  out.text(std::string_view("\x41\0\x02\xf4zTXtRaw", 11));
  return out.finish();
}

/// Words of a child that somebody has taken over: values of other types ended the parent.
std::vector<Bytes> events_of_other_types() {
  std::vector<Bytes> list;
  for (const char* line :
       {R"({"event":1})", R"({"event":"result","bytes":"a"})", R"({"event":"error","kind":[]})",
        R"({"event":"inputs","files":7})", R"({"event":"layer-left-out","layer":{}})",
        R"([["a",1,"0000000000000000000000000000000000000000000000000000000000000000",1,1,1,1,1,1]])"})
    list.push_back(to_bytes(line));
  return list;
}

/// Tables of 2 x 32767 fragments, of which none is stored: a message was put together for every cell.
Bytes tables_of_many_cells() {
  BytesOut section;
  section.u32(2), section.u32(32767);
  for (const unsigned x : {1, 50, 1, 1, 0, 0, 0, 0}) section.u8(x);  // a scale, 50 rungs, widths
  for (const float x : {1.f, 1.f, 1.f, 100.f}) section.f32(x);
  section.u32(0);
  for (unsigned rung = 0; rung < 50; ++rung) section.u8(1 + rung);
  for (unsigned rung = 0; rung < 50; ++rung) section.u32(20);
  section.f32(50);
  const Bytes bytes = section.finish();
  BytesOut out;
  out.text("TXMT"), out.u16(2), out.u16(0), out.u32(1), out.u32(0);
  out.u32(bytes.size()), out.raw(sha256(bytes)), out.raw(bytes);
  return out.finish();
}

/// Three points in Draco's plain coding, whose attributes are truth values of 0xb6: they were read as bool.
Bytes draco_of_truth_values() {
  BytesOut out;
  out.u8(0), out.u16(3), out.u16(1);  // for the target: points, triangles
  for (unsigned id = 0; id < 3; ++id) out.u8(id);
  out.text("DRACO");
  for (const unsigned x : {2, 2, 1, 0, 0, 0})  // version, a mesh, one index after the other, flags
    out.u8(x);
  for (const unsigned x : {1, 3, 1, 0, 1, 2})  // a face, three points, indices as they are
    out.u8(x);
  for (const unsigned x :
       {1, 3, 0, 11, 3, 0, 0, 3, 11, 2, 0, 1, 1, 11, 3, 0, 2, 0, 0, 0})  // three attributes
    out.u8(x);
  out.raw(Bytes(24, 0xb6));
  return out.finish();
}

/// A glTF of 40 million positions that no byte stands for.
Bytes gltf_of_zeros() {
  return to_bytes(
      R"({"asset":{"version":"2.0"},"accessors":[{"type":"VEC3","componentType":5126,"count":40000000}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"nodes":[{"mesh":0}],"scenes":[{"nodes":[0]}]})");
}

/// A GLB of four billion indices that no byte stands for: each was looked at.
Bytes glb_of_zeros() {
  const std::string json =
      R"({"asset":{"version":"2.0"},"accessors":[{"type":"VEC3","componentType":5126,"count":1},)"
      R"({"type":"SCALAR","componentType":5123,"count":4294967295}],)"
      R"("meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}]}    )";
  BytesOut out;
  out.text("glTF"), out.u32(2), out.u32(20 + json.size());
  out.u32(json.size()), out.text("JSON"), out.text(json);
  return out.finish();
}

}  // namespace

std::vector<Bytes> regressions(const std::string& target) {
  static const std::map<std::string, std::vector<Bytes>> found{
      {"draco", {draco_of_truth_values()}},
      {"events", events_of_other_types()},
      {"exr",
       {exr_with_long_attribute("str"), exr_with_long_attribute(""), exr_with_short_claim(),
        exr_of_one_row(1u << 30, 400),  // OpenEXR took memory for its rows before anybody saw the size
        exr_of_one_row(250'000, 400),   // OpenImageIO took 256 MB for 256 rows of this
        exr_of_one_row(4, ~0ull)}},     // OpenImageIO read in front of the file
      {"glb_check", {glb_of_zeros()}},
      {"gltf", {gltf_of_zeros()}},
      {"png", {png_with_long_chunk()}},
      {"tiff", {tiff_of_short_rows(), tiff_of_large_tile(), tiff_of_long_strip()}},
      {"tables", {tables_of_many_cells()}}};
  const auto it = found.find(target);
  return it == found.end() ? std::vector<Bytes>{} : it->second;
}

}  // namespace texmesh::fuzz
