#pragma once
#include <span>

#include "format/model/model.h"
#include "stages/base/run_context.h"

namespace texmesh {

/// A direction of view: a camera looks along -z at the sphere of radius `radius` around `centre`.
struct ViewCamera {
  Vec3d x, y, z;  // unit vectors: x to the right, y up, z towards the viewer
  Vec3d centre;
  double radius = 1;
};
/// Around S_0. StageError of `stage` where it has no extent.
BoundingSphere sphere_around(const Mesh& finest, const char* stage);
/// The camera that sees the sphere from the direction z, of unit length and not straight up or down.
ViewCamera view_towards(Vec3d z, const BoundingSphere& bounds);
/// The camera of view `index`, 0 <= index < count. The `count` directions are spread evenly over the sphere.
/// The directions are the same for every model.
ViewCamera camera_of(int index, int count, Vec3d centre, double radius);

/// A perspective camera with a square picture.
struct RenderCamera {
  Vec3d eye;                  // in the mesh's local frame
  Vec3d x, y, z;              // unit and orthogonal: x right, y up, z backwards; the camera looks along -z
  double tan_half_fov = 0.3;  // half the picture's height at distance 1
  double near = 0;            // what lies nearer along -z is not seen; > 0, object units
};

inline constexpr double kRenderFovDegrees = 30;  // of the whole picture's height

/// The same direction as `view`, at the distance at which the sphere fills 0.96 of the picture's side. A
/// radius of 0, or one that is not finite, counts as 1.
RenderCamera perspective_camera(const ViewCamera& view, double fov_degrees = kRenderFovDegrees);

/// A camera at `eye` that looks at `target`. `up` need not be orthogonal; where it is parallel to the view or
/// zero another direction serves. `near` as RenderCamera. 0 < fov_degrees < 180.
RenderCamera look_at_camera(Vec3d eye, Vec3d target, Vec3d up, double fov_degrees, double near);

/// What a material reads of a texture, as glTF has it.
enum class TextureUse : std::uint8_t {
  kBaseColour,         // sRGB colour, and alpha as a plain number
  kMetallicRoughness,  // green = roughness, blue = metallic
  kNormal,             // tangent space, +Y up
  kOcclusion,          // red
  kEmissive            // sRGB colour
};
inline constexpr std::size_t kTextureUses = 5;
/// Colours are sRGB encoded; the others are plain numbers.
constexpr bool is_srgb(TextureUse use) {
  return use == TextureUse::kBaseColour || use == TextureUse::kEmissive;
}

enum class MagFilter : std::uint8_t { kNearest, kLinear };
/// kLinear reads level 0 alone, kTrilinear blends two levels. Both are bilinear within a level.
enum class MinFilter : std::uint8_t { kNearest, kLinear, kTrilinear };

/// How a material reads one texture.
struct TextureSlot {
  std::int32_t texture = -1;  // index into the textures that shade() gets, -1 = none
  std::uint8_t uv_set = 0;    // 0 -> Mesh::uv0, 1 -> Mesh::uv1
  Wrap wrap_s = Wrap::kRepeat, wrap_t = Wrap::kRepeat;
  MagFilter mag_filter = MagFilter::kLinear;
  MinFilter min_filter = MinFilter::kTrilinear;
  UvTransform transform;
  bool is_placed_like(const TextureSlot& o) const {
    return uv_set == o.uv_set && wrap_s == o.wrap_s && wrap_t == o.wrap_t && mag_filter == o.mag_filter &&
           min_filter == o.min_filter && transform == o.transform;
  }
};

/// The metallic-roughness material of glTF 2.0. Factors are linear and lie in the ranges that glTF allows.
struct RenderMaterial {
  Vec4f base_colour{1, 1, 1, 1};
  float metallic = 1, roughness = 1;
  Vec3f emissive{0, 0, 0};
  float normal_scale = 1, occlusion_strength = 1;
  AlphaMode alpha_mode = AlphaMode::kOpaque;
  float alpha_cutoff = 0.5f;
  bool double_sided = false;
  bool unlit = false;  // base colour alone, tone-mapped like the rest
  std::array<TextureSlot, kTextureUses> textures;
  TextureSlot& slot(TextureUse use) { return textures[static_cast<std::size_t>(use)]; }
  const TextureSlot& slot(TextureUse use) const { return textures[static_cast<std::size_t>(use)]; }
};

/// The material without its extensions, but for the strength of emission. `texture_of` gives the index of the
/// texture that stands for a used reference, -1 = none. One image may stand for two textures, one sRGB and
/// one plain. All four of glTF's minification filters with mip levels become kTrilinear. Values that are not
/// finite become the defaults of glTF, others are clipped to its ranges.
RenderMaterial render_material(
    const Material& material,
    const std::function<std::int32_t(const TextureRef& reference, TextureUse use)>& texture_of);

/// What is shown. Textures are given later, so that one Visibility serves many qualities of them. The scales
/// of a nest share one Mesh.
struct RenderScene {
  const Mesh* mesh = nullptr;
  const std::vector<Triangle>* triangles = nullptr;  // index the mesh's wedges
  /// Per triangle: index into mesh->triangle_material. Null: the triangle's own index.
  const std::vector<std::uint32_t>* triangle_source = nullptr;
  const std::vector<RenderMaterial>* materials = nullptr;  // as mesh->triangle_material counts them
  std::size_t texture_count = 0;                           // of the textures that shade() will get

