#include "stages/ladder/rung_hull.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "stages/base/parallel.h"
#include "stages/jpeg/jpeg.h"
#include "stages/measure/fragment_meter.h"

namespace texmesh {
namespace {

constexpr std::size_t kWindows = 6;
constexpr std::uint32_t kWindowPx = 128;
// Mips show their source's windows interpolated. So far from the border of a fragment that one of a mip's
// fragments, which covers four of the source's, is enough: fewer to encode and to decode.
constexpr std::uint32_t kInsetPx = 16;
// Where a mip is what the display shows, 1 - SSIM that its best rung must come down to. Scans of 2048 px:
// 0.02 is quality 86 to 93 and takes 12 % of the full size's bytes for all mips of a colour; 0.01 would take
// 20 %.
constexpr double kShownWell = 0.02, kDataShownWell = 0.03;
// Between the preview and that rung others are stored without which a client loses half more and over:
// factors of about two in bytes.
constexpr double kOwnGain = 0.5;
constexpr std::uint64_t kMostPreviewPixels = 1u << 26;

struct Window {
  std::size_t fragment = 0;
  std::uint32_t x = 0, y = 0, width = 0, height = 0;  // within the full-size plane's padded pixels
  std::uint64_t covered = 0;
};

std::vector<std::uint8_t> mask_of(const TexturePlane& plane, const Window& w) {
  const std::size_t stride = (std::size_t{plane.width_px} + 7) / 8;
  std::vector<std::uint8_t> out(std::size_t{w.width} * w.height);
  for (std::uint32_t v = 0; v < w.height && w.y + v < plane.height_px; ++v)
    for (std::uint32_t u = 0; u < w.width && w.x + u < plane.width_px; ++u)
      if (plane.coverage[(w.y + v) * stride + (w.x + u) / 8] >> (7 - (w.x + u) % 8) & 1)
        out[std::size_t{v} * w.width + u] = 255;
  return out;
}

/// Of the fragment's middle and corners, `inset` from its border, the one with most covered texels.
Window window_in(const TexturePlane& plane, std::size_t fragment, std::uint32_t inset) {
  if (std::min(plane.fragment_width_px, plane.fragment_height_px) < 4 * inset) inset = 0;
  const std::uint32_t width = plane.fragment_width_px - 2 * inset, w = std::min(kWindowPx, width);
  const std::uint32_t height = plane.fragment_height_px - 2 * inset, h = std::min(kWindowPx, height);
  const auto left = static_cast<std::uint32_t>(fragment % plane.columns) * plane.fragment_width_px + inset;
  const auto top = static_cast<std::uint32_t>(fragment / plane.columns) * plane.fragment_height_px + inset;
  const std::uint32_t right = width - w, low = height - h;
  Window best;
  for (const auto& [x, y] : {std::pair{right / 2, low / 2}, std::pair{0u, 0u}, std::pair{right, 0u},
                             std::pair{0u, low}, std::pair{right, low}}) {
    Window window{fragment, left + x, top + y, w, h, 0};
    const std::vector<std::uint8_t> mask = mask_of(plane, window);
    window.covered = static_cast<std::uint64_t>(std::count(mask.begin(), mask.end(), 255));
    if (best.width == 0 || window.covered > best.covered) best = window;
  }
  return best;
}

/// In every `sparseness`-th covered fragment, up to kWindows.
std::vector<Window> sample_windows(const TexturePlane& plane, std::size_t sparseness, std::uint32_t inset) {
  std::vector<std::size_t> covered;
  for (std::size_t f = 0; f < plane.covered_texels.size(); ++f)
    if (plane.covered_texels[f] > 0) covered.push_back(f);
  const std::size_t count = std::min(kWindows, (covered.size() + sparseness - 1) / sparseness);
  std::vector<Window> out;
  for (std::size_t k = 0; k < count; ++k) {
    const Window w = window_in(plane, covered[(2 * k + 1) * covered.size() / (2 * count)], inset);
    if (w.covered > 0) out.push_back(w);
  }
  return out;
}

/// Of a full-size plane, to be shown by its mips, and of a mip for itself.
std::vector<Window> chain_windows(const TexturePlane& full) { return sample_windows(full, 4, kInsetPx); }
std::vector<Window> own_windows(const TexturePlane& mip) { return sample_windows(mip, 1, 0); }

/// Where between two coarse texels a full-size one lies, in 1 / 256.
struct Place {
  std::uint32_t first, second, part;
};

Place place_of(std::uint32_t at, std::uint32_t size, std::uint32_t coarse) {
  const std::int64_t centre = (2 * std::int64_t{at} + 1) * coarse * 128 / size - 128;
  const auto clamped =
      static_cast<std::uint32_t>(std::clamp<std::int64_t>(centre, 0, (std::int64_t{coarse} - 1) * 256));
  return {clamped / 256, std::min(clamped / 256 + 1, coarse - 1), clamped % 256};
}

/// A rectangle of a plane as one rung shows it; as the source does where no fragment is stored.
struct Patch {
  std::uint32_t x, y, width, height;
  Samples samples;
};

Patch decode_patch(const TexturePlane& plane, const Pixels& pixels, const PlaneLadder& ladder,
                   std::size_t rung, Patch patch) {
  const std::size_t measured = measured_channels(plane);
  patch.samples.assign(measured, std::vector<std::uint8_t>(std::size_t{patch.width} * patch.height));
  const std::uint32_t w = plane.fragment_width_px, h = plane.fragment_height_px;
  for (std::uint32_t row = patch.y / h; row <= (patch.y + patch.height - 1) / h; ++row)
    for (std::uint32_t column = patch.x / w; column <= (patch.x + patch.width - 1) / w; ++column) {
      const std::size_t f = std::size_t{row} * plane.columns + column;
      const bool stored = !fragment_stream(ladder.rungs[rung], f).empty();
      const Samples decoded =
          stored ? decode_samples(ladder, rung, f, std::uint64_t{w} * h, measured) : Samples{};
      for (std::size_t c = 0; c < measured; ++c)
        for (std::uint32_t y = std::max(patch.y, row * h);
             y < std::min(patch.y + patch.height, (row + 1) * h); ++y)
          for (std::uint32_t x = std::max(patch.x, column * w);
               x < std::min(patch.x + patch.width, (column + 1) * w); ++x)
            patch.samples[c][std::size_t{y - patch.y} * patch.width + x - patch.x] =
                stored ? decoded[c][std::size_t{y - row * h} * w + x - column * w]
                       : measured_value(pixels.at(x, y), pixels.channels, measured, c);
    }
  return patch;
}

/// Of texels `first` and on of a side, where each lies between those of a coarser one.
std::vector<Place> places(std::uint32_t first, std::uint32_t count, std::uint32_t size,
                          std::uint32_t coarse) {
  std::vector<Place> out;
  for (std::uint32_t k = 0; k < count; ++k)
    out.push_back(place_of(std::min(first + k, size - 1), size, coarse));
  return out;
}

/// Bilinear, as clients scale up.
Samples scaled_up(const Patch& patch, const std::vector<Place>& across, const std::vector<Place>& down) {
  Samples out;
  for (const std::vector<std::uint8_t>& samples : patch.samples) {
    std::vector<std::uint8_t>& to = out.emplace_back();
    to.reserve(across.size() * down.size());
    for (const Place& v : down) {
      const std::uint8_t* a = samples.data() + std::size_t{v.first - patch.y} * patch.width;
      const std::uint8_t* b = samples.data() + std::size_t{v.second - patch.y} * patch.width;
      for (const Place& u : across) {
        const std::uint32_t l = u.first - patch.x, r = u.second - patch.x;
        const std::uint32_t upper = a[l] * (256 - u.part) + a[r] * u.part;
        const std::uint32_t lower = b[l] * (256 - u.part) + b[r] * u.part;
        to.push_back(static_cast<std::uint8_t>((upper * (256 - v.part) + lower * v.part + 32768) >> 16));
      }
    }
  }
  return out;
}

/// What of a level a window of the full size shows.
struct Support {
  std::vector<Place> across, down;
  Support(const TexturePlane& full, const TexturePlane& plane, const Window& window)
      : across(places(window.x, window.width, full.width_px, plane.width_px)),
        down(places(window.y, window.height, full.height_px, plane.height_px)) {}
  std::uint32_t left() const { return across.front().first; }
  std::uint32_t right() const { return across.back().second; }
  std::uint32_t top() const { return down.front().first; }
  std::uint32_t low() const { return down.back().second; }
};

/// The window as a level shows it, scaled up to the full size.
Samples show(const TexturePlane& full, const TexturePlane& plane, const Pixels& pixels,
             const PlaneLadder& ladder, std::size_t rung, const Window& window) {
  const Support s(full, plane, window);
  const Patch patch = decode_patch(plane, pixels, ladder, rung,
                                   {s.left(), s.top(), s.right() - s.left() + 1, s.low() - s.top() + 1, {}});
  return scaled_up(patch, s.across, s.down);
}

/// The mip's fragments that windows of a full-size plane, or its own, show.
void mark_shown(const TexturePlane& full, const TexturePlane& mip, const std::vector<Window>& windows,
                std::vector<std::uint8_t>& marks) {
  for (const Window& window : windows) {
    const Support s(full, mip, window);
    for (std::uint32_t row = s.top() / mip.fragment_height_px; row <= s.low() / mip.fragment_height_px; ++row)
      for (std::uint32_t column = s.left() / mip.fragment_width_px;
           column <= s.right() / mip.fragment_width_px; ++column)
        marks[std::size_t{row} * mip.columns + column] = 1;
  }
}

/// The window as the preview shows it.
Samples show_preview(const TexturePlane& plane, const Patch& preview, const Window& window) {
  return scaled_up(preview, places(window.x, window.width, plane.width_px, preview.width),
                   places(window.y, window.height, plane.height_px, preview.height));
}

Samples source_samples(const TexturePlane& plane, const Pixels& pixels, const Window& window) {
  const std::size_t measured = measured_channels(plane);
  Samples out(measured);
  for (std::size_t c = 0; c < measured; ++c)
    for (std::uint32_t y = 0; y < window.height; ++y)
      for (std::uint32_t x = 0; x < window.width; ++x)
        out[c].push_back(measured_value(pixels.at(window.x + x, window.y + y), pixels.channels, measured, c));
  return out;
}

/// The full-size plane `base` and its mips.
std::vector<std::size_t> chain_of(const Fragments& fragments, std::size_t base) {
  std::vector<std::size_t> chain{base};
  for (std::size_t p = 0; p < fragments.planes.size(); ++p)
    if (fragments.planes[p].mip > 0 && fragments.planes[p].base == base) chain.push_back(p);
  return chain;
}

/// Lower convex hull of (bytes, loss), where loss falls; indices by rising bytes.
std::vector<std::size_t> hull_of(const std::vector<RungPair>& pairs) {
  std::vector<std::size_t> order(pairs.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    if (pairs[a].bytes != pairs[b].bytes) return pairs[a].bytes < pairs[b].bytes;
    if (pairs[a].loss != pairs[b].loss) return pairs[a].loss < pairs[b].loss;
    return a < b;
  });
  const auto slope = [&](std::size_t a, std::size_t b) {
    return (pairs[b].loss - pairs[a].loss) / static_cast<double>(pairs[b].bytes - pairs[a].bytes);
  };
  std::vector<std::size_t> hull;
  for (const std::size_t k : order) {
    if (!hull.empty() && (pairs[k].loss >= pairs[hull.back()].loss)) continue;
    while (hull.size() > 1 && slope(hull[hull.size() - 2], hull.back()) >= slope(hull.back(), k))
      hull.pop_back();
    hull.push_back(k);
  }
  return hull;
}

double hull_loss(const std::vector<RungPair>& pairs, const std::vector<std::size_t>& hull,
                 std::uint64_t bytes) {
  for (std::size_t k = 1; k < hull.size(); ++k) {
    const RungPair &a = pairs[hull[k - 1]], &b = pairs[hull[k]];
    if (bytes > b.bytes) continue;
    if (bytes == b.bytes) return b.loss;  // what interpolation would miss by rounding
    return a.loss + (b.loss - a.loss) *
                        (static_cast<double>(bytes - a.bytes) / static_cast<double>(b.bytes - a.bytes));
  }
  return pairs[hull.back()].loss;
}

/// Returns the indices of those that are kept.
std::vector<std::size_t> keep_rungs(std::vector<std::uint8_t> of_rung, PlaneLadder& plane) {
  if (codec_traits(plane.codec).incremental)
    for (std::size_t r = of_rung.size() - 1; r-- > 0;) of_rung[r] |= of_rung[r + 1];
  std::vector<LadderRung> rungs;
  std::vector<std::size_t> kept;
  for (std::size_t r = 0; r < of_rung.size(); ++r)
    if (of_rung[r]) {
      rungs.push_back(std::move(plane.rungs[r]));
      kept.push_back(r);
    }
  plane.rungs = std::move(rungs);
  return kept;
}

/// Takes mips' vertices off the hull as long as it hardly rises without them.
void thin_hull(const std::vector<RungPair>& pairs, double gain, std::vector<std::size_t>& hull) {
  for (;;) {
    std::size_t least = 0;
    double least_rise = gain;
    for (std::size_t k = 1; k + 1 < hull.size(); ++k) {
      const RungPair& pair = pairs[hull[k]];
      if (pair.level == 0 || pair.loss <= 0) continue;
      const double rise = hull_loss(pairs, {hull[k - 1], hull[k + 1]}, pair.bytes) / pair.loss - 1;
      if (rise < least_rise || (rise == least_rise && least == 0)) least = k, least_rise = rise;
    }
    if (least == 0) return;
    hull.erase(hull.begin() + static_cast<std::ptrdiff_t>(least));
  }
}

/// The level's pair whose loss is the least multiple of the hull's.
std::size_t nearest_of_level(const std::vector<RungPair>& pairs, const std::vector<std::size_t>& hull,
                             std::size_t level) {
  std::size_t nearest = pairs.size();
  double least = 0;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    if (pairs[k].level != level) continue;
    const double best = hull_loss(pairs, hull, pairs[k].bytes);
    const double excess = pairs[k].loss <= best ? 1
                          : best > 0            ? pairs[k].loss / best
                                                : std::numeric_limits<double>::infinity();
    if (nearest == pairs.size() || excess < least) nearest = k, least = excess;
  }
  return nearest;
}

