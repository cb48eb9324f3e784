
#include <fmt/format.h>

#include "delivery/cpp/decide/fragment_list.h"
#include "format/rules/viewing.h"
#include "pipeline/io/table.h"
#include "tools/extract/budget/budget_search.h"
#include "tools/extract/proxy/proxy_search.h"

namespace texmesh {
namespace {

constexpr double kExtractDisplayPx = 1000;
constexpr double kDisplayQuality = 90;  // of images that were made smaller
constexpr double kTopQuality = 97;      // of images coded anew from planes that say no quality
/// Names and padding around the notes in a file.
constexpr std::size_t kNotesFrameBytes = 64;

FileImage format_of(const ExtractScale& wishes, bool alpha) {
  if (wishes.images == ExtractImages::kPng) return FileImage::kPng;
  if (wishes.images == ExtractImages::kWebp) return FileImage::kWebp;
  if (wishes.images == ExtractImages::kAvif) return FileImage::kAvif;
  return alpha ? FileImage::kPng : FileImage::kJpeg;
}

/// A scale with whole textures: run() makes the file.
class ScaleExtraction {
 public:
  ScaleExtraction(PackageReader& package, const ExtractScale& wishes, const RunContext& context)
      : package_(package), wishes_(wishes), context_(context), manifest_(package.manifest()) {}

  Extracted run(const OutputTransform& place) {
    const bool has_levels = wishes_.form == ExtractScale::Form::kLevels;
    Extracted out;
    out.scale = wanted_scale();
    require_rung(package_, wishes_.rung);
    out.triangles = scale_entry(out.scale).triangles;
    out.levels = has_levels ? levels_of(manifest_, out.scale) : std::vector<int>{out.scale};
    StandaloneGlb file = scale_file(package_, out.scale, context_);
    if (has_levels) file.begin_levels(screen_coverage_of(manifest_, out.levels, 0));
    for (std::size_t l = 1; l < out.levels.size(); ++l)
      file.add_level(scale_file(package_, out.levels[l], context_),
                     screen_coverage_of(manifest_, out.levels, l));
    if (wishes_.form == ExtractScale::Form::kPlain) file = plain_file(file, mesh_path(out.scale), context_);
    file.place(place);
    const std::map<std::uint32_t, std::uint32_t> planes = shown_planes();
    const std::vector<std::uint32_t> used = file.source_images();
    std::map<std::uint32_t, FileImageData> images;
    for (const PackageImage& image : package_images(package_)) {
      if (std::find(used.begin(), used.end(), image.image) == used.end()) continue;
      images[image.image] = image_file(image, planes.at(image.plane), out.images.emplace_back());
      context_.report(static_cast<double>(images.size()) / static_cast<double>(used.size() + 1));
    }
    file.set_images(images);
    file.set_about(transformed_about(package_.about(), place));
    out.glb = file.finish();
    out.mesh_bytes = out.glb.size();
    for (const ExtractedImage& i : out.images) out.mesh_bytes -= i.bytes;
    return out;
  }

 private:
  const ManifestScale& scale_entry(int scale) const { return manifest_.scales[package_.scale_index(scale)]; }

  int wanted_scale() const {
    if (wishes_.scale) return scale_entry(*wishes_.scale).scale;
    if (wishes_.form == ExtractScale::Form::kLevels && wishes_.display_px <= 0) return 0;
    return select_scale(manifest_, wishes_.display_px > 0 ? wishes_.display_px : kExtractDisplayPx);
  }

  /// The plane that stands for a full-size one: itself, or where a displayed height is given and no rung, the
  /// smallest mip that has a texel for every pixel.
  std::map<std::uint32_t, std::uint32_t> shown_planes() const {
    std::map<std::uint32_t, std::uint32_t> out;
    const bool by_display = wishes_.display_px > 0 && wishes_.rung == kBestRung;
    for (const PlaneChoice& c :
         by_display ? planes_for_display(package_, wishes_.display_px) : full_size(package_))
      out[c.base] = c.plane;
    return out;
  }

  double quality_of_rung(std::uint32_t plane) const {
    const PlaneTables& t = package_.tables().planes[plane];
    if (t.rung_quality.empty()) return kTopQuality;
    return t.rung_quality[std::min<std::size_t>(wishes_.rung, t.rung_count() - 1)];
  }

