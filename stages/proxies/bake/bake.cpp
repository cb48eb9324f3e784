// Each texel of the atlas is the mean of what S_0 shows at several places of its part of the charts (Baker).
// What no chart covers continues the charts smoothly (push_pull()).
#include "stages/proxies/bake/bake.h"

#include <map>

#include "stages/base/parallel.h"
#include "stages/geometry/mesh_topology.h"

namespace texmesh {
namespace {

struct PullLevel {
  std::uint32_t width = 0, height = 0;
  std::vector<Vec3f> value;
  std::vector<float> weight;  // 0 = nothing is known here
};

/// Means of 2 x 2 by their weights; a weight of 1 is full knowledge.
PullLevel half_map(const PullLevel& fine) {
  PullLevel out{(fine.width + 1) / 2, (fine.height + 1) / 2, {}, {}};
  out.value.resize(std::size_t{out.width} * out.height);
  out.weight.resize(out.value.size(), 0);
  for (std::uint32_t y = 0; y < fine.height; ++y)
    for (std::uint32_t x = 0; x < fine.width; ++x) {
      const std::size_t from = std::size_t{y} * fine.width + x, to = std::size_t{y / 2} * out.width + x / 2;
      out.value[to] = out.value[to] + fine.value[from] * fine.weight[from];
      out.weight[to] += fine.weight[from];
    }
  for (std::size_t i = 0; i < out.value.size(); ++i)
    if (out.weight[i] > 0) {
      out.value[i] = out.value[i] * (1 / out.weight[i]);
      out.weight[i] = std::min(out.weight[i], 1.0f);
    }
  return out;
}

/// The coarse level in the middle of a fine texel, bilinear.
Vec3f read_coarse(const PullLevel& coarse, std::uint32_t x, std::uint32_t y) {
  const auto clamp = [](std::int64_t i, std::uint32_t size) {
    return static_cast<std::size_t>(std::clamp<std::int64_t>(i, 0, std::int64_t{size} - 1));
  };
  const std::int64_t cx = x / 2, cy = y / 2;
  const std::size_t x0 = clamp(cx, coarse.width), x1 = clamp(x % 2 == 0 ? cx - 1 : cx + 1, coarse.width);
  const std::size_t y0 = clamp(cy, coarse.height), y1 = clamp(y % 2 == 0 ? cy - 1 : cy + 1, coarse.height);
  const auto at = [&](std::size_t i, std::size_t j) { return coarse.value[j * coarse.width + i]; };
  return (at(x0, y0) * 0.75f + at(x1, y0) * 0.25f) * 0.75f +
         (at(x0, y1) * 0.75f + at(x1, y1) * 0.25f) * 0.25f;
}

constexpr std::size_t kMostPerSide = 4;  // of the places of a texel

struct Corners {
  std::array<Vec3d, 3> position, normal;
  std::array<Vec2d, 3> uv;
};

Corners baked_corners(const AtlasMesh& mesh, const std::vector<Vec3f>& normals, std::size_t triangle) {
  Corners out;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::uint32_t v = mesh.triangles[triangle][k];
    out.position[k] = to_double(mesh.positions[v]);
    if (!normals.empty()) out.normal[k] = to_double(normals[v]);
    out.uv[k] = {static_cast<double>(mesh.uvs[v].x) * mesh.width_px,
                 static_cast<double>(mesh.uvs[v].y) * mesh.height_px};
  }
  return out;
}

template <class T>
T mean3(const std::array<T, 3>& value, const std::array<double, 3>& weight) {
  return value[0] * weight[0] + value[1] * weight[1] + value[2] * weight[2];
}

/// Of the corners; negative outside. False without an area.
bool weights_at(const std::array<Vec2d, 3>& uv, Vec2d p, std::array<double, 3>& weight) {
  const double area = cross(uv[1] - uv[0], uv[2] - uv[0]);
  if (area == 0) return false;
  for (std::size_t k = 0; k < 3; ++k) weight[k] = cross(uv[(k + 1) % 3] - p, uv[(k + 2) % 3] - p) / area;
  return true;
}

/// Which triangle covers each place of a grid that is `per_side` times as fine as the texels.
struct PlaceGrid {
  std::size_t per_side = 1, width = 0, height = 0;
  std::vector<std::uint32_t> owner;  // kNoIndex = none; of several triangles the first
  Vec2d texel_of(std::size_t x, std::size_t y) const {
    return {(static_cast<double>(x) + 0.5) / static_cast<double>(per_side),
            (static_cast<double>(y) + 0.5) / static_cast<double>(per_side)};
  }
};

struct PlaceRange {
  std::size_t first = 0, end = 0;
};
PlaceRange places_between(double low, double high, std::size_t per_side, std::size_t size) {
  const auto scale = static_cast<double>(per_side), most = static_cast<double>(size);
  const double first = std::clamp(std::floor(low * scale - 0.5), 0.0, most),
               end = std::clamp(std::floor(high * scale - 0.5) + 2, 0.0, most);
  return {static_cast<std::size_t>(first), static_cast<std::size_t>(end)};
}

PlaceGrid make_grid(const AtlasMesh& mesh, std::size_t per_side) {
  PlaceGrid grid{per_side, mesh.width_px * per_side, mesh.height_px * per_side, {}};
  grid.owner.assign(grid.width * grid.height, kNoIndex);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::array<Vec2d, 3> uv = baked_corners(mesh, {}, t).uv;
    const auto [x_low, x_high] = std::minmax({uv[0].x, uv[1].x, uv[2].x});
    const auto [y_low, y_high] = std::minmax({uv[0].y, uv[1].y, uv[2].y});
    const PlaceRange xs = places_between(x_low, x_high, per_side, grid.width),
                     ys = places_between(y_low, y_high, per_side, grid.height);
    std::array<double, 3> weight{};
    for (std::size_t y = ys.first; y < ys.end; ++y)
      for (std::size_t x = xs.first; x < xs.end; ++x) {
        std::uint32_t& owner = grid.owner[y * grid.width + x];
        if (owner != kNoIndex || !weights_at(uv, grid.texel_of(x, y), weight)) continue;
        if (weight[0] >= 0 && weight[1] >= 0 && weight[2] >= 0) owner = static_cast<std::uint32_t>(t);
      }
  }
  return grid;
}

