#include "stages/quality/table_fit.h"

#include <deque>

#include "format/base/portable_math.h"
#include "format/rules/picture_prediction.h"
#include "format/rules/viewing.h"

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

/// Of the least size, and of all where nothing follows from it.
bool is_all_rendered(const TextureSampler& sampler, std::size_t rank) {
  return rank == 0 || !sampler.shown.with_mips();
}

constexpr double kHigh = 0.95;  // the percentile

/// Which textures stand for the source's: per shown texture an index into the studio's, -1 = the source's.
using Replaced = std::vector<std::int32_t>;

ShotMaterials materials_with(const ShotMaterials& source, const Replaced& replaced) {
  ShotMaterials out = source;
  for (RenderMaterial& m : out)
    for (TextureSlot& slot : m.textures)
      if (slot.texture >= 0 && replaced[static_cast<std::size_t>(slot.texture)] >= 0)
        slot.texture = replaced[static_cast<std::size_t>(slot.texture)];
  return out;
}

/// Shots of one size, each with the place where its losses go.
class SizeShots {
 public:
  SizeShots(const TextureSampler& sampler, Studio& studio, const RunContext& context)
      : sampler_(sampler), studio_(studio), context_(context), source_(studio.textures.size()) {}

  /// Textures of the knot, made when they are first asked for.
  Replaced coded(const GroupCells& group, std::size_t knot) {
    Replaced out(source_, -1);
    for (std::size_t t = 0; t < source_; ++t)
      if (TextureMaker texture = texture_at(sampler_.data, sampler_.shown.textures[t], group.knots[knot],
                                            studio_.textures[t].first_level))
        out[t] = add(std::move(texture));
    return out;
  }

  Replaced previews(const PlanesOfGroup& group) {
    Replaced out(source_, -1);
    for (std::size_t t = 0; t < source_; ++t)
      if (auto texture = preview_at(sampler_.data, sampler_.shown.textures[t], group, context_))
        out[t] = add([small = std::move(*texture)](const RunContext&) { return small; });
    return out;
  }

  /// Mips that are not coded, `levels` coarser than those of the group's planes at this size, or finer where
  /// below 0; of full size the source's texels, where a rung has them.
  Replaced mips(const GroupCells& group, int levels) {
    Replaced out(source_, -1);
    for (const MipShown& mip : mips_shown(group, levels)) out[mip.texture] = uncoded(mip);
    return out;
  }

  Replaced none() const { return Replaced(source_, -1); }
  static bool is_source(const Replaced& replaced) {
    return std::ranges::all_of(replaced, [](std::int32_t t) { return t < 0; });
  }

  /// A scale with the source's texels, all read with mips.
  void take_scale(std::size_t scale, Losses& to, ViewPart views, const std::optional<ShotLimits>& limits) {
    scale_shots_.push_back({scale, &sampler_.shown.materials, views, limits});
    scales_.push_back(&to);
  }

  /// Textures, as samplers read them.
  void take(std::size_t scale, const Replaced& replaced, Losses& to, ViewPart views) {
    if (scale == 0 && is_source(replaced)) {
      to.assign(static_cast<std::size_t>(studio_.views.views), {});  // as the reference
      return;
    }
    for (const Taken& taken : taken_)
      if (taken.scale == scale && taken.views == views && taken.replaced == replaced) {
        repeated_.push_back({taken.to, &to});
        return;
      }
    taken_.push_back({scale, replaced, views, &to});
    materials_.push_back(materials_with(sampler_.shown.sampled, replaced));
    shots_.push_back({scale, &materials_.back(), views});
    to_.push_back(&to);
  }

  void render(double displayed_px, bool with_ssim) {
    all_shots_ = scale_shots_.size() + shots_.size();
    if (have_one_reference(sampler_.shown)) {
      shots_.insert(shots_.end(), scale_shots_.begin(), scale_shots_.end());
      to_.insert(to_.end(), scales_.begin(), scales_.end());
    } else {
      SizePictures pictures(studio_, sampler_.shown.materials, displayed_px, with_ssim);
      take(pictures, scale_shots_, scales_);
    }
    SizePictures pictures(studio_, sampler_.shown.sampled, displayed_px, with_ssim);
    take(pictures, shots_, to_);
    for (const auto& [from, to] : repeated_) *to = *from;
    studio_.textures.resize(source_);
  }