  /// A plane at full size, or from it the size of a mip: the full-size plane has better rungs than any mip.
  Pixels fragment_texels(const PackageImage& image, std::uint32_t plane) const {
    Pixels pixels = read_plane(package_, image.plane, wishes_.rung, context_);
    if (plane == image.plane) return pixels;
    const TextureInfo& mip = package_.textures()[plane];
    const Averaging kind = image.averaging();
    return reduced(pixels, pixels.width_px, pixels.height_px, std::min(mip.width_px, pixels.width_px),
                   std::min(mip.height_px, pixels.height_px), kind,
                   kind == Averaging::kLight ? kSharpening : 0.f);
  }

  /// Which texels S_0 shows of an image; S_0 is read when it is first asked for.
  std::vector<std::uint8_t> shown(const PackageImage& image) {
    if (!finest_) finest_ = read_model(scale_file(package_, 0, context_), mesh_path(0), context_);
    return shown_texels(finest_->mesh, *finest_, image.image, image.width_px, image.height_px);
  }

  /// The coefficients that the package has of a plane.
  FileImageData coefficient_file(const PackageImage& image, ExtractedImage& row) {
    const std::size_t rung =
        std::min<std::size_t>(wishes_.rung, package_.tables().planes.at(image.plane).rung_count() - 1);
    JoinedJpeg joined = joined_plane(package_, image.plane, rung, context_);
    joined.fill_unseen(shown(image));
    row.width_px = joined.width_px();
    row.height_px = joined.height_px();
    row.quality = quality_of_rung(image.plane);
    return {FileImage::kJpeg, joined.file()};
  }

  /// From texels: at the quality of the package where the size is the package's.
  FileImageData coded_file(const PackageImage& image, std::uint32_t plane, ExtractedImage& row) const {
    Pixels pixels = fragment_texels(image, plane);
    if (image.alpha_plane) {
      const Pixels alpha = read_plane(package_, *image.alpha_plane, wishes_.rung, context_);
      if (alpha.width_px < pixels.width_px || alpha.height_px < pixels.height_px)
        throw FormatError(kTexturesPath, "alpha", "a plane as large as its colours", "a smaller one");
      pixels = with_alpha(pixels, reduced(alpha, alpha.width_px, alpha.height_px, pixels.width_px,
                                          pixels.height_px, Averaging::kNumbers));
    }
    row.width_px = pixels.width_px;
    row.height_px = pixels.height_px;
    row.quality = row.format == FileImage::kPng ? 100
                  : plane != image.plane        ? kDisplayQuality
                                                : quality_of_rung(plane);
    return {row.format, encode_image(pixels, {row.format, row.quality, !image.colours, false})};
  }

  FileImageData image_file(const PackageImage& image, std::uint32_t plane, ExtractedImage& row) {
    row.image = image.image;
    row.role = image.role;
    row.format = format_of(wishes_, image.alpha_plane.has_value());
    const bool coefficients = plane == image.plane && !image.alpha_plane &&
                              format_of(wishes_, false) == FileImage::kJpeg &&
                              package_.textures()[plane].codec == Codec::kJpeg;
    FileImageData file = coefficients ? coefficient_file(image, row) : coded_file(image, plane, row);
    row.bytes = file.bytes.size();
    return file;
  }

