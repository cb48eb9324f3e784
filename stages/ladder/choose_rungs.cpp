// Losses of all rungs are measured in a few windows of each plane. Then rung_value.h tells which are worth
// their bytes.
#include "stages/ladder/choose_rungs.h"

#include <bit>
#include <map>

#include "stages/base/parallel.h"
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/image/jpeg_segments.h"
#include "stages/ladder/encode_rungs.h"
#include "stages/measure/fragment_meter.h"

namespace texmesh {
namespace {

constexpr std::size_t kWindows = 6;
constexpr std::uint32_t kWindowPx = 128;
// Coarser mips show a window interpolated. A window so far from the border of its fragment shows one of a
// mip's fragments, which covers four of the source's: fewer to encode and to decode.
constexpr std::uint32_t kInsetPx = 16;
// Where chroma is halved, the luma's loss counts twice, but at most this much more: lit pictures show coarse
// chroma. Of a yurt, 655 kB of full size lose .021 of luma and .017 of FLIP; 665 kB of mip 1 .029 and .011.
constexpr double kHalvedChroma = 0.02;

/// A rectangle of the plane's padded pixels, within one fragment.
struct Window {
  std::size_t fragment = 0;
  TexelRectangle rectangle;
  std::uint64_t covered = 0;
};

std::uint64_t covered_texels(const TexturePlane& plane, const TexelRectangle& part) {
  const CoverageMask mask(plane);
  const std::uint32_t right = std::min(part.right_px(), plane.width_px);
  std::uint64_t count = 0;
  for (std::uint32_t v = part.top_px; v < std::min(part.bottom_px(), plane.height_px); ++v)
    for (std::uint32_t u = part.left_px; u < right;) {
      const bool eight = u % 8 == 0 && u + 8 <= right;
      count += eight ? static_cast<std::uint64_t>(std::popcount(mask.byte_at(u, v))) : mask.covered(u, v);
      u += eight ? 8 : 1;
    }
  return count;
}

/// Of the fragment's middle and corners, `inset` from its border, the one with most covered texels.
Window window_in(const TexturePlane& plane, std::size_t fragment, std::uint32_t inset) {
  if (std::min(plane.fragment_width_px, plane.fragment_height_px) < 4 * inset) inset = 0;
  const TexelRectangle whole = padded_fragment_rectangle(plane, fragment);
  const std::uint32_t width = whole.width_px - 2 * inset, w = std::min(kWindowPx, width);
  const std::uint32_t height = whole.height_px - 2 * inset, h = std::min(kWindowPx, height);
  const std::uint32_t right = width - w, low = height - h;
  Window best;
  for (const auto& [x, y] : {std::pair{right / 2, low / 2}, std::pair{0u, 0u}, std::pair{right, 0u},
                             std::pair{0u, low}, std::pair{right, low}}) {
    Window window{fragment, {whole.left_px + inset + x, whole.top_px + inset + y, w, h}, 0};
    window.covered = covered_texels(plane, window.rectangle);
    if (best.rectangle.width_px == 0 || window.covered > best.covered) best = window;
  }
  return best;
}

/// In covered fragments evenly spread in index order.
std::vector<Window> sample_windows(const TexturePlane& plane) {
  const std::vector<std::size_t> covered = covered_fragments(plane);
  const std::size_t count = std::min(kWindows, covered.size());
  std::vector<Window> out;
  for (std::size_t k = 0; k < count; ++k) {
    const Window w = window_in(plane, covered[(2 * k + 1) * covered.size() / (2 * count)], kInsetPx);
    if (w.covered > 0) out.push_back(w);
  }
  return out;
}

/// What of a coarser level a window shows.
struct Support {
  std::vector<BilinearPlace> across, down;
  Support(const TexturePlane& full, const TexturePlane& level, const TexelRectangle& window)
      : across(bilinear_places(window.left_px, window.width_px, full.width_px, level.width_px)),
        down(bilinear_places(window.top_px, window.height_px, full.height_px, level.height_px)) {}
  TexelRectangle rectangle() const {
    const std::uint32_t left = across.front().first, top = down.front().first;
    return {left, top, across.back().second - left + 1, down.back().second - top + 1};
  }
};

/// Calls visit(fragment) for every fragment of the plane that the rectangle touches.
void for_each_fragment(const TexturePlane& plane, const TexelRectangle& rectangle, const auto& visit) {
  const std::uint32_t w = plane.fragment_width_px, h = plane.fragment_height_px;
  for (std::uint32_t row = rectangle.top_px / h; row <= (rectangle.bottom_px() - 1) / h; ++row)
    for (std::uint32_t column = rectangle.left_px / w; column <= (rectangle.right_px() - 1) / w; ++column)
      visit(std::size_t{row} * plane.columns + column);
}

/// What one rung of a plane shows. Fragments are decoded once, however many windows show them.
class ShownRung {
 public:
  ShownRung(const TexturePlane& plane, const Pixels& pixels, const PlaneLadder& ladder, std::size_t rung)
      : plane_(plane), pixels_(pixels), ladder_(ladder), rung_(rung) {}

