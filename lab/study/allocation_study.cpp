#include "lab/study/allocation_study.h"

#include <algorithm>

#include "format/base/vec.h"
#include "format/rules/allocation.h"
#include "stages/base/parallel.h"
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/jpeg/jpeg.h"
#include "stages/measure/flip.h"
#include "stages/measure/fragment_meter.h"
#include "stages/render/shade.h"
#include "tools/render/rendered_model.h"

namespace texmesh {
namespace {

constexpr std::uint32_t kLargestLevelPx = 2048;  // what a view of some hundred pixels can show
constexpr std::uint64_t kMaxPreviewPixels = 1u << 26;

using Rungs = std::vector<std::vector<std::int16_t>>;  // [shown plane][fragment]

struct Shown {
  std::vector<std::size_t> planes;        // indices into Fragments::planes
  std::vector<std::int32_t> of_material;  // index into planes, -1 = no texture
};

Shown shown_planes(const std::vector<Material>& materials, const Fragments& fragments) {
  Shown out;
  for (const Material& m : materials) {
    std::int32_t found = -1;
    for (std::size_t p = 0; m.base_colour_texture.used() && p < fragments.planes.size() && found < 0; ++p) {
      const TexturePlane& plane = fragments.planes[p];
      if (plane.image != static_cast<std::uint32_t>(m.base_colour_texture.image) ||
          plane.role != TextureRole::kBaseColour)
        continue;
      const auto at = std::find(out.planes.begin(), out.planes.end(), p);
      found = static_cast<std::int32_t>(at - out.planes.begin());
      if (at == out.planes.end()) out.planes.push_back(p);
    }
    out.of_material.push_back(found);
  }
  if (out.planes.empty())
    throw StageError("allocation study", "materials", "a base colour with a texture", "none");
  return out;
}

/// A plane's texture, from the first level that is worth keeping.
RenderTexture texture_of(const Pixels& pixels, const TexturePlane& plane, const RunContext& context) {
  Pixels whole{plane.width_px, plane.height_px, pixels.channels, {}};
  for (std::uint32_t y = 0; y < whole.height_px; ++y)
    whole.data.insert(whole.data.end(), pixels.at(0, y),
                      pixels.at(0, y) + std::size_t{whole.width_px} * whole.channels);
  std::uint32_t first_level = 0;
  while (std::max(plane.width_px, plane.height_px) >> first_level > kLargestLevelPx) ++first_level;
  return render_texture(std::move(whole), true, first_level, context);
}

/// A plane as a client puts it together from the chosen rungs.
Pixels compose(const TexturePlane& plane, const Pixels& source, const PlaneLadder& ladder,
               const PlanePreview& preview_file, const std::vector<std::int16_t>& rungs,
               const RunContext& context) {
  Pixels out = source;  // fragments without coverage keep the source's pixels: nobody sees them
  const Pixels preview = enlarged_preview(decode_jpeg(preview_file.file, kMaxPreviewPixels), plane.width_px,
                                          plane.height_px, out.channels);
  parallel_for(context, plane.fragment_count(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f) {
      if (plane.covered_texels[f] == 0) continue;
      const auto [left, top, w, h] = padded_fragment_rectangle(plane, f);
      const bool skipped = rungs[f] == kSkipped;
      const Pixels block =
          skipped ? Pixels{}
                  : decode_fragment(ladder, static_cast<std::size_t>(rungs[f]), f, std::uint64_t{w} * h);
      for (std::uint32_t y = 0; y < h; ++y)
        for (std::uint32_t x = 0; x < w; ++x)
          std::copy_n(skipped ? preview.at(std::min(left + x, preview.width_px - 1),
                                           std::min(top + y, preview.height_px - 1))
                              : block.at(x, y),
                      out.channels,
                      &out.data[(std::size_t{top + y} * out.width_px + left + x) * out.channels]);
    }
  });
  return out;
}

struct Chosen {
  std::string name;
  Rungs rungs;
};

std::uint64_t bytes_of(const std::vector<const PlaneTables*>& tables, const Rungs& rungs) {
  std::uint64_t sum = 0;
  for (std::size_t p = 0; p < tables.size(); ++p) sum += sum_of(texmesh::bytes_of(*tables[p], rungs[p]));
  return sum;
}

Rungs uniform_rungs(const std::vector<const PlaneTables*>& tables, int quality) {
  Rungs out;
  for (const PlaneTables* t : tables) {
    out.emplace_back(t->fragment_count(), kSkipped);
    for (const std::uint16_t f : t->order)
      out.back()[f] = static_cast<std::int16_t>(nearest_rung(*t, quality));
  }
  return out;
}

/// What whole rungs leave of the budget: fragment after fragment by falling eta of scale 0 (ties: plane,
/// index) goes up by a rung where that fits, again and again until none does.
void spend_remainder(const std::vector<const PlaneTables*>& tables, std::uint64_t budget, Rungs& rungs) {
  struct RankedFragment {
    float eta;
    std::size_t plane, fragment;
  };
  std::vector<RankedFragment> ranked;
  for (std::size_t p = 0; p < tables.size(); ++p) {
    const std::vector<float> eta = eta_of(*tables[p], 0);
    for (std::size_t f = 0; f < eta.size(); ++f)
      if (rungs[p][f] != kSkipped) ranked.push_back({eta[f], p, f});
  }
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const RankedFragment& a, const RankedFragment& b) { return a.eta > b.eta; });
  std::uint64_t spent = bytes_of(tables, rungs);
  for (bool more = spent < budget; more;) {
    more = false;
    for (const RankedFragment& at : ranked) {
      const PlaneTables& t = *tables[at.plane];
      std::int16_t& rung = rungs[at.plane][at.fragment];
      const auto next = static_cast<std::size_t>(rung) + 1;
      if (next >= t.rung_count()) continue;
      const std::uint64_t others = spent - bytes_to_show(t, next - 1, at.fragment);
      if (others + bytes_to_show(t, next, at.fragment) > budget) continue;
      spent = others + bytes_to_show(t, next, at.fragment);
      ++rung;
      more = true;
    }
  }
}

