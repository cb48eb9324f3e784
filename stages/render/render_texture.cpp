#include "stages/render/render_texture.h"

#include "stages/base/parallel.h"
#include "stages/image/decode_image.h"
#include "stages/render/render_math.h"

namespace texmesh {
namespace {

/// What a texel of the coarser level reads along one axis.
struct Pair {
  std::uint32_t first, second;
  float part;
};

std::vector<Pair> pairs(std::uint32_t fine, std::uint32_t coarse) {
  std::vector<Pair> out(coarse);
  for (std::uint32_t i = 0; i < coarse; ++i) {
    // (i + 0.5) fine / coarse - 0.5, as a fraction of 2 coarse
    const std::uint64_t at = (2ull * i + 1) * fine - coarse;
    const auto first = static_cast<std::uint32_t>(at / (2ull * coarse));
    out[i] = {first, std::min(first + 1, fine - 1),
              static_cast<float>(at % (2ull * coarse)) / static_cast<float>(2ull * coarse)};
  }
  return out;
}

/// The mean of 2 x 2 numbers, as next_level() rounds it: exact in floats, too.
void halve_numbers(const std::uint8_t* upper, const std::uint8_t* lower, std::size_t channels,
                   std::size_t texels, std::uint8_t* to) {
  for (std::size_t x = 0; x < texels; ++x, upper += 2 * channels, lower += 2 * channels)
    for (std::size_t k = 0; k < channels; ++k)
      *to++ = static_cast<std::uint8_t>(
          (upper[k] + upper[channels + k] + lower[k] + lower[channels + k] + 2) >> 2);
}

Pixels next_level(const Pixels& fine, bool srgb, const RunContext& context) {
  Pixels out{std::max(fine.width_px / 2, 1u), std::max(fine.height_px / 2, 1u), fine.channels, {}};
  out.data.resize(static_cast<std::size_t>(out.width_px) * out.height_px * out.channels);
  const std::vector<Pair> across = pairs(fine.width_px, out.width_px),
                          down = pairs(fine.height_px, out.height_px);
  const std::size_t n = fine.channels;
  const std::size_t colours = !srgb ? 0 : n % 2 == 0 ? n - 1 : n;  // alpha stays a plain number
  const bool even = fine.width_px == 2 * out.width_px && fine.height_px == 2 * out.height_px;
  const auto& encode = srgb_encoder();
  const auto& light = light_of_bytes();
  parallel_for(context, out.height_px, 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y) {
      const Pair& d = down[y];
      std::uint8_t* to = out.data.data() + y * out.width_px * n;
      if (colours == 0 && even) {
        halve_numbers(fine.at(0, d.first), fine.at(0, d.second), n, out.width_px, to);
        continue;
      }
      for (const Pair& a : across) {
        const std::uint8_t *p = fine.at(a.first, d.first), *q = fine.at(a.second, d.first),
                           *r = fine.at(a.first, d.second), *s = fine.at(a.second, d.second);
        auto mean = [&](float pv, float qv, float rv, float sv) {
          const float top = pv + (qv - pv) * a.part, bottom = rv + (sv - rv) * a.part;
          return top + (bottom - top) * d.part;
        };
        for (std::size_t k = 0; k < n; ++k)
          *to++ = k < colours ? encode(mean(light[p[k]], light[q[k]], light[r[k]], light[s[k]]))
                              : static_cast<std::uint8_t>(mean(p[k], q[k], r[k], s[k]) + 0.5f);
      }
    }
  });
  return out;
}

/// A texture that materials read: an image as colours or as plain numbers.
struct ImageUse {
  std::uint32_t image = 0;
  bool srgb = false;
  friend bool operator==(const ImageUse&, const ImageUse&) = default;
};

std::optional<std::size_t> plane_of(const Fragments& fragments, std::uint32_t image, bool alpha,
                                    std::uint32_t mip) {
  for (std::size_t p = 0; p < fragments.planes.size(); ++p) {
    const TexturePlane& plane = fragments.planes[p];
    if (plane.image == image && plane.mip == mip && (plane.role == TextureRole::kAlpha) == alpha) return p;
  }
  return std::nullopt;
}