/// How many times the covered texels of the fragments that the ladder holds the plane has.
double times_held(const TexturePlane& plane, const PlaneLadder& ladder) {
  double all = 0, held = 0;
  for (std::size_t f = 0; f < plane.fragment_count(); ++f) {
    all += plane.covered_texels[f];
    if (!fragment_stream(ladder.rungs[0], f).empty()) held += plane.covered_texels[f];
  }
  return held > 0 ? all / held : 1;
}

/// The plane's rungs as pairs, losses 0.
void add_pairs(const TexturePlane& fragments, const PlaneLadder& plane, std::size_t level,
               std::vector<RungPair>& pairs) {
  const double times = times_held(fragments, plane);
  for (std::size_t r = 0; r < plane.rungs.size(); ++r) {
    std::uint64_t bytes =
        static_cast<std::uint64_t>(static_cast<double>(plane.rungs[r].data.size()) * times) +
        plane.rungs[r].tables.size();
    if (codec_traits(plane.codec).incremental && r > 0) bytes += pairs.back().bytes;
    pairs.push_back({level, r, bytes, 0});
  }
}

/// `loss` is by window, then pair; each window weighs as much as its fragment's surface.
void weigh_losses(const TexturePlane& plane, const std::vector<Window>& windows,
                  const std::vector<double>& loss, std::vector<RungPair>& pairs) {
  double whole = 0;
  for (std::size_t w = 0; w < windows.size(); ++w) {
    const double weight = std::max(static_cast<double>(plane.surface_fraction[windows[w].fragment]), 1e-9);
    whole += weight;
    for (std::size_t k = 0; k < pairs.size(); ++k) pairs[k].loss += weight * loss[w * pairs.size() + k];
  }
  for (RungPair& pair : pairs) pair.loss /= std::max(whole, 1e-9);
}

}  // namespace

