#include "stages/geometry/scale_frames.h"

#include "format/base/numbering.h"
#include "stages/base/parallel.h"
#include "stages/geometry/distance.h"
#include "stages/geometry/triangle_tree.h"

namespace texmesh {
namespace {

constexpr std::size_t kSamplesPerNormal = 8;  // more make no difference that shows
constexpr int kSteps = 4;
constexpr int kMostWalks = 3;
constexpr double kLeastFacing = 0.25;  // cosine between a sample and the triangle that it is put on

/// Where S_0's positions are in a scale: the position that they have collapsed into, one of twins for all;
/// kNoIndex = vanished with its component.
std::vector<std::uint32_t> places_in(const NestedScales& scales, const NestedScale& scale) {
  std::vector<std::uint32_t> place =
      survivors(scales.mesh.positions.size(), scales.collapses, scale.collapse_count);
  std::vector<bool> vanished(place.size(), false);
  for (std::size_t i = 0; i < scale.collapse_count; ++i)
    if (scales.collapses[i].vanishes_with_component()) vanished[scales.collapses[i].from] = true;
  for (std::uint32_t& p : place)
    if (vanished[p]) p = kNoIndex;
  if (!scales.twin.empty())
    for (std::uint32_t& p : place)
      if (p != kNoIndex) p = scales.twin[p];
  return place;
}

/// Area that each wedge of S_0 stands for; 0 = not in use.
std::vector<double> wedge_areas(const Mesh& mesh, const std::vector<Triangle>& triangles) {
  std::vector<double> area(mesh.wedge_count(), 0);
  for (const Triangle& t : triangles) {
    const auto at = [&](std::size_t k) { return to_double(mesh.positions[mesh.wedge_position[t[k]]]); };
    const double third = length(cross(at(1) - at(0), at(2) - at(0))) / 6;
    for (const std::uint32_t w : t) area[w] += third;
  }
  return area;
}

/// What a sample says about the normals of a face's corners.
struct Tie {
  std::array<std::uint32_t, 3> corner{};  // index of normals
  std::array<double, 3> weight{};
  Vec3f normal;
  double area = 0;
};

/// Steps of least squares with lumped weights, which never overshoot. `tie_of(sample)`: nothing for a sample
/// that no face takes.
void improve(std::size_t samples, auto&& tie_of, std::vector<Vec3d>& normals) {
  std::vector<Vec3d> change(normals.size());
  std::vector<double> weight(normals.size());
  for (int step = 0; step < kSteps; ++step) {
    std::fill(change.begin(), change.end(), Vec3d{});
    std::fill(weight.begin(), weight.end(), 0);
    for (std::size_t s = 0; s < samples; ++s) {
      const std::optional<Tie> tie = tie_of(s);
      if (!tie) continue;
      Vec3d here;
      for (std::size_t k = 0; k < 3; ++k) here = here + normals[tie->corner[k]] * tie->weight[k];
      const Vec3d missing = to_double(tie->normal) - normalized(here);
      for (std::size_t k = 0; k < 3; ++k) {
        const double w = tie->weight[k] * tie->area;
        change[tie->corner[k]] = change[tie->corner[k]] + missing * w;
        weight[tie->corner[k]] += w;
      }
    }
    for (std::size_t i = 0; i < normals.size(); ++i) {
      if (!(weight[i] > 0)) continue;
      const Vec3d next = normals[i] + change[i] * (1 / weight[i]);
      if (dot(next, next) > 1e-6) normals[i] = normalized(next);
    }
  }
}

/// The scale's triangles, around each place, and the normals that are sought.
class Fit {
 public:
  Fit(const NestedScales& scales, const NestedScale& scale)
      : mesh_(scales.mesh),
        place_(places_in(scales, scale)),
        normal_of_(mesh_.wedge_count(), kNoIndex),
        spokes_(mesh_.positions.size(), scale.triangles, [&](std::uint32_t w) { return place(w); }) {
    add_faces(scale);
  }
  void take_samples(const std::vector<Triangle>& finest, const RunContext& context);
  void improve_normals() {
    improve(
        samples_.size(),
        [this](std::size_t i) -> std::optional<Tie> {
          const Sample& s = samples_[i];
          if (s.face == kNoIndex) return std::nullopt;
          return Tie{faces_[s.face].normal, s.weight, mesh_.normals[s.wedge], s.area};
        },
        normals_);
  }
  ScaleFrames frames() const;