  PackageReader& package_;
  const ExtractScale& wishes_;
  const RunContext& context_;
  const Manifest& manifest_;
  std::optional<Model> finest_;
};

}  // namespace

std::vector<Extracted> extract_files(PackageReader& package, const ExtractRequest& request,
                                     const RunContext& context) {
  const About& about = package.about();
  const OutputTransform place =
      output_transform(about, request.recentre ? Vec3d{} : package.manifest().origin, request.keep_units);
  const nlohmann::ordered_json notes = placed_notes(package.annotations(), place);
  // In a file for a number of bytes they may take a twentieth, as the words about the object.
  const std::uint64_t room = notes.empty() ? 0 : notes.dump().size() + kNotesFrameBytes;
  const auto holds_notes = [room](std::uint64_t bytes) {
    return room > 0 && (bytes == 0 || room <= bytes / 20);
  };
  std::vector<Extracted> out;
  if (const auto* scale = std::get_if<ExtractScale>(&request.file))
    out.push_back(ScaleExtraction(package, *scale, context).run(place));
  else if (const auto* proxy = std::get_if<ExtractProxy>(&request.file))
    out.push_back(extract_proxy(package, *proxy, place, context));
  else {
    ExtractBudget budget = std::get<ExtractBudget>(request.file);
    for (std::uint64_t& bytes : budget.bytes)
      if (holds_notes(bytes)) bytes -= room;
    out = extract_within_bytes(package, budget, place, context);
  }
  const About words = transformed_about(about, place);
  const std::string units = units_note(about, place);
  for (std::size_t i = 0; i < out.size(); ++i) {
    Extracted& file = out[i];
    if (!units.empty()) file.notes.push_back(units);
    if (std::ranges::count(file.images, FileImage::kAvif, &ExtractedImage::format) > 0)
      file.notes.emplace_back(
          "images are AVIF (EXT_texture_avif): three.js, <model-viewer>, Babylon.js and glTF-Transform read them, "
          "Blender does not");
    const std::size_t before = file.glb.size();
    if (file.asked_bytes > 0 && !add_words(file.glb, words, file.asked_bytes))
      file.notes.emplace_back(
          "the bytes do not hold all that is known of the object; texmesh dump PKG about prints it");
    if (file.asked_bytes > 0) file.asked_bytes = std::get<ExtractBudget>(request.file).bytes[i];
    if (holds_notes(file.asked_bytes))
      add_notes(file.glb, notes);
    else if (room > 0)
      file.notes.emplace_back("the bytes do not hold the notes; texmesh dump PKG annotations prints them");
    file.mesh_bytes += file.glb.size() - before;
  }
  return out;
}

Extracted extract_model(PackageReader& package, const ExtractRequest& request, const RunContext& context) {
  return std::move(extract_files(package, request, context).front());
}

DocumentSchema extract_schema() {
  Json body = schema_of<Extracted>();
  body["dependencies"] = {
      {"asked_bytes", Json::array({"within", "difference", "mesh_difference", "views", "side_px"})},
      {"within", Json::array({"asked_bytes"})}};
  return document_schema(
      "extract.v1", "texmesh extract report, version 1",
      "Output of `texmesh extract PKG -o GLB --json`: what the file holds and how it was chosen. Several numbers "
      "for --bytes give one such object for each file, a line each.",
      body);
}

std::string extract_text(const Extracted& e) {
  std::string text = fmt::format(
      "{}: {} bytes, {} with {} triangles", printable(e.name), grouped(e.glb.size()),
      e.proxy ? fmt::format("proxy {}", *e.proxy) : fmt::format("S_{}", e.scale), grouped(e.triangles));
  for (std::size_t l = 1; l < e.levels.size(); ++l)
    text += fmt::format("{} S_{}", l == 1 ? ", levels" : ",", e.levels[l]);
  const bool is_whole_proxy = e.proxy && e.images.empty();
  text +=
      is_whole_proxy ? ", as the package has it\n" : fmt::format("; mesh {} bytes\n", grouped(e.mesh_bytes));
  for (const ExtractedImage& i : e.images) {
    text += fmt::format("  image {}, {}: {} x {} px, {}", i.image, i.role, i.width_px, i.height_px,
                        enum_name(i.format));
    if (i.format != FileImage::kPng) text += fmt::format(" of quality {:.0f}", i.quality);
    text += fmt::format(", {} bytes\n", grouped(i.bytes));
  }
  if (e.asked_bytes > 0)
    text += fmt::format("difference to the package's best (FLIP of lit pictures {}): {:.4f}{}\n",
                        e.views > 0 ? fmt::format("of {} px, {} views", e.side_px, e.views)
                                    : fmt::format("predicted by the package's tables for {} px", e.side_px),
                        e.difference,
                        e.proxy ? "" : fmt::format("; of the mesh alone {:.4f}", e.mesh_difference));
  if (!e.within)
    text += fmt::format("{} bytes cannot be kept: this is the smallest file that the package gives\n",
                        grouped(e.asked_bytes));
  for (const std::string& n : e.notes) text += "note: " + n + "\n";
  return text;
}

}  // namespace texmesh
