#include "pipeline/import/mesh_builder.h"

#include "format/base/portable_math.h"
#include "stages/geometry/mesh_topology.h"

namespace texmesh {
namespace {

bool usable(const Vec3d& p, double largest) {
  auto in_range = [largest](double x) { return std::fabs(x) <= largest; };  // false for NaN
  return in_range(p.x) && in_range(p.y) && in_range(p.z);
}

// GCC 12.2 at -O2 drops the rounding of to_double(to_float(v)) when it puts x and y into one vector register
// (found by the test; -fno-tree-slp-vectorize does not), hence volatile.
double float_exact(double x) {
  const volatile float rounded = static_cast<float>(x);
  return static_cast<double>(rounded);
}

Vec3d choose_origin(const std::vector<Vec3d>& positions, double largest) {
  Box3d box;
  for (const Vec3d& p : positions)
    if (usable(p, largest)) box.extend(p);
  if (box.empty()) return {};
  double farthest = 0;
  for (int i = 0; i < 3; ++i) farthest = std::max({farthest, std::fabs(box.min[i]), std::fabs(box.max[i])});
  const double rounding = farthest / 16777216;  // half a unit in the last place of a float, at most
  if (rounding <= 1e-7 * box.diagonal()) return {};
  const Vec3d centre = box.centre();
  return {float_exact(centre.x), float_exact(centre.y), float_exact(centre.z)};
}

/// The unit of the last decimal, where the coordinates are those of a text with few decimals; 0 where they
/// are not, and where so few digits are no rounding but the design.
double decimal_step(const std::vector<Vec3d>& positions, double magnitude) {
  constexpr int kLeastDecimals = 3, kMostDecimals = 8;
  constexpr std::size_t kLooks = 4096;
  constexpr double kLeastUnits = 1e4;  // five digits
  const std::size_t stride = positions.size() / kLooks + 1;
  double unit = 1, units = 1;
  int decimals = 0;
  for (std::size_t i = 0; i < positions.size(); i += stride)
    for (int k = 0; k < 3; ++k) {
      const double x = positions[i][k];
      if (!(std::fabs(x) <= magnitude)) continue;
      while (decimals <= kMostDecimals && std::fabs(x * units - std::round(x * units)) > 1e-3)
        ++decimals, unit /= 10, units *= 10;
      if (decimals > kMostDecimals) return 0;
    }
  return decimals >= kLeastDecimals && magnitude * units >= kLeastUnits ? unit : 0;
}

}  // namespace

void set_positions(Mesh& mesh, const std::vector<Vec3d>& positions, double largest) {
  mesh.origin = choose_origin(positions, largest);
  if (mesh.rounding.empty()) {
    double magnitude = 0;
    for (const Vec3d& p : positions)
      if (usable(p, largest))
        magnitude = std::max({magnitude, std::fabs(p.x), std::fabs(p.y), std::fabs(p.z)});
    // Numbers that were rounded to a decimal differ by one unit at most: half is four halves too many.
    mesh.rounding = {
        std::max(float_unit(magnitude), static_cast<float>(decimal_step(positions, magnitude) / 2))};
  }
  mesh.positions.resize(positions.size());
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (std::size_t i = 0; i < positions.size(); ++i)
    mesh.positions[i] =
        usable(positions[i], largest) ? to_float(positions[i] - mesh.origin) : Vec3f{nan, nan, nan};
}

namespace {

std::uint64_t bits(float x) { return std::bit_cast<std::uint32_t>(x); }
bool equal_bits(float a, float b) {
  return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b);
}
bool equal_bits(Vec2f a, Vec2f b) { return equal_bits(a.x, b.x) && equal_bits(a.y, b.y); }
bool equal_bits(Vec3f a, Vec3f b) {
  return equal_bits(a.x, b.x) && equal_bits(a.y, b.y) && equal_bits(a.z, b.z);
}
bool equal_bits(Vec4f a, Vec4f b) {
  return equal_bits(a.x, b.x) && equal_bits(a.y, b.y) && equal_bits(a.z, b.z) && equal_bits(a.w, b.w);
}

bool finite_normal(const Vec3d& p) { return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z); }

// Twice the area vector (Newell), about the first corner so that far-away polygons keep their digits.
Vec3d area_vector(std::span<const Vec3d> points) {
  Vec3d sum;
  for (std::size_t i = 1; i + 1 < points.size(); ++i)
    sum = sum + cross(points[i] - points[0], points[i + 1] - points[0]);
  return sum;
}

