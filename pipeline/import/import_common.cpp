#include <algorithm>
#include <cmath>
#include <limits>

#include "format/base/box.h"
#include "format/base/errors.h"
#include "format/base/no_index.h"
#include "pipeline/import/import.h"
#include "pipeline/import/near_uvs.h"
#include "pipeline/import/text_scan.h"
#include "pipeline/io/uri.h"
#include "stages/image/decode_image.h"
#include "stages/image/image_metadata.h"

namespace texmesh {
namespace {

bool finite(Vec2f a) { return std::isfinite(a.x) && std::isfinite(a.y); }
bool finite(Vec3f a) { return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z); }

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
  static constexpr std::string_view kKnown[] = {"jpg", "jpeg", "jpe", "jfif", "png", "tif", "tiff", "webp",
                                                "exr", "tga",  "bmp", "gif",  "ppm", "pgm", "hdr",  "dds"};
  const std::string extension = lower_extension(image.name);
  if (std::find(std::begin(kKnown), std::end(kKnown), extension) == std::end(kKnown)) return;
  if (!extension_fits(extension, image.format))
    add_info(model.notes, "image-extension", place,
             image.name + " holds a " + image_format_name(image.format) + " and is read as one");
}

// What an image says beside its pixels: what is done about it, and that a user should know.
void apply_metadata(Model& model, Image& image, const std::string& place, const ImportOptions& options) {
  const ImageMetadata metadata = read_image_metadata(image.format, image.bytes);
  image.honour_profile = options.colour_profiles != ProfilePolicy::kIgnore;
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

// --- finish_model --------------------------------------------------------------------------------------

void fill_defaults(Model& model) {
  Mesh& mesh = model.mesh;
  if (model.materials.empty()) model.materials.emplace_back();
  if (mesh.triangle_material.empty()) mesh.triangle_material.assign(mesh.triangles.size(), 0);
  if (mesh.triangle_part.empty()) mesh.triangle_part.assign(mesh.triangles.size(), 0);
  if (mesh.part_names.empty()) mesh.part_names.emplace_back();
  for (std::size_t i = 0; i < mesh.part_names.size(); ++i)
    if (mesh.part_names[i].empty()) mesh.part_names[i] = "part " + std::to_string(i + 1);
}

// A reader that hands over a wrong index has a bug; reading past an array for it would be worse than saying
// so.
void check_structure(const Model& model, const std::string& file_name) {
  const Mesh& mesh = model.mesh;
  const std::size_t wedges = mesh.wedge_count();
  auto require = [&file_name](bool ok, const char* what) {
    if (!ok) throw InputError(file_name, "imported mesh", what, "an index or a count out of range");
  };
  auto attribute = [wedges](std::size_t n) { return n == 0 || n == wedges; };
  require(attribute(mesh.uv0.size()) && attribute(mesh.uv1.size()) && attribute(mesh.normals.size()) &&
              attribute(mesh.colours.size()) && attribute(mesh.tangents.size()),
          "one value per wedge for every attribute");
  require(mesh.triangle_material.size() == mesh.triangles.size() &&
              mesh.triangle_part.size() == mesh.triangles.size(),
          "a material and a part for every triangle");
  for (std::uint32_t p : mesh.wedge_position)
    require(p < mesh.positions.size(), "wedges that refer to positions");
  for (const Triangle& t : mesh.triangles)
    for (std::uint32_t w : t) require(w < wedges, "triangles that refer to wedges");
  for (std::uint16_t m : mesh.triangle_material)
    require(m < model.materials.size(), "triangles that refer to materials");
  for (std::uint16_t p : mesh.triangle_part)
    require(p < mesh.part_names.size(), "triangles that refer to parts");
}

void check_limits(const Model& model, const std::string& file_name, const ImportOptions& options) {
  auto check = [&file_name](const char* what, std::size_t found, int limit) {
    if (found > static_cast<std::size_t>(limit))
      throw InputError(file_name, what, "at most " + std::to_string(limit), std::to_string(found));
  };
  check("positions", model.mesh.positions.size(), options.max_vertices);
  check("vertices with texture coordinates", model.mesh.wedge_count(), options.max_vertices);
  check("triangles", model.mesh.triangles.size(), options.max_triangles);
  check("images", model.images.size(), options.max_images);
}

std::string count_of(std::size_t n, const char* one, const char* many) {
  return std::to_string(n) + " " + (n == 1 ? one : many);
}

void drop_non_finite_triangles(Model& model, const std::string& file_name) {
  Mesh& mesh = model.mesh;
  std::size_t kept = 0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    bool good = true;
    for (std::uint32_t w : mesh.triangles[t]) good = good && finite(mesh.positions[mesh.wedge_position[w]]);
    if (!good) continue;
    mesh.triangles[kept] = mesh.triangles[t];
    mesh.triangle_material[kept] = mesh.triangle_material[t];
    mesh.triangle_part[kept] = mesh.triangle_part[t];
    ++kept;
  }
  const std::size_t dropped = mesh.triangles.size() - kept;
  if (dropped && kept == 0)
    throw InputError(file_name, "positions", "some finite ones", "only NaN and infinities in every triangle");
  if (kept == 0) throw InputError(file_name, "triangles", "at least one", "none");
  if (!dropped) return;
  mesh.triangles.resize(kept);
  mesh.triangle_material.resize(kept);
  mesh.triangle_part.resize(kept);
  add_warning(model.notes, "non-finite-position", file_name,
              count_of(dropped, "triangle", "triangles") + " left out because of NaN or infinite positions");
}

