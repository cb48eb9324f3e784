#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "format/base/no_index.h"
#include "format/base/vec.h"
#include "pipeline/import/import.h"

namespace texmesh {

struct ObjCorner {
  std::uint32_t position = 0, uv = kNoIndex, normal = kNoIndex;
};

struct ObjFace {
  std::uint64_t begin = 0;  // of its corners
  std::uint32_t line = 0;
  std::uint16_t material = 0, part = 0;
};

/// The statements of an OBJ as they stand.
struct ObjData {
  std::vector<Vec3d> positions;
  std::vector<Vec3f> colours;  // as written; empty or one per position, NaN where a vertex has none
  std::vector<Vec2f> uvs;      // v flipped
  std::vector<Vec3f> normals;
  std::vector<ObjCorner> corners;
  std::vector<ObjFace> faces;
  std::vector<std::string> materials, parts;  // by first use; materials[0] is "" (before any usemtl)
  struct Library {
    std::string name;
    std::size_t line;
  };
  std::vector<Library> libraries;
  std::uint64_t small_faces = 0, lines_and_points = 0;  // left out
  bool parts_full = false;                              // the last part stands for all further ones
  std::span<const ObjCorner> corners_of(std::size_t f) const {
    const std::uint64_t end = f + 1 < faces.size() ? faces[f + 1].begin : corners.size();
    return {corners.data() + faces[f].begin, static_cast<std::size_t>(end - faces[f].begin)};
  }
};

/// Reads the statements of an OBJ; the comment in obj_reader.cpp says which. InputError names the line.
ObjData read_obj(const std::string& file, std::string_view text, const ImportOptions& options,
                 const RunContext& context);

}  // namespace texmesh
