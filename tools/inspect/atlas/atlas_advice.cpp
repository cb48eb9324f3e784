#include "tools/inspect/atlas/atlas_advice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/io/text_table.h"

namespace texmesh {
namespace {

constexpr double kManyFloorTriangles = 1500;  // a first picture of some 10 kB has no more
constexpr double kMuchThin = 0.05, kLittleCover = 0.5, kMuchOverlap = 0.01, kWideSpread = 4, kMuchStretch = 2;
constexpr double kVisibleSeams = 5;     // mean CIE difference; 2.3 can just be seen in flat colours
constexpr double kBeyondTexture = 1.5;  // so many times what the texture has anyway
constexpr double kManyBroken = 0.002;   // of the triangles, or of the surface
constexpr double kGoodCover = 0.75;     // what a packer reaches with charts of ordinary shapes
constexpr double kJustSeen = 2.3;

std::string percents(double share) { return fixed(100 * share, share < 0.0995 ? 1 : 0) + " %"; }

AtlasAdvice about_charts(const AtlasDiagnosis& d) {
  std::uint64_t small = 0;
  for (const AtlasFigures& a : d.report.atlases) small += a.small_charts;
  return {
      "charts", "",
      fmt::format(
          "The texture is cut into {} charts; {} of them have at most {} triangles. A mesh that keeps "
          "every chart beside its neighbours has at least {} triangles, about {} kB, however small the "
          "object is shown. In coarser meshes charts are lost, and the texture tears.",
          grouped(d.charts()), grouped(small), kSmallChart, grouped(d.triangle_floor()),
          kilobytes(d.floor_bytes())),
      "Make a new atlas with fewer and larger charts: remove loose specks, close holes and smooth noise first, "
      "because unwrappers cut at creases; then unwrap the finished mesh and bake the texture onto it."};
}

AtlasAdvice about_thin(const AtlasFigures& a, const std::string& name) {
  return {
      "thin", name,
      fmt::format(
          "{} of the charts' texels lie in {} charts that are thinner than {} texels. Such charts "
          "mix with their surroundings where the texture is shown smaller, and in every block of a JPEG.",
          percents(a.thin_share), grouped(a.thin_charts), kThinTexels),
      "Join thin charts with their neighbours: raise the unwrapper's least chart size, or its limit for the "
      "angle at which it cuts."};
}

AtlasAdvice about_cover(const AtlasFigures& a, const std::string& name) {
  const double shrink = std::sqrt(a.cover / kGoodCover);
  return {
      "cover", name,
      fmt::format("Only {} of the texels are shown. The others take memory on every display, and bytes.",
                  percents(a.cover)),
      fmt::format("Pack the charts again, 4 texels apart: {:.0f} x {:.0f} px hold what {} x {} px hold now.",
                  std::ceil(a.width_px * shrink), std::ceil(a.height_px * shrink), a.width_px, a.height_px)};
}

AtlasAdvice about_overlap(const AtlasFigures& a, const std::string& name) {
  return {
      "overlap", name,
      fmt::format("{} of the shown texels are shown at two or more places of the surface. That is right for "
                  "tiles and for mirrored halves, and wrong for a scan: one place has the other's colours.",
                  percents(a.overlap)),
      "Where the object was scanned, unwrap it again without overlaps and bake the texture again."};
}

AtlasAdvice about_density(const AtlasFigures& a, const std::string& name) {
  return {"density", name,
          fmt::format(
              "The finest twentieth of the surface has {} times as many texels per length as the coarsest "
              "twentieth. The fine parts cost bytes that nobody sees beside the coarse ones.",
              shortest(a.density_spread(), 3)),
          "Scale the charts to one density when packing, or on purpose: more for a face than for a base."};
}

AtlasAdvice about_stretch(const AtlasFigures& a, const std::string& name) {
  return {"stretch", name,
          fmt::format(
              "On a twentieth of the surface texels are more than {} times as long as wide. Details smear "
              "along them.",
              shortest(a.stretch.p95, 2)),
          "Cut strongly curved charts once more, or let the unwrapper relax them with a limit for stretch."};
}

AtlasAdvice about_seams(const AtlasFigures& a, const std::string& name) {
  return {
      "seams", name,
      fmt::format(
          "Colours on both sides of seams differ by {} in the mean and {} along the worst twentieth (CIE "
          "1976; {} can just be seen), and by {} from one texel to the next. Seams show as lines.",
          shortest(a.seam_colours->mean, 2), shortest(a.seam_colours->p95, 2), kJustSeen,
          shortest(a.seam_colours->inside, 2)),
      "Let the texturing equalise exposures and blend photos across charts, and continue each chart's colours "
      "some 4 texels beyond its border."};
}

AtlasAdvice about_flat(const AtlasFigures& a, const std::string& name) {
  return {
      "flat", name,
      fmt::format(
          "{} triangles, {} of the surface, have no area on the texture: they show single texels or lines.",
          grouped(a.flat_triangles), percents(a.flat_surface)),
      "Unwrap these triangles, or remove them when they are slivers of the reconstruction."};
}

AtlasAdvice about_folded(const AtlasFigures& a, const std::string& name) {
  return {"folded", name,
          fmt::format(
              "{} triangles are folded over inside their charts and show their neighbours' texels mirrored.",
              grouped(a.folded_triangles)),
          "Unwrap the charts again with a method that forbids flips."};
}

AtlasAdvice about_far(const AtlasFigures& a, const std::string& name) {
  return {"far", name,
          fmt::format(
              "{} triangles lie too far out on the texture, or over too many of its tiles, to be measured.",
              grouped(a.far_triangles)),
          "Look at their texture coordinates: these are tiles or faults, not an atlas."};
}

void advise_on(const AtlasFigures& a, const std::string& name, std::vector<AtlasAdvice>& out) {
  const double broken = kManyBroken * static_cast<double>(a.triangles);
  if (a.thin_share > kMuchThin) out.push_back(about_thin(a, name));
  if (a.cover < kLittleCover) out.push_back(about_cover(a, name));
  if (a.overlap > kMuchOverlap) out.push_back(about_overlap(a, name));
  if (a.seam_colours && a.seam_colours->mean > kVisibleSeams &&
      a.seam_colours->mean > kBeyondTexture * a.seam_colours->inside)
    out.push_back(about_seams(a, name));
  if (a.density_spread() > kWideSpread) out.push_back(about_density(a, name));
  if (a.stretch.p95 > kMuchStretch) out.push_back(about_stretch(a, name));
  if (a.flat_surface > kManyBroken) out.push_back(about_flat(a, name));
  if (static_cast<double>(a.folded_triangles) > broken) out.push_back(about_folded(a, name));
  if (a.far_triangles > 0) out.push_back(about_far(a, name));
}

}  // namespace

std::vector<AtlasAdvice> advise(const AtlasDiagnosis& d) {
  std::vector<AtlasAdvice> out;
  if (static_cast<double>(d.triangle_floor()) > kManyFloorTriangles) out.push_back(about_charts(d));
  for (std::size_t a = 0; a < d.report.atlases.size(); ++a) advise_on(d.report.atlases[a], d.names[a], out);
  return out;
}

std::string reason_for_none(const AtlasSubject& subject) {
  const bool textures = std::ranges::any_of(subject.materials, [](const Material& m) {
    bool used = false;
    for_each_texture(m, [&](const TextureRef& t) { used |= t.used(); });
    return used;
  });
  if (!textures) return "No material has a texture, so there is no atlas to look at.";
  if (subject.mesh.uv0.empty() && subject.mesh.uv1.empty())
    return "The materials have textures, but the mesh has no texture coordinates: nothing of the textures is "
           "shown, and there is no atlas to look at.";
  return "No triangle shows a texture, so there is no atlas to look at.";
}

}  // namespace texmesh
