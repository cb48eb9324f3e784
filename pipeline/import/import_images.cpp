#include "pipeline/import/import_images.h"

#include <algorithm>

#include "pipeline/import/foreign_file.h"
#include "pipeline/import/text_scan.h"
#include "stages/image/decode_image.h"
#include "stages/image/image_metadata.h"
#include "stages/image/ktx2/read_ktx2.h"
#include "stages/image/readers_module/other_pictures.h"

namespace texmesh {
namespace {

std::string base_name(const std::string& uri) {
  const std::size_t slash = uri.find_last_of('/');
  return slash == std::string::npos ? uri : uri.substr(slash + 1);
}

bool extension_fits(const std::string& extension, ImageFormat format) {
  switch (format) {
    case ImageFormat::kJpeg:
      return extension == "jpg" || extension == "jpeg" || extension == "jpe" || extension == "jfif";
    case ImageFormat::kPng:
      return extension == "png";
    case ImageFormat::kTiff:
      return extension == "tif" || extension == "tiff";
    case ImageFormat::kWebp:
      return extension == "webp";
    case ImageFormat::kExr:
      return extension == "exr";
  }
  return false;
}

void note_foreign_extension(Model& model, const Image& image, const std::string& place) {
  static constexpr std::string_view kKnown[] = {"jpg",  "jpeg", "jpe", "jfif", "png", "tif", "tiff",
                                                "webp", "exr",  "tga", "bmp",  "gif", "ppm", "pgm",
                                                "hdr",  "dds",  "jp2", "j2k",  "ktx2"};
  const std::string extension = lower_extension(image.name);
  if (std::find(std::begin(kKnown), std::end(kKnown), extension) == std::end(kKnown)) return;
  if (!extension_fits(extension, image.format))
    add_info(model.notes, "image-extension", place,
             image.name + " holds a " + image_format_name(image.format) + " and is read as one");
}

/// What an image says beside its pixels: what is done about it, and that a user should know.
void apply_metadata(Model& model, Image& image, const std::string& place, const ImportOptions& options) {
  const ImageMetadata metadata = read_image_metadata(image.format, image.bytes);
  image.honour_profile = options.colour_profiles != ProfilePolicy::kIgnore;
  image.accept_damage = true;
  const char* what = metadata.damaged_profile        ? "a damaged ICC profile"
                     : !metadata.icc_profile.empty() ? "an ICC profile"
                     : metadata.gamma > 0            ? "a gamma"
                                                     : nullptr;
  if (what && !image.honour_profile)
    add_info(model.notes, "colour-profile-ignored", place,
             image.name + " has " + what + " that is ignored: its values are taken as sRGB");
  if (what && image.honour_profile)
    add_info(model.notes, "colour-profile", place,
             image.name + " has " + what +
                 (metadata.damaged_profile ? ": where it gives colours it is refused"
                                           : ": where it gives colours they are converted to sRGB"));
  if (metadata.other_primaries)
    add_warning(model.notes, "colour-primaries-ignored", place,
                image.name + " names primaries other than sRGB's without a profile; they are ignored");
  if (metadata.cmyk && metadata.icc_profile.empty())
    add_warning(model.notes, "cmyk-image", place,
                image.name +
                    " is CMYK without a profile; its inks are taken as ideal ones, so where it gives colours "
                    "they may differ from those of its maker");
  if (metadata.more_pictures)
    add_info(model.notes, "more-pictures", place,
             image.name + " holds more than one picture; the first is read");
  if (metadata.orientation != 1)
    add_warning(model.notes, "exif-orientation", place,
                image.name + " asks to be turned for display (EXIF orientation " +
                    std::to_string(metadata.orientation) +
                    "); texture coordinates count from its first stored pixel, so it is not turned");
}

void note_conversion(Model& model, const Image& image, const std::string& kind,
                     const ConvertedPicture& picture, const std::string& place) {
  const std::string what = image.name + " is a " + kind;
  add_info(model.notes, "converted-image", place,
           what + ": it goes on as a " + image_format_name(image.format) + " of the same texels");
  if (picture.more_pictures)
    add_warning(model.notes, "more-pictures", place, what + " of more than one picture; the first is read");
  if (picture.profile)
    add_warning(model.notes, "colour-profile-ignored", place,
                what + " with an ICC profile that is ignored: its values are taken as sRGB");
}

void note_missing(Model& model, const std::string& place, const std::string& texture) {
  add_once(model.notes, Severity::kWarning, "missing-texture", place,
           "texture " + texture + "; the material stays without it");
}

}  // namespace

std::int32_t add_image_bytes(Model& model, std::string name, std::vector<std::uint8_t> bytes,
                             const std::string& file_name, const std::string& place,
                             const ImportOptions& options) {
  ImageLimits limits;
  limits.max_pixels = static_cast<std::uint64_t>(options.max_image_pixels);
  const std::string foreign = bytes.empty()               ? "an empty file"
                              : sniff_image_format(bytes) ? ""
                                                          : foreign_file(bytes);
  if (!foreign.empty()) {
    note_missing(model, place, quote(name) + " is " + foreign);
    return -1;
  }
  const auto placed = [&](auto&& read) {
    try {
      return read();
    } catch (const InputError& e) {
      throw InputError(file_name, place + " (" + name + ")" + (e.place().empty() ? "" : ": " + e.place()),
                       e.expected(), e.found());
    }
  };
  const bool ktx2 = is_ktx2(bytes);
  if (ktx2) bytes = placed([&] { return png_of_ktx2(name, bytes, limits); });
  ConvertedPicture picture;
  std::string kind;  // of a picture that is converted
  if (const auto other = sniff_image_format(bytes) ? std::nullopt : sniff_other_picture(name, bytes)) {
    kind = other_picture_name(*other);
    picture = placed([&] { return convert_other_picture(name, *other, bytes, limits); });
    bytes = std::move(picture.bytes);
  }
  for (std::size_t i = 0; i < model.images.size(); ++i)
    if (model.images[i].bytes == bytes) return static_cast<std::int32_t>(i);
  if (model.images.size() >= static_cast<std::size_t>(options.max_images))
    throw InputError(file_name, place, "at most " + std::to_string(options.max_images) + " images", "more");
  model.images.push_back(placed([&] { return probe_image(base_name(name), std::move(bytes), limits); }));
  Image& image = model.images.back();
  if (ktx2)
    add_info(model.notes, "ktx2-image", place,
             image.name + " is a KTX2: its largest level is read and goes on as a PNG of the same texels");
  else if (!kind.empty())
    note_conversion(model, image, kind, picture, place);
  else
    note_foreign_extension(model, image, place);
  apply_metadata(model, image, place, options);
  return static_cast<std::int32_t>(model.images.size() - 1);
}

std::int32_t add_image(Model& model, const NameInModel& name, Resolver& resolver,
                       const std::string& file_name, const std::string& place, const ImportOptions& options) {
  NamedFile file =
      find_file(name, resolver, static_cast<std::uint64_t>(options.max_file_bytes), model.notes, place);
  if (file.bytes) return add_image_bytes(model, file.name, std::move(*file.bytes), file_name, place, options);
  note_missing(model, place, quote(name.text) + " not found: " + file.looked_for);
  return -1;
}

std::int32_t add_image_of_stem(Model& model, const std::string& stem, Resolver& resolver,
                               const std::string& file_name, const std::string& place,
                               const ImportOptions& options) {
  Notes of_the_ending;
  NamedFile file = find_file({stem + ".jpg", "", false}, resolver,
                             static_cast<std::uint64_t>(options.max_file_bytes), of_the_ending, place);
  return file.bytes ? add_image_bytes(model, file.name, std::move(*file.bytes), file_name, place, options)
                    : -1;
}

std::int32_t add_unnamed_texture(Model& model, Resolver& resolver, const std::string& file_name,
                                 const std::string& place, const ImportOptions& options) {
  const std::int32_t image = add_image_of_stem(model, file_name.substr(0, file_name.rfind('.')), resolver,
                                               file_name, place, options);
  if (image >= 0)
    add_warning(model.notes, "unnamed-texture", place,
                "the model has texture coordinates and names no texture; " +
                    quote(model.images[static_cast<std::size_t>(image)].name) +
                    ", which is named after the model, is taken");
  return image;
}

}  // namespace texmesh