 private:
  struct Taken {
    std::size_t scale;
    Replaced replaced;
    ViewPart views;
    const Losses* to;
  };
  struct MipShown {
    std::size_t texture;
    std::uint32_t level;
    bool is_source;  // the full size has a rung with the source's texels
    auto operator<=>(const MipShown&) const = default;
  };
  std::vector<MipShown> mips_shown(const GroupCells& group, int levels) const {
    std::vector<MipShown> out;
    for (std::size_t t = 0; t < source_; ++t) {
      const ShownTexture& shown = sampler_.shown.textures[t];
      const std::uint32_t asked_for = studio_.textures[t].first_level;
      for (const PlaneRung& r : group.knots[0].rungs) {
        const TexturePlane& plane = sampler_.data.fragments.planes[r.plane];
        if ((plane.mip > 0 ? plane.base : r.plane) != shown.plane) continue;
        const auto level = static_cast<std::uint32_t>(std::max(0, static_cast<int>(plane.mip) + levels));
        const bool is_source = shows_source(sampler_.data, shown, level);
        out.push_back({t, std::max(level, asked_for), is_source});
      }
    }
    return out;
  }
  /// A texture's plane from that level on, made when it is first asked for.
  std::int32_t uncoded(const MipShown& mip) {
    const auto [found, is_new] = uncoded_.try_emplace(mip, -1);
    const ShownTexture& shown = sampler_.shown.textures[mip.texture];
    if (is_new)
      found->second = add([this, &shown, mip](const RunContext& context) {
        return mip.is_source ? best_texture(sampler_.data, shown, 0, mip.level, context)
                             : uncoded_texture(sampler_.data, shown, mip.level, context);
      });
    return found->second;
  }

  /// Shots one after the other, with the textures that they read, as long as these are not too large
  /// together.
  void take(SizePictures& pictures, const std::vector<Shot>& shots, const std::vector<Losses*>& to) {
    constexpr std::size_t kTogetherBytes = std::size_t{32} << 20;
    for (std::size_t begin = 0; begin < shots.size();) {
      std::size_t end = begin, bytes = 0;
      while (end < shots.size() && bytes <= kTogetherBytes) bytes += make_textures(*shots[end++].materials);
      const auto at = [](std::size_t i) { return static_cast<std::ptrdiff_t>(i); };
      RunContext part = context_;
      part.progress = [this, count = static_cast<double>(end - begin)](double fraction) {
        context_.report((taken_shots_ + count * fraction) / static_cast<double>(all_shots_));
      };
      std::vector<Losses> losses = pictures.take({shots.begin() + at(begin), shots.begin() + at(end)}, part);
      taken_shots_ += static_cast<double>(end - begin);
      for (std::size_t i = begin; i < end; ++i) *to[i] = std::move(losses[i - begin]);
      for (std::size_t t = source_; t < studio_.textures.size(); ++t) studio_.textures[t] = {};
      begin = end;
    }
  }
  /// Those that are not there. Returns their bytes.
  std::size_t make_textures(const ShotMaterials& materials) {
    std::size_t bytes = 0;
    for (const RenderMaterial& m : materials)
      for (const TextureSlot& slot : m.textures) {
        const auto t = static_cast<std::size_t>(slot.texture);
        if (slot.texture < 0 || t < source_ || !studio_.textures[t].levels.empty()) continue;
        studio_.textures[t] = makers_[t - source_](context_);
        for (const Pixels& level : studio_.textures[t].levels) bytes += level.data.size();
      }
    return bytes;
  }
  std::int32_t add(TextureMaker maker) {
    makers_.push_back(std::move(maker));
    studio_.textures.emplace_back();
    return static_cast<std::int32_t>(studio_.textures.size() - 1);
  }

