#include "stages/quality/table_fit.h"

#include "format/base/portable_math.h"
#include "format/rules/picture_prediction.h"

namespace texmesh {
namespace {

constexpr float kLeastDssim = 1e-6f;  // of the one knot of textures that lose nothing

/// What the table says where all fragments have that knot.
double predicted_flip(const GroupCurve& curve, const Knot& knot) {
  double sum = 0, total = 0;
  for (std::size_t i = 0; i < knot.dssim.size(); ++i) {
    if (!(knot.weight[i] > 0)) continue;
    sum += knot.weight[i] * curve.coded(knot.dssim[i]);
    total += knot.weight[i];
  }
  return total > 0 ? sum / total : 0;
}

void make_rising(std::vector<float>& values) {
  for (std::size_t i = 1; i < values.size(); ++i) values[i] = std::max(values[i], values[i - 1]);
}

/// From the finest level to the coarsest.
void make_mips_rising(TextureLosses& losses) {
  std::vector<float>&finer = losses.finer.flip, &coarser = losses.coarser.flip;
  std::vector<float> all(finer.rbegin(), finer.rend());
  all.insert(all.end(), coarser.begin(), coarser.end());
  make_rising(all);
  for (std::size_t i = 0; i < finer.size(); ++i) finer[i] = all[finer.size() - 1 - i];
  std::copy(all.end() - static_cast<std::ptrdiff_t>(coarser.size()), all.end(), coarser.begin());
}

/// Indices of the knots that stay. Rungs may lose the same.
std::vector<std::size_t> rising_knots(const std::vector<Knot>& knots) {
  std::vector<std::size_t> order;
  for (std::size_t k = 0; k < knots.size(); ++k) order.push_back(k);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return knots[a].mean_dssim < knots[b].mean_dssim; });
  std::vector<std::size_t> out;
  for (const std::size_t k : order) {
    const auto dssim = static_cast<float>(knots[k].mean_dssim);
    const float before = out.empty() ? kLeastDssim : static_cast<float>(knots[out.back()].mean_dssim);
    if (dssim > before) out.push_back(k);
  }
  return out;
}

/// A table of one size and one group.
GroupCurve curve_of(TextureLosses losses) {
  QualityTable table;
  table.sizes_px = {1};
  losses.preview.flip = {0};  // not read
  table.groups = {{PlaneGroup::kColour, {std::move(losses)}}};
  return {table, PlaneGroup::kColour, 1};
}

/// What the group's mips lose by themselves, as clients read it.
double mip_loss(const GroupCells& group, const TextureLosses& losses) {
  double sum = 0;
  const GroupCurve curve = curve_of(losses);
  for (const ShownMip& m : group.mips) sum += m.part * curve.halved({}, m.mip);
  return sum;
}

/// What coding adds to that. Knots rise. Little coding is lost in what its mips lose, so that the first knots
/// say no more than how much it is at most.
void take_off(double mips, double exponent, TextureLosses& losses) {
  std::vector<float>& flip = losses.coded.flip;
  for (float& f : flip) {
    const double left = portable::pow(static_cast<double>(f), exponent) - portable::pow(mips, exponent);
    f = static_cast<float>(left > 0 ? portable::pow(left, 1 / exponent) : 0);
  }
  for (std::size_t i = flip.size() - 1; i-- > 0;)
    flip[i] = std::max(flip[i], flip[i + 1] * (losses.texel_dssim[i] / losses.texel_dssim[i + 1]));
}

// Of the growth to one height, what is left to the next. Geometry of saxophone, turtle, helmet and small
// models: .5 to .9 (of 256 to 512 beside 512 to 1024 px); previews: .3 to .7.
constexpr double kGeometryGrows = 0.6, kPreviewGrows = 0.5;
// Coarser mips lose 1.5 times as much at twice the height where texels are as large as pixels, 1.18 times
// where they are twice as large (a model of 2,000 triangles and 512 px; flight helmet 1.5).
constexpr double kMipGrowth = 0.48, kMipGrowthLeft = 0.4;
constexpr double kSmoother = 0.8;  // SSIM of enlarged pictures: windows show less of a change

void scale(PictureLosses& losses, double factor) {
  for (const auto list : {&PictureLosses::flip, &PictureLosses::flip_p95, &PictureLosses::dssim}) {
    const double by = list == &PictureLosses::dssim ? kSmoother : factor;
    for (float& v : losses.*list) v = static_cast<float>(std::min(1.0, static_cast<double>(v) * by));
  }
}

