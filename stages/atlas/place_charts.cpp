// Where charts lie. Charts are cut class by class, get so many texels as the source has there, are shared out
// to pages of at most 8192 px, and packed. Triangles without area follow their neighbours.
#include <unordered_map>

#include "format/base/numbering.h"
#include "stages/atlas/atlas_parts.h"
#include "stages/geometry/mesh_topology.h"

namespace texmesh {
namespace {

constexpr std::uint32_t kSideStepPx = 64;
constexpr std::uint32_t kGutterPx = 4;
constexpr double kExpectedCover = 0.7;  // of a page by its charts
constexpr double kMostTexels = 2;       // of those of the source's images
// Of the density that is asked for: so much less is no reason to pack again.
constexpr double kNearEnough = 0.97;
constexpr int kMostPackings = 4;
constexpr ChartLimits kLimits{1.5, 6};

/// The triangles that have an area and textures.
struct TexturedSurface {
  ProxySurface surface;                  // a class is a group
  std::vector<std::uint32_t> triangles;  // of the mesh, by the surface's
};

TexturedSurface textured_surface(const ConditionedMesh& from, const MaterialClasses& classes) {
  const Mesh& mesh = from.mesh;
  TexturedSurface out;
  std::vector<std::uint32_t> number(mesh.positions.size(), kNoIndex);
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::uint32_t material_class = classes.class_of[mesh.triangle_material[t]];
    const auto [a, b, c] = corner_points(mesh, mesh.triangles[t]);
    if (material_class == kNoIndex || !(length(cross(b - a, c - a)) > 0)) continue;
    Triangle corners;
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t position = from.twin[mesh.position_of(t, k)];
      corners[static_cast<std::size_t>(k)] =
          numbered(number[position], out.surface.positions, mesh.positions[position]);
    }
    if (corners[0] == corners[1] || corners[1] == corners[2] || corners[2] == corners[0]) continue;
    out.triangles.push_back(t);
    out.surface.triangles.push_back(corners);
    out.surface.group.push_back(material_class);
  }
  return out;
}

/// Texels of the source on a triangle.
double source_texels(const Mesh& mesh, std::uint32_t triangle, const MaterialClasses& classes,
                     const std::vector<Image>& images) {
  const std::uint16_t material = mesh.triangle_material[triangle];
  const ReadPicture& guide = classes.pictures[material][classes.guide[material]];
  const Image& image = images.at(static_cast<std::size_t>(guide.reference.image));
  const auto [a, b, c] = read_uvs(mesh, triangle, guide.reference);
  const double texels = std::fabs(cross(b - a, c - a)) / 2 * image.width_px * image.height_px;
  return std::isfinite(texels) ? texels : 0;
}

/// What a chart asks for.
struct ChartWish {
  std::uint32_t group = 0;
  double area = 0, texels = 0;
  Vec3d centre;      // sum of the triangles' middles by area
  double scale = 1;  // texels per object unit
};

std::vector<ChartWish> chart_wishes(const Mesh& mesh, const TexturedSurface& textured,
                                    const SurfaceCharts& charts, const MaterialClasses& classes,
                                    const std::vector<Image>& images) {
  std::vector<ChartWish> out(charts.chart_count);
  for (std::size_t i = 0; i < textured.triangles.size(); ++i) {
    ChartWish& wish = out[charts.chart_of[i]];
    const Vec2d* p = &charts.plane[3 * i];
    const double area = std::fabs(cross(p[1] - p[0], p[2] - p[0])) / 2;
    const auto [a, b, c] = corner_points(mesh, mesh.triangles[textured.triangles[i]]);
    wish.group = textured.surface.group[i];
    wish.area += area;
    wish.texels += source_texels(mesh, textured.triangles[i], classes, images);
    wish.centre = wish.centre + (a + b + c) * (area / 3);
  }
  return out;
}

