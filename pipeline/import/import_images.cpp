#include "pipeline/import/import_images.h"

#include "pipeline/import/named_files.h"
#include "pipeline/import/text_scan.h"
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

/// What is wrong with the colour profile that a picture has; "" for nothing.
std::string fault_of_profile(const Image& image, const ImageMetadata& metadata) {
  if (metadata.damaged_profile) return "it is damaged";
  if (metadata.icc_profile.empty()) return "";
  if (metadata.cmyk) return "profiles of CMYK are not read";
  try {
    changes_colours(image, FloatEncoding::kSrgb);
    return "";
  } catch (const InputError& e) {
    return "expected " + e.expected() + ", found " + e.found();
  }
}

/// What an image says beside its pixels: what is done about it, and that a user should know.
void apply_metadata(Model& model, Image& image, const std::string& place, const ImportOptions& options) {
  const ImageMetadata metadata = read_image_metadata(image.format, image.bytes);
  image.honour_profile = options.colour_profiles != ProfilePolicy::kIgnore;
  const std::string fault =
      options.colour_profiles == ProfilePolicy::kAuto ? fault_of_profile(image, metadata) : "";
  if (!fault.empty()) {
    image.honour_profile = false;
    add_warning(model.notes, "colour-profile-ignored", place,
                image.name + " has an ICC profile that cannot be used (" + fault +
                    "): where it gives colours its values are taken as sRGB");
  }
  image.accept_damage = true;
  const char* what = metadata.damaged_profile        ? "a damaged ICC profile"
                     : !metadata.icc_profile.empty() ? "an ICC profile"
                     : metadata.gamma > 0            ? "a gamma"
                                                     : nullptr;
  if (what && fault.empty() && !image.honour_profile)
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

constexpr std::size_t kMostMaterials = 65535;

/// Where the mark stands in a name.
struct Mark {
  TileMark kind = TileMark::kNone;
  std::size_t at = 0, length = 0;
};

Mark find_mark(std::string_view name) {
  const std::string small = lower(name);
  for (const std::string_view word : {"<udim>", "%3cudim%3e"})
    if (const std::size_t at = small.rfind(word); at != small.npos) return {TileMark::kWord, at, word.size()};
  static constexpr std::string_view kNumber = "1001";
  const std::size_t at = small.rfind(kNumber), end = at + kNumber.size();
  if (at == small.npos || at == 0 || (small[at - 1] != '.' && small[at - 1] != '_') || end >= small.size() ||
      small[end] != '.')
    return {};
  return {TileMark::kNumber, at, kNumber.size()};
}

bool is_there(const NameInModel& name, std::uint16_t tile, Resolver& resolver, const ImportOptions& options) {
  Notes unsaid;
  NameInModel of = name;
  of.text = name_of_tile(name.text, tile);
  return find_file(of, resolver, static_cast<std::uint64_t>(options.max_file_bytes), unsaid, "")
      .bytes.has_value();
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

void warn_of_tiles(Notes& notes, const std::string& place, std::size_t tiles, std::size_t left_out) {
  if (left_out > 0)
    add_warning(
        notes, "too-many-tiles", place,
        "faces lie in " + std::to_string(tiles) + " UDIM tiles, and a model has at most " +
            std::to_string(kMostMaterials) + " materials: " + std::to_string(left_out) +
            " tiles are shown without their own pictures. Join pictures, or compile parts of the model");
}

TileMark tile_mark(std::string_view name) { return find_mark(name).kind; }

std::string name_of_tile(std::string name, std::uint16_t tile) {
  const Mark mark = find_mark(name);
  return mark.kind == TileMark::kNone ? name : name.replace(mark.at, mark.length, std::to_string(tile));
}

std::uint16_t tile_at(Vec2d uv) {
  const double u = std::floor(uv.x), v = std::floor(1 - uv.y), tile = kFirstTile + u + kTilesInARow * v;
  return u >= 0 && u < kTilesInARow && v >= 0 && tile <= kLastTile ? static_cast<std::uint16_t>(tile)
                                                                   : kFirstTile;
}

bool other_tile_is_there(const NameInModel& name, const std::set<std::uint16_t>& tiles, Resolver& resolver,
                         const ImportOptions& options) {
  return std::any_of(tiles.begin(), tiles.end(), [&](std::uint16_t tile) {
    return tile != kFirstTile && is_there(name, tile, resolver, options);
  });
}

std::int32_t TiledImages::add_image(Model& model, const NameInModel& name, Resolver& resolver,
                                    const std::string& file_name, const std::string& place,
                                    const ImportOptions& options) {
  const TileMark mark = tile_mark(name.text);
  if (mark == TileMark::kNone) return texmesh::add_image(model, name, resolver, file_name, place, options);
  NameInModel first = name;
  if (mark == TileMark::kWord) {
    constexpr std::uint16_t kSearched = kFirstTile + 10 * kTilesInARow;
    std::uint16_t tile = kFirstTile;
    while (tile < kSearched && !is_there(name, tile, resolver, options)) ++tile;
    first.text = name_of_tile(name.text, tile == kSearched ? kFirstTile : tile);
  }
  const std::int32_t image = texmesh::add_image(model, first, resolver, file_name, place, options);
  if (image >= 0) tiled_.push_back({image, name, place});
  return image;
}

const TiledImages::Tiled* TiledImages::find(const TextureRef& reference) const {
  const auto is_it = [&](const Tiled& t) { return t.image == reference.image; };
  const auto at = std::find_if(tiled_.begin(), tiled_.end(), is_it);
  return reference.used() && at != tiled_.end() ? &*at : nullptr;
}

bool TiledImages::has_tiles(const Material& material, const std::set<std::uint16_t>& tiles,
                            Resolver& resolver, const ImportOptions& options) const {
  bool any = false;
  for_each_texture(material, [&](const TextureRef& r) {
    const Tiled* of = find(r);
    any = any || (of && (tile_mark(of->name.text) == TileMark::kWord ||
                         other_tile_is_there(of->name, tiles, resolver, options)));
  });
  return any;
}

Material TiledImages::of_tile(Material material, std::uint16_t tile, Model& model, Resolver& resolver,
                              const std::string& file_name, const ImportOptions& options) const {
  material.name += "." + std::to_string(tile);
  for_each_texture(material, [&](TextureRef& r) {
    const Tiled* of = find(r);
    if (!of) return;
    NameInModel name = of->name;
    name.text = name_of_tile(name.text, tile);
    r.image = texmesh::add_image(model, name, resolver, file_name, of->place, options);
    r.wrap_s = r.wrap_t = Wrap::kRepeat;  // the coordinates stay in their tile
    if (!r.used()) r = {};
  });
  return material;
}

void TiledImages::split(Model& model, Resolver& resolver, const std::string& file_name,
                        const ImportOptions& options) {
  if (tiled_.empty()) return;
  Mesh& mesh = model.mesh;
  const std::size_t materials = model.materials.size();
  std::vector<const std::vector<Vec2f>*> uvs(materials, nullptr);  // of the material's first such texture
  for (std::size_t m = 0; m < materials; ++m)
    for_each_texture(model.materials[m], [&](const TextureRef& r) {
      const std::vector<Vec2f>& of = r.texcoord == 0 ? mesh.uv0 : mesh.uv1;
      if (!uvs[m] && find(r) && !of.empty()) uvs[m] = &of;
    });
  const auto tile_of = [&](std::size_t t) {
    Vec2d sum;
    for (const std::uint32_t w : mesh.triangles[t])
      sum = sum + to_double((*uvs[mesh.triangle_material[t]])[w]);
    return tile_at(sum * (1 / 3.0));
  };
  std::vector<std::set<std::uint16_t>> tiles(materials);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (uvs[mesh.triangle_material[t]]) tiles[mesh.triangle_material[t]].insert(tile_of(t));
  std::map<std::pair<std::size_t, std::uint16_t>, std::uint16_t> made;
  std::size_t all = 0;
  for (std::size_t m = 0; m < materials; ++m) {
    if (!has_tiles(model.materials[m], tiles[m], resolver, options)) continue;
    const Material whole = model.materials[m];
    all += tiles[m].size();
    for (const std::uint16_t tile : tiles[m]) {
      if (model.materials.size() >= kMostMaterials) break;
      Material material = of_tile(whole, tile, model, resolver, file_name, options);
      const bool is_first = tile == *tiles[m].begin();  // takes the place of the whole
      made[{m, tile}] = static_cast<std::uint16_t>(is_first ? m : model.materials.size());
      if (is_first)
        model.materials[m] = std::move(material);
      else
        model.materials.push_back(std::move(material));
    }
  }
  warn_of_tiles(model.notes, file_name, all, all - made.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    std::uint16_t& material = mesh.triangle_material[t];
    if (!uvs[material]) continue;
    if (const auto at = made.find({material, tile_of(t)}); at != made.end()) material = at->second;
  }
}

}  // namespace texmesh
