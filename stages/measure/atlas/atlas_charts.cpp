// Charts: triangles that hang together in the texture. Seams: edges between them, and the colours on both
// sides.
#include <bit>
#include <tuple>

#include "stages/base/parallel.h"
#include "stages/measure/atlas/atlas_parts.h"
#include "stages/measure/cie_lab.h"

namespace texmesh {
namespace {

/// Per wedge a number for its position with its texture coordinates, from `first` on. Returns the next
/// number.
std::uint32_t number_vertices(const std::vector<std::uint32_t>& position, const std::vector<Vec2f>& uvs,
                              std::uint32_t first, std::vector<std::uint32_t>& vertex) {
  struct Key {
    std::uint32_t position, u, v, wedge;
    bool same_place(const Key& k) const { return std::tie(position, u, v) == std::tie(k.position, k.u, k.v); }
  };
  std::vector<Key> keys(uvs.size());
  for (std::uint32_t w = 0; w < uvs.size(); ++w)  // + 0: -0 is 0
    keys[w] = {position[w], std::bit_cast<std::uint32_t>(uvs[w].x + 0.0f),
               std::bit_cast<std::uint32_t>(uvs[w].y + 0.0f), w};
  std::ranges::sort(keys, [](const Key& a, const Key& b) {
    return std::tie(a.position, a.u, a.v, a.wedge) < std::tie(b.position, b.u, b.v, b.wedge);
  });
  vertex.resize(uvs.size());
  std::uint32_t next = first;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    if (i > 0 && !keys[i].same_place(keys[i - 1])) ++next;
    vertex[keys[i].wedge] = next;
  }
  return keys.empty() ? first : next + 1;
}

class ChartFinder {
 public:
  ChartFinder(const AtlasLayout& layout, std::span<const std::uint32_t> atlas_of_triangle,
              std::size_t atlases)
      : layout_(layout), atlas_(atlas_of_triangle), sets_(layout.mesh().triangles.size()) {
    out_.counts.resize(atlases);
  }
  AtlasCharts find();

 private:
  /// A half-edge as its edge sees it: equal sides hang together.
  struct Side {
    std::uint32_t low, high, material, half_edge;  // vertices at the edge's lower and higher position
    bool backwards;                                // runs from the higher position to the lower one
    bool joins(const Side& s) const {
      return std::tie(low, high, material) == std::tie(s.low, s.high, s.material);
    }
  };
  void number();
  void keep_triangles();
  void look_at_edge(std::span<const std::uint32_t> half_edges);
  void add_borders(bool is_line);
  void count_vertices();
  void name_charts();
  std::uint32_t vertex(std::uint32_t triangle, std::size_t corner) const {
    const std::uint32_t w = layout_.mesh().triangles[triangle][corner];
    return layout_.texture(triangle)->texcoord == 1 ? vertex1_[w] : vertex0_[w];
  }
  std::uint32_t position(std::uint32_t triangle, std::size_t corner) const {
    return position_[layout_.mesh().triangles[triangle][corner]];
  }

