#include <numeric>
#include <queue>
#include <tuple>

#include "examples/scan_model.h"
#include "examples/scan_noise.h"
#include "format/base/portable_math.h"
#include "format/base/vec.h"

namespace texmesh {
namespace {

using Corners = std::vector<std::array<std::uint32_t, 3>>;  // position indices

struct Sphere {
  std::vector<Vec3d> direction;
  Corners triangles;
};

// A cube's surface as a lattice of 6 n^2 cells, blown up to a sphere, its vertices shaken within their cells
// and its diagonals drawn at random, so that triangles are as irregular as a scanner's.
Sphere irregular_sphere(std::uint32_t n, std::uint32_t seed) {
  std::vector<std::array<std::uint64_t, 4>> cells;
  for (int axis = 0; axis < 3; ++axis)
    for (std::uint32_t side = 0; side < 2; ++side)
      for (std::uint32_t a = 0; a < n; ++a)
        for (std::uint32_t b = 0; b < n; ++b) {
          auto key = [&](std::uint32_t u, std::uint32_t v) {
            std::uint32_t c[3];
            c[axis] = side * n;
            c[(axis + 1) % 3] = u;
            c[(axis + 2) % 3] = v;
            return (static_cast<std::uint64_t>(c[0]) * (n + 1) + c[1]) * (n + 1) + c[2];
          };
          std::array<std::uint64_t, 4> cell{key(a, b), key(a + 1, b), key(a + 1, b + 1), key(a, b + 1)};
          if (side == 0) std::swap(cell[1], cell[3]);
          cells.push_back(cell);
        }
  std::vector<std::uint64_t> keys;
  for (const auto& cell : cells) keys.insert(keys.end(), cell.begin(), cell.end());
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());

  Sphere sphere;
  for (std::size_t v = 0; v < keys.size(); ++v) {
    const std::uint64_t key = keys[v];
    const double c[3] = {static_cast<double>(key / (n + 1) / (n + 1)),
                         static_cast<double>(key / (n + 1) % (n + 1)), static_cast<double>(key % (n + 1))};
    double d[3];
    for (std::uint32_t k = 0; k < 3; ++k) {
      // Equal angles instead of equal steps on the cube keep the cells alike.
      const double angle = (2 * c[k] / n - 1) * portable::kPi / 4;
      d[k] = portable::sin(angle) / portable::cos(angle) +
             0.5 / n * (hash01(static_cast<std::uint32_t>(v), k, 0, seed) - 0.5);
    }
    sphere.direction.push_back(normalized(Vec3d{d[0], d[1], d[2]}));
  }
  auto index = [&keys](std::uint64_t key) {
    return static_cast<std::uint32_t>(std::lower_bound(keys.begin(), keys.end(), key) - keys.begin());
  };
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const std::uint32_t a = index(cells[i][0]), b = index(cells[i][1]), c = index(cells[i][2]),
                        d = index(cells[i][3]);
    if (hash(static_cast<std::uint32_t>(i), 0, 1, seed) & 1) {
      sphere.triangles.push_back({a, b, c});
      sphere.triangles.push_back({a, c, d});
    } else {
      sphere.triangles.push_back({a, b, d});
      sphere.triangles.push_back({b, c, d});
    }
  }
  return sphere;
}

