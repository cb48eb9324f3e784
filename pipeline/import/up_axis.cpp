#include "pipeline/import/up_axis.h"

#include <nlohmann/json.hpp>

#include "format/base/text_bytes.h"
#include "format/container/layout.h"
#include "stages/base/first_use_table.h"

namespace texmesh {

namespace {

using Axes = std::array<double, 3>;

Axes axes_of(Vec3d v) { return {v.x, v.y, v.z}; }

std::uint64_t hash_of_point(Vec3f p) {
  std::uint64_t hash = 0;
  for (const float x : {p.x, p.y, p.z}) hash = hash_with(hash, std::bit_cast<std::uint32_t>(x + 0.0f));
  return hash;
}

class UpGuess {
 public:
  explicit UpGuess(const Mesh& mesh) : mesh_(mesh) {
    Box3d box;
    for (const Triangle& t : mesh.triangles)
      for (std::size_t k = 0; k < 3; ++k) box.extend(to_double(point(t, k)));
    if (box.empty()) return;
    low_ = axes_of(box.min);
    high_ = axes_of(box.max);
    add_planes();
  }

  char best() {
    double extent_most = 0;
    for (std::size_t a = 0; a < 3; ++a) extent_most = std::max(extent_most, extent(a));
    for (std::size_t a = 0; a < 3; ++a)
      if (!(extent(a) > kThin * extent_most)) return '\0';
    add_openings();
    for (const std::size_t a : {std::size_t{1}, std::size_t{2}})
      if (stands_on(a)) return "xyz"[a];
    return '\0';
  }

 private:
  static constexpr double kThin = 0.2;       // of the largest extent
  static constexpr double kFlat = 0.02;      // of the axis' extent: what lies in the end's plane
  static constexpr double kRim = 0.05;       // the same of an opening's rim
  static constexpr double kFacing = 0.9;     // cosine
  static constexpr double kLeastPart = 0.1;  // of the box's face
  static constexpr double kTimesOthers = 3;
  static constexpr double kLowCentre = 0.58;  // of the extent: a cone stands, one on its tip does not

  Vec3f point(const Triangle& t, std::size_t k) const { return mesh_.positions[mesh_.wedge_position[t[k]]]; }
  double extent(std::size_t axis) const { return high_[axis] - low_[axis]; }
  double face(std::size_t axis) const { return extent((axis + 1) % 3) * extent((axis + 2) % 3); }

  void add_planes() {
    for (const Triangle& t : mesh_.triangles) {
      const Vec3d a = to_double(point(t, 0)), b = to_double(point(t, 1)), c = to_double(point(t, 2));
      const Vec3d doubled = cross(b - a, c - a);
      const double twice = length(doubled);
      if (!(twice > 0)) continue;
      const Axes normal = axes_of(doubled), middle = axes_of((a + b + c) * (1.0 / 3));
      area_ += twice / 2;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        net_[axis] += normal[axis] / 2;
        centre_[axis] += middle[axis] * twice / 2;
        const bool down = normal[axis]<-kFacing * twice, up = normal[axis]> kFacing * twice;
        if (down && middle[axis] < low_[axis] + kFlat * extent(axis)) planes_[axis][0] += twice / 2;
        if (up && middle[axis] > high_[axis] - kFlat * extent(axis)) planes_[axis][1] += twice / 2;
      }
    }
    for (double& c : centre_) c /= std::max(area_, 1e-300);
  }