/// A chart thinner than the grid owns no place, though its triangles show texels: the middle of each is one.
void own_thin_triangles(const AtlasMesh& mesh, PlaceGrid& grid) {
  const auto scale = static_cast<double>(grid.per_side);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::array<Vec2d, 3> uv = baked_corners(mesh, {}, t).uv;
    const Vec2d middle = (uv[0] + uv[1] + uv[2]) * (1.0 / 3);
    if (!(middle.x >= 0 && middle.y >= 0)) continue;
    const auto x = static_cast<std::size_t>(std::min(middle.x * scale, 1e9)),
               y = static_cast<std::size_t>(std::min(middle.y * scale, 1e9));
    if (x >= grid.width || y >= grid.height) continue;
    std::uint32_t& owner = grid.owner[y * grid.width + x];
    if (owner == kNoIndex) owner = static_cast<std::uint32_t>(t);
  }
}

/// Sums of samples, each with a weight of 1; colours count by their alpha, so that what cannot be seen leaves
/// no trace.
struct TexelSum {
  Vec3f base, emission, orm;
  Vec3d normal;
  float alpha = 0, count = 0, colours = 0;
  void add(const BakeSample& s, Vec3d tangent_normal) {
    const float weight = s.alpha > 1e-3f ? s.alpha : 1e-3f;
    base = base + s.base_colour * weight;
    colours += weight;
    emission = emission + s.emission;
    orm = orm + Vec3f{s.occlusion, s.roughness, s.metallic};
    normal = normal + tangent_normal;
    alpha += s.alpha;
    count += 1;
  }
};

/// The numbers a, b, c of n = a u + b v + c w; (0, 0, 1) where the frame has no volume.
Vec3d in_frame(Vec3d n, Vec3d u, Vec3d v, Vec3d w) {
  const double volume = dot(cross(u, v), w);
  if (!(std::fabs(volume) > 1e-6)) return {0, 0, 1};
  return Vec3d{dot(cross(n, v), w), dot(cross(u, n), w), dot(cross(u, v), n)} * (1 / volume);
}

