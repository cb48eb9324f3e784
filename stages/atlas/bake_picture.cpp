// Texels of a new texture. Each belongs to the triangle in which its middle lies, or to the nearest one
// within two texels; it is the mean of so many places there that none of the source's texels is passed over.
#include "stages/atlas/atlas_parts.h"
#include "stages/base/parallel.h"
#include "stages/charts/texture_frame.h"
#include "stages/geometry/mesh_topology.h"
#include "stages/image/decode_image.h"
#include "stages/render/render_math.h"
#include "stages/render/render_texture.h"

namespace texmesh {
namespace {

constexpr std::uint32_t kBandRows = 64, kBlockPx = 16;
constexpr double kReach = 2;     // texels around a chart that continue it
constexpr int kMostSamples = 4;  // along each axis of a texel

/// A triangle on the new texture, in texels.
struct FlatTriangle {
  std::array<Vec2d, 3> p;

  /// Weights of the corners at the nearest place of the triangle, and its squared distance.
  std::array<double, 3> nearest(Vec2d at, double& distance2) const {
    const double area = cross(p[1] - p[0], p[2] - p[0]);
    if (std::fabs(area) > 0) {
      const double w1 = cross(at - p[0], p[2] - p[0]) / area, w2 = cross(p[1] - p[0], at - p[0]) / area;
      if (w1 >= 0 && w2 >= 0 && w1 + w2 <= 1) {
        distance2 = 0;
        return {1 - w1 - w2, w1, w2};
      }
    }
    std::array<double, 3> best{1, 0, 0};
    distance2 = 1e300;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t next = (k + 1) % 3;
      const Vec2d edge = p[next] - p[k];
      const double square = dot(edge, edge);
      const double part = square > 0 ? std::clamp(dot(at - p[k], edge) / square, 0.0, 1.0) : 0;
      const Vec2d away = p[k] + edge * part - at;
      if (const double d2 = dot(away, away); d2 < distance2) {
        distance2 = d2;
        best = {};
        best[k] = 1 - part, best[next] = part;
      }
    }
    return best;
  }
};

FlatTriangle flat_triangle(const AtlasPages& pages, std::uint32_t triangle, double side_px) {
  FlatTriangle out;
  for (std::size_t k = 0; k < 3; ++k)
    out.p[k] = to_double(pages.uvs[pages.vertex_of[3 * std::size_t{triangle} + k]]) * side_px;
  return out;
}

/// Per texel the triangle that it belongs to; kNoIndex: none.
std::vector<std::uint32_t> texel_owners(const AtlasPages& pages, const AtlasPage& page, std::uint32_t side_px,
                                        const RunContext& context) {
  const std::uint32_t bands = (side_px + kBandRows - 1) / kBandRows;
  struct Rows {
    std::uint32_t first, end;
  };
  const auto range = [&](double low, double high) {
    const double most = side_px;
    return Rows{static_cast<std::uint32_t>(std::clamp(std::floor(low - kReach), 0.0, most)),
                static_cast<std::uint32_t>(std::clamp(std::ceil(high + kReach), 0.0, most))};
  };
  std::vector<std::vector<std::uint32_t>> in_band(bands);
  for (const std::uint32_t t : page.triangles) {
    const FlatTriangle flat = flat_triangle(pages, t, side_px);
    const auto [low, high] = std::minmax({flat.p[0].y, flat.p[1].y, flat.p[2].y});
    const Rows rows = range(low, high);
    for (std::uint32_t b = rows.first / kBandRows; b * kBandRows < rows.end; ++b) in_band[b].push_back(t);
  }
  std::vector<std::uint32_t> owner(std::size_t{side_px} * side_px, kNoIndex);
  parallel_each(context, bands, 1, [&](std::size_t band) {
    context.check_cancelled();
    const auto first_row = static_cast<std::uint32_t>(band) * kBandRows;
    const std::uint32_t end_row = std::min(first_row + kBandRows, side_px);
    std::vector<float> nearest(std::size_t{end_row - first_row} * side_px, float{kReach * kReach});
    for (const std::uint32_t t : in_band[band]) {
      const FlatTriangle flat = flat_triangle(pages, t, side_px);
      const auto [low_y, high_y] = std::minmax({flat.p[0].y, flat.p[1].y, flat.p[2].y});
      const auto [low_x, high_x] = std::minmax({flat.p[0].x, flat.p[1].x, flat.p[2].x});
      const Rows rows = range(low_y, high_y), columns = range(low_x, high_x);
      for (std::uint32_t y = std::max(rows.first, first_row); y < std::min(rows.end, end_row); ++y)
        for (std::uint32_t x = columns.first; x < columns.end; ++x) {
          float& least = nearest[std::size_t{y - first_row} * side_px + x];
          if (least == 0) continue;
          double distance2 = 0;
          flat.nearest({x + 0.5, y + 0.5}, distance2);
          if (static_cast<float>(distance2) >= least) continue;
          least = static_cast<float>(distance2);
          owner[std::size_t{y} * side_px + x] = t;
        }
    }
  });
  return owner;
}

/// The longest side that a new texel has on the source, in its texels.
double footprint_px(const FlatTriangle& flat, const std::array<Vec2d, 3>& source) {
  const Vec2d a = flat.p[1] - flat.p[0], b = flat.p[2] - flat.p[0];
  const double area = cross(a, b);
  const Vec2d s = source[1] - source[0], t = source[2] - source[0];
  const Vec2d dx = (s * b.y - t * a.y) * (1 / area), dy = (t * a.x - s * b.x) * (1 / area);
  const double longest2 = std::max(dot(dx, dx), dot(dy, dy));
  return std::isfinite(longest2) ? std::sqrt(longest2) : 0;
}

/// Reads one picture of one material.
class PictureReader {
 public:
  PictureReader(const Mesh& mesh, const AtlasPages& pages, const ReadPicture& picture, const Image& image,
                std::uint32_t side_px, const RunContext& context)
      : mesh_(mesh), pages_(pages), picture_(picture), side_px_(side_px) {
    const bool srgb = picture.kind == TexelKind::kColour;
    Pixels pixels = decode_image(image, srgb ? FloatEncoding::kSrgb : FloatEncoding::kAsIs);
    texture_.width_px = pixels.width_px, texture_.height_px = pixels.height_px;
    texture_.srgb = srgb;
    texture_.levels.push_back(std::move(pixels));
    complete_mips(texture_, context);
    slot_.wrap_s = picture.reference.wrap_s, slot_.wrap_t = picture.reference.wrap_t;
  }

