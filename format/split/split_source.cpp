#include "format/split/split_source.h"

#include "format/base/errors.h"
#include "format/split/split_head.h"

namespace texmesh {

void fail_split_source(const std::string& place, const std::string& expected, const std::string& found) {
  throw FormatError("split source", place, expected, found);
}

void check_split_source(const SplitSource& s) {
  const auto require = [](bool good, const std::string& what) {
    if (!good) fail_split_source(what, "in range", "another");
  };
  require(s.splits_per_block >= 1 && s.splits_per_block <= kMostSplits, "splits per block");
  require(!s.chapters.empty() && s.chapters.size() <= kMostScales && !s.chapters[0].patch.empty(),
          "chapters");
  require(s.position.bits >= 1 && s.position.bits <= 24, "position bits");
  require(s.values.size() == s.attributes.size() && !s.groups.empty() && s.groups.size() <= 65536,
          "attributes and groups");
  for (const SplitMesh::Point& p : s.points)
    for (std::int32_t x : p) require(x >= 0 && x < (1 << s.position.bits), "places");
  for (std::uint32_t p : s.wedge_point) require(p < s.points.size(), "points of wedges");
  for (std::size_t k = 0; k < s.values.size(); ++k) {
    const SplitAttribute& a = s.attributes[k];
    require(k == 0 || s.attributes[k - 1].kind < a.kind, "order of attribute kinds");
    require(a.grid.bits >= (a.kind == SplitKind::kNormal ? 2 : 1) && a.grid.bits <= 24, "attribute bits");
    require(s.values[k].size() == s.wedge_point.size() * static_cast<std::size_t>(split_components(a.kind)),
            "number of attributes");
    for (std::int32_t x : s.values[k]) require(x >= 0 && x < (1 << a.grid.bits), "attributes");
  }
  for (std::uint16_t g : s.face_group) require(g < s.groups.size(), "groups of faces");
  const auto check_face = [&](const SplitSource::Face& f) {
    require(f.face < s.face_group.size(), "faces");
    for (std::uint32_t w : f.wedges) require(w < s.wedge_point.size(), "wedges of faces");
  };
  for (const SplitSource::Chapter& c : s.chapters) {
    for (const SplitSource::Face& f : c.patch) {
      check_face(f);
      const std::uint32_t a = s.wedge_point[f.wedges[0]], b = s.wedge_point[f.wedges[1]],
                          d = s.wedge_point[f.wedges[2]];
      require(a != b && b != d && d != a, "corners of a face");
    }
    for (const SplitSource::Face& f : c.born) check_face(f);
    for (const SplitSource::Move& m : c.moves)
      require(m.face < s.face_group.size() && m.wedge < s.wedge_point.size(), "moves");
    for (const SplitSource::Split& x : c.splits)
      require(x.parent < s.points.size() && x.child < s.points.size() && x.move_begin <= x.move_end &&
                  x.move_end <= c.moves.size() && x.born_begin <= x.born_end && x.born_end <= c.born.size(),
              "splits");
  }
}

}  // namespace texmesh
