#include "format/rules/whole_textures.h"

#include <map>

#include "format/rules/allocation.h"
#include "format/rules/picture_prediction.h"
#include "format/rules/viewing.h"

namespace texmesh {
namespace {

constexpr int kCoarserLevels = 4;

/// One choice for all planes of a group.
struct GroupChoice {
  std::vector<WholeTexture> textures;
  double bytes = 0, flip = 0;
};

std::size_t group_index(const TextureInfo& t) { return static_cast<std::size_t>(group_of(t.role)); }

double level_of(const TexturedObject& o, std::uint32_t base, double displayed_px) {
  return display_level(o.tables[base], o.surface_area, o.height, displayed_px);
}

/// How much larger a plane's texels are than those that were sampled at the table's heights.
TexelGrowth growth_of(const TexturedObject& o, const WholeTexture& t, double displayed_px) {
  const double here = o.textures[t.plane].mip - level_of(o, t.base, displayed_px);
  TexelGrowth out{};
  const SizesAround sizes = sizes_around(o.quality, displayed_px);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const double level = level_of(o, t.base, sizes[i]);
    out[i] = here - (o.textures[plane_at_level(o.textures, t.base, level)].mip - level);
  }
  return out;
}

/// Sums of one group's planes, by the surface that each of them has.
class GroupSum {
 public:
  GroupSum(const TexturedObject& object, const GroupCurve& curve, double displayed_px)
      : object_(object), curve_(curve), displayed_px_(displayed_px) {}

  /// `weights` are the plane's surface_weights().
  void add(const WholeTexture& texture, const std::vector<float>& weights) {
    const PlaneTables& t = object_.tables[texture.plane];
    double dssim = 0, weight = 0;
    for (const std::uint16_t f : t.order) {
      const auto w = static_cast<double>(weights[f]);
      weight += w;
      dssim += w * static_cast<double>(t.dssim[texture.rung * t.fragment_count() + f]);
    }
    choice_.textures.push_back(texture);
    if (!(weight > 0)) return;
    const TexelGrowth growth = growth_of(object_, texture, displayed_px_);
    const double parts[] = {curve_.coded(dssim / weight, growth),
                            curve_.halved(growth, object_.textures[texture.plane].mip)};
    flip_ += weight * combined_flip(object_.quality, parts);
    weight_ += weight;
    choice_.bytes += static_cast<double>(bytes_of_rung(t, texture.rung));
  }
  GroupChoice finish() {
    choice_.flip = weight_ > 0 ? flip_ / weight_ : 0;
    return std::move(choice_);
  }

 private:
  const TexturedObject& object_;
  const GroupCurve& curve_;
  double displayed_px_, flip_ = 0, weight_ = 0;
  GroupChoice choice_;
};

/// Those that no other one beats in both bytes and FLIP, by rising bytes.
std::vector<GroupChoice> worth_having(std::vector<GroupChoice> all) {
  std::ranges::stable_sort(all, [](const GroupChoice& a, const GroupChoice& b) {
    return a.bytes != b.bytes ? a.bytes < b.bytes : a.flip < b.flip;
  });
  std::vector<GroupChoice> kept;
  for (GroupChoice& c : all)
    if (kept.empty() || c.flip < kept.back().flip) kept.push_back(std::move(c));
  return kept;
}

std::vector<GroupChoice> group_choices(const TexturedObject& o, const std::vector<std::uint32_t>& bases,
                                       double displayed_px) {
  if (bases.empty()) return {GroupChoice{}};
  const GroupCurve curve(o.quality, group_of(o.textures[bases.front()].role), displayed_px);
  GroupChoice previews;
  previews.flip = curve.preview();
  std::uint32_t rungs = 0;
  for (const std::uint32_t base : bases) previews.textures.push_back({base, base});
  for (const PlaneTables& t : o.tables) rungs = std::max(rungs, static_cast<std::uint32_t>(t.rung_count()));
  std::vector<GroupChoice> all{previews};
  std::map<std::uint32_t, std::vector<float>> weights;  // of a plane
  for (int coarser = kCoarserLevels; coarser >= 0; --coarser)
    for (std::uint32_t rung = 0; rung < rungs; ++rung) {
      GroupSum sum(o, curve, displayed_px);
      for (const std::uint32_t base : bases) {
        const double level = std::max(0.0, level_of(o, base, displayed_px)) + coarser;
        const std::uint32_t plane = plane_at_level(o.textures, base, level);
        const auto [known, fresh] = weights.try_emplace(plane);
        if (fresh) known->second = surface_weights(o.tables[plane]);
        sum.add({base, plane, std::min(rung, static_cast<std::uint32_t>(o.tables[plane].rung_count()) - 1)},
                known->second);
      }
      all.push_back(sum.finish());
    }
  return worth_having(std::move(all));
}

}  // namespace

std::vector<WholeTexture> least_textures(const TexturedObject& o, int scale, double displayed_px,
                                         double most_flip) {
  std::array<std::vector<std::uint32_t>, kPlaneGroups> bases;
  for (std::uint32_t p = 0; p < o.textures.size(); ++p) {
    const TextureInfo& t = o.textures[p];
    const auto is_its_alpha = [&](const TextureInfo& a) { return a.image == t.image && a.role == "alpha"; };
    if (t.mip == 0 && std::ranges::none_of(o.textures, is_its_alpha)) bases[group_index(t)].push_back(p);
  }
  std::array<std::vector<GroupChoice>, kPlaneGroups> choices;
  for (std::size_t g = 0; g < kPlaneGroups; ++g) choices[g] = group_choices(o, bases[g], displayed_px);
  const double geometry = geometry_flip(o.quality, displayed_px, scale);
  std::array<const GroupChoice*, kPlaneGroups> best{};
  double best_bytes = 0, best_flip = 2;
  for (const GroupChoice& a : choices[0])
    for (const GroupChoice& b : choices[1])
      for (const GroupChoice& c : choices[2]) {
        const double losses[] = {geometry, a.flip, b.flip, c.flip};
        const double flip = combined_flip(o.quality, losses), bytes = a.bytes + b.bytes + c.bytes;
        const bool better =
            best_flip <= most_flip ? flip <= most_flip && bytes < best_bytes : flip < best_flip;
        if (better) best = {&a, &b, &c}, best_bytes = bytes, best_flip = flip;
      }
  std::vector<WholeTexture> out;
  for (const GroupChoice* g : best) out.insert(out.end(), g->textures.begin(), g->textures.end());
  std::ranges::sort(out, {}, &WholeTexture::base);
  return out;
}

}  // namespace texmesh
