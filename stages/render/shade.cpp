#include "stages/render/shade.h"

#include "stages/base/parallel.h"
#include "stages/render/fragment_shader.h"

namespace texmesh {
namespace {

/// Triangles of an opaque pixel that are shaded: as many as a graphics processor with four samples a pixel
/// shades at most. In pictures of at most kSmallSidePx all of them are: with a dozen a pixel four are noise,
/// and no scale of a turtle was like S_0 below 100 px.
constexpr std::size_t kMostShaded = 4;
constexpr std::uint32_t kSmallSidePx = 200;
constexpr std::size_t kSamples = std::size_t{kSamplesPerSide} * kSamplesPerSide;
using Curve = SampledCurve<8192>;

template <double (*kFunction)(double)>
Vec3f curved(Vec3f c) {
  static const Curve curve(kFunction);
  return {curve(c.x), curve(c.y), curve(c.z)};
}
Vec3f encoded(Vec3f light) { return curved<srgb_of_light>(light); }
Vec3f decoded(Vec3f code) { return curved<light_of_srgb>(code); }

float share_of(const RenderFragment& fragment) {
  return static_cast<float>(sample_count(fragment.mask)) / static_cast<float>(kSamples);
}

/// The samples of one pixel, filled from the nearest fragment to the farthest.
class Samples {
 public:
  /// `mixes`: something lets light through, so colours are mixed as they are encoded.
  explicit Samples(bool mixes) : mixes_(mixes) { left_.fill(1); }

  void put_behind(unsigned mask, Vec3f linear, float alpha) {
    const Vec3f colour = mixes_ ? encoded(linear) : linear;
    for (std::size_t s = 0; s < kSamples; ++s) {
      if ((mask >> s & 1) == 0) continue;
      colour_[s] = colour_[s] + colour * (alpha * left_[s]);
      left_[s] *= 1 - alpha;
    }
  }
  Vec3f mean() const {
    Vec3f sum;
    for (const Vec3f c : colour_) sum = sum + (mixes_ ? decoded(c) : c);
    return sum * (1 / static_cast<float>(kSamples));
  }

 private:
  bool mixes_;
  std::array<Vec3f, kSamples> colour_{};
  std::array<float, kSamples> left_{};  // of the light from behind
};

/// Pixels with their fragments, in all variants. Those that were added are shaded together.
class PixelShader {
 public:
  PixelShader(const FragmentShader& shader, PictureVariants& pictures, Vec3f background, bool all_shaded)
      : shader_(shader), pictures_(pictures), background_(background), all_shaded_(all_shaded) {}

  /// `at` indexes the pictures' places.
  void add(std::size_t at, std::span<const RenderFragment> fragments) {
    constexpr std::size_t kTogether = 128;
    const bool layers = fragments.front().layer != 0;
    float covered = 0;
    for (const RenderFragment& f : fragments) covered += share_of(f);
    if (!layers && !all_shaded_) fragments = most_seen(fragments);
    pixels_.push_back({at, fragments_.size(), fragments.size(), layers, covered});
    for (const RenderFragment& f : fragments) fragments_.push_back({pictures_.places()[at], f});
    if (fragments_.size() >= kTogether) finish();
  }

  void finish() {
    const std::size_t variants = pictures_.count();
    if (fragments_.empty() || variants == 0) return;
    colours_.resize(fragments_.size() * variants);
    shader_.colours_of(fragments_, scratch_, colours_);
    for (const Pixel& pixel : pixels_)
      for (std::size_t v = 0; v < variants; ++v) {
        if (pixel.layers)
          put_layers(pixel, v);
        else
          put_opaque(pixel, v);
      }
    pixels_.clear(), fragments_.clear();
  }

 private:
  struct Pixel {
    std::size_t at, first, count;  // of fragments_
    bool layers;                   // something lets what lies behind show
    float covered;                 // of its samples
  };
  const FragmentColour& colour(std::size_t fragment, std::size_t variant) const {
    return colours_[fragment * pictures_.count() + variant];
  }

  /// The kMostShaded fragments with most samples, of equal ones the first; their order stays.
  std::span<const RenderFragment> most_seen(std::span<const RenderFragment> fragments) {
    if (fragments.size() <= kMostShaded) return fragments;
    std::array<std::size_t, kSamples> order;
    for (std::size_t i = 0; i < fragments.size(); ++i) {
      std::size_t to = i;
      const int samples = sample_count(fragments[i].mask);
      for (; to > 0 && sample_count(fragments[order[to - 1]].mask) < samples; --to) order[to] = order[to - 1];
      order[to] = i;
    }
    std::sort(order.begin(), order.begin() + kMostShaded);
    for (std::size_t i = 0; i < kMostShaded; ++i) most_seen_[i] = fragments[order[i]];
    return most_seen_;
  }

  /// Nothing can be seen through what the pixel shows.
  void put_opaque(const Pixel& pixel, std::size_t variant) {
    Vec3f sum;
    float shaded = 0;
    for (std::size_t i = pixel.first; i < pixel.first + pixel.count; ++i) {
      const float share = share_of(fragments_[i].fragment);
      sum = sum + colour(i, variant).linear * share;
      shaded += share;
    }
    if (shaded < pixel.covered) sum = sum * (pixel.covered / shaded);
    pictures_.set(variant, pixel.at, sum + background_ * (1 - pixel.covered), true);
  }

