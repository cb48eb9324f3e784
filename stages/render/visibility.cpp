
#include <algorithm>
#include <initializer_list>

#include "format/base/portable_math.h"
#include "stages/base/parallel.h"
#include "stages/render/visibility_tile.h"

namespace texmesh {
namespace {

constexpr double kFill = 0.96;  // of the picture's side
constexpr double kNearOfDistance = 1e-3;

double tan_of_half(double degrees) {
  const double half = degrees * portable::kPi / 360;
  return portable::sin(half) / portable::cos(half);
}

float within(float value, float low, float high, float otherwise) {
  if (!std::isfinite(value)) return otherwise;
  return value < low ? low : value > high ? high : value;
}

float emission_strength(const Material& material) {
  for (const MaterialExtension& extension : material.extensions)
    if (extension.name == "KHR_materials_emissive_strength")
      for (const ExtensionFactor& factor : extension.factors)
        if (factor.key == "emissiveStrength" && !factor.values.empty())
          return within(factor.values[0], 0, 1e6f, 1);
  return 1;
}

MinFilter min_filter_of(Minification minification) {
  switch (minification) {
    case Minification::kNearest:
      return MinFilter::kNearest;
    case Minification::kLinear:
      return MinFilter::kLinear;
    default:  // the renderer has one filter with mip levels
      return MinFilter::kTrilinear;
  }
}

UvTransform finite_transform(const UvTransform& t) {
  const bool finite = std::isfinite(t.offset.x) && std::isfinite(t.offset.y) && std::isfinite(t.scale.x) &&
                      std::isfinite(t.scale.y) && std::fabs(t.rotation) <= 1e6f;
  return finite ? t : UvTransform{};
}

constexpr std::uint32_t kMostSide = 8192;

void require(bool held, const char* what) {
  if (!held) throw std::invalid_argument(what);
}

void check_scene(const RenderScene& scene) {
  const Mesh& mesh = *scene.mesh;
  const std::size_t wedges = mesh.wedge_count(), triangles = scene.triangles->size();
  require(!scene.triangle_source || scene.triangle_source->size() == triangles,
          "look: a triangle has no source");
  for (const std::uint32_t p : mesh.wedge_position)
    require(p < mesh.positions.size(), "look: a wedge's position is beyond the mesh");
  for (std::size_t t = 0; t < triangles; ++t) {
    for (const std::uint32_t wedge : (*scene.triangles)[t])
      require(wedge < wedges, "look: a triangle's wedge is beyond the mesh");
    const std::size_t source = scene.triangle_source ? (*scene.triangle_source)[t] : t;
    require(
        source < mesh.triangle_material.size() && mesh.triangle_material[source] < scene.materials->size(),
        "look: a triangle's material is beyond the materials");
  }
}

void check_camera(const RenderCamera& camera) {
  double sum = camera.tan_half_fov + camera.near;
  for (const Vec3d& v : {camera.eye, camera.x, camera.y, camera.z}) sum += v.x + v.y + v.z;
  require(std::isfinite(sum) && camera.tan_half_fov > 0 && camera.near > 0, "look: no camera");
}

/// The triangles of every tile by rising index: those of tile i stand from first[i] on.
struct Bins {
  std::vector<std::size_t> first;
  std::vector<std::uint32_t> triangles;
};

void for_each_tile(const SampleBox& box, std::uint32_t tiles, auto f) {
  if (box.empty()) return;
  constexpr auto kSide = static_cast<std::int32_t>(kTileSamples);
  for (std::int32_t y = box.y_first / kSide; y <= box.y_last / kSide; ++y)
    for (std::int32_t x = box.x_first / kSide; x <= box.x_last / kSide; ++x)
      f(static_cast<std::size_t>(y) * tiles + static_cast<std::size_t>(x));
}

/// Those that nobody looks at stay empty.
Bins sorted_into_tiles(const std::vector<SampleBox>& boxes, std::uint32_t tiles,
                       std::span<const std::uint8_t> bands) {
  Bins bins;
  bins.first.assign(static_cast<std::size_t>(tiles) * tiles + 1, 0);
  for (const SampleBox& box : boxes) for_each_tile(box, tiles, [&](std::size_t i) { ++bins.first[i + 1]; });
  const auto looks_at = [&](std::size_t tile) { return bands.empty() || bands[tile / tiles] != 0; };
  for (std::size_t i = 0; i + 1 < bins.first.size(); ++i)
    if (!looks_at(i)) bins.first[i + 1] = 0;
  for (std::size_t i = 1; i < bins.first.size(); ++i) bins.first[i] += bins.first[i - 1];
  bins.triangles.resize(bins.first.back());
  std::vector<std::size_t> next(bins.first.begin(), bins.first.end() - 1);
  for (std::uint32_t t = 0; t < boxes.size(); ++t)
    for_each_tile(boxes[t], tiles, [&](std::size_t i) {
      if (looks_at(i)) bins.triangles[next[i]++] = t;
    });
  return bins;
}

TileInput tile_input(const RenderScene& scene, const RenderCamera& camera, std::uint32_t side_px,
                     const RunContext& context) {
  TileInput input{&scene, SampleFrame(camera, side_px), camera.near, side_px, {}, {}, true};
  input.seen.resize(scene.mesh->positions.size());
  parallel_for(context, input.seen.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i)
      input.seen[i] = seen_from(camera, input.frame, scene.mesh->positions[i]);
  });
  input.boxes.resize(scene.triangles->size());
  parallel_for(context, input.boxes.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const auto triangle = static_cast<std::uint32_t>(t);
      const std::array<Vec3d, 3> corners = input.corners_of(triangle);
      const EdgePlanes planes = edge_planes(corners);
      if (planes.visible && (planes.front || scene.material_of(triangle).double_sided))
        input.boxes[t] = sample_box(corners, input.frame, camera.near);
    }
  });
  return input;
}