  const TextureSampler& sampler_;
  Studio& studio_;
  const RunContext& context_;
  std::size_t source_;
  std::vector<TextureMaker> makers_;  // of the studio's textures behind the source's
  std::map<MipShown, std::int32_t> uncoded_;
  std::deque<ShotMaterials> materials_;
  std::vector<Taken> taken_;
  std::vector<std::pair<const Losses*, Losses*>> repeated_;
  std::vector<Shot> shots_, scale_shots_;
  std::vector<Losses*> to_, scales_;
  std::size_t all_shots_ = 0;
  double taken_shots_ = 0;
};

/// The samples that tell how losses add up: parts that lose little and much.
struct TogetherSample {
  std::size_t scale;
  Together shown;
};

std::vector<TogetherSample> together_samples(std::size_t scales, std::size_t rank) {
  using enum Together;
  const std::size_t near = std::min(scales - 1, 1 + (scales - 1) / 3),
                    far = std::min(scales - 1, 1 + 2 * (scales - 1) / 3);
  if (rank == 0)
    return {{0, kCoarser},    {0, kPreview},   {near, kCoded}, {near, kCoarser},
            {near, kPreview}, {far, kCoarser}, {far, kPreview}};
  if (rank == 1) return {{near, kCoded}};
  return {};
}

Replaced both(Replaced a, const Replaced& b) {
  for (std::size_t i = 0; i < a.size(); ++i)
    if (b[i] >= 0) a[i] = b[i];
  return a;
}

constexpr std::size_t kKinds = 3;  // of losses
double value_of(const Loss& loss, std::size_t kind) {
  return kind == 0 ? loss.flip.mean() : kind == 1 ? loss.flip.percentile(kHigh) : loss.mean_dssim();
}
constexpr std::vector<float> PictureLosses::*kLists[kKinds] = {&PictureLosses::flip, &PictureLosses::flip_p95,
                                                               &PictureLosses::dssim};

/// Linear in the index between the neighbours that have a value; beyond them theirs. Some must have one.
double interpolated(const std::vector<std::optional<double>>& values, std::size_t at) {
  std::size_t below = at, above = at;
  while (below > 0 && !values[below]) --below;
  while (above + 1 < values.size() && !values[above]) ++above;
  if (!values[below]) return values[above].value_or(1);
  if (!values[above]) return *values[below];
  if (above == below) return *values[at];
  const double part = static_cast<double>(at - below) / static_cast<double>(above - below);
  return (1 - part) * *values[below] + part * *values[above];
}

ViewPart coded_views(std::size_t rank, bool few) {
  return rank > 0 ? ViewPart::kLargest : few ? ViewPart::kLarge : ViewPart::kAll;
}
/// Of what is compared with coded planes.
ViewPart other_views(std::size_t rank) { return rank == 0 ? ViewPart::kLarge : ViewPart::kLargest; }

/// A group's textures in each way of Together.
using TogetherTextures = std::array<Replaced, 3>;

TogetherTextures add_group(const TextureSampler& sampler, std::size_t rank, const Display& display,
                           const PlanesOfGroup& planes, bool few, GroupCells& group, SizeShots& shots) {
  const bool follows = few && follows_below(sampler, rank);
  group.knots = sample_knots(sampler.data, planes, sampler.rung_samples, display);
  group.texel_level = texel_level(sampler.data, planes, display);
  const std::size_t knots = group.knots.size();
  group.mips = shown_mips(sampler.data, planes, display);
  group.coded.resize(knots);
  Replaced coded = shots.none();
  group.finer.resize(kFinerLevels + 1);
  group.coarser.resize(kCoarserLevels);
  for (std::size_t k = 0; k < knots; ++k) {
    if (!is_sampled(sampler, group.knots, k, rank)) continue;
    coded = shots.coded(group, k);
    shots.take(0, coded, group.coded[k], coded_views(rank, few));
  }
  group.preview.resize(1);
  const Replaced preview = shots.previews(planes);
  if (!follows) shots.take(0, preview, group.preview[0], coded_views(rank, few));
  MipSamples mips = mip_samples(sampler, rank, display, planes);
  if (follows) mips.finer = 0;
  for (std::size_t l = 0; l < mips.finer; ++l)
    shots.take(0, shots.mips(group, -static_cast<int>(l)), group.finer[l], coded_views(rank, few));
  for (std::size_t l = 0; l < mips.coarser; ++l)
    shots.take(0, shots.mips(group, static_cast<int>(l) + 1), group.coarser[l], other_views(rank));
  const bool coarsest = mips.coarser == kCoarserLevels;
  return {coded, coarsest ? shots.mips(group, static_cast<int>(kCoarserLevels)) : shots.none(), preview};
}