  void put_layers(const Pixel& pixel, std::size_t variant) {
    bool mixes = false, covered = false;
    for (std::size_t i = pixel.first; i < pixel.first + pixel.count; ++i) {
      const float alpha = colour(i, variant).alpha;
      mixes = mixes || (alpha > 0 && alpha < 1);
      covered = covered || alpha > 0;
    }
    Samples samples(mixes);
    for (std::size_t i = pixel.first; i < pixel.first + pixel.count; ++i) {
      const FragmentColour& c = colour(i, variant);
      if (c.alpha > 0) samples.put_behind(fragments_[i].fragment.mask, c.linear, c.alpha);
    }
    samples.put_behind((1u << kSamples) - 1, background_, 1);
    pictures_.set(variant, pixel.at, samples.mean(), covered);
  }

  const FragmentShader& shader_;
  PictureVariants& pictures_;
  Vec3f background_;
  bool all_shaded_;
  FragmentShader::Scratch scratch_;
  std::vector<Pixel> pixels_;
  std::vector<FragmentInPixel> fragments_;
  std::vector<FragmentColour> colours_;  // [fragment][variant]
  std::array<RenderFragment, kMostShaded> most_seen_;
};

/// Indices into places by squares of the picture: what a square reads of many textures stays in the cache
/// while a row of the picture would have pushed it out.
std::vector<std::uint32_t> by_squares(const std::vector<std::uint32_t>& places, std::uint32_t side_px) {
  constexpr std::uint32_t kSquarePx = 16;
  const std::uint32_t across = (side_px + kSquarePx - 1) / kSquarePx;
  std::vector<std::uint32_t> out(places.size()), next(across + 1);
  const auto column = [&](std::size_t i) { return places[i] % side_px / kSquarePx; };
  for (std::size_t begin = 0, end = 0; begin < places.size(); begin = end) {
    const std::uint32_t row = places[begin] / side_px / kSquarePx;
    std::ranges::fill(next, 0u);
    for (; end < places.size() && places[end] / side_px / kSquarePx == row; ++end) ++next[column(end) + 1];
    for (std::uint32_t c = 0; c < across; ++c) next[c + 1] += next[c];
    for (std::size_t i = begin; i < end; ++i) out[begin + next[column(i)]++] = static_cast<std::uint32_t>(i);
  }
  return out;
}

}  // namespace

PictureVariants::PictureVariants(const Visibility& visibility, std::size_t count, Vec3f background)
    : side_px_(visibility.side_px), background_(background) {
  if (count == 0) return;
  const std::vector<std::uint32_t>& first = visibility.first;
  std::size_t shown = 0;
  for (std::size_t i = 0; i + 1 < first.size(); ++i) shown += first[i] < first[i + 1];
  places_.reserve(shown);
  for (std::size_t i = 0; i + 1 < first.size(); ++i)
    if (first[i] < first[i + 1]) places_.push_back(static_cast<std::uint32_t>(i));
  shown_.assign(count, {std::vector<Vec3f>(shown), std::vector<std::uint8_t>(shown)});
}

Picture PictureVariants::picture(std::size_t variant) const {
  Picture out;
  put(variant, out);
  return out;
}

void PictureVariants::put(std::size_t variant, Picture& picture) const {
  const std::size_t pixels = static_cast<std::size_t>(side_px_) * side_px_;
  const Shown& shown = shown_.at(variant);
  if (picture.linear.empty())
    picture = {side_px_, std::vector<Vec3f>(pixels, background_), std::vector<std::uint8_t>(pixels)};
  for (std::size_t i = 0; i < places_.size(); ++i) {
    picture.linear[places_[i]] = shown.linear[i];
    picture.covered[places_[i]] = shown.covered[i];
  }
}

PixelSpans PictureVariants::spans() const {
  std::vector<PixelSpans::Row> rows(side_px_);
  // Filters take the corner for the background.
  const bool all = !places_.empty() && places_.front() == 0;
  if (all) rows.assign(side_px_, {0, side_px_, 0});
  for (std::size_t i = 0; i < places_.size() && !all; ++i) {
    PixelSpans::Row& row = rows[places_[i] / side_px_];
    const std::uint32_t x = places_[i] % side_px_;
    if (row.first == row.last) row.first = x;
    row.last = x + 1;
  }
  return spans_around(rows);
}

PictureVariants shade_variants(const RenderScene& scene, const Visibility& visibility,
                               std::span<const std::vector<RenderMaterial>* const> variants,
                               const std::vector<RenderTexture>& textures,
                               const RenderEnvironment& environment, const RunContext& context) {
  const FragmentShader shader(scene, visibility, variants, textures, environment);
  PictureVariants out(visibility, variants.size(), environment.background);
  const std::vector<std::uint32_t>& places = out.places();
  const std::vector<std::uint32_t> order = by_squares(places, visibility.side_px);
  parallel_for(context, order.size(), 256, [&](std::size_t begin, std::size_t end) {
    PixelShader pixel(shader, out, environment.background, visibility.side_px <= kSmallSidePx);
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t at = order[i], place = places[at], first = visibility.first[place];
      pixel.add(at, {visibility.fragments.data() + first, visibility.first[place + 1] - first});
    }
    pixel.finish();
  });
  return out;
}

Picture shade(const RenderScene& scene, const Visibility& visibility,
              const std::vector<RenderTexture>& textures, const RenderEnvironment& environment,
              const RunContext& context) {
  const std::vector<RenderMaterial>* const materials = scene.materials;
  return shade_variants(scene, visibility, {&materials, 1}, textures, environment, context).picture(0);
}

Vec3f tone_mapped(Vec3f linear) { return tone_mapped_of(linear); }

Pixels encode_srgb(const Picture& picture) {
  Pixels out{picture.side_px, picture.side_px, 3, {}};
  out.data.reserve(picture.linear.size() * 3);
  const auto& encode = srgb_encoder();
  for (const Vec3f c : picture.linear)
    for (int k = 0; k < 3; ++k) out.data.push_back(encode(c[k]));
  return out;
}

}  // namespace texmesh
