#include "stages/scales/vertex_split.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "format/base/errors.h"
#include "format/base/no_index.h"
#include "format/split/split_source.h"

namespace texmesh {
namespace {

[[noreturn]] void fail(const std::string& place, const std::string& expected, const std::string& found) {
  throw StageError("scales", place, expected, found);
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
  static std::int32_t place(const QuantisationGrid& grid, float x, int axis) {
    const auto largest = (std::uint32_t{1} << grid.bits) - 1;
    return static_cast<std::int32_t>(std::min(grid.index(x, axis), largest));
  }
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
    std::vector<std::uint32_t> order(n);
    std::iota(order.begin(), order.end(), 0u);
    auto compare = [&](std::uint32_t a, std::uint32_t b) {
      const std::uint32_t pa = point_[mesh_.wedge_position[a]], pb = point_[mesh_.wedge_position[b]];
      if (pa != pb) return pa < pb ? -1 : 1;
      for (std::size_t k = 0; k < attributes_.size(); ++k) {
        const auto c = static_cast<std::size_t>(split_components(attributes_[k].kind));
        for (std::size_t i = 0; i < c; ++i)
          if (all[k][a * c + i] != all[k][b * c + i]) return all[k][a * c + i] < all[k][b * c + i] ? -1 : 1;
      }
      return 0;
    };
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      const int c = compare(a, b);
      return c < 0 || (c == 0 && a < b);
    });
    std::vector<std::uint32_t> same(n);  // the lowest equal wedge
    for (std::size_t i = 0; i < n; ++i)
      same[order[i]] = i > 0 && compare(order[i - 1], order[i]) == 0 ? same[order[i - 1]] : order[i];
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

/// Who has used a point since, for the order of splits: a collapse uses its two points alone, the points
/// around shared.
struct PointUse {
  std::uint32_t alone = kNoIndex;   // last collapse that had it alone
  std::uint32_t shared = kNoIndex;  // head of a list of those that shared it since
};

// What is asked together lies together: collapses come in the order of their cost, anywhere on the surface.
struct ReplayPoint {
  std::uint32_t head = kNoIndex;  // its first corner
  std::uint32_t mark = 0;         // the last collapse that counted it as one of those around
  PointUse use;
};
struct ReplayFace {
  std::array<std::uint32_t, 3> wedge{}, point{};
  std::array<std::uint32_t, 3> next{};   // the next corner (3 * face + corner) at its point
  std::array<std::uint32_t, 3> final{};  // wedges in the coarse scale, where it has the face
  bool alive = true;
};

/// Replays the collapses from fine to coarse on faces of wedges, recording what each did.
class CollapseReplay {
 public:
  CollapseReplay(const NestedScales& scales, RoundedMesh& rounded)
      : scales_(scales), rounded_(rounded), points_(rounded.points()), faces_(scales.mesh.triangles.size()) {
    for (std::uint32_t f = 0; f < faces_.size(); ++f) {
      for (std::uint32_t k = 0; k < 3; ++k) put_wedge(f, k, rounded_.wedge(scales.mesh.triangles[f][k]));
      // Where rounding or twins leave a face with a corner twice it shows nothing and cannot take part.
      if (point(f, 0) == point(f, 1) || point(f, 1) == point(f, 2) || point(f, 2) == point(f, 0))
        faces_[f].alive = false;
      if (!faces_[f].alive) continue;
      for (std::uint32_t k = 0; k < 3; ++k) link(f, k);
    }
  }

  /// From scale `fine` to `coarse`; the chapter leads back.
  SplitSource::Chapter run(const NestedScale& fine, const NestedScale& coarse) {
    SplitSource::Chapter chapter;
    chapter.scale = fine.scale;
    chapter_ = &chapter;
    shares_.clear();
    for (ReplayPoint& p : points_) p.use = {};
    note_final(coarse);
    for (std::uint32_t c = fine.collapse_count; c < coarse.collapse_count; ++c) {
      const Collapse& collapse = scales_.collapses.at(c);
      if (collapse.vanishes_with_component()) continue;
      const std::uint32_t u = rounded_.point(collapse.from), v = rounded_.point(collapse.to);
      if (u != v && points_[u].head != kNoIndex) replay(u, v);
    }
    patch_leftovers();
    reverse(chapter);
    return chapter;
  }
  /// All faces there are now.
  SplitSource::Chapter remaining_faces(int scale) {
    SplitSource::Chapter chapter;
    chapter.scale = scale;
    for (std::uint32_t f = 0; f < faces_.size(); ++f)
      if (faces_[f].alive) chapter.patch.push_back({f, faces_[f].wedge});
    return chapter;
  }

 private:
  std::uint32_t point(std::uint32_t face, std::uint32_t corner) const {
    return faces_[face].point[corner % 3];
  }
  void put_wedge(std::uint32_t face, std::uint32_t corner, std::uint32_t wedge) {
    faces_[face].wedge[corner] = wedge;
    faces_[face].point[corner] = rounded_.point_of(wedge);
  }
  std::uint32_t& next(std::uint32_t corner) { return faces_[corner / 3].next[corner % 3]; }
  void link(std::uint32_t face, std::uint32_t corner) {
    std::uint32_t& head = points_[point(face, corner)].head;
    faces_[face].next[corner] = head;
    head = 3 * face + corner;
  }
  void unlink(std::uint32_t face, std::uint32_t corner) {
    std::uint32_t* at = &points_[point(face, corner)].head;
    while (*at != 3 * face + corner) at = &next(*at);
    *at = faces_[face].next[corner];
  }