  /// All that a triangle's texels have in common.
  struct Place {
    std::uint32_t triangle = kNoIndex;
    FlatTriangle flat;
    std::array<Vec2d, 3> uv, new_uv;
    std::array<Vec3d, 3> corner;
    int samples = 1;  // along each axis
    float side = 0;   // of a sample on the source, by its width
    float side_t = 0;
  };
  Place place(std::uint32_t triangle) const {
    Place out;
    out.triangle = triangle;
    out.flat = flat_triangle(pages_, triangle, side_px_);
    out.uv = read_uvs(mesh_, triangle, picture_.reference);
    std::array<Vec2d, 3> texels;
    for (std::size_t k = 0; k < 3; ++k) {
      out.new_uv[k] = out.flat.p[k] * (1.0 / side_px_);
      texels[k] = {out.uv[k].x * texture_.width_px, out.uv[k].y * texture_.height_px};
    }
    out.corner = corner_points(mesh_, mesh_.triangles[triangle]);
    const double footprint = footprint_px(out.flat, texels);
    out.samples = static_cast<int>(std::clamp(std::ceil(footprint * 1.5), 1.0, double{kMostSamples}));
    const double side = std::min(footprint / out.samples, 1e6);
    out.side = static_cast<float>(side / texture_.width_px);
    out.side_t = static_cast<float>(side / texture_.height_px);
    return out;
  }

