#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "format/base/vec.h"
#include "pipeline/import/import.h"

namespace texmesh {

// A part of import_ply: what the vertices and faces of a file say, before a mesh is made of them.

struct PlyVertices {
  std::vector<Vec3d> positions;
  std::vector<Vec2f> uv;  // each empty or one per position
  std::vector<Vec3f> normals;
  std::vector<Vec4f> colours;
};

/// Faces as they stand in the file; corners of face f are begin[f] .. begin[f + 1].
struct PlyFaces {
  std::vector<std::size_t> begin{0};
  std::vector<std::uint32_t> index;
  std::vector<Vec2f> uv;              // per corner, or empty
  std::vector<std::uint8_t> has_uv;   // per face, or empty
  std::vector<Vec4f> colours;         // per corner, or empty
  std::vector<std::int32_t> texture;  // per face, or empty
  std::size_t count() const { return begin.size() - 1; }
};

struct PlySurface {
  PlyVertices vertices;
  PlyFaces faces;                     // every index below the number of vertices
  std::vector<std::string> comments;  // of the header, in order
  // Faults that are passed over, with their numbers:
  std::uint64_t long_lines = 0, odd_texcoords = 0;
  std::string first_long_line;  // where it stands
};

/// Reads the elements vertex, face and tristrips. InputError for a file without faces, for indices that are
/// no vertices, and for more than the options allow.
PlySurface read_ply_surface(const std::string& file, std::span<const std::uint8_t> bytes,
                            const ImportOptions& options, const RunContext& context);

}  // namespace texmesh