// Holes with ragged rims: where no camera looked.
void punch_holes(Sphere& sphere, int holes, std::uint32_t seed) {
  std::vector<std::pair<Vec3d, double>> hole;  // centre, cosine of the radius
  for (int h = 0; h < holes; ++h) {
    const auto i = static_cast<std::uint32_t>(h);
    const double y = 2 * hash01(i, 11, 0, seed) - 1, angle = 2 * portable::kPi * hash01(i, 12, 0, seed);
    const double ring = std::sqrt(1 - y * y);
    // The first one is the foot the object stood on.
    const Vec3d centre =
        h == 0 ? Vec3d{0, -1, 0} : Vec3d{ring * portable::cos(angle), y, ring * portable::sin(angle)};
    const double radius =
        h == 0 ? 0.3 : mix(0.03, 0.12, hash01(i, 13, 0, seed)) / std::sqrt(1 + holes / 20.0);
    hole.emplace_back(centre, portable::cos(radius));
  }
  std::erase_if(sphere.triangles, [&](const std::array<std::uint32_t, 3>& t) {
    const Vec3d middle = normalized(sphere.direction[t[0]] + sphere.direction[t[1]] + sphere.direction[t[2]]);
    return std::any_of(hole.begin(), hole.end(), [&](const auto& h) {
      const double ragged = (1 - h.second) * (1 + 0.5 * noise(middle * 30, seed + 3));
      return dot(middle, h.first) > 1 - ragged;
    });
  });
  std::vector<std::uint32_t> renumber(sphere.direction.size(), 0);
  for (const auto& t : sphere.triangles)
    for (std::uint32_t v : t) renumber[v] = 1;
  std::uint32_t count = 0;
  for (std::size_t v = 0; v < renumber.size(); ++v)
    if (renumber[v]) {
      sphere.direction[count] = sphere.direction[v];
      renumber[v] = count++;
    }
  sphere.direction.resize(count);
  for (auto& t : sphere.triangles)
    for (std::uint32_t& v : t) v = renumber[v];
}

std::vector<std::array<std::uint32_t, 3>> neighbours(const Corners& triangles) {
  // Vertex pair, triangle, corner.
  std::vector<std::tuple<std::uint64_t, std::uint32_t, std::uint32_t>> edges;
  edges.reserve(triangles.size() * 3);
  for (std::uint32_t t = 0; t < triangles.size(); ++t)
    for (std::uint32_t k = 0; k < 3; ++k) {
      const std::uint64_t a = triangles[t][k], b = triangles[t][(k + 1) % 3];
      edges.emplace_back(std::min(a, b) << 32 | std::max(a, b), t, k);
    }
  std::sort(edges.begin(), edges.end());
  std::vector<std::array<std::uint32_t, 3>> out(triangles.size(), {kNoIndex, kNoIndex, kNoIndex});
  for (std::size_t i = 1; i < edges.size(); ++i) {
    const auto& [key_a, ta, ka] = edges[i - 1];
    const auto& [key_b, tb, kb] = edges[i];
    if (key_a != key_b) continue;
    out[ta][ka] = tb;
    out[tb][kb] = ta;
  }
  return out;
}

// Charts grow from their seeds over edges of random length, which makes connected charts with ragged rims and
// unequal sizes, as segmentation by camera does.
std::vector<std::uint32_t> grow_charts(const Corners& triangles, int charts, std::uint32_t seed) {
  const auto next = neighbours(triangles);
  std::vector<std::uint32_t> chart(triangles.size(), kNoIndex);
  using Front = std::tuple<double, std::uint32_t, std::uint32_t>;  // distance, triangle, chart
  std::priority_queue<Front, std::vector<Front>, std::greater<>> front;
  const auto count = static_cast<std::uint32_t>(triangles.size());
  for (std::uint32_t c = 0; c < static_cast<std::uint32_t>(charts); ++c)
    front.emplace(4 * hash01(c, 21, 0, seed), hash(c, 22, 0, seed) % count, c);
  std::uint32_t used = 0;
  std::vector<std::uint32_t> number(static_cast<std::size_t>(charts), kNoIndex);
  auto run = [&] {
    while (!front.empty()) {
      const auto [distance, t, c] = front.top();
      front.pop();
      if (chart[t] != kNoIndex) continue;
      if (number[c] == kNoIndex) number[c] = used++;
      chart[t] = number[c];
      for (std::uint32_t k = 0; k < 3; ++k)
        if (const std::uint32_t o = next[t][k]; o != kNoIndex && chart[o] == kNoIndex)
          front.emplace(distance + 0.5 + hash01(t, k, 23, seed), o, c);
    }
  };
  run();
  // A triangle that holes have cut off from every seed becomes the seed of one more chart.
  for (std::uint32_t t = 0; t < count; ++t)
    if (chart[t] == kNoIndex) {
      number.push_back(kNoIndex);
      front.emplace(0.0, t, static_cast<std::uint32_t>(number.size() - 1));
      run();
    }
  return chart;
}