class Baker {
 public:
  Baker(const AtlasMesh& mesh, const std::vector<Vec3f>& normals, const BakeSource& source, PlaceGrid grid,
        bool normal_map)
      : mesh_(mesh), normals_(normals), source_(source), grid_(std::move(grid)), normal_map_(normal_map) {}

  void bake_row(std::size_t y, BakedMaps& out) const {
    std::optional<SurfacePlace> guess;
    for (std::size_t x = 0; x < mesh_.width_px; ++x) {
      TexelSum sum;
      for (std::size_t j = 0; j < grid_.per_side; ++j)
        for (std::size_t i = 0; i < grid_.per_side; ++i)
          add_place(x * grid_.per_side + i, y * grid_.per_side + j, guess, sum);
      if (sum.count > 0) put_texel(y * mesh_.width_px + x, sum, out);
    }
  }

 private:
  void add_place(std::size_t x, std::size_t y, std::optional<SurfacePlace>& guess, TexelSum& sum) const {
    const std::uint32_t triangle = grid_.owner[y * grid_.width + x];
    if (triangle == kNoIndex) return;
    const Corners c = baked_corners(mesh_, normals_, triangle);
    std::array<double, 3> weight{};
    if (!weights_at(c.uv, grid_.texel_of(x, y), weight)) weight = {1.0 / 3, 1.0 / 3, 1.0 / 3};
    const Vec3d face = cross(c.position[1] - c.position[0], c.position[2] - c.position[0]);
    Vec3d normal = normalized(mean3(c.normal, weight));
    if (!(dot(normal, normal) > 0.5)) normal = normalized(face);
    const auto place = source_.find(mesh_.group_of[triangle], mean3(c.position, weight), normal, guess);
    if (!place) return;
    guess = place;
    const double texels = std::fabs(cross(c.uv[1] - c.uv[0], c.uv[2] - c.uv[0]));
    const double footprint = texels > 0 ? std::sqrt(length(face) / texels) : 0;
    const BakeSample sample =
        source_.sample(*place, footprint / static_cast<double>(grid_.per_side), {true, true, normal_map_});
    if (!normal_map_) return sum.add(sample, {});
    const TextureFrame frame = texture_frame(c.position, c.uv, normal);
    sum.add(sample, in_frame(to_double(sample.normal), frame.along_u, frame.along_v, normal));
  }

  static void put_texel(std::size_t i, const TexelSum& sum, BakedMaps& out) {
    out.covered[i] = 1;
    out.base_colour[i] = sum.base * (1 / sum.colours);
    out.emission[i] = sum.emission * (1 / sum.count);
    out.occlusion_roughness_metallic[i] = sum.orm * (1 / sum.count);
    out.alpha[i] = sum.alpha / sum.count;
    if (out.normal.empty()) return;
    // What looks below the horizon of a coarse triangle stays just above.
    Vec3d n = normalized(sum.normal);
    if (!(n.z > 0.1)) n = normalized(Vec3d{n.x, n.y, 0.1});
    out.normal[i] = to_float(n);
  }

  const AtlasMesh& mesh_;
  const std::vector<Vec3f>& normals_;
  const BakeSource& source_;
  PlaceGrid grid_;
  bool normal_map_;
};

void finish_maps(BakedMaps& maps) {
  double count = 0;
  Vec3d sum;
  maps.least_orm = {1, 1, 1};
  for (std::size_t i = 0; i < maps.covered.size(); ++i) {
    if (!maps.covered[i]) continue;
    count += 1;
    const Vec3f orm = maps.occlusion_roughness_metallic[i], e = maps.emission[i];
    sum = sum + to_double(orm);
    for (int k = 0; k < 3; ++k) {
      maps.least_orm[k] = std::min(maps.least_orm[k], orm[k]);
      maps.most_orm[k] = std::max(maps.most_orm[k], orm[k]);
      maps.most_emission[k] = std::max(maps.most_emission[k], e[k]);
    }
    maps.has_alpha = maps.has_alpha || maps.alpha[i] < 0.999f;
  }
  maps.mean_orm = count > 0 ? to_float(sum * (1 / count)) : Vec3f{1, 1, 0};
  maps.has_emission = maps.most_emission != Vec3f{};
  push_pull(maps.base_colour, maps.covered, maps.width_px, maps.height_px);
  push_pull(maps.occlusion_roughness_metallic, maps.covered, maps.width_px, maps.height_px);
  if (maps.has_emission) push_pull(maps.emission, maps.covered, maps.width_px, maps.height_px);
  if (!maps.normal.empty()) push_pull(maps.normal, maps.covered, maps.width_px, maps.height_px);
  for (Vec3f& n : maps.normal) n = normalized(n);
  if (!maps.has_alpha) return;
  std::vector<Vec3f> alpha;
  for (const float a : maps.alpha) alpha.push_back({a, a, a});
  push_pull(alpha, maps.covered, maps.width_px, maps.height_px);
  for (std::size_t i = 0; i < alpha.size(); ++i) maps.alpha[i] = alpha[i].x;
}