std::vector<std::uint8_t> worth_storing(const std::vector<RungPair>& pairs, double gain) {
  std::vector<std::uint8_t> keep(pairs.size(), gain < 0);
  if (pairs.empty() || gain < 0) return keep;
  const std::vector<std::size_t> hull = hull_of(pairs);
  std::vector<std::size_t> thinned = hull;
  thin_hull(pairs, gain, thinned);
  for (const std::size_t k : thinned) keep[k] = 1;
  std::size_t levels = 0;
  for (const RungPair& pair : pairs) levels = std::max(levels, pair.level + 1);
  for (std::size_t level = 0; level < levels; ++level) {
    bool any = false;
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      if (pairs[k].level != level) continue;
      if (level == 0) keep[k] = 1;
      any = any || keep[k];
    }
    const std::size_t nearest = any ? pairs.size() : nearest_of_level(pairs, hull, level);
    if (nearest < pairs.size()) keep[nearest] = 1;
  }
  return keep;
}

std::vector<std::vector<std::uint8_t>> hull_sample(const Fragments& fragments) {
  std::vector<std::vector<std::uint8_t>> out;
  for (const TexturePlane& plane : fragments.planes) {
    std::vector<std::uint8_t>& marks = out.emplace_back(plane.fragment_count(), plane.mip == 0);
    if (plane.mip == 0) continue;
    const TexturePlane& full = fragments.planes[plane.base];
    mark_shown(full, plane, chain_windows(full), marks);
    mark_shown(plane, plane, own_windows(plane), marks);
    std::uint64_t covered = 0;
    for (std::size_t f = 0; f < marks.size(); ++f) covered += marks[f] ? plane.covered_texels[f] : 0;
    if (covered == 0) marks.assign(marks.size(), 1);
  }
  return out;
}

