// What filling the texels that no chart covers saves: fill_bench MODEL ... . Bytes of the stored fragments at
// equal PSNR over covered texels, as a share of those of the atlas's own background; and what blocks that are
// covered wholly take alone, at the same qualities: no fill can be below. Ratios within one run.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <utility>

#include "stages/data/fragments.h"
#include "stages/fill/fill.h"
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/ladder/ladder.h"
#include "stages/lut/lut.h"
#include "stages/previews/previews.h"
#include "stages/zim/zim.h"
#include "tests/bench/bench_model.h"
#include "tests/support/all_rungs.h"
#include "tests/support/fill_curves.h"

namespace texmesh {
namespace {

using testing::bytes_at;
using testing::fill_curve;
using testing::FillPoint;

bool covered(const TexturePlane& plane, std::uint32_t x, std::uint32_t y) {
  return CoverageMask(plane).covered(x, y);
}

/// Every uncovered texel becomes the covered one that a brush fire reaches it from first.
void dilate(Pixels& pixels, const TexturePlane& plane) {
  std::vector<std::uint32_t> from(std::size_t{plane.width_px} * plane.height_px, 0xffffffffu), queue;
  for (std::uint32_t y = 0; y < plane.height_px; ++y)
    for (std::uint32_t x = 0; x < plane.width_px; ++x)
      if (covered(plane, x, y)) {
        queue.push_back(y * plane.width_px + x);
        from[queue.back()] = queue.back();
      }
  for (std::size_t k = 0; k < queue.size(); ++k) {
    const std::uint32_t x = queue[k] % plane.width_px, y = queue[k] / plane.width_px;
    const auto visit = [&](std::uint32_t u, std::uint32_t v) {
      if (u >= plane.width_px || v >= plane.height_px) return;
      const std::uint32_t to = v * plane.width_px + u;
      if (from[to] != 0xffffffffu) return;
      from[to] = from[queue[k]];
      queue.push_back(to);
    };
    visit(x + 1, y), visit(x - 1, y), visit(x, y + 1), visit(x, y - 1);
  }
  for (std::uint32_t y = 0; y < plane.height_px; ++y)
    for (std::uint32_t x = 0; x < plane.width_px; ++x) {
      const std::uint32_t source = from[y * plane.width_px + x];
      if (source == 0xffffffffu) continue;
      const std::uint8_t* value = pixels.at(source % plane.width_px, source / plane.width_px);
      std::copy(value, value + pixels.channels,
                pixels.data.data() + (std::size_t{y} * pixels.width_px + x) * pixels.channels);
    }
}

/// Every 16 x 16 block that is not wholly covered becomes flat: no fill makes fewer bytes, for what such
/// blocks have of the picture is not even coded.
void leave_whole_blocks(Pixels& pixels, const TexturePlane& plane) {
  constexpr std::uint32_t kMcu = 16;
  for (std::uint32_t top = 0; top + kMcu <= plane.height_px; top += kMcu)
    for (std::uint32_t left = 0; left + kMcu <= plane.width_px; left += kMcu) {
      std::uint32_t count = 0;
      for (std::uint32_t k = 0; k < kMcu * kMcu; ++k)
        if (covered(plane, left + k % kMcu, top + k / kMcu)) ++count;
      if (count == kMcu * kMcu) continue;
      for (std::uint32_t k = 0; k < kMcu * kMcu; ++k)
        for (std::uint32_t c = 0; c < pixels.channels; ++c)
          pixels
              .data[(std::size_t{top + k / kMcu} * pixels.width_px + left + k % kMcu) * pixels.channels + c] =
              128;
    }
}

/// Means of 8 x 8 texels that are covered in part, as a client that halves what it shows three times has
/// them: there uncovered texels are seen, too. [planes, fragments, blocks] x channels.
std::vector<double> mixed_means(const Fragments& fragments, const std::vector<std::size_t>& shown,
                                const Ladder& ladder, std::size_t rung) {
  constexpr std::uint32_t kSide = 8;
  std::vector<double> out;
  for (const std::size_t p : shown) {
    const TexturePlane& plane = fragments.planes[p];
    for (std::uint32_t f = 0; f < plane.fragment_count(); ++f) {
      if (plane.covered_texels[f] == 0) continue;
      const auto [left, top, width, height] = padded_fragment_rectangle(plane, f);
      const Pixels shows = decode_fragment(ladder.planes[p], rung, f, std::uint64_t{1} << 20);
      for (std::uint32_t y = 0; y < height; y += kSide)
        for (std::uint32_t x = 0; x < width; x += kSide) {
          if (left + x + kSide > plane.width_px || top + y + kSide > plane.height_px) continue;
          std::uint32_t count = 0;
          for (std::uint32_t k = 0; k < kSide * kSide; ++k)
            count += covered(plane, left + x + k % kSide, top + y + k / kSide);
          if (count == 0 || count == kSide * kSide) continue;
          for (std::uint32_t c = 0; c < shows.channels; ++c) {
            double sum = 0;
            for (std::uint32_t k = 0; k < kSide * kSide; ++k)
              sum += shows.at(x + k % kSide, y + k / kSide)[c];
            out.push_back(sum / (kSide * kSide));
          }
        }
    }
  }
  return out;
}

double rms_difference(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (std::size_t k = 0; k < a.size(); ++k) sum += (a[k] - b[k]) * (a[k] - b[k]);
  return a.empty() ? 0 : std::sqrt(sum / static_cast<double>(a.size()));
}

constexpr std::size_t kMiddleRung = 5, kTopRung = 9;  // qualities 53 and 97
struct Measured {
  std::vector<FillPoint> rungs;
  std::vector<double> mixed_middle, mixed_top;
};

Measured measure(const Fragments& fragments, const std::vector<std::size_t>& shown,
                 const std::vector<Pixels>& pixels, Uncovered uncovered, const RunContext& context) {
  LadderOptions options = testing::all_rungs();
  options.uncovered = uncovered;
  const Predictors predictors = predict_quality(fragments, pixels, {}, context);
  const Previews previews = make_previews(fragments, pixels, {}, context);
  const Ladder ladder = encode_ladder(fragments, pixels, previews, {}, options, context);
  const PackageTables tables =
      build_tables(fragments, pixels, predictors, ladder, previews, {}, context).tables;
  return {fill_curve(tables, shown), mixed_means(fragments, shown, ladder, kMiddleRung),
          mixed_means(fragments, shown, ladder, kTopRung)};
}

/// How many uncovered texels equal their four neighbours: what the source's background costs.
double flat_share(const Fragments& fragments, const std::vector<std::size_t>& shown,
                  const std::vector<Pixels>& pixels) {
  double flat = 0, all = 0;
  for (const std::size_t p : shown) {
    const TexturePlane& plane = fragments.planes[p];
    for (std::uint32_t y = 0; y + 1 < plane.height_px; ++y)
      for (std::uint32_t x = 0; x + 1 < plane.width_px; ++x) {
        if (covered(plane, x, y)) continue;
        ++all;
        const std::uint8_t *a = pixels[p].at(x, y), *b = pixels[p].at(x + 1, y), *c = pixels[p].at(x, y + 1);
        int most = 0;
        for (std::uint32_t k = 0; k < plane.channels; ++k)
          most = std::max({most, std::abs(a[k] - b[k]), std::abs(a[k] - c[k])});
        if (most <= 2) ++flat;
      }
  }
  return all > 0 ? flat / all : 1;
}

void print_model(const std::string& path) {
  RunContext context;
  context.threads = 2;
  BenchModel model = load_bench_model(path, context);
  // Only what is measured is worth encoding.
  Fragments shown_only = model.fragments;
  shown_only.planes.clear();
  for (const std::size_t p : colour_planes(model.fragments))
    shown_only.planes.push_back(model.fragments.planes[p]);
  std::vector<std::size_t> shown(shown_only.planes.size());
  for (std::size_t p = 0; p < shown.size(); ++p) shown[p] = p;
  if (shown.empty()) return;

  double texels = 0, stored_texels = 0;
  for (const TexturePlane& plane : shown_only.planes)
    for (std::size_t f = 0; f < plane.fragment_count(); ++f) {
      texels += plane.covered_texels[f];
      if (plane.covered_texels[f] > 0)
        stored_texels += static_cast<double>(plane.fragment_width_px) * plane.fragment_height_px;
    }
  const std::vector<Pixels> source = fill_planes(shown_only, model.images, Fill::kNone, context);
  std::vector<Pixels> nearest = source;
  for (std::size_t p = 0; p < nearest.size(); ++p) dilate(nearest[p], shown_only.planes[p]);
  const std::vector<Pixels> ours =
      fill_planes(shown_only, model.images, Fill::kPushPull, context, PartBlocks::kSmooth);

  const std::vector<FillPoint> reference =
      measure(shown_only, shown, source, Uncovered::kKept, context).rungs;
  std::cout << fmt::format("{:<22} {:5.1f} {:5.1f} ", model_name(path), 100 * texels / stored_texels,
                           100 * flat_share(shown_only, shown, source));
  Measured free;
  for (const std::vector<Pixels>* pixels : {&std::as_const(nearest), &ours}) {
    const Measured measured =
        measure(shown_only, shown, *pixels, pixels == &ours ? Uncovered::kFree : Uncovered::kKept, context);
    const std::vector<FillPoint>& curve = measured.rungs;
    if (pixels == &ours) free = measured;
    double sum = 0;
    int count = 0;
    std::string at;
    for (const std::size_t r :
         {std::size_t{3}, std::size_t{4}, std::size_t{5}, std::size_t{6}, std::size_t{7}}) {
      const double bytes = bytes_at(curve, reference[r].psnr);
      if (bytes <= 0) continue;
      if (r != 4 && r != 6) at += fmt::format(" {:.3f}", bytes / reference[r].bytes);
      sum += std::log(bytes / reference[r].bytes);
      ++count;
    }
    std::cout << fmt::format("   {:.3f} ({} )", std::exp(sum / count), at);
  }
  std::vector<Pixels> whole = ours;
  for (std::size_t p = 0; p < whole.size(); ++p) leave_whole_blocks(whole[p], shown_only.planes[p]);
  const std::vector<FillPoint> least = measure(shown_only, shown, whole, Uncovered::kKept, context).rungs;
  const Measured kept = measure(shown_only, shown, ours, Uncovered::kKept, context);
  std::cout << fmt::format(
      "   {:.3f} {:.3f} {:.3f}   {:.0f} kB {:.2f} dB at quality 53   {:.2f} {:.2f} ({:.2f})\n",
      least[3].bytes / reference[3].bytes, least[5].bytes / reference[5].bytes,
      least[7].bytes / reference[7].bytes, reference[5].bytes / 1e3, reference[5].psnr,
      rms_difference(free.mixed_middle, kept.mixed_top), rms_difference(free.mixed_top, kept.mixed_top),
      rms_difference(kept.mixed_middle, kept.mixed_top));
}

}  // namespace
}  // namespace texmesh

int main(int argc, char** argv) {
  std::cout << "fill: bytes over the source's background at equal PSNR of covered texels, mean of rungs "
               "18..86 (rungs "
               "18 53 86)\n"
               "                       cov.%  flat%  nearest texel                  push-pull                "
               "      least possible       source                          error of mixed 8 x 8 at 53, 97 "
               "(kept 53)\n";
  try {
    for (int k = 1; k < argc; ++k) texmesh::print_model(argv[k]);
  } catch (const std::exception& e) {
    std::cerr << e.what() << '\n';
    return 1;
  }
  return argc > 1 ? 0 : 2;
}
