#include "tools/extract/glb/texture_source.h"

#include "delivery/cpp/package/package_reader.h"
#include "format/rules/viewing.h"
#include "stages/fill/fill.h"
#include "stages/geometry/texel_coverage.h"
#include "stages/image/avif.h"
#include "stages/image/png_writer.h"
#include "stages/image/webp.h"
#include "stages/jpeg/jpeg_coder.h"
#include "tools/extract/glb/standalone_glb.h"
#include "tools/render/rendered_model.h"

namespace texmesh {
namespace {

std::uint32_t half_of(std::uint32_t side, std::uint32_t times) {
  for (; times > 0; --times) side = (side + 1) / 2;
  return side;
}

bool finite(const std::array<Vec2d, 3>& corners) {
  return std::all_of(corners.begin(), corners.end(),
                     [](Vec2d c) { return std::isfinite(c.x) && std::isfinite(c.y); });
}

void add_triangles(const Mesh& mesh, std::size_t material, const TextureRef& ref, const TexelMap& map,
                   TexelCoverage& coverage) {
  const std::vector<Vec2f>& uv = ref.texcoord == 0 ? mesh.uv0 : mesh.uv1;
  if (uv.empty()) return;
  coverage.set_wrap(ref.wrap_s, ref.wrap_t);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (mesh.triangle_material[t] != material) continue;
    std::array<Vec2d, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) corners[k] = map(uv[mesh.triangles[t][k]]);
    if (finite(corners)) coverage.add(corners);
  }
}

/// A byte of coverage is a row of a block.
void cover_whole_blocks(std::vector<std::uint8_t>& coverage, std::uint32_t width_px,
                        std::uint32_t height_px) {
  constexpr std::uint32_t kSide = 8;
  const std::size_t stride = coverage_stride_bytes(width_px);
  for (std::uint32_t y = 0; y < height_px; y += kSide)
    for (std::size_t x = 0; x < stride; ++x) {
      const std::uint32_t end = std::min(y + kSide, height_px);
      bool any = false;
      for (std::uint32_t row = y; row < end; ++row) any |= coverage[row * stride + x] != 0;
      const std::uint32_t beyond =
          x + 1 == stride ? static_cast<std::uint32_t>(stride * kSide) - width_px : 0;
      const auto whole = static_cast<std::uint8_t>(0xffu << beyond);
      for (std::uint32_t row = y; row < end; ++row) coverage[row * stride + x] = any ? whole : 0;
    }
}

}  // namespace

Averaging PackageImage::averaging() const {
  if (colours) return Averaging::kLight;
  return role == "normal" ? Averaging::kNormals : Averaging::kNumbers;
}

std::vector<PackageImage> package_images(PackageReader& package) {
  const std::vector<TextureInfo>& textures = package.textures();
  std::vector<PackageImage> out;
  for (std::uint32_t p = 0; p < full_size_planes(textures); ++p) {
    const TextureInfo& t = textures[p];
    if (t.role == "alpha" && !out.empty() && out.back().image == t.image) {
      out.back().alpha_plane = p;
      continue;
    }
    PackageImage image;
    image.image = t.image;
    image.plane = p;
    image.role = t.role;
    image.width_px = t.width_px;
    image.height_px = t.height_px;
    image.colours = t.colour_space == "srgb";
    out.push_back(std::move(image));
  }
  return out;
}

TextureSource::TextureSource(PackageReader& package, double most_texels, const RunContext& context,
                             ExtractEffort effort, double least_texels)
    : package_(package),
      context_(context),
      images_(package_images(package)),
      effort_(effort),
      most_texels_(most_texels),
      least_texels_(least_texels),
      unread_(images_.size()) {
  context_.progress = nullptr;
  cut_ = levels_cut(most_texels, least_texels);
}

void TextureSource::leave_unread(std::vector<std::uint32_t> levels) {
  unread_ = std::move(levels);
  cut_ = levels_cut(most_texels_, least_texels_);
}

void TextureSource::set_shown(std::size_t index, std::vector<std::uint8_t> coverage) {
  const PackageImage& image = images_.at(index);
  cover_whole_blocks(coverage, image.width_px, image.height_px);
  if (image.alpha_plane) shown_[*image.alpha_plane] = coverage;
  shown_[image.plane] = std::move(coverage);
}

std::vector<std::uint32_t> TextureSource::levels_cut(double most_texels, double least_texels) const {
  const auto texels_of = [](const PackageImage& i) { return static_cast<double>(i.width_px) * i.height_px; };
  const bool fast = effort_ == ExtractEffort::kFast;
  double texels = 0;
  for (const PackageImage& i : images_)
    if (i.colours || fast) texels += texels_of(i);
  std::uint32_t times = 0;
  for (; texels > most_texels && times < 20; texels /= 4) ++times;
  std::vector<std::uint32_t> out;
  for (const PackageImage& i : images_)
    out.push_back(i.colours || fast ? times : effort_ == ExtractEffort::kUsual ? std::max(times, 1u) - 1 : 0);
  if (effort_ != ExtractEffort::kUsual || unread_.empty()) return out;
  for (std::uint32_t most = std::ranges::max(unread_); most > 0; --most) {
    std::vector<std::uint32_t> cut = out;
    texels = 0;
    for (std::size_t i = 0; i < cut.size(); ++i) {
      cut[i] = std::max(cut[i], std::min(most, unread_[i]));
      texels += texels_of(images_[i]) / std::pow(4.0, cut[i]);
    }
    if (texels >= least_texels) return cut;
  }
  return out;
}