/// (3.2) or its log form with the highest Q_i that fits.
Rungs variable_rungs(const std::vector<const PlaneTables*>& tables, std::uint8_t allocation, double width,
                     std::uint64_t budget) {
  Rungs best = uniform_rungs(tables, 1);
  for (double q = 1; q <= 100; q += 0.25) {
    Rungs rungs;
    for (const PlaneTables* t : tables) {
      PlaneTables asked = *t;
      asked.allocation = allocation;
      asked.quality_width = static_cast<float>(width);
      asked.quality[0] = static_cast<float>(q);
      rungs.push_back(rungs_of(asked, 0, mean_eta(asked, 0)));
    }
    if (bytes_of(tables, rungs) <= budget) best = std::move(rungs);
  }
  spend_remainder(tables, budget, best);
  return best;
}

double largest_weight(const PlaneTables& tables) {
  double largest = 0;
  for (const float w : surface_weights(tables)) largest = std::max(largest, static_cast<double>(w));
  return largest;
}

Rungs bought_rungs(const std::vector<const PlaneTables*>& tables, std::uint64_t budget) {
  double largest = 0;
  for (const PlaneTables* t : tables) largest = std::max(largest, largest_weight(*t));
  std::vector<RdCurve> curves;
  for (const PlaneTables* t : tables) {
    const auto own = rd_curves(*t, surface_weights(*t), largest > 0 ? largest_weight(*t) / largest : 1);
    curves.insert(curves.end(), own.begin(), own.end());
  }
  const std::vector<std::uint32_t> ways = spend_bytes(curves, budget);
  Rungs out;
  std::size_t k = 0;
  for (const PlaneTables* t : tables) {
    std::vector<std::uint16_t> stored = t->order;
    std::sort(stored.begin(), stored.end());
    out.emplace_back(t->fragment_count(), kSkipped);
    for (const std::uint16_t f : stored)
      out.back()[f] = static_cast<std::int16_t>(static_cast<int>(ways[k++]) - 1);
  }
  return out;
}