  /// Linear RGBA, or a vector of the new texture's axes.
  Vec4f texel(const Place& place, std::uint32_t x, std::uint32_t y) const {
    Vec4f sum{};
    Vec3d direction;
    for (int j = 0; j < place.samples; ++j)
      for (int i = 0; i < place.samples; ++i) {
        double distance2 = 0;
        const std::array<double, 3> weight =
            place.flat.nearest({x + (i + 0.5) / place.samples, y + (j + 0.5) / place.samples}, distance2);
        const Vec4f read = sample(place, weight);
        sum = {sum.x + read.x, sum.y + read.y, sum.z + read.z, sum.w + read.w};
        if (picture_.kind == TexelKind::kNormal) direction = direction + turned(place, weight, read);
      }
    if (picture_.kind == TexelKind::kNormal) {
      const Vec3d unit = normalized(direction);
      if (!(dot(unit, unit) > 0.5)) return {0.5f, 0.5f, 1, 1};
      return {static_cast<float>(unit.x / 2 + 0.5), static_cast<float>(unit.y / 2 + 0.5),
              static_cast<float>(unit.z / 2 + 0.5), 1};
    }
    const float part = 1 / static_cast<float>(place.samples * place.samples);
    return {sum.x * part, sum.y * part, sum.z * part, sum.w * part};
  }

 private:
  Vec4f sample(const Place& place, const std::array<double, 3>& weight) const {
    const Vec2d uv = place.uv[0] * weight[0] + place.uv[1] * weight[1] + place.uv[2] * weight[2];
    TextureFootprint at;
    at.uv = {static_cast<float>(uv.x), static_cast<float>(uv.y)};
    at.uv_dx = {place.side, 0};
    at.uv_dy = {0, place.side_t};
    return TextureSite({texture_.width_px, texture_.height_px}, 0, slot_, at).read(texture_);
  }

  /// A normal map's vector in the axes of the new texture.
  Vec3d turned(const Place& place, const std::array<double, 3>& weight, Vec4f texel) const {
    const Triangle& corner = mesh_.triangles[place.triangle];
    const Vec3d face =
        normalized(cross(place.corner[1] - place.corner[0], place.corner[2] - place.corner[0]));
    Vec3d normal = face;
    if (!mesh_.normals.empty()) {
      Vec3d mean;
      for (std::size_t k = 0; k < 3; ++k) mean = mean + to_double(mesh_.normals[corner[k]]) * weight[k];
      if (dot(mean, mean) > 1e-20) normal = normalized(mean);
    }
    const auto carried = vertex_frame(mesh_, place.triangle, weight);
    const TextureFrame from = carried ? *carried : texture_frame(place.corner, place.uv, normal);
    const TextureFrame to = texture_frame(place.corner, place.new_uv, normal);
    const double scale = picture_.normal_scale, x = (texel.x * 2.0 - 1) * scale,
                 y = (texel.y * 2.0 - 1) * scale;
    const Vec3d across = from.along_u * x + from.along_v * y;
    // The new axes stand at right angles to the normal, but not always to each other.
    const double uu = dot(to.along_u, to.along_u), vv = dot(to.along_v, to.along_v),
                 uv = dot(to.along_u, to.along_v), au = dot(across, to.along_u), av = dot(across, to.along_v);
    const double determinant = uu * vv - uv * uv;
    if (!(determinant > 1e-9) || scale == 0) return {0, 0, 1};
    return {(au * vv - av * uv) / determinant / scale, (av * uu - au * uv) / determinant / scale,
            texel.z * 2.0 - 1 + dot(across, normal)};
  }

