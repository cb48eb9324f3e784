#include "tools/extract/budget/reference.h"

#include "format/base/portable_math.h"
#include "format/rules/viewing.h"
#include "stages/base/parallel.h"
#include "stages/geometry/texel_coverage.h"
#include "tools/extract/glb/standalone_glb.h"

namespace texmesh {
namespace {

constexpr int kViews = 5;
constexpr std::uint32_t kLeastSide = 4;
constexpr double kWholeBlocks = 16;
constexpr int kWindowsPerView = 1;
constexpr std::uint32_t kWindowPx = 64;
constexpr double kFinestShown = 8;  // texels per pixel: pictures read no finer ones
constexpr double kSparse = 0.05;    // of the surface has fewer texels per pixel than what counts

RunContext serial(const RunContext& context) {
  RunContext one = context;
  one.threads = 1;
  return one;
}

bool covered(const Visibility& view, std::size_t pixel) { return view.first[pixel] < view.first[pixel + 1]; }

/// A camera at the same place that looks at a pixel, at so much of the picture's side.
LitCamera window_at(const Visibility& view, std::size_t pixel, std::uint32_t side_px, double share) {
  const RenderCamera& from = view.camera;
  const double pitch = 2 * from.tan_half_fov / view.side_px;
  const auto offset = [&](std::size_t place) {
    return (static_cast<double>(place) + 0.5 - 0.5 * view.side_px) * pitch;
  };
  const Vec3d towards =
      from.x * offset(pixel % view.side_px) - from.y * offset(pixel / view.side_px) - from.z;
  LitCamera out{
      look_at_camera(from.eye, from.eye + towards, from.y, kRenderFovDegrees, from.near), side_px, {}};
  out.camera.tan_half_fov = from.tan_half_fov * share;
  return out;
}

using Materials = std::vector<RenderMaterial>;

/// The materials with slots that read other textures: place[t] instead of t, where it is not negative.
Materials with_textures(Materials materials, const std::vector<std::int32_t>& place) {
  for (RenderMaterial& m : materials)
    for (TextureSlot& slot : m.textures) {
      const std::int32_t other = slot.texture < 0 ? -1 : place[static_cast<std::size_t>(slot.texture)];
      if (other >= 0) slot.texture = other;
    }
  return materials;
}

/// Which textures a picture reads.
std::vector<std::uint8_t> textures_read(const LitViews& views, std::size_t view) {
  const LitMesh& lit = views.mesh();
  std::vector<std::uint8_t> out(lit.texture_count), known(lit.materials.size());
  for (const RenderFragment& f : views.visibility(view).fragments) {
    const std::uint16_t material = lit.mesh.triangle_material[f.triangle];
    if (std::exchange(known[material], 1)) continue;
    for (const TextureSlot& slot : lit.materials[material].textures)
      if (slot.texture >= 0) out[static_cast<std::size_t>(slot.texture)] = 1;
  }
  return out;
}

double area_of(const Mesh& mesh, std::size_t triangle) {
  const Triangle& t = mesh.triangles[triangle];
  const auto at = [&](std::size_t k) { return to_double(mesh.positions[t[k]]); };
  return length(cross(at(1) - at(0), at(2) - at(0))) / 2;
}

double texels_on(const Mesh& mesh, std::size_t triangle, int texcoord, const TexelMap& map) {
  const std::vector<Vec2f>& uv = texcoord == 0 ? mesh.uv0 : mesh.uv1;
  if (uv.empty() || texcoord > 1) return 0;
  const Triangle& t = mesh.triangles[triangle];
  const Vec2d a = map(uv[t[0]]), b = map(uv[t[1]]), c = map(uv[t[2]]);
  return std::abs((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)) / 2;
}

}  // namespace

double longest_side(const Mesh& mesh) {
  const double side = to_double(bounding_box(mesh.positions)).longest_side();
  return side > 0 ? side : 1;
}

std::vector<LitCamera> cameras_around(const BoundingSphere& bounds, int count, std::uint32_t side_px) {
  std::vector<LitCamera> out;
  for (int v = 0; v < count; ++v)
    out.push_back({perspective_camera(camera_of(v, count, bounds.centre, bounds.radius)), side_px, {}});
  return out;
}

void LitCamera::cut(Picture& picture) const {
  constexpr std::uint32_t kReach = kFilterReach;
  for (std::uint32_t y = 0; y < side_px && !bands.empty(); ++y) {
    const std::uint32_t first = y - std::min(y, kReach), last = std::min(y + kReach, side_px - 1);
    if (!bands[first / kBandPx] || !bands[last / kBandPx])
      std::fill_n(picture.covered.data() + std::size_t{y} * side_px, side_px, 0);
  }
}

LitViews::LitViews(const LitMesh& mesh, const std::vector<LitCamera>& cameras, const RunContext& context)
    : mesh_(&mesh), cameras_(cameras), views_(cameras.size()) {
  const RenderScene scene = render_scene(mesh.mesh, mesh.materials, mesh.texture_count);
  parallel_each(context, cameras.size(), 1, [&](std::size_t v) {
    views_[v] = look(scene, cameras[v].camera, cameras[v].side_px, serial(context), cameras[v].bands);
  });
}

std::uint64_t LitViews::covered_px(std::size_t view) const {
  std::uint64_t count = 0;
  for (std::size_t i = 0; i + 1 < views_[view].first.size(); ++i) count += covered(views_[view], i);
  return count;
}

Picture LitViews::picture(std::size_t view, const std::vector<RenderTexture>& textures,
                          const RenderEnvironment& environment, const RunContext& context) const {
  return shade(render_scene(mesh_->mesh, mesh_->materials, mesh_->texture_count), views_[view], textures,
               environment, context);
}

PictureVariants LitViews::pictures(std::size_t view, const std::vector<const Materials*>& materials,
                                   const std::vector<RenderTexture>& textures,
                                   const RenderEnvironment& environment, const RunContext& context) const {
  return shade_variants(render_scene(mesh_->mesh, mesh_->materials, textures.size()), views_[view], materials,
                        textures, environment, context);
}

std::vector<std::uint8_t> bands_of(const LitViews& views, std::size_t view, std::uint32_t picture_px) {
  constexpr std::uint32_t kCycle = 8, kTogether = 2;  // bands, and those of them that are looked at
  constexpr double kEnoughPx = 16000, kFewer = 0.8;
  const Visibility& seen = views.visibility(view);
  const std::uint32_t bands = (picture_px + kBandPx - 1) / kBandPx;
  std::array<double, kCycle / kTogether> shown{};  // by what is looked at
  double sum = 0;
  for (std::size_t i = 0; i + 1 < seen.first.size(); ++i) {
    if (!covered(seen, i)) continue;
    const std::size_t row = i / seen.side_px * picture_px / seen.side_px;
    shown[row / kBandPx % kCycle / kTogether] += 1;
    sum += 1;
  }
  const double scale = static_cast<double>(picture_px) / seen.side_px;
  if (sum * scale * scale < kEnoughPx) return {};
  std::size_t part = view % shown.size();
  while (shown[part] * static_cast<double>(shown.size()) < kFewer * sum) part = (part + 1) % shown.size();
  std::vector<std::uint8_t> out;
  for (std::uint32_t b = 0; b < bands; ++b) out.push_back(b % kCycle / kTogether == part);
  return out;
}

std::vector<LitCamera> windows_of(const LitViews& views, std::uint32_t picture_px, int per_view,
                                  std::uint32_t side_px) {
  std::vector<LitCamera> out;
  for (std::size_t v = 0; v < views.count(); ++v) {
    const Visibility& view = views.visibility(v);
    std::vector<std::size_t> shown;
    for (std::size_t i = 0; i + 1 < view.first.size(); ++i)
      if (covered(view, i)) shown.push_back(i);
    if (shown.empty()) continue;
    // In raster order, so that the places are spread from top to bottom; by another part of a step in every
    // view.
    for (int k = 0; k < per_view; ++k) {
      const double rank = (k + 0.25 + 0.5 * static_cast<double>(v) / static_cast<double>(views.count())) /
                          per_view * static_cast<double>(shown.size());
      out.push_back(window_at(view, shown[std::min(static_cast<std::size_t>(rank), shown.size() - 1)],
                              side_px, static_cast<double>(side_px) / picture_px));
    }
  }
  return out;
}

LitMeter::LitMeter(const LitViews& views, const std::vector<RenderTexture>& textures,
                   const RenderEnvironment& environment, const RunContext& context)
    : environment_(environment), reference_(views.count()), weights_(views.count()) {
  parallel_each(context, views.count(), 1, [&](std::size_t v) {
    Picture picture = views.picture(v, textures, environment_, serial(context));
    views.camera(v).cut(picture);
    reference_[v] = prepare_flip(picture);
  });
  double sum = 0;
  for (std::size_t v = 0; v < views.count(); ++v)
    sum += weights_[v] =
        static_cast<double>(std::count(reference_[v].covered.begin(), reference_[v].covered.end(), 1));
  for (double& w : weights_) w = sum > 0 ? w / sum : 0;
}

double LitMeter::difference(const LitViews& views, const std::vector<RenderTexture>& textures,
                            const RunContext& context) const {
  std::vector<double> parts(reference_.size());
  parallel_each(context, parts.size(), 1,
                [&](std::size_t v) { parts[v] = part(v, views, v, textures, serial(context)); });
  double sum = 0;
  for (const double p : parts) sum += p;
  return sum;
}

double LitMeter::part(std::size_t view, const LitViews& views, std::size_t made,
                      const std::vector<RenderTexture>& textures, const RunContext& context) const {
  Picture picture = views.picture(made, textures, environment_, context);
  views.camera(made).cut(picture);
  return weights_[view] * compare_flip(reference_[view], picture).mean();
}

std::vector<double> LitMeter::differences(const LitViews& views, const std::vector<RenderTexture>& textures,
                                          std::vector<OtherTextures>&& changes,
                                          const RunContext& context) const {
  std::vector<RenderTexture> all = textures;
  // First the one that most textures of the others are of: they take over what was found of it.
  std::vector<Materials> materials(1, views.mesh().materials);
  for (OtherTextures& change : changes) {
    std::vector<std::int32_t> place(textures.size(), -1);
    for (auto& [t, texture] : change) {
      place.at(t) = static_cast<std::int32_t>(all.size());
      all.push_back(std::move(texture));
    }
    materials.push_back(with_textures(views.mesh().materials, place));
  }
  std::vector<double> sums(changes.size());
  for (std::size_t v = 0; v < reference_.size(); ++v) {
    const std::vector<std::uint8_t> read = textures_read(views, v);
    std::vector<const Materials*> lists(1, &materials.front());
    std::vector<std::size_t> seen;  // the changes that this picture shows
    for (std::size_t k = 0; k < changes.size(); ++k) {
      if (std::ranges::none_of(changes[k], [&](const auto& change) { return read[change.first]; })) continue;
      seen.push_back(k);
      lists.push_back(&materials[k + 1]);
    }
    if (seen.empty()) continue;
    const PictureVariants pictures = views.pictures(v, lists, all, environment_, context);
    parallel_each(context, seen.size(), 1, [&](std::size_t k) {
      sums[seen[k]] += weights_[v] * compare_flip(reference_[v], pictures.picture(k + 1)).mean();
    });
  }
  return sums;
}

Reference::Reference(PackageReader& from, const ExtractBudget& asked, const OutputTransform& placed,
                     TextureSource& textures, const RunContext& run, std::optional<int> shown_by)
    : package(from),
      wishes(asked),
      place(placed),
      context(run),
      side_px(static_cast<std::uint32_t>(std::clamp(asked.display_px, 64.0, 768.0))),
      images(textures.images()) {
  context.progress = nullptr;
  if (wishes.fast()) {
    use_tables(shown_by.value_or(package.manifest().scales.back().scale));
    return;
  }
  source = read_model(scale_file(package, 0, context), mesh_path(0), context);
  const BoundingSphere sphere = sphere_around(source.mesh, "extract");
  light = normal_samples(source.mesh);
  extent = longest_side(source.mesh);
  cameras = cameras_around(sphere, kViews, side_px);
  find_textures();
  find_groups();
  find_alike();
  finest = lit_mesh(source);
  choose_views(
      LitViews(finest, cameras_around(sphere, kViews, wishes.best() ? side_px : side_px / 4), context));
  read_best_textures(textures);
  environment = studio_environment();
  finest_views = std::make_unique<LitViews>(finest, cameras, context);
  finest_windows = std::make_unique<LitViews>(finest, windows, context);
  window_meter = std::make_unique<LitMeter>(*finest_windows, best_textures, environment, context);
  whole_meter = std::make_unique<LitMeter>(*finest_views, best_textures, environment, context);
}

/// What the package says of S_0 without it. The coarsest scale, which takes the least time, shows about the
/// same texels.
void Reference::use_tables(int shown_by) {
  const Manifest& m = package.manifest();
  source = read_model(scale_file(package, shown_by, context), mesh_path(shown_by), context);
  find_alike();
  finest.mesh = std::move(source.mesh);
  const Vec3d size = m.bounds_max - m.bounds_min;
  extent = std::max({size.x, size.y, size.z, 1e-30});
  for (const PackageImage& image : images) {
    const double level =
        display_level(package.tables().planes[image.plane], m.surface_area, m.object_height, side_px);
    texels_per_pixel.push_back(portable::exp(2 * level * portable::log(2)));
    groups.push_back(0);
  }
}

std::int32_t Reference::shown_texture(const Model& model, const TextureRef& reference, TextureUse use) const {
  const std::vector<Vec2f>& uv = reference.texcoord == 0 ? model.mesh.uv0 : model.mesh.uv1;
  if (!reference.used() || reference.texcoord > 1 || uv.empty()) return -1;
  const std::string& name = model.images.at(static_cast<std::size_t>(reference.image)).name;
  for (std::size_t t = 0; t < shown.size(); ++t)
    if (shown[t].srgb == is_srgb(use) && image_name(images[shown[t].image].image) == name)
      return static_cast<std::int32_t>(t);
  return -1;
}

void Reference::find_textures() {
  for (const Material& m : source.materials)
    render_material(m, [&](const TextureRef& reference, TextureUse use) {
      if (reference.texcoord > 1 || shown_texture(source, reference, use) >= 0) return -1;
      for (std::size_t i = 0; i < images.size(); ++i)
        if (image_name(images[i].image) == source.images.at(static_cast<std::size_t>(reference.image)).name)
          shown.push_back({i, is_srgb(use)});
      return -1;
    });
}

/// Images of one material are of one group.
void Reference::find_groups() {
  for (std::size_t i = 0; i < images.size(); ++i) groups.push_back(i);
  for (const Material& m : source.materials) {
    std::vector<std::size_t> together;
    render_material(m, [&](const TextureRef& reference, TextureUse use) {
      const std::int32_t t = shown_texture(source, reference, use);
      if (t >= 0) together.push_back(groups[shown[static_cast<std::size_t>(t)].image]);
      return -1;
    });
    for (std::size_t& g : groups)
      if (std::find(together.begin(), together.end(), g) != together.end()) g = together.front();
  }
}

/// Where a sampler asks for no smaller copies, what is seen is noise that differs with the size of a texture:
/// pictures read such copies.
LitMesh Reference::lit_mesh(Model& model) const {
  LitMesh out;
  out.texture_count = shown.size();
  for (const Material& m : model.materials) {
    out.materials.push_back(render_material(m, [&](const TextureRef& reference, TextureUse use) {
      return shown_texture(model, reference, use);
    }));
    for (TextureSlot& slot : out.materials.back().textures)
      if (slot.min_filter == MinFilter::kLinear) slot.min_filter = MinFilter::kTrilinear;
  }
  out.mesh = std::move(model.mesh);
  return out;
}

/// `small`: what the cameras see in pictures that may be smaller.
void Reference::choose_views(const LitViews& small) {
  const double scale = static_cast<double>(side_px) / small.camera(0).side_px;
  double pixels = 0;
  for (std::size_t v = 0; v < cameras.size(); ++v) {
    pixels += static_cast<double>(small.covered_px(v)) * scale * scale;
    if (!wishes.best()) cameras[v].bands = bands_of(small, v, side_px);
  }
  measure_surface(pixels);
  windows = side_px < 2 * kWindowPx ? cameras : windows_of(small, side_px, kWindowsPerView, kWindowPx);
}

/// Texels that S_0 shows over the pixels that its whole surface has on the screen: four times its mean
/// outline, as if it were convex. `pixels`: of the outlines of all views.
void Reference::measure_surface(double pixels) {
  constexpr std::uint32_t kSide = 256;
  pixels = std::max(4 * pixels / kViews, 1.0);
  for (std::size_t i = 0; i < images.size(); ++i) {
    double covered = 0;
    for (const std::uint8_t bits : shown_texels(i, kSide, kSide)) covered += std::popcount(bits);
    texels_per_pixel.push_back(covered / (kSide * kSide) * images[i].width_px * images[i].height_px / pixels);
  }
}

/// Texels per pixel of an image at full size where the surface faces a camera: nearly all of the surface has
/// as many or more.
double Reference::fewest_texels_per_pixel(std::size_t image) const {
  const RenderCamera& camera = cameras.front().camera;
  const Vec3d centre = to_double(bounding_box(finest.mesh.positions)).centre();
  const double pixel = 2 * camera.tan_half_fov / side_px * length(camera.eye - centre);
  std::vector<std::pair<double, double>> parts;  // texels per pixel, area
  double total = 0;
  for (std::size_t m = 0; m < source.materials.size(); ++m)
    for_each_texture(source.materials[m], [&](const TextureRef& ref) {
      if (!shows(ref, image)) return;
      const TexelMap map(ref.transform, images[image].width_px, images[image].height_px);
      for (std::size_t t = 0; t < finest.mesh.triangles.size(); ++t) {
        if (finest.mesh.triangle_material[t] != m) continue;
        const double area = area_of(finest.mesh, t);
        if (!(area > 0)) continue;
        parts.emplace_back(texels_on(finest.mesh, t, ref.texcoord, map) / area * pixel * pixel, area);
        total += area;
      }
    });
  std::ranges::sort(parts);
  double below = 0;
  for (const auto& [texels, area] : parts)
    if ((below += area) >= kSparse * total) return texels;
  return texels_per_pixel[image];
}

void Reference::read_best_textures(TextureSource& textures) {
  fewest_texels_.assign(images.size(), 0);
  for (const PictureTexture& t : shown) fewest_texels_[t.image] = fewest_texels_per_pixel(t.image);
  std::vector<std::uint32_t> unread;
  for (std::size_t i = 0; i < images.size(); ++i)
    unread.push_back(unread_levels(i, side_px / std::max<double>(wishes.display_px, side_px)));
  textures.leave_unread(std::move(unread));
  for (std::size_t i = 0; i < images.size() && wishes.images != ExtractImages::kPng; ++i)
    if (textures.reads_whole(i))
      textures.set_shown(i, shown_texels(i, images[i].width_px, images[i].height_px));
  for (const PictureTexture& t : shown) {
    const PackageImage& from = images[t.image];
    Pixels pixels = textures.texels(t.image, from.width_px, from.height_px, {}, 0);
    const double share = static_cast<double>(pixels.width_px) / from.width_px;
    best_textures.push_back(
        render_texture(std::move(pixels), t.srgb, unread_levels(t.image, share), context));
  }
}

std::uint32_t Reference::unread_levels(std::size_t image, double share) const {
  std::uint32_t out = 0;
  for (double texels = fewest_texels_[image] * share * share; texels > kFinestShown; texels /= 4) ++out;
  return out;
}

/// Which texels are shown takes a walk over all triangles: once a size for the images of an atlas.
std::vector<std::uint8_t> Reference::shown_texels(std::size_t image, std::uint32_t width_px,
                                                  std::uint32_t height_px) const {
  const std::lock_guard lock(known_texels_->mutex);
  std::vector<std::uint8_t>& bits = known_texels_->bits[{alike_[image], width_px, height_px}];
  if (bits.empty())
    bits = texmesh::shown_texels(finest.mesh, source, images[image].image, width_px, height_px);
  return bits;
}

bool Reference::shows(const TextureRef& ref, std::size_t image) const {
  return ref.used() &&
         source.images.at(static_cast<std::size_t>(ref.image)).name == image_name(images[image].image);
}

void Reference::find_alike() {
  using Way = std::pair<std::size_t, TextureRef>;  // a material, and its reference without the image
  std::vector<std::vector<Way>> ways(images.size());
  for (std::size_t i = 0; i < images.size(); ++i) {
    for (std::size_t m = 0; m < source.materials.size(); ++m)
      for_each_texture(source.materials[m], [&](const TextureRef& ref) {
        if (!shows(ref, i)) return;
        Way way{m, {0, ref.texcoord, ref.wrap_s, ref.wrap_t, false, {}, ref.transform}};
        if (std::ranges::find(ways[i], way) == ways[i].end()) ways[i].push_back(std::move(way));
      });
    alike_.push_back(static_cast<std::size_t>(std::ranges::find(ways, ways[i]) - ways.begin()));
  }
}

std::uint32_t side_of(std::uint32_t full, double share) {
  double side = std::floor(static_cast<double>(full) * share + 0.5);
  if (side >= 8 * kWholeBlocks && side < full) side = std::floor(side / kWholeBlocks + 0.5) * kWholeBlocks;
  return static_cast<std::uint32_t>(
      std::clamp(side, std::min<double>(kLeastSide, full), static_cast<double>(full)));
}

}  // namespace texmesh