  const AtlasLayout& layout_;
  std::span<const std::uint32_t> atlas_;
  DisjointSets sets_;
  std::vector<std::uint32_t> position_, vertex0_, vertex1_;  // per wedge
  std::uint32_t vertices_ = 0;
  std::vector<std::uint32_t> kept_, corners_;  // triangles with three positions; these, three each
  std::vector<Side> sides_;                    // of the edge at hand
  std::vector<std::uint32_t> borders_,
      lines_;  // half-edges that end a chart; per position, seams and borders
  AtlasCharts out_;
};

void ChartFinder::number() {
  const Mesh& mesh = layout_.mesh();
  const std::vector<std::uint32_t> weld = weld_positions(mesh.positions, 0);
  position_.resize(mesh.wedge_count());
  for (std::size_t w = 0; w < position_.size(); ++w) {
    const std::uint32_t p = mesh.wedge_position[w];
    position_[w] = weld[p] == kNoIndex ? p : weld[p];
  }
  vertices_ = number_vertices(position_, mesh.uv0, 0, vertex0_);
  const bool second =
      std::ranges::any_of(layout_.guides(), [](const TextureRef& t) { return t.texcoord == 1; });
  if (second) vertices_ = number_vertices(position_, mesh.uv1, vertices_, vertex1_);
}

void ChartFinder::keep_triangles() {
  for (std::uint32_t t = 0; t < atlas_.size(); ++t) {
    if (atlas_[t] == kNoIndex) continue;
    const std::uint32_t a = position(t, 0), b = position(t, 1), c = position(t, 2);
    if (a == b || b == c || c == a) continue;
    kept_.push_back(t);
    corners_.insert(corners_.end(), {a, b, c});
  }
}

/// Charts go on where both sides of an edge have the same vertices; in other places there is a seam, or the
/// mesh ends.
void ChartFinder::look_at_edge(std::span<const std::uint32_t> half_edges) {
  sides_.clear();
  for (const std::uint32_t h : half_edges) {
    const std::uint32_t t = kept_[h / 3];
    const std::size_t from = h % 3, to = (from + 1) % 3;
    const bool backwards = corners_[h] > corners_[next_corner(h)];
    const std::uint32_t a = vertex(t, from), b = vertex(t, to);
    sides_.push_back({backwards ? b : a, backwards ? a : b, layout_.mesh().triangle_material[t],
                      3 * t + static_cast<std::uint32_t>(from), backwards});
  }
  std::ranges::sort(sides_, [](const Side& a, const Side& b) {
    return std::tie(a.low, a.high, a.material, a.half_edge) <
           std::tie(b.low, b.high, b.material, b.half_edge);
  });
  bool seam = false;
  for (std::size_t i = 1; i < sides_.size(); ++i) {
    if (sides_[i].joins(sides_[i - 1])) {
      sets_.join(sides_[i].half_edge / 3, sides_[i - 1].half_edge / 3);
      continue;
    }
    seam = true;
    out_.seams.push_back(
        {sides_[0].half_edge, sides_[i].half_edge, sides_[0].backwards != sides_[i].backwards});
  }
  AtlasCharts::Counts& count = out_.counts[atlas_[sides_[0].half_edge / 3]];
  count.edges += sides_.size() > 1;
  count.seam_edges += seam;
  add_borders(seam || sides_.size() == 1);
  if (seam || sides_.size() == 1)
    for (const std::uint32_t end : {corners_[half_edges[0]], corners_[next_corner(half_edges[0])]})
      ++lines_[end];
}

void ChartFinder::add_borders(bool is_line) {
  if (!is_line) return;
  for (std::size_t i = 0; i < sides_.size(); ++i) {
    const bool alone = (i == 0 || !sides_[i].joins(sides_[i - 1])) &&
                       (i + 1 == sides_.size() || !sides_[i].joins(sides_[i + 1]));
    if (alone) borders_.push_back(sides_[i].half_edge);
  }
}

void ChartFinder::count_vertices() {
  std::vector<std::vector<std::uint32_t>> triangles(out_.counts.size());
  for (const std::uint32_t t : kept_) triangles[atlas_[t]].push_back(t);
  std::vector<std::uint32_t> seen_position(layout_.mesh().positions.size(), kNoIndex),
      seen_vertex(vertices_, kNoIndex);
  for (std::uint32_t a = 0; a < triangles.size(); ++a)
    for (const std::uint32_t t : triangles[a])
      for (std::size_t k = 0; k < 3; ++k) {
        std::uint32_t &p = seen_position[position(t, k)], &v = seen_vertex[vertex(t, k)];
        out_.counts[a].positions += p != a;
        out_.counts[a].vertices += v != a;
        p = v = a;
      }
}

void ChartFinder::name_charts() {
  out_.chart_of_triangle.assign(atlas_.size(), kNoIndex);
  for (const std::uint32_t t : kept_) {  // a set's root is its lowest triangle, which comes first
    const std::uint32_t root = sets_.find(t);
    if (root == t) {
      out_.chart_of_triangle[t] = static_cast<std::uint32_t>(out_.charts.size());
      out_.charts.push_back({});
      out_.charts.back().atlas = atlas_[t];
    }
    const std::uint32_t chart = out_.chart_of_triangle[t] = out_.chart_of_triangle[root];
    const double texels = doubled_texels(layout_.texels(t)) / 2;
    ++out_.charts[chart].triangles;
    out_.charts[chart].texels += std::fabs(texels);
    if (texels > 0) out_.charts[chart].turned_texels += texels;
  }
  for (const std::uint32_t h : borders_) {
    ChartFigures& chart = out_.charts[out_.chart_of_triangle[h / 3]];
    const std::array<Vec2d, 3> at = layout_.texels(h / 3);
    const Vec2d along = at[(h % 3 + 1) % 3] - at[h % 3];
    const double length = std::sqrt(dot(along, along));
    if (std::isfinite(length)) chart.border_texels += length;
    chart.corners += lines_[position(h / 3, h % 3)] != 2;
  }
}

AtlasCharts ChartFinder::find() {
  number();
  keep_triangles();
  lines_.assign(layout_.mesh().positions.size(), 0);
  const EdgeTable edges = group_edges(corners_, layout_.mesh().positions.size());
  for (std::size_t e = 0; e < edges.edge_count(); ++e) look_at_edge(edges.edge(e));
  count_vertices();
  name_charts();
  return std::move(out_);
}

constexpr double kTexelsPerSample = 4;
constexpr double kMostSamples = 8;  // of one edge

/// The light of an image in between its texels, as viewers read it: bilinear, wrapped.
Vec3f light_at(const Pixels& p, Vec2d texels, const TextureRef& texture) {
  const double x = texels.x - 0.5, y = texels.y - 0.5, left = std::floor(x), top = std::floor(y);
  const std::array<float, 256>& light = light_of_bytes();
  Vec3f sum;
  for (const int dy : {0, 1})
    for (const int dx : {0, 1}) {
      const double weight = (dx ? x - left : 1 - (x - left)) * (dy ? y - top : 1 - (y - top));
      const std::uint8_t* at =
          p.at(wrapped(static_cast<std::int64_t>(left) + dx, p.width_px, texture.wrap_s),
               wrapped(static_cast<std::int64_t>(top) + dy, p.height_px, texture.wrap_t));
      const bool grey = p.channels < 3;
      sum = sum + Vec3f{light[at[0]], light[at[grey ? 0 : 1]], light[at[grey ? 0 : 2]]} *
                      static_cast<float>(weight);
    }
  return sum;
}

Vec3d lab_of(Vec3f light) {
  const Vec3d xyz = xyz_of_linear(light);
  const double x = lab_root(xyz.x / kWhiteXyz.x), y = lab_root(xyz.y), z = lab_root(xyz.z / kWhiteXyz.z);
  return {116 * y - 16, 500 * (x - y), 200 * (y - z)};
}

/// One side of a seam, from one end to the other.
struct SeamSide {
  const Pixels* colours = nullptr;
  const TextureRef* texture = nullptr;
  Vec2d from, to, inwards;  // inwards: one texel long, or 0
  bool can_be_read() const {
    const auto near = [](Vec2d p) {
      return std::fabs(p.x) < 0x1p40 && std::fabs(p.y) < 0x1p40;  // finite, and a texel can be told
    };
    return colours && near(from) && near(to);
  }
  double texels() const { return std::sqrt(dot(to - from, to - from)); }
  Vec3d lab(double part, double depth_texels) const {
    return lab_of(light_at(*colours, from + (to - from) * part + inwards * depth_texels, *texture));
  }
};

SeamSide side_of(const AtlasLayout& layout, std::uint32_t half_edge, std::span<const AtlasImage> images) {
  const std::uint32_t t = half_edge / 3, k = half_edge % 3;
  const TextureRef* texture = layout.texture(t);
  const std::array<Vec2d, 3> at = layout.texels(t);
  const Vec2d along = at[(k + 1) % 3] - at[k], across{-along.y, along.x};
  const double length = std::sqrt(dot(along, along));
  const double side = dot(across, at[(k + 2) % 3] - at[k]) < 0 ? -1 : 1;
  const Vec2d inwards = length > 0 ? across * (side / length) : Vec2d{};
  return {images[static_cast<std::size_t>(texture->image)].colours, texture, at[k], at[(k + 1) % 3], inwards};
}

/// Means along a seam, and its length in space; weight 0 where nothing can be compared.
struct SeamDifference {
  double across = 0, inside = 0, weight = 0;
};

SeamDifference difference_along(const AtlasLayout& layout, const AtlasSeam& seam,
                                std::span<const AtlasImage> images) {
  const SeamSide a = side_of(layout, seam.first, images);
  SeamSide b = side_of(layout, seam.second, images);
  if (!a.can_be_read() || !b.can_be_read()) return {};
  if (seam.opposite) std::swap(b.from, b.to);
  const double longer = std::max(a.texels(), b.texels());
  const int samples = static_cast<int>(std::clamp(std::ceil(longer / kTexelsPerSample), 1.0, kMostSamples));
  double across = 0, inside = 0;
  for (int k = 0; k < samples; ++k) {
    const double part = (k + 0.5) / samples;
    const Vec3d here = a.lab(part, 0), there = b.lab(part, 0);
    across += length(here - there);
    inside += (length(here - a.lab(part, 1)) + length(there - b.lab(part, 1))) / 2;
  }
  const std::array<Vec3d, 3> p = layout.points(seam.first / 3);
  const double weight = length(p[(seam.first % 3 + 1) % 3] - p[seam.first % 3]);
  return {across / samples, inside / samples, std::isfinite(weight) ? weight : 0};
}

}  // namespace