  const Mesh& mesh_;
  const AtlasPages& pages_;
  const ReadPicture& picture_;
  const std::uint32_t side_px_;
  RenderTexture texture_;
  TextureSlot slot_;
};

std::uint8_t byte_of(float value) {
  return static_cast<std::uint8_t>(std::clamp(value, 0.f, 1.f) * 255 + 0.5f);
}

void put_texel(Vec4f value, bool srgb, std::uint32_t channels, std::uint8_t* to) {
  const float colour[3] = {value.x, value.y, value.z};
  for (std::uint32_t c = 0; c < std::min(channels, 3u); ++c)
    to[c] = srgb ? srgb_encoder()(colour[c]) : byte_of(colour[c]);
  if (channels == 4) to[3] = byte_of(value.w);
}

/// Texels of no chart get the mean of their block, or of the block before: codecs of blocks spend nothing on
/// them.
void fill_blocks(Pixels& pixels, const std::vector<std::uint32_t>& owner) {
  std::array<std::uint8_t, 4> mean{};
  for (std::uint32_t top = 0; top < pixels.height_px; top += kBlockPx)
    for (std::uint32_t left = 0; left < pixels.width_px; left += kBlockPx) {
      const std::uint32_t bottom = std::min(top + kBlockPx, pixels.height_px),
                          right = std::min(left + kBlockPx, pixels.width_px);
      std::array<std::uint32_t, 4> sum{};
      std::uint32_t count = 0;
      const auto each = [&](const auto& f) {
        for (std::uint32_t y = top; y < bottom; ++y)
          for (std::uint32_t x = left; x < right; ++x) {
            const std::size_t at = std::size_t{y} * pixels.width_px + x;
            f(owner[at] != kNoIndex, &pixels.data[at * pixels.channels]);
          }
      };
      each([&](bool covered, const std::uint8_t* texel) {
        count += covered ? 1 : 0;
        for (std::uint32_t c = 0; covered && c < pixels.channels; ++c) sum[c] += texel[c];
      });
      for (std::uint32_t c = 0; count > 0 && c < pixels.channels; ++c)
        mean[c] = static_cast<std::uint8_t>((sum[c] + count / 2) / count);
      each([&](bool covered, std::uint8_t* texel) {
        if (!covered) std::copy_n(mean.data(), pixels.channels, texel);
      });
    }
}

}  // namespace

Pixels bake_picture(const Mesh& source, const MaterialClasses& classes, const std::vector<Image>& images,
                    const AtlasPages& pages, std::uint32_t page_index, std::uint32_t picture_index,
                    const RunContext& context) {
  const AtlasPage& page = pages.pages[page_index];
  const ClassPicture& picture = classes.classes[page.material_class].pictures[picture_index];
  const std::uint32_t side_px = page.side_px >> picture.halvings;
  Pixels out{side_px, side_px, picture.channels, {}};
  out.data.resize(std::size_t{side_px} * side_px * picture.channels);
  const std::vector<std::uint32_t> owner = texel_owners(pages, page, side_px, context);
  std::vector<std::uint8_t> used(classes.class_of.size(), 0);
  for (const std::uint32_t t : page.triangles) used[source.triangle_material[t]] = 1;
  for (std::size_t material = 0; material < used.size(); ++material) {
    if (!used[material]) continue;
    const ReadPicture& read = classes.pictures[material][picture_index];
    const PictureReader reader(source, pages, read, images.at(static_cast<std::size_t>(read.reference.image)),
                               side_px, context);
    parallel_for(context, side_px, 16, [&](std::size_t begin, std::size_t end) {
      context.check_cancelled();
      PictureReader::Place place;
      for (std::size_t y = begin; y < end; ++y)
        for (std::size_t x = 0; x < side_px; ++x) {
          const std::uint32_t t = owner[y * side_px + x];
          if (t == kNoIndex || source.triangle_material[t] != material) continue;
          if (place.triangle != t) place = reader.place(t);
          put_texel(reader.texel(place, static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y)),
                    picture.kind == TexelKind::kColour, picture.channels,
                    &out.data[(y * side_px + x) * picture.channels]);
        }
    });
  }
  fill_blocks(out, owner);
  return out;
}

}  // namespace texmesh