  const RenderMaterial& material_of(std::uint32_t triangle) const {
    const std::uint32_t source = triangle_source ? (*triangle_source)[triangle] : triangle;
    return (*materials)[mesh->triangle_material[source]];
  }
};
/// The whole mesh.
RenderScene render_scene(const Mesh& mesh, const std::vector<RenderMaterial>& materials,
                         std::size_t texture_count);

inline constexpr int kSamplesPerSide = 4;  // of a pixel
inline constexpr std::size_t kMaxLayers = 32;

/// One triangle within one pixel. Sample bit 4 row + column of the mask lies at ((column + 0.5) / 4,
/// (row + 0.5) / 4) of the pixel, row 0 on top.
struct RenderFragment {
  std::uint32_t triangle = 0;
  float weight1 = 0, weight2 = 0;  // of corners 1 and 2 at the mean of the covered samples; in perspective
  std::uint16_t mask = 0;          // samples covered and not hidden; not 0
  std::uint8_t layer = 0;          // 1 = mask or blend: what lies behind may show
  std::uint8_t back = 0;           // 1 = seen from behind, double-sided
};

/// What a camera sees of a scene; independent of textures.
struct Visibility {
  std::uint32_t side_px = 0;
  RenderCamera camera;
  /// [side_px * side_px + 1], raster order: fragments first[p] to first[p + 1] belong to pixel p.
  std::vector<std::uint32_t> first;
  /// Of a pixel: layers from near to far, then opaque ones by triangle, whose masks do not overlap.
  std::vector<RenderFragment> fragments;
};

/// Rows of a picture that are looked at together.
inline constexpr std::uint32_t kBandPx = 32;

/// Finds out what is seen on 4 x 4 samples a pixel. Opaque triangles: the nearest a sample, of equal ones the
/// lowest index. Mask and blend: all that no opaque sample hides, ordered by their depth in the pixel, then
/// index; at most the kMaxLayers nearest. Back faces are seen of double-sided materials only. A sample on an
/// edge that two triangles share belongs to one of them. Triangles without area, and those with a corner that
/// is not finite, are not seen. Same bits on every machine and for any thread count.
/// `bands`: by kBandPx rows, 0 = nothing is looked at, as if nothing were there; empty: everything is.
/// std::invalid_argument for a side of 0 or above 8192, a camera that is not finite, and indices of the scene
/// beyond their tables, and for bands of another number.
Visibility look(const RenderScene& scene, const RenderCamera& camera, std::uint32_t side_px,
                const RunContext& context, std::span<const std::uint8_t> bands = {});

}  // namespace texmesh
