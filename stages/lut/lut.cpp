#include "stages/lut/lut.h"

#include <numeric>

#include "format/base/number16.h"
#include "format/base/portable_math.h"
#include "format/rules/allocation.h"
#include "format/rules/size_curve.h"
#include "stages/base/parallel.h"
#include "stages/image/pixel_window.h"
#include "stages/measure/fragment_meter.h"

namespace texmesh {
namespace {

void check(const Fragments& fragments, const std::vector<Pixels>& pixels, const Predictors& predictors,
           const Ladder& ladder, const Previews& previews, const LutOptions& options) {
  const auto fail = [](std::string place, std::string expected, std::string found) {
    throw StageError("lut", std::move(place), std::move(expected), std::move(found));
  };
  const std::size_t planes = fragments.planes.size();
  check_pixels("lut", fragments, pixels);
  for (const std::size_t found : {predictors.planes.size(), ladder.planes.size(), previews.planes.size()})
    if (found != planes) fail("planes", std::to_string(planes) + " of each kind", std::to_string(found));
  for (std::size_t p = 0; p < planes; ++p) {
    const TexturePlane& plane = fragments.planes[p];
    const std::string place = "plane " + std::to_string(p);
    if (predictors.planes[p].vqp.size() != plane.fragment_count())
      fail(place + ": predictors", std::to_string(plane.fragment_count()),
           std::to_string(predictors.planes[p].vqp.size()));
    for (const LadderRung& rung : ladder.planes[p].rungs)
      if (rung.offset.size() != plane.fragment_count() + 1 || rung.offset.back() != rung.data.size())
        fail(place + ": rung " + std::to_string(rung.quality),
             std::to_string(plane.fragment_count()) + " streams",
             std::to_string(rung.offset.size()) + " offsets");
  }
  if (!(options.quality_min <= options.quality_max))
    fail("quality_min", "at most quality_max", std::to_string(options.quality_min));
}

/// Sizes, digests and distortions of one fragment at every rung, and of what the preview shows of it.
void measure_fragment(const TexturePlane& plane, const Pixels& pixels, const PlaneLadder& ladder,
                      const SamplePatch& preview, std::size_t fragment, PlaneTables& out) {
  const TexelRectangle at = padded_fragment_rectangle(plane, fragment);
  const FragmentMeter meter(rectangle_samples(plane, pixels, at), coverage_samples(plane, at), at.width_px,
                            at.height_px);
  out.skip_dssim[fragment] =
      static_cast<float>(std::max(meter.against(show_preview(plane, preview, at)).dssim, 0.0));
  const std::uint64_t texels = std::uint64_t{at.width_px} * at.height_px;
  for (std::size_t r = 0; r < ladder.rungs.size(); ++r) {
    const auto stream = fragment_stream(ladder.rungs[r], fragment);
    const std::size_t cell = r * plane.fragment_count() + fragment;
    const Samples decoded = decode_samples(ladder, r, fragment, texels, measured_channels(plane));
    if (decoded[0].size() != texels)
      throw StageError("lut", "fragment " + std::to_string(fragment), std::to_string(texels) + " texels",
                       std::to_string(decoded[0].size()));
    const Distortion distortion = meter.against(decoded);
    out.size_bytes[cell] = static_cast<std::uint32_t>(stream.size());
    out.digest[cell] = truncated(sha256(stream));
    out.mse[cell] = static_cast<float>(distortion.mse);
    out.dssim[cell] = static_cast<float>(std::max(distortion.dssim, 0.0));
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

/// Q_i
float default_quality(const TexturePlane& plane, std::uint32_t scale, std::uint32_t scales,
                      const LutOptions& options) {
  const double range = options.quality_coarse - options.quality_fine;
  if (options.default_quality == DefaultQuality::kDistance)
    return static_cast<float>(options.quality_fine + range * scale / std::max(scales, 1u));
  const auto features = [&](std::uint32_t row) {
    const auto begin = plane.features.begin() + static_cast<std::ptrdiff_t>(row * plane.fragment_count());
    return std::accumulate(begin, begin + static_cast<std::ptrdiff_t>(plane.fragment_count()), 0.0);
  };
  const double finest = features(0);
  const double share = finest > 0 ? std::min(features(scale) / finest, 1.0) : scale == 0 ? 1 : 0;
  return static_cast<float>(options.quality_coarse - range * share);
}

/// Everything that is copied or follows from the options.
PlaneTables start_plane(const TexturePlane& plane, const PlanePredictors& predictors, double density_weight,
                        const PlaneLadder& ladder, std::uint32_t scales, const LutOptions& options) {
  PlaneTables out;
  out.columns = plane.columns;
  out.rows = plane.rows;
  out.incremental = codec_traits(ladder.codec).incremental;
  for (const LadderRung& rung : ladder.rungs) {
    out.rung_quality.push_back(static_cast<std::uint8_t>(rung.quality));
    out.table_bytes.push_back(static_cast<std::uint32_t>(rung.table_stream.size()));
  }
  out.knot_quality = ladder.knots.quality;
  out.knot_position = ladder.knots.position;
  const std::size_t cells = ladder.rungs.size() * plane.fragment_count();
  out.size_bytes.resize(cells);
  out.digest.resize(cells);
  out.mse.resize(cells);
  out.dssim.resize(cells);
  out.skip_dssim.resize(plane.fragment_count());
  out.covered_texels = plane.covered_texels;
  out.surface_fraction = plane.surface_fraction;
  out.features = plane.features;
  for (std::uint32_t s = 0; s <= scales; ++s)
    out.quality.push_back(default_quality(plane, s, scales, options));
  out.allocation = static_cast<std::uint8_t>(options.allocate);
  out.quality_width = static_cast<float>(options.quality_width);
  out.log_width = static_cast<float>(options.log_width);
  out.quality_min = static_cast<float>(least_quality(plane.role, options));
  out.quality_max = static_cast<float>(options.quality_max);
  if (options.allocate == Allocation::kVqp) {  // as the file stores it, so that every reader decides the same
    for (const float p : predictors.vqp) out.vqp.push_back(from_unit16(to_unit16(p)));
    out.density_weight = static_cast<float>(density_weight);
  }
  return out;
}

std::vector<std::uint16_t> importance_order(const TexturePlane& plane, const std::vector<float>& vqp) {
  const std::vector<float>& importance = vqp.empty() ? plane.eta : vqp;
  std::vector<std::uint16_t> order;
  for (std::size_t f = 0; f < plane.fragment_count(); ++f)
    if (plane.covered_texels[f] > 0) order.push_back(static_cast<std::uint16_t>(f));
  std::stable_sort(order.begin(), order.end(), [&](std::uint16_t a, std::uint16_t b) {
    if (importance[a] != importance[b]) return importance[a] > importance[b];
    return plane.surface_fraction[a] > plane.surface_fraction[b];
  });
  return order;
}

/// What the thesis's policy reads of a plane whose tables are there.
PlaneThesis describe_thesis(const PlanePredictors& predictors, const PlaneLadder& ladder,
                            const PlaneTables& tables) {
  PlaneThesis out;
  out.z = predictors.z;
  out.i = predictors.i;
  out.zeta = predictors.zeta;
  out.m = predictors.m;
  out.vqp = predictors.vqp;
  out.quality = tables.quality;
  for (std::size_t scale = 0; scale < tables.scale_count(); ++scale)
    for (std::size_t g = 0; g < kGammaSteps; ++g)  // with rd, too: that is what rungs_of() then spends
      out.total_bytes.push_back(bytes_asked_for(tables, scale, static_cast<double>(g) / (kGammaSteps - 1)));
  out.models = fit_size_models(ladder, tables, predictors.vqp);
  return out;
}

/// y = offset + slope x.
struct Line {
  double slope = 0, offset = 0, correlation = 0;
};

Line least_squares(const std::vector<double>& x, const std::vector<double>& y) {
  const auto n = static_cast<double>(x.size());
  double mean_x = 0, mean_y = 0, xx = 0, xy = 0, yy = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    mean_x += x[k] / n;
    mean_y += y[k] / n;
  }
  for (std::size_t k = 0; k < x.size(); ++k) {
    xx += (x[k] - mean_x) * (x[k] - mean_x);
    xy += (x[k] - mean_x) * (y[k] - mean_y);
    yy += (y[k] - mean_y) * (y[k] - mean_y);
  }
  const double slope = xy / xx;
  return {slope, mean_y - slope * mean_x, yy > 0 ? xy / std::sqrt(xx * yy) : 0};
}

}  // namespace

LutTables build_tables(const Fragments& fragments, const std::vector<Pixels>& pixels,
                       const Predictors& predictors, const Ladder& ladder, const Previews& previews,
                       const LutOptions& options, const RunContext& context) {
  check(fragments, pixels, predictors, ladder, previews, options);
  LutTables out;
  std::vector<PlaneTables>& tables = out.tables.planes;
  std::vector<SamplePatch> skipped;
  for (std::size_t p = 0; p < fragments.planes.size(); ++p) {
    const TexturePlane& plane = fragments.planes[p];  // a mip is skipped for its full-size plane's preview
    skipped.push_back(preview_samples(plane, previews.planes[plane.mip > 0 ? plane.base : p].file));
  }
  std::vector<std::pair<std::size_t, std::size_t>> tasks;  // plane, fragment
  for (std::size_t p = 0; p < fragments.planes.size(); ++p) {
    tables.push_back(start_plane(fragments.planes[p], predictors.planes[p], predictors.density_weight,
                                 ladder.planes[p], static_cast<std::uint32_t>(fragments.scales), options));
    tables[p].order = importance_order(fragments.planes[p], tables[p].vqp);
    for (std::uint16_t f : tables[p].order) tasks.emplace_back(p, f);
  }
  std::atomic<std::size_t> done{0};
  parallel_each(context, tasks.size(), 1, [&](std::size_t t) {
    const auto [p, f] = tasks[t];
    measure_fragment(fragments.planes[p], pixels[p], ladder.planes[p], skipped[p], f, tables[p]);
    context.report(0.95 * static_cast<double>(++done) / static_cast<double>(tasks.size()));
  });
  out.thesis.planes.resize(tables.size());
  parallel_each(context, tables.size(), 1, [&](std::size_t p) {
    out.thesis.planes[p] = describe_thesis(predictors.planes[p], ladder.planes[p], tables[p]);
  });
  return out;
}

std::vector<SizeModel> fit_size_models(const PlaneLadder& ladder, const PlaneTables& t,
                                       const std::vector<float>& vqp) {
  std::vector<SizeModel> models(t.fragment_count());
  std::vector<double> quality, log_size;
  for (std::size_t r = 0; r + (ladder.source_rung ? 1 : 0) < ladder.rungs.size(); ++r)
    quality.push_back(t.rung_quality[r] / 100.0);
  if (quality.size() < 2) return models;
  for (const std::uint16_t f : t.order) {
    const auto p = static_cast<double>(vqp[f]);
    if (!(p >= kLeastModelVqp)) continue;
    log_size.clear();
    for (std::size_t r = 0; r < quality.size(); ++r)
      log_size.push_back(portable::log(static_cast<double>(bytes_to_show(t, r, f))));
    const Line line = least_squares(quality, log_size);
    if (!(line.slope > 0)) continue;
    models[f].a = static_cast<float>(portable::exp(line.offset));
    models[f].b = static_cast<float>(line.slope / portable::log(100 * p));
    models[f].correlation = static_cast<float>(line.correlation);
  }
  return models;
}

}  // namespace texmesh