std::vector<RungPair> measure_pairs(const Fragments& fragments, const std::vector<Pixels>& pixels,
                                    const Ladder& ladder, std::size_t base, const RunContext& context) {
  const TexturePlane& full = fragments.planes[base];
  const std::vector<std::size_t> chain = chain_of(fragments, base);
  std::vector<RungPair> pairs;
  for (std::size_t level = 0; level < chain.size(); ++level)
    add_pairs(fragments.planes[chain[level]], ladder.planes[chain[level]], level, pairs);
  const std::vector<Window> windows = chain_windows(full);
  std::vector<double> loss(windows.size() * pairs.size());
  parallel_for(context, windows.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t w = begin; w < end; ++w) {
      const Window& window = windows[w];
      const FragmentMeter meter(source_samples(full, pixels[base], window), mask_of(full, window),
                                window.width, window.height);
      for (std::size_t k = 0; k < pairs.size(); ++k) {
        const std::size_t p = chain[pairs[k].level];
        const auto shown =
            show(full, fragments.planes[p], pixels[p], ladder.planes[p], pairs[k].rung, window);
        loss[w * pairs.size() + k] = std::max(meter.against(shown).dssim, 0.0);
      }
    }
  });
  weigh_losses(full, windows, loss, pairs);
  return pairs;
}