AtlasCharts find_charts(const AtlasLayout& layout, std::span<const std::uint32_t> atlas_of_triangle,
                        std::size_t atlases) {
  return ChartFinder(layout, atlas_of_triangle, atlases).find();
}

std::vector<std::optional<SeamColours>> measure_seams(const AtlasLayout& layout, const AtlasCharts& charts,
                                                      std::span<const AtlasImage> images, std::size_t atlases,
                                                      const RunContext& context) {
  std::vector<SeamDifference> differences(charts.seams.size());
  parallel_each(context, differences.size(), 1024,
                [&](std::size_t s) { differences[s] = difference_along(layout, charts.seams[s], images); });
  std::vector<std::vector<WeighedValue>> of_atlas(atlases);
  std::vector<double> inside(atlases);
  for (std::size_t s = 0; s < differences.size(); ++s) {
    const std::uint32_t chart = charts.chart_of_triangle[charts.seams[s].first / 3];
    const SeamDifference& d = differences[s];
    if (!(d.weight > 0)) continue;
    of_atlas[charts.charts[chart].atlas].push_back({d.across, d.weight});
    inside[charts.charts[chart].atlas] += d.inside * d.weight;
  }
  std::vector<std::optional<SeamColours>> out(atlases);
  for (std::size_t a = 0; a < atlases; ++a) {
    if (of_atlas[a].empty()) continue;
    double sum = 0, weight = 0;
    for (const WeighedValue& v : of_atlas[a]) sum += v.value * v.weight, weight += v.weight;
    std::ranges::sort(of_atlas[a]);
    out[a] = SeamColours{sum / weight, weighed_percentile(of_atlas[a], 0.95), inside[a] / weight};
  }
  return out;
}

}  // namespace texmesh