double TextureSource::largest_share(std::size_t index) const {
  return 1.0 / static_cast<double>(1u << cut_[index]);
}

/// Of the package's planes of an image.
std::uint32_t TextureSource::read_level(std::size_t index) const {
  if (effort_ == ExtractEffort::kFast) return cut_[index];
  return effort_ == ExtractEffort::kUsual ? std::max(cut_[index], 1u) - 1 : 0;
}

std::vector<Pixels>& TextureSource::levels(std::size_t index, std::uint32_t plane, Averaging kind) {
  std::vector<Pixels>& levels = planes_[plane];
  if (!levels.empty()) return levels;
  const std::uint32_t skip = cut_[index];
  const TextureInfo& info = package_.textures()[plane];
  const std::uint32_t read = plane_at_level(package_.textures(), plane, read_level(index));
  const auto shown = shown_.find(plane);
  const bool is_shown = shown != shown_.end() && read == plane;
  Pixels full = read_plane(package_, read, kBestRung, context_, is_shown ? &shown->second : nullptr);
  // As pictures read smaller copies of a whole texture: others would differ from the package's best.
  const std::uint32_t halved = skip - package_.textures()[read].mip;
  if (effort_ != ExtractEffort::kBest && full.width_px % (1u << halved) == 0 &&
      full.height_px % (1u << halved) == 0)
    full = coarser_level(std::move(full), kind == Averaging::kLight, halved, context_);
  else if (skip > 0)
    full = reduced(full, full.width_px, full.height_px, half_of(info.width_px, skip),
                   half_of(info.height_px, skip), kind);
  levels.push_back(std::move(full));
  return levels;
}

/// The smallest level that has twice these sides: averaging it again costs no sharpness.
const Pixels& TextureSource::level_for(std::size_t index, std::uint32_t plane, Averaging kind,
                                       std::uint32_t width_px, std::uint32_t height_px) {
  std::vector<Pixels>& from = levels(index, plane, kind);
  for (std::size_t level = 0;; ++level) {
    const Pixels& p = from[level];
    const std::uint32_t half_width = half_of(p.width_px, 1), half_height = half_of(p.height_px, 1);
    if (p.width_px <= 8 || p.height_px <= 8 || half_width < 2 * width_px || half_height < 2 * height_px)
      return p;
    if (level + 1 == from.size())
      from.push_back(reduced(p, p.width_px, p.height_px, half_width, half_height, kind));
  }
}

Pixels TextureSource::plane_texels(std::size_t index, std::uint32_t base, std::uint32_t width_px,
                                   std::uint32_t height_px, const std::vector<std::uint8_t>& coverage,
                                   float sharpening) {
  const Averaging kind = base == images_[index].plane ? images_[index].averaging() : Averaging::kNumbers;
  const Pixels& p = level_for(index, base, kind, width_px, height_px);
  Pixels out = reduced(p, p.width_px, p.height_px, std::min(width_px, p.width_px),
                       std::min(height_px, p.height_px), kind, images_[index].colours ? sharpening : 0.f);
  if (coverage.size() == coverage_size_bytes(out.width_px, out.height_px))
    fill_uncovered(out, coverage, context_);
  return out;
}

Pixels TextureSource::texels(std::size_t index, std::uint32_t width_px, std::uint32_t height_px,
                             const std::vector<std::uint8_t>& coverage, float sharpening) {
  const PackageImage& image = images_.at(index);
  Pixels colours = plane_texels(index, image.plane, width_px, height_px, coverage, sharpening);
  if (!image.alpha_plane) return colours;
  return with_alpha(colours, plane_texels(index, *image.alpha_plane, width_px, height_px, coverage, 0));
}

JoinedJpeg joined_plane(PackageReader& package, std::uint32_t plane, std::size_t rung,
                        const RunContext& context) {
  const TextureInfo& info = package.textures().at(plane);
  const std::string& path = info.rungs.at(rung).path;
  PlaneStreams streams(info.codec, package.tables().planes.at(plane), package.entry(info.tables));
  if (info.codec != Codec::kJpeg) throw FormatError(path, "", "a plane of codec jpeg", "another");
  streams.add_pack(rung, package.entry(info.rungs[rung]));
  JpegFragments fragments{path,
                          info.width_px,
                          info.height_px,
                          info.fragment_width_px,
                          info.fragment_height_px,
                          info.columns,
                          info.channels,
                          {},
                          {}};
  for (std::size_t f = 0; f < package.tables().planes.at(plane).fragment_count(); ++f)
    fragments.stored.push_back(streams.stream(f).empty() ? 0 : 1);
  fragments.file = [&](std::size_t fragment) { return streams.file(fragment); };
  return JoinedJpeg(fragments, context);
}