/// Charts keep the density of the source, as long as all of a class have no more than kMostTexels. Returns
/// the least share of their texels that the charts of a class keep.
double set_scales(std::vector<ChartWish>& wishes, const MaterialClasses& classes, double density) {
  std::vector<double> texels(classes.classes.size(), 0);
  for (const ChartWish& w : wishes) texels[w.group] += w.texels * density * density;
  double least = 1;
  for (ChartWish& w : wishes) {
    const double most = kMostTexels * classes.classes[w.group].texels;
    const double reduced = texels[w.group] > most ? most / texels[w.group] : 1;
    least = std::min(least, reduced);
    w.scale = w.area > 0 ? density * std::sqrt(std::max(w.texels, 1.0) * reduced / w.area) : 1;
  }
  return least;
}

double scaled_texels(const ChartWish& w) { return w.area * w.scale * w.scale; }

/// Halves lists of charts across the longest side of the box around their middles, until each fits a page.
void share_out(std::vector<std::uint32_t> charts, const std::vector<ChartWish>& wishes, double most_side_px,
               std::vector<std::vector<std::uint32_t>>& pages) {
  double texels = 0;
  Box3d box;
  const auto middle = [&](std::uint32_t c) {
    return wishes[c].centre * (1 / std::max(wishes[c].area, 1e-300));
  };
  for (const std::uint32_t c : charts) {
    texels += scaled_texels(wishes[c]);
    box.extend(middle(c));
  }
  if (charts.size() < 2 || texels <= kExpectedCover * most_side_px * most_side_px) {
    std::ranges::sort(charts);
    pages.push_back(std::move(charts));
    return;
  }
  const Vec3d size = box.max - box.min;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  std::ranges::sort(charts, {}, [&](std::uint32_t c) { return std::pair(middle(c)[axis], c); });
  std::size_t first = 0;
  for (double half = 0; first + 1 < charts.size() && half < texels / 2; ++first)
    half += scaled_texels(wishes[charts[first]]);
  share_out({charts.begin(), charts.begin() + static_cast<std::ptrdiff_t>(first)}, wishes, most_side_px,
            pages);
  share_out({charts.begin() + static_cast<std::ptrdiff_t>(first), charts.end()}, wishes, most_side_px, pages);
}

/// Some of the charts, in texels instead of object units.
struct PageCharts {
  ProxySurface surface;
  SurfaceCharts charts;
  std::vector<std::uint32_t> triangles;  // of the whole surface
  double texels = 0;
};

PageCharts charts_of_page(const TexturedSurface& textured, const SurfaceCharts& all,
                          const std::vector<ChartWish>& wishes, const std::vector<std::uint32_t>& chosen) {
  PageCharts out;
  std::vector<std::uint32_t> number(all.chart_count, kNoIndex), vertex(all.vertex_count, kNoIndex);
  out.surface.positions = textured.surface.positions;
  for (const std::uint32_t c : chosen) {
    number[c] = out.charts.chart_count++;
    out.charts.size.push_back(all.size[c] * wishes[c].scale);
    out.texels += scaled_texels(wishes[c]);
  }
  for (std::uint32_t i = 0; i < textured.triangles.size(); ++i) {
    const std::uint32_t chart = all.chart_of[i];
    if (number[chart] == kNoIndex) continue;
    out.triangles.push_back(i);
    out.surface.triangles.push_back(textured.surface.triangles[i]);
    out.surface.group.push_back(textured.surface.group[i]);
    out.charts.chart_of.push_back(number[chart]);
    for (std::size_t c = 3 * std::size_t{i}; c < 3 * std::size_t{i} + 3; ++c) {
      out.charts.plane.push_back(all.plane[c] * wishes[chart].scale);
      std::uint32_t& v = vertex[all.vertex_of[c]];
      if (v == kNoIndex) v = out.charts.vertex_count++;
      out.charts.vertex_of.push_back(v);
    }
  }
  return out;
}

/// By how much the packing has scaled the charts.
double packed_scale(const AtlasMesh& packed, double texels) {
  double area = 0;
  for (const Triangle& t : packed.triangles) {
    const Vec2d a = to_double(packed.uvs[t[0]]);
    area += std::fabs(cross(to_double(packed.uvs[t[1]]) - a, to_double(packed.uvs[t[2]]) - a)) / 2;
  }
  return std::sqrt(area * packed.width_px * packed.height_px / texels);
}