struct ChartBox {
  double scale = 1;  // object units per unit of the flattened sphere
  Vec3d x, y, z;     // frame: z = middle direction
  Vec2d lo{1e9, 1e9}, hi{-1e9, -1e9};
  Vec2d at;  // place in the atlas, px
};

// Lambert's azimuthal projection: no folds short of the antipode, so any chart up to a hemisphere and more
// lies flat.
Vec2d flatten(const ChartBox& box, Vec3d d) {
  const double k = std::sqrt(2 / std::max(1e-3, 1 + dot(d, box.z))) * box.scale;
  return {dot(d, box.x) * k, dot(d, box.y) * k};
}

std::vector<ChartBox> frame_charts(const Sphere& sphere, const ScanMesh& scan, std::uint32_t seed) {
  std::vector<ChartBox> boxes(scan.chart_count);
  std::vector<double> flat_area(scan.chart_count, 0), area(scan.chart_count, 0);
  for (std::size_t t = 0; t < sphere.triangles.size(); ++t) {
    const auto& [a, b, c] = sphere.triangles[t];
    const std::uint32_t id = scan.chart[t];
    const Vec3d n =
        cross(sphere.direction[b] - sphere.direction[a], sphere.direction[c] - sphere.direction[a]);
    boxes[id].z = boxes[id].z + n;
    flat_area[id] += length(n);
    area[id] += length(cross(scan.surface[b] - scan.surface[a], scan.surface[c] - scan.surface[a]));
  }
  for (std::uint32_t i = 0; i < boxes.size(); ++i) {
    ChartBox& b = boxes[i];
    b.z = normalized(b.z);
    const Vec3d helper = std::fabs(b.z.y) < 0.8 ? Vec3d{0, 1, 0} : Vec3d{1, 0, 0};
    const Vec3d u = normalized(cross(helper, b.z)), v = cross(b.z, u);
    const double turn = 2 * portable::kPi * hash01(i, 31, 0, seed);
    b.x = u * portable::cos(turn) + v * portable::sin(turn);
    b.y = cross(b.z, b.x);
    b.scale = std::sqrt(area[i] / std::max(1e-30, flat_area[i]));
  }
  for (std::size_t t = 0; t < sphere.triangles.size(); ++t)
    for (std::uint32_t p : sphere.triangles[t]) {
      ChartBox& b = boxes[scan.chart[t]];
      const Vec2d f = flatten(b, sphere.direction[p]);
      b.lo = {std::min(b.lo.x, f.x), std::min(b.lo.y, f.y)};
      b.hi = {std::max(b.hi.x, f.x), std::max(b.hi.y, f.y)};
    }
  return boxes;
}

// Shelves of falling height; the largest resolution at which all of them fit. Returns px per object unit.
double pack_charts(std::vector<ChartBox>& boxes, double side, double gutter) {
  std::vector<std::uint32_t> order(boxes.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return boxes[a].hi.y - boxes[a].lo.y > boxes[b].hi.y - boxes[b].lo.y;
  });
  auto place = [&](double px) {
    double x = 0, y = 0, shelf = 0;
    for (std::uint32_t i : order) {
      ChartBox& b = boxes[i];
      const double w = (b.hi.x - b.lo.x) * px + 2 * gutter, h = (b.hi.y - b.lo.y) * px + 2 * gutter;
      if (x + w > side) {
        x = 0;
        y += shelf;
        shelf = 0;
      }
      if (w > side || y + h > side) return false;
      b.at = {x + gutter, y + gutter};
      x += w;
      shelf = std::max(shelf, h);
    }
    return true;
  };
  double lo = 0, hi = 1;
  while (place(hi)) hi *= 2;
  for (int i = 0; i < 30; ++i) (place((lo + hi) / 2) ? lo : hi) = (lo + hi) / 2;
  if (!place(lo) || lo == 0)
    throw InputError("make_scan", "--charts", "fewer charts or a larger texture",
                     std::to_string(boxes.size()) + " charts");
  return lo;
}