void triangulate_quad(std::span<const Vec3d> p, std::vector<std::array<std::uint32_t, 3>>& triangles) {
  const Vec3d n = area_vector(p);
  auto along = [&](int a, int b, int c) { return dot(cross(p[b] - p[a], p[c] - p[a]), n) > 0; };
  const bool first = along(0, 1, 2) && along(0, 2, 3), second = along(0, 1, 3) && along(1, 2, 3);
  const Vec3d d02 = p[2] - p[0], d13 = p[3] - p[1];
  const bool shorter = dot(d13, d13) < dot(d02, d02);
  if (second && (!first || shorter)) {
    triangles.push_back({0, 1, 3});
    triangles.push_back({1, 2, 3});
  } else {
    triangles.push_back({0, 1, 2});
    triangles.push_back({0, 2, 3});
  }
}

// The polygon seen along its area vector: the two axes that matter, turned so that it runs counter-clockwise.
std::vector<Vec2d> project(std::span<const Vec3d> points, const Vec3d& n) {
  const double x = std::fabs(n.x), y = std::fabs(n.y), z = std::fabs(n.z);
  const int drop = x >= y && x >= z ? 0 : y >= z ? 1 : 2;
  const int a = (drop + 1) % 3, b = (drop + 2) % 3;
  const bool flip = n[drop] < 0;
  std::vector<Vec2d> flat;
  for (const Vec3d& p : points) {
    const Vec3d q = p - points[0];
    flat.push_back(flip ? Vec2d{q[b], q[a]} : Vec2d{q[a], q[b]});
  }
  return flat;
}

double turn(const Vec2d& a, const Vec2d& b, const Vec2d& c) { return cross(b - a, c - a); }

bool inside(const Vec2d& p, const Vec2d& a, const Vec2d& b, const Vec2d& c) {
  return turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0;
}

// Ring of the corners that are still there.
struct Ring {
  std::vector<std::uint32_t> next, previous;
  explicit Ring(std::size_t n) : next(n), previous(n) {
    for (std::uint32_t i = 0; i < n; ++i) {
      next[i] = static_cast<std::uint32_t>((i + 1) % n);
      previous[i] = static_cast<std::uint32_t>((i + n - 1) % n);
    }
  }
  void remove(std::uint32_t i) {
    next[previous[i]] = next[i];
    previous[next[i]] = previous[i];
  }
};

bool is_ear(const std::vector<Vec2d>& flat, const Ring& ring, std::uint32_t i, std::uint64_t& work) {
  const std::uint32_t before = ring.previous[i], after = ring.next[i];
  const Vec2d &a = flat[before], &b = flat[i], &c = flat[after];
  if (!(turn(a, b, c) > 0)) return false;
  for (std::uint32_t k = ring.next[after]; k != before; k = ring.next[k]) {
    ++work;
    const Vec2d& p = flat[k];
    // A corner at the very place of a or c is the other side of a slit, not an obstacle.
    if (!(p == a) && !(p == c) && inside(p, a, b, c)) return false;
  }
  return true;
}

void cut_ears(const std::vector<Vec2d>& flat, std::vector<std::array<std::uint32_t, 3>>& triangles,
              std::uint64_t& work) {
  Ring ring(flat.size());
  std::size_t left = flat.size();
  std::uint32_t at = 0;
  std::size_t refused = 0;
  while (left > 3 && work < kMaxEarWork) {
    if (is_ear(flat, ring, at, work)) {
      triangles.push_back({ring.previous[at], at, ring.next[at]});
      ring.remove(at);
      --left;
      refused = 0;
      // Going on two corners further gives rounder pieces than a fan from one corner.
      at = ring.next[ring.next[at]];
    } else {
      at = ring.next[at];
      if (++refused > left) break;
    }
  }
  for (std::uint32_t b = ring.next[at]; left >= 3; --left, b = ring.next[b])
    triangles.push_back({at, b, ring.next[b]});
}

}  // namespace

float linear_from_srgb(double srgb) {
  if (!(srgb > 0)) return srgb <= 0 ? 0.0f : 1.0f;
  if (srgb >= 1) return 1;
  return static_cast<float>(light_of_srgb(srgb));
}

void count_lost(Lost& lost, const std::string& what, std::uint64_t count) {
  constexpr std::size_t kMostKinds = 32;
  lost[lost.size() < kMostKinds || lost.contains(what) ? what : "others"] += count;
}