void repair_uvs(Model& model, std::vector<Vec2f>& uvs, const std::string& file_name) {
  std::size_t bad = 0;
  for (Vec2f& uv : uvs)
    if (!finite(uv)) {
      uv = {};
      ++bad;
    }
  if (bad)
    add_warning(
        model.notes, "non-finite-uv", file_name,
        count_of(bad, "texture coordinate", "texture coordinates") + " with NaN or infinity set to 0");
}

// Normals become unit vectors. One that is NaN or 0 takes the sum of its triangles' area-weighted normals.
void repair_normals(Mesh& mesh) {
  if (mesh.normals.empty()) return;
  std::vector<std::uint8_t> bad(mesh.normals.size(), 0);
  bool any = false;
  for (std::size_t w = 0; w < mesh.normals.size(); ++w) {
    const Vec3d n = to_double(mesh.normals[w]);
    const double l = length(n);
    if (l > 1e-20 && std::isfinite(l)) {
      mesh.normals[w] = to_float(n * (1 / l));
    } else {
      bad[w] = 1;
      any = true;
    }
  }
  if (!any) return;
  std::vector<Vec3d> sum(mesh.normals.size());
  for (const Triangle& t : mesh.triangles) {
    if (!bad[t[0]] && !bad[t[1]] && !bad[t[2]]) continue;
    const Vec3d a = to_double(mesh.positions[mesh.wedge_position[t[0]]]);
    const Vec3d n = cross(to_double(mesh.positions[mesh.wedge_position[t[1]]]) - a,
                          to_double(mesh.positions[mesh.wedge_position[t[2]]]) - a);
    for (std::uint32_t w : t) sum[w] = sum[w] + n;
  }
  for (std::size_t w = 0; w < bad.size(); ++w) {
    if (!bad[w]) continue;
    const double l = length(sum[w]);
    mesh.normals[w] = l > 0 && std::isfinite(l) ? to_float(sum[w] * (1 / l)) : Vec3f{0, 1, 0};
  }
}

void clamp_colours(std::vector<Vec4f>& colours) {
  auto clamp = [](float x) { return x >= 0 ? std::min(x, 1.0f) : x < 0 ? 0.0f : 1.0f; };  // NaN: 1, no tint
  for (Vec4f& c : colours) c = {clamp(c.x), clamp(c.y), clamp(c.z), clamp(c.w)};
}

/// Unit length, w one of 1 and -1; what cannot be so is 0. Nothing at all where no normal map needs them.
void repair_tangents(Model& model) {
  std::vector<Vec4f>& tangents = model.mesh.tangents;
  const bool wanted = std::any_of(model.materials.begin(), model.materials.end(),
                                  [](const Material& m) { return needs_tangents(m); });
  if (!wanted || model.mesh.normals.empty()) tangents.clear();
  for (Vec4f& t : tangents) {
    const Vec3d d{t.x, t.y, t.z};
    const double l = length(d);
    if (l > 1e-20 && std::isfinite(l) && std::isfinite(t.w)) {
      const Vec3f unit = to_float(d * (1 / l));
      t = {unit.x, unit.y, unit.z, t.w < 0 ? -1.0f : 1.0f};
    } else {
      t = {};
    }
  }
}