/// Colours and alpha of one size.
struct PlanePair {
  std::size_t colours = 0;
  std::optional<std::size_t> alpha;
};

/// The coarsest size that has the side; one at which the alpha has a plane, too, where there is an alpha.
PlanePair planes_for(const Fragments& fragments, std::uint32_t image, std::size_t full,
                     std::uint32_t least_side_px) {
  const bool has_alpha = plane_of(fragments, image, true, 0).has_value();
  PlanePair best{full, plane_of(fragments, image, true, 0)};
  for (std::uint32_t mip = 1;; ++mip) {
    const auto colours = plane_of(fragments, image, false, mip);
    if (!colours) return best;
    const TexturePlane& plane = fragments.planes[*colours];
    if (std::max(plane.width_px, plane.height_px) < least_side_px) return best;
    const auto alpha = plane_of(fragments, image, true, mip);
    if (alpha.has_value() == has_alpha) best = {*colours, alpha};
  }
}

/// Writes a plane's texels into channels of the image, from channel `first` on.
void put_plane(const TexturePlane& plane, const Pixels& pixels, std::uint32_t first, std::uint32_t count,
               Pixels& image) {
  if (pixels.width_px < image.width_px || pixels.height_px < image.height_px ||
      pixels.data.size() != std::size_t{pixels.width_px} * pixels.height_px * pixels.channels)
    throw StageError("render", "pixels of image " + std::to_string(plane.image), "as large as their plane",
                     std::to_string(pixels.width_px) + " x " + std::to_string(pixels.height_px));
  for (std::uint32_t y = 0; y < image.height_px; ++y)
    for (std::uint32_t x = 0; x < image.width_px; ++x) {
      const std::uint8_t* from = pixels.at(x, y);
      std::uint8_t* to = image.data.data() + (std::size_t{y} * image.width_px + x) * image.channels + first;
      for (std::uint32_t c = 0; c < count; ++c) to[c] = from[pixels.channels >= 3 ? c : 0];
    }
}

RenderTexture texture_of(const Fragments& fragments, const std::vector<Pixels>& pixels, const ImageUse& use,
                         std::uint32_t least_side_px, const RunContext& context) {
  const std::size_t full = *plane_of(fragments, use.image, false, 0);
  const PlanePair pair = planes_for(fragments, use.image, full, least_side_px);
  const TexturePlane& plane = fragments.planes[pair.colours];
  const std::uint32_t colours = plane.channels >= 3 ? 3 : 1;
  Pixels image{plane.width_px, plane.height_px, colours + (pair.alpha ? 1 : 0), {}};
  image.data.resize(std::size_t{image.width_px} * image.height_px * image.channels);
  put_plane(plane, pixels.at(pair.colours), 0, colours, image);
  if (pair.alpha) put_plane(fragments.planes[*pair.alpha], pixels.at(*pair.alpha), colours, 1, image);
  return render_texture(std::move(image), use.srgb, 0, context);
}

/// Materials with the textures that `make` makes of the images that `is_there`.
ShownMaterials shown_with(const std::vector<Material>& materials, const Mesh& mesh,
                          const std::function<bool(std::uint32_t image)>& is_there,
                          const std::function<RenderTexture(const ImageUse&)>& make) {
  ShownMaterials out;
  std::vector<ImageUse> uses;
  const auto index_of = [&](const TextureRef& ref, TextureUse use) -> std::int32_t {
    const std::vector<Vec2f>& uv = ref.texcoord == 0 ? mesh.uv0 : mesh.uv1;
    const ImageUse wanted{static_cast<std::uint32_t>(ref.image), is_srgb(use)};
    if (ref.texcoord > 1 || uv.empty() || !is_there(wanted.image)) return -1;
    const auto found = std::find(uses.begin(), uses.end(), wanted);
    const auto index = static_cast<std::int32_t>(found - uses.begin());
    if (found == uses.end()) uses.push_back(wanted);
    return index;
  };
  for (const Material& m : materials) out.materials.push_back(render_material(m, index_of));
  for (const ImageUse& use : uses) out.textures.push_back(make(use));
  return out;
}

