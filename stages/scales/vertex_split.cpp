// Scales as vertex splits. RoundedMesh rounds all values and merges what is equal then. CollapseReplay
// carries the collapses out once more, from fine to coarse, and writes down what each one changes. Read
// backwards these are the splits.
#include "stages/scales/vertex_split.h"

#include <algorithm>

#include "format/base/buckets.h"

namespace texmesh {
namespace {

std::int32_t place(const QuantisationGrid& grid, float x, int axis) {
  const auto largest = (std::uint32_t{1} << grid.bits) - 1;
  return static_cast<std::int32_t>(std::min(grid.index(x, axis), largest));
}

/// Rounded values, wedge by wedge, and what is equal merged: the source's points, wedges, attributes.
class RoundedMesh {
 public:
  RoundedMesh(const NestedScales& scales, const VertexSplitCoding& coding)
      : mesh_(scales.mesh), coding_(coding), point_(scales.mesh.positions.size()) {
    for (std::size_t p = 0; p < point_.size(); ++p) {
      const std::uint32_t twin = scales.twin.empty() ? static_cast<std::uint32_t>(p) : scales.twin[p];
      point_[p] = twin == p ? static_cast<std::uint32_t>(places_.size()) : point_[twin];
      if (twin != p) continue;
      const Vec3f at = mesh_.positions[p];
      places_.push_back({place(coding.position, at.x, 0), place(coding.position, at.y, 1),
                         place(coding.position, at.z, 2)});
    }
    add_attributes();
    std::vector<std::vector<std::int32_t>> all(attributes_.size());
    for (std::size_t w = 0; w < mesh_.wedge_count(); ++w)
      for (std::size_t k = 0; k < attributes_.size(); ++k) append_value(attributes_[k], w, all[k]);
    merge_wedges(all);
  }

  std::uint32_t point(std::uint32_t position) const { return point_.at(position); }
  /// Asks memory for what point() will read.
  void look_ahead(std::uint32_t position) const { ask_memory(&point_[position]); }
  std::uint32_t wedge(std::uint32_t mesh_wedge) const { return wedge_.at(mesh_wedge); }
  std::uint32_t point_of(std::uint32_t wedge) const { return wedge_point_[wedge]; }
  std::size_t points() const { return places_.size(); }

  /// A wedge with the values of another one at another point.
  std::uint32_t add_wedge(std::uint32_t wedge, std::uint32_t point) {
    wedge_point_.push_back(point);
    for (std::size_t k = 0; k < values_.size(); ++k) {
      const auto n = static_cast<std::size_t>(split_components(attributes_[k].kind));
      for (std::size_t i = 0; i < n; ++i) values_[k].push_back(values_[k][wedge * n + i]);
    }
    return static_cast<std::uint32_t>(wedge_point_.size() - 1);
  }

  void move_to(SplitSource& source) {
    const QuantisationGrid& g = coding_.position;
    source.position = {g.bits, {g.origin.x, g.origin.y, g.origin.z}, g.range};
    source.attributes = std::move(attributes_);
    source.points = std::move(places_);
    source.wedge_point = std::move(wedge_point_);
    source.values = std::move(values_);
  }

 private:
  void add_attributes() {
    auto grid = [](const QuantisationGrid& g) {
      return SplitGrid{g.bits, {g.origin.x, g.origin.y, 0}, g.range};
    };
    if (coding_.uv[0].bits > 0) attributes_.push_back({SplitKind::kUv0, grid(coding_.uv[0])});
    if (coding_.uv[1].bits > 0) attributes_.push_back({SplitKind::kUv1, grid(coding_.uv[1])});
    if (!mesh_.normals.empty()) attributes_.push_back({SplitKind::kNormal, {coding_.normal_bits, {}, 1}});
    if (coding_.colour_bits > 0) attributes_.push_back({SplitKind::kColour, {coding_.colour_bits, {}, 1}});
  }