/// White where nothing is.
Pixels picture_of(const Picture& picture) {
  Pixels out = encode_srgb(picture);
  for (std::size_t k = 0; k < picture.covered.size(); ++k)
    if (!picture.covered[k])
      std::fill_n(out.data.begin() + static_cast<std::ptrdiff_t>(3 * k), 3, std::uint8_t{255});
  return out;
}

/// The budget is what one quality everywhere takes.
std::vector<Chosen> choices_of(const std::vector<const PlaneTables*>& tables,
                               const AllocationStudyOptions& options) {
  std::vector<Chosen> out{{"source", {}}, {"uniform", uniform_rungs(tables, options.quality)}};
  const std::uint64_t budget = bytes_of(tables, out[1].rungs);
  out.push_back({"variable (3.2)", variable_rungs(tables, 0, options.width, budget)});
  out.push_back({"variable (log)", variable_rungs(tables, 1, options.width, budget)});
  out.push_back({"rate-distortion", bought_rungs(tables, budget)});
  return out;
}

std::vector<RenderMaterial> lit_materials(const std::vector<Material>& materials, const Shown& shown) {
  std::vector<RenderMaterial> out;
  for (std::size_t m = 0; m < materials.size(); ++m)
    out.push_back(render_material(materials[m], [&](const TextureRef&, TextureUse use) {
      return use == TextureUse::kBaseColour ? shown.of_material[m] : -1;
    }));
  return out;
}

std::vector<Visibility> views_of(const RenderScene& scene, const AllocationStudyOptions& options,
                                 const RunContext& context) {
  if (scene.mesh->positions.empty()) throw StageError("allocation study", "mesh", "positions", "none");
  const BoundingSphere sphere = bounding_sphere(scene.mesh->positions);
  std::vector<Visibility> views;
  for (int v = 0; v < options.views; ++v)
    views.push_back(look(scene, perspective_camera(camera_of(v, options.views, sphere.centre, sphere.radius)),
                         static_cast<std::uint32_t>(options.size_px), context));
  return views;
}

/// What is the same for all choices.
struct StudyScene {
  const Shown& shown;
  const Fragments& fragments;
  const std::vector<Pixels>& pixels;
  const Ladder& ladder;
  const Previews& previews;
};

std::vector<RenderTexture> textures_of(const StudyScene& scene, const Chosen& choice,
                                       const RunContext& context) {
  std::vector<RenderTexture> textures;
  for (std::size_t p = 0; p < scene.shown.planes.size(); ++p) {
    const std::size_t index = scene.shown.planes[p];
    const TexturePlane& plane = scene.fragments.planes[index];
    const Pixels& whole = scene.pixels.at(index);
    textures.push_back(texture_of(choice.rungs.empty()
                                      ? whole
                                      : compose(plane, whole, scene.ladder.planes.at(index),
                                                scene.previews.planes.at(index), choice.rungs[p], context),
                                  plane, context));
  }
  return textures;
}

/// What a view is compared by.
struct ComparedView {
  LumaPicture luma;
  FlipPicture flip;
};

/// Compares the views with the originals, which the first choice, the source, sets.
void measure_views(const RenderScene& scene, const std::vector<Visibility>& views,
                   const std::vector<RenderTexture>& textures, int picture_view,
                   std::vector<ComparedView>& original, StudiedChoice& result, const RunContext& context) {
  const RenderEnvironment environment = studio_environment();
  const bool first = original.empty();
  PictureDifference luma;
  FlipSum flip;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const Picture picture = shade(scene, views[v], textures, environment, context);
    if (static_cast<int>(v) == picture_view) result.picture = picture_of(picture);
    const ComparedView compared{prepare_luma(picture), prepare_flip(picture)};
    if (first) original.push_back(compared);
    const PictureDifference d = compare_luma(original[v].luma, compared.luma);
    luma.ssim += d.ssim, luma.pixels += d.pixels;
    flip.add(compare_flip(original[v].flip, compared.flip));
  }
  if (luma.pixels == 0) throw StageError("allocation study", "views", "pixels that show the object", "none");
  result.ssim = luma.ssim / static_cast<double>(luma.pixels);
  result.difference = flip.mean();
}

}  // namespace