 private:
  struct Face {
    std::array<std::uint32_t, 3> normal, place;  // index into normals_; of the corners
    std::array<Vec3d, 3> corners;
    Vec3d up;  // unit, zero without area
  };
  /// A wedge of S_0 on a face.
  struct Sample {
    std::uint32_t wedge = 0, face = kNoIndex;
    std::array<double, 3> weight{};
    double area = 0;
  };
  std::uint32_t place(std::uint32_t wedge) const { return place_[mesh_.wedge_position[wedge]]; }
  void add_faces(const NestedScale& scale);
  void put_on_face(Sample& sample) const;

  const Mesh& mesh_;
  std::vector<std::uint32_t> place_, normal_of_;  // per position; per wedge
  std::vector<Vec3d> normals_;
  std::vector<Face> faces_;
  Spokes spokes_;  // of places
  std::vector<Sample> samples_;
};

void Fit::add_faces(const NestedScale& scale) {
  for (const Triangle& t : scale.triangles) {
    Face face;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t w = t[k];
      face.normal[k] = numbered(normal_of_[w], normals_, to_double(mesh_.normals[w]));
      face.place[k] = place(w);
      face.corners[k] = to_double(mesh_.positions[mesh_.wedge_position[w]]);
    }
    face.up = normalized(cross(face.corners[1] - face.corners[0], face.corners[2] - face.corners[0]));
    faces_.push_back(face);
  }
}

/// From the place that the sample's position has collapsed into, on to the places at which nearer triangles
/// meet.
void Fit::put_on_face(Sample& sample) const {
  const Vec3d at = to_double(mesh_.positions[mesh_.wedge_position[sample.wedge]]);
  const Vec3d n = to_double(mesh_.normals[sample.wedge]);
  double best = 0;
  std::uint32_t last = kNoIndex, p = place(sample.wedge);
  for (int walk = 0; walk < kMostWalks && p != last; ++walk) {
    last = p;
    const std::uint32_t before = sample.face;
    for (const Spokes::Spoke& spoke : spokes_.at(p)) {
      const Face& face = faces_[spoke.triangle];
      if (!(dot(face.up, n) > kLeastFacing)) continue;
      const double height = dot(face.up, at - face.corners[0]);
      if (sample.face != kNoIndex && height * height >= best) continue;
      const OnTriangle found = closest_on_triangle(face.corners, at);
      if (sample.face != kNoIndex && found.distance2 >= best) continue;
      best = found.distance2;
      sample.face = spoke.triangle;
      sample.weight = found.weight;
    }
    if (sample.face == before) return;
    const auto nearest = std::max_element(sample.weight.begin(), sample.weight.end());
    p = faces_[sample.face].place[static_cast<std::size_t>(nearest - sample.weight.begin())];
  }
}

void Fit::take_samples(const std::vector<Triangle>& finest, const RunContext& context) {
  const std::vector<double> area = wedge_areas(mesh_, finest);
  const auto stays = [&](std::uint32_t w) { return area[w] > 0 && place(w) != kNoIndex; };
  std::size_t count = 0;
  for (std::uint32_t w = 0; w < area.size(); ++w) count += stays(w) ? 1 : 0;
  const std::size_t every = count / (kSamplesPerNormal * normals_.size() + 1) + 1;
  samples_.reserve(count / every + 1);
  count = 0;
  for (std::uint32_t w = 0; w < area.size(); ++w)
    if (stays(w) && count++ % every == 0) samples_.push_back({w, kNoIndex, {}, area[w]});
  parallel_each(context, samples_.size(), 4096, [&](std::size_t i) { put_on_face(samples_[i]); });
}

ScaleFrames Fit::frames() const {
  ScaleFrames out{mesh_.normals, mesh_.tangents};
  for (std::uint32_t w = 0; w < normal_of_.size(); ++w) {
    if (normal_of_[w] == kNoIndex) continue;
    const Vec3d n = normals_[normal_of_[w]];
    out.normals[w] = to_float(n);
    if (out.tangents.empty() || out.tangents[w].w == 0) continue;
    const Vec4f old = out.tangents[w];
    const Vec3d t{old.x, old.y, old.z}, along = t - n * dot(t, n);
    if (!(dot(along, along) > 1e-6)) continue;
    const Vec3f turned = to_float(normalized(along));
    out.tangents[w] = {turned.x, turned.y, turned.z, old.w};
  }
  return out;
}

constexpr std::size_t kMostSamples = 400000;

std::vector<std::optional<Tie>> ties_of(std::span<const Vec3d> points, std::span<const Triangle> triangles,
                                        const NormalSamples& samples, const RunContext& context) {
  const TriangleTree tree(points, triangles);
  std::vector<std::optional<Tie>> out(samples.places.size());
  parallel_each(context, out.size(), 256, [&](std::size_t s) {
    const TriangleTree::Nearest found = tree.nearest(samples.places[s]);
    const Triangle& t = triangles[found.triangle];
    const Vec3d face = normalized(cross(points[t[1]] - points[t[0]], points[t[2]] - points[t[0]]));
    if (dot(face, to_double(samples.normals[s])) > kLeastFacing)
      out[s] = Tie{t, found.weight, samples.normals[s], samples.areas[s]};
  });
  return out;
}

}  // namespace