using Weights = std::array<double, 3>;

/// Places of a triangle, evenly spread: the middles of a subdivision's upright triangles. Small triangles
/// need fewer.
std::vector<Weights> places_of_triangles(std::size_t triangles) {
  constexpr std::size_t kManyTriangles = 3000;
  const int n = triangles < kManyTriangles ? 4 : 2;
  std::vector<Weights> out;
  for (int i = 0; i < n; ++i)
    for (int j = 0; i + j < n; ++j)
      out.push_back({(i + 1.0 / 3) / n, (j + 1.0 / 3) / n, (n - 1 - i - j + 1.0 / 3) / n});
  return out;
}

using CornerSums = std::array<Vec3d, 3>;

Vec3d face_vector(const AtlasMesh& mesh, const Triangle& t) {
  const auto at = [&](std::size_t k) { return to_double(mesh.positions[t[k]]); };
  return cross(at(1) - at(0), at(2) - at(0));
}

CornerSums sums_of(const AtlasMesh& mesh, std::size_t triangle, const std::vector<Vec3d>& smooth,
                   const std::vector<Weights>& places, const BakeSource& source) {
  const Triangle& t = mesh.triangles[triangle];
  const Vec3d face = face_vector(mesh, t);
  const double area = length(face);
  CornerSums out{};
  if (!(area > 0)) return out;
  std::optional<SurfacePlace> guess;
  for (const Weights& w : places) {
    Vec3d p, normal;
    for (std::size_t k = 0; k < 3; ++k) {
      p = p + to_double(mesh.positions[t[k]]) * w[k];
      normal = normal + smooth[t[k]] * w[k];
    }
    normal = normalized(normal);
    if (!(dot(normal, normal) > 0.5)) normal = normalized(face);
    const auto place = source.find(mesh.group_of[triangle], p, normal, guess);
    if (!place) continue;
    guess = place;
    const double footprint = std::sqrt(area / (2 * static_cast<double>(places.size())));
    const Vec3d n = to_double(source.sample(*place, footprint, {false, false, true}).normal);
    if (dot(n, face) > 0)
      for (std::size_t k = 0; k < 3; ++k) out[k] = out[k] + n * (w[k] * w[k] * area);
  }
  return out;
}

/// Vertices of equal position and group have one number.
std::vector<std::uint32_t> shared_normals(const AtlasMesh& mesh) {
  std::vector<std::uint32_t> group(mesh.positions.size(), 0);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (const std::uint32_t v : mesh.triangles[t]) group[v] = mesh.group_of[t];
  std::map<std::array<std::uint32_t, 2>, std::uint32_t> index;
  std::vector<std::uint32_t> out;
  for (std::size_t v = 0; v < group.size(); ++v)
    out.push_back(index.try_emplace({mesh.position_of[v], group[v]}, static_cast<std::uint32_t>(index.size()))
                      .first->second);
  return out;
}