/// Grown by `part` of the growth from the smaller size, element by element.
PictureLosses enlarged(const PictureLosses& from, const PictureLosses& smaller, double part) {
  PictureLosses out = from;
  for (const auto list : {&PictureLosses::flip, &PictureLosses::flip_p95})
    for (std::size_t i = 0; i < from.size(); ++i) {
      const auto now = static_cast<double>((from.*list)[i]), before = static_cast<double>((smaller.*list)[i]);
      const double grown = before > 0 ? std::clamp(now / before, 1.0, 2.0) : 1;
      (out.*list)[i] = static_cast<float>(std::min(1.0, now * (1 + part * (grown - 1))));
    }
  for (float& v : out.dssim) v = static_cast<float>(static_cast<double>(v) * kSmoother);
  return out;
}

}  // namespace

PictureLosses along_curve(const GroupCells& larger, const GroupCells& smaller, const GroupPictures& losses,
                          const PictureLosses& finer) {
  const std::vector<std::size_t> kept = rising_knots(smaller.knots);
  if (kept.empty()) return losses.coded;
  const double growth = larger.texel_level - smaller.texel_level;
  PictureLosses out;
  for (const auto list : {&PictureLosses::flip, &PictureLosses::flip_p95, &PictureLosses::dssim}) {
    const auto before = static_cast<double>((losses.finer.*list)[0]),
               now = static_cast<double>((finer.*list)[0]);
    TextureLosses read;
    for (const std::size_t k : kept) {
      const auto coded = static_cast<double>((losses.coded.*list)[k]);
      read.texel_dssim.push_back(static_cast<float>(smaller.knots[k].mean_dssim));
      read.coded.flip.push_back(
          static_cast<float>(std::sqrt(std::max(0.0, coded * coded - before * before))));
    }
    make_rising(read.coded.flip);
    const GroupCurve curve = curve_of(std::move(read));
    for (const Knot& knot : larger.knots) {
      const double added = curve.coded(knot.mean_dssim, {growth, growth});
      (out.*list).push_back(static_cast<float>(std::min(1.0, std::sqrt(added * added + now * now))));
    }
  }
  return out;
}

PictureLosses coarser_along(const GroupCells& larger, const GroupCells& smaller,
                            const GroupPictures& losses) {
  constexpr std::uint32_t kAnyMip = 1000;
  const double growth = std::max(0.0, larger.texel_level - smaller.texel_level);
  PictureLosses out = losses.coarser;
  for (const auto list : {&PictureLosses::flip, &PictureLosses::flip_p95, &PictureLosses::dssim}) {
    TextureLosses read;
    read.texel_dssim = {1};
    read.coded.flip = {1};  // not read
    read.finer.flip = losses.finer.*list;
    read.coarser.flip = losses.coarser.*list;
    make_mips_rising(read);
    const GroupCurve curve = curve_of(std::move(read));
    const auto at = [&](double level) { return curve.halved({level, level}, kAnyMip); };
    for (std::size_t l = 0; l < out.size(); ++l) {
      const double level = static_cast<double>(l + 1);
      (out.*list)[l] = static_cast<float>(std::clamp(at(level + growth) - at(growth) + at(0), 0.0, 1.0));
    }
  }
  return out;
}

TextureLosses texture_losses(const GroupCells& group, GroupPictures pictures, float exponent) {
  const std::vector<Knot>& knots = group.knots;
  const PictureLosses& coded = pictures.coded;
  TextureLosses out;
  out.preview = std::move(pictures.preview);
  out.finer = std::move(pictures.finer);
  out.coarser = std::move(pictures.coarser);
  make_mips_rising(out);
  std::vector<std::size_t> kept = rising_knots(knots);
  const bool nothing = kept.empty();
  if (nothing) kept.push_back(knots.size() - 1);
  for (const std::size_t k : kept) {
    out.texel_dssim.push_back(nothing ? kLeastDssim : static_cast<float>(knots[k].mean_dssim));
    out.coded.flip.push_back(coded.flip[k]);
    out.coded.flip_p95.push_back(coded.flip_p95[k]);
    out.coded.dssim.push_back(coded.dssim[k]);
  }
  make_rising(out.coded.flip);
  const double mips = mip_loss(group, out);
  if (mips > 0) take_off(mips, static_cast<double>(exponent), out);
  const std::vector<float> measured = out.coded.flip;
  for (int step = 0; step < 3 && !nothing; ++step) {
    const GroupCurve curve = curve_of(out);
    for (std::size_t i = 0; i < kept.size(); ++i) {
      const double predicted = predicted_flip(curve, knots[kept[i]]);
      if (predicted > 0)
        out.coded.flip[i] = static_cast<float>(std::min(
            1.0, static_cast<double>(out.coded.flip[i]) * static_cast<double>(measured[i]) / predicted));
    }
    make_rising(out.coded.flip);
  }
  return out;
}