void keep_for_display(const std::vector<RungPair>& own, double shown_well, double gain,
                      std::vector<std::uint8_t>& keep) {
  if (own.size() < 2) return;
  std::size_t top = 1;
  while (top + 1 < own.size() && own[top].loss > shown_well) ++top;
  for (std::size_t k = 1; k < own.size(); ++k)
    if (own[k].loss >= own[0].loss && k != top) keep[k - 1] = 0;
  std::vector<RungPair> pairs(own.begin(), own.begin() + static_cast<std::ptrdiff_t>(top) + 1);
  for (std::size_t k = 0; k <= top; ++k)
    pairs[k].level = k == 0 || keep[k - 1] ? 0 : 1;  // those of level 0 are not thinned away
  std::vector<std::size_t> hull = hull_of(pairs);
  thin_hull(pairs, gain, hull);
  for (const std::size_t k : hull)
    if (k > 0) keep[k - 1] = 1;
  keep[top - 1] = 1;
}

std::vector<RungPair> measure_own(const TexturePlane& plane, const Pixels& pixels, const PlaneLadder& ladder,
                                  const std::vector<std::uint8_t>& preview_file, const RunContext& context) {
  const std::vector<Window> windows = own_windows(plane);
  if (windows.empty()) return {};
  const std::size_t measured = measured_channels(plane);
  const Pixels file = measured > 1 ? decode_jpeg(preview_file, kMostPreviewPixels)
                                   : decode_jpeg_luma(preview_file, kMostPreviewPixels);
  const Patch preview{0, 0, file.width_px, file.height_px, split_samples(file, measured)};
  std::vector<RungPair> pairs{{0, 0, 0, 0}};
  add_pairs(plane, ladder, 1, pairs);
  std::vector<double> loss(windows.size() * pairs.size());
  parallel_for(context, windows.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t w = begin; w < end; ++w) {
      const Window& window = windows[w];
      const FragmentMeter meter(source_samples(plane, pixels, window), mask_of(plane, window), window.width,
                                window.height);
      for (std::size_t k = 0; k < pairs.size(); ++k) {
        const auto shown = k == 0 ? show_preview(plane, preview, window)
                                  : show(plane, plane, pixels, ladder, pairs[k].rung, window);
        loss[w * pairs.size() + k] = std::max(meter.against(shown).dssim, 0.0);
      }
    }
  });
  weigh_losses(plane, windows, loss, pairs);
  return pairs;
}