StudiedChoice described(const std::vector<const PlaneTables*>& tables, const Rungs& rungs) {
  StudiedChoice out;
  out.bytes = bytes_of(tables, rungs);
  double loss = 0, weight = 0;
  for (std::size_t p = 0; p < tables.size(); ++p) {
    const PlaneTables& t = *tables[p];
    for (const std::uint16_t f : t.order) {
      ++out.fragments;
      if (rungs[p][f] == kSkipped) {
        ++out.skipped;
        continue;
      }
      const int q = t.rung_quality[static_cast<std::size_t>(rungs[p][f])];
      out.lowest_quality = out.lowest_quality == 0 ? q : std::min(out.lowest_quality, q);
      out.highest_quality = std::max(out.highest_quality, q);
      out.mean_quality += q;
    }
    double w = 0;
    for (const float v : surface_weights(t)) w += static_cast<double>(v);
    loss += w * surface_dssim(t, rungs[p]);
    weight += w;
  }
  out.surface_ssim = weight > 0 ? 1 - loss / weight : 1;
  if (out.fragments > out.skipped) out.mean_quality /= static_cast<double>(out.fragments - out.skipped);
  return out;
}

Pixels enlarged_preview(const Pixels& preview, std::uint32_t width_px, std::uint32_t height_px,
                        std::uint32_t channels) {
  SamplePatch patch{{0, 0, preview.width_px, preview.height_px}, Samples(channels)};
  for (std::size_t c = 0; c < channels; ++c)
    for (std::size_t i = 0; i < std::size_t{preview.width_px} * preview.height_px; ++i)
      patch.samples[c].push_back(
          preview.data[i * preview.channels + std::min<std::size_t>(c, preview.channels - 1)]);
  const Samples large = scaled_up(patch, bilinear_places(0, width_px, width_px, preview.width_px),
                                  bilinear_places(0, height_px, height_px, preview.height_px));
  Pixels out{width_px, height_px, channels, {}};
  out.data.resize(std::size_t{out.width_px} * out.height_px * out.channels);
  for (std::size_t c = 0; c < channels; ++c)
    for (std::size_t i = 0; i < large[c].size(); ++i) out.data[i * channels + c] = large[c][i];
  return out;
}

std::vector<StudiedChoice> study_allocation(
    const ConditionedMesh& mesh, const std::vector<Material>& materials, const Fragments& fragments,
    const std::vector<Pixels>& pixels, const Ladder& ladder, const Previews& previews,
    const PackageTables& tables, const AllocationStudyOptions& options, const RunContext& context) {
  const Shown shown = shown_planes(materials, fragments);
  std::vector<const PlaneTables*> shown_tables;
  for (const std::size_t p : shown.planes) shown_tables.push_back(&tables.planes.at(p));
  const std::vector<Chosen> choices = choices_of(shown_tables, options);
  RunContext inner = context;
  inner.progress = nullptr;
  const std::vector<RenderMaterial> lit = lit_materials(materials, shown);
  const RenderScene scene = render_scene(mesh.mesh, lit, shown.planes.size());
  const std::vector<Visibility> views = views_of(scene, options, inner);
  std::vector<ComparedView> original;
  std::vector<StudiedChoice> out;
  for (const Chosen& choice : choices) {
    StudiedChoice& result = out.emplace_back();
    if (!choice.rungs.empty()) result = described(shown_tables, choice.rungs);
    result.name = choice.name;
    measure_views(scene, views, textures_of({shown, fragments, pixels, ladder, previews}, choice, inner),
                  options.picture_view, original, result, inner);
    context.report(static_cast<double>(out.size()) / static_cast<double>(choices.size()));
  }
  return out;
}

Pixels side_by_side(const std::vector<const StudiedChoice*>& choices) {
  const std::uint32_t side = choices.at(0)->picture.width_px;
  const auto count = static_cast<std::uint32_t>(choices.size());
  Pixels out{side * count, side, 3, std::vector<std::uint8_t>(std::size_t{side} * count * side * 3)};
  for (std::uint32_t k = 0; k < count; ++k) paste(choices[k]->picture, k * side, 0, out);
  return out;
}

}  // namespace texmesh