template <class T>
void keep_marked(std::vector<T>& values, const std::vector<std::uint32_t>& new_index) {
  if (values.empty()) return;
  // new_index[i] <= i; moving a string or a vector onto itself would empty it.
  for (std::size_t i = 0; i < values.size(); ++i)
    if (new_index[i] != kNoIndex && new_index[i] != i) values[new_index[i]] = std::move(values[i]);
  values.resize(static_cast<std::size_t>(
      std::count_if(new_index.begin(), new_index.end(), [](auto i) { return i != kNoIndex; })));
}

// Marks become consecutive indices in the old order; kNoIndex stays.
std::uint32_t number_marked(std::vector<std::uint32_t>& marks) {
  std::uint32_t next = 0;
  for (std::uint32_t& m : marks)
    if (m != kNoIndex) m = next++;
  return next;
}

void drop_unused_vertices(Model& model) {
  Mesh& mesh = model.mesh;
  std::vector<std::uint32_t> wedge(mesh.wedge_count(), kNoIndex), position(mesh.positions.size(), kNoIndex);
  for (const Triangle& t : mesh.triangles)
    for (std::uint32_t w : t) {
      wedge[w] = 0;
      position[mesh.wedge_position[w]] = 0;
    }
  const std::uint32_t wedges = number_marked(wedge), positions = number_marked(position);
  if (wedges == wedge.size() && positions == position.size()) return;
  if (positions != position.size())
    add_info(model.notes, "unused-vertices", "",
             count_of(position.size() - positions, "vertex", "vertices") + " of no triangle left out");
  keep_marked(mesh.uv0, wedge);
  keep_marked(mesh.uv1, wedge);
  keep_marked(mesh.normals, wedge);
  keep_marked(mesh.colours, wedge);
  keep_marked(mesh.tangents, wedge);
  keep_marked(mesh.wedge_position, wedge);
  keep_marked(mesh.positions, position);
  for (std::uint32_t& p : mesh.wedge_position) p = position[p];
  for (Triangle& t : mesh.triangles)
    for (std::uint32_t& w : t) w = wedge[w];
  for (std::uint32_t& p : model.range.position)
    if (p != kNoIndex) p = position[p];
}

void drop_unused_materials(Model& model) {
  std::vector<std::uint32_t> material(model.materials.size(), kNoIndex);
  for (std::uint16_t m : model.mesh.triangle_material) material[m] = 0;
  number_marked(material);
  keep_marked(model.materials, material);
  for (std::uint16_t& m : model.mesh.triangle_material) m = static_cast<std::uint16_t>(material[m]);
}

void drop_unused_parts(Mesh& mesh) {
  std::vector<std::uint32_t> part(mesh.part_names.size(), kNoIndex);
  for (std::uint16_t p : mesh.triangle_part) part[p] = 0;
  number_marked(part);
  keep_marked(mesh.part_names, part);
  for (std::uint16_t& p : mesh.triangle_part) p = static_cast<std::uint16_t>(part[p]);
}

void drop_unused_images(Model& model, const std::string& file_name) {
  std::vector<std::uint32_t> image(model.images.size(), kNoIndex);
  auto mark = [&](TextureRef& ref) {
    if (!ref.used()) return;
    if (static_cast<std::size_t>(ref.image) >= image.size())
      throw InputError(file_name, "imported materials", "textures that refer to images",
                       std::to_string(ref.image));
    image[static_cast<std::size_t>(ref.image)] = 0;
  };
  for (Material& m : model.materials) for_each_texture(m, mark);
  number_marked(image);
  keep_marked(model.images, image);
  for (Material& m : model.materials)
    for_each_texture(m, [&image](TextureRef& ref) {
      if (ref.used()) ref.image = static_cast<std::int32_t>(image[static_cast<std::size_t>(ref.image)]);
    });
}

void turn_z_up(Mesh& mesh) {
  auto turn = [](auto& v) { v = {v.x, v.z, -v.y}; };
  for (Vec4f& t : mesh.tangents) t = {t.x, t.z, -t.y, t.w};
  turn(mesh.origin);
  for (Vec3f& p : mesh.positions) turn(p);
  for (Vec3f& n : mesh.normals) turn(n);
}

