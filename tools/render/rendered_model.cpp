#include "tools/render/rendered_model.h"

#include "pipeline/import/named_files.h"
#include "pipeline/io/file_resolver.h"
#include "stages/base/parallel.h"
#include "stages/condition/condition.h"
#include "stages/fill/fill.h"
#include "stages/fragment_codec/fragment_codec.h"
#include "stages/image/decode_image.h"
#include "stages/render/shade.h"

namespace texmesh {
namespace {

constexpr const char* kEmissiveStrength = "KHR_materials_emissive_strength";  // the one that is rendered

/// The index of a texture in the model's list, where it may be new; -1 = nothing to read.
std::int32_t texture_of(RenderedModel& model, const TextureRef& reference, TextureUse use) {
  const std::vector<Vec2f>& uv = reference.texcoord == 0 ? model.mesh.uv0 : model.mesh.uv1;
  if (!reference.used() || reference.texcoord > 1 || uv.empty()) return -1;
  const TextureImage wanted{static_cast<std::uint32_t>(reference.image), is_srgb(use)};
  std::vector<TextureImage>& all = model.texture_images;
  const auto found = std::find(all.begin(), all.end(), wanted);
  const auto index = static_cast<std::int32_t>(found - all.begin());
  if (found == all.end()) all.push_back(wanted);
  return index;
}

/// Files beneath the model's folder; for a mesh of an unpacked package also the package's previews, which
/// stand beside that folder.
class ModelFiles : public Resolver {
 public:
  explicit ModelFiles(const std::filesystem::path& folder) : folder_(folder), files_(folder) {}

  std::optional<Bytes> read(const std::string& uri, std::uint64_t max_bytes) override {
    if (!is_preview_uri(uri) || !in_package()) return files_.read(uri, max_bytes);
    if (!package_) package_.emplace(folder_ / "..");
    return package_->read(uri.substr(std::string_view("../").size()), max_bytes);
  }
  std::optional<Bytes> read_beside(const std::string& name, std::uint64_t max_bytes) override {
    return files_.read_beside(name, max_bytes);
  }
  std::vector<std::string> similar(const std::string& uri) override { return files_.similar(uri); }
  bool failed_for_resources() const {
    return files_.failed_for_resources() || (package_ && package_->failed_for_resources());
  }