/// Corners and boxes of triangles are gone when tiles are joined: 100,000 triangles have 5 MB of them.
std::vector<TileFragments> look_into_tiles(const RenderScene& scene, const RenderCamera& camera,
                                           std::uint32_t side_px, std::uint32_t tiles,
                                           std::span<const std::uint8_t> bands, const RunContext& context) {
  const TileInput input = tile_input(scene, camera, side_px, context);
  const Bins bins = sorted_into_tiles(input.boxes, tiles, bands);
  std::vector<TileFragments> parts(bins.first.size() - 1);
  parallel_for(context, parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const auto tile = static_cast<std::uint32_t>(i);
      parts[i] = look_into_tile(input, tile % tiles, tile / tiles,
                                {bins.triangles.data() + bins.first[i], bins.first[i + 1] - bins.first[i]});
    }
  });
  return parts;
}

/// Puts the pixels of all tiles into raster order. Tiles are empty behind it.
void join_tiles(std::vector<TileFragments>& parts, std::uint32_t tiles, const RunContext& context,
                Visibility& out) {
  const std::size_t side = out.side_px;
  auto part_of = [&](std::size_t x, std::size_t y) -> const TileFragments& {
    return parts[y / kTilePx * tiles + x / kTilePx];
  };
  out.first.assign(side * side + 1, 0);
  for (std::size_t y = 0; y < side; ++y)
    for (std::size_t x = 0; x < side; ++x)
      out.first[y * side + x + 1] =
          out.first[y * side + x] + part_of(x, y).count[y % kTilePx * kTilePx + x % kTilePx];
  out.fragments.resize(out.first.back());
  parallel_for(context, parts.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      auto from = parts[i].fragments.begin();
      for (std::size_t p = 0; p < parts[i].count.size(); ++p) {
        const std::size_t x = i % tiles * kTilePx + p % kTilePx, y = i / tiles * kTilePx + p / kTilePx;
        if (x >= side || y >= side) continue;
        const auto count = static_cast<std::ptrdiff_t>(parts[i].count[p]);
        std::copy(from, from + count,
                  out.fragments.begin() + static_cast<std::ptrdiff_t>(out.first[y * side + x]));
        from += count;
      }
      parts[i] = {};
    }
  });
}

}  // namespace

ViewCamera camera_of(int index, int count, Vec3d centre, double radius) {
  // A Fibonacci lattice on the sphere, starting a little to the side of the front.
  const double golden = portable::kPi * (3 - std::sqrt(5.0));
  const double height = count == 1 ? 0.2 : 1 - 2 * (index + 0.5) / count,
               ring = std::sqrt(1 - height * height);
  const double angle = 0.4 + golden * index;
  ViewCamera camera;
  camera.z = {ring * portable::sin(angle), height, ring * portable::cos(angle)};
  camera.x = normalized(cross(Vec3d{0, 1, 0}, camera.z));
  camera.y = cross(camera.z, camera.x);
  camera.centre = centre;
  camera.radius = radius;
  return camera;
}