std::optional<AtlasMesh> pack_page(const PageCharts& page, std::uint32_t most_side_px,
                                   const RunContext& context) {
  const auto stepped = [most_side_px](double side) {
    const double steps = std::ceil(std::max(side, 1.0) / kSideStepPx);
    return static_cast<std::uint32_t>(std::min(steps * kSideStepPx, double(most_side_px)));
  };
  std::uint32_t side_px = stepped(std::sqrt(page.texels / kExpectedCover));
  std::optional<AtlasMesh> best;
  for (int i = 0; i < kMostPackings; ++i) {
    auto packed = pack_atlas(page.surface, page.charts, side_px, side_px, kGutterPx, context);
    const double scale = packed ? packed_scale(*packed, page.texels) : 0.5;
    if (packed) best = std::move(packed);
    if (scale >= kNearEnough || side_px == most_side_px) break;
    side_px = std::max(stepped(side_px / scale), std::min(side_px + kSideStepPx, most_side_px));
  }
  return best;
}

/// Puts triangles without area where their neighbours have them.
class SliverPlaces {
 public:
  SliverPlaces(const ConditionedMesh& from, const MaterialClasses& classes, AtlasPages& pages)
      : from_(from), classes_(classes), pages_(pages) {}

  void place() {
    std::vector<std::uint32_t> slivers;
    for (std::uint32_t t = 0; t < pages_.page_of.size(); ++t)
      if (pages_.page_of[t] == kNoIndex && class_of(t) != kNoIndex) slivers.push_back(t);
    if (slivers.empty()) return;
    for (std::uint32_t t = 0; t < pages_.page_of.size(); ++t)
      if (pages_.page_of[t] != kNoIndex)
        for (std::uint32_t k = 0; k < 3; ++k) half_edges_.try_emplace(edge_key(3 * t + k), 3 * t + k);
    for (const std::uint32_t t : slivers) place_one(t);
  }

 private:
  std::uint32_t class_of(std::uint32_t t) const { return classes_.class_of[from_.mesh.triangle_material[t]]; }
  std::uint32_t position(std::uint32_t corner) const {
    return from_.twin[from_.mesh.position_of(corner / 3, static_cast<int>(corner % 3))];
  }
  std::uint64_t edge_key(std::uint32_t corner) const {
    const auto [a, b] = std::minmax({position(corner), position(next_corner(corner))});
    return std::uint64_t{a} << 32 | b;
  }
  Vec3d point(std::uint32_t corner) const { return to_double(from_.mesh.positions[position(corner)]); }

  /// The neighbour's vertices at the ends of a corner's edge; kNoIndex without a neighbour.
  std::pair<std::uint32_t, std::uint32_t> ends(std::uint32_t corner, std::uint32_t& page) const {
    const auto found = half_edges_.find(edge_key(corner));
    if (found == half_edges_.end() || class_of(found->second / 3) != class_of(corner / 3))
      return {kNoIndex, kNoIndex};
    const std::uint32_t h = found->second, next = next_corner(h);
    page = pages_.page_of[h / 3];
    const bool same_way = position(h) == position(corner);
    return {pages_.vertex_of[same_way ? h : next], pages_.vertex_of[same_way ? next : h]};
  }