  /// The window of `wanted`, the same or a finer level, scaled up.
  Samples window(const TexturePlane& wanted, const TexelRectangle& window) {
    if (&wanted == &plane_) return patch(window).samples;
    const Support support(wanted, plane_, window);
    return scaled_up(patch(support.rectangle()), support.across, support.down);
  }

 private:
  /// As the source shows it where no fragment is stored.
  SamplePatch patch(const TexelRectangle& rectangle) {
    SamplePatch patch{rectangle, rectangle_samples(plane_, pixels_, rectangle)};
    for_each_fragment(plane_, rectangle, [&](std::size_t f) {
      if (fragment_stream(ladder_.rungs[rung_], f).empty()) return;
      const TexelRectangle whole = padded_fragment_rectangle(plane_, f);
      const Samples& decoded = fragment(f, whole);
      const std::uint32_t left = std::max(rectangle.left_px, whole.left_px);
      const std::uint32_t right = std::min(rectangle.right_px(), whole.right_px());
      const std::uint32_t bottom = std::min(rectangle.bottom_px(), whole.bottom_px());
      for (std::size_t c = 0; c < decoded.size(); ++c)
        for (std::uint32_t y = std::max(rectangle.top_px, whole.top_px); y < bottom; ++y)
          std::copy_n(
              decoded[c].data() + std::size_t{y - whole.top_px} * whole.width_px + (left - whole.left_px),
              right - left,
              patch.samples[c].data() + std::size_t{y - rectangle.top_px} * rectangle.width_px +
                  (left - rectangle.left_px));
    });
    return patch;
  }
  const Samples& fragment(std::size_t f, const TexelRectangle& whole) {
    const auto [it, fresh] = decoded_.try_emplace(f);
    if (fresh)
      it->second = decode_samples(ladder_, rung_, f, std::uint64_t{whole.width_px} * whole.height_px,
                                  measured_channels(plane_));
    return it->second;
  }

  const TexturePlane& plane_;
  const Pixels& pixels_;
  const PlaneLadder& ladder_;
  std::size_t rung_;
  std::map<std::size_t, Samples> decoded_;
};

/// Marks the fragments of the same or a coarser level that the windows show.
void mark_shown(const TexturePlane& wanted, const TexturePlane& level, const std::vector<Window>& windows,
                std::vector<std::uint8_t>& marks) {
  for (const Window& window : windows)
    for_each_fragment(level, Support(wanted, level, window.rectangle).rectangle(),
                      [&](std::size_t f) { marks[f] = 1; });
}

/// The plane's covered texels over those of the fragments that the ladder holds.
double times_held(const TexturePlane& plane, const PlaneLadder& ladder) {
  double all = 0, held = 0;
  for (std::size_t f = 0; f < plane.fragment_count(); ++f) {
    all += plane.covered_texels[f];
    if (!fragment_stream(ladder.rungs[0], f).empty()) held += plane.covered_texels[f];
  }
  return held > 0 ? all / held : 1;
}

/// Bytes to show the whole plane, by rung.
std::vector<std::uint64_t> bytes_by_rung(const TexturePlane& plane, const PlaneLadder& ladder) {
  const double times = times_held(plane, ladder);
  std::vector<std::uint64_t> out;
  for (const LadderRung& rung : ladder.rungs) {
    std::uint64_t bytes = static_cast<std::uint64_t>(static_cast<double>(rung.data.size()) * times);
    bytes += rung.table_stream.size();
    if (codec_traits(ladder.codec).incremental && !out.empty()) bytes += out.back();
    out.push_back(bytes);
  }
  return out;
}

/// A level where it is wanted, and 1 - SSIM of what is shown of it.
class WantedLevel {
 public:
  WantedLevel(const TexturePlane& plane, const Pixels& pixels, const RunContext& context)
      : plane_(plane), windows_(sample_windows(plane)), meters_(windows_.size()) {
    parallel_each(context, windows_.size(), 1, [&](std::size_t w) {
      const TexelRectangle& window = windows_[w].rectangle;
      meters_[w].emplace(rectangle_samples(plane, pixels, window), coverage_samples(plane, window),
                         window.width_px, window.height_px);
    });
  }
  /// The mean over the windows, each of which weighs as much as its fragment's surface; 0 where nothing is
  /// covered. shown(window) gives the samples of a window.
  double loss(const auto& shown) const {
    double sum = 0, whole = 0;
    for (std::size_t w = 0; w < windows_.size(); ++w) {
      const double weight =
          std::max(static_cast<double>(plane_.surface_fraction[windows_[w].fragment]), 1e-9);
      whole += weight;
      sum += weight * std::max(meters_[w]->against(shown(windows_[w].rectangle)).dssim, 0.0);
    }
    return sum / std::max(whole, 1e-9);
  }
  double loss_of(ShownRung& rung) const {
    return loss([&](const TexelRectangle& window) { return rung.window(plane_, window); });
  }
  double loss_of(const SamplePatch& preview) const {
    return loss([&](const TexelRectangle& window) { return show_preview(plane_, preview, window); });
  }

