#pragma once
#include <array>

#include "format/base/note.h"
#include "format/base/vec.h"

namespace texmesh {

/// Three indices. In a Mesh they index wedges.
using Triangle = std::array<std::uint32_t, 3>;

/// An indexed triangle mesh with wedges: a *position* is a point in space, a *wedge* is a position together
/// with the attributes it has on one side of a seam. Two triangles share an edge geometrically when they
/// share two positions, and also in texture when they share two wedges. Right-handed, +Y up,
/// counter-clockwise front faces, as glTF.
struct Mesh {
  Vec3d origin;                  // add to a position to get the source's coordinates; object units
  std::vector<Vec3f> positions;  // local frame, object units, finite
  // One for all positions, one per position, or none: the unit in the last place of the coarsest number on a
  // position's way from the source (a float, an integer of a quantisation, a node's transform), object units.
  // None: of a float.
  std::vector<float> rounding;
  std::vector<std::uint32_t> wedge_position;  // per wedge: index into positions
  // Per wedge, each either empty (the mesh has no such attribute) or as long as wedge_position:
  std::vector<Vec2f> uv0, uv1;      // glTF convention, v grows downwards; may lie outside 0..1
  std::vector<Vec3f> normals;       // unit length
  std::vector<Vec4f> colours;       // linear RGBA, 0..1
  std::vector<Vec4f> tangents;      // direction of growing u, unit length, and the sign (w = 1 or -1) of
                                    // cross(normal, tangent) along v, as glTF; all 0 = none here
  std::vector<Triangle> triangles;  // wedge indices
  std::vector<std::uint16_t> triangle_material;  // per triangle: index into Model::materials
  std::vector<std::uint16_t> triangle_part;      // per triangle: index into part_names
  std::vector<std::string> part_names;           // node names of the source; at least one