Pixels with_alpha(const Pixels& colours, const Pixels& alpha) {
  if (colours.width_px != alpha.width_px || colours.height_px != alpha.height_px || alpha.channels != 1)
    throw FormatError(kTexturesPath, "alpha", "a plane as large as its colours", "another");
  return joined_alpha(colours, alpha);
}

Pixels with_alpha_of(const PackageImage& image, const Pixels& colours, const Pixels& alpha) {
  const std::uint32_t width = std::min(colours.width_px, alpha.width_px),
                      height = std::min(colours.height_px, alpha.height_px);
  const auto fitted = [&](const Pixels& p, Averaging kind) {
    return reduced(p, p.width_px, p.height_px, width, height, kind);
  };
  return with_alpha(fitted(colours, image.averaging()), fitted(alpha, Averaging::kNumbers));
}

std::vector<std::uint8_t> shown_texels(const Mesh& mesh, const Model& model, std::uint32_t image,
                                       std::uint32_t width_px, std::uint32_t height_px) {
  TexelCoverage coverage(width_px, height_px, Wrap::kRepeat, Wrap::kRepeat);
  const auto named = std::ranges::find(model.images, image_name(image), &Image::name);
  const auto number = static_cast<std::int32_t>(named - model.images.begin());
  bool known = false;
  for (std::size_t m = 0; m < model.materials.size() && named != model.images.end(); ++m)
    for_each_texture(model.materials[m], [&](const TextureRef& ref) {
      if (ref.image != number || ref.texcoord > 1) return;
      known = true;
      add_triangles(mesh, m, ref, TexelMap(ref.transform, width_px, height_px), coverage);
    });
  const auto twice = [](std::uint32_t side_px) { return 2.0 * side_px; };
  if (!known) coverage.add({Vec2d{0, 0}, Vec2d{twice(width_px), 0}, Vec2d{0, twice(height_px)}});
  return coverage.release_bits();
}

namespace {

/// Progressive, or where that has more bytes in one scan: what a scan has beside its coefficients is much of
/// a small file.
std::vector<std::uint8_t> encode_jpeg_file(const Pixels& pixels, const ImageCoding& coding) {
  constexpr std::size_t kSmallTexels = 65536;
  const auto file = [&](bool sequential) {
    JpegKind kind;
    kind.channels = pixels.channels;
    kind.rgb = coding.data && pixels.channels == 3;
    kind.subsampling = coding.full_chroma ? Subsampling::k444 : Subsampling::k420;
    kind.file = FileSteps{coding.quality, coding.full_chroma, sequential};
    return JpegCoder(kind).complete({pixels.data.data(), std::size_t{pixels.width_px} * pixels.channels,
                                     pixels.width_px, pixels.height_px});
  };
  const bool small = std::size_t{pixels.width_px} * pixels.height_px <= kSmallTexels;
  std::vector<std::uint8_t> one_scan = small || coding.quick ? file(true) : std::vector<std::uint8_t>{};
  if (coding.quick) return one_scan;
  std::vector<std::uint8_t> progressive = file(false);
  return small && one_scan.size() < progressive.size() ? one_scan : progressive;
}

std::vector<std::uint8_t> encode_webp_file(const Pixels& pixels, const ImageCoding& coding) {
  WebpOptions options;
  options.method = coding.quick ? 3 : 6;
  options.quality = static_cast<float>(std::clamp(coding.quality, 0.0, 100.0));
  options.alpha_quality = 90;
  options.sharp_chroma = true;
  return encode_webp(pixels, options);
}

}  // namespace

const char* mime_type_of(FileImage format) {
  if (format == FileImage::kWebp) return "image/webp";
  if (format == FileImage::kAvif) return "image/avif";
  return format == FileImage::kPng ? "image/png" : "image/jpeg";
}

Pixels decode_file_image(const FileImageData& file) {
  if (file.format != FileImage::kAvif) return decode_image(probe_image("texture", file.bytes, {}));
  AvifPicture picture = decode_avif("texture", file.bytes, {});
  return {picture.width_px, picture.height_px, picture.channels, std::get<Bytes>(std::move(picture.samples))};
}

std::vector<std::uint8_t> encode_image(const Pixels& pixels, const ImageCoding& coding) {
  if (pixels.width_px == 0 || pixels.height_px == 0 ||
      pixels.data.size() != std::size_t{pixels.width_px} * pixels.height_px * pixels.channels)
    throw StageError("extract", "image", "pixels as many as width and height say",
                     std::to_string(pixels.data.size()));
  if (coding.format == FileImage::kPng) return write_png(pixels);
  if (coding.format == FileImage::kAvif)
    return encode_avif(pixels, {coding.quality, coding.data, coding.quick});
  return coding.format == FileImage::kWebp ? encode_webp_file(pixels, coding)
                                           : encode_jpeg_file(pixels, coding);
}

}  // namespace texmesh