void lay_out_atlas(ScanMesh& scan, const Sphere& sphere, int texture_px, std::uint32_t seed) {
  std::vector<ChartBox> boxes = frame_charts(sphere, scan, seed);
  const double side = texture_px > 0 ? texture_px : 1024;
  // Many charts in a small texture leave little room for gutters.
  const double gutter = std::clamp(side / 16 / std::sqrt(static_cast<double>(boxes.size())), 1.0, 6.0);
  const double px = pack_charts(boxes, side, gutter);

  std::vector<std::uint64_t> wedges;  // position, chart
  for (std::size_t t = 0; t < sphere.triangles.size(); ++t)
    for (std::uint32_t p : sphere.triangles[t])
      wedges.push_back(static_cast<std::uint64_t>(p) << 32 | scan.chart[t]);
  std::sort(wedges.begin(), wedges.end());
  wedges.erase(std::unique(wedges.begin(), wedges.end()), wedges.end());
  for (std::uint64_t w : wedges) {
    const auto p = static_cast<std::uint32_t>(w >> 32);
    const ChartBox& b = boxes[w & 0xffffffff];
    const Vec2d f = (flatten(b, sphere.direction[p]) - b.lo) * px + b.at;
    scan.mesh.wedge_position.push_back(p);
    scan.mesh.uv0.push_back({static_cast<float>(f.x / side), static_cast<float>(1 - f.y / side)});
    scan.mesh.normals.push_back(to_float(scan.normal[p]));
  }
  for (std::size_t t = 0; t < sphere.triangles.size(); ++t) {
    Triangle triangle;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t key = static_cast<std::uint64_t>(sphere.triangles[t][k]) << 32 | scan.chart[t];
      triangle[k] =
          static_cast<std::uint32_t>(std::lower_bound(wedges.begin(), wedges.end(), key) - wedges.begin());
    }
    scan.mesh.triangles.push_back(triangle);
  }
}

// Measuring noise along the normal: mostly white, partly in patches as depth maps have it.
void measure(ScanMesh& scan, double noise_fraction, std::uint32_t seed) {
  const double deviation = noise_fraction * bounding_box(scan.surface).diagonal();
  for (std::uint32_t p = 0; p < scan.surface.size(); ++p) {
    double white = -2;  // sum of four uniform numbers: bell-shaped, deviation 0.577
    for (std::uint32_t k = 0; k < 4; ++k) white += hash01(p, k, 41, seed);
    const double patch = noise(scan.surface[p] * 60, seed + 42);
    scan.mesh.positions.push_back(
        to_float(scan.surface[p] + scan.normal[p] * (deviation * (1.5 * white + 1.0 * patch))));
  }
}

}  // namespace

ScanMesh make_scan_mesh(const ScanShape& shape, const ScanOptions& options) {
  const auto seed = static_cast<std::uint32_t>(options.seed) * 7919u + 5u;
  const auto n = std::max(2u, static_cast<std::uint32_t>(std::lround(std::sqrt(options.triangles / 12.0))));
  Sphere sphere = irregular_sphere(n, seed);
  punch_holes(sphere, options.holes, seed);

  ScanMesh scan;
  for (Vec3d d : sphere.direction) scan.surface.push_back(shape.point(d));
  scan.normal.resize(scan.surface.size());
  for (const auto& [a, b, c] : sphere.triangles) {
    const Vec3d normal = cross(scan.surface[b] - scan.surface[a], scan.surface[c] - scan.surface[a]);
    for (std::uint32_t v : {a, b, c}) scan.normal[v] = scan.normal[v] + normal;
  }
  for (Vec3d& normal : scan.normal) normal = normalized(normal);
  scan.chart = grow_charts(sphere.triangles, options.charts, seed);
  scan.chart_count = *std::max_element(scan.chart.begin(), scan.chart.end()) + 1;
  lay_out_atlas(scan, sphere, options.texture_px, seed);
  measure(scan, options.noise, seed);
  scan.mesh.triangle_material.assign(scan.mesh.triangles.size(), 0);
  scan.mesh.triangle_part.assign(scan.mesh.triangles.size(), 0);
  scan.mesh.part_names = {"scan"};
  return scan;
}

}  // namespace texmesh