using ByteCurve = std::array<float, 256>;

const ByteCurve& numbers_of_bytes() {
  static const ByteCurve table = [] {
    ByteCurve t{};
    for (std::size_t i = 0; i < t.size(); ++i) t[i] = static_cast<float>(i) / 255;
    return t;
  }();
  return table;
}

using Axis = TextureSite::Axis;
using Place = TextureSite::Place;

/// 0..1 inside the image, with mirrors and repetitions folded back.
float folded(float u, Wrap wrap) {
  constexpr float kMost = 1e6f;
  if (!(u >= -kMost && u <= kMost)) return 0;
  if (wrap == Wrap::kClamp) return saturated(u);
  if (wrap == Wrap::kRepeat) return u - static_cast<float>(floor_of(u));
  const float t = u - 2 * static_cast<float>(floor_of(u * 0.5f));
  return t > 1 ? 2 - t : t;
}

/// `u` is folded.
Axis bilinear_axis(float u, std::uint32_t size, Wrap wrap) {
  const auto n = static_cast<std::int32_t>(size);
  const float at = u * static_cast<float>(n) - 0.5f;
  Axis axis;
  axis.first = floor_of(at);
  axis.second = axis.first + 1;
  axis.part = at - static_cast<float>(axis.first);
  if (wrap == Wrap::kRepeat) {
    if (axis.first < 0) axis.first += n;
    if (axis.second >= n) axis.second -= n;
  }
  // A mirrored image meets its own last texel at the border, just as a clamped one.
  axis.first = std::clamp(axis.first, 0, n - 1);
  axis.second = std::clamp(axis.second, 0, n - 1);
  return axis;
}

/// `u` is folded.
std::int32_t nearest_texel(float u, std::uint32_t size) {
  const auto n = static_cast<std::int32_t>(size);
  return std::clamp(floor_of(u * static_cast<float>(n)), 0, n - 1);
}

template <std::size_t N>
Vec4f rgba(const float* v) {
  if constexpr (N == 1) return {v[0], v[0], v[0], 1};
  if constexpr (N == 2) return {v[0], v[0], v[0], v[1]};
  if constexpr (N == 3) return {v[0], v[1], v[2], 1};
  return {v[0], v[1], v[2], v[3]};
}

template <std::size_t N>
Vec4f bilinear(const Pixels& level, const ByteCurve& colour, const Place& place) {
  const ByteCurve& number = numbers_of_bytes();
  const Axis &x = place.x, &y = place.y;
  auto texel = [&](std::int32_t column, std::int32_t row) {
    return level.data.data() +
           (static_cast<std::size_t>(row) * level.width_px + static_cast<std::size_t>(column)) * N;
  };
  const std::uint8_t *a = texel(x.first, y.first), *b = texel(x.second, y.first),
                     *c = texel(x.first, y.second), *d = texel(x.second, y.second);
  const float wd = x.part * y.part, wb = x.part - wd, wc = y.part - wd, wa = 1 - x.part - wc;
  float value[N];
  for (std::size_t k = 0; k < N; ++k) {
    const ByteCurve& curve = (N == 2 || N == 4) && k + 1 == N ? number : colour;
    value[k] = (curve[a[k]] * wa + curve[b[k]] * wb) + (curve[c[k]] * wc + curve[d[k]] * wd);
  }
  return rgba<N>(value);
}

Vec4f read_bilinear(const Pixels& level, bool srgb, const Place& place) {
  const ByteCurve& colour = srgb ? light_of_bytes() : numbers_of_bytes();
  if (level.channels == 3) return bilinear<3>(level, colour, place);
  if (level.channels == 4) return bilinear<4>(level, colour, place);
  return level.channels == 1 ? bilinear<1>(level, colour, place) : bilinear<2>(level, colour, place);
}

