// Inputs that were found by libFuzzer, or made by hand where the target cannot reach: what they did stands
// beside them.
#include <map>

#include "format/base/sha256.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/stages/image/hostile_pictures.h"

namespace texmesh::fuzz {
namespace {

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
      {"draco", {draco_of_truth_values()}}, {"events", events_of_other_types()},
      {"exr", testing::hostile_exrs()},     {"glb_check", {glb_of_zeros()}},
      {"gltf", {gltf_of_zeros()}},          {"png", {png_with_long_chunk()}},
      {"tiff", testing::hostile_tiffs()},   {"tables", {tables_of_many_cells()}}};
  const auto it = found.find(target);
  return it == found.end() ? std::vector<Bytes>{} : it->second;
}

}  // namespace texmesh::fuzz