std::vector<std::vector<std::size_t>> drop_rungs_off_hull(const Fragments& fragments,
                                                          const std::vector<Pixels>& pixels,
                                                          const Previews& previews, double gain,
                                                          Ladder& ladder, const RunContext& context) {
  RunContext inner = context;
  inner.progress = nullptr;
  std::vector<std::vector<std::size_t>> kept(ladder.planes.size());
  for (std::size_t p = 0; p < kept.size(); ++p) {
    kept[p].resize(ladder.planes[p].rungs.size());
    std::iota(kept[p].begin(), kept[p].end(), std::size_t{0});
  }
  for (std::size_t base = 0; base < fragments.planes.size(); ++base) {
    if (fragments.planes[base].mip > 0) break;
    const std::vector<std::size_t> chain = chain_of(fragments, base);
    if (chain.size() == 1 || gain < 0) continue;
    const std::vector<RungPair> pairs = measure_pairs(fragments, pixels, ladder, base, inner);
    const std::vector<std::uint8_t> keep = worth_storing(pairs, gain);
    auto first = keep.begin();
    for (std::size_t level = 0; level < chain.size(); ++level) {
      const std::size_t p = chain[level];
      PlaneLadder& plane = ladder.planes[p];
      const auto last = first + static_cast<std::ptrdiff_t>(plane.rungs.size());
      std::vector<std::uint8_t> of_rung(first, last);
      first = last;
      if (level > 0)
        keep_for_display(
            measure_own(fragments.planes[p], pixels[p], plane, previews.planes[base].file, inner),
            is_colour(fragments.planes[p].role) ? kShownWell : kDataShownWell, kOwnGain, of_rung);
      kept[p] = keep_rungs(std::move(of_rung), plane);
    }
  }
  return kept;
}

}  // namespace texmesh