void add_textures(const TextureSampler& sampler, std::size_t rank, const Studio& studio, SizeCells& cells,
                  SizeShots& shots) {
  const Display display{sampler.surface_area, studio.frame.extent, cells.displayed_px};
  cells.groups.resize(sampler.groups.size());
  std::vector<TogetherTextures> textures;
  for (std::size_t g = 0; g < cells.groups.size(); ++g)
    textures.push_back(
        add_group(sampler, rank, display, sampler.groups[g], studio.few, cells.groups[g], shots));
  if (studio.few) return;  // the exponent is a fitted one
  const std::vector<TogetherSample> samples = together_samples(studio.scenes.size(), rank);
  cells.together.resize(samples.size());  // shots hold places in it
  for (std::size_t i = 0; i < samples.size(); ++i) {
    TogetherCell& cell = cells.together[i];
    cell.scale = samples[i].scale;
    cell.shown = samples[i].shown;
    Replaced all = shots.none();
    for (const TogetherTextures& of : textures)
      all = both(std::move(all), of[static_cast<std::size_t>(cell.shown)]);
    shots.take(cell.scale, all, cell.losses, other_views(rank));
  }
}

}  // namespace

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

bool follows_below(const TextureSampler& sampler, std::size_t rank) {
  return rank + 1 == kTextureSizes && sampler.shown.with_mips();
}

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

double mean_mip(const GroupCells& group) {
  double sum = 0;
  for (const ShownMip& m : group.mips) sum += m.part * m.mip;
  return sum;
}