void lend_knots(const std::vector<double>& texel_level, std::vector<TextureLosses>& sizes) {
  constexpr float kFar = 1.5f;
  const std::vector<TextureLosses> own = sizes;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    TextureLosses& to = sizes[i];
    // Of larger sizes first: there the ladder has more rungs.
    for (std::size_t from = own.size(); from-- > 0;) {
      if (from == i) continue;
      const double growth = texel_level[i] - texel_level[from];
      const double per_level = growth < 0 ? GroupCurve::kLossPerHalving : GroupCurve::kLossPerDoubling;
      const auto factor = static_cast<float>(portable::pow(per_level, growth));
      const TextureLosses& losses = own[from];
      for (std::size_t k = 0; k < losses.texel_dssim.size(); ++k) {
        const float dssim = losses.texel_dssim[k];
        const auto is_near = [&](float d) { return d < kFar * dssim && dssim < kFar * d; };
        if (!(losses.coded.flip[k] > 0) || std::ranges::any_of(to.texel_dssim, is_near)) continue;
        const auto at = std::ranges::lower_bound(to.texel_dssim, dssim) - to.texel_dssim.begin();
        to.texel_dssim.insert(to.texel_dssim.begin() + at, dssim);
        for (const auto list : {&PictureLosses::flip, &PictureLosses::flip_p95, &PictureLosses::dssim}) {
          std::vector<float>& values = to.coded.*list;
          values.insert(values.begin() + at, std::min(1.0f, factor * (losses.coded.*list)[k]));
        }
      }
    }
    make_rising(to.coded.flip);
  }
}

void enlarge(const std::vector<double>& texel_level, QualityTable& table) {
  const std::size_t last = table.sizes_px.size() - 1;
  const auto shift = [](auto& of, auto added) {
    of.erase(of.begin());
    of.push_back(std::move(added));
  };
  shift(table.geometry, enlarged(table.geometry[last], table.geometry[last - 1], kGeometryGrows));
  for (std::size_t g = 0; g < table.groups.size(); ++g) {
    std::vector<TextureLosses>& sizes = table.groups[g].sizes;
    TextureLosses to = sizes[last];
    to.preview = enlarged(to.preview, sizes[last - 1].preview, kPreviewGrows);
    scale(to.coded, GroupCurve::kLossPerDoubling);
    const double less = portable::pow(kMipGrowthLeft, std::max(0.0, texel_level[g]));
    scale(to.coarser, 1 + kMipGrowth * less);
    make_mips_rising(to);
    shift(sizes, std::move(to));
  }
  shift(table.sizes_px, 2 * table.sizes_px[last]);
}

void fit_exponent(const std::vector<TogetherLoss>& samples, QualityTable& table) {
  constexpr int kSteps = 64;        // of the exponent in a unit
  constexpr double kUnseen = 1e-4;  // samples that lose less say nothing
  table.exponent = 1;
  table.error = 0;
  QualityTable tried;
  double least = 1e300;
  for (int step = 0; step <= 3 * kSteps; ++step) {
    tried.exponent = static_cast<float>(1 + static_cast<double>(step) / kSteps);
    double sum = 0;
    std::size_t count = 0;
    for (const TogetherLoss& s : samples) {
      if (!(s.measured > kUnseen)) continue;
      sum += std::fabs(combined_flip(tried, s.parts) - s.measured) / s.measured;
      ++count;
    }
    if (count == 0) return;
    if (sum >= least) continue;
    least = sum;
    table.exponent = tried.exponent;
    table.error = static_cast<float>(sum / static_cast<double>(count));
  }
}

}  // namespace texmesh
