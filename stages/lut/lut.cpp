#include "stages/lut/lut.h"

#include <algorithm>
#include <atomic>
#include <string>

#include "format/base/sha256.h"
#include "format/documents/allocation.h"
#include "stages/base/parallel.h"
#include "stages/jpeg/jpeg.h"
#include "stages/lut/size_model.h"
#include "stages/measure/fragment_meter.h"

namespace texmesh {
namespace {

constexpr int kGammas = 21;  // 0, 0.05 .. 1

void check(const Fragments& fragments, const std::vector<Pixels>& pixels, const Predictors& predictors,
           const Ladder& ladder, const LutOptions& options) {
  const auto fail = [](std::string place, std::string expected, std::string found) {
    throw StageError("lut", std::move(place), std::move(expected), std::move(found));
  };
  const std::size_t planes = fragments.planes.size();
  if (pixels.size() != planes || predictors.planes.size() != planes || ladder.planes.size() != planes)
    fail("planes", std::to_string(planes) + " of each kind",
         std::to_string(pixels.size()) + ", " + std::to_string(predictors.planes.size()) + " and " +
             std::to_string(ladder.planes.size()));
  for (std::size_t p = 0; p < planes; ++p) {
    const TexturePlane& plane = fragments.planes[p];
    const std::string place = "plane " + std::to_string(p);
    if (predictors.planes[p].vqp.size() != plane.fragment_count())
      fail(place + ": predictors", std::to_string(plane.fragment_count()),
           std::to_string(predictors.planes[p].vqp.size()));
    if (pixels[p].width_px != plane.columns * plane.fragment_width_px ||
        pixels[p].height_px != plane.rows * plane.fragment_height_px || pixels[p].channels != plane.channels)
      fail(place + ": pixels", "whole fragments",
           std::to_string(pixels[p].width_px) + " x " + std::to_string(pixels[p].height_px));
    for (const LadderRung& rung : ladder.planes[p].rungs)
      if (rung.offset.size() != plane.fragment_count() + 1 || rung.offset.back() != rung.data.size())
        fail(place + ": rung " + std::to_string(rung.quality),
             std::to_string(plane.fragment_count()) + " streams",
             std::to_string(rung.offset.size()) + " offsets");
  }
  if (!(options.quality_min <= options.quality_max))
    fail("quality_min", "at most quality_max", std::to_string(options.quality_min));
}

/// What the distortion of a fragment is measured on.
Samples fragment_samples(const TexturePlane& plane, const Pixels& pixels, std::size_t fragment) {
  const std::uint32_t w = plane.fragment_width_px, h = plane.fragment_height_px;
  const auto left = static_cast<std::uint32_t>(fragment % plane.columns) * w;
  const auto top = static_cast<std::uint32_t>(fragment / plane.columns) * h;
  const std::size_t measured = measured_channels(plane);
  Samples out(measured, std::vector<std::uint8_t>(std::size_t{w} * h));
  for (std::size_t c = 0; c < measured; ++c)
    for (std::uint32_t y = 0; y < h; ++y) {
      const std::uint8_t* p = pixels.at(left, top + y);
      for (std::uint32_t x = 0; x < w; ++x, p += plane.channels)
        out[c][std::size_t{y} * w + x] = measured_value(p, plane.channels, measured, c);
    }
  return out;
}

/// 255 for covered texels, 0 for the others and for the padding.
std::vector<std::uint8_t> fragment_mask(const TexturePlane& plane, std::size_t fragment) {
  const std::uint32_t w = plane.fragment_width_px, h = plane.fragment_height_px;
  const auto left = static_cast<std::uint32_t>(fragment % plane.columns) * w;
  const auto top = static_cast<std::uint32_t>(fragment / plane.columns) * h;
  const std::size_t stride = (std::size_t{plane.width_px} + 7) / 8;
  std::vector<std::uint8_t> out(std::size_t{w} * h);
  for (std::uint32_t y = 0; y < h && top + y < plane.height_px; ++y)
    for (std::uint32_t x = 0; x < w && left + x < plane.width_px; ++x)
      if (plane.coverage[(top + y) * stride + (left + x) / 8] >> (7 - (left + x) % 8) & 1)
        out[std::size_t{y} * w + x] = 255;
  return out;
}

/// A fragment's samples as the preview shows them: bilinear, in 1/256 of a preview's texel.
class PreviewSamples {
 public:
  PreviewSamples(const TexturePlane& plane, const std::vector<std::uint8_t>& jpeg)
      : plane_(plane), measured_(measured_channels(plane)) {
    constexpr std::uint64_t kMostPixels = 1u << 26;
    const Pixels preview =
        measured_ > 1 ? decode_jpeg(jpeg, kMostPixels) : decode_jpeg_luma(jpeg, kMostPixels);
    width_ = preview.width_px;
    height_ = preview.height_px;
    preview_ = split_samples(preview, measured_);
  }

