#pragma once
#include <string>

#include "format/split/split_mesh.h"
#include "format/split/split_stream.h"

namespace texmesh {

/// What write_split_stream needs, in the caller's numbers of points, wedges and faces.
struct SplitSource {
  struct Face {
    std::uint32_t face = 0;
    std::array<std::uint32_t, 3> wedges{};
  };
  /// The corner of `face` at the parent goes to the child and gets this wedge.
  struct Move {
    std::uint32_t face = 0, wedge = 0;
  };
  struct Split {
    std::uint32_t parent = 0, child = 0;
    std::uint32_t move_begin = 0, move_end = 0;  // in Chapter::moves
    std::uint32_t born_begin = 0, born_end = 0;  // in Chapter::born; each with a corner at parent and child
  };
  /// From one scale to the next finer one. First the patch, then the splits, in any order in which each
  /// comes after those it depends on.
  struct Chapter {
    int scale = 0;  // that it leads to
    std::vector<Face> patch;
    std::vector<Split> splits;
    std::vector<Move> moves;
    std::vector<Face> born;
    std::vector<std::array<std::uint32_t, 2>> before;  // {a, b}: split a comes before split b
  };
  SplitGrid position;
  std::vector<SplitAttribute> attributes;
  std::vector<SplitGroup> groups;
  std::vector<SplitMesh::Point> points;
  std::vector<std::uint32_t> wedge_point;
  std::vector<std::vector<std::int32_t>> values;  // per attribute: components * wedges
  std::vector<std::uint16_t> face_group;          // per face
  std::vector<Chapter> chapters;                  // the first has a patch only: the coarsest scale
  std::uint32_t splits_per_block = 512;           // 1 to 4096
};

/// FormatError when an index or a number of the source is out of range.
void check_split_source(const SplitSource& source);

[[noreturn]] void fail_split_source(const std::string& place, const std::string& expected,
                                    const std::string& found);

/// Same bytes for the same source. FormatError when the source contradicts itself: splits that wait for each
/// other, faces that are not at their parent, indices or numbers out of range.
std::vector<std::uint8_t> write_split_stream(const SplitSource& source);

}  // namespace texmesh