float level_of(Vec2<std::uint32_t> size_px, const TextureFootprint& footprint) {
  const auto w = static_cast<float>(size_px.x), h = static_cast<float>(size_px.y);
  const Vec2f dx{footprint.uv_dx.x * w, footprint.uv_dx.y * h},
      dy{footprint.uv_dy.x * w, footprint.uv_dy.y * h};
  const float longer = std::max(dot(dx, dx), dot(dy, dy));
  // Not finite: the derivatives of a triangle seen edge-on. The smallest level shows its mean.
  if (!(longer < 1e30f)) return 100;
  return longer > 1e-30f ? 0.5f * log2_of(longer) : -100;
}

}  // namespace

Pixels coarser_level(Pixels image, bool srgb, std::uint32_t levels, const RunContext& context) {
  for (; levels > 0 && (image.width_px > 1 || image.height_px > 1); --levels)
    image = next_level(image, srgb, context);
  return image;
}

void complete_mips(RenderTexture& texture, const RunContext& context) {
  while (texture.levels.back().width_px > 1 || texture.levels.back().height_px > 1)
    texture.levels.push_back(next_level(texture.levels.back(), texture.srgb, context));
}

RenderTexture render_texture(Pixels image, bool srgb, std::uint32_t first_level, const RunContext& context) {
  if (image.width_px == 0 || image.height_px == 0 || image.channels < 1 || image.channels > 4 ||
      image.data.size() != static_cast<std::size_t>(image.width_px) * image.height_px * image.channels)
    throw std::invalid_argument("render_texture: no image of 1 to 4 channels");
  RenderTexture out;
  out.width_px = image.width_px;
  out.height_px = image.height_px;
  out.srgb = srgb;
  out.levels.push_back(std::move(image));
  while (out.first_level < first_level && (out.levels[0].width_px > 1 || out.levels[0].height_px > 1)) {
    out.levels[0] = next_level(out.levels[0], srgb, context);
    ++out.first_level;
  }
  complete_mips(out, context);
  return out;
}

TextureSite::TextureSite(Vec2<std::uint32_t> size_px, std::uint32_t first_level, const TextureSlot& slot,
                         const TextureFootprint& footprint)
    : uv_{folded(footprint.uv.x, slot.wrap_s), folded(footprint.uv.y, slot.wrap_t)},
      wrap_s_(slot.wrap_s),
      wrap_t_(slot.wrap_t) {
  const float level = level_of(size_px, footprint);
  nearest_ = level <= 0 ? slot.mag_filter == MagFilter::kNearest : slot.min_filter == MinFilter::kNearest;
  if (nearest_) return;
  const int last = std::bit_width(std::max(size_px.x, size_px.y)) - 1;
  level_ = static_cast<float>(first_level);
  if (slot.min_filter == MinFilter::kTrilinear)
    level_ = std::max(level_, std::min(level, static_cast<float>(last)));
  fine_ = static_cast<std::size_t>(level_);
  find_places(size_px);
}

/// place_in() of both levels at once: the same bits.
void TextureSite::find_places(Vec2<std::uint32_t> size_px) {
  using Quad = float __attribute__((vector_size(16)));
  using Whole = std::int32_t __attribute__((vector_size(16)));
  const auto side = [&](std::uint32_t px, std::size_t level) {
    return static_cast<std::int32_t>(std::max(px >> level, 1u));
  };
  const Whole n{side(size_px.x, fine_), side(size_px.y, fine_), side(size_px.x, fine_ + 1),
                side(size_px.y, fine_ + 1)};
  const auto repeats = [](Wrap wrap) { return wrap == Wrap::kRepeat ? -1 : 0; };
  const Whole wraps{repeats(wrap_s_), repeats(wrap_t_), repeats(wrap_s_), repeats(wrap_t_)};
  const Quad at = Quad{uv_.x, uv_.y, uv_.x, uv_.y} * __builtin_convertvector(n, Quad) - 0.5f;
  Whole first = __builtin_convertvector(at, Whole);
  first += at < __builtin_convertvector(first, Quad);  // true is -1
  const Quad part = at - __builtin_convertvector(first, Quad);
  Whole second = first + 1;
  first += n & (first < 0) & wraps;
  second -= n & (second >= n) & wraps;
  const Whole last = n - 1;
  for (Whole* texel : {&first, &second}) {
    *texel = *texel < 0 ? Whole{} : *texel;
    *texel = *texel > last ? last : *texel;
  }
  for (std::size_t k = 0; k < 2; ++k)
    places_[k] = {{first[2 * k], second[2 * k], part[2 * k]},
                  {first[2 * k + 1], second[2 * k + 1], part[2 * k + 1]}};
}