  Samples fragment(std::size_t fragment) const {
    const std::uint32_t w = plane_.fragment_width_px, h = plane_.fragment_height_px;
    const auto left = static_cast<std::uint32_t>(fragment % plane_.columns) * w;
    const auto top = static_cast<std::uint32_t>(fragment / plane_.columns) * h;
    std::vector<Place> across;
    for (std::uint32_t x = 0; x < w; ++x) across.push_back(place(left + x, plane_.width_px, width_));
    Samples out(measured_);
    for (std::size_t c = 0; c < measured_; ++c)
      for (std::uint32_t y = 0; y < h; ++y) {
        const Place v = place(top + y, plane_.height_px, height_);
        const std::uint8_t *a = preview_[c].data() + std::size_t{v.first} * width_,
                           *b = preview_[c].data() + std::size_t{v.second} * width_;
        for (const Place& u : across) {
          const std::uint32_t upper = a[u.first] * (256 - u.part) + a[u.second] * u.part;
          const std::uint32_t lower = b[u.first] * (256 - u.part) + b[u.second] * u.part;
          out[c].push_back(
              static_cast<std::uint8_t>((upper * (256 - v.part) + lower * v.part + 32768) >> 16));
        }
      }
    return out;
  }

 private:
  struct Place {
    std::uint32_t first, second, part;
  };
  static Place place(std::uint32_t at, std::uint32_t size, std::uint32_t preview_size) {
    const std::int64_t centre =
        (2 * std::int64_t{at} + 1) * preview_size * 128 / size - 128;  // of a preview's texel, in 1/256
    const std::int64_t last = (std::int64_t{preview_size} - 1) * 256;
    const auto clamped = static_cast<std::uint32_t>(std::clamp<std::int64_t>(centre, 0, last));
    return {clamped / 256, std::min(clamped / 256 + 1, preview_size - 1), clamped % 256};
  }