  /// The sum of all normals is what an opening lacks, turned round; its rim tells at which end it is.
  void add_openings() {
    bool any = false;
    for (std::size_t axis = 0; axis < 3; ++axis) any = any || std::abs(net_[axis]) > kLeastPart * face(axis);
    if (!any) return;
    struct Edge {
      std::uint64_t hash;
      std::uint32_t triangle, corner;
    };
    std::vector<Edge> edges;
    edges.reserve(3 * mesh_.triangles.size());
    for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t)
      for (std::uint32_t k = 0; k < 3; ++k) {
        const Triangle& corners = mesh_.triangles[t];
        edges.push_back(
            {hash_of_point(point(corners, k)) + hash_of_point(point(corners, (k + 1) % 3)), t, k});
      }
    std::ranges::sort(edges, {}, &Edge::hash);
    double rim = 0;
    std::array<std::array<double, 2>, 3> at_end{};
    for (std::size_t i = 0; i < edges.size(); ++i) {
      if ((i > 0 && edges[i - 1].hash == edges[i].hash) ||
          (i + 1 < edges.size() && edges[i + 1].hash == edges[i].hash))
        continue;
      const Triangle& t = mesh_.triangles[edges[i].triangle];
      const Vec3d a = to_double(point(t, edges[i].corner)),
                  b = to_double(point(t, (edges[i].corner + 1) % 3));
      const double size = length(b - a);
      const Axes middle = axes_of((a + b) * 0.5);
      rim += size;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (middle[axis] < low_[axis] + kRim * extent(axis)) at_end[axis][0] += size;
        if (middle[axis] > high_[axis] - kRim * extent(axis)) at_end[axis][1] += size;
      }
    }
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (const std::size_t end : {std::size_t{0}, std::size_t{1}})
        if (at_end[axis][end] > rim / 2)
          planes_[axis][end] += std::max(0.0, end == 0 ? net_[axis] : -net_[axis]);
  }

  bool stands_on(std::size_t up) const {
    const double bottom = planes_[up][0] / face(up);
    if (bottom < kLeastPart || centre_[up] > low_[up] + kLowCentre * extent(up)) return false;
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (const std::size_t end : {std::size_t{0}, std::size_t{1}})
        if (!(axis == up && end == 0) && bottom < kTimesOthers * planes_[axis][end] / face(axis))
          return false;
    return true;
  }

  const Mesh& mesh_;
  Axes low_{}, high_{}, net_{}, centre_{};
  double area_ = 0;
  std::array<std::array<double, 2>, 3> planes_{};  // areas by axis and end: low, high
};

}  // namespace

char guessed_up(const Mesh& mesh) { return UpGuess(mesh).best(); }

void turn_up(Mesh& mesh, char up) {
  if (up != 'x' && up != 'z') return;
  const auto turn = [up](auto& v) { v = turned_up(v, up); };
  for (Vec4f& t : mesh.tangents) {
    const Vec3f v = turned_up(Vec3f{t.x, t.y, t.z}, up);
    t = {v.x, v.y, v.z, t.w};
  }
  turn(mesh.origin);
  for (Vec3f& p : mesh.positions) turn(p);
  for (Vec3f& n : mesh.normals) turn(n);
}

char turned_axis(const About& about, UpAxis up) {
  if (up != UpAxis::kAuto) return up == UpAxis::kKeep ? 'y' : enum_name(up)[0];
  const auto source = nlohmann::json::parse(about.source, nullptr, false);
  const std::string axis =
      source.is_object() && source.contains(kTurnedMember) ? source[kTurnedMember].value("up", "y") : "y";
  return axis == "x" || axis == "z" ? axis[0] : 'y';
}

std::string placed_annotations(const std::string& json, const About& source, UpAxis up, Vec3d origin,
                               const Box3d& box, Notes& notes) {
  if (json.empty()) return "";
  Annotations all = read_annotations(text_bytes(json), kAnnotationsPath);
  if (all.frame == AnnotationFrame::kSource) {
    const auto turn = [axis = turned_axis(source, up)](Vec3d v) { return turned_up(v, axis); };
    transform_annotations(
        all, [&](Vec3d p) { return turn(p) - origin; }, turn);
    all.frame = AnnotationFrame::kPackage;
  }
  if (const auto outside = annotations_outside(all, box); !outside.empty())
    add_warning(notes, "annotations-outside", kAnnotationsPath,
                std::to_string(outside.size()) + " of " + std::to_string(all.list.size()) +
                    " notes lie outside the object, the first is note " + std::to_string(outside.front()) +
                    "; coordinates are to be those of the source file");
  return write_annotations(all);
}

}  // namespace texmesh