  void append_value(const SplitAttribute& a, std::size_t w, std::vector<std::int32_t>& out) const {
    if (a.kind == SplitKind::kNormal) {
      const Vec3f n = mesh_.normals[w];
      const auto code = octahedral_code({n.x, n.y, n.z}, a.grid.bits);
      out.insert(out.end(), code.begin(), code.end());
    } else if (a.kind == SplitKind::kColour) {
      const float one = static_cast<float>((1 << a.grid.bits) - 1);
      const Vec4f c = mesh_.colours[w];
      for (float x : {c.x, c.y, c.z, c.w})
        out.push_back(static_cast<std::int32_t>(std::floor(std::clamp(x, 0.0f, 1.0f) * one + 0.5f)));
    } else {
      const int set = a.kind == SplitKind::kUv1 ? 1 : 0;
      const Vec2f uv = set == 1 ? mesh_.uv1[w] : mesh_.uv0[w];
      out.push_back(place(coding_.uv[set], uv.x, 0));
      out.push_back(place(coding_.uv[set], uv.y, 1));
    }
  }

  void merge_wedges(const std::vector<std::vector<std::int32_t>>& all) {
    const std::size_t n = mesh_.wedge_count();
    const auto compare = [&](std::uint32_t a, std::uint32_t b) {
      for (std::size_t k = 0; k < attributes_.size(); ++k) {
        const auto c = static_cast<std::size_t>(split_components(attributes_[k].kind));
        for (std::size_t i = 0; i < c; ++i)
          if (all[k][a * c + i] != all[k][b * c + i]) return all[k][a * c + i] < all[k][b * c + i] ? -1 : 1;
      }
      return 0;
    };
    Buckets<std::uint32_t> of_points = in_buckets(places_.size(), [&](auto&& put) {
      for (std::uint32_t w = 0; w < n; ++w) put(point_[mesh_.wedge_position[w]], w);
    });
    std::vector<std::uint32_t> same(n);  // the lowest equal wedge
    for (std::size_t p = 0; p < places_.size(); ++p) {
      const std::span<std::uint32_t> wedges = of_points[p];
      std::ranges::sort(wedges, [&](std::uint32_t a, std::uint32_t b) {
        const int c = compare(a, b);
        return c < 0 || (c == 0 && a < b);
      });
      for (std::size_t i = 0; i < wedges.size(); ++i)
        same[wedges[i]] = i > 0 && compare(wedges[i - 1], wedges[i]) == 0 ? same[wedges[i - 1]] : wedges[i];
    }
    wedge_.resize(n);
    values_.resize(attributes_.size());
    for (std::uint32_t w = 0; w < n; ++w) {
      if (same[w] != w) {
        wedge_[w] = wedge_[same[w]];
        continue;
      }
      wedge_[w] = static_cast<std::uint32_t>(wedge_point_.size());
      wedge_point_.push_back(point_[mesh_.wedge_position[w]]);
      for (std::size_t k = 0; k < attributes_.size(); ++k) {
        const auto c = static_cast<std::size_t>(split_components(attributes_[k].kind));
        for (std::size_t i = 0; i < c; ++i) values_[k].push_back(all[k][w * c + i]);
      }
    }
  }

  const Mesh& mesh_;
  const VertexSplitCoding& coding_;
  std::vector<std::uint32_t> point_, wedge_;  // per position; per wedge of the mesh
  std::vector<SplitMesh::Point> places_;
  std::vector<std::uint32_t> wedge_point_;
  std::vector<SplitAttribute> attributes_;
  std::vector<std::vector<std::int32_t>> values_;
};

/// Steps by which memory is asked for what a collapse will read.
enum class ReplayStep : std::uint8_t {
  kPositions,   // which points it joins
  kPoints,      // the points, and where their corners are listed
  kCorners,     // of the point that goes
  kFaces,       // at these corners
  kNeighbours,  // the points around
  kCount
};

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

/// Replays the collapses from fine to coarse on faces of wedges, recording what each did.
class CollapseReplay {
 public:
  CollapseReplay(const NestedScales& scales, RoundedMesh& rounded)
      : scales_(scales),
        rounded_(rounded),
        points_(rounded.points()),
        faces_(faces_of(scales.mesh, rounded)),
        corners_(faces_, rounded.points()) {
    for (std::uint32_t f = 0; f < faces_.size(); ++f)
      if (faces_[f].alive) alive_.push_back(f);
  }