ScaleFrames scale_frames(const NestedScales& scales, std::size_t index, const RunContext& context) {
  if (index == 0 || scales.mesh.normals.empty()) return {scales.mesh.normals, scales.mesh.tangents};
  Fit fit(scales, scales.scales.at(index));
  fit.take_samples(scales.scales[0].triangles, context);
  fit.improve_normals();
  return fit.frames();
}

Mesh lit_scale(const NestedScales& scales, std::size_t index, const RunContext& context) {
  return lit_scale(scales, index, scale_frames(scales, index, context));
}

Mesh lit_scale(const NestedScales& scales, std::size_t index, const ScaleFrames& frames) {
  const NestedScale& scale = scales.scales.at(index);
  Mesh out = extract_scale(scales, scale);
  for (std::size_t t = 0; t < scale.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t from = scale.triangles[t][k], to = out.triangles[t][k];
      if (!frames.normals.empty()) out.normals[to] = frames.normals[from];
      if (!frames.tangents.empty()) out.tangents[to] = frames.tangents[from];
    }
  return out;
}

std::size_t stand_in_scale(const NestedScales& scales, std::size_t most_triangles, double farthest) {
  const std::vector<NestedScale>& all = scales.scales;
  std::size_t i = 0;
  while (i + 1 < all.size() && all[i].triangles.size() > most_triangles &&
         2 * all[i + 1].triangles.size() >= most_triangles && double{all[i + 1].error_rms} <= farthest)
    ++i;
  return i;
}

NormalSamples normal_samples(const Mesh& mesh) {
  NormalSamples out;
  if (mesh.normals.empty()) return out;
  const std::vector<double> areas = wedge_areas(mesh, mesh.triangles);
  const std::size_t every = mesh.wedge_count() / kMostSamples + 1;
  for (std::size_t w = 0; w < mesh.wedge_count(); w += every) {
    if (!(areas[w] > 0)) continue;
    out.places.push_back(to_double(mesh.positions[mesh.wedge_position[w]]));
    out.normals.push_back(mesh.normals[w]);
    out.areas.push_back(areas[w]);
  }
  return out;
}

std::vector<Vec3f> fit_normals(std::span<const Vec3d> points, std::span<const Triangle> triangles,
                               std::vector<Vec3f> normals, const NormalSamples& samples,
                               const RunContext& context) {
  if (triangles.empty() || samples.places.empty()) return normals;
  const std::vector<std::optional<Tie>> ties = ties_of(points, triangles, samples, context);
  std::vector<Vec3d> fitted;
  for (const Vec3f n : normals) fitted.push_back(to_double(n));
  improve(
      ties.size(), [&](std::size_t s) { return ties[s]; }, fitted);
  for (std::size_t i = 0; i < normals.size(); ++i) normals[i] = to_float(fitted[i]);
  return normals;
}

}  // namespace texmesh