/// Whether S_0 turns at an edge of two triangles. On round shapes normals turn within triangles as well: near
/// the edge they differ by .55 to .6 of what the triangles do, at a hard edge by all of it.
class Creases {
 public:
  Creases(const AtlasMesh& mesh, const std::vector<CornerSums>& sums, CreaseUse use)
      : mesh_(mesh), sums_(sums), use_(use) {
    for (const Triangle& t : mesh.triangles) mean_size_ += length(face_vector(mesh, t));
    mean_size_ /= static_cast<double>(std::max<std::size_t>(mesh.triangles.size(), 1));
  }
  bool between(std::uint32_t half_edge, std::uint32_t opposite) const {
    constexpr double kLeastTurn = 0.35, kLargeTurn = 0.85;  // chords of 20 and 50 degrees
    constexpr double kLeastShare = 0.7;
    // Of both triangles together, in means of all: a crease between small ones is hardly seen, and its
    // vertices take bytes.
    constexpr double kLeastSizes = 1.3;
    const Vec3d one = normalized(near(half_edge)), other = normalized(near(opposite));
    if (!(dot(one, one) > 0.5 && dot(other, other) > 0.5)) return false;
    const double turn = length(one - other);
    if (use_ == CreaseUse::kWhereChartsEnd)
      return turn > kLargeTurn && mesh_.chart_of[half_edge / 3] != mesh_.chart_of[opposite / 3];
    if (size(half_edge) + size(opposite) < kLeastSizes * mean_size_) return false;
    const double faces_turn = length(unit_face(half_edge) - unit_face(opposite));
    return std::min(turn, faces_turn) >= kLeastTurn && turn >= kLeastShare * faces_turn;
  }

 private:
  Vec3d unit_face(std::uint32_t corner) const {
    return normalized(face_vector(mesh_, mesh_.triangles[corner / 3]));
  }
  double size(std::uint32_t corner) const { return length(face_vector(mesh_, mesh_.triangles[corner / 3])); }
  Vec3d near(std::uint32_t half_edge) const {
    const CornerSums& sums = sums_[half_edge / 3];
    return sums[half_edge % 3] + sums[next_corner(half_edge) % 3];
  }
  const AtlasMesh& mesh_;
  const std::vector<CornerSums>& sums_;
  CreaseUse use_;
  double mean_size_ = 0;
};

/// Per corner 3 t + k: the set of corners that have its normal. They lie around one position, and no crease
/// is between them.
DisjointSets smooth_corners(const AtlasMesh& mesh, const std::vector<std::uint32_t>& shared,
                            std::size_t shared_count, const std::vector<CornerSums>& sums, CreaseUse use) {
  constexpr std::size_t kMostSheets = 64;  // at one edge: their pairs take time that grows with the square
  std::vector<std::uint32_t> corners;
  for (const Triangle& t : mesh.triangles)
    for (const std::uint32_t v : t) corners.push_back(shared[v]);
  DisjointSets sets(corners.size());
  const Creases creases(mesh, sums, use);
  const EdgeTable edges = group_edges(corners, shared_count);
  for (std::size_t e = 0; e < edges.edge_count(); ++e) {
    const std::span<const std::uint32_t> sheets = edges.edge(e);
    if (sheets.size() > kMostSheets) continue;
    for (std::size_t i = 0; i < sheets.size(); ++i)
      for (std::size_t j = i + 1; j < sheets.size(); ++j) {
        const std::uint32_t a = sheets[i], b = sheets[j];
        if (corners[a] == corners[b] || creases.between(a, b)) continue;  // not the same way round
        sets.join(a, next_corner(b));
        sets.join(next_corner(a), b);
      }
  }
  return sets;
}

}  // namespace

void push_pull(std::vector<Vec3f>& values, const std::vector<std::uint8_t>& covered, std::uint32_t width,
               std::uint32_t height) {
  if (std::find(covered.begin(), covered.end(), 1) == covered.end()) return;
  std::vector<PullLevel> levels(1);
  levels[0] = {width, height, std::move(values), {}};
  for (const std::uint8_t c : covered) levels[0].weight.push_back(c ? 1 : 0);
  while (levels.back().width > 1 || levels.back().height > 1) levels.push_back(half_map(levels.back()));
  for (std::size_t l = levels.size() - 1; l-- > 0;) {
    PullLevel& fine = levels[l];
    for (std::uint32_t y = 0; y < fine.height; ++y)
      for (std::uint32_t x = 0; x < fine.width; ++x) {
        const std::size_t i = std::size_t{y} * fine.width + x;
        if (fine.weight[i] >= 1) continue;
        const Vec3f known = fine.weight[i] > 0 ? fine.value[i] : Vec3f{};
        fine.value[i] = known * fine.weight[i] + read_coarse(levels[l + 1], x, y) * (1 - fine.weight[i]);
      }
  }
  values = std::move(levels[0].value);
}

