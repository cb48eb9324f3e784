#include "tools/extract/extract.h"

#include <algorithm>
#include <map>
#include <optional>

#include "delivery/cpp/decide/fragment_list.h"
#include "format/container/layout.h"
#include "format/rules/viewing.h"
#include "pipeline/about/gltf_about.h"
#include "tools/extract/budget/budget_search.h"
#include "tools/extract/glb/scale_file.h"
#include "tools/extract/glb/standalone_glb.h"
#include "tools/extract/glb/texture_source.h"
#include "tools/extract/proxy/proxy_search.h"

namespace texmesh {
namespace {

constexpr double kExtractDisplayPx = 1000;
constexpr double kDisplayQuality = 90;  // of images that were made smaller
constexpr double kTopQuality = 97;      // of images coded anew from planes that say no quality

const ManifestScale& scale_entry(PackageReader& package, int scale) {
  return package.manifest().scales[package.scale_index(scale)];
}

int wanted_scale(PackageReader& package, const ExtractRequest& request) {
  if (request.scale) return scale_entry(package, *request.scale).scale;
  if (request.lods && request.display_px <= 0) return 0;
  return select_scale(package.manifest(), request.display_px > 0 ? request.display_px : kExtractDisplayPx);
}

/// The plane that stands for a full-size one: itself, or where a displayed height is given and no rung, the
/// smallest mip that has a texel for every pixel.
std::map<std::uint32_t, std::uint32_t> shown_planes(PackageReader& package, const ExtractRequest& request) {
  std::map<std::uint32_t, std::uint32_t> out;
  const bool by_display = request.display_px > 0 && request.rung == kBestRung;
  for (const PlaneChoice& c :
       by_display ? planes_for_display(package, request.display_px) : full_size(package))
    out[c.base] = c.plane;
  return out;
}

FileImage format_of(const ExtractRequest& request, bool alpha) {
  if (request.images == ExtractImages::kPng) return FileImage::kPng;
  if (request.images == ExtractImages::kWebp) return FileImage::kWebp;
  return alpha ? FileImage::kPng : FileImage::kJpeg;
}

double quality_of_rung(PackageReader& package, std::uint32_t plane, std::uint32_t rung) {
  const PlaneTables& t = package.tables().planes[plane];
  if (t.rung_quality.empty()) return kTopQuality;
  return t.rung_quality[std::min<std::size_t>(rung, t.rung_count() - 1)];
}

/// A plane at full size, or from it the size of a mip: the full-size plane has better rungs than any mip.
Pixels fragment_texels(PackageReader& package, std::uint32_t base, std::uint32_t plane, std::uint32_t rung,
                       Averaging kind, const RunContext& context) {
  Pixels pixels = read_plane(package, base, rung, context);
  if (plane == base) return pixels;
  const TextureInfo& mip = package.textures()[plane];
  return reduced(pixels, pixels.width_px, pixels.height_px, std::min(mip.width_px, pixels.width_px),
                 std::min(mip.height_px, pixels.height_px), kind,
                 kind == Averaging::kLight ? kSharpening : 0.f);
}

/// Whether a file's image can be the coefficients that the package has of a plane.
bool takes_coefficients(PackageReader& package, const ExtractRequest& request, const PackageImage& image,
                        std::uint32_t plane) {
  return plane == image.plane && !image.alpha_plane && format_of(request, false) == FileImage::kJpeg &&
         package.textures()[plane].codec == Codec::kJpeg;
}

/// Which texels of an image S_0 shows; S_0 is read when it is first asked for.
class ShownTexels {
 public:
  ShownTexels(PackageReader& package, const RunContext& context) : package_(package), context_(context) {}
  std::vector<std::uint8_t> of(const PackageImage& image) {
    if (!finest_) finest_ = read_model(scale_file(package_, 0, context_), mesh_path(0), context_);
    return shown_texels(finest_->mesh, *finest_, image.image, image.width_px, image.height_px);
  }