  // The parts refer to each other.
  CollapseReplay(const CollapseReplay&) = delete;
  CollapseReplay& operator=(const CollapseReplay&) = delete;

  /// From scale `fine` to `coarse`; the chapter leads back.
  SplitSource::Chapter run(const NestedScale& fine, const NestedScale& coarse) {
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

  /// All faces there are now.
  SplitSource::Chapter remaining_faces(int scale) const {
    SplitSource::Chapter chapter;
    chapter.scale = scale;
    for (const std::uint32_t f : alive_) chapter.patch.push_back({f, faces_[f].wedge});
    return chapter;
  }

 private:
  /// Who has used a point since, for the order of splits: a collapse uses its two points alone, the points
  /// around shared.
  struct PointUse {
    std::uint32_t alone = kNoIndex;   // last collapse that had it alone
    std::uint32_t shared = kNoIndex;  // head of a list of those that shared it since
  };

  // What is asked together lies together: collapses come in the order of their cost, anywhere on the surface.
  struct Point {
    std::uint32_t mark = 0;  // the last collapse that used it; up to begin_, `use` is of an earlier chapter
    PointUse use;
  };
  struct Mapping {
    std::uint32_t from, group, to;
  };
  struct Share {
    std::uint32_t collapse, next;
  };

  std::uint32_t point(std::uint32_t face, std::uint32_t corner) const {
    return faces_[face].point[corner % 3];
  }
  void put_wedge(std::uint32_t face, std::uint32_t corner, std::uint32_t wedge) {
    faces_[face].wedge[corner] = wedge;
    faces_[face].point[corner] = rounded_.point_of(wedge);
  }

  /// Collapses come in the order of their cost, anywhere on the surface.
  void look_ahead(std::uint32_t collapse, std::uint32_t end) const {
    LookAhead<ReplayStep, 4>::each_step([&](ReplayStep step, std::size_t ahead) {
      if (const std::size_t at = collapse + ahead; at < end) look_at(scales_.collapses[at], step);
    });
  }

  void look_at(const Collapse& collapse, ReplayStep step) const {
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
  void note_final(const NestedScale& coarse) {
    for (const std::uint32_t f : alive_) faces_[f].coarse_wedge.fill(kNoIndex);
    for (std::size_t i = 0; i < coarse.triangles.size(); ++i)
      for (std::size_t k = 0; k < 3; ++k)
        faces_[coarse.triangle_source[i]].coarse_wedge[k] = rounded_.wedge(coarse.triangles[i][k]);
  }

  void replay(std::uint32_t u, std::uint32_t v) {
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
  void gather_corners(std::uint32_t u) {
    gathered_.clear();
    for (const std::uint32_t c : corners_.at(u))
      if (faces_[c / 3].alive) gathered_.push_back(c);
    std::ranges::reverse(gathered_);
    corners_.clear(u);
  }

  /// Which points lie around the gathered corners, and where faces that go map wedges to.
  void look_around(std::uint32_t v) {
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

  bool has_edge_to(std::uint32_t v, std::uint32_t corner) const {
    return point(corner / 3, corner % 3 + 1) == v || point(corner / 3, corner % 3 + 2) == v;
  }

  void remove_face(std::uint32_t face) {
    chapter_->born.push_back({face, faces_[face].wedge});
    faces_[face].alive = false;
  }

  void move_corner(std::uint32_t corner, std::uint32_t v) {
    const std::uint32_t f = corner / 3, k = corner % 3;
    const std::uint32_t moved = faces_[f].wedge[k], last = faces_[f].coarse_wedge[k];
    chapter_->moves.push_back({f, moved});
    const bool stays = last != kNoIndex && rounded_.point_of(last) == v;
    put_wedge(f, k, stays ? last : target(moved, group(f), v));
  }

  /// Only now: lists without room give up corners of faces that are gone.
  void list_moved_corners(std::uint32_t move_begin, std::uint32_t v) {
    for (std::size_t i = move_begin; i < chapter_->moves.size(); ++i) {
      const std::uint32_t f = chapter_->moves[i].face;
      for (std::uint32_t k = 0; k < 3; ++k)
        if (point(f, k) == v) corners_.add(v, 3 * f + k);
    }
  }

  std::uint32_t group(std::uint32_t face) const {
    return std::uint32_t{faces_[face].material} << 16 | faces_[face].part;
  }

  /// Where a wedge of the point that goes is mapped by the removed faces, those of its own material and part
  /// first; a wedge without such a face keeps its values and becomes one of the point that stays.
  std::uint32_t target(std::uint32_t wedge, std::uint32_t group, std::uint32_t v) {
    for (const Mapping& m : map_)
      if (m.from == wedge && m.group == group) return m.to;
    for (const Mapping& m : map_)
      if (m.from == wedge) return m.to;
    const std::uint32_t made = rounded_.add_wedge(wedge, v);
    map_.push_back({wedge, group, made});
    return made;
  }

  /// Notes which earlier collapses this one comes after.
  void order(std::uint32_t number, std::uint32_t u, std::uint32_t v) {
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
  void patch_leftovers() {
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

  const NestedScales& scales_;
  RoundedMesh& rounded_;
  std::vector<Point> points_;
  std::vector<ReplayFace> faces_;
  std::vector<std::uint32_t> alive_;  // faces, rising; dead ones go when a chapter ends
  CornerLists corners_;
  std::vector<Share> shares_;
  std::vector<std::uint32_t> ring_, gathered_;
  std::vector<Mapping> map_;
  std::uint32_t now_ = 0, begin_ = 0;  // collapses replayed so far, and when the chapter began
  SplitSource::Chapter* chapter_ = nullptr;
};

[[noreturn]] void fail(const std::string& place, const std::string& expected, const std::string& found) {
  throw StageError("scales", place, expected, found);
}

void add_groups(const Mesh& mesh, bool merge_parts, SplitSource& source) {
  std::map<std::array<std::uint16_t, 2>, std::uint16_t> index;
  for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
    const std::array<std::uint16_t, 2> key{mesh.triangle_material[f],
                                           merge_parts ? std::uint16_t{0} : mesh.triangle_part[f]};
    const auto [at, added] = index.try_emplace(key, static_cast<std::uint16_t>(source.groups.size()));
    if (added) source.groups.push_back({key[0], key[1]});
    if (source.groups.size() > 65535) fail("materials and parts", "at most 65535 pairs", "more");
    source.face_group.push_back(at->second);
  }
}

}  // namespace

SplitSource make_vertex_splits(const NestedScales& scales, const std::vector<std::size_t>& kept,
                               const VertexSplitCoding& coding, const RunContext& context) {
  if (kept.empty() || kept[0] != 0) fail("kept scales", "S_0 first", "another");
  SplitSource source;
  add_groups(scales.mesh, coding.merge_parts, source);
  RoundedMesh rounded(scales, coding);
  CollapseReplay replay(scales, rounded);
  for (std::size_t i = 1; i < kept.size(); ++i) {
    context.check_cancelled();
    source.chapters.push_back(replay.run(scales.scales.at(kept[i - 1]), scales.scales.at(kept[i])));
  }
  source.chapters.push_back(replay.remaining_faces(scales.scales.at(kept.back()).scale));
  std::reverse(source.chapters.begin(), source.chapters.end());
  rounded.move_to(source);
  return source;
}

}  // namespace texmesh