 private:
  bool in_package() const {
    return std::filesystem::is_regular_file(std::filesystem::symlink_status(folder_ / ".." / kManifestPath));
  }
  std::filesystem::path folder_;
  FileResolver files_;
  std::optional<FileResolver> package_;
};

void note_what_is_left_out(const std::vector<Material>& materials, Notes& notes) {
  std::set<std::string> names;
  for (const Material& m : materials)
    for (const MaterialExtension& e : m.extensions)
      if (e.name != kEmissiveStrength) names.insert(e.name);
  for (const std::string& name : names)
    add_warning(notes, "not-rendered", "", name + " is not rendered: the base material is shown");
}

}  // namespace

RenderedModel untextured_model(Mesh mesh, const std::vector<Material>& materials) {
  RenderedModel model;
  model.mesh = std::move(mesh);
  model.bounds = bounding_sphere(model.mesh.positions);
  for (const Material& m : materials)
    model.materials.push_back(render_material(m, [&model](const TextureRef& reference, TextureUse use) {
      return texture_of(model, reference, use);
    }));
  note_what_is_left_out(materials, model.notes);
  return model;
}

RenderedModel rendered_model(ImportedModel imported, const RunContext& context) {
  Model& source = imported.model;
  if (source.mesh.normals.empty() && !imported.normals_by_specification)
    source.mesh = condition_mesh(source.mesh, false, {}, context).mesh;
  RenderedModel model = untextured_model(std::move(source.mesh), source.materials);
  model.notes.insert(model.notes.begin(), source.notes.begin(), source.notes.end());
  std::vector<Pixels> pixels(model.texture_images.size());
  parallel_each(context, pixels.size(), 1, [&](std::size_t t) {
    const TextureImage& from = model.texture_images[t];
    pixels[t] =
        decode_image(source.images.at(from.image), from.srgb ? FloatEncoding::kSrgb : FloatEncoding::kAsIs);
  });
  for (std::size_t t = 0; t < pixels.size(); ++t)
    model.textures.push_back(render_texture(std::move(pixels[t]), model.texture_images[t].srgb, 0, context));
  return model;
}

ImportedModel import_file(const std::string& path, const ImportOptions& options, const RunContext& context) {
  const std::filesystem::path file(path);
  const std::vector<std::uint8_t> bytes =
      read_input_file(file, static_cast<std::uint64_t>(options.max_file_bytes));
  ModelFiles resolver(file.parent_path());
  try {
    return import_model(file.filename().string(), bytes, resolver, options, context);
  } catch (const InputError& e) {
    if (resolver.failed_for_resources()) throw ResourceError(e.file(), e.place(), e.expected(), e.found());
    throw;
  }
}

RenderedModel load_rendered_model(const std::string& path, const ImportOptions& options,
                                  const RunContext& context) {
  ImportedModel imported = import_file(path, options, context);
  return with_model_named(path, [&] { return rendered_model(std::move(imported), context); });
}

void make_unlit(RenderedModel& model) {
  for (RenderMaterial& m : model.materials) m.unlit = true;
}

namespace {

/// The whole sheet as if nothing stood on it.
Pixels empty_sheet(std::uint32_t width_px, std::uint32_t height_px, const RenderEnvironment& environment) {
  const std::array<std::uint8_t, 3> colour = background_colour(environment);
  Pixels sheet{width_px, height_px, 3, {}};
  sheet.data.reserve(std::size_t{width_px} * height_px * 3);
  for (std::size_t i = 0; i < std::size_t{width_px} * height_px; ++i)
    sheet.data.insert(sheet.data.end(), colour.begin(), colour.end());
  return sheet;
}

}  // namespace

RenderEnvironment environment_of(RenderLight light, const RunContext& context) {
  if (light == RenderLight::kStudio) return studio_environment();
  return prepare_environment([](Vec3f) { return Vec3f{1, 1, 1}; }, KeyLight{}, context);
}

void paste(const Pixels& picture, std::uint32_t left_px, std::uint32_t top_px, Pixels& sheet) {
  for (std::uint32_t y = 0; y < picture.height_px; ++y)
    std::memcpy(sheet.data.data() + (std::size_t{top_px + y} * sheet.width_px + left_px) * sheet.channels,
                picture.at(0, y), std::size_t{picture.width_px} * picture.channels);
}

std::array<std::uint8_t, 3> background_colour(const RenderEnvironment& environment) {
  const Pixels pixel = encode_srgb({1, {environment.background}, {0}});
  return {pixel.data[0], pixel.data[1], pixel.data[2]};
}

std::uint32_t sheet_columns(int count) {
  std::uint32_t columns = 1;
  while (columns * columns < static_cast<std::uint32_t>(std::max(count, 1))) ++columns;
  return columns;
}

PictureSheet render_sheet(const RenderedModel& model, const RenderEnvironment& environment, int count,
                          std::uint32_t side_px, const RunContext& context) {
  const std::uint32_t columns = sheet_columns(count);
  if (count < 1 || count > kMaxSheetViews) throw std::invalid_argument("a sheet of too few or many views");
  if (side_px == 0 || side_px > kMaxSheetSide / columns)
    throw std::invalid_argument("views of a sheet are empty or too large");
  PictureSheet sheet;
  sheet.columns = columns;
  sheet.rows = (static_cast<std::uint32_t>(count) + columns - 1) / columns;
  sheet.pixels = empty_sheet(columns * side_px, sheet.rows * side_px, environment);
  const RenderScene scene = model.scene();
  for (std::uint32_t k = 0; k < static_cast<std::uint32_t>(count); ++k) {
    context.check_cancelled();
    SheetView view;
    view.camera =
        perspective_camera(camera_of(static_cast<int>(k), count, model.bounds.centre, model.bounds.radius));
    view.left_px = k % columns * side_px;
    view.top_px = k / columns * side_px;
    const Picture picture =
        shade(scene, look(scene, view.camera, side_px, context), model.textures, environment, context);
    view.covered_px =
        static_cast<std::uint32_t>(std::count(picture.covered.begin(), picture.covered.end(), 1));
    paste(encode_srgb(picture), view.left_px, view.top_px, sheet.pixels);
    sheet.views.push_back(view);
    context.report((k + 1.0) / count);
  }
  return sheet;
}

namespace {

constexpr std::uint64_t kMaxPixels = 400'000'000;

/// Copies what of a fragment lies within the plane.
void place(const Pixels& fragment, const TextureInfo& info, std::uint32_t index, Pixels& plane) {
  const std::uint32_t x = index % info.columns * info.fragment_width_px;
  const std::uint32_t y = index / info.columns * info.fragment_height_px;
  if (x >= plane.width_px || y >= plane.height_px) return;
  const std::uint32_t width = std::min(fragment.width_px, plane.width_px - x),
                      height = std::min(fragment.height_px, plane.height_px - y);
  for (std::uint32_t row = 0; row < height; ++row)
    std::memcpy(plane.data.data() + (std::size_t{y + row} * plane.width_px + x) * plane.channels,
                fragment.at(0, row), std::size_t{width} * plane.channels);
}

void require_fragment(const Pixels& pixels, const TextureInfo& info, const std::string& path,
                      std::uint32_t fragment) {
  if (pixels.width_px == info.fragment_width_px && pixels.height_px == info.fragment_height_px &&
      pixels.channels == info.channels)
    return;
  throw FormatError(path, "fragment " + std::to_string(fragment),
                    std::to_string(info.fragment_width_px) + " x " + std::to_string(info.fragment_height_px) +
                        " px, " + std::to_string(info.channels) + " channels",
                    std::to_string(pixels.width_px) + " x " + std::to_string(pixels.height_px) + " px, " +
                        std::to_string(pixels.channels) + " channels");
}

/// Coverage bits (TexturePlane::coverage) of the texels that some fragment has given.
std::vector<std::uint8_t> known_texels(const TextureInfo& info, const std::vector<bool>& known) {
  const std::size_t stride = coverage_stride_bytes(info.width_px);
  std::vector<std::uint8_t> bits(stride * info.height_px);
  for (std::uint32_t y = 0; y < info.height_px; ++y)
    for (std::uint32_t x = 0; x < info.width_px; ++x)
      if (known[std::size_t{y / info.fragment_height_px} * info.columns + x / info.fragment_width_px])
        bits[y * stride + x / 8] = static_cast<std::uint8_t>(bits[y * stride + x / 8] | 0x80 >> x % 8);
  return bits;
}

/// Whether all texels of `part` are in `bits`.
bool holds(const std::vector<std::uint8_t>& bits, const std::vector<std::uint8_t>& part) {
  for (std::size_t i = 0; i < bits.size() && i < part.size(); ++i)
    if (part[i] & ~bits[i]) return false;
  return true;
}

void require_size(const TextureInfo& info, std::uint32_t plane) {
  if (std::uint64_t{info.width_px} * info.height_px > kMaxPixels)
    throw FormatError(kTexturesPath, "/textures/" + std::to_string(plane),
                      "at most " + std::to_string(kMaxPixels) + " texels",
                      std::to_string(info.width_px) + " x " + std::to_string(info.height_px));
}

}  // namespace

void decode_fragments(const TextureInfo& info, const std::string& rung_path, const PlaneStreams& streams,
                      std::span<const std::uint16_t> fragments, Pixels& plane, const RunContext& context) {
  const std::uint64_t fragment_pixels = std::uint64_t{info.fragment_width_px} * info.fragment_height_px;
  parallel_each(context, fragments.size(), 1, [&](std::size_t k) {
    if (streams.stream(fragments[k]).empty()) return;
    const Pixels pixels = decode_fragment_file(info.codec, streams.file(fragments[k]), fragment_pixels);
    require_fragment(pixels, info, rung_path, fragments[k]);
    place(pixels, info, fragments[k], plane);
  });
}

Pixels read_plane(PackageReader& package, std::uint32_t plane, std::uint32_t rung, const RunContext& context,
                  const std::vector<std::uint8_t>* shown) {
  const TextureInfo& info = package.textures().at(plane);
  const PlaneTables& tables = package.tables().planes.at(plane);
  require_size(info, plane);
  const auto top = static_cast<std::uint32_t>(std::min<std::size_t>(rung, tables.rung_count() - 1));
  PlaneStreams streams(info.codec, tables, package.entry(info.tables));
  for (std::uint32_t r = codec_traits(info.codec).incremental ? 0 : top; r <= top; ++r)
    streams.add_pack(r, package.entry(info.rungs[r]));

  Pixels out{info.width_px, info.height_px, info.channels, {}};
  out.data.resize(std::size_t{out.width_px} * out.height_px * out.channels);
  std::vector<bool> known(tables.fragment_count());
  for (const std::uint16_t f : tables.order) known[f] = !streams.stream(f).empty();
  decode_fragments(info, info.rungs[top].path, streams, tables.order, out, context);
  if (std::find(known.begin(), known.end(), false) != known.end()) {
    const std::vector<std::uint8_t> bits = known_texels(info, known);
    if (!shown || !holds(bits, *shown)) fill_uncovered(out, bits, context);
  }
  if (shown) fill_uncovered(out, *shown, context, PartBlocks::kSmooth);
  return out;
}

void require_rung(PackageReader& package, std::uint32_t rung) {
  if (rung == kBestRung || package.tables().planes.empty()) return;
  std::size_t most = 0;
  for (const PlaneTables& t : package.tables().planes) most = std::max(most, t.rung_count());
  if (rung >= most)
    throw InputError(package.store().name(), "rung " + std::to_string(rung),
                     "0 to " + std::to_string(most - 1) + ", or max", "another");
}

}  // namespace texmesh