RenderCamera perspective_camera(const ViewCamera& view, double fov_degrees) {
  const double radius = std::isfinite(view.radius) && view.radius > 0 ? view.radius : 1;
  RenderCamera camera;
  camera.x = view.x, camera.y = view.y, camera.z = view.z;
  camera.tan_half_fov = tan_of_half(fov_degrees);
  // The rays that touch the sphere have the tangent radius / sqrt(distance^2 - radius^2).
  const double tangent = kFill * camera.tan_half_fov;
  const double distance = radius * std::sqrt(1 + 1 / (tangent * tangent));
  camera.eye = view.centre + view.z * distance;
  camera.near = distance * kNearOfDistance;
  return camera;
}

RenderCamera look_at_camera(Vec3d eye, Vec3d target, Vec3d up, double fov_degrees, double near) {
  RenderCamera camera;
  camera.eye = eye;
  camera.z = normalized(eye - target);
  if (!(length(camera.z) > 0)) camera.z = {0, 0, 1};
  for (const Vec3d direction : {normalized(up), Vec3d{0, 1, 0}, Vec3d{0, 0, -1}}) {
    camera.x = cross(direction, camera.z);
    if (length(camera.x) > 1e-9) break;
  }
  camera.x = normalized(camera.x);
  camera.y = cross(camera.z, camera.x);
  camera.tan_half_fov = tan_of_half(fov_degrees);
  camera.near = near;
  return camera;
}

RenderMaterial render_material(const Material& material,
                               const std::function<std::int32_t(const TextureRef&, TextureUse)>& texture_of) {
  constexpr float kMost = 1e6f;
  RenderMaterial out;
  const Vec4f c = material.base_colour;
  out.base_colour = {within(c.x, 0, 1, 1), within(c.y, 0, 1, 1), within(c.z, 0, 1, 1), within(c.w, 0, 1, 1)};
  out.metallic = within(material.metallic, 0, 1, 1);
  out.roughness = within(material.roughness, 0, 1, 1);
  for (int k = 0; k < 3; ++k)
    out.emissive[k] = within(material.emissive[k], 0, 1, 0) * emission_strength(material);
  out.normal_scale = within(material.normal_scale, -kMost, kMost, 1);
  out.occlusion_strength = within(material.occlusion_strength, 0, 1, 1);
  out.alpha_mode = material.alpha_mode;
  out.alpha_cutoff = within(material.alpha_cutoff, 0, kMost, 0.5f);
  out.double_sided = material.double_sided;
  out.unlit = material.unlit;
  const TextureRef* refs[kTextureUses] = {&material.base_colour_texture, &material.metallic_roughness_texture,
                                          &material.normal_texture, &material.occlusion_texture,
                                          &material.emissive_texture};
  for (std::size_t use = 0; use < kTextureUses; ++use) {
    const TextureRef& ref = *refs[use];
    if (!ref.used()) continue;
    TextureSlot& slot = out.textures[use];
    slot.texture = texture_of(ref, static_cast<TextureUse>(use));
    slot.uv_set = ref.texcoord;
    slot.wrap_s = ref.wrap_s;
    slot.wrap_t = ref.wrap_t;
    slot.mag_filter = ref.nearest ? MagFilter::kNearest : MagFilter::kLinear;
    slot.min_filter = min_filter_of(ref.minification);
    slot.transform = finite_transform(ref.transform);
  }
  return out;
}

RenderScene render_scene(const Mesh& mesh, const std::vector<RenderMaterial>& materials,
                         std::size_t texture_count) {
  return {&mesh, &mesh.triangles, nullptr, &materials, texture_count};
}

Visibility look(const RenderScene& scene, const RenderCamera& camera, std::uint32_t side_px,
                const RunContext& context, std::span<const std::uint8_t> bands) {
  static_assert(kBandPx == kTilePx);
  require(side_px > 0 && side_px <= kMostSide, "look: a picture has 1 to 8192 pixels a side");
  check_camera(camera);
  check_scene(scene);
  const std::uint32_t tiles = (side_px + kTilePx - 1) / kTilePx;
  require(bands.empty() || bands.size() == tiles, "look: as many bands as the picture has");
  std::vector<TileFragments> parts = look_into_tiles(scene, camera, side_px, tiles, bands, context);
  Visibility out;
  out.side_px = side_px;
  out.camera = camera;
  join_tiles(parts, tiles, context, out);
  return out;
}

}  // namespace texmesh