 private:
  PackageReader& package_;
  const RunContext& context_;
  std::optional<Model> finest_;
};

FileImageData coefficient_file(PackageReader& package, const ExtractRequest& request,
                               const PackageImage& image, ShownTexels& shown, const RunContext& context,
                               ExtractedImage& row) {
  const std::uint32_t plane = image.plane;
  const std::size_t rung =
      std::min<std::size_t>(request.rung, package.tables().planes.at(plane).rung_count() - 1);
  JoinedJpeg joined = joined_plane(package, plane, rung, context);
  joined.fill_unseen(shown.of(image));
  row.width_px = joined.width_px();
  row.height_px = joined.height_px();
  row.quality = quality_of_rung(package, plane, request.rung);
  return {FileImage::kJpeg, joined.file()};
}

/// From texels: at the quality of the package where the size is the package's.
FileImageData coded_file(PackageReader& package, const ExtractRequest& request, const PackageImage& image,
                         std::uint32_t plane, const RunContext& context, ExtractedImage& row) {
  Pixels pixels = fragment_texels(package, image.plane, plane, request.rung, image.averaging(), context);
  if (image.alpha_plane) {
    const Pixels alpha = read_plane(package, *image.alpha_plane, request.rung, context);
    if (alpha.width_px < pixels.width_px || alpha.height_px < pixels.height_px)
      throw FormatError(kTexturesPath, "alpha", "a plane as large as its colours", "a smaller one");
    pixels = with_alpha(pixels, reduced(alpha, alpha.width_px, alpha.height_px, pixels.width_px,
                                        pixels.height_px, Averaging::kNumbers));
  }
  row.width_px = pixels.width_px;
  row.height_px = pixels.height_px;
  row.quality = row.format == FileImage::kPng ? 100
                : plane != image.plane        ? kDisplayQuality
                                              : quality_of_rung(package, plane, request.rung);
  return {row.format, encode_image(pixels, {row.format, row.quality, !image.colours, false})};
}

FileImageData image_file(PackageReader& package, const ExtractRequest& request, const PackageImage& image,
                         const std::map<std::uint32_t, std::uint32_t>& planes, ShownTexels& shown,
                         const RunContext& context, ExtractedImage& row) {
  const std::uint32_t plane = planes.at(image.plane);
  row.image = image.image;
  row.role = image.role;
  row.format = format_of(request, image.alpha_plane.has_value());
  FileImageData file = takes_coefficients(package, request, image, plane)
                           ? coefficient_file(package, request, image, shown, context, row)
                           : coded_file(package, request, image, plane, context, row);
  row.bytes = file.bytes.size();
  return file;
}

Extracted extract_whole(PackageReader& package, const ExtractRequest& request, const RunContext& context) {
  const Manifest& m = package.manifest();
  Extracted out;
  out.scale = wanted_scale(package, request);
  require_rung(package, request.rung);
  out.triangles = scale_entry(package, out.scale).triangles;
  out.levels = request.lods ? levels_of(m, out.scale) : std::vector<int>{out.scale};
  StandaloneGlb file = scale_file(package, out.scale, context);
  if (request.lods) file.begin_levels(screen_coverage_of(m, out.scale));
  for (std::size_t l = 1; l < out.levels.size(); ++l)
    file.add_level(scale_file(package, out.levels[l], context), screen_coverage_of(m, out.levels[l]));
  if (request.plain) file = plain_file(file, mesh_path(out.scale), context);
  About about = package.about();
  const double unit = request.metres && about.metres_per_unit > 0 ? about.metres_per_unit : 1;
  if (unit != 1) about.unit = "m", about.metres_per_unit = 1;
  file.move_to(request.recentre ? Vec3d{} : m.origin, unit);
  const std::map<std::uint32_t, std::uint32_t> planes = shown_planes(package, request);
  const std::vector<std::uint32_t> used = file.source_images();
  std::map<std::uint32_t, FileImageData> images;
  ShownTexels shown(package, context);
  for (const PackageImage& image : package_images(package)) {
    if (std::find(used.begin(), used.end(), image.image) == used.end()) continue;
    images[image.image] =
        image_file(package, request, image, planes, shown, context, out.images.emplace_back());
    context.report(static_cast<double>(images.size()) / static_cast<double>(used.size() + 1));
  }
  file.set_images(images);
  file.set_about(about);
  out.glb = file.finish();
  out.mesh_bytes = out.glb.size();
  for (const ExtractedImage& i : out.images) out.mesh_bytes -= i.bytes;
  return out;
}

}  // namespace

Extracted extract_model(PackageReader& package, const ExtractRequest& request, const RunContext& context) {
  if (request.proxy) return extract_proxy(package, request, *request.proxy, context);
  if (request.bytes == 0) return extract_whole(package, request, context);
  return std::move(extract_budgets(package, request, {request.bytes}, context).front());
}

std::vector<Extracted> extract_budgets(PackageReader& package, const ExtractRequest& request,
                                       const std::vector<std::uint64_t>& bytes, const RunContext& context) {
  std::vector<Extracted> out = extract_bytes(package, request, bytes, context);
  for (std::size_t k = 0; k < out.size(); ++k)
    if (about_within(package.about(), bytes[k] / kAboutShare) != package.about())
      out[k].notes.emplace_back(
          "the file is too small for all that is known of the object; see dump PKG about");
  return out;
}

}  // namespace texmesh