  /// Wedges of the faces that the coarse scale has.
  void note_final(const NestedScale& coarse) {
    for (ReplayFace& f : faces_) f.final.fill(kNoIndex);
    for (std::size_t i = 0; i < coarse.triangles.size(); ++i)
      for (std::size_t k = 0; k < 3; ++k)
        faces_[coarse.triangle_source[i]].final[k] = rounded_.wedge(coarse.triangles[i][k]);
  }

  void replay(std::uint32_t u, std::uint32_t v) {
    const auto number = static_cast<std::uint32_t>(chapter_->splits.size());
    SplitSource::Split split{v,
                             u,
                             static_cast<std::uint32_t>(chapter_->moves.size()),
                             0,
                             static_cast<std::uint32_t>(chapter_->born.size()),
                             0};
    ring_.clear();
    corners_.clear();
    map_.clear();
    for (std::uint32_t c = points_[u].head; c != kNoIndex; c = next(c)) corners_.push_back(c);
    for (std::uint32_t c : corners_) {
      const std::uint32_t f = c / 3, k = c % 3, a = point(f, k + 1), b = point(f, k + 2);
      ring_.push_back(a);
      ring_.push_back(b);
      const std::array<std::uint32_t, 3>& wedge = faces_[f].wedge;
      if (a == v || b == v) map_.push_back({wedge[k], group(f), wedge[(k + (a == v ? 1 : 2)) % 3]});
    }
    order(number, u, v);
    for (std::uint32_t c : corners_) {
      const std::uint32_t f = c / 3, k = c % 3;
      if (point(f, k + 1) == v || point(f, k + 2) == v) {
        chapter_->born.push_back({f, faces_[f].wedge});
        for (std::uint32_t i = 0; i < 3; ++i)
          if (i != k) unlink(f, i);
        faces_[f].alive = false;
      } else {
        const std::uint32_t moved = faces_[f].wedge[k], last = faces_[f].final[k];
        chapter_->moves.push_back({f, moved});
        const bool stays = last != kNoIndex && rounded_.point_of(last) == v;
        put_wedge(f, k, stays ? last : target(moved, group(f), v));
      }
    }
    points_[u].head = kNoIndex;
    for (std::uint32_t i = split.move_begin; i < chapter_->moves.size(); ++i) {
      const std::uint32_t f = chapter_->moves[i].face;
      for (std::uint32_t k = 0; k < 3; ++k)
        if (point(f, k) == v) link(f, k);
    }
    split.move_end = static_cast<std::uint32_t>(chapter_->moves.size());
    split.born_end = static_cast<std::uint32_t>(chapter_->born.size());
    chapter_->splits.push_back(split);
  }
  std::uint32_t group(std::uint32_t face) const {
    return std::uint32_t{scales_.mesh.triangle_material[face]} << 16 | scales_.mesh.triangle_part[face];
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
    for (std::uint32_t p : {u, v}) {
      PointUse& use = points_[p].use;
      after(use.alone);
      for (std::uint32_t s = use.shared; s != kNoIndex; s = shares_[s].next) after(shares_[s].collapse);
      use = {number, kNoIndex};
    }
    ++now_;
    points_[u].mark = points_[v].mark = now_;
    for (std::uint32_t p : ring_) {
      ReplayPoint& around = points_[p];
      if (around.mark == now_) continue;
      around.mark = now_;
      after(around.use.alone);
      shares_.push_back({number, around.use.shared});
      around.use.shared = static_cast<std::uint32_t>(shares_.size() - 1);
    }
  }

  /// Faces that the coarse scale does not have although no collapse removed them become the chapter's patch.
  void patch_leftovers() {
    for (std::uint32_t f = 0; f < faces_.size(); ++f) {
      ReplayFace& face = faces_[f];
      if (!face.alive) continue;
      if (face.final[0] == kNoIndex) {
        chapter_->patch.push_back({f, face.wedge});
        for (std::uint32_t k = 0; k < 3; ++k) unlink(f, k);
        face.alive = false;
      } else if (face.wedge != face.final) {
        fail("collapses", "those that lead to the nested scales",
             "triangle " + std::to_string(f) + " elsewhere");
      }
    }
  }
  /// Splits are the collapses backwards.
  static void reverse(SplitSource::Chapter& chapter) {
    const auto last = static_cast<std::uint32_t>(chapter.splits.size()) - 1;
    std::reverse(chapter.splits.begin(), chapter.splits.end());
    for (auto& [a, b] : chapter.before) a = last - a, b = last - b;
  }

  struct Mapping {
    std::uint32_t from, group, to;
  };
  struct Share {
    std::uint32_t collapse, next;
  };
  const NestedScales& scales_;
  RoundedMesh& rounded_;
  std::vector<ReplayPoint> points_;
  std::vector<ReplayFace> faces_;
  std::vector<Share> shares_;
  std::vector<std::uint32_t> ring_, corners_;
  std::vector<Mapping> map_;
  std::uint32_t now_ = 0;
  SplitSource::Chapter* chapter_ = nullptr;
};

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