  void place_one(std::uint32_t t) {
    std::array<std::uint32_t, 3> corner{3 * t, 3 * t + 1, 3 * t + 2};
    const auto edge = [&](std::uint32_t c) { return length(point(next_corner(c)) - point(c)); };
    std::ranges::stable_sort(corner, std::greater(), edge);
    for (const std::uint32_t c : corner) {
      std::uint32_t page = kNoIndex;
      const auto [a, b] = ends(c, page);
      if (a == kNoIndex) continue;
      const std::uint32_t other = previous_corner(c);
      const Vec3d along = point(next_corner(c)) - point(c);
      const double square = dot(along, along);
      const double part = square > 0 ? std::clamp(dot(point(other) - point(c), along) / square, 0.0, 1.0) : 0;
      pages_.page_of[t] = page;
      pages_.vertex_of[c] = a;
      pages_.vertex_of[next_corner(c)] = b;
      pages_.vertex_of[other] = static_cast<std::uint32_t>(pages_.uvs.size());
      pages_.uvs.push_back(pages_.uvs[a] + (pages_.uvs[b] - pages_.uvs[a]) * static_cast<float>(part));
      return;
    }
    // Alone: any place of its class.
    for (std::uint32_t p = 0; p < pages_.pages.size(); ++p) {
      if (pages_.pages[p].material_class != class_of(t)) continue;
      pages_.page_of[t] = p;
      const std::uint32_t v = pages_.vertex_of[3 * std::size_t{pages_.pages[p].triangles.front()}];
      for (const std::uint32_t c : corner) pages_.vertex_of[c] = v;
      return;
    }
  }

  const ConditionedMesh& from_;
  const MaterialClasses& classes_;
  AtlasPages& pages_;
  std::unordered_map<std::uint64_t, std::uint32_t> half_edges_;  // any of an edge with an area beside it
};

void add_page(const PageCharts& charts, const AtlasMesh& packed, const TexturedSurface& textured,
              AtlasPages& out) {
  const auto first = static_cast<std::uint32_t>(out.uvs.size()),
             index = static_cast<std::uint32_t>(out.pages.size());
  AtlasPage& page = out.pages.emplace_back();
  page.material_class = charts.surface.group.front();
  page.side_px = packed.width_px;
  out.uvs.insert(out.uvs.end(), packed.uvs.begin(), packed.uvs.end());
  for (std::size_t i = 0; i < charts.triangles.size(); ++i) {
    const std::uint32_t t = textured.triangles[charts.triangles[i]];
    page.triangles.push_back(t);
    out.page_of[t] = index;
    for (std::size_t k = 0; k < 3; ++k)
      out.vertex_of[3 * std::size_t{t} + k] = first + packed.triangles[i][k];
  }
}

}  // namespace

std::optional<AtlasPages> place_charts(const ConditionedMesh& mesh, const MaterialClasses& classes,
                                       const std::vector<Image>& images, double density,
                                       const RunContext& context, std::uint32_t most_side_px) {
  const TexturedSurface textured = textured_surface(mesh, classes);
  if (textured.triangles.empty()) return std::nullopt;
  const SurfaceCharts charts = segment_charts(textured.surface, context, kLimits);
  std::vector<ChartWish> wishes = chart_wishes(mesh.mesh, textured, charts, classes, images);
  AtlasPages out;
  out.least_share = set_scales(wishes, classes, density);
  out.chart_count = charts.chart_count;
  out.vertex_of.assign(3 * mesh.mesh.triangles.size(), kNoIndex);
  out.page_of.assign(mesh.mesh.triangles.size(), kNoIndex);
  for (std::uint32_t group = 0; group < classes.classes.size(); ++group) {
    std::vector<std::uint32_t> of_class;
    for (std::uint32_t c = 0; c < wishes.size(); ++c)
      if (wishes[c].group == group) of_class.push_back(c);
    if (of_class.empty()) continue;
    std::vector<std::vector<std::uint32_t>> shares;
    share_out(std::move(of_class), wishes, most_side_px, shares);
    for (const std::vector<std::uint32_t>& share : shares) {
      const PageCharts page = charts_of_page(textured, charts, wishes, share);
      const auto packed = pack_page(page, most_side_px, context);
      if (!packed) return std::nullopt;
      add_page(page, *packed, textured, out);
    }
  }
  SliverPlaces(mesh, classes, out).place();
  for (std::size_t t = 0; t < out.page_of.size(); ++t)
    if (out.page_of[t] == kNoIndex && classes.class_of[mesh.mesh.triangle_material[t]] != kNoIndex)
      return std::nullopt;  // a class without any area
  return out;
}

}  // namespace texmesh