BakedMaps bake(const AtlasMesh& mesh, const std::vector<Vec3f>& normals, const BakeSource& source,
               const BakeOrder& order, const RunContext& context) {
  const std::size_t texels = std::size_t{mesh.width_px} * mesh.height_px;
  std::size_t per_side = 1;
  while (per_side < kMostPerSide && texels * (per_side + 1) * (per_side + 1) <= order.samples) ++per_side;
  PlaceGrid grid = make_grid(mesh, per_side);
  own_thin_triangles(mesh, grid);
  BakedMaps out;
  out.width_px = mesh.width_px, out.height_px = mesh.height_px;
  out.base_colour.resize(texels);
  out.emission.resize(texels);
  out.occlusion_roughness_metallic.resize(texels);
  if (order.normal_map) out.normal.resize(texels, {0, 0, 1});
  out.alpha.resize(texels, 1);
  out.covered.resize(texels, 0);
  const Baker baker(mesh, normals, source, std::move(grid), order.normal_map);
  parallel_each(context, mesh.height_px, 1, [&](std::size_t y) { baker.bake_row(y, out); });
  finish_maps(out);
  return out;
}

std::uint32_t SmoothMesh::add_copy(std::uint32_t vertex) {
  const auto copy = [vertex](auto& list) {
    const auto value = list[vertex];
    list.push_back(value);
  };
  copy(mesh.positions);
  copy(mesh.uvs);
  copy(mesh.position_of);
  copy(normals);
  return static_cast<std::uint32_t>(normals.size() - 1);
}

SmoothMesh sampled_normals(const AtlasMesh& mesh, const BakeSource& source, CreaseUse use,
                           const RunContext& context) {
  const std::vector<std::uint32_t> shared = shared_normals(mesh);
  std::vector<Vec3d> face_sum(shared.size());
  for (const Triangle& t : mesh.triangles)
    for (const std::uint32_t v : t) face_sum[shared[v]] = face_sum[shared[v]] + face_vector(mesh, t);
  std::vector<Vec3d> smooth(shared.size());
  for (std::size_t v = 0; v < shared.size(); ++v) smooth[v] = normalized(face_sum[shared[v]]);

  const std::vector<Weights> places = places_of_triangles(mesh.triangles.size());
  std::vector<CornerSums> sums(mesh.triangles.size());
  parallel_each(context, sums.size(), 64,
                [&](std::size_t t) { sums[t] = sums_of(mesh, t, smooth, places, source); });
  DisjointSets sets = smooth_corners(mesh, shared, shared.size(), sums, use);
  std::vector<Vec3d> total(3 * sums.size());  // per set, at its name
  for (std::uint32_t c = 0; c < total.size(); ++c) {
    Vec3d& sum = total[sets.find(c)];
    sum = sum + sums[c / 3][c % 3];
  }
  SmoothMesh out{mesh, std::vector<Vec3f>(mesh.positions.size(), {0, 1, 0})};
  std::vector<std::vector<std::array<std::uint32_t, 2>>> sides(
      mesh.positions.size());  // of a vertex: set, vertex
  for (std::uint32_t c = 0; c < total.size(); ++c) {
    std::uint32_t& v = out.mesh.triangles[c / 3][c % 3];
    const std::uint32_t set = sets.find(c);
    std::vector<std::array<std::uint32_t, 2>>& known = sides[v];
    const auto side = std::ranges::find(known, set, [](const auto& s) { return s[0]; });
    const std::uint32_t first = v;
    if (side != known.end()) {
      v = (*side)[1];
      continue;
    }
    if (!known.empty()) v = out.add_copy(first);
    known.push_back({set, v});
    const Vec3d n = normalized(total[set]);
    if (dot(n, n) > 0.5)
      out.normals[v] = to_float(n);
    else if (dot(smooth[first], smooth[first]) > 0.5)
      out.normals[v] = to_float(smooth[first]);
  }
  return out;
}

}  // namespace texmesh