void raise_to_smaller(const GroupCells& larger, const GroupCells& smaller, const GroupPictures& losses,
                      PictureLosses& coarser) {
  const long finer_by = std::lround(std::max(0.0, mean_mip(smaller) - mean_mip(larger)));
  for (std::size_t l = 0; l < coarser.size(); ++l) {
    const long there = static_cast<long>(l) + 1 - finer_by;  // levels coarser than what the smaller one shows
    const PictureLosses& same = there > 0 ? losses.coarser : losses.finer;
    const auto at = static_cast<std::size_t>(there > 0 ? there - 1 : -there);
    if (!larger.coarser[l].empty() || at >= same.size()) continue;
    for (const auto list : {&PictureLosses::flip, &PictureLosses::flip_p95})
      (coarser.*list)[l] = std::max((coarser.*list)[l], (same.*list)[at]);
  }
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

std::size_t fewer_heights(const TextureSampler& sampler, std::size_t triangles, double object_height,
                          const QualityOptions& options) {
  // Texels of 0.7 pixels are the least. Those of a sampler that reads level 0 alone flicker where they are
  // smaller than pixels.
  constexpr double kTexelLevel = 0.5, kSharpTexelLevel = 0;
  constexpr double kLeastEnlargedPx = 128;  // below, a half height hardly costs anything
  constexpr double kTrianglePixels = 16, kSeenArea = 0.25, kSeenTriangles = 0.5;
  std::size_t fewer = 0;
  while (fewer + 1 < kTextureSizes) {
    const double px = std::ldexp(options.largest_px, -static_cast<int>(fewer + 1));
    const double per_unit = px / object_height;
    const double pixels = kSeenArea * sampler.surface_area * per_unit * per_unit;
    if (px < kLeastEnlargedPx || pixels < kTrianglePixels * kSeenTriangles * static_cast<double>(triangles))
      break;
    const bool finer = std::ranges::any_of(sampler.shown.textures, [&](const ShownTexture& t) {
      return display_level(sampler.data.tables.planes[t.plane], sampler.surface_area, object_height, px) >
             (t.with_mips ? kTexelLevel : kSharpTexelLevel);
    });
    if (finer) break;
    ++fewer;
  }
  return fewer;
}

bool have_one_reference(const ShownTextures& shown) { return shown.with_mips(); }

bool repeats(const Knot& knot, const Knot& before) {
  return std::ranges::equal(knot.rungs, before.rungs,
                            [](const PlaneRung& a, const PlaneRung& b) { return a.rung == b.rung; });
}

bool is_sampled(const TextureSampler& sampler, const std::vector<Knot>& knots, std::size_t knot,
                std::size_t rank) {
  if (knot > 0 && repeats(knots[knot], knots[knot - 1])) return false;
  return is_all_rendered(sampler, rank) || repeats(knots[knot], knots.back()) || (rank == 1 && knot == 0);
}

MipSamples mip_samples(const TextureSampler& sampler, std::size_t rank, const Display& display,
                       const PlanesOfGroup& group) {
  if (is_all_rendered(sampler, rank)) return {kFinerLevels + 1, kCoarserLevels};
  Display smaller = display;
  smaller.displayed_px /= 2;
  const bool again = rank == 1 || std::ranges::any_of(group.planes, [&](std::uint32_t p) {
                       return shown_plane(sampler.data, p, smaller) == shown_plane(sampler.data, p, display);
                     });
  return {1, again ? std::size_t{1} : 0};
}

void render_size(const TextureSampler& sampler, const SizeTask& task, Studio& studio, SizeCells& cells,
                 const RunContext& context) {
  SizeShots shots(sampler, studio, context);
  cells.geometry.resize(studio.scenes.size());
  for (std::size_t k = 1; k < task.scales.size(); ++k)
    if (task.scales[k]) shots.take_scale(k, cells.geometry[k], *task.scales[k], task.ends_beyond);
  if (task.rank && !sampler.groups.empty()) add_textures(sampler, *task.rank, studio, cells, shots);
  shots.render(cells.displayed_px, task.rank.has_value());
  for (GroupCells& group : cells.groups)
    for (std::size_t k = 1; k < group.knots.size(); ++k)
      if (repeats(group.knots[k], group.knots[k - 1])) group.coded[k] = group.coded[k - 1];
}

PictureLosses losses_of(const LossCells& cells, const SmallerSize* smaller) {
  constexpr double kNothing = 1e-5;  // curves of logarithms do not reach 0
  PictureLosses out;
  for (std::size_t kind = 0; kind < kKinds; ++kind) {
    const auto below = [&](std::size_t i) { return static_cast<double>((smaller->losses.*kLists[kind])[i]); };
    std::vector<std::optional<double>> found(cells.size()), ratio(cells.size());
    for (std::size_t i = 0; i < cells.size(); ++i) {
      if (cells[i].empty()) continue;
      found[i] = value_of(pooled(cells[i]), kind);
      if (!smaller) continue;
      // Fewer views than at the size below: as far as these were like all of them there.
      if (const Losses& there = smaller->cells[i]; !there.empty()) {
        const double same = value_of(pooled(there, cells[i]), kind);
        if (same > kNothing) *found[i] *= static_cast<double>((smaller->measured.*kLists[kind])[i]) / same;
      }
      if (below(i) > kNothing) ratio[i] = *found[i] / below(i);
    }
    // What was not rendered at all does not follow from its neighbours alone: little is lost alike.
    if (smaller && smaller->first_follows && !ratio.empty() && !ratio[0]) ratio[0] = 1;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const double rest = smaller && below(i) > kNothing ? below(i) * interpolated(ratio, i) : 0;
      const double value = found[i].value_or(rest);
      (out.*kLists[kind]).push_back(static_cast<float>(std::clamp(value, 0.0, 1.0)));
    }
  }
  return out;
}

}  // namespace texmesh
