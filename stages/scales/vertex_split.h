#pragma once

#include "format/split/split_writer.h"
#include "stages/gltf/scale_codecs.h"

namespace texmesh {

/// A face while collapses are replayed.
struct ReplayFace {
  std::array<std::uint32_t, 3> wedge{}, point{};
  std::array<std::uint32_t, 3> coarse_wedge{};  // wedges in the coarse scale, where it has the face
  std::uint16_t material = 0, part = 0;
  bool alive = true;
};

/// The corners (3 * face + corner) at each point, which may be of dead faces: lists in one array. A list
/// without room gives up the corners of dead faces. Where that frees less than a quarter, the list moves to
/// the end of the array with room for half as many more, so that adding costs the same on average however
/// long it is. `faces` must outlive the lists.
class CornerLists {
 public:
  CornerLists(const std::vector<ReplayFace>& faces, std::size_t points) : faces_(faces), lists_(points) {
    const auto each = [&](auto visit) {
      for (std::uint32_t f = 0; f < faces_.size(); ++f)
        for (std::uint32_t k = 0; k < 3 && faces_[f].alive; ++k) visit(faces_[f].point[k], 3 * f + k);
    };
    each([&](std::uint32_t point, std::uint32_t) { ++lists_[point].room; });
    std::uint32_t begin = 0;
    for (List& list : lists_) begin += list.room, list.begin = begin - list.room;
    corners_.reserve(begin + begin / 2);
    corners_.resize(begin);
    each([&](std::uint32_t point, std::uint32_t corner) { add(point, corner); });
  }
  std::span<const std::uint32_t> at(std::uint32_t point) const {
    return {corners_.data() + lists_[point].begin, lists_[point].count};
  }
  void add(std::uint32_t point, std::uint32_t corner) {
    List& list = lists_[point];
    if (list.count == list.room) make_room(list);
    corners_[list.begin + list.count++] = corner;
  }
  void clear(std::uint32_t point) { lists_[point].count = 0; }
  /// Asks memory for what at() will read first.
  void look_ahead(std::uint32_t point) const { ask_memory(&lists_[point]); }

 private:
  struct List {
    std::uint32_t begin = 0, count = 0, room = 0;
  };
  void make_room(List& list) {
    const auto begin = corners_.begin() + list.begin;
    const auto end = std::remove_if(begin, begin + list.count,
                                    [&](std::uint32_t corner) { return !faces_[corner / 3].alive; });
    list.count = static_cast<std::uint32_t>(end - begin);
    if (list.count <= list.room - list.room / 4 && list.count < list.room) return;
    const std::size_t at = corners_.size();
    list.room = list.count + list.count / 2 + 4;
    if (at + list.room > kNoIndex)
      throw StageError("scales", "collapses", "corners that 32 bits can count", "more");
    corners_.resize(at + list.room);
    std::copy_n(corners_.begin() + list.begin, list.count,
                corners_.begin() + static_cast<std::ptrdiff_t>(at));
    list.begin = static_cast<std::uint32_t>(at);
  }
  const std::vector<ReplayFace>& faces_;
  std::vector<List> lists_;
  std::vector<std::uint32_t> corners_;
};

/// How the values of a stream are rounded. Texture coordinates and colours of the mesh that are not to be in
/// it have 0 bits.
struct VertexSplitCoding {
  QuantisationGrid position;  // 1 to 24 bits
  QuantisationGrid uv[2];
  int normal_bits = 10, colour_bits = 0;
  bool merge_parts = false;  // all parts as part 0
};

/// The collapses between the given scales (indices into NestedScales::scales, S_0 first) turned round, for
/// write_split_stream. The coarsest of them is the first patch. Collapses are replayed; where a face's wedge
/// between two scales is not known it is the one that the removed faces suggest, and at every given scale it
/// is exactly that scale's. What a scale lacks that no collapse explains (components that vanish) is a patch
/// of the next finer one. Twins are one point; wedges of a point that are equal after rounding are one.
/// Deterministic. Time grows with triangles and with the triangles that collapses move. Throws StageError
/// when collapses and scales do not belong together.
SplitSource make_vertex_splits(const NestedScales& scales, const std::vector<std::size_t>& kept,
                               const VertexSplitCoding& coding, const RunContext& context);

}  // namespace texmesh