  std::size_t wedge_count() const { return wedge_position.size(); }
  std::uint32_t position_of(std::uint32_t triangle, int corner) const {
    return wedge_position[triangles[triangle][static_cast<std::size_t>(corner)]];
  }
  friend bool operator==(const Mesh&, const Mesh&) = default;
  static void archive(auto& s, auto& a) {
    a(s.origin, s.positions, s.rounding, s.wedge_position, s.uv0, s.uv1, s.normals, s.colours, s.tangents,
      s.triangles, s.triangle_material, s.triangle_part, s.part_names);
  }
};

enum class Wrap : std::uint8_t { kRepeat = 0, kClamp = 1, kMirror = 2 };
/// How a texture is read where it is shown smaller than it is, as glTF's minFilter. The first part is the
/// filter within a level, the second part the filter between levels; without a second part level 0 alone is
/// read.
enum class Minification : std::uint8_t {
  kLinearMipmapLinear = 0,
  kNearest = 1,
  kLinear = 2,
  kNearestMipmapNearest = 3,
  kLinearMipmapNearest = 4,
  kNearestMipmapLinear = 5
};
enum class AlphaMode : std::uint8_t { kOpaque = 0, kMask = 1, kBlend = 2 };

/// Affine map of a UV before sampling: uv' = offset + rotate(rotation) * (scale *
/// uv), as KHR_texture_transform.
struct UvTransform {
  Vec2f offset{0, 0}, scale{1, 1};
  float rotation = 0;  // radians, counter-clockwise in the extension's sense
  bool is_identity() const { return *this == UvTransform{}; }
  friend bool operator==(const UvTransform&, const UvTransform&) = default;
  static void archive(auto& s, auto& a) { a(s.offset, s.scale, s.rotation); }
};

/// Use of an image by a material.
struct TextureRef {
  std::int32_t image = -1;    // index into Model::images, -1 = none
  std::uint8_t texcoord = 0;  // 0 -> uv0, 1 -> uv1
  Wrap wrap_s = Wrap::kRepeat, wrap_t = Wrap::kRepeat;
  bool nearest = false;  // magnification without interpolation
  Minification minification = Minification::kLinearMipmapLinear;
  UvTransform transform;
  bool used() const { return image >= 0; }
  friend bool operator==(const TextureRef&, const TextureRef&) = default;
  static void archive(auto& s, auto& a) {
    a(s.image, s.texcoord, s.wrap_s, s.wrap_t, s.nearest, s.minification, s.transform);
  }
};

/// A texture of a material extension.
struct ExtensionTexture {
  std::string key;  // as format/model/material_extensions.h lists it
  TextureRef texture;
  float scale = 1;  // of a normal map
  friend bool operator==(const ExtensionTexture&, const ExtensionTexture&) = default;
  static void archive(auto& s, auto& a) { a(s.key, s.texture, s.scale); }
};

/// Numbers of a material extension.
struct ExtensionFactor {
  std::string key;
  std::vector<float> values;
  friend bool operator==(const ExtensionFactor&, const ExtensionFactor&) = default;
  static void archive(auto& s, auto& a) { a(s.key, s.values); }
};

/// A glTF material extension of those that format/model/material_extensions.h lists, with what
/// the source says.
struct MaterialExtension {
  std::string name;
  std::vector<ExtensionFactor> factors;
  std::vector<ExtensionTexture> textures;
  friend bool operator==(const MaterialExtension&, const MaterialExtension&) = default;
  static void archive(auto& s, auto& a) { a(s.name, s.factors, s.textures); }
};

/// The glTF metallic-roughness material with its extensions. Factors are linear.
struct Material {
  std::string name;
  Vec4f base_colour{1, 1, 1, 1};
  float metallic = 1, roughness = 1;
  Vec3f emissive{0, 0, 0};
  float normal_scale = 1, occlusion_strength = 1;
  AlphaMode alpha_mode = AlphaMode::kOpaque;
  float alpha_cutoff = 0.5f;
  bool double_sided = false, unlit = false;
  TextureRef base_colour_texture, metallic_roughness_texture, normal_texture, occlusion_texture,
      emissive_texture;
  std::vector<MaterialExtension> extensions;  // by name
  friend bool operator==(const Material&, const Material&) = default;
  static void archive(auto& s, auto& a) {
    a(s.name, s.base_colour, s.metallic, s.roughness, s.emissive, s.normal_scale, s.occlusion_strength,
      s.alpha_mode, s.alpha_cutoff, s.double_sided, s.unlit, s.base_colour_texture,
      s.metallic_roughness_texture, s.normal_texture, s.occlusion_texture, s.emissive_texture, s.extensions);
  }
};

/// A normal map, or a direction, of the material is given in tangent space.
bool needs_tangents(const Material& material);

/// Calls f with every texture reference of a material, used or not; extensions' after the core's.
void for_each_texture(auto& material, auto&& f) {
  f(material.base_colour_texture);
  f(material.metallic_roughness_texture);
  f(material.normal_texture);
  f(material.occlusion_texture);
  f(material.emissive_texture);
  for (auto& extension : material.extensions)
    for (auto& t : extension.textures) f(t.texture);
}

enum class ImageFormat : std::uint8_t { kJpeg = 0, kPng = 1, kTiff = 2, kWebp = 3, kExr = 4 };

/// An encoded image file. Import has read its header and checked it against the limits; pixels are decoded
/// later by stages/image/decode_image.h.
struct Image {
  std::string name;  // as the source names it; no folder
  ImageFormat format = ImageFormat::kPng;
  std::uint32_t width_px = 0, height_px = 0;
  std::uint8_t channels = 0;          // 1 grey, 2 grey+alpha, 3 RGB, 4 RGBA
  std::uint8_t bits_per_channel = 0;  // 8, 16 or 32 (float)
  bool honour_profile = false;        // colours are converted to sRGB by what the file says of them
  bool accept_damage = false;         // a JPEG that ends early or is corrupt is shown as viewers show it
  std::vector<std::uint8_t> bytes;    // the file
  friend bool operator==(const Image&, const Image&) = default;
  static void archive(auto& s, auto& a) {
    a(s.name, s.format, s.width_px, s.height_px, s.channels, s.bits_per_channel, s.honour_profile,
      s.accept_damage, s.bytes);
  }
};

/// A cylindrical range scan: r(alpha, y), the distance of the surface from the axis of rotation (thesis 2.2).
struct RangeGrid {
  std::uint32_t columns = 0, rows = 0;   // alpha index (periodic when full_turn), y index (top row first)
  std::vector<float> radius;             // rows x columns, object units; <= 0 = no sample
  float alpha_step_rad = 0, y_step = 0;  // spacing; y in object units
  bool full_turn = true;
  std::vector<std::uint32_t> position;  // per sample: index of the mesh position, kNoIndex = none
  friend bool operator==(const RangeGrid&, const RangeGrid&) = default;
  static void archive(auto& s, auto& a) {
    a(s.columns, s.rows, s.radius, s.alpha_step_rad, s.y_step, s.full_turn, s.position);
  }
};

/// What import gives. Every texture reference, material and part index is in range; images nobody
/// uses are gone.
struct Model {
  Mesh mesh;
  std::vector<Material> materials;  // at least one
  std::vector<Image> images;
  RangeGrid range;  // columns == 0 unless the source is a range scan
  Notes notes;
  friend bool operator==(const Model&, const Model&) = default;
  static void archive(auto& s, auto& a) { a(s.mesh, s.materials, s.images, s.range, s.notes); }
};

}  // namespace texmesh
