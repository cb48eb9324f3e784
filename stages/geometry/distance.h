#pragma once
#include <span>

#include "format/base/buckets.h"
#include "stages/data/nested_scales.h"

namespace texmesh {

/// A triangle and its place along a space-filling curve.
struct CurvedTriangle {
  std::uint64_t code = 0;
  std::uint32_t triangle = 0;
};

/// Answers "how far is this point from the surface" exactly (point to triangle), about a million times a
/// second. A tree of boxes, four side by side, over the triangles in the order of a space-filling curve:
/// built in linear time, since most surfaces are asked a few thousand questions only. Deterministic.
class SurfaceDistance {
 public:
  /// Triangles index `wedge_position`, which indexes `positions`. At least one triangle.
  SurfaceDistance(const std::vector<Vec3f>& positions, const std::vector<std::uint32_t>& wedge_position,
                  const std::vector<Triangle>& triangles);
  /// Distance in the positions' unit; safe to call from several threads. A caller that only asks whether the
  /// distance exceeds `enough` gets some upper bound <= enough, several times faster, where it does not.
  double operator()(Vec3d p, double enough = 0) const;

  /// A triangle to begin with: where one near the point is known, the search is several times shorter.
  struct Hint {
    std::uint32_t leaf = kNoIndex;  // of the last answer; none at first
  };
  /// As operator(), beginning with the triangle of the hint, which becomes the closest one found. With the
  /// same chain of points and hints the same bits; another chain may differ in the last one.
  double operator()(Vec3d p, Hint& hint) const;
  /// The hint that names the triangle with this index in the constructor's list.
  Hint hint_of(std::uint32_t triangle) const { return {leaf_of_[triangle]}; }
  /// Whichever hint is nearer to the point; the first one, which names a triangle, where the other names
  /// nothing.
  Hint nearer(Hint a, Hint b, Vec3d p) const;
  /// The square of the distance to that triangle alone: no less than that of the distance.
  double distance2_to(std::uint32_t triangle, Vec3d p) const;
  Vec3f centre_of(std::uint32_t triangle) const;

 private:
  using Lanes = float __attribute__((vector_size(16)));
  /// Up to four boxes, side by side, in the unit of `frame_`, a little too large. Of a leaf `first` and
  /// `count` are its triangles, whose corners stand at corners_[3 * first]; of an inner child count is 0 and
  /// `first` a node. Behind the last child boxes are nowhere.
  struct Node {
    Lanes min[3], max[3];
    std::uint32_t first[4], count[4];
  };
  /// Where the boxes are: floats near 0 are fine and cheap.
  struct Frame {
    Vec3d centre;
    double scale = 1;
  };
  void split(std::uint32_t node, std::uint32_t begin, std::uint32_t end,
             const std::vector<CurvedTriangle>& order);
  void fit_boxes();
  Lanes box_distances2(const Lanes (&p)[3], const Node& node) const;
  double search(Vec3d p, double enough, double best, std::uint32_t& leaf) const;
  double leaf_distance2(std::uint32_t leaf, Vec3d p) const;

  Frame frame_;
  std::vector<Node> nodes_;
  std::vector<Vec3f> corners_;  // three per triangle, in the order of the leaves
  std::vector<std::uint32_t> leaf_of_;
};

/// A point on a triangle: weights of its three corners, summing to 1.
struct SurfaceSample {
  std::uint32_t triangle = 0;
  float weight[3] = {1, 0, 0};
};

/// As many points as say something about so many triangles, at most `most`: where there are few, more than
/// one for every fourth say little more.
std::size_t enough_samples(std::size_t triangles, std::size_t most);

/// `count` points spread over the surface in proportion to area: equal steps along the running sum of areas,
/// weights from a low-discrepancy sequence. Deterministic; empty when no triangle has an area.
std::vector<SurfaceSample> sample_surface(const std::vector<Vec3f>& positions,
                                          const std::vector<std::uint32_t>& wedge_position,
                                          const std::vector<Triangle>& triangles, std::size_t count);

/// Per position of S_0: the one that stands for it when the first `count` collapses are done. What has
/// collapsed into a component that vanished is stood for by the last position of it.
std::vector<std::uint32_t> survivors(std::size_t positions, std::span<const Collapse> collapses,
                                     std::size_t count);

/// The triangles at each place of a mesh.
class Spokes {
 public:
  /// A triangle at a place, and the place of its next corner.
  struct Spoke {
    std::uint32_t triangle, next;
  };
  /// `place_of` gives a wedge's place, below `places`. Triangles of a place keep their order.
  Spokes(std::size_t places, std::span<const Triangle> triangles, auto&& place_of)
      : spokes_(in_buckets<Spoke>(places, [&](auto&& put) {
          for (std::uint32_t t = 0; t < triangles.size(); ++t)
            for (std::size_t k = 0; k < 3; ++k)
              put(place_of(triangles[t][k]), {t, place_of(triangles[t][(k + 1) % 3])});
        })) {}
  std::span<const Spoke> at(std::uint32_t place) const { return spokes_[place]; }

 private:
  Buckets<Spoke> spokes_;
};

/// Guesses where a scale is nearest to a point of a finer one: from what a corner near the point has become
/// on to nearer corners, and there among the triangles. Most guesses are right, and all bound the distance.
/// Safe to ask from many threads; the arguments must outlive it.
class ScaleWalk {
 public:
  ScaleWalk(const Mesh& mesh, const std::vector<Triangle>& triangles, std::span<const std::uint32_t> survivor,
            const SurfaceDistance& surface);

  struct Guess {
    double distance2 = 0;  // infinite where there is none: the corner has vanished with its component
    std::uint32_t triangle = kNoIndex;
    SurfaceDistance::Hint hint;  // that triangle, or nothing
  };
  Guess from(std::uint32_t position, Vec3d point) const;
  /// Of the triangles that from() compares only the one whose centre is nearest: no less than from(), mostly
  /// the same, for a third of the time.
  Guess quick_from(std::uint32_t position, Vec3d point) const;

 private:
  std::uint32_t nearest_corner(std::uint32_t from, Vec3d point) const;

  const std::vector<Vec3f>& positions_;
  std::span<const std::uint32_t> survivor_;
  const SurfaceDistance& surface_;
  Spokes spokes_;  // of positions
};

}  // namespace texmesh
