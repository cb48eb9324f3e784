#include "stages/scales/collapse_replay.h"

#include <algorithm>
#include <ranges>
#include <string>

#include "format/base/errors.h"
#include "format/split/look_ahead.h"

namespace texmesh {
namespace {

/// Splits are the collapses backwards.
void reverse(SplitSource::Chapter& chapter) {
  const auto last = static_cast<std::uint32_t>(chapter.splits.size()) - 1;
  std::reverse(chapter.splits.begin(), chapter.splits.end());
  for (auto& [a, b] : chapter.before) a = last - a, b = last - b;
}

std::vector<ReplayFace> faces_of(const Mesh& mesh, const RoundedMesh& rounded) {
  std::vector<ReplayFace> faces(mesh.triangles.size());
  for (std::size_t f = 0; f < faces.size(); ++f) {
    auto& [wedge, point, coarse, material, part, alive] = faces[f];
    for (std::size_t k = 0; k < 3; ++k) {
      wedge[k] = rounded.wedge(mesh.triangles[f][k]);
      point[k] = rounded.point_of(wedge[k]);
    }
    material = mesh.triangle_material[f];
    part = mesh.triangle_part[f];
    // Where rounding or twins leave a face with a corner twice it shows nothing and cannot take part.
    alive = point[0] != point[1] && point[1] != point[2] && point[2] != point[0];
  }
  return faces;
}

}  // namespace

CollapseReplay::CollapseReplay(const NestedScales& scales, RoundedMesh& rounded)
    : scales_(scales),
      rounded_(rounded),
      points_(rounded.points()),
      faces_(faces_of(scales.mesh, rounded)),
      corners_(faces_, rounded.points()) {
  for (std::uint32_t f = 0; f < faces_.size(); ++f)
    if (faces_[f].alive) alive_.push_back(f);
}

SplitSource::Chapter CollapseReplay::run(const NestedScale& fine, const NestedScale& coarse) {
  if (coarse.collapse_count > scales_.collapses.size())
    throw StageError(
        "scales", "collapses",
        std::to_string(coarse.collapse_count) + " that lead to scale " + std::to_string(coarse.scale),
        std::to_string(scales_.collapses.size()));
  SplitSource::Chapter chapter;
  chapter.scale = fine.scale;
  chapter_ = &chapter;
  shares_.clear();
  begin_ = now_;
  note_final(coarse);
  for (std::uint32_t c = fine.collapse_count; c < coarse.collapse_count; ++c) {
    look_ahead(c, coarse.collapse_count);
    const Collapse& collapse = scales_.collapses[c];
    if (collapse.vanishes_with_component()) continue;
    const std::uint32_t u = rounded_.point(collapse.from), v = rounded_.point(collapse.to);
    if (u != v) replay(u, v);
  }
  patch_leftovers();
  reverse(chapter);
  return chapter;
}

SplitSource::Chapter CollapseReplay::remaining_faces(int scale) const {
  SplitSource::Chapter chapter;
  chapter.scale = scale;
  for (const std::uint32_t f : alive_) chapter.patch.push_back({f, faces_[f].wedge});
  return chapter;
}

void CollapseReplay::put_wedge(std::uint32_t face, std::uint32_t corner, std::uint32_t wedge) {
  faces_[face].wedge[corner] = wedge;
  faces_[face].point[corner] = rounded_.point_of(wedge);
}

/// Collapses come in the order of their cost, anywhere on the surface.
void CollapseReplay::look_ahead(std::uint32_t collapse, std::uint32_t end) const {
  LookAhead<ReplayStep, 4>::each_step([&](ReplayStep step, std::size_t ahead) {
    if (const std::size_t at = collapse + ahead; at < end) look_at(scales_.collapses[at], step);
  });
}

void CollapseReplay::look_at(const Collapse& collapse, ReplayStep step) const {
  if (step == ReplayStep::kPositions) {
    for (const std::uint32_t position : {collapse.from, collapse.to}) rounded_.look_ahead(position);
    return;
  }
  const std::uint32_t u = rounded_.point(collapse.from), v = rounded_.point(collapse.to);
  if (step == ReplayStep::kPoints) {
    for (const std::uint32_t p : {u, v}) {
      corners_.look_ahead(p);
      ask_memory(&points_[p]);
    }
    return;
  }
  const std::span<const std::uint32_t> corners = corners_.at(u);
  if (step == ReplayStep::kCorners) {
    ask_memory(corners.data());
    ask_memory(corners.data() + corners.size());
    return;
  }
  constexpr std::size_t kMost = 16;  // of hubs not all
  for (const std::uint32_t c : corners.last(std::min(corners.size(), kMost))) {
    const ReplayFace& face = faces_[c / 3];
    if (step == ReplayStep::kFaces) {
      ask_memory(&face);
      ask_memory(&face.alive);
    } else if (face.alive) {
      ask_memory(&points_[face.point[(c + 1) % 3]]);
    }
  }
}

/// Wedges of the faces that the coarse scale has.
void CollapseReplay::note_final(const NestedScale& coarse) {
  for (const std::uint32_t f : alive_) faces_[f].coarse_wedge.fill(kNoIndex);
  for (std::size_t i = 0; i < coarse.triangles.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k)
      faces_[coarse.triangle_source[i]].coarse_wedge[k] = rounded_.wedge(coarse.triangles[i][k]);
}

void CollapseReplay::replay(std::uint32_t u, std::uint32_t v) {
  gather_corners(u);
  if (gathered_.empty()) return;
  const auto number = static_cast<std::uint32_t>(chapter_->splits.size()),
             move_begin = static_cast<std::uint32_t>(chapter_->moves.size()),
             born_begin = static_cast<std::uint32_t>(chapter_->born.size());
  look_around(v);
  order(number, u, v);
  for (const std::uint32_t c : gathered_)
    if (has_edge_to(v, c))
      remove_face(c / 3);
    else
      move_corner(c, v);
  list_moved_corners(move_begin, v);
  chapter_->splits.push_back({v, u, move_begin, static_cast<std::uint32_t>(chapter_->moves.size()),
                              born_begin, static_cast<std::uint32_t>(chapter_->born.size())});
}

/// Of the faces there are; the point has none afterwards.
void CollapseReplay::gather_corners(std::uint32_t u) {
  gathered_.clear();
  for (const std::uint32_t c : corners_.at(u) | std::views::reverse)
    if (faces_[c / 3].alive) gathered_.push_back(c);
  corners_.clear(u);
}

/// Which points lie around the gathered corners, and where faces that go map wedges to.
void CollapseReplay::look_around(std::uint32_t v) {
  ring_.clear();
  map_.clear();
  for (const std::uint32_t c : gathered_) {
    const std::uint32_t f = c / 3, k = c % 3, a = point(f, k + 1), b = point(f, k + 2);
    ring_.push_back(a);
    ring_.push_back(b);
    const std::array<std::uint32_t, 3>& wedge = faces_[f].wedge;
    if (a == v || b == v) map_.push_back({wedge[k], group(f), wedge[(k + (a == v ? 1 : 2)) % 3]});
  }
}

bool CollapseReplay::has_edge_to(std::uint32_t v, std::uint32_t corner) const {
  return point(corner / 3, corner % 3 + 1) == v || point(corner / 3, corner % 3 + 2) == v;
}

void CollapseReplay::remove_face(std::uint32_t face) {
  chapter_->born.push_back({face, faces_[face].wedge});
  faces_[face].alive = false;
}

void CollapseReplay::move_corner(std::uint32_t corner, std::uint32_t v) {
  const std::uint32_t f = corner / 3, k = corner % 3;
  const std::uint32_t moved = faces_[f].wedge[k], last = faces_[f].coarse_wedge[k];
  chapter_->moves.push_back({f, moved});
  const bool stays = last != kNoIndex && rounded_.point_of(last) == v;
  put_wedge(f, k, stays ? last : target(moved, group(f), v));
}

/// Only now: lists without room give up corners of faces that are gone.
void CollapseReplay::list_moved_corners(std::uint32_t move_begin, std::uint32_t v) {
  for (std::size_t i = move_begin; i < chapter_->moves.size(); ++i) {
    const std::uint32_t f = chapter_->moves[i].face;
    for (std::uint32_t k = 0; k < 3; ++k)
      if (point(f, k) == v) corners_.add(v, 3 * f + k);
  }
}

std::uint32_t CollapseReplay::group(std::uint32_t face) const {
  return std::uint32_t{faces_[face].material} << 16 | faces_[face].part;
}

/// Where a wedge of the point that goes is mapped by the removed faces, those of its own material and part
/// first; a wedge without such a face keeps its values and becomes one of the point that stays.
std::uint32_t CollapseReplay::target(std::uint32_t wedge, std::uint32_t group, std::uint32_t v) {
  for (const Mapping& m : map_)
    if (m.from == wedge && m.group == group) return m.to;
  for (const Mapping& m : map_)
    if (m.from == wedge) return m.to;
  const std::uint32_t made = rounded_.add_wedge(wedge, v);
  map_.push_back({wedge, group, made});
  return made;
}

/// Notes which earlier collapses this one comes after.
void CollapseReplay::order(std::uint32_t number, std::uint32_t u, std::uint32_t v) {
  auto after = [&](std::uint32_t earlier) {
    if (earlier != kNoIndex) chapter_->before.push_back({number, earlier});
  };
  // What a point has of an earlier chapter counts no more.
  const auto use_of = [&](Point& p) -> PointUse& {
    if (p.mark <= begin_) p.use = {};
    return p.use;
  };
  for (std::uint32_t p : {u, v}) {
    PointUse& use = use_of(points_[p]);
    after(use.alone);
    for (std::uint32_t s = use.shared; s != kNoIndex; s = shares_[s].next) after(shares_[s].collapse);
    use = {number, kNoIndex};
  }
  ++now_;
  points_[u].mark = points_[v].mark = now_;
  for (std::uint32_t p : ring_) {
    Point& around = points_[p];
    if (around.mark == now_) continue;
    PointUse& use = use_of(around);
    around.mark = now_;
    after(use.alone);
    shares_.push_back({number, use.shared});
    use.shared = static_cast<std::uint32_t>(shares_.size() - 1);
  }
}

/// Faces that the coarse scale does not have although no collapse removed them become the chapter's patch.
void CollapseReplay::patch_leftovers() {
  for (const std::uint32_t f : alive_) {
    ReplayFace& face = faces_[f];
    if (!face.alive) continue;
    if (face.coarse_wedge[0] == kNoIndex) {
      chapter_->patch.push_back({f, face.wedge});
      face.alive = false;
    } else if (face.wedge != face.coarse_wedge) {
      throw StageError("scales", "collapses", "those that lead to the nested scales",
                       "triangle " + std::to_string(f) + " elsewhere");
    }
  }
  std::erase_if(alive_, [&](std::uint32_t f) { return !faces_[f].alive; });
}

}  // namespace texmesh
