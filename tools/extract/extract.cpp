
#include <fmt/format.h>

#include "delivery/cpp/decide/fragment_list.h"
#include "format/rules/viewing.h"
#include "pipeline/about/gltf_about.h"
#include "pipeline/io/record.h"
#include "pipeline/io/table.h"
#include "tools/extract/budget/budget_search.h"
#include "tools/extract/glb/scale_file.h"
#include "tools/extract/proxy/proxy_search.h"

namespace texmesh {

constexpr double kMostGlbBytes = 4294967295;  // of a GLB

template <>
struct EnumNames<FileImage> {
  static constexpr std::array<std::string_view, 3> names{"jpeg", "webp", "png"};
};
template <>
struct RecordFields<ExtractedImage> {
  static void fields(auto& s, auto&& v) {
    v("image", s.image, "Number of the source image: texture/<image>.");
    v("role", s.role, "As in textures.json.");
    v("format", s.format, "");
    v("width_px", s.width_px, Range{1, 65536}, "");
    v("height_px", s.height_px, Range{1, 65536}, "");
    v("quality", s.quality, Range{0, 100}, "Of the coder; 100 for png.");
    v("bytes", s.bytes, Range{1, kMostGlbBytes}, "");
  }
};

namespace {

constexpr double kExtractDisplayPx = 1000;
constexpr double kDisplayQuality = 90;  // of images that were made smaller
constexpr double kTopQuality = 97;      // of images coded anew from planes that say no quality

const ManifestScale& scale_entry(PackageReader& package, int scale) {
  return package.manifest().scales[package.scale_index(scale)];
}

int wanted_scale(PackageReader& package, const ExtractScale& wishes) {
  if (wishes.scale) return scale_entry(package, *wishes.scale).scale;
  if (wishes.form == ExtractScale::Form::kLevels && wishes.display_px <= 0) return 0;
  return select_scale(package.manifest(), wishes.display_px > 0 ? wishes.display_px : kExtractDisplayPx);
}

/// The plane that stands for a full-size one: itself, or where a displayed height is given and no rung, the
/// smallest mip that has a texel for every pixel.
std::map<std::uint32_t, std::uint32_t> shown_planes(PackageReader& package, const ExtractScale& wishes) {
  std::map<std::uint32_t, std::uint32_t> out;
  const bool by_display = wishes.display_px > 0 && wishes.rung == kBestRung;
  for (const PlaneChoice& c :
       by_display ? planes_for_display(package, wishes.display_px) : full_size(package))
    out[c.base] = c.plane;
  return out;
}

FileImage format_of(const ExtractScale& wishes, bool alpha) {
  if (wishes.images == ExtractImages::kPng) return FileImage::kPng;
  if (wishes.images == ExtractImages::kWebp) return FileImage::kWebp;
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
bool takes_coefficients(PackageReader& package, const ExtractScale& wishes, const PackageImage& image,
                        std::uint32_t plane) {
  return plane == image.plane && !image.alpha_plane && format_of(wishes, false) == FileImage::kJpeg &&
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

FileImageData coefficient_file(PackageReader& package, const ExtractScale& wishes, const PackageImage& image,
                               ShownTexels& shown, const RunContext& context, ExtractedImage& row) {
  const std::uint32_t plane = image.plane;
  const std::size_t rung =
      std::min<std::size_t>(wishes.rung, package.tables().planes.at(plane).rung_count() - 1);
  JoinedJpeg joined = joined_plane(package, plane, rung, context);
  joined.fill_unseen(shown.of(image));
  row.width_px = joined.width_px();
  row.height_px = joined.height_px();
  row.quality = quality_of_rung(package, plane, wishes.rung);
  return {FileImage::kJpeg, joined.file()};
}

/// From texels: at the quality of the package where the size is the package's.
FileImageData coded_file(PackageReader& package, const ExtractScale& wishes, const PackageImage& image,
                         std::uint32_t plane, const RunContext& context, ExtractedImage& row) {
  Pixels pixels = fragment_texels(package, image.plane, plane, wishes.rung, image.averaging(), context);
  if (image.alpha_plane) {
    const Pixels alpha = read_plane(package, *image.alpha_plane, wishes.rung, context);
    if (alpha.width_px < pixels.width_px || alpha.height_px < pixels.height_px)
      throw FormatError(kTexturesPath, "alpha", "a plane as large as its colours", "a smaller one");
    pixels = with_alpha(pixels, reduced(alpha, alpha.width_px, alpha.height_px, pixels.width_px,
                                        pixels.height_px, Averaging::kNumbers));
  }
  row.width_px = pixels.width_px;
  row.height_px = pixels.height_px;
  row.quality = row.format == FileImage::kPng ? 100
                : plane != image.plane        ? kDisplayQuality
                                              : quality_of_rung(package, plane, wishes.rung);
  return {row.format, encode_image(pixels, {row.format, row.quality, !image.colours, false})};
}

FileImageData image_file(PackageReader& package, const ExtractScale& wishes, const PackageImage& image,
                         const std::map<std::uint32_t, std::uint32_t>& planes, ShownTexels& shown,
                         const RunContext& context, ExtractedImage& row) {
  const std::uint32_t plane = planes.at(image.plane);
  row.image = image.image;
  row.role = image.role;
  row.format = format_of(wishes, image.alpha_plane.has_value());
  FileImageData file = takes_coefficients(package, wishes, image, plane)
                           ? coefficient_file(package, wishes, image, shown, context, row)
                           : coded_file(package, wishes, image, plane, context, row);
  row.bytes = file.bytes.size();
  return file;
}

Extracted extract_scale(PackageReader& package, const ExtractScale& wishes, bool recentre,
                        const RunContext& context) {
  const bool has_levels = wishes.form == ExtractScale::Form::kLevels;
  const Manifest& m = package.manifest();
  Extracted out;
  out.scale = wanted_scale(package, wishes);
  require_rung(package, wishes.rung);
  out.triangles = scale_entry(package, out.scale).triangles;
  out.levels = has_levels ? levels_of(m, out.scale) : std::vector<int>{out.scale};
  StandaloneGlb file = scale_file(package, out.scale, context);
  if (has_levels) file.begin_levels(screen_coverage_of(m, out.scale));
  for (std::size_t l = 1; l < out.levels.size(); ++l)
    file.add_level(scale_file(package, out.levels[l], context), screen_coverage_of(m, out.levels[l]));
  if (wishes.form == ExtractScale::Form::kPlain) file = plain_file(file, mesh_path(out.scale), context);
  About about = package.about();
  const double unit = wishes.metres && about.metres_per_unit > 0 ? about.metres_per_unit : 1;
  if (unit != 1) about.unit = "m", about.metres_per_unit = 1;
  file.move_to(recentre ? Vec3d{} : m.origin, unit);
  const std::map<std::uint32_t, std::uint32_t> planes = shown_planes(package, wishes);
  const std::vector<std::uint32_t> used = file.source_images();
  std::map<std::uint32_t, FileImageData> images;
  ShownTexels shown(package, context);
  for (const PackageImage& image : package_images(package)) {
    if (std::find(used.begin(), used.end(), image.image) == used.end()) continue;
    images[image.image] =
        image_file(package, wishes, image, planes, shown, context, out.images.emplace_back());
    context.report(static_cast<double>(images.size()) / static_cast<double>(used.size() + 1));
  }
  file.set_images(images);
  file.set_about(about);
  out.glb = file.finish();
  out.mesh_bytes = out.glb.size();
  for (const ExtractedImage& i : out.images) out.mesh_bytes -= i.bytes;
  return out;
}

/// What --json prints.
struct ExtractReport {
  std::string file;
  std::uint64_t bytes = 0;
  int scale = 0;
  std::vector<int> levels;
  std::uint64_t triangles = 0, mesh_bytes = 0;
  std::vector<ExtractedImage> images;
  std::optional<std::uint32_t> proxy;
  std::optional<std::uint64_t> asked_bytes = {};
  std::optional<bool> within = {};
  std::optional<double> difference = {}, mesh_difference = {};
  std::optional<int> views = {};
  std::optional<std::uint32_t> side_px = {};
  std::vector<std::string> notes = {};
  static void fields(auto& s, auto&& v) {
    v("version", Constant{1}, "");
    v("file", s.file, "Name of the GLB, without its folder.");
    v("bytes", s.bytes, Range{20, kMostGlbBytes}, "");
    v("scale", s.scale, Range{0, 99},
      "Number of the finest scale in the file; with `proxy` the package's coarsest one.");
    v("levels", s.levels, FieldRule{.range = Range{0, 99}, .count = Range{1, 100}},
      "Scales of the file, finest first; more than one with --lods.");
    v("triangles", s.triangles, Range{1, kMostGlbBytes}, "Of the finest scale.");
    v("mesh_bytes", s.mesh_bytes, "Everything but the images; of a whole proxy the whole file.");
    v("images", s.images, "");
    v("proxy", s.proxy, Range{0, kMaxPackageProxies - 1},
      "The file is this proxy of the package, or made of it: its mesh coded coarser, its pictures smaller, maps "
      "left out; 0 = the smallest.");
    v("asked_bytes", s.asked_bytes, "--bytes.");
    v("within", s.within,
      "bytes is at most asked_bytes, and at least 98 % of it unless the file has S_0 and all of the source's "
      "JPEG coefficients; otherwise the file is the nearest possible one.");
    v("difference", s.difference, Range{0, 1},
      "Mean FLIP of the file's lit pictures against those of the package's best, over the object's pixels; 0 = "
      "equal.");
    v("mesh_difference", s.mesh_difference, Range{0, 1},
      "The same with the best textures instead: what the mesh alone costs.");
    v("views", s.views, Range{1, 1000}, "Directions from which it was measured.");
    v("side_px", s.side_px, Range{1, 65536}, "Side of those pictures.");
    v("notes", s.notes, "");
  }
};

}  // namespace

std::vector<Extracted> extract_files(PackageReader& package, const ExtractRequest& request,
                                     const RunContext& context) {
  std::vector<Extracted> out;
  if (const auto* scale = std::get_if<ExtractScale>(&request.file))
    out.push_back(extract_scale(package, *scale, request.recentre, context));
  else if (const auto* proxy = std::get_if<ExtractProxy>(&request.file))
    out.push_back(extract_proxy(package, *proxy, request.recentre, context));
  else
    out = extract_within_bytes(package, std::get<ExtractBudget>(request.file), request.recentre, context);
  for (Extracted& file : out)
    if (file.asked_bytes > 0 &&
        about_within(package.about(), file.asked_bytes / kAboutShare) != package.about())
      file.notes.emplace_back(
          "the file is too small for all that is known of the object; see dump PKG about");
  return out;
}

Extracted extract_model(PackageReader& package, const ExtractRequest& request, const RunContext& context) {
  return std::move(extract_files(package, request, context).front());
}

std::string extract_json(const Extracted& e, const std::string& file) {
  ExtractReport out{file, e.glb.size(), e.scale, e.levels, e.triangles, e.mesh_bytes, e.images, e.proxy};
  if (e.asked_bytes > 0) {
    out.asked_bytes = e.asked_bytes;
    out.within = e.within;
    out.difference = e.difference;
    out.mesh_difference = e.mesh_difference;
    out.views = e.views;
    out.side_px = e.side_px;
  }
  out.notes = e.notes;
  return to_json(out).dump();
}

DocumentSchema extract_schema() {
  Json body = schema_of<ExtractReport>();
  body["dependencies"] = {
      {"asked_bytes", Json::array({"within", "difference", "mesh_difference", "views", "side_px"})},
      {"within", Json::array({"asked_bytes"})}};
  return document_schema(
      "extract.v1", "texmesh extract report, version 1",
      "Output of `texmesh extract PKG -o GLB --json`: what the file holds and how it was chosen. Several numbers "
      "for --bytes give one such object for each file, a line each.",
      body);
}

std::string extract_text(const Extracted& e, const std::string& file) {
  std::string text = fmt::format("{}: {} bytes, {} with {} triangles", file, grouped(e.glb.size()),
                                 e.proxy ? fmt::format("proxy {}", *e.proxy) : fmt::format("S_{}", e.scale),
                                 grouped(e.triangles));
  for (std::size_t l = 1; l < e.levels.size(); ++l)
    text += fmt::format("{} S_{}", l == 1 ? ", levels" : ",", e.levels[l]);
  text += fmt::format("; mesh {} bytes\n", grouped(e.mesh_bytes));
  for (const ExtractedImage& i : e.images) {
    text += fmt::format("  image {}, {}: {} x {} px, {}", i.image, i.role, i.width_px, i.height_px,
                        enum_name(i.format));
    if (i.format != FileImage::kPng) text += fmt::format(" of quality {:.4g}", i.quality);
    text += fmt::format(", {} bytes\n", grouped(i.bytes));
  }
  if (e.asked_bytes > 0)
    text += fmt::format(
        "difference to the package's best (FLIP of lit pictures, {} views of {} px): {:.4f}; of the mesh alone "
        "{:.4f}\n",
        e.views, e.side_px, e.difference, e.mesh_difference);
  if (!e.within)
    text += fmt::format(
        "{} bytes cannot be reached within 2 %: this is the nearest file that the package gives\n",
        grouped(e.asked_bytes));
  for (const std::string& n : e.notes) text += "note: " + n + "\n";
  return text;
}

}  // namespace texmesh
