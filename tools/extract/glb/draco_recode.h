#pragma once
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "format/base/vec.h"
#include "tools/extract/glb/fit_normals.h"

namespace texmesh {

/// How fine a mesh is coded anew. Steps are the largest distance between neighbouring places of a grid.
struct DracoSteps {
  double position = 0;  // object units, > 0
  double uv = 0;        // texture coordinates, > 0
  int normal_bits = 8;
  int colour_bits = 8;  // of the 8 that vertex colours have
  /// Steps exactly so long. Otherwise a grid's last place is the end of what it holds, and its steps may be
  /// half as long.
  bool exact = false;
};

/// One primitive of a file: its Draco stream, and the stream's id of every glTF attribute.
struct DracoStream {
  std::vector<std::uint8_t> bytes;
  std::map<std::string, int> attributes;  // "POSITION" -> unique id
  std::uint32_t vertices = 0, triangles = 0;
  Vec3f low, high;  // of the positions
};

/// Codes the primitives of one file anew on coarser grids that all of them share, so that borders between
/// primitives stay closed. When one stream does not get smaller, all streams of the file stay as they are
/// (one grid for all). With `lit_as`, normals are fitted to `lit_as`, and the new streams are used however
/// many bytes they have. FormatError when a stream does not decode; StageError when Draco refuses.
void recode_draco(std::vector<DracoStream>& primitives, const DracoSteps& steps, const NormalSamples* lit_as,
                  const std::string& entry, const RunContext& context);

}  // namespace texmesh