Place TextureSite::place_in(std::uint32_t width_px, std::uint32_t height_px) const {
  return {bilinear_axis(uv_.x, width_px, wrap_s_), bilinear_axis(uv_.y, height_px, wrap_t_)};
}

Vec4f TextureSite::read_level(const RenderTexture& texture, std::size_t level) const {
  const Pixels& texels = texture.levels[level - texture.first_level];
  const bool known = level == fine_ || level == fine_ + 1;
  return read_bilinear(texels, texture.srgb,
                       known ? places_[level - fine_] : place_in(texels.width_px, texels.height_px));
}

Vec4f TextureSite::read(const RenderTexture& texture) const {
  const Pixels& finest = texture.levels.front();
  if (nearest_) {
    const std::int32_t x = nearest_texel(uv_.x, finest.width_px), y = nearest_texel(uv_.y, finest.height_px);
    return read_bilinear(finest, texture.srgb, {{x, x, 0}, {y, y, 0}});
  }
  if (level_ <= static_cast<float>(texture.first_level)) return read_level(texture, texture.first_level);
  const float part = level_ - static_cast<float>(fine_);
  const Vec4f a = read_level(texture, fine_);
  if (part == 0) return a;
  const Vec4f b = read_level(texture, fine_ + 1);
  return {a.x + (b.x - a.x) * part, a.y + (b.y - a.y) * part, a.z + (b.z - a.z) * part,
          a.w + (b.w - a.w) * part};
}

void TextureSite::prefetch(const RenderTexture& texture) const {
  if (nearest_ || fine_ < texture.first_level) return;
  const std::size_t at = fine_ - texture.first_level;
  for (std::size_t k = 0; k < 2 && at + k < texture.levels.size(); ++k) {
    const Pixels& level = texture.levels[at + k];
    for (const std::int32_t row : {places_[k].y.first, places_[k].y.second})
      __builtin_prefetch(
          level.at(static_cast<std::uint32_t>(places_[k].x.first), static_cast<std::uint32_t>(row)));
  }
}

UvMatrix uv_matrix(const UvTransform& t) {
  if (t.is_identity()) return {};
  const auto c = static_cast<float>(portable::cos(t.rotation)),
             s = static_cast<float>(portable::sin(t.rotation));
  return {c * t.scale.x, s * t.scale.y, t.offset.x, -s * t.scale.x, c * t.scale.y, t.offset.y};
}

ShownMaterials shown_materials(const std::vector<Material>& materials, const Fragments& fragments,
                               const std::vector<Pixels>& pixels, const Mesh& mesh,
                               std::uint32_t least_side_px, const RunContext& context) {
  if (pixels.size() != fragments.planes.size())
    throw StageError("render", "planes of pixels", std::to_string(fragments.planes.size()),
                     std::to_string(pixels.size()));
  return shown_with(
      materials, mesh, [&](std::uint32_t image) { return plane_of(fragments, image, false, 0).has_value(); },
      [&](const ImageUse& use) { return texture_of(fragments, pixels, use, least_side_px, context); });
}

ShownMaterials shown_materials(const std::vector<Material>& materials, const std::vector<Image>& images,
                               const Mesh& mesh, std::uint32_t least_side_px, const RunContext& context) {
  return shown_with(
      materials, mesh, [&](std::uint32_t image) { return image < images.size(); },
      [&](const ImageUse& use) {
        const Image& image = images[use.image];
        std::uint32_t level = 0;
        while (std::max(image.width_px, image.height_px) >> (level + 1) >= least_side_px) ++level;
        return render_texture(decode_image(image, use.srgb ? FloatEncoding::kSrgb : FloatEncoding::kAsIs),
                              use.srgb, level, context);
      });
}

}  // namespace texmesh