void tell_trailing_bytes(Notes& notes, std::span<const std::uint8_t> bytes, std::uint64_t end) {
  const auto is_padding = [](std::uint8_t b) { return b == 0 || b == ' ' || (b >= '\t' && b <= '\r'); };
  if (!std::ranges::all_of(bytes.subspan(end), is_padding))
    add_warning(notes, "trailing-bytes", "byte " + std::to_string(end),
                "the file goes on after the end that its header declares; the rest is not read");
}

Material scan_material(std::string name) {
  Material material;
  material.name = std::move(name);
  material.metallic = 0;
  material.double_sided = true;
  return material;
}

void triangulate_polygon(std::span<const Vec3d> points, std::vector<std::array<std::uint32_t, 3>>& triangles,
                         std::uint64_t& work) {
  triangles.clear();
  const std::size_t n = points.size();
  if (n < 3) return;
  if (n == 3) {
    triangles.push_back({0, 1, 2});
    return;
  }
  if (n == 4) return triangulate_quad(points, triangles);
  const Vec3d normal = area_vector(points);
  if (finite_normal(normal) && dot(normal, normal) > 0)
    return cut_ears(project(points, normal), triangles, work);
  for (std::uint32_t i = 1; i + 1 < n; ++i) triangles.push_back({0, i, i + 1});
}

MeshBuilder::MeshBuilder(const std::vector<Vec3d>& positions, Attributes attributes)
    : positions_(positions), attributes_(attributes) {}

std::uint64_t MeshBuilder::hash(const Corner& c) const {
  std::uint64_t h = hash_with(0, c.position);
  const auto add = [&h](float a, float b) { h = hash_with(h, bits(a) << 32 | bits(b)); };
  if (attributes_.uv) add(c.uv.x, c.uv.y);
  if (attributes_.normals) add(c.normal.x, c.normal.y), add(c.normal.z, 0);
  if (attributes_.colours) add(c.colour.x, c.colour.y), add(c.colour.z, c.colour.w);
  return h;
}

bool MeshBuilder::same(std::uint32_t w, const Corner& c) const {
  return mesh_.wedge_position[w] == c.position && (!attributes_.uv || equal_bits(mesh_.uv0[w], c.uv)) &&
         (!attributes_.normals || equal_bits(mesh_.normals[w], c.normal)) &&
         (!attributes_.colours || equal_bits(mesh_.colours[w], c.colour));
}

Corner MeshBuilder::corner_of(std::uint32_t w) const {
  Corner c;
  c.position = mesh_.wedge_position[w];
  if (attributes_.uv) c.uv = mesh_.uv0[w];
  if (attributes_.normals) c.normal = mesh_.normals[w];
  if (attributes_.colours) c.colour = mesh_.colours[w];
  return c;
}

std::uint32_t MeshBuilder::wedge(const Corner& c) {
  const std::uint32_t w = table_.number_of(
      hash(c), [&](std::uint32_t other) { return same(other, c); },
      [&](std::uint32_t other) { return hash(corner_of(other)); });
  if (w < mesh_.wedge_position.size()) return w;
  mesh_.wedge_position.push_back(c.position);
  if (attributes_.uv) mesh_.uv0.push_back(c.uv);
  if (attributes_.normals) mesh_.normals.push_back(c.normal);
  if (attributes_.colours) mesh_.colours.push_back(c.colour);
  return w;
}

void MeshBuilder::add_face(std::span<const Corner> corners, std::uint16_t material, std::uint16_t part) {
  if (corners.size() < 3) return;
  wedges_.clear();
  for (const Corner& c : corners) wedges_.push_back(wedge(c));
  pieces_.clear();
  if (corners.size() == 3) {
    pieces_.push_back({0, 1, 2});
  } else {
    points_.clear();
    for (const Corner& c : corners) points_.push_back(positions_[c.position]);
    triangulate_polygon(points_, pieces_, ear_work_);
  }
  for (const auto& t : pieces_) {
    mesh_.triangles.push_back({wedges_[t[0]], wedges_[t[1]], wedges_[t[2]]});
    mesh_.triangle_material.push_back(material);
    mesh_.triangle_part.push_back(part);
  }
}

Mesh MeshBuilder::finish() {
  set_positions(mesh_, positions_);
  table_ = FirstUseTable();
  Mesh mesh = std::move(mesh_);
  mesh_ = {};
  return mesh;
}

}  // namespace texmesh