// --- set_positions -------------------------------------------------------------------------------------

// Beyond this a coordinate is no measure of anything, and squares of differences would overflow a float.
constexpr double kLargestCoordinate = 1e18;

bool usable(const Vec3d& p) {
  auto in_range = [](double x) { return std::fabs(x) <= kLargestCoordinate; };  // false for NaN
  return in_range(p.x) && in_range(p.y) && in_range(p.z);
}

// GCC 12.2 at -O2 drops the rounding of to_double(to_float(v)) when it puts x and y into one vector register
// (found by the test; -fno-tree-slp-vectorize does not), hence volatile.
double float_exact(double x) {
  const volatile float rounded = static_cast<float>(x);
  return static_cast<double>(rounded);
}

Vec3d choose_origin(const std::vector<Vec3d>& positions) {
  Box3d box;
  for (const Vec3d& p : positions)
    if (usable(p)) box.extend(p);
  if (box.empty()) return {};
  double farthest = 0;
  for (int i = 0; i < 3; ++i) farthest = std::max({farthest, std::fabs(box.min[i]), std::fabs(box.max[i])});
  const double rounding = farthest / 16777216;  // half a unit in the last place of a float, at most
  if (rounding <= 1e-7 * box.diagonal()) return {};
  const Vec3d centre = box.centre();
  return {float_exact(centre.x), float_exact(centre.y), float_exact(centre.z)};
}

}  // namespace

void set_positions(Mesh& mesh, const std::vector<Vec3d>& positions) {
  mesh.origin = choose_origin(positions);
  mesh.positions.resize(positions.size());
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (std::size_t i = 0; i < positions.size(); ++i)
    mesh.positions[i] = usable(positions[i]) ? to_float(positions[i] - mesh.origin) : Vec3f{nan, nan, nan};
}

std::int32_t add_image_bytes(Model& model, std::string name, std::vector<std::uint8_t> bytes,
                             const std::string& file_name, const std::string& place,
                             const ImportOptions& options) {
  for (std::size_t i = 0; i < model.images.size(); ++i)
    if (model.images[i].bytes == bytes) return static_cast<std::int32_t>(i);
  if (model.images.size() >= static_cast<std::size_t>(options.max_images))
    throw InputError(file_name, place, "at most " + std::to_string(options.max_images) + " images", "more");
  ImageLimits limits;
  limits.max_pixels = static_cast<std::uint64_t>(options.max_image_pixels);
  try {
    model.images.push_back(probe_image(base_name(name), std::move(bytes), limits));
  } catch (const InputError& e) {
    throw InputError(file_name, place + " (" + name + ")" + (e.place().empty() ? "" : ": " + e.place()),
                     e.expected(), e.found());
  }
  note_foreign_extension(model, model.images.back(), place);
  apply_metadata(model, model.images.back(), place, options);
  return static_cast<std::int32_t>(model.images.size() - 1);
}

std::int32_t add_image(Model& model, const std::string& uri, Resolver& resolver, const std::string& file_name,
                       const std::string& place, const ImportOptions& options) {
  check_relative_name(uri, file_name, place);
  auto bytes = resolver.read(uri, static_cast<std::uint64_t>(options.max_file_bytes));
  if (bytes) return add_image_bytes(model, uri, std::move(*bytes), file_name, place, options);
  const std::string text = "texture " + uri + " not found; the material stays without it";
  const bool told =
      std::any_of(model.notes.begin(), model.notes.end(), [&text](const Note& n) { return n.text == text; });
  if (!told) add_warning(model.notes, "missing-texture", place, text);
  return -1;
}

void finish_model(Model& model, const std::string& file_name, const ImportOptions& options) {
  fill_defaults(model);
  check_structure(model, file_name);
  check_limits(model, file_name, options);
  drop_non_finite_triangles(model, file_name);
  drop_unused_vertices(model);
  repair_uvs(model, model.mesh.uv0, file_name);
  repair_uvs(model, model.mesh.uv1, file_name);
  repair_normals(model.mesh);
  clamp_colours(model.mesh.colours);
  drop_unused_materials(model);
  drop_unused_parts(model.mesh);
  drop_unused_images(model, file_name);
  repair_tangents(model);
  bring_uvs_near(model);
  if (options.up == UpAxis::kZ) turn_z_up(model.mesh);
}

}  // namespace texmesh
