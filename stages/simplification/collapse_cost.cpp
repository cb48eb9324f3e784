#include "stages/simplification/collapse_cost.h"

#include <numeric>

#include "format/base/box.h"

namespace texmesh {
namespace {

// A full step of a colour channel counts as much as a shift by a twentieth of the diagonal.
constexpr double kColourLength = 0.05;
constexpr double kTint = 0.5;  // of the colours' weight where there is a texture
// Where charts are folded to slivers the gradient of the texture runs away; its square must not.
constexpr double kSteepest = 64;

Vec3d face_normal(const CollapseMesh& mesh, const CollapseMesh::Face& face) {
  const Vec3d a = mesh.point(face.point[0]);
  return cross(mesh.point(face.point[1]) - a, mesh.point(face.point[2]) - a);
}

/// Per material: how long one unit of UV is on the surface, so that the texture's distortion is a length like
/// the shape's.
std::vector<double> texture_lengths(const CollapseMesh& mesh, const Mesh& input) {
  std::vector<double> surface, texture, scale;
  for (std::uint32_t f = 0; f < mesh.faces().size(); ++f) {
    const CollapseMesh::Face& face = mesh.faces()[f];
    const std::size_t material = input.triangle_material[mesh.face_source(f)];
    if (material >= surface.size()) surface.resize(material + 1), texture.resize(material + 1);
    surface[material] += length(face_normal(mesh, face));
    const Vec2d a = mesh.wedge_uv(face.wedge[0]);
    texture[material] += std::fabs(cross(mesh.wedge_uv(face.wedge[1]) - a, mesh.wedge_uv(face.wedge[2]) - a));
  }
  for (std::size_t m = 0; m < surface.size(); ++m)
    scale.push_back(texture[m] > 0 ? std::sqrt(surface[m] / texture[m]) : 0);
  return scale;
}

double mean_edge(const CollapseMesh& mesh) {
  double sum = 0;
  for (const CollapseMesh::Face& face : mesh.faces())
    for (std::size_t k = 0; k < 3; ++k)
      sum += length(mesh.point(face.point[(k + 1) % 3]) - mesh.point(face.point[k]));
  return sum / (3 * static_cast<double>(std::max<std::size_t>(mesh.faces().size(), 1)));
}

bool colours_vary(const Mesh& input, auto&& same) {
  return !std::all_of(input.colours.begin(), input.colours.end(),
                      [&](const Vec4f& c) { return same(c, input.colours[0]); });
}

}  // namespace

CollapseCost::CollapseCost(const CollapseMesh& mesh, const Mesh& input, const SimplificationOptions& options)
    : mesh_(mesh) {
  add_shape();
  add_lines(input, options);
  if (options.order != CollapseOrder::kThesis) add_attributes(input, options);
}

void CollapseCost::add_shape() {
  quadric_.resize(mesh_.point_count());
  for (const CollapseMesh::Face& face : mesh_.faces()) {
    const Vec3d n = face_normal(mesh_, face);
    const double area = length(n) / 2;
    if (!(area > 0)) continue;
    const Vec3d unit = n * (0.5 / area);
    const double d = -dot(unit, mesh_.point(face.point[0]));
    for (std::uint32_t p : face.point) quadric_[p].add_plane(unit, d, area);
  }
}

/// Planes that stand on open borders, on borders of materials and parts, and on seams of the texture.
void CollapseCost::add_lines(const Mesh& input, const SimplificationOptions& options) {
  CollapseRing ring(mesh_);
  constexpr std::uint64_t kUnseen = ~std::uint64_t{0};
  struct Uses {
    std::uint64_t first = kUnseen;
    bool mixed = false;
  };
  std::vector<Uses> uses;  // per neighbour: material and part of the faces at the edge
  for (std::uint32_t u = 0; u < mesh_.point_count(); ++u) {
    ring.gather(u);
    uses.assign(ring.neighbours().size(), {});
    for (const CollapseRing::Corner& corner : ring.corners()) {
      const std::uint32_t t = mesh_.face_source(corner.face);
      const std::uint64_t use = std::uint64_t{input.triangle_material[t]} << 16 | input.triangle_part[t];
      for (std::uint32_t slot : {corner.a, corner.b}) {
        uses[slot].mixed = uses[slot].mixed || (uses[slot].first != kUnseen && uses[slot].first != use);
        uses[slot].first = use;
      }
    }
    for (const CollapseRing::Corner& corner : ring.corners()) {
      const CollapseRing::Neighbour& n = ring.neighbours()[corner.a];  // every edge of a face once
      const bool border = n.valence != 2 || uses[corner.a].mixed;
      const double factor = border ? options.boundary_weight : n.is_seam() ? options.seam_weight : 0;
      if (!(factor > 0)) continue;
      const Vec3d a = mesh_.point(u), edge = mesh_.point(n.point) - a;
      const Vec3d across = normalized(cross(edge, face_normal(mesh_, mesh_.faces()[corner.face])));
      const double weight = factor * dot(edge, edge);
      if (!(weight > 0) || across == Vec3d{}) continue;
      quadric_[u].add_plane(across, -dot(across, a), weight);
      quadric_[n.point].add_plane(across, -dot(across, a), weight);
    }
  }
}

void CollapseCost::add_attributes(const Mesh& input, const SimplificationOptions& options) {
  const bool normal = options.normal_weight > 0 && !input.normals.empty();
  const bool colour = options.colour_weight > 0;
  colour_varies_ = colour && colours_vary(input, [](const Vec4f& a, const Vec4f& b) {
                     return a.x == b.x && a.y == b.y && a.z == b.z;
                   });
  alpha_varies_ = colour && colours_vary(input, [](const Vec4f& a, const Vec4f& b) { return a.w == b.w; });
  texture_channels_ = options.uv_weight > 0 && mesh_.has_uv() ? 2 : 0;
  const std::size_t channels =
      texture_channels_ + (normal ? 3 : 0) + (colour_varies_ ? 3 : 0) + (alpha_varies_ ? 1 : 0);
  attribute_quadric_ = AttributeQuadrics(channels);
  if (channels == 0) return;
  if (texture_channels_ > 0) shift_per_cost_ = 1 / options.uv_weight;
  attribute_.assign(mesh_.wedge_count() * channels, 0);
  attribute_quadric_.resize(mesh_.wedge_count());
  fill_attributes(input, options);
  for (const CollapseMesh::Face& face : mesh_.faces()) add_gradients(face);
}

/// The weights of the kinds are in the lengths already.
void CollapseCost::fill_attributes(const Mesh& input, const SimplificationOptions& options) {
  const std::size_t channels = attribute_quadric_.channels();
  std::vector<double> texture;
  if (texture_channels_ > 0) texture = texture_lengths(mesh_, input);
  const double texture_factor = std::sqrt(options.uv_weight);
  const double normal_length = std::sqrt(options.normal_weight) * mean_edge(mesh_);
  // Beside a texture, which has the photograph, colours are tints.
  const double alpha_length = std::sqrt(options.colour_weight) * kColourLength;
  const double colour_length = alpha_length * (texture_channels_ > 0 ? std::sqrt(kTint) : 1);
  const bool normal = options.normal_weight > 0 && !input.normals.empty();
  for (std::uint32_t f = 0; f < mesh_.faces().size(); ++f)
    for (std::uint32_t w : mesh_.faces()[f].wedge) {
      double* at = attribute_.data() + w * channels;
      const std::uint32_t source = mesh_.wedge_source(w);
      if (texture_channels_ > 0) {
        const double s = texture_factor * texture[input.triangle_material[mesh_.face_source(f)]];
        const Vec2d uv = mesh_.wedge_uv(w);
        *at++ = s * uv.x, *at++ = s * uv.y;
      }
      if (normal)
        for (int k = 0; k < 3; ++k) *at++ = normal_length * input.normals[source][k];
      if (!colour_varies_ && !alpha_varies_) continue;
      const Vec4f c = input.colours[source];
      if (colour_varies_)
        *at++ = colour_length * c.x, *at++ = colour_length * c.y, *at++ = colour_length * c.z;
      if (alpha_varies_) *at++ = alpha_length * c.w;
    }
}

void CollapseCost::add_gradients(const CollapseMesh::Face& face) {
  const std::size_t channels = attribute_quadric_.channels();
  const Vec3d p0 = mesh_.point(face.point[0]);
  const Vec3d e1 = mesh_.point(face.point[1]) - p0, e2 = mesh_.point(face.point[2]) - p0;
  const Vec3d n = cross(e1, e2);
  const double square = dot(n, n);
  if (!(square > 0)) return;
  double area = std::sqrt(square) / 2;
  const Vec3d along1 = cross(e2, n) * (1 / square), along2 = cross(n, e1) * (1 / square);
  std::array<Vec3d, AttributeQuadrics::kMaxChannels> gradient;
  double steepest = 0;
  for (std::size_t k = 0; k < channels; ++k) {
    const double s0 = attributes(face.wedge[0])[k];
    gradient[k] = along1 * (attributes(face.wedge[1])[k] - s0) + along2 * (attributes(face.wedge[2])[k] - s0);
    if (k < texture_channels_) steepest = std::max(steepest, dot(gradient[k], gradient[k]));
  }
  if (steepest > kSteepest) area *= kSteepest / steepest;
  for (std::uint32_t w : face.wedge) {
    for (std::size_t k = 0; k < channels; ++k) attribute_quadric_.add_channel(w, k, gradient[k], area);
    attribute_quadric_.add_area(w, area);
  }
}

AttributeQuadrics::Step CollapseCost::step(std::uint32_t from, std::uint32_t to) const {
  AttributeQuadrics::Step s{};
  const double *a = attributes(from), *b = attributes(to);
  for (std::size_t k = 0; k < attribute_quadric_.channels(); ++k) s[k] = b[k] - a[k];
  return s;
}

CollapseCost::Distortion CollapseCost::distortion(const CollapseRing& ring,
                                                  const CollapseRing::WedgeMap& map) const {
  const Vec3d move = mesh_.point(ring.neighbours()[map.slot].point) - mesh_.point(ring.centre());
  Distortion d;
  double area = 0;
  for (std::size_t i = 0; i < ring.wedges().size(); ++i) {
    const std::uint32_t wedge = ring.wedges()[i], target = map.target[i];
    d.cost += attribute_quadric_.at(
        wedge, move, target == CollapseRing::kNone ? AttributeQuadrics::Step{} : step(wedge, target));
    area += attribute_quadric_.area(wedge);
  }
  if (texture_channels_ > 0 && area > 0) d.shift = std::sqrt(d.cost * shift_per_cost_ / area);
  return d;
}

void CollapseCost::merge(const CollapseRing& ring, const CollapseRing::WedgeMap& map) {
  const std::uint32_t point = ring.neighbours()[map.slot].point;
  quadric_[point].add(quadric_[ring.centre()]);
  if (!has_attributes()) return;
  const std::size_t channels = attribute_quadric_.channels();
  const Vec3d move = mesh_.point(point) - mesh_.point(ring.centre());
  for (std::size_t i = 0; i < ring.wedges().size(); ++i) {
    const std::uint32_t wedge = ring.wedges()[i];
    if (map.target[i] == CollapseRing::kNone) {
      attribute_quadric_.push_moved(wedge, move);
      for (std::size_t k = 0; k < channels; ++k) {
        const double value = attribute_[wedge * channels + k];
        attribute_.push_back(value);
      }
    } else {
      attribute_quadric_.merge(map.target[i], wedge, move, step(wedge, map.target[i]));
    }
  }
}

CollapseComponents::CollapseComponents(const CollapseMesh& mesh, const ConditionedMesh& input)
    : begin(input.component_count + 1, 0),
      points(mesh.point_count()),
      size(input.component_count, 0),
      cost(input.component_count, 0) {
  auto component = [&](std::uint32_t p) { return input.component[mesh.members(p)[0]]; };
  std::vector<Box3d> box(count());
  for (std::uint32_t p = 0; p < mesh.point_count(); ++p) {
    const std::uint32_t c = component(p);
    ++begin[c + 1];
    box[c].extend(mesh.point(p));
  }
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<std::uint32_t> at(begin.begin(), begin.end() - 1);
  for (std::uint32_t p = 0; p < mesh.point_count(); ++p) points[at[component(p)]++] = p;

  std::vector<double> area(count(), 0);
  for (const CollapseMesh::Face& face : mesh.faces()) {
    const Vec3d a = mesh.point(face.point[0]);
    area[component(face.point[0])] +=
        length(cross(mesh.point(face.point[1]) - a, mesh.point(face.point[2]) - a)) / 2;
  }
  for (std::size_t c = 0; c < count(); ++c) {
    size[c] = box[c].diagonal();
    // What moving the whole component by half its size would cost. Every area stands in the quadrics of three
    // corners, hence 3.
    cost[c] = 3 * area[c] * size[c] * size[c] / 4;
    if (area[c] > area[largest]) largest = static_cast<std::uint32_t>(c);
  }
}

}  // namespace texmesh