 private:
  const TexturePlane& plane_;
  std::vector<Window> windows_;
  std::vector<std::optional<FragmentMeter>> meters_;
};

/// Whether the fragments of a JPEG rung have fewer samples of chroma than of luma.
bool has_halved_chroma(const LadderRung& rung) {
  bool halved = false;
  for_each_jpeg_segment(rung.table_stream, [&](std::uint8_t marker, ByteSpan body) {
    if (is_jpeg_frame(marker) && body.size() > 10 && body[5] == 3) halved = body[7] != body[10];
  });
  return halved;
}

/// TextureRungs::surface and texels_across.
void measure_size(const TexturePlane& full, TextureRungs& out) {
  // Surface of a ball over its height squared. What an object really has is not known here, and a factor of
  // two moves the level of a display by half a step.
  constexpr double kBallSurface = 3.14159265358979323846;
  double texels = 0;
  for (std::size_t f = 0; f < full.fragment_count(); ++f) {
    texels += full.covered_texels[f];
    out.surface += static_cast<double>(full.surface_fraction[f]);
  }
  if (out.surface > 0) out.texels_across = std::sqrt(texels / (out.surface * kBallSurface));
}

// A rung with a tenth of a texture's bytes must lower the loss of loads by so many tenths of this part.
constexpr double kGain = 0.05;
constexpr double kLeastLoads = 0.01;
// Of a JPEG's bytes.
constexpr double kMostOfJpeg = 1.9;
// Of the bytes of a source without loss, for its finest rung to stay whatever it is worth.
constexpr double kMostOfLossless = 1.25;

/// Indices of the rungs that `keep` marks, with those that they lean on.
std::vector<std::size_t> kept_indices(std::vector<std::uint8_t> keep, bool incremental) {
  if (incremental)
    for (std::size_t r = keep.size() - 1; r-- > 0;) keep[r] |= keep[r + 1];
  std::vector<std::size_t> out;
  for (std::size_t r = 0; r < keep.size(); ++r)
    if (keep[r]) out.push_back(r);
  return out;
}

/// Fixes the rung that stands for a source without loss. The others are judged as if it were not there: it
/// has two to three times the bytes of the next one, beside which too many of the others would seem cheap.
void fix_finest(const TexturePlane& base, const PlaneLadder& ladder, const std::vector<Image>& images,
                TextureRungs& texture) {
  if (images.empty() || !is_lossless(images[base.image])) return;
  const double most = kMostOfLossless * static_cast<double>(images[base.image].bytes.size());
  for (RungPair& pair : texture.pairs) {
    const bool finest = pair.level == 0 && ladder.rungs[pair.rung].quality == kFinestQuality;
    if (finest && static_cast<double>(pair.bytes) <= most)
      pair.fixed = true;
    else
      texture.whole_bytes = std::max(texture.whole_bytes, pair.bytes);
  }
}

}  // namespace

std::vector<std::size_t> chain_of(const Fragments& fragments, std::size_t base) {
  std::vector<std::size_t> chain{base};
  for (std::size_t p = 0; p < fragments.planes.size(); ++p)
    if (fragments.planes[p].mip > 0 && fragments.planes[p].base == base) chain.push_back(p);
  return chain;
}

std::vector<std::vector<std::uint8_t>> choice_sample(const Fragments& fragments) {
  std::vector<std::vector<std::uint8_t>> out;
  for (const TexturePlane& plane : fragments.planes) out.emplace_back(plane.fragment_count());
  for (std::size_t base = 0; base < fragments.planes.size() && fragments.planes[base].mip == 0; ++base) {
    const std::vector<std::size_t> chain = chain_of(fragments, base);
    for (std::size_t wanted = 0; wanted < chain.size(); ++wanted) {
      const std::vector<Window> windows = sample_windows(fragments.planes[chain[wanted]]);
      for (std::size_t level = wanted; level < chain.size(); ++level)
        mark_shown(fragments.planes[chain[wanted]], fragments.planes[chain[level]], windows,
                   out[chain[level]]);
    }
  }
  for (std::size_t p = 0; p < out.size(); ++p) {
    std::uint64_t covered = 0;
    for (std::size_t f = 0; f < out[p].size(); ++f)
      covered += out[p][f] ? fragments.planes[p].covered_texels[f] : 0;
    if (covered == 0) out[p].assign(out[p].size(), 1);
  }
  return out;
}

TextureRungs measure_rungs(const Fragments& fragments, const std::vector<Pixels>& pixels,
                           const std::vector<PlaneLadder>& planes, std::size_t base,
                           const std::vector<std::uint8_t>& preview_file, const RunContext& context) {
  const std::vector<std::size_t> chain = chain_of(fragments, base);
  TextureRungs out;
  out.closes_gaps = is_colour(fragments.planes[base].role);
  measure_size(fragments.planes[base], out);
  for (std::size_t level = 0; level < chain.size(); ++level) {
    const PlaneLadder& ladder = planes[chain[level]];
    const std::vector<std::uint64_t> bytes = bytes_by_rung(fragments.planes[chain[level]], ladder);
    for (std::size_t r = 0; r < bytes.size(); ++r)
      out.pairs.push_back({level, r, bytes[r], {}, ladder.source_rung && r + 1 == bytes.size()});
  }
  std::vector<WantedLevel> levels;
  for (const std::size_t p : chain) levels.emplace_back(fragments.planes[p], pixels[p], context);
  const SamplePatch preview = preview_samples(fragments.planes[base], preview_file);
  for (const WantedLevel& level : levels) out.preview_loss.push_back(level.loss_of(preview));
  parallel_each(context, out.pairs.size(), 1, [&](std::size_t k) {
    RungPair& pair = out.pairs[k];
    const std::size_t p = chain[pair.level];
    const bool halved = out.closes_gaps && !pair.fixed && has_halved_chroma(planes[p].rungs[pair.rung]);
    ShownRung shown(fragments.planes[p], pixels[p], planes[p], pair.rung);
    for (std::size_t wanted = 0; wanted <= pair.level; ++wanted) {
      const double loss = levels[wanted].loss_of(shown);
      pair.loss.push_back(loss + (halved ? std::min(loss, kHalvedChroma) : 0));
    }
  });
  return out;
}

bool is_lossless(const Image& image) {
  return image.format != ImageFormat::kJpeg && image.format != ImageFormat::kWebp;
}

double most_bytes(const TexturePlane& base, const std::vector<Image>& images) {
  if (images.empty() || images[base.image].format != ImageFormat::kJpeg)
    return std::numeric_limits<double>::infinity();
  return kMostOfJpeg * static_cast<double>(images[base.image].bytes.size());
}

std::vector<std::vector<std::size_t>> choose_rungs(const Fragments& fragments,
                                                   const std::vector<Pixels>& pixels,
                                                   const std::vector<PlaneLadder>& sample,
                                                   const Previews& previews, const std::vector<Image>& images,
                                                   const RunContext& context) {
  RunContext quiet = context;
  quiet.progress = nullptr;
  std::vector<TextureRungs> textures;
  for (std::size_t base = 0; base < fragments.planes.size() && fragments.planes[base].mip == 0; ++base) {
    textures.push_back(measure_rungs(fragments, pixels, sample, base, previews.planes[base].file, quiet));
    textures.back().most_bytes = most_bytes(fragments.planes[base], images);
    fix_finest(fragments.planes[base], sample[base], images, textures.back());
  }
  const auto keep = pairs_worth_storing(textures, texture_loads(), kGain, kLeastLoads);
  std::vector<std::vector<std::size_t>> kept(sample.size());
  for (std::size_t base = 0; base < textures.size(); ++base) {
    auto first = keep[base].begin();
    for (const std::size_t p : chain_of(fragments, base)) {
      const auto last = first + static_cast<std::ptrdiff_t>(sample[p].rungs.size());
      kept[p] = kept_indices({first, last}, codec_traits(sample[p].codec).incremental);
      first = last;
    }
  }
  return kept;
}

}  // namespace texmesh