  const TexturePlane& plane_;
  std::size_t measured_;
  std::uint32_t width_ = 0, height_ = 0;
  Samples preview_;
};

/// Sizes, digests and distortions of one fragment at every rung, and of what the preview shows of it.
void measure_fragment(const TexturePlane& plane, const Pixels& pixels, const PlaneLadder& ladder,
                      const PreviewSamples& preview, std::size_t fragment, PlaneTables& out) {
  const FragmentMeter meter(fragment_samples(plane, pixels, fragment), fragment_mask(plane, fragment),
                            plane.fragment_width_px, plane.fragment_height_px);
  out.skip_dssim[fragment] =
      static_cast<float>(std::max(meter.against(preview.fragment(fragment)).dssim, 0.0));
  const std::uint64_t texels = std::uint64_t{plane.fragment_width_px} * plane.fragment_height_px;
  for (std::size_t r = 0; r < ladder.rungs.size(); ++r) {
    const auto stream = fragment_stream(ladder.rungs[r], fragment);
    const std::size_t at = r * plane.fragment_count() + fragment;
    const Samples decoded = decode_samples(ladder, r, fragment, texels, measured_channels(plane));
    if (decoded[0].size() != texels)
      throw StageError("lut", "fragment " + std::to_string(fragment), std::to_string(texels) + " texels",
                       std::to_string(decoded[0].size()));
    const Distortion distortion = meter.against(decoded);
    out.size_bytes[at] = static_cast<std::uint32_t>(stream.size());
    out.digest[at] = truncated(sha256(stream));
    out.mse[at] = static_cast<float>(distortion.mse);
    out.dssim[at] = static_cast<float>(std::max(distortion.dssim, 0.0));
  }
}

/// What no fragment of a plane is asked to be worse than: a fault of a normal shows in every light, one of
/// metalness or alpha at every edge, where colours hide it.
double least_quality(TextureRole role, const LutOptions& options) {
  const double own = is_colour(role)                ? options.quality_min
                     : role == TextureRole::kNormal ? options.normal_quality_min
                     : role == TextureRole::kAlpha  ? options.alpha_quality_min
                                                    : options.data_quality_min;
  return std::min(std::max(own, options.quality_min), options.quality_max);
}

/// Everything that is copied or follows from the options.
PlaneTables start_plane(const TexturePlane& plane, const PlanePredictors& predictors,
                        const PlaneLadder& ladder, std::uint32_t scales, const LutOptions& options) {
  PlaneTables out;
  out.columns = plane.columns;
  out.rows = plane.rows;
  out.scales = scales;
  out.incremental = codec_traits(ladder.codec).incremental;
  for (const LadderRung& rung : ladder.rungs) {
    out.rung_quality.push_back(static_cast<std::uint8_t>(rung.quality));
    out.table_bytes.push_back(static_cast<std::uint32_t>(rung.tables.size()));
  }
  // A lossless last rung came after the knots were measured, perhaps instead of another one.
  const std::size_t measured = out.rung_quality.size() - (ladder.lossless ? 1 : 0);
  for (std::size_t k = 0; k < ladder.knots.quality.size(); ++k)
    if (measured > 0 && ladder.knots.quality[k] < out.rung_quality[measured - 1]) {
      out.knot_quality.push_back(ladder.knots.quality[k]);
      out.knot_position.push_back(ladder.knots.position[k]);
    }
  const std::size_t cells = ladder.rungs.size() * plane.fragment_count();
  out.size_bytes.resize(cells);
  out.digest.resize(cells);
  out.mse.resize(cells);
  out.dssim.resize(cells);
  out.skip_dssim.resize(plane.fragment_count());
  out.covered_texels = plane.covered_texels;
  out.surface_fraction = plane.surface_fraction;
  out.z = predictors.z;
  out.i = predictors.i;
  out.zeta = predictors.zeta;
  out.m = predictors.m;
  out.vqp = predictors.vqp;
  out.features = plane.features;
  for (std::uint32_t s = 0; s <= scales; ++s)
    out.quality.push_back(static_cast<float>(
        options.quality_fine + (options.quality_coarse - options.quality_fine) * s / std::max(scales, 1u)));
  out.allocation = static_cast<std::uint8_t>(options.allocate);
  out.quality_width = static_cast<float>(options.quality_width);
  out.log_width = static_cast<float>(options.log_width);
  out.quality_min = static_cast<float>(least_quality(plane.role, options));
  out.quality_max = static_cast<float>(options.quality_max);
  return out;
}

std::vector<std::uint16_t> importance_order(const TexturePlane& plane) {
  std::vector<std::uint16_t> order;
  for (std::size_t f = 0; f < plane.fragment_count(); ++f)
    if (plane.covered_texels[f] > 0) order.push_back(static_cast<std::uint16_t>(f));
  std::stable_sort(order.begin(), order.end(), [&](std::uint16_t a, std::uint16_t b) {
    if (plane.eta[a] != plane.eta[b]) return plane.eta[a] > plane.eta[b];
    return plane.surface_fraction[a] > plane.surface_fraction[b];
  });
  return order;
}

/// D_i(Gamma): bytes of all fragments, each at the rung nearest to its q_i.
std::vector<std::uint64_t> total_bytes(const PlaneTables& tables) {
  std::vector<std::uint64_t> out;
  for (std::uint32_t scale = 0; scale <= tables.scales; ++scale)
    for (int g = 0; g < kGammas; ++g) {
      const std::vector<float> quality = quality_of(tables, scale, g / 20.0);
      std::uint64_t sum = 0;
      for (std::uint16_t f : tables.order) sum += bytes_to_show(tables, nearest_rung(tables, quality[f]), f);
      out.push_back(sum);  // with rd, too: that is what rungs_of() then spends
    }
  return out;
}

}  // namespace

PackageTables build_tables(const Fragments& fragments, const std::vector<Pixels>& pixels,
                           const Predictors& predictors, const Ladder& ladder, const LutOptions& options,
                           const RunContext& context) {
  check(fragments, pixels, predictors, ladder, options);
  PackageTables out;
  std::vector<PreviewSamples> previews;
  for (std::size_t p = 0; p < fragments.planes.size(); ++p) {
    const TexturePlane& plane = fragments.planes[p];  // a mip is skipped for its full-size plane's preview
    previews.emplace_back(plane, ladder.planes[plane.mip > 0 ? plane.base : p].preview);
  }
  std::vector<std::pair<std::size_t, std::size_t>> tasks;  // plane, fragment
  for (std::size_t p = 0; p < fragments.planes.size(); ++p) {
    out.planes.push_back(start_plane(fragments.planes[p], predictors.planes[p], ladder.planes[p],
                                     static_cast<std::uint32_t>(fragments.scales), options));
    out.planes[p].order = importance_order(fragments.planes[p]);
    for (std::uint16_t f : out.planes[p].order) tasks.emplace_back(p, f);
  }
  std::atomic<std::size_t> done{0};
  parallel_for(context, tasks.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const auto [p, f] = tasks[t];
      measure_fragment(fragments.planes[p], pixels[p], ladder.planes[p], previews[p], f, out.planes[p]);
      context.report(0.95 * static_cast<double>(++done) / static_cast<double>(tasks.size()));
    }
  });
  parallel_for(context, out.planes.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) {
      out.planes[p].total_bytes = total_bytes(out.planes[p]);
      const TexturePlane& plane = fragments.planes[p];
      fit_size_model(ladder.planes[p], plane.fragment_width_px, plane.fragment_height_px, out.planes[p]);
    }
  });
  return out;
}

}  // namespace texmesh
